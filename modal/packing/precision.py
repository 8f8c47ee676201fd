"""Handle overlaps that are known to few digits, or not at all.

Positions that were rounded when they were written change each overlap by a random amount.
Velocities and moduli, which are sums over many contacts, hardly change; a single low mode, which
depends on the weakest places, changes more: in a packing of 3,000 spheres at 100 kPa an error of
1e-3 of the overlaps changes V_P by less than 1e-5 and one of the lowest eight modes by 2 %. For
spheres from a scan (`modal.packing.scan`) no overlap is known at all.
"""

from collections.abc import Iterator

import numpy as np

from modal.packing.network import Network
from modal.packing.scan import TOLERANCE, Scan, alternatives
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
PERTURBED_PACKINGS = 3
"""Number of packings with perturbed overlaps: each costs as much as what is computed of it."""
SEED = 1
"""Seed of the perturbations, so that a packing has the same error each time."""
MAX_OVERLAP_ERROR = 0.3
"""Largest error of overlaps with which any number is given; with this one, one contact in ten is
lost or false, and V_P is wrong by 4 %."""


def overlap_error(network: Network) -> float:
    """Return the error of the overlaps divided by their median; 0 if the overlaps are exact."""
    return network.noted(OVERLAP_ERROR) or 0.0


def is_scanned(network: Network) -> bool:
    """Return whether contacts and stiffnesses of a network are guessed from gaps and the stress."""
    return Scan.of(network.study) is not None


def is_exact(network: Network) -> bool:
    """Return whether the overlaps of a network are known exactly."""
    return not overlap_error(network) and not is_scanned(network)


def other_packings(network: Network) -> Iterator[Network]:
    """Yield packings that are as likely as the given one; their scatter gives errors.

    The packings have perturbed overlaps or, for a scan, other tolerances and forces. None is
    yielded if overlaps are known exactly.
    """
    if is_scanned(network):
        for other in alternatives(network):
            yield taken_as_exact(other)
    elif overlap_error(network):
        random = np.random.default_rng(SEED)
        for _ in range(PERTURBED_PACKINGS):
            yield with_perturbed_overlaps(network, random)


def refuse_few_digits(network: Network) -> None:
    """Raise UnavailableError if overlaps are not known well enough for single modes."""
    if is_scanned(network):
        raise UnavailableError(
            "scanned_packing",
            "contacts and stiffnesses are guessed from gaps and the stress",
            "no single mode follows from them",
            "bring the spheres to rest under the stress (`relax --stress`); moduli, wave, density "
            "and measure take this packing",
        )
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
    """Return the network without its notes on errors, for callers that compute the error."""
    notes = [name for name in (OVERLAP_ERROR, TOLERANCE) if name in network.study]
    if not notes:
        return network
    copy = network.unchecked()
    for name in notes:
        del copy.study[name]  # of a new dict, which nobody else has
    return copy


def with_perturbed_overlaps(network: Network, random: np.random.Generator) -> Network:
    """Return the network with its overlaps changed by further random errors of the same size.

    Stiffnesses follow the contact law: k is proportional to overlap^p, where p follows from the
    ratio 1 / (1 + p) of force to stiffness times overlap. Contacts that open are left out; contacts
    that would close are not known. UnavailableError if forces or overlaps are absent.
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
