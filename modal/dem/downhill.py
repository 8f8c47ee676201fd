"""Spheres that go down the energy of their contacts: what one step takes and moves, in few passes.

Each loop goes over the spheres in parts whose ends depend on their number alone, so that any number
of threads gives the same bits.
"""

from __future__ import annotations

import numpy as np

from modal.tools.loops import compiled, compiled_part, fingerprint, numba, prange
from modal.tools.slabs import SLABS


def _drive_some(first, last, velocity, force):
    power = speed = size = fastest = strongest = 0.0
    for i in range(first, last):
        along = of_velocity = of_force = 0.0
        for axis in range(3):
            v, f = velocity[i, axis], force[i, axis]
            along += f * v
            of_velocity += v * v
            of_force += f * f
        power += along
        speed += of_velocity
        size += of_force
        fastest, strongest = max(fastest, of_velocity), max(strongest, of_force)
    return power, speed, size, fastest, strongest


def _drive(velocity, force):
    n = len(velocity)
    found = np.zeros((SLABS, 5))
    for part in prange(SLABS):
        first, last = part * n // SLABS, (part + 1) * n // SLABS
        found[part] = _drive_some(first, last, velocity, force)
    power, speed, size = found[:, 0].sum(), found[:, 1].sum(), found[:, 2].sum()
    return power, speed, size, np.sqrt(found[:, 3].max()), np.sqrt(found[:, 4].max())


def drive_by_arrays(velocity, force):
    """The same as the compiled loop; the fallback, and its oracle."""
    speeds, sizes = (velocity**2).sum(axis=1), (force**2).sum(axis=1)
    ends = np.sqrt(speeds.max()), np.sqrt(sizes.max())
    return (velocity * force).sum(), speeds.sum(), sizes.sum(), *ends


def _go_some(first, last, position, velocity, force, keep, push, stretch, dt):
    for i in range(first, last):
        for axis in range(3):
            velocity[i, axis] = keep * velocity[i, axis] + push * force[i, axis]
            position[i, axis] = stretch[axis] * position[i, axis] + dt * velocity[i, axis]


def _go(position, velocity, force, keep, push, stretch, dt):
    n = len(position)
    for part in prange(SLABS):
        first, last = part * n // SLABS, (part + 1) * n // SLABS
        _go_some(first, last, position, velocity, force, keep, push, stretch, dt)


def go_by_arrays(position, velocity, force, keep, push, stretch, dt):
    """The same as the compiled loop; the fallback, and its oracle."""
    velocity *= keep
    velocity += push * force
    position *= stretch
    position += dt * velocity


def _way_of_some(first, last, position, start, stretch):
    longest = 0.0
    for i in range(first, last):
        way = 0.0
        for axis in range(3):
            way += (position[i, axis] - stretch[axis] * start[i, axis]) ** 2
        # What is no number stays in sight.
        if longest == longest and not way <= longest:
            longest = way
    return longest


def _longest_ways(position, start, stretch):
    n = len(position)
    longest = np.zeros(SLABS)
    for part in prange(SLABS):
        first, last = part * n // SLABS, (part + 1) * n // SLABS
        longest[part] = _way_of_some(first, last, position, start, stretch)
    return np.sqrt(longest)


def longest_ways_by_arrays(position, start, stretch):
    """Instead of the longest way of each part that of every sphere; the fallback, and its oracle.

    The largest of them is for numpy, which unlike threads' loops does not pass over what is none.
    """
    return np.sqrt(((position - stretch * start) ** 2).sum(axis=1))


if numba is None:
    drive, go, longest_ways = drive_by_arrays, go_by_arrays, longest_ways_by_arrays
else:
    _drive_some = compiled_part(_drive_some, fingerprint())
    _go_some = compiled_part(_go_some, fingerprint())
    _way_of_some = compiled_part(_way_of_some, fingerprint())
    drive = compiled(_drive, 0, fingerprint())
    go = compiled(_go, 0, fingerprint())
    longest_ways = compiled(_longest_ways, 0, fingerprint())
