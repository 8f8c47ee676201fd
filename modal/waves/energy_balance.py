"""Whether a wave run has kept its energy: the sum after the pulse against that at the end."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from modal.packing.network import Network


@dataclass(frozen=True)
class EnergyBalance:
    """The books of a wave run, from the end of the pulse to the end of the record.

    energy is that of the wave after the pulse, J; drift what kinetic energy and the work stored in
    the contacts have changed by since, and friction what sliding has dissipated since, both over
    energy. contacts counts those at the start, opened and slid those of them that were seen to.
    limit is what the time step may change, NaN where contacts slid: friction then takes energy,
    out of the state at rest too, and the drift has no such bound.
    """

    energy: float
    drift: float
    friction: float
    contacts: int
    opened: int
    slid: int
    limit: float

    @property
    def kept(self) -> bool:
        """Whether the drift is within its limit; true where there is none."""
        return not abs(self.drift) > self.limit

    def attributes(self) -> dict[str, Any]:
        """Attributes of the group `balance` of a signals file."""
        return vars(self) | {"kept": self.kept}

    @staticmethod
    def of_attributes(found: Mapping[str, Any]) -> EnergyBalance | None:
        """What a file says; None where it says nothing, as the files of earlier versions."""
        kinds = {"contacts": int, "opened": int, "slid": int}
        names = EnergyBalance.__dataclass_fields__
        if not names.keys() <= found.keys():
            return None
        return EnergyBalance(**{name: kinds.get(name, float)(found[name]) for name in names})


def drift_limit(network: Network, fraction: float, amplitude: float, energy: float) -> float:
    """Largest relative change of the energy that the time step and round-off explain.

    The leapfrog scheme conserves the sum of elastic energy and the product of the velocities
    half a step behind and ahead exactly in a linear system. What is left comes from the change of
    stiffness, a share of 2A over the overlap, and shrinks as (omega dt / 2)^2; the fastest mode
    bounds omega dt by 2 `fraction`. A position of size L is rounded by eps L, and every force does
    that much work at random in each of the contacts.
    """
    overlap = network.known("overlap", "limit of the energy drift")
    force = float(network.known("force_normal", "limit of the energy drift").mean())
    bend = min(1.0, 2 * abs(amplitude) / float(overlap.mean()))
    rounding = np.finfo(float).eps * network.length * force * math.sqrt(network.n_contacts)
    return fraction**2 * bend + ROUNDED * rounding / energy


ROUNDED = 10
"""Positions are rounded at every step; what adds up was up to 3 times that of one, so far."""
