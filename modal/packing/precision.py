"""Overlaps that are known to few digits: how well, and what that leaves of a packing.

Positions that were rounded when they were written move each overlap by a random amount. Sums over
many contacts, as velocities and moduli are, hardly feel it; a single low mode, which hangs on the
weakest places, does: of 3,000 spheres at 100 kPa an error of 1e-3 of the overlaps moves V_P by less
than 1e-5 and one of the lowest eight modes by 2 %.
"""

import numpy as np

from modal.packing.network import Network
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError

OVERLAP_ERROR = "overlap_error"
"""Note of a network: root mean square error of its overlaps over their median."""
NOTED_OVERLAP_ERROR = 1e-4
"""From which it is noted: below, single modes of a packing are right to three digits."""
MAX_OVERLAP_ERROR_OF_MODES = 1e-3
"""Above, lists of single modes are refused: they would be off by more than 2 %."""
MAX_OVERLAP_ERROR = 0.3
"""Above, no number is given: one contact in ten is lost or was none, V_P is off by 4 %."""


def overlap_error(network: Network) -> float:
    """Return the error of the overlaps over their median, 0 where they are exact."""
    return network.noted(OVERLAP_ERROR) or 0.0


def refuse_few_digits(network: Network) -> None:
    """Raise InputError where overlaps are not known well enough for single modes."""
    error = overlap_error(network)
    if error > MAX_OVERLAP_ERROR_OF_MODES:
        raise UnavailableError(
            "too_few_digits",
            f"overlaps are known to {error:.1%} alone, by the digits of positions",
            "single modes "
            "would be off by several percent; write positions with more digits (17 are all), or "
            "contacts with their forces, and import them again",
            "moduli, wave, density and measure take this packing",
        )


def taken_as_exact(network: Network) -> Network:
    """Return the network without the note on its digits, for who counts their error by himself."""
    if OVERLAP_ERROR not in network.study:
        return network
    copy = network.unchecked()
    del copy.study[OVERLAP_ERROR]  # its own notes, which no one else has seen yet
    return copy


def with_perturbed_overlaps(network: Network, random: np.random.Generator) -> Network:
    """Return the network whose overlaps are off once more by as much as they are already.

    Stiffnesses follow as the contacts' law says, which is told by force over stiffness times
    overlap: k goes as overlap^p with 1 / (1 + p) that ratio. Contacts that open are left out; those
    that close cannot be known.
    """
    overlap = network.require("overlap", "error by the digits of positions")
    force = network.require("force_normal", "error by the digits of positions")
    pressed = np.flatnonzero((overlap > 0) & (force > 0) & (network.stiffness_normal > 0))
    growth = np.zeros(len(overlap))
    growth[pressed] = (network.stiffness_normal * overlap)[pressed] / force[pressed] - 1
    size = overlap_error(network) * float(np.median(overlap[pressed]))
    moved = overlap + size * random.standard_normal(len(overlap))
    kept = (moved > 0) | ~np.isin(np.arange(len(overlap)), pressed)
    ratio: Floats = np.ones(len(overlap))
    shared = pressed[kept[pressed]]
    ratio[shared] = (moved[shared] / overlap[shared]) ** growth[shared]
    stiffnesses = {
        name: ratio * getattr(network, name)
        for name in ("stiffness_normal", "stiffness_tangential")
    }
    return taken_as_exact(network).unchecked(**stiffnesses).some(kept)
