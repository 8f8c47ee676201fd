"""Stress-controlled compression: strain rates of the periodic cell that lead to a wanted stress."""

import math

import numpy as np
from yade import Matrix3, O
from yade.utils import getStress, unbalancedForce

from modal.hertz_mindlin import GLASS, RADIUS
from yade_scripts.scene import cell_side, wall_faces

GROWTH, TURN = 1.1, 0.5
"""Factors of the servo's strain rate, each interval: short of the target, and on crossing it."""
FIRST = 1e-3
"""The servo's first strain rate over its limit."""
INTERVAL = 5
"""Steps between two settings of the strain rates."""
HIGHEST_FREQUENCY = 2.16e5
"""Highest natural frequency of a packing at 100 kPa, Hz; it grows with the sixth root of stress."""
STABILITY = 0.7
"""Time step over its limit 1 / (pi f_max): overlaps may exceed the mean eightfold."""


def time_step(stress, fraction=STABILITY):
    """Stable time step of statics at `stress` (Pa), s."""
    return fraction / (math.pi * HIGHEST_FREQUENCY * (stress / 1e5) ** (1 / 6))


def rate_of_inertial_number(inertial_number, stress):
    """Strain rate, 1/s: I sqrt(stress / density) / D."""
    return inertial_number * math.sqrt(stress / GLASS.density) / (2 * RADIUS)


def principal_stresses(n):
    """Stresses (xx, yy, zz) of the sample between its walls, Pa, compression positive.

    YADE sums force times branch over all contacts, with the branch of a wall contact from the
    centre of the wall's box; the true one goes from the wall's face straight to the sphere.
    """
    (side_x, side_y), (low, high) = cell_side(), wall_faces(n)
    volume = side_x * side_y * (high - low)
    total = np.array([getStress(volume)[k][k] for k in range(3)])
    box_centres = 0.0
    for wall, face in ((n, low), (n + 1, high)):
        for contact in O.interactions.withBody(wall):
            if not contact.isReal:
                continue
            first = contact.id1 == wall
            ball = O.bodies[contact.id2 if first else contact.id1].state.pos
            force = np.array(contact.phys.normalForce + contact.phys.shearForce)
            branch = np.array(O.bodies[contact.id1].state.pos - O.bodies[contact.id2].state.pos)
            branch -= np.array(O.cell.hSize * contact.cellDist)
            straight = np.array([0, 0, (face - ball[2]) * (1 if first else -1)])
            box_centres = box_centres + force * (branch - straight)
    return -(total - box_centres / volume)


def wall_stresses(n):
    """Pressure on source and receiver wall, Pa."""
    side_x, side_y = cell_side()
    area = side_x * side_y
    return -O.forces.f(n, sync=True)[2] / area, O.forces.f(n + 1, sync=True)[2] / area


def void_ratio(n):
    """Volume of voids over volume of spheres, wall to wall."""
    (side_x, side_y), (low, high) = cell_side(), wall_faces(n)
    return side_x * side_y * (high - low) / (n * 4 / 3 * math.pi * RADIUS**3) - 1


def deform(n, rates):
    """Deform the cell at the rates (xx, yy, zz), 1/s; the walls follow along z.

    The integrator adds the jump of the rate times position to every velocity, also to the walls'.
    They are set to the velocity before that jump, so that errors do not add up.
    """
    now = O.cell.velGrad[2, 2]
    O.cell.velGrad = Matrix3(rates[0], 0, 0, 0, rates[1], 0, 0, 0, rates[2])
    for wall in (n, n + 1):
        state = O.bodies[wall].state
        state.vel = (0, 0, now * state.pos[2])


class ConstantRate:
    """Isotropic compression at a constant rate, 1/s."""

    def __init__(self, n, rate):
        self.n, self.rate = n, rate
        self.stress = principal_stresses(n)

    def __call__(self):
        """Set the rates; to be called every INTERVAL steps between forces and motion."""
        self.stress = principal_stresses(self.n)
        deform(self.n, [-self.rate] * 3)


class Servo:
    """Drives three principal stresses to one target within a limited strain rate.

    No stiffness is assumed, because that of a packing falls by orders of magnitude when it comes
    apart: each strain rate grows until its stress crosses the target, then turns round, halved.
    """

    def __init__(self, n, target, inertial_number):
        self.n, self.target = n, target
        self.limit = rate_of_inertial_number(inertial_number, target)
        self.rates = np.full(3, FIRST * self.limit)
        self.stress = principal_stresses(n)

    def __call__(self):
        """Set the rates; to be called every INTERVAL steps between forces and motion."""
        self.stress = principal_stresses(self.n)
        outward = np.where(self.stress > self.target, 1.0, -1.0)
        factor = np.where(outward * self.rates < 0, TURN, GROWTH)
        self.rates = outward * np.minimum(factor * np.abs(self.rates), self.limit)
        deform(self.n, self.rates)

    def error(self):
        """Largest relative deviation of a principal stress from the target."""
        return float(abs(self.stress / self.target - 1).max())


def unbalanced():
    """Mean residual force on a sphere over the mean contact force."""
    return unbalancedForce(useMaxForce=False)
