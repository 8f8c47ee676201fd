"""A linear system between a source and receivers: what an integrator is given.

Of v = M^1/2 u, with d(t) the source's motion,

    v'' + D v' + A v = push d(t) + drag d'(t),

where push and drag are what springs and dashpots do for a unit displacement and a unit velocity of
the source. What is recorded is linear in v, forces on walls also in v', d and d'.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from modal.packing.network import RECEIVER_WALL
from modal.system.imposed import Imposed, WallMoves
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError
from modal.waves.one_part import Part, one_part
from modal.waves.receivers import Receivers
from modal.waves.recording import COMPONENT
from modal.waves.sources import Source


@dataclass(frozen=True)
class Driven:
    """Operators, source and receivers in the numbering of the operators' bodies.

    `springs` is A, `dashpots` D or None; push, drag (size,). `rows` (count, size) read v, the first
    `walls` of them forces, N, or torques, N m; `viscous` (walls, size) read what v' adds to these;
    `held`, `held_viscous` (walls,): what d and d' add. The first force is that which holds the
    source, of one that moves; the last that on the receiver wall, where there is one. `part` says
    which bodies of the packing these are.
    """

    springs: ContactOperator
    dashpots: ContactOperator | None
    push: Floats
    drag: Floats
    rows: sp.csr_matrix
    viscous: sp.csr_matrix
    held: Floats
    held_viscous: Floats
    area: float
    part: Part

    @classmethod
    def of(
        cls,
        system: LinearSystem,
        source: Source,
        receivers: Receivers,
        duration: float,
        tolerance: float,
        *,
        whole: bool = False,
    ) -> Driven:
        """The system with its source and receivers, or one of its equal parts unless `whole`.

        One will do where it changes the motion, for `duration`, s, by no more than `tolerance` of
        the largest (`modal.waves.one_part`). InputError where the source moves nothing.
        """
        direction, network = receivers.direction, system.network
        own = source.imposed(network, direction)
        if whole or not source.alike:
            every = np.arange(network.n_particles)
            part = Part(system, every, every)
        else:
            part = one_part(system, duration, tolerance)
        springs = part.system.operator.renumbered()
        dashpots = None if system.dashpots is None else system.dashpots.operator
        if dashpots is not None and springs.order is not None:
            dashpots = dashpots.renumbered()
        beyond = WallMoves(RECEIVER_WALL, COMPONENT[direction]) if receivers.walls else None
        # What holds the source against the bodies, and what these do to the wall beyond.
        walls = [(wall, way) for wall, way in ((own, -1.0), (beyond, 1.0)) if wall is not None]
        push, held, pulls = _coupled(system, walls, own)
        push += source.load(network, direction)
        if not push.any():
            raise InputError(
                f"the source, {source.name}, moves nothing along {direction}: its contacts have no "
                f"{'normal' if direction == 'z' else 'tangential'} stiffness"
            )
        drag, held_viscous, viscous = np.zeros_like(push), np.zeros(len(walls)), pulls * 0
        if system.dashpots is not None:
            drag, held_viscous, viscous = _coupled(system.dashpots, walls, own)
        root = part.system.root
        # Which motion of the operator's bodies each of the packing's is.
        place = springs.outward(np.arange(springs.shape[0])).reshape(-1, 6)[part.member].ravel()
        motion = np.arange(len(place) + 1)
        same = sp.csr_matrix((np.ones(len(place)), place, motion), (len(place), springs.shape[0]))

        def inward(force: Floats) -> Floats:
            return springs.inward(root.over(force.reshape(-1, 6)[part.first].ravel()))

        def reading(rows: sp.csr_matrix) -> sp.csr_matrix:
            return (rows @ system.root.inverse() @ same).tocsr()

        return cls(
            springs,
            dashpots,
            inward(push),
            inward(drag),
            reading(sp.vstack([pulls, receivers.rows], format="csr")),
            reading(viscous),
            held,
            held_viscous,
            network.area,
            part,
        )

    @property
    def count(self) -> int:
        """How many numbers are recorded."""
        return int(self.rows.shape[0])

    @property
    def walls(self) -> int:
        """How many of them are forces."""
        return len(self.held)

    def observe(self, v: Floats, out: Floats) -> None:
        """Write the row (count,) of the motion v = M^1/2 u (size,) into `out`."""
        out[:] = self.rows @ v

    def reach(self) -> Floats:
        """Shape (walls + 1,): lengths of the rows, of each force and the longest of all others."""
        length = np.sqrt(np.asarray(self.rows.multiply(self.rows).sum(axis=1)).ravel())
        return np.append(length[: self.walls], length[self.walls :].max())

    def recorded(self, record: Array, displacement: Floats) -> Array:
        """A record (k, count) with what the source's `displacement` (k,) adds to the forces."""
        record[:, : self.walls] += displacement[:, None] * self.held
        return record

    def stresses(self, record: Array) -> dict[str, Any]:
        """Forces of a complete record (k, count) over the area; empty where there is none."""
        none = np.empty(0)
        own, beyond = self.held.any(), self.walls > self.held.any()
        return {
            "source_stress": record[:, 0] / self.area if own else none,
            "receiver_stress": record[:, self.walls - 1] / self.area if beyond else none,
        }

    def largest(self, record: Array, displacement: Floats) -> Floats:
        """Shape (walls + 1,): forces and motions at most in a record (k, count)."""
        forces = record[:, : self.walls] + displacement[:, None] * self.held
        return np.append(abs(forces).max(axis=0), abs(record[:, self.walls :]).max())


def _coupled(
    system: LinearSystem, walls: list[tuple[Imposed, float]], own: Imposed | None
) -> tuple[Floats, Floats, sp.csr_matrix]:
    """Push of the source (6n,), what holds it (walls,), and what the bodies do to walls, sparse."""
    push, held = np.zeros(6 * system.network.n_particles), np.zeros(len(walls))
    pulls = [sp.csr_matrix((0, len(push)))]
    for k, (wall, way) in enumerate(walls):
        coupling = system.put_on(wall)
        if wall is own:
            push, held[k] = coupling.push[:, 0], coupling.held[0, 0]
        pulls.append(sp.csr_matrix(way * coupling.pull[:, 0]))
    return push, held, sp.vstack(pulls, format="csr")
