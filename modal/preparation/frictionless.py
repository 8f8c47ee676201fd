"""Energy minimum of frictionless spheres at a given pressure, by FIRE.

Positions and the logarithms of the three lengths move together down the enthalpy E + p V
(fast inertial relaxation engine: Bitzek et al., PRL 97, 170201, 2006; the half step back after an
uphill one: Guenole et al., Comp. Mat. Sci. 175, 109584, 2020). Walls are lengths as well: they
move homothetically with the cell.
"""

import math
from dataclasses import replace

import numpy as np

from modal.dem.contacts import MovingContacts
from modal.packing.sample import Sample
from modal.preparation.protocol import SQUEEZE, Stage, Study, stress_of
from modal.preparation.strain_control import Servo
from modal.tools.arrays import Floats
from modal.tools.loops import by_parts
from modal.tools.slabs import SLABS

PEAK_PACE, PACE = 0.3, 0.4
"""Time step of a descent at the peak, and after it, over sqrt(m / mean kn); the highest mode of a
dense packing, about sqrt(12 kn / m), would allow 0.58 if all contacts were equally stiff. On the
way to the peak longer steps make the coordination number scatter."""
STRESS_ERROR = 1e-3
"""Largest relative error of a principal stress at which a descent is over."""
DESCENT_CHECK, DESCENT_CHECKS, DESCENT_STEPS = 25, 400, 200_000
"""Steps of a descent between two looks, which cost a fifth of one; looks between two checkpoints,
from which it starts anew; steps after which it is given up."""
SKIN = 0.1
"""Reach of the list of pairs at first, diameters: the cloud is on its way."""
MIXING = 0.1
"""First share of the velocity that is turned towards the force."""
FARTHEST, STRAIN = 0.1, 0.01
"""Smallest radii that a sphere may go in a step, and by how much the cell may change: far from rest
spheres must not pass through each other."""


def _sums_of_some(first, last, part, velocity, force, sums):
    power = square = pushes = fastest = hardest = 0.0
    for i in range(first, last):
        for axis in range(3):
            v, f = velocity[i, axis], force[i, axis]
            power += f * v
            square += v * v
            pushes += f * f
            fastest, hardest = max(fastest, abs(v)), max(hardest, abs(f))
    row = sums[part]
    row[0], row[1], row[2], row[3], row[4] = power, square, pushes, fastest, hardest


def sums_by_arrays(velocity: Floats, force: Floats, sums: Floats) -> None:
    """Fill rows of parts of the spheres: sums of F v, v^2 and F^2; the largest v and F."""
    # Not BLAS: its threads cost more than they save here, and make the sum depend on their number.
    pairs = ((force, velocity), (velocity, velocity), (force, force))
    largest = abs(velocity).max(), abs(force).max()
    sums[0] = [*(np.einsum("ij,ij", a, b) for a, b in pairs), *largest]


def _descend_some(first, last, _, position, velocity, force, keep, gain, stretch, dt):
    for i in range(first, last):
        for axis in range(3):
            v = keep * velocity[i, axis] + gain * force[i, axis]
            velocity[i, axis] = v
            position[i, axis] = stretch[axis] * position[i, axis] + dt * v


def descend_by_arrays(position, velocity, force, keep, gain, stretch, dt):
    """Velocities (n, 3) to keep v + gain F, positions along them; the loop does the same."""
    velocity *= keep
    velocity += gain * force
    position *= stretch
    position += dt * velocity


sums_by_loop = by_parts(_sums_of_some, sums_by_arrays)
descend_by_loop = by_parts(_descend_some, descend_by_arrays)


class Pressure(Stage):
    """A pressure of spheres without friction; times count steps of a descent.

    `pace` is the length of these over sqrt(m / mean kn).
    """

    checks = DESCENT_CHECKS

    def __init__(self, name: str, study: Study) -> None:
        peak = name == SQUEEZE
        target = study.peak * study.mixture.hardness if peak else stress_of(name)
        self.name, self.study, self.control = name, study, Servo(target, study.inertial_number)
        self.limits = STRESS_ERROR, study.residual
        self.pace = PEAK_PACE if peak else PACE
        self.check, self.interval, self.patience = DESCENT_CHECK, 1.0, DESCENT_STEPS

    def time_step(self) -> float:
        """One step of the descent."""
        return 1.0


