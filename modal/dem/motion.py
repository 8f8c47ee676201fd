"""Spheres in motion between two walls: leapfrog steps in a cell that is strained, with damping.

One step is YADE's: forces at the present places, strain rates from the control, then
`NewtonIntegrator` in a homothetic cell. Velocities hold the cell's own motion, rate times place,
and jump with the rate; Cundall's local damping opposes what a sphere moves beside it (YADE's form
with the acceleration's half step). The walls are the faces of boxes one radius thick to each side
of their centres, which move with the cell along z and rest across it; a cell without walls has a
period along z like the others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from modal.dem.contacts import SKIN, MovingContacts
from modal.packing.sample import Sample
from modal.tools.arrays import Floats
from modal.tools.loops import by_parts, elementwise

PACE = 0.3
"""Squared time step over mass per sum of kn, of dynamic relaxation. For each contact kn (n.d)^2 +
kt |d_t|^2 is at most 2 kn (u_i^2 + u_j^2) + 4 kt (u_t^2 + (R theta)^2) summed over both ends; with
kt <= 0.9 kn and inertia 2/5 m R^2 the largest omega^2 is below 9 PACE, the leapfrog limit is 4."""
LIGHTEST = 0.02
"""Its least mass, over the mean: free spheres must not be light when they meet others."""
LOCAL_DAMPING = 0.3
AT_REST = np.zeros(3)
"""Strain rates of a cell that rests."""


@elementwise
def damped(pull, beside, dt, damping):
    """What local damping leaves of a pull, m/s^2, on what moves `beside` its cell, m/s."""
    work = pull * (beside + 0.5 * dt * pull)
    # The sign of the work is a toss: without a branch nothing waits for a wrong guess.
    return pull * (1 - damping * (1.0 * (work > 0) - (work < 0)))


@elementwise
def advanced(x, v, late, pull, before, rate, dt, damping):
    """Place, m, velocity, m/s, and `late` of `advance_by_arrays` along an axis, a step later."""
    pull = damped(pull, v - before * x, dt, damping)
    v = v + dt * (pull + before * v)
    v = v + (rate - before) * x
    way = dt * v + late
    return x + way, v, way - ((x + way) - x)


def _advance_some(
    first, last, _, position, velocity, load, before, rates, dt, damping, masses, late
):  # fmt: skip
    for i in range(first, last):
        of_force, of_torque = 1 / masses[i, 0], 1 / masses[i, 1]
        for axis in range(3):
            x, v, pull = position[i, axis], velocity[i, axis], load[i, axis] * of_force
            x, v, rest = advanced(x, v, late[i, axis], pull, before[axis], rates[axis], dt, damping)
            position[i, axis], velocity[i, axis], late[i, axis] = x, v, rest
            w, twist = velocity[i, 3 + axis], load[i, 3 + axis] * of_torque
            velocity[i, 3 + axis] = w + dt * damped(twist, w, dt, damping)


def advance_by_arrays(position, velocity, load, before, rates, dt, damping, masses, late):
    """Move spheres by one step of leapfrog; the compiled loop does the same.

    `late` (n, 3), m, is what rounding has taken off their ways so far. Slip goes by velocities:
    without it the normal and the shear forces of a contact would come to stand on different ways,
    and their works on each other would not cancel (2e-3 of a wave's energy at 0.25 nm).
    """
    v, spin = velocity[:, :3], velocity[:, 3:]
    pull, twist = load[:, :3] / masses[:, :1], load[:, 3:] / masses[:, 1:]
    position[:], v[:], late[:] = advanced(position, v, late, pull, before, rates, dt, damping)
    spin += dt * damped(twist, spin, dt, damping)


advance_by_loop = by_parts(_advance_some, advance_by_arrays)


Control = Callable[[Floats], Floats]


class DampedMotion:
    """Dynamic relaxation: spheres that move, from rest, until what drives them has died.

    Only the end matters here, not the way: each sphere is given a mass in proportion to the
    stiffness of its contacts, so that all of them move as fast as the time step allows (Otter,
    Proc. Inst. Civ. Eng. 35, 633, 1966), with the local damping of Cundall (1987). What is slow,
    the longest waves along a packing, is left to whoever knows its springs: a drag that killed them
    would hold up loose spheres that have some micrometres to go.
    """

    def __init__(self, contacts: MovingContacts) -> None:
        self.contacts, n = contacts, len(contacts.position)
        self.velocity, self._late = np.zeros((n, 6)), np.zeros((n, 3))

    def step(self) -> None:
        """Move all spheres by one time step, which is 1."""
        contacts, stiffness = self.contacts, self.contacts.stiffness
        mass = np.maximum(stiffness, LIGHTEST * stiffness.mean()) / PACE
        masses = np.column_stack([mass, 0.4 * mass * contacts.radius**2])
        advance_by_loop(
            contacts.position, self.velocity, contacts.load, AT_REST, AT_REST, 1.0, LOCAL_DAMPING,
            masses, self._late,
        )  # fmt: skip
        contacts.touch(self.velocity, 1.0)


def _turned_by(angle: float) -> Floats:
    """Shape (2, 2): what turns rows of x and y about z by an angle, rad."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.array([[cosine, sine], [-sine, cosine]])


class Dynamics:
    """A sample in motion; every attribute is that after the last step.

    contacts: see `MovingContacts`; velocity (n, 6), m/s and rad/s; rates (3,), 1/s, of the cell;
    damping, the share of each force that local damping takes; masses (n, 2), kg and kg m^2. `step`
    takes the time step, s; `books` as of `MovingContacts`. Of a source of waves: `carried`, the
    numbers of spheres that the source wall takes along, so that a plane opens between these and all
    others; `axis` (2,), m, the x and y of the line along z that it turns about; `push` (n, 6), N
    and N m, pushes spheres, or is None. `control` gives the strain rates (3,), 1/s, for the
    stresses (3,), Pa; without it they stay.
    """

    def __init__(
        self,
        sample: Sample,
        damping: float = 0.0,
        skin: float = SKIN,
        *,
        control: Control | None = None,
        books: bool = False,
    ) -> None:
        self.control, self.steps, self._set_at = control, 0, 0
        self.contacts = MovingContacts(sample, skin=skin, stiffness=False, books=books)
        self.contacts.most = self.contacts.smallest
        self._source_at, self._source_step, self.axis = np.zeros(6), np.zeros(6), np.zeros(2)
        self._bare, self.carried, self.push = sample, np.zeros(0, int), None
        n = len(sample.position)
        self.velocity, self._late, self.damping = np.zeros((n, 6)), np.zeros((n, 3)), damping
        if sample.velocity is not None:
            self.velocity[:, :3] = sample.velocity
        if sample.angular_velocity is not None:
            self.velocity[:, 3:] = sample.angular_velocity
        self.rates = np.zeros(3) if sample.strain_rate is None else sample.strain_rate.copy()
        self.masses = np.column_stack(sample.masses)

    def place_source(self, displacement: Floats) -> None:
        """Put the source wall of a cell at rest `displacement` (6,) off its place at the start.

        It goes, m, along x, y and z, or turns, rad, about z, and takes along the `carried` spheres;
        in a cell without walls it is the end of the period along z, which does not turn. The next
        step finds the forces of it where it is.
        """
        contacts = self.contacts
        self._source_step = displacement - self._source_at
        self._source_at = displacement
        contacts.walls[0] = self._bare.walls[0] + displacement[2]
        after = contacts.position[self.carried] + self._source_step[:3]
        if self._source_step[5]:
            turn = _turned_by(self._source_step[5])
            after[:, :2] = self.axis + (after[:, :2] - self.axis) @ turn
            self.velocity[self.carried, :2] = self.velocity[self.carried, :2] @ turn
        contacts.position[self.carried] = after
        if contacts.whole:
            contacts.lean = -displacement[:2]

    def displacement(self) -> Floats:
        """Shape (n, 3), m: how far the spheres have moved, less what carries them along a line."""
        moved: Floats = self.contacts.position - self._bare.position
        moved[self.carried] -= self._source_at[:3]
        return moved

    def held(self) -> Floats:
        """Shape (6,), N, and N m about z: what holds the source, of the forces found last."""
        contacts, total = self.contacts, -self.contacts.on_walls[0]
        load, (x, y) = contacts.load[self.carried], self._from_axis()
        total[:3] -= load[:, :3].sum(axis=0)
        total[5] -= (x * load[:, 1] - y * load[:, 0] + load[:, 5]).sum()
        return total

    def _from_axis(self) -> Floats:
        """Shape (2, k), m: x and y of the carried spheres, from the line of the turn."""
        away: Floats = (self.contacts.position[self.carried, :2] - self.axis).T
        return away

    def advance(self, count: int, dt: float, every: int) -> None:
        """`count` steps of `dt`, s, with the rates set `every` so many of them."""
        for _ in range(count):
            due = self.steps - self._set_at >= every
            self.step(dt, self.control if due else None)
            if due:
                self._set_at = self.steps
            self.steps += 1

    def step(self, dt: float, control: Control | None = None) -> None:
        """One step; a `control` sets the strain rates."""
        self.find_forces(dt)
        if self.push is not None:
            self.contacts.load += self.push
        rates = self.rates if control is None else np.asarray(control(self.stress()), float)
        contacts, radius = self.contacts, self._bare.radius
        faces = 0.0 if contacts.whole else np.array([radius, -radius])
        contacts.walls += dt * rates[2] * (contacts.walls - faces)
        advance_by_loop(
            contacts.position,
            self.velocity,
            contacts.load,
            self.rates,
            rates,
            dt,
            self.damping,
            self.masses,
            self._late,
        )
        contacts.side *= 1 + dt * rates[:2]
        self.rates = rates.copy()

    def find_forces(self, dt: float) -> None:
        """Forces at the present places, where a step `dt` has led; 0 opens and closes only."""
        contacts = self.contacts
        gained, lean = contacts.lengths * (1 - 1 / (1 + dt * self.rates)), np.zeros(3)
        if contacts.whole:
            gained[2] -= self._source_step[2]
            lean[:2] = -self._source_step[:2]
        velocity, rate = self.velocity, self._source_step / dt if dt else np.zeros(6)
        if len(self.carried) and dt:
            velocity, (x, y) = velocity.copy(), self._from_axis()
            velocity[self.carried] += rate
            velocity[self.carried, :2] += rate[5] * np.column_stack([-y, x])
        turn = np.array([rate[5], *self.axis])
        contacts.touch(velocity, dt, np.array([gained, self._source_step[:3], lean, turn]))

    def stress(self) -> np.ndarray:
        """Principal stresses (3,), Pa, compression positive, of the forces found last."""
        return self.contacts.stress()

    def unbalanced(self) -> float:
        """Mean residual force on a sphere over the mean contact force, shear included."""
        return self.contacts.unbalanced()

    def sample(self, *, moving: bool) -> Sample:
        """The sample as it is now; with its velocities and strain rate if it is `moving`.

        Contacts are opened and closed at the present places; their shear forces miss the increment
        of the last step, which the first step of the sample in motion makes good.
        """
        self.find_forces(0.0)
        sample = self.contacts.sample()
        if moving:
            velocity, turning = self.velocity[:, :3].copy(), self.velocity[:, 3:].copy()
            # Velocities hold the cell's motion: those of another image differ by its share.
            velocity += self.rates * (sample.position - self.contacts.position)
            sample = replace(
                sample, velocity=velocity, angular_velocity=turning, strain_rate=self.rates.copy()
            )
        return sample
