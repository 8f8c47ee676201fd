"""Couple a linear system to a source and receivers: the equations for an integrator.

With v = M^1/2 u and the motion d(t) of the source,

    v'' + D v' + A v = push d(t) + drag d'(t),

where push and drag are the forces of springs and dashpots per unit displacement and unit velocity
of the source. Records are linear in v; forces on walls are also linear in v', d and d'.

If a packing repeats itself along x or y (`modal.packing.repeats`) and the source moves all parts
alike, it is enough to compute one part. This is exact for equal parts. Parts that differ by
round-off are replaced by equal ones, which changes a wave little: with C the contacts' strains
times the roots of their stiffnesses, in mass-scaled motions, A = C^T C, and y = (C v, v') follows
(C v)' = C v', v'' = -C^T (C v) + the push. Both right-hand sides conserve |y|, the root of twice
the energy, so that after a time t the two waves differ by at most |C - C'| t of the largest |y|;
and |C - C'| <= `Repeats.difference` omega_max.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import norm

from modal.packing.repeats import Repeats, lateral_repeats, undivided
from modal.system.imposed import Imposed, end_moves
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
    """Return the smallest part of a packing with the same wave as the whole, and how it repeats.

    During `duration`, s, the motion may differ from that of the whole packing by at most
    `tolerance` times the largest motion, estimated from `Repeats.difference`. The whole system is
    returned if no part is equal enough, or if contacts have dashpots.
    """
    network = system.network
    if system.dashpots is not None:
        return system, undivided(network)
    repeats = lateral_repeats(network, pre_stress=system.pre_stress != "none")
    if repeats.count > 1:
        part = replace(system, network=repeats.part)
        difference = repeats.difference * float(np.sqrt(part.spectral_bound)) * duration
        if difference <= tolerance:
            return part, replace(repeats, difference=difference)
    return system, undivided(network)


@dataclass(frozen=True)
class SourceCoupling:
    """The coupling of source, bodies and walls by springs, or by dashpots.

    Attributes
    ----------
    operator : ContactOperator
        A for springs, D for dashpots.
    push : sparse matrix (1, size)
        Load on the bodies per unit displacement of the source, or per unit velocity.
    rows : sparse matrix
        (walls, size) give the forces on the walls from v, or v'. For springs, further rows for the
        receivers follow: (count, size).
    held : ndarray (walls,)
        Force on the walls per unit displacement of the source, or per unit velocity, while the
        bodies are at rest. For springs, the readings of the receivers follow, from spheres that
        move with the source: (count,).
    """

    operator: ContactOperator
    push: sp.csr_matrix
    rows: sp.csr_matrix
    held: Floats


class _WallForce(NamedTuple):
    """A force that is recorded: its name, the motion of its wall, and the sign of the force."""

    name: str
    imposed: Imposed
    sign: float


@dataclass(frozen=True)
class ForcedSystem:
    """A system with a source and receivers, in the numbering of the operators' bodies.

    Attributes
    ----------
    springs : SourceCoupling
    dashpots : SourceCoupling or None
    stresses : tuple of str
        Names of the forces, N or N m, that are recorded first: the force that holds a moving
        source, and the force on the receiver wall, if they exist.
    part : Repeats
        The bodies of the packing that are simulated.
    system : LinearSystem
        Linear system of the part.
    """

    springs: SourceCoupling
    dashpots: SourceCoupling | None
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
    ) -> ForcedSystem:
        """Couple a system to a source and receivers.

        If the packing repeats itself along x or y, and one part reproduces the motion within the
        relative `tolerance` during `duration`, s, only this part is simulated; `whole` prevents
        this. Raises InputError if the source moves nothing.
        """
        direction = receivers.direction
        network = system.network
        part_system = system
        part = undivided(network)
        if source.moves_parts_alike and not whole:
            part_system, part = one_part(system, duration, tolerance)
        builder = _CouplingBuilder(
            root_under=system.sqrt_mass.under,
            motion_of_part=_motion_of_part(part_system, part),
            parts=part.count,
            forces=_wall_forces(source, receivers),
            motion_of_source=_motion_of_bodies(source, receivers),
        )
        load = source.load(network, direction)
        operator = part_system.renumbered
        springs = builder.couple(system, operator, load, receivers.rows)
        if not springs.push.count_nonzero():
            stiffness = "normal" if direction == "z" else "tangential"
            raise UnavailableError(
                "source_moves_nothing",
                f"the source, {source.name}, moves nothing along {direction}",
                f"its contacts have no {stiffness} stiffness",
            )
        dashpots = None
        if system.dashpots is not None:
            damped = system.dashpots
            viscous = damped.operator if operator.order is None else damped.renumbered
            dashpots = builder.couple(damped, viscous, 0 * load)
        stresses = tuple(force.name for force in builder.forces)
        return cls(springs, dashpots, stresses, part, part_system)

    @property
    def count(self) -> int:
        """Return how many numbers are recorded."""
        return int(self.springs.rows.shape[0])

    @property
    def walls(self) -> int:
        """Return how many of the recorded numbers are forces."""
        return len(self.stresses)

    def blank(self, moved: Array) -> Array:
        """Return the record (k, count) of bodies at rest for a source moved by `moved` (k,), m."""
        return moved[:, None] * self.springs.held

    @property
    def reach(self) -> Floats:
        """Return the norms (walls + 1,) of the rows: of each force, and the largest of motions."""
        return self._largest_of_each_kind(norm(self.springs.rows, axis=1))

    def largest(self, record: Array, *, apart: bool) -> Floats:
        """Return the largest forces and the largest motion (walls + 1,) of a record (k, count).

        With `apart` each force has its own maximum; otherwise the largest force counts for all.
        """
        largest = self._largest_of_each_kind(abs(record).max(axis=0))
        if not apart:
            largest[:-1] = largest[:-1].max(initial=0.0)
        return largest

    def _largest_of_each_kind(self, sizes: Floats) -> Floats:
        """Return, from numbers (count,), those of the forces and the largest of the others.

        The shape is (walls + 1,).
        """
        return np.maximum.reduceat(sizes, np.arange(self.walls + 1))


def _motion_of_part(part_system: LinearSystem, part: Repeats) -> sp.csr_matrix:
    """Return the matrix (6n, 6k) of ones that copies the motion of a part to all bodies.

    Columns are in the numbering of the operator.
    """
    renumbered = part_system.renumbered.outward(np.arange(part_system.size)).reshape(-1, 6)
    column = renumbered[part.member].ravel()
    row_starts = np.arange(len(column) + 1)
    shape = (len(column), 6 * len(part.first))
    return sp.csr_matrix((np.ones(len(column)), column, row_starts), shape)


def _motion_of_bodies(source: Source, receivers: Receivers) -> Floats:
    """Return the motion (6n,) of the source's own bodies, per unit motion of the source."""
    motion = np.zeros((receivers.network.n_particles, 6))
    motion[source.own_bodies(receivers.network), COMPONENT[receivers.direction]] = 1
    return motion.ravel()


