"""Whether the energy books of a wave run close: what it has, and what the source wall gave it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_type_hints

import numpy as np

from modal.packing.network import Network

ROUNDED = 10
"""Times the work of one rounding of all positions: over whole runs up to 3 times was measured."""
CLOSED = 1e-3
"""Largest gap of the books of a run in which contacts slid, over the work of the source wall."""

LATER = {"work", "gap"}
"""What files of earlier versions do not say."""


@dataclass(frozen=True)
class EnergyBalance:
    """What became of the energy of a wave run, from the end of the pulse to the end of the record.

    `energy`: of the wave after the pulse, J. `drift`: the change since then of kinetic energy plus
    energy stored in the contacts, over `energy`. `friction`: what sliding has dissipated since
    then, over `energy`. `contacts`: their number at the start, of which `opened` were seen to open
    and `slid` to slide. `limit`: the largest drift that the time step explains; NaN where contacts
    slid, since sliding also releases energy of the state at rest and the drift has no bound then.
    `work`: of the source wall, J; `gap`: kinetic and elastic energy at the end plus all that
    sliding has dissipated since the start, less `work`, over `work`. Both are NaN in the files of
    earlier versions, where `friction` is the law's own count, which misses the slip of contacts
    that only lose normal force.
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
    def kept(self) -> bool:
        """Whether drift and gap are within their limits; true where there is none."""
        bound = CLOSED if math.isnan(self.limit) else max(CLOSED, self.limit)
        return not (abs(self.drift) > self.limit or abs(self.gap) > bound)

    def attributes(self) -> dict[str, Any]:
        """Attributes of the group `balance` of a signals file."""
        return vars(self) | {"kept": self.kept}

    @staticmethod
    def of_attributes(found: Mapping[str, Any]) -> EnergyBalance | None:
        """What a file says; None where it says nothing, as the files of earlier versions."""
        kinds = get_type_hints(EnergyBalance)
        if not kinds.keys() - LATER <= found.keys():
            return None
        said = kinds.keys() & found.keys()
        return EnergyBalance(**{name: kinds[name](found[name]) for name in said})


def drift_limit(network: Network, fraction: float, amplitude: float, energy: float) -> float:
    """Largest relative change of the energy that the time step and round-off explain.

    The leapfrog scheme conserves the sum of elastic energy and the product of the velocities
    half a step behind and ahead exactly in a linear system. What is left comes from the change of
    stiffness, a share of 2A over the overlap, and shrinks as (omega dt / 2)^2. `fraction` is the
    time step over the longest stable one, 2 / omega_max, so omega dt / 2 is at most `fraction`.
    A position of size L is rounded by eps L; the contact force does work over this distance, of
    random sign, in each of the contacts.
    """
    overlap = network.require("overlap", "limit of the energy drift")
    force = float(network.require("force_normal", "limit of the energy drift").mean())
    bend = min(1.0, 2 * abs(amplitude) / float(overlap.mean()))
    rounding = np.finfo(float).eps * network.length * force * math.sqrt(network.n_contacts)
    return fraction**2 * bend + ROUNDED * rounding / energy
