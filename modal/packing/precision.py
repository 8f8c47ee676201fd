"""Handle overlaps that are known to few digits.

Positions that were rounded when they were written change each overlap by a random amount.
Velocities and moduli, which are sums over many contacts, hardly change; a single low mode, which
depends on the weakest places, does: in a packing of 3,000 spheres at 100 kPa an error of 1e-3 of
the overlaps changes V_P by less than 1e-5 and one of the lowest eight modes by 2 %.
"""

import numpy as np

from modal.packing.network import Network
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError

OVERLAP_ERROR = "overlap_error"
"""Name of the note in a network: root mean square error of its overlaps divided by their median."""
NOTED_OVERLAP_ERROR = 1e-4
"""Smallest error of overlaps that is noted in a network; with a smaller one, single modes of a
packing are right to three digits."""
MAX_OVERLAP_ERROR_OF_MODES = 1e-3
"""Largest error of overlaps with which single modes are listed; with a larger one they would be
wrong by more than 2 %."""
MAX_OVERLAP_ERROR = 0.3
"""Largest error of overlaps with which any number is given; with this one, one contact in ten is
lost or false, and V_P is wrong by 4 %."""


def overlap_error(network: Network) -> float:
    """Return the error of the overlaps divided by their median; 0 if they are exact."""
    return network.noted(OVERLAP_ERROR) or 0.0


def refuse_few_digits(network: Network) -> None:
    """Raise UnavailableError if overlaps are not known well enough for single modes."""
    error = overlap_error(network)
    if error > MAX_OVERLAP_ERROR_OF_MODES:
        raise UnavailableError(
            "too_few_digits",
            f"overlaps are known to {error:.1%} alone, by the digits of positions",
            "single modes would be off by several percent",
            "write positions with more digits (17 are all), or contacts with their forces, and "
            "import them again; moduli, wave, density and measure take this packing",
        )


def taken_as_exact(network: Network) -> Network:
    """Return the network without its note, for callers that compute the error themselves."""
    if OVERLAP_ERROR not in network.study:
        return network
    copy = network.unchecked()
    del copy.study[OVERLAP_ERROR]  # a new dict, which nobody else has
    return copy


def with_perturbed_overlaps(network: Network, random: np.random.Generator) -> Network:
    """Return the network with its overlaps changed once more by random errors of the same size.

    Stiffnesses follow the contact law: k is proportional to overlap^p, where p follows from the
    ratio 1 / (1 + p) of force to stiffness times overlap. Contacts that open are left out; those
    that close cannot be known. UnavailableError if forces or overlaps are absent.
    """
    overlap = network.require("overlap", "error by the digits of positions")
    force = network.require("force_normal", "error by the digits of positions")
    pressed = np.flatnonzero((overlap > 0) & (force > 0) & (network.stiffness_normal > 0))
    exponent = np.zeros(len(overlap))
    exponent[pressed] = (network.stiffness_normal * overlap)[pressed] / force[pressed] - 1
    size = overlap_error(network) * float(np.median(overlap[pressed]))
    perturbed = overlap + size * random.standard_normal(len(overlap))
    remains = (perturbed > 0) | ~np.isin(np.arange(len(overlap)), pressed)
    factor: Floats = np.ones(len(overlap))
    changed = pressed[remains[pressed]]
    factor[changed] = (perturbed[changed] / overlap[changed]) ** exponent[changed]
    exact = taken_as_exact(network).unchecked(
        stiffness_normal=factor * network.stiffness_normal,
        stiffness_tangential=factor * network.stiffness_tangential,
    )
    return exact.some(remains)