def _wall_forces(source: Source, receivers: Receivers) -> list[_WallForce]:
    """Return the forces that are recorded: on the source, if it moves, and on the receiver wall."""
    forces = []
    network = receivers.network
    imposed = source.imposed(network, receivers.direction)
    if imposed is not None:
        # The force that holds the source against the bodies.
        forces.append(_WallForce("source_stress", imposed, -1.0))
    if receivers.walls:
        receiver = end_moves(network, "receiver", COMPONENT[receivers.direction])
        forces.append(_WallForce("receiver_stress", receiver, 1.0))
    return forces


@dataclass(frozen=True)
class _CouplingBuilder:
    """Couple springs or dashpots to a source and to the walls.

    root_under: divides rows by the roots of masses. motion_of_part: see `_motion_of_part`. parts:
    the number of equal parts. forces: the recorded forces. motion_of_source: see
    `_motion_of_bodies`.
    """

    root_under: Callable[[sp.csr_matrix], sp.csr_matrix]
    motion_of_part: sp.csr_matrix
    parts: int
    forces: list[_WallForce]
    motion_of_source: Floats

    def couple(
        self,
        system: LinearSystem,
        operator: ContactOperator,
        load: Floats,
        receiver_rows: sp.csr_matrix | None = None,
    ) -> SourceCoupling:
        """Return the coupling of a system of springs or dashpots.

        `load` (6n,) is the load of a source of force; `receiver_rows` (k, 6n) are appended after
        the rows of forces.
        """
        push = sp.csr_matrix(load)
        rows = [sp.csr_matrix((0, system.size))]
        held_source = None
        for force in self.forces:
            coupling = system.put_on(force.imposed)
            rows.append(force.sign * coupling.pull.T)
            if force.name == "source_stress":
                push = coupling.push.T.tocsr()
                held_source = coupling.held[0, 0]
        if receiver_rows is not None:
            rows.append(receiver_rows)
        reading = sp.vstack(rows, format="csr")
        held = np.asarray(reading @ self.motion_of_source, float)
        if held_source is not None:
            held[0] = held_source
        # The mean of the pushes on equal parts is the push on one part.
        mean_push = self.root_under(push) @ self.motion_of_part / self.parts
        return SourceCoupling(
            operator, mean_push, self.root_under(reading) @ self.motion_of_part, held
        )
