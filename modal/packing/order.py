"""Find crystalline order among equal spheres, which overcompression and flat walls favour.

The neighbourhood of a sphere is described by the vector of spherical harmonics of degree 6,
averaged over its neighbours. Two neighbours whose vectors nearly agree are joined by a solid bond,
and a sphere with many such bonds sits in a crystal (ten Wolde, Ruiz-Montero, Frenkel, J. Chem.
Phys. 104, 9932, 1996). FCC and HCP are not distinguished; a random packing has a few such spheres
by chance.
"""

from collections.abc import Iterator
from math import factorial

import numpy as np
from numpy.polynomial.legendre import Legendre

from modal.packing.neighbours import periodic_pairs
from modal.packing.network import Network
from modal.tools.arrays import Bools, Complex, Floats

NEIGHBOUR_DISTANCE = 1.3
"""Largest distance of neighbours, diameters: between first and second shell of FCC (1 and 1.41)."""
MIN_COSINE = 0.7
"""Least cosine of the angle between the vectors of two neighbours whose bond is solid."""
MIN_SOLID_BONDS = 7
"""Least number of solid bonds of a crystalline sphere; an inner sphere of a crystal has 12."""
BONDS_PER_PART = 1_000_000
"""Number of bonds that are computed together, which bounds the memory."""
DEGREE = 6
"""Degree of the spherical harmonics; it is even: a bond looks the same from both ends."""


def crystalline(network: Network) -> Bools:
    """Return which spheres (n,) have crystalline surroundings, in a cell periodic along x and y.

    Walls do not count as neighbours: a sphere of an FCC layer at a wall has 8 or 9 solid bonds.
    """
    return network.cached("crystalline", lambda: _crystalline(network))


def _crystalline(network: Network) -> Bools:
    """Find crystalline spheres as `crystalline` does, without the cache."""
    n = network.n_particles
    side = network.cell_size[:2]
    position = network.position.copy()
    position[:, :2] %= side
    reach = NEIGHBOUR_DISTANCE * 2 * float(network.radius.mean())
    i, j, shift = periodic_pairs(position, side, reach)
    parts = [slice(first, first + BONDS_PER_PART) for first in range(0, len(i), BONDS_PER_PART)]
    vector = np.zeros((n, DEGREE + 1), complex)
    # Centres that coincide through a period, in too narrow a cell, have no direction and no bond.
    coincide = np.zeros(len(i), bool)
    for part in parts:
        branch = position[j[part]] + shift[part] * np.array([*side, 0.0]) - position[i[part]]
        length = np.linalg.norm(branch, axis=1)
        coincide[part] = length == 0
        length[coincide[part]] = np.inf
        for m, harmonic in enumerate(_harmonics(branch / length[:, None])):
            harmonic[coincide[part]] = 0
            for end in (i[part], j[part]):
                vector.real[:, m] += np.bincount(end, harmonic.real, n)
                vector.imag[:, m] += np.bincount(end, harmonic.imag, n)
    size = np.linalg.norm(vector, axis=1)
    vector /= np.where(size > 0, size, 1)[:, None]
    # A cosine is real: the scalar product of real and imaginary parts.
    real_vector = vector.view(float)
    solid_bonds = np.zeros(n, int)
    for part in parts:
        cosine = np.einsum("bk,bk->b", real_vector[i[part]], real_vector[j[part]])
        solid = (cosine > MIN_COSINE) & ~coincide[part]
        for end in (i[part], j[part]):
            solid_bonds += np.bincount(end[solid], minlength=n)
    return solid_bonds >= MIN_SOLID_BONDS


def _harmonics(direction: Floats) -> Iterator[Complex]:
    """Yield Y_6m (b,), for m = 0 to 6, of unit vectors (b, 3), up to a common factor.

    Y_6m with a negative m is the conjugate of the one with -m. The functions with m > 0 therefore
    have an additional factor sqrt(2).
    """
    x, y, z = direction.T
    power: Complex = np.ones(len(z), complex)
    for m in range(DEGREE + 1):
        multiplicity = 2 if m else 1
        scale = np.sqrt(multiplicity * factorial(DEGREE - m) / factorial(DEGREE + m))
        yield scale * Legendre.basis(DEGREE).deriv(m)(z) * power
        power *= x + 1j * y
