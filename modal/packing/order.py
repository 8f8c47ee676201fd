"""Crystalline order among equal spheres, which overcompression and flat walls invite.

Each sphere's neighbourhood is a vector of the spherical harmonics of degree 6, averaged over its
neighbours. Two neighbours whose vectors nearly agree are joined by a solid bond, and a sphere with
many such bonds sits in a crystal (ten Wolde, Ruiz-Montero, Frenkel, J. Chem. Phys. 104, 9932,
1996). FCC and HCP count alike; a random packing has a few such spheres by chance.
"""

from math import factorial

import numpy as np
from numpy.polynomial.legendre import Legendre

from modal.packing.neighbours import periodic_pairs
from modal.packing.network import Network
from modal.tools.arrays import Bools, Complex

REACH = 1.3
"""Distance of neighbours, diameters: between first and second shell of FCC (1 and 1.41)."""
AGREEMENT = 0.7
"""Cosine of the angle between two neighbours' vectors from which their bond is solid."""
SOLID_BONDS = 7
"""Solid bonds from which a sphere is crystalline; an inner sphere of a crystal has 12."""

TOGETHER = 1_000_000
"""Bonds that are looked at together, which bounds the memory."""


def crystalline(network: Network) -> Bools:
    """Shape (n,) bool: spheres in crystalline surroundings, in a cell with periods along x and y.

    The walls count for nothing: a sphere of an FCC layer at a wall has 8 or 9 solid bonds.
    """
    return network.cached("crystalline", lambda: _crystalline(network))


def _crystalline(network: Network) -> Bools:
    side, n = network.cell_size[:2], network.n_particles
    position = network.position.copy()
    position[:, :2] %= side
    reach = REACH * 2 * float(network.radius.mean())
    i, j, shift = periodic_pairs(position, side, reach)
    parts = [slice(first, first + TOGETHER) for first in range(0, len(i), TOGETHER)]
    vector = np.zeros((n, 7), complex)
    for part in parts:
        here, there = i[part], j[part]
        branch = position[there] + shift[part] * np.array([*side, 0.0]) - position[here]
        x, y, z = (branch / np.linalg.norm(branch, axis=1)[:, None]).T
        turned: Complex = np.ones(len(z), complex)
        for m in range(7):
            # Y_6m up to a common factor; those of negative m are conjugates: a factor 2.
            scale = np.sqrt((2 if m else 1) * factorial(6 - m) / factorial(6 + m))
            value = scale * Legendre.basis(6).deriv(m)(z) * turned
            turned *= x + 1j * y
            for end in (here, there):  # degree 6 is even: a bond looks the same from both ends
                vector.real[:, m] += np.bincount(end, value.real, n)
                vector.imag[:, m] += np.bincount(end, value.imag, n)
    size = np.linalg.norm(vector, axis=1)
    vector /= np.where(size > 0, size, 1)[:, None]
    # A cosine is real: the scalar product of real and imaginary parts.
    bonds, parts_of = np.zeros(n, int), vector.view(float)
    for part in parts:
        here, there = i[part], j[part]
        solid = np.einsum("bk,bk->b", parts_of[here], parts_of[there]) > AGREEMENT
        bonds += np.bincount(here[solid], minlength=n) + np.bincount(there[solid], minlength=n)
    return bonds >= SOLID_BONDS
