"""Dynamic relaxation: contacts that move until what drives them has died.

Only the end matters here, not the way: each sphere is given a mass in proportion to the stiffness
of its contacts, so that all of them move as fast as the time step allows (Otter, Proc. Inst. Civ.
Eng. 35, 633, 1966), with the local damping of Cundall (1987). What is slow, the longest waves along
a packing, is left to whoever knows its springs: a drag that killed them would hold up loose spheres
that have some micrometres to go.
"""

from __future__ import annotations

import numpy as np

from modal.dem.contacts import MovingContacts
from modal.tools.arrays import Bools, Floats
from modal.tools.loops import compiled, compiled_part, fingerprint, numba, prange
from modal.tools.slabs import SLABS

PACE = 0.3
"""Squared time step over mass per sum of kn. For each contact kn (n.d)^2 + kt |d_t|^2 is at most
2 kn (u_i^2 + u_j^2) + 4 kt (u_t^2 + (R theta)^2) summed over both ends; with kt <= 0.9 kn and
inertia 2/5 m R^2 the largest omega^2 is below 9 PACE, the leapfrog limit is 4."""
LIGHTEST = 0.02
"""Least mass, over the mean: free spheres must not be light when they meet others."""
LOCAL_DAMPING = 0.3
LIGHTNESS = np.array([1.0] * 3 + [2.5] * 3)
"""One over mass of each component, in parts of that of a translation. Rotations count as arcs, so
that one mass serves all six: m R^2 for an inertia of 2/5 m R^2."""


def _push_some(first, last, velocity, load, arm, stiffness, least):
    for i in range(first, last):
        mass = max(stiffness[i], least) / PACE
        for axis in range(6):
            push, before = load[i, axis] / arm[i, axis], velocity[i, axis]
            push -= LOCAL_DAMPING * np.copysign(push, before)
            velocity[i, axis] = before + push * (LIGHTNESS[axis] / mass)


def _push(velocity, load, arm, stiffness, least):
    n = len(velocity)
    for part in prange(SLABS):
        first, last = part * n // SLABS, (part + 1) * n // SLABS
        _push_some(first, last, velocity, load, arm, stiffness, least)


def push_by_arrays(velocity, load, arm, stiffness, least):
    """The same as the compiled loop; the fallback, and its oracle."""
    push = load / arm
    push -= LOCAL_DAMPING * np.copysign(push, velocity)
    velocity += push * (LIGHTNESS / (np.maximum(stiffness, least) / PACE)[:, None])


if numba is None:
    push_by_loop = push_by_arrays
else:
    _push_some = compiled_part(_push_some, fingerprint())
    push_by_loop = compiled(_push, 0, fingerprint())


class DampedMotion:
    """How spheres of the radii (n,), m, go on, from rest at first.

    Those that are not `free` (n,) stand still.
    """

    def __init__(self, radius: Floats, free: Bools | None = None) -> None:
        self._held = None if free is None else ~free
        self._arm = np.repeat(np.column_stack([np.ones_like(radius), radius]), 3, axis=1)
        self._velocity = np.zeros((len(radius), 6))

    def stop(self) -> None:
        """Take all velocity away."""
        self._velocity[:] = 0

    def step(self, contacts: MovingContacts) -> None:
        """Move all spheres by one time step."""
        velocity, stiffness = self._velocity, contacts.stiffness
        least = LIGHTEST * stiffness.mean()
        push_by_loop(velocity, contacts.load, self._arm, stiffness, least)
        if self._held is not None:
            velocity[self._held] = 0
        contacts.move(velocity / self._arm)
