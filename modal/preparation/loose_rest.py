"""A few spheres that are still on their way, brought to rest among neighbours that stand still.

A loose sphere that slides or rolls over many overlaps takes thousands of steps, while all others
have long come to rest. Those few and what is near them move alone, at some hundredths of
the cost; what their neighbours then lack, springs give them (`elastic_rest`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modal.dem.contacts import MovingContacts
from modal.dem.motion import DampedMotion
from modal.packing.sample import Sample
from modal.tools.arrays import Bools, Floats

FEW, PART = 0.01, 0.3
"""Largest share of spheres that are loose, and of those that move or stand around them: with more,
all had better move."""
LOOSE = 10.0
"""Net force of a loose sphere, over the mean one of all; what is less, springs still take away."""
SHELLS = 2
"""Neighbours of neighbours that may move with a loose sphere; those around them stand still."""
LOOK, MOST_STEPS = 200, 20_000
"""Steps between two looks at the part, and of all; 5,000 carry a sphere by some ten overlaps."""


def loose_rest(sample: Sample, contacts: MovingContacts, allowed: float) -> Sample | None:
    """The sample after the motion of its few loose spheres; None where they are none or many.

    `contacts` are those of the sample; `allowed`, N, is the net force (torque over radius) with
    which a sphere counts as at rest.
    """
    size = size_of(contacts.load, contacts.radius)
    free = size > max(allowed, LOOSE * size.mean())
    if not free.any() or free.mean() > FEW:
        return None
    pairs = contacts.pairs()
    for _ in range(SHELLS):
        free |= _beside(pairs, free)
    members = free | _beside(pairs, free)
    if members.mean() > PART:
        return None
    part = MovingContacts(_part(sample, members), contacts.friction)
    free = free[members]
    motion = DampedMotion(part, free)
    start, slack = part.position.copy(), 0.25 * part.skin * 2 * part.smallest
    for step in range(1, MOST_STEPS + 1):
        motion.step()
        if abs(part.position - start).max() > slack:
            break  # Spheres outside the part, which it does not know, come into reach.
        if step % LOOK == 0 and size_of(part.load, part.radius)[free].max() <= allowed:
            break
    return _with(sample, members, part.sample())


def size_of(load: Floats, radius: Floats) -> Floats:
    """Shape (n,), N: length of each sphere's force, its torque over its radius with it."""
    torque = load[:, 3:] / radius[:, None]
    size: Floats = np.sqrt((load[:, :3] ** 2).sum(axis=1) + (torque**2).sum(axis=1))
    return size


def _beside(pairs: np.ndarray, these: Bools) -> Bools:
    """Shape (n,) bool: spheres that touch, or nearly touch, one of `these`."""
    beside = np.zeros(len(these), bool)
    for one, other in ((0, 1), (1, 0)):
        beside[pairs[these[pairs[:, one]], other]] = True
    return beside


def _within(sample: Sample, members: Bools) -> Bools:
    """Shape (m,) bool: contacts of the sample whose ends are all members."""
    contact = sample.contacts()
    i, j = contact.particle_i, contact.particle_j
    inside: Bools = members[i] & ((j < 0) | members[j])
    return inside


def _part(sample: Sample, members: Bools) -> Sample:
    """The sample of some of the spheres; their contacts keep their order."""
    return replace(
        sample,
        position=sample.position[members],
        shear=None if sample.shear is None else sample.shear[_within(sample, members)],
        radii=None if sample.radii is None else sample.radii[members],
        densities=None if sample.densities is None else sample.densities[members],
    )


def _with(sample: Sample, members: Bools, part: Sample) -> Sample:
    """The sample with its `members` as they are in `part`; its other contacts are as they were."""
    position = sample.position.copy()
    position[members] = part.position
    moved = replace(sample, position=position, shear=None)
    inside = _within(moved, members)
    shear = np.empty((len(inside), 2))
    shear[inside] = part.shear
    shear[~inside] = 0 if sample.shear is None else sample.shear[~_within(sample, members)]
    return replace(moved, shear=shear)