class Descent:
    """Spheres on their way to the least enthalpy under the pressure of a stage, from rest.

    A step's length goes by the `pace` of the stage.
    """

    def __init__(self, sample: Sample, stage: Pressure) -> None:
        low, self.steps = sample.walls[0], 0
        bare = replace(sample, position=sample.position - [0, 0, low], walls=sample.walls - low)
        own = {"history": False, "stiffness": sample.radii is not None}
        self.contacts = MovingContacts(bare, skin=SKIN, **own)
        self.velocity, self._drift = np.zeros_like(self.contacts.load), np.zeros(3)
        self._control, self._pace = stage.control, stage.pace
        # Lengths are variables of the same stiffness as positions: log length times sqrt(n) D.
        self._scale = math.sqrt(len(self.velocity)) * 2 * sample.radius
        # Where hardly anything touches, the step is that of overlaps of 1e-8 R (below 10 Pa).
        softest = sample.laws[0].stiffness_normal(1e-8 * sample.radius, sample.radius)
        self._softest = float(softest)
        self._mixing, self._downhill, self._dt = MIXING, 0, 0.0

    def advance(self, count: int, dt: float, every: int) -> None:
        """`count` steps, of the descent's own length; the control then knows the stresses."""
        for _ in range(count):
            self._step()
            self.steps += 1
        self._control.follow(self.stress())

    def _limit(self) -> float:
        """The longest step that is stable."""
        contacts, stiffness = self.contacts, self.contacts.stiffness
        limit = self._pace / math.sqrt(max(contacts.mean_stiffness, self._softest))
        if len(stiffness):
            # A large sphere among small ones has many contacts: omega^2 <= 2 sum kn / m.
            limit = min(limit, 1 / math.sqrt(max(stiffness.max(), self._softest)))
        return limit

    def _step(self) -> None:
        contacts, force, drift = self.contacts, self.contacts.load, self._drift
        pull = (contacts.virial - self._control.target * contacts.lengths.prod()) / self._scale
        limit = self._limit()
        dt = min(max(self._dt, 0.02 * limit), limit)
        sums = np.zeros((SLABS, 5))
        sums_by_loop(self.velocity, force, sums)
        power, square, pushes = sums[:, :3].sum(axis=0)
        fastest, hardest = sums[:, 3:].max(axis=0)
        keep, push = 0.0, 0.0
        if power + pull @ drift > 0:
            self._downhill += 1
            keep = 1 - self._mixing
            push = self._mixing * math.sqrt((square + drift @ drift) / (pushes + pull @ pull))
            if self._downhill > 20:
                dt, self._mixing = min(1.1 * dt, limit), 0.99 * self._mixing
        elif self.steps:
            self._move(1.0, 0.0, np.exp(-0.5 * dt * drift / self._scale), -0.5 * dt)
            self._downhill, self._mixing, dt = 0, MIXING, 0.5 * dt
        gain = push + dt
        self._drift = keep * drift + gain * pull
        way = math.sqrt(3) * (keep * fastest + gain * hardest) * dt
        strain = abs(self._drift).max() * dt / self._scale
        hold = min(
            1.0,
            FARTHEST * contacts.smallest / max(way, 1e-300),
            STRAIN / max(strain, 1e-300),
        )
        self._drift *= hold
        self._move(hold * keep, hold * gain, np.exp(dt * self._drift / self._scale), dt)
        self._dt = dt
        contacts.touch()

    def _move(self, keep: float, gain: float, stretch: Floats, dt: float) -> None:
        contacts = self.contacts
        contacts.side *= stretch[:2]
        contacts.walls *= stretch[2]
        descend_by_loop(contacts.position, self.velocity, contacts.load, keep, gain, stretch, dt)

    def stress(self) -> Floats:
        """Principal stresses (3,), Pa, compression positive."""
        return self.contacts.stress()

    def unbalanced(self) -> float:
        """Mean net force on a sphere over the mean contact force."""
        return self.contacts.unbalanced()

    def sample(self, *, moving: bool) -> Sample:
        """The sample as it is now, at rest: spheres without friction go on from their places."""
        return self.contacts.sample()
