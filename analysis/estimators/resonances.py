"""The standing waves sin(pi r z / L) among the modes of a disordered packing (Fig. 10, Table 2).

A crystal's P resonances are pure. In a random packing the r-th standing wave is shared by many
modes; its share in mode i is <e_r|i>^2, with e_r the pattern of all force-bearing spheres,
normalised in the mass. The r-th resonance is the mode with the largest share, which is what a
reader of mode shapes would choose, with the share as the measure of how far it is one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.estimators.structure_factor import standing_waves
from modal.modes.mode_set import ModeSet
from modal.packing.network import Network
from modal.stiffness.matrices import mass_diagonal

LEAST_SHARE = 0.25
"""Below it the standing wave belongs to no mode."""
HIGHEST_ORDER = 40


@dataclass(frozen=True)
class Standing:
    """Of r = 1 ... R: frequency (R,) Hz, share (R,) of the pattern, row (R,) in the mode set."""

    frequency: np.ndarray
    share: np.ndarray
    row: np.ndarray


def standing_modes(modes: ModeSet, network: Network) -> Standing:
    """The resonances r = 1, 2, ... up to the first that no mode bears; needs the modes' shapes."""
    orders = np.arange(1, HIGHEST_ORDER + 1)
    pattern = standing_waves(network, orders) * np.sqrt(mass_diagonal(network))[:, None]
    share = (modes.mode_shape.reshape(len(modes.frequency), -1) @ pattern) ** 2
    row = np.argmax(share, axis=0)
    largest = share[row, np.arange(len(orders))]
    lost = np.flatnonzero(largest < LEAST_SHARE)
    kept = slice(0, lost[0] if len(lost) else len(orders))
    return Standing(modes.frequency[row[kept]], largest[kept], row[kept])


def mode_velocities(frequency: np.ndarray, wavenumber: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Phase and group velocity (k,) m/s of resonances: frequency (k,) Hz, kappa (k,) rad/m."""
    omega = 2 * np.pi * np.asarray(frequency)
    return omega / wavenumber, np.gradient(omega, wavenumber)
