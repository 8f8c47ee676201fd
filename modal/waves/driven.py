"""A linear system between a source and receivers: what an integrator is given.

Of v = M^1/2 u, with d(t) the source's motion,

    v'' + D v' + A v = push d(t) + drag d'(t),

where push and drag are what springs and dashpots do for a unit displacement and a unit velocity of
the source. What is recorded is linear in v, forces on walls also in v', d and d'.

Of a packing that repeats itself sideways (`modal.packing.repeats`) one part is enough where the
source moves all parts alike. That is exact for parts that are equal. Parts that differ by round-off
are replaced by equal ones, which changes a wave little: with C the contacts' strains times the
roots of their stiffnesses, in mass-scaled motions, A = C^T C, and y = (C v, v') follows
(C v)' = C v', v'' = -C^T (C v) + the push. Both right-hand sides conserve |y|, the root of twice
the energy, so that after a time t the two waves differ by |C - C'| t of the largest |y| at most;
and |C - C'| <= `Repeats.difference` omega_max.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import norm

from modal.packing.network import RECEIVER_WALL
from modal.packing.repeats import Repeats, lateral_repeats, undivided
from modal.system.imposed import WallMoves
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator
from modal.tools.arrays import Array, Floats
from modal.tools.errors import UnavailableError
from modal.waves.receivers import Receivers
from modal.waves.signals import COMPONENT
from modal.waves.sources import Source


def one_part(
    system: LinearSystem, duration: float, tolerance: float
) -> tuple[LinearSystem, Repeats]:
    """The smallest part that will do for the time `duration`, s, within the relative `tolerance`.

    All of it where contacts have dashpots. The motion differs from that of the whole by
    `difference` of the largest at most.
    """
    network = system.network
    if system.dashpots is None:
        found = lateral_repeats(network, pre_stress=system.pre_stress != "none")
        if found.count > 1:
            part = replace(system, network=found.part)
            difference = found.difference * float(np.sqrt(part.top)) * duration
            if difference <= tolerance:
                return part, replace(found, difference=difference)
    return system, undivided(network)


@dataclass(frozen=True)
class Link:
    """What springs, or dashpots, do between the source, the bodies and the walls.

    `operator` A, or D; push (1, size) on the bodies, and `held` (walls,) on the walls, per unit of
    the source's displacement, or of its velocity; `rows` (walls, size) read what v, or v', does to
    the walls. Those of springs read, below that, the receivers too: (count, size).
    """

    operator: ContactOperator
    push: sp.csr_matrix
    rows: sp.csr_matrix
    held: Floats


@dataclass(frozen=True)
class Driven:
    """Source, system and receivers in the numbering of the operators' bodies.

    `stresses` names the forces that are recorded first, N, or N m: that which holds the source, of
    one that moves, and that on the receiver wall, where there is one. `part` says which bodies of
    the packing these are, `system` is of it.
    """

    springs: Link
    dashpots: Link | None
    stresses: tuple[str, ...]
    part: Repeats
    system: LinearSystem

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
        the largest (`modal.waves.driven`). InputError where the source moves nothing.
        """
        direction, network = receivers.direction, system.network
        moved = source.imposed(network, direction)
        small, part = system, undivided(network)
        if source.alike and not whole:
            small, part = one_part(system, duration, tolerance)
        springs = small.renumbered
        # Which freedom of the operator moves as each of the packing does.
        column = springs.outward(np.arange(small.size)).reshape(-1, 6)[part.member].ravel()
        entries = np.ones(len(column)), column, np.arange(len(column) + 1)
        alike = sp.csr_matrix(entries, (len(column), 6 * len(part.first)))
        beyond = WallMoves(RECEIVER_WALL, COMPONENT[direction]) if receivers.walls else None
        # What holds the source against the bodies, and what these do to the wall beyond.
        ends = ("source_stress", moved, -1.0), ("receiver_stress", beyond, 1.0)
        walls = [(name, wall, way) for name, wall, way in ends if wall is not None]

        def link(by: LinearSystem, operator: ContactOperator, load: Floats, *more: Any) -> Link:
            push, held = sp.csr_matrix(load), np.zeros(len(walls))
            rows = [sp.csr_matrix((0, by.size))]
            for k, (_, wall, way) in enumerate(walls):
                coupling = by.put_on(wall)
                rows.append(way * coupling.pull.T)
                if wall is moved:
                    push, held[k] = coupling.push.T.tocsr(), coupling.held[0, 0]
            reading, under = sp.vstack([*rows, *more], format="csr"), system.root.under
            # Of the pushes on equal parts the mean is that on one.
            return Link(operator, under(push) @ alike / part.count, under(reading) @ alike, held)

        load, dashpots = source.load(network, direction), None
        by_springs = link(system, springs, load, receivers.rows)
        if not by_springs.push.count_nonzero():
            raise UnavailableError(
                f"the source, {source.name}, moves nothing along {direction}: its contacts have no "
                f"{'normal' if direction == 'z' else 'tangential'} stiffness",
                code="no_stiffness",
            )
        if system.dashpots is not None:
            damped = system.dashpots
            viscous = damped.operator if springs.order is None else damped.renumbered
            dashpots = link(damped, viscous, 0 * load)
        return cls(by_springs, dashpots, tuple(name for name, _, _ in walls), part, small)

    @property
    def count(self) -> int:
        """How many numbers are recorded."""
        return int(self.springs.rows.shape[0])

    @property
    def walls(self) -> int:
        """How many of them are forces."""
        return len(self.stresses)

    def blank(self, moved: Array) -> Array:
        """Shape (k, count): a record of bodies at rest, while the source has `moved` by (k,), m."""
        record = np.zeros((len(moved), self.count), moved.dtype)
        record[:, : self.walls] = moved[:, None] * self.springs.held
        return record

    @property
    def reach(self) -> Floats:
        """Shape (walls + 1,): lengths of the rows, of each force and the longest of all others."""
        return self._each(norm(self.springs.rows, axis=1))

    def largest(self, record: Array, *, apart: bool) -> Floats:
        """Shape (walls + 1,): largest force on each wall, or on any, and motion of a record."""
        found = self._each(abs(record).max(axis=0))
        found[:-1] = found[:-1] if apart else found[:-1].max(initial=0.0)
        return found

    def _each(self, sizes: Floats) -> Floats:
        """Of numbers (count,) that of each force, and the largest of all others."""
        return np.maximum.reduceat(sizes, np.arange(self.walls + 1))
