"""Move the grains of a sample while a source moves or pushes, and add up the work of the source.

Sources are those of the linear wave: the source wall, flat or of held spheres, a plane between
spheres that opens, a sphere that a force pushes or a torque turns, a disc of spheres that move
together or are pushed. In torsion a wall turns about z as a body. For a plane, everything below it
turns, and is computed in the turning frame.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modal.packing.ends import rough_wall
from modal.packing.network import Network
from modal.packing.sample import Sample
from modal.system.imposed import TURN
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError
from modal.waves.signals import COMPONENT, TORSION, Direction
from modal.waves.sources import Source, hold_own_bodies


@dataclass(frozen=True)
class DrivenSample:
    """A sample at rest, its network, and the source that drives it along a direction.

    Raises InputError for a source that the packing does not have, or that cannot turn.
    """

    sample: Sample
    network: Network
    source: Source
    direction: Direction

    def __post_init__(self) -> None:
        # Building the source's motion and load refuses a source that the packing does not have.
        if self.source_moves and self.direction == TORSION and self.sample.periodic_z:
            raise InputError(
                "torsion_of_periods",
                "a period along z does not turn",
                remedy="take a cell between walls, a sphere as the source, or the linear wave",
            )
        _ = self.load
        self._refuse_clumps_of_the_source()

    def _refuse_clumps_of_the_source(self) -> None:
        """Raise UnavailableError for clumps that would be the source, or turn with it as a body."""
        turned = self.direction == TORSION and len(self.source.carried(self.network))
        if turned or len(self.source.own_bodies(self.network)):
            self.sample.refuse_clumps("the non-linear wave, from this source,")

    @cached_property
    def source_moves(self) -> bool:
        """Whether the source moves; otherwise it pushes by a force."""
        return self.source.imposed(self.network, self.direction) is not None

    @cached_property
    def load(self) -> Floats:
        """Forces and torques (n, 6) on spheres per unit force of the source."""
        return self.source.load(self.network, self.direction).reshape(-1, 6)

    @cached_property
    def held_sample(self) -> Sample:
        """The sample with the source's own bodies held."""
        held = hold_own_bodies(self.network, self.source)
        if held is self.network:
            return self.sample
        return replace(self.sample, fixed=held.fixed)

    @property
    def component(self) -> int:
        """Index, 0 to 5, of the recorded motion among the six motions of a sphere."""
        return COMPONENT[self.direction]


class DrivenDynamics:
    """The dynamics of a sample whose source moves or pushes, and the work of the source.

    `source_motion` (steps + 1,) is the source's displacement, m, or force, N, at each step.
    """

    def __init__(self, start: DrivenSample, time_step: float, source_motion: Floats) -> None:
        from modal.dem.motion import Dynamics  # not at import: linear waves need none of its loops

        self.start = start
        self.time_step = time_step
        self.source_motion = source_motion
        self.dynamics = Dynamics(start.held_sample, track_energy=True)
        self.dynamics.moves_flat_wall = start.source.moves_flat_wall
        self.dynamics.axis = start.network.cell_size[:2] / 2
        self.dynamics.carry(start.source.carried(start.network))
        self.own_bodies = start.source.own_bodies(start.network)
        self.contacts = self.dynamics.contacts
        self.rotation = np.zeros(start.network.n_particles)
        self.work = 0.0
        self.source_force = 0.0

    @property
    def velocity(self) -> Floats:
        """Velocities (n, 6) of the network's bodies, m/s and rad/s, half a step ahead."""
        return self.dynamics.grain_velocity

    @property
    def turns(self) -> bool:
        """True if turns are recorded, not displacements."""
        return self.start.component > 2

    def displacement(self, k: int) -> Floats:
        """Return the recorded component of the motion (n,), m or rad, at step k."""
        moved = self.rotation.copy()
        if not self.turns:
            moved = self.dynamics.displacement()[:, self.start.component]
        moved[self.own_bodies] = self.source_motion[k]
        return moved

    def step(self, k: int) -> None:
        """Take step k, with the source at its place at that time, and add up its work."""
        if self.start.source_moves:
            self._step_moved(k)
        else:
            self._step_pushed(k)
        if self.turns:
            self.rotation += self.time_step * self.velocity[:, self.start.component]

    def _step_moved(self, k: int) -> None:
        """Take step k of a source that moves.

        The work of the source is computed with the mean of the forces at both ends of the step.
        """
        component = self.start.component
        self.dynamics.place_source(self.source_motion[k] * np.eye(6)[component])
        self.dynamics.step(self.time_step)
        force = float(self.dynamics.holding_load()[component])
        if k:
            path = self.source_motion[k] - self.source_motion[k - 1]
            self.work += 0.5 * (self.source_force + force) * path
        self.source_force = force

    def _step_pushed(self, k: int) -> None:
        """Take step k of a source of force; its work is computed with the mean force."""
        if k:
            path = self.time_step * float((self.start.load * self.velocity).sum())
            self.work += 0.5 * (self.source_motion[k - 1] + self.source_motion[k]) * path
        self.dynamics.push = self.source_motion[k] * self.start.load
        self.dynamics.step(self.time_step)

    def energy(self, velocity_behind: Floats) -> tuple[float, float, float, float]:
        """Return work, kinetic energy, energy stored in contacts and energy dissipated by slip, J.

        `velocity_behind` (n, 6) are the velocities half a step before the state.
        """
        stored = self.contacts.elastic_energy + float(self.contacts.work[:, 0].sum())
        kinetic = self.dynamics.kinetic_energy(velocity_behind, self.velocity)
        return self.work, kinetic, stored, self.contacts.slipped

    def wall_forces(self) -> tuple[float, float]:
        """Return the force that holds the source and that on the receiver wall, N or N m."""
        component = self.start.component
        bodies = rough_wall(self.start.network, "receiver")
        if not len(bodies):
            return self.source_force, self.contacts.on_walls[1, component]
        return self.source_force, self._force_on_held(bodies, component)

    def _force_on_held(self, bodies: Ints, component: int) -> float:
        """Return the force, N, or the torque about z, N m, on held spheres with given indices."""
        load = self.contacts.on_held[bodies]
        if component != TURN:
            return float(load[:, component].sum())
        x, y = (self.contacts.position[bodies, :2] - self.dynamics.axis).T
        return float((x * load[:, 1] - y * load[:, 0] + load[:, 5]).sum())
