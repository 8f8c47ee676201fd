"""Minimise the energy of frictionless spheres at a given pressure, by FIRE.

Positions and the logarithms of the three lengths of the cell move together towards lower enthalpy E
+ p V. FIRE is the fast inertial relaxation engine of Bitzek et al., PRL 97, 170201, 2006; going
back by half a step after an uphill step follows Guenole et al., Comp. Mat. Sci. 175, 109584, 2020.
The distance of the walls is one of the lengths: walls move homothetically with the cell.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modal.dem.contacts import MovingContacts
from modal.packing.sample import Sample
from modal.preparation.protocol import SQUEEZE, SettlingLimits, Stage, read_target_stress
from modal.preparation.strain_control import Servo
from modal.preparation.study import Study
from modal.tools.arrays import Floats
from modal.tools.loops import by_parts
from modal.tools.slabs import SLABS

PEAK_STEP_RATIO = 0.3
"""Time step of the descent to the peak divided by sqrt(m / mean kn); longer steps on the way to the
peak make the coordination number scatter."""
STEP_RATIO = 0.4
"""Time step of the descents after the peak divided by sqrt(m / mean kn). The highest mode of a
dense packing, about sqrt(12 kn / m), would allow 0.58 if all contacts were equally stiff."""
MIN_STEP_RATIO = 0.02
"""Shortest step of a descent divided by the longest stable one."""
STRESS_ERROR = 1e-3
"""Largest relative error of a principal stress at which a descent is over."""
DESCENT_CHECK = 25
"""Number of steps of a descent between two checks; a check costs a fifth of a step."""
DESCENT_CHECKS = 400
"""Number of checks between two checkpoints; at a checkpoint a descent starts again at rest."""
DESCENT_STEPS = 200_000
"""Number of steps after which a descent ends without success."""
SKIN_DIAMETERS = 0.1
"""Distance beyond contact, in diameters, of the first list of pairs: spheres of the cloud move
far."""
FIRST_MIXING = 0.1
"""First share of the velocity that is turned towards the force: alpha_start of FIRE."""
MIXING_FACTOR = 0.99
"""Factor on the share of the velocity that is turned towards the force, at each step after
`STEPS_BEFORE_GROWTH` downhill ones: f_alpha of FIRE."""
STEP_GROWTH = 1.1
"""Factor on the time step, at each step after `STEPS_BEFORE_GROWTH` downhill ones: f_inc of
FIRE."""
STEPS_BEFORE_GROWTH = 20
"""Number of downhill steps before the time step grows: N_min of FIRE."""
MAX_STEP_RADII = 0.1
"""Largest displacement in a step, in units of the smallest radius: far from rest, spheres must not
pass through each other."""
MAX_STEP_STRAIN = 0.01
"""Largest strain of the cell in a step: spheres must not pass through each other."""
TINY = 1e-300
"""Smallest divisor: keeps quotients of zero motions finite."""
SOFTEST_OVERLAP_RADII = 1e-8
"""Overlap, in radii, whose stiffness limits the time step if few spheres touch (below 10 Pa)."""


def _sums_of_some(first, last, part, velocity, force, sums):
    power = 0.0
    velocity_square = 0.0
    force_square = 0.0
    max_velocity = 0.0
    max_force = 0.0
    for i in range(first, last):
        for axis in range(3):
            v = velocity[i, axis]
            f = force[i, axis]
            power += f * v
            velocity_square += v * v
            force_square += f * f
            max_velocity = max(max_velocity, abs(v))
            max_force = max(max_force, abs(f))
    row = sums[part]
    row[0] = power
    row[1] = velocity_square
    row[2] = force_square
    row[3] = max_velocity
    row[4] = max_force


def sums_by_arrays(velocity: Floats, force: Floats, sums: Floats) -> None:
    """Fill the first row of `sums` with sums of F v, v^2 and F^2 and the largest |v| and |F|.

    Velocities v and forces F are (n, 3), `sums` is (parts, 5); the compiled loop fills one row for
    each part.
    """
    # Not BLAS: its threads cost more than they save here, and make the sum depend on their number.
    power = np.einsum("ij,ij", force, velocity)
    velocity_square = np.einsum("ij,ij", velocity, velocity)
    force_square = np.einsum("ij,ij", force, force)
    sums[0] = power, velocity_square, force_square, abs(velocity).max(), abs(force).max()


class DescentStep(NamedTuple):
    """One step of the descent.

    Attributes
    ----------
    keep, gain : float
        Factors of velocity and force: the velocity becomes keep v + gain F.
    stretch : ndarray (3,)
        Factors by which positions are multiplied before spheres move.
    dt : float
        Length of the step; masses are 1.
    """

    keep: float
    gain: float
    stretch: Floats
    dt: float


def _descend_some(first, last, _, position, velocity, force, *fields):
    """Do what `descend_by_arrays` does for the spheres from `first` to `last` - 1."""
    keep, gain, stretch, dt = fields
    for i in range(first, last):
        for axis in range(3):
            v = keep * velocity[i, axis] + gain * force[i, axis]
            velocity[i, axis] = v
            position[i, axis] = stretch[axis] * position[i, axis] + dt * v


def descend_by_arrays(position: Floats, velocity: Floats, force: Floats, step: DescentStep) -> None:
    """Set velocities (n, 3) to keep v + gain F, and move positions (n, 3) by them.

    The compiled loop does the same.
    """
    velocity *= step.keep
    velocity += step.gain * force
    position *= step.stretch
    position += step.dt * velocity


sums_by_loop = by_parts(_sums_of_some, sums_by_arrays)
descend_by_loop = by_parts(_descend_some, descend_by_arrays)


class Pressure(Stage):
    """Stage that brings spheres without friction to a pressure; its times are numbers of steps.

    `step_ratio` is the time step of the descent divided by sqrt(m / mean kn).
    """

    checks = DESCENT_CHECKS

    def __init__(self, name: str, study: Study) -> None:
        self.name = name
        self.study = study
        if name == SQUEEZE:
            target = study.peak * study.mixture.hardness
            self.step_ratio = PEAK_STEP_RATIO
        else:
            target = read_target_stress(name)
            self.step_ratio = STEP_RATIO
        self.control = Servo(target, study.inertial_number)
        self.limits = SettlingLimits(STRESS_ERROR, study.residual)
        self.check = DESCENT_CHECK
        self.interval = 1.0
        self.patience = DESCENT_STEPS

    def time_step(self) -> float:
        """Return 1: the unit of time is one step of the descent."""
        return 1.0


class Descent:
    """Spheres that move, from rest, to the minimum of the enthalpy at the pressure of a stage."""

    def __init__(self, sample: Sample, stage: Pressure) -> None:
        low = sample.walls[0]
        on_floor = replace(sample, position=sample.position - [0, 0, low], walls=sample.walls - low)
        self.steps = 0
        self.contacts = MovingContacts(
            on_floor, skin=SKIN_DIAMETERS, history=False, stiffness=sample.radii is not None
        )
        self.velocity = np.zeros_like(self.contacts.load)
        self._drift = np.zeros(3)
        self._control = stage.control
        self._step_ratio = stage.step_ratio
        # Lengths are variables of the same stiffness as positions: log length times sqrt(n) D.
        self._scale = math.sqrt(len(self.velocity)) * 2 * sample.radius
        overlap = SOFTEST_OVERLAP_RADII * sample.radius
        self._softest = float(sample.laws[0].stiffness_normal(overlap, sample.radius))
        self._mixing = FIRST_MIXING
        self._downhill_steps = 0
        self._dt = 0.0

    def advance(self, count: int, dt: float, every: int) -> None:
        """Take `count` steps, whose length the descent chooses; then pass stresses to the control.

        `dt` and `every` are ignored.
        """
        for _ in range(count):
            self._step()
            self.steps += 1
        self._control.follow(self.stress())

    def _max_time_step(self) -> float:
        """Return the longest stable time step, in units in which all masses are 1."""
        contacts = self.contacts
        stiffness = contacts.stiffness
        limit = self._step_ratio / math.sqrt(max(contacts.mean_stiffness, self._softest))
        if len(stiffness):
            # A large sphere among small ones has many contacts: omega^2 <= 2 sum kn / m.
            limit = min(limit, 1 / math.sqrt(max(stiffness.max(), self._softest)))
        return limit

    def _step(self) -> None:
        """Take one step of FIRE."""
        contacts = self.contacts
        force = contacts.load
        drift = self._drift
        pull = (contacts.virial - self._control.target * contacts.lengths.prod()) / self._scale
        limit = self._max_time_step()
        dt = min(max(self._dt, MIN_STEP_RATIO * limit), limit)
        sums = np.zeros((SLABS, 5))
        sums_by_loop(self.velocity, force, sums)
        power, velocity_square, force_square = sums[:, :3].sum(axis=0)
        max_velocity, max_force = sums[:, 3:].max(axis=0)
        keep = 0.0
        turn = 0.0
        if power + pull @ drift > 0:
            self._downhill_steps += 1
            keep = 1 - self._mixing
            speed_per_force = math.sqrt(
                (velocity_square + drift @ drift) / (force_square + pull @ pull)
            )
            turn = self._mixing * speed_per_force
            if self._downhill_steps > STEPS_BEFORE_GROWTH:
                dt = min(STEP_GROWTH * dt, limit)
                self._mixing = MIXING_FACTOR * self._mixing
        elif self.steps:
            self._move(DescentStep(1.0, 0.0, np.exp(-0.5 * dt * drift / self._scale), -0.5 * dt))
            self._downhill_steps = 0
            self._mixing = FIRST_MIXING
            dt = 0.5 * dt
        gain = turn + dt
        self._drift = keep * drift + gain * pull
        max_displacement = math.sqrt(3) * (keep * max_velocity + gain * max_force) * dt
        max_strain = abs(self._drift).max() * dt / self._scale
        share = min(
            1.0,
            MAX_STEP_RADII * contacts.smallest / max(max_displacement, TINY),
            MAX_STEP_STRAIN / max(max_strain, TINY),
        )
        self._drift *= share
        stretch = np.exp(dt * self._drift / self._scale)
        self._move(DescentStep(share * keep, share * gain, stretch, dt))
        self._dt = dt
        contacts.touch()

    def _move(self, step: DescentStep) -> None:
        """Stretch the cell, update the velocities, and move the spheres along them."""
        contacts = self.contacts
        contacts.side *= step.stretch[:2]
        contacts.walls *= step.stretch[2]
        descend_by_loop(contacts.position, self.velocity, contacts.load, step)

    def stress(self) -> Floats:
        """Return the principal stresses (3,), Pa, compression positive."""
        return self.contacts.stress()

    def unbalanced(self) -> float:
        """Return the mean net force on a sphere divided by the mean contact force."""
        return self.contacts.unbalanced()

    def sample(self, *, moving: bool) -> Sample:
        """Return the present sample at rest: positions alone suffice to continue a descent."""
        return self.contacts.sample()
