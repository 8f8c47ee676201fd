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
and |C - C'| <= `Repeats.difference` omega_bound, whose square bounds all omega^2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from modal.packing.network import RECEIVER_WALL, Network
from modal.packing.repeats import lateral_repeats
from modal.system.imposed import Imposed, WallMoves
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError
from modal.waves.receivers import Receivers
from modal.waves.signals import COMPONENT
from modal.waves.sources import Source


@dataclass(frozen=True)
class Part:
    """A part of a packing, or all of it, and how the whole is read from it.

    `first` (k,): the body of the whole that each of its k bodies is; `member` (n,): the body of the
    part that moves as each of the whole does; `count` such parts; the motion differs from that of
    the whole by `difference` of the largest at most.
    """

    system: LinearSystem
    first: Ints
    member: Ints
    count: int = 1
    difference: float = 0.0


def one_part(system: LinearSystem, duration: float, tolerance: float) -> Part:
    """The smallest part that will do for the time `duration`, s, within the relative `tolerance`.

    All of it where contacts have dashpots.
    """
    every: Ints = np.arange(system.network.n_particles)
    whole = Part(system, every, every)
    if system.dashpots is not None:
        return whole
    found = lateral_repeats(system.network, pre_stress=system.pre_stress != "none")
    difference = found.difference * bound_of_omega(found.part) * duration
    if found.count == 1 or difference > tolerance:
        return whole
    small = replace(system, network=found.part)
    return Part(small, found.first, found.member, found.count, difference)


def bound_of_omega(network: Network) -> float:
    """A bound of all omega of the springs, 1/s; two to three times the highest.

    A contact stores at most twice what it would for the motion of either sphere alone; and what a
    sphere's contacts store is at most the sum over its six unit motions, of mass-scaled length 1.
    """
    kn, kt = network.stiffness_normal, network.stiffness_tangential
    share = np.zeros(network.n_particles)
    for end, lever, chosen in (
        (network.particle_i, network.lever_i, slice(None)),
        (network.particle_j, network.lever_j, ~network.with_wall),
    ):
        at, across = end[chosen], np.cross(lever, network.normal)[chosen]
        turning = 2 * kt[chosen] * (lever[chosen] ** 2).sum(axis=1)
        turning += (kn - kt)[chosen] * (across**2).sum(axis=1)
        pushing = (kn + 2 * kt)[chosen]
        own = pushing / network.mass[at] + turning / network.inertia[at]
        share += np.bincount(at, own, len(share))
    return float(np.sqrt(2 * share.max()))


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
        the largest (`modal.waves.driven`). InputError where the source moves nothing.
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
