"""Move spheres between two walls: forces, strain rates of the cell, and steps of leapfrog.

One step is that of YADE: forces at the present positions, strain rates from the control, then a
step of leapfrog (`modal.dem.leapfrog`). The walls are the faces of boxes, one radius thick to each
side of their centres, which move with the cell along z and do not move along x and y. A cell
without walls is periodic along z, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from modal.dem.clump_motion import ClumpMotion
from modal.dem.contact_step import LEAN, PERIODS, SOURCE, TURN
from modal.dem.contacts import SKIN, MovingContacts
from modal.dem.leapfrog import SphereMotion, Step, advance_by_loop
from modal.packing.sample import Sample
from modal.tools.arrays import Floats, Ints

STIFFNESS_PER_MASS = 0.3
"""Squared time step of dynamic relaxation times the sum of kn of a sphere, divided by the sphere's
mass. For each contact kn (n.d)^2 + kt |d_t|^2 is at most 2 kn (u_i^2 + u_j^2) + 4 kt (u_t^2 + (R
theta)^2) summed over both ends. With kt <= 0.9 kn and inertia 2/5 m R^2 the largest omega^2 dt^2 is
therefore below 9 times this ratio; the limit of leapfrog is 4."""
MIN_STIFFNESS_RATIO = 0.02
"""Least stiffness of a sphere, divided by the mean, from which its mass is computed: free spheres
must not be too light when they meet others."""
LOCAL_DAMPING = 0.3
AT_REST = np.zeros(3)
"""Strain rates of a cell that does not deform."""


Control = Callable[[Floats], Floats]


def relaxation_masses(stiffness: Floats) -> Floats:
    """Return the masses (n,) with which spheres of these stiffnesses (n,) move in steps of 1."""
    least = MIN_STIFFNESS_RATIO * stiffness.mean()
    mass: Floats = np.maximum(stiffness, least) / STIFFNESS_PER_MASS
    return mass


class DampedMotion:
    """Dynamic relaxation: spheres move, from rest, until the net forces have vanished.

    Only the final state matters, not the motion: each sphere has a mass in proportion to the
    stiffness of its contacts, so that all of them move as fast as the time step allows (Otter,
    Proc. Inst. Civ. Eng. 35, 633, 1966), with the local damping of Cundall (1987). Slow motions,
    the longest waves along a packing, are left to a solver that uses the stiffness matrix: a drag
    that damped these motions would delay loose spheres, which may have to move by micrometres.
    """

    def __init__(self, contacts: MovingContacts) -> None:
        n = len(contacts.position)
        self.contacts = contacts
        self.velocity = np.zeros((n, 6))
        self._residue = np.zeros((n, 3))

    def step(self) -> None:
        """Move all spheres by one time step, which is 1."""
        contacts = self.contacts
        mass = relaxation_masses(contacts.stiffness)
        masses = np.column_stack([mass, 0.4 * mass * contacts.radius**2])
        motion = SphereMotion(contacts.position, self.velocity, self._residue)
        step = Step(AT_REST, AT_REST, 1.0, LOCAL_DAMPING)
        advance_by_loop(contacts.load, masses, motion, step)
        contacts.touch(self.velocity, 1.0)


def _rotation(angle: float) -> Floats:
    """Return the matrix (2, 2) that turns rows of x and y about z by an angle, rad."""
    sine = np.sin(angle)
    cosine = np.cos(angle)
    return np.array([[cosine, sine], [-sine, cosine]])


class Dynamics:
    """A sample in motion; every attribute has its value after the last step.

    Parameters
    ----------
    sample : Sample
        The spheres at the start, at rest or in motion.
    damping : float, default 0
        Share of each force that local damping takes.
    skin : float
        As in `MovingContacts`.
    control : callable, optional
        Function that returns the strain rates (3,), 1/s, from the stresses (3,), Pa; without it the
        rates are constant.
    track_energy : bool, default False
        See `MovingContacts`.

    Attributes
    ----------
    contacts : MovingContacts
        Positions, forces, contacts.
    velocity : ndarray (n, 6)
        Velocities of the spheres, m/s and rad/s.
    rates : ndarray (3,)
        Strain rates of the cell, 1/s.
    masses : ndarray (n, 2)
        Masses, kg, and moments of inertia, kg m^2.
    steps : int
        Steps of `advance` so far.
    carried : ndarray (k,) of int
        Spheres that move with the source wall, so that a plane opens between these and all others.
    moves_flat_wall : bool
        Whether the flat wall at the source end moves with the source; otherwise the `carried`
        spheres alone are the source.
    axis : ndarray (2,)
        x and y, m, of the line along z about which the source wall turns.
    clumps : ClumpMotion or None
        The clumps that the spheres are parts of.
    push : ndarray (k, 6) or None
        Forces and torques of a source on the grains, N and N m.
    """

    def __init__(
        self,
        sample: Sample,
        damping: float = 0.0,
        skin: float = SKIN,
        *,
        control: Control | None = None,
        track_energy: bool = False,
    ) -> None:
        n = len(sample.position)
        self.control = control
        self.damping = damping
        self.steps = 0
        self._step_of_rates = 0
        self.contacts = MovingContacts(
            sample, skin=skin, stiffness=False, track_energy=track_energy
        )
        self.contacts.max_step = self.contacts.smallest
        self._source_displacement = np.zeros(6)
        self._source_step = np.zeros(6)
        self.axis = np.zeros(2)
        self.carried = np.zeros(0, int)
        self._carried_grains = self.carried
        self.moves_flat_wall = True
        self.push: Floats | None = None
        self._start = sample
        self.velocity = np.zeros((n, 6))
        self._residue = np.zeros((n, 3))
        if sample.velocity is not None:
            self.velocity[:, :3] = sample.velocity
        if sample.angular_velocity is not None:
            self.velocity[:, 3:] = sample.angular_velocity
        self.rates = np.zeros(3)
        if sample.strain_rate is not None:
            self.rates = sample.strain_rate.copy()
        self.masses = np.column_stack(sample.masses)
        self.clumps = None
        if sample.clumps is not None:
            self.clumps = ClumpMotion(sample, self.contacts, self.velocity, self.rates)

    def carry(self, grains: Ints) -> None:
        """Let the source wall take grains along, spheres or clumps, by their indices (k,).

        A plane opens between these and all others.
        """
        self._carried_grains = grains
        self.carried = grains
        if self.clumps is not None:
            self.carried = self.clumps.spheres_carried(grains)

    def place_source(self, displacement: Floats) -> None:
        """Move the source wall of a cell at rest to a `displacement` (6,) from its first place.

        The wall moves along x, y and z, m, or turns about z, rad, and the `carried` spheres move
        with it. In a cell without walls the end of the period along z moves instead, and cannot
        turn. The next step computes the forces.
        """
        contacts = self.contacts
        self._source_step = displacement - self._source_displacement
        self._source_displacement = displacement
        if self.moves_flat_wall:
            contacts.walls[0] = self._start.walls[0] + displacement[2]
        position = contacts.position[self.carried] + self._source_step[:3]
        if self._source_step[5]:
            rotation = _rotation(self._source_step[5])
            position[:, :2] = self.axis + (position[:, :2] - self.axis) @ rotation
            self.velocity[self.carried, :2] = self.velocity[self.carried, :2] @ rotation
        contacts.position[self.carried] = position
        if self.clumps is not None:
            self.clumps.carry(self._carried_grains, self._source_step[:3])
        if contacts.periodic_z and self.moves_flat_wall:
            contacts.lean = -displacement[:2]

    def displacement(self) -> Floats:
        """Return the displacements (k, 3), m, of the grains, spheres or the centres of clumps.

        Those of carried grains are relative to the source wall.
        """
        moved: Floats = self.contacts.position - self._start.position
        if self.clumps is not None:
            moved = self.clumps.displacement()
        moved[self._carried_grains] -= self._source_displacement[:3]
        return moved

    @property
    def grain_velocity(self) -> Floats:
        """Velocities (k, 6), m/s and rad/s, of the grains, spheres or clumps, half a step ahead."""
        if self.clumps is not None:
            return self.clumps.velocities
        return self.velocity

    def kinetic_energy(self, before: Floats, after: Floats) -> float:
        """Return the kinetic energy, J, from `grain_velocity` (k, 6) before and after a state."""
        if self.clumps is not None:
            return self.clumps.kinetic_energy(before, after)
        inertia = np.repeat(self.masses, 3, axis=1)
        return 0.5 * float((inertia * before * after).sum())

    def holding_load(self) -> Floats:
        """Return the force, N, and the torque, N m, (6,) that hold the source wall in its place.

        The forces of the last step are used.
        """
        total = np.zeros(6)
        if self.moves_flat_wall:
            total -= self.contacts.on_walls[0]
        load = self.contacts.load[self.carried] + self.contacts.on_held[self.carried]
        x, y = self._from_axis()
        total[:3] -= load[:, :3].sum(axis=0)
        total[5] -= (x * load[:, 1] - y * load[:, 0] + load[:, 5]).sum()
        return total

    def _from_axis(self) -> Floats:
        """Return lateral positions (2, k), m, of the carried spheres relative to the axis."""
        away: Floats = (self.contacts.position[self.carried, :2] - self.axis).T
        return away

    def advance(self, count: int, dt: float, every: int) -> None:
        """Do `count` steps of `dt`, s; the control sets the strain rates every `every` steps."""
        for _ in range(count):
            due = self.steps - self._step_of_rates >= every
            self.step(dt, self.control if due else None)
            if due:
                self._step_of_rates = self.steps
            self.steps += 1

    def step(self, dt: float, control: Control | None = None) -> None:
        """Do one step of `dt`, s; a `control` sets the strain rates."""
        self.find_forces(dt)
        contacts = self.contacts
        if self.clumps is not None:
            self.clumps.push = self.push
        elif self.push is not None:
            contacts.load += self.push
            if self._start.fixed is not None:
                contacts.load[self._start.fixed] = 0.0
        rates = self.rates
        if control is not None:
            rates = np.asarray(control(self.stress()), float)
        # The cell is strained about the centres of the boxes whose faces are the walls.
        faces: Floats | float = 0.0
        if not contacts.periodic_z:
            faces = np.array([self._start.radius, -self._start.radius])
        step = Step(self.rates, rates, dt, self.damping)
        if self.clumps is not None:
            self.clumps.advance(self.velocity, step)
        else:
            motion = SphereMotion(contacts.position, self.velocity, self._residue)
            advance_by_loop(contacts.load, self.masses, motion, step)
        contacts.walls += dt * rates[2] * (contacts.walls - faces)
        contacts.side *= 1 + dt * rates[:2]
        self.rates = rates.copy()

    def find_forces(self, dt: float) -> None:
        """Compute the forces at the present positions, which a step `dt`, s, has reached.

        With `dt` = 0 contacts open and close, and nothing else changes.
        """
        contacts = self.contacts
        change = np.zeros((4, 3))
        change[PERIODS] = contacts.lengths * (1 - 1 / (1 + dt * self.rates))
        if self.moves_flat_wall:
            change[SOURCE] = self._source_step[:3]
        if contacts.periodic_z and self.moves_flat_wall:
            change[PERIODS, 2] -= self._source_step[2]
            change[LEAN, :2] = -self._source_step[:2]
        velocity = self.velocity
        source_velocity = np.zeros(6)
        if dt:
            source_velocity = self._source_step / dt
        if len(self.carried) and dt:
            velocity = velocity.copy()
            x, y = self._from_axis()
            velocity[self.carried] += source_velocity
            velocity[self.carried, :2] += source_velocity[5] * np.column_stack([-y, x])
        if self.moves_flat_wall:
            change[TURN] = source_velocity[5], *self.axis
        contacts.touch(velocity, dt, change)

    def stress(self) -> Floats:
        """Return the principal stresses (3,), Pa, compression positive, of the last forces."""
        return self.contacts.stress()

    def unbalanced(self) -> float:
        """Return mean net force on a grain divided by mean contact force, shear included."""
        return self.contacts.unbalanced()

    def sample(self, *, moving: bool) -> Sample:
        """Return the sample as it is now; if `moving`, with its velocities and strain rate.

        Contacts are opened and closed at the present positions; their shear forces lack the
        increment of the last step, which the first step of the sample in motion adds.
        """
        self.find_forces(0.0)
        sample = self.contacts.sample()
        if not moving:
            return sample
        # Velocities contain the motion of the cell: that of another image differs by its share.
        image_velocity = self.rates * (sample.position - self.contacts.position)
        return replace(
            sample,
            velocity=self.velocity[:, :3] + image_velocity,
            angular_velocity=self.velocity[:, 3:].copy(),
            strain_rate=self.rates.copy(),
        )
