"""Move spheres by one leapfrog step in a cell that is strained, with Cundall's local damping.

One step is that of YADE's `NewtonIntegrator` in a homothetic cell. Velocities include the motion of
the cell, strain rate times position, and jump when the rate changes; local damping acts on the
motion relative to the cell (in YADE's form, with the half step of the acceleration).
"""

from __future__ import annotations

from typing import NamedTuple

from modal.tools.arrays import Floats
from modal.tools.loops import by_parts, elementwise


class SphereMotion(NamedTuple):
    """Positions and velocities of spheres, which a step updates in place.

    Attributes
    ----------
    position : ndarray (n, 3)
        m.
    velocity : ndarray (n, 6)
        Velocities and spins, m/s and rad/s.
    residue : ndarray (n, 3)
        What rounding has subtracted from the displacements so far, m. Slip follows the velocities:
        without the residue normal and shear forces of a contact would follow different motions, and
        their works on each other would not cancel (2e-3 of a wave's energy at 0.25 nm).
    """

    position: Floats
    velocity: Floats
    residue: Floats


class Step(NamedTuple):
    """One step of leapfrog.

    Attributes
    ----------
    rates_before, rates : ndarray (3,)
        Strain rates of the cell before the step, and from now on, 1/s.
    dt : float
        Length of the step, s.
    damping : float
        Share of each force that local damping takes.
    """

    rates_before: Floats
    rates: Floats
    dt: float
    damping: float


@elementwise
def damp(acceleration, velocity, dt, damping):
    """Return an acceleration after local damping; the velocity is relative to the cell."""
    work = acceleration * (velocity + 0.5 * dt * acceleration)
    # The sign of the work is random: without a branch the processor guesses nothing wrongly.
    return acceleration * (1 - damping * (1.0 * (work > 0) - (work < 0)))


@elementwise
def advance_along_axis(motion, acceleration, step):
    """Return position, m, velocity, m/s, and rounding residue, m, a step later, along an axis.

    `motion` holds the three before the step; `acceleration` is in m/s^2. The rates of the `step`
    are those along the axis.
    """
    x, v, residue = motion
    rate_before, rate, dt, damping = step
    acceleration = damp(acceleration, v - rate_before * x, dt, damping)
    v = v + dt * (acceleration + rate_before * v)
    v = v + (rate - rate_before) * x
    path = dt * v + residue
    return x + path, v, path - ((x + path) - x)


def _advance_part(first, last, _, load, masses, *fields):
    """Move the spheres from `first` to `last` - 1 by one leapfrog step.

    `fields` are those of a `SphereMotion`, then those of a `Step`.
    """
    position, velocity, residue, rates_before, rates, dt, damping = fields
    for i in range(first, last):
        inverse_mass = 1 / masses[i, 0]
        inverse_inertia = 1 / masses[i, 1]
        for axis in range(3):
            motion = (position[i, axis], velocity[i, axis], residue[i, axis])
            step = (rates_before[axis], rates[axis], dt, damping)
            x, v, left = advance_along_axis(motion, load[i, axis] * inverse_mass, step)
            position[i, axis] = x
            velocity[i, axis] = v
            residue[i, axis] = left
            spin = velocity[i, 3 + axis]
            twist = load[i, 3 + axis] * inverse_inertia
            velocity[i, 3 + axis] = spin + dt * damp(twist, spin, dt, damping)


def advance_by_arrays(load: Floats, masses: Floats, motion: SphereMotion, step: Step) -> None:
    """Move spheres by one step of leapfrog; the compiled loop does the same.

    `load` (n, 6) are forces and torques, N and N m, and `masses` (n, 2) are in kg and kg m^2.
    """
    position, velocity, residue = motion
    spin = velocity[:, 3:]
    acceleration = load[:, :3] / masses[:, :1]
    twist = load[:, 3:] / masses[:, 1:]
    along_axes = (position, velocity[:, :3], residue)
    position[:], velocity[:, :3], residue[:] = advance_along_axis(along_axes, acceleration, step)
    spin += step.dt * damp(twist, spin, step.dt, step.damping)


advance_by_loop = by_parts(_advance_part, advance_by_arrays)
