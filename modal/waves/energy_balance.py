"""Balance the energy of a wave run with the work of its source wall."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_type_hints

import numpy as np

from modal.packing.network import Network

ROUNDINGS = 10
"""Largest drift by round-off, in units of the work that one rounding of all positions does. Whole
runs showed up to 3."""
MAX_GAP = 1e-3
"""Largest gap of the balance of a run in which contacts slid, divided by the source wall's work."""
OPTIONAL_FIELDS = {"work", "gap"}
"""Fields that files of earlier versions lack."""


@dataclass(frozen=True)
class EnergyBalance:
    """The energy of a wave run, from the end of the pulse to the end of the record.

    Attributes
    ----------
    energy : float
        Energy of the wave after the pulse, J.
    drift : float
        Change, after the pulse, of the kinetic energy plus the energy stored in contacts, divided
        by `energy`.
    friction : float
        Energy that sliding has dissipated after the pulse, divided by `energy`.
    contacts, opened, slid : int
        Number of contacts at the start, and numbers of contacts that opened and that slid.
    limit : float
        Largest drift that the time step explains. NaN if contacts slid: sliding also releases
        energy of the state at rest, so that the drift has no bound.
    work : float
        Work of the source wall, J.
    gap : float
        Kinetic and elastic energy at the end, plus all energy that sliding has dissipated since the
        start, minus `work`, divided by `work`.

    `work` and `gap` are NaN in files of earlier versions. In these files `friction` comes from the
    contact law itself, which omits the slip of contacts that only lose normal force.
    """

    energy: float
    drift: float
    friction: float
    contacts: int
    opened: int
    slid: int
    limit: float
    work: float = math.nan
    gap: float = math.nan

    @property
    def closes(self) -> bool:
        """Whether drift and gap are within their limits; True if neither has a limit."""
        max_gap = MAX_GAP
        if not math.isnan(self.limit):
            max_gap = max(MAX_GAP, self.limit)
        return not (abs(self.drift) > self.limit or abs(self.gap) > max_gap)

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the group `balance` of a signals file."""
        return vars(self) | {"kept": self.closes}

    @staticmethod
    def of_attributes(attributes: Mapping[str, Any]) -> EnergyBalance | None:
        """Return the balance in a file's attributes; None if an early file has none."""
        types = get_type_hints(EnergyBalance)
        if not types.keys() - OPTIONAL_FIELDS <= attributes.keys():
            return None
        present = types.keys() & attributes.keys()
        return EnergyBalance(**{name: types[name](attributes[name]) for name in present})


def drift_limit(network: Network, fraction: float, amplitude: float, energy: float) -> float:
    """Return the largest relative change of the energy that time step and round-off explain.

    In a linear system the leapfrog scheme exactly conserves the elastic energy plus the kinetic
    energy from the product of the velocities half a step before and after. The drift comes from the
    change of stiffness, which is of the relative size 2A divided by the overlap, and decreases as
    (omega dt / 2)^2. `fraction` is the time step divided by the longest stable one, 2 / omega_max,
    so that omega dt / 2 is at most `fraction`. A position of size L is rounded by eps L; the
    contact force does work over this distance, of random sign, in each of the contacts. The
    `amplitude` A is in m, the `energy` of the wave in J.
    """
    purpose = "limit of the energy drift"
    overlap = network.require("overlap", purpose)
    force = float(abs(network.require("force_normal", purpose)).mean())
    stiffness_change = min(1.0, 2 * abs(amplitude) / float(abs(overlap).mean()))
    rounding = np.finfo(float).eps * network.length * force * math.sqrt(network.n_contacts)
    return fraction**2 * stiffness_change + ROUNDINGS * rounding / energy
