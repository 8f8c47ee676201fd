"""The last steps to rest: where springs put a packing, and the few spheres that they leave out.

Damped motion ends in a long elastic tail: nothing slides any more, and what is left are the longest
waves along the packing, which die slowly. The springs say at once how far each sphere still has to
go: K d = F, with the present overlaps' stiffnesses and the net forces F (a step of Newton's method
without the change of direction of the forces, which gains two or three digits at a time). Spheres
that slide, or that springs alone would send far, know no such rest: their own net force is left out
and they follow their neighbours.

A loose sphere that slides or rolls over many overlaps takes thousands of steps, while all others
have long come to rest. Those few and what is near them move alone among neighbours that stand
still, at some hundredths of the cost; what their neighbours then lack, springs give them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modal.dem.contacts import MovingContacts
from modal.dem.motion import DampedMotion
from modal.packing.sample import Sample
from modal.packing.state import friction_used, sizes_of_loads
from modal.solvers.conjugate_gradients import conjugate_gradients
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError

STRIDE = 1.0
"""Median overlaps that a sphere may go at once; its neighbours go nearly as far, and the overlaps
change by much less."""
LEFT_OUT = 0.05
"""Share of spheres that springs leave out above which the packing is not yet one of springs."""
ROUNDS = 3
"""Solutions until no further sphere goes too far."""
HELD = 1e-7
"""Of the mean stiffness, added to that of every sphere: the softest elastic motion of 150 layers
has 1e-5, motions without energy none."""
ERROR = 1e-2
"""Of the motion, in the energy norm. The change of stiffness on the way is off by as much."""
LOOK_BACK, MOST_PRODUCTS = 30, 3000
"""Products with K over which the error is measured, and after which the springs know of no rest."""
AT_LIMIT = 1 - 1e-9
"""Share of friction from which a contact slides: the moving contacts are cut back to exactly 1."""
FEW, PART = 0.01, 0.3
"""Largest share of spheres that are loose, and of those that move or stand around them: with more,
all had better move."""
LOOSE = 10.0
"""Net force of a loose sphere, over the mean one of all; what is less, springs still take away."""
SHELLS = 2
"""Neighbours of neighbours that may move with a loose sphere; those around them stand still."""
LOOK, MOST_STEPS = 200, 20_000
"""Steps between two looks at the part, and of all; 5,000 carry a sphere by some ten overlaps."""


def elastic_motion(contacts: MovingContacts, sample: Sample) -> Floats | None:
    """Shape (n, 6), m and rad: the motion to balance of the springs; None if they know of none.

    `sample` is what the contacts are now. None of the spheres goes further than `STRIDE` median
    overlaps, a turn counted as the arc that it makes. It is for the caller to see whether the
    forces of the law are nearer to balance there.
    """
    network = sample.network()
    system = LinearSystem(network)
    stride = STRIDE * float(np.median(network.require("overlap", "rest")))
    at_limit = friction_used(network, contacts.friction) > AT_LIMIT
    out = np.zeros(network.n_particles, bool)
    out[network.particle_i[at_limit]] = True
    out[network.particle_j[at_limit & ~network.with_wall]] = True
    for _ in range(ROUNDS):
        if out.mean() > LEFT_OUT:
            return None
        try:
            motion = _balance(system, np.where(out[:, None], 0.0, contacts.load))
        except InputError:
            return None  # stiffnesses that differ too much for the solver: damped motion goes on
        turn = motion[:, 3:] * network.radius[:, None]
        size = np.sqrt((motion[:, :3] ** 2).sum(axis=1) + (turn**2).sum(axis=1))
        far = size > stride
        if not (far & ~out).any():
            break
        out |= far
    return motion * np.minimum(1, stride / np.maximum(size, stride))[:, None]


def _balance(system: LinearSystem, load: Floats) -> Floats:
    """Shape (n, 6), m and rad: where the springs, all spheres held a little, balance `load`."""
    root, blocks, operator = system.root, system.own_blocks, system.renumbered
    held = HELD * float(np.einsum("nii->ni", blocks).mean())
    inverse = np.linalg.inv(blocks + held * np.eye(6))
    if operator.order is not None:
        inverse = inverse[operator.order]
    found = conjugate_gradients(
        lambda motion: operator.combine(motion, np.empty_like(motion), 1.0, held),
        lambda rest: (inverse @ rest.reshape(-1, 6, 1)).reshape(rest.shape),
        operator.inward(root.over(load.ravel()))[:, None],
        lambda energy: ERROR**2 * energy,
        np.zeros(1),
        look_back=LOOK_BACK,
        most_products=MOST_PRODUCTS,
    )
    return root.over(operator.outward(found.motion[:, 0])).reshape(load.shape)


def loose_rest(sample: Sample, contacts: MovingContacts, allowed: float) -> Sample | None:
    """The sample after the motion of its few loose spheres; None where they are none or many.

    `contacts` are those of the sample; `allowed`, N, is the net force (torque over radius) with
    which a sphere counts as at rest.
    """
    size = sizes_of_loads(contacts.load, contacts.radius)
    free = size > max(allowed, LOOSE * size.mean())
    if not free.any() or free.mean() > FEW:
        return None
    pairs = contacts.pairs()
    for _ in range(SHELLS):
        free |= _beside(pairs, free)
    members = free | _beside(pairs, free)
    if members.mean() > PART:
        return None
    inside = _within(sample, members)
    own = {name: getattr(sample, name) for name in ("position", "radii", "densities")}
    own = {name: data if data is None else data[members] for name, data in own.items()}
    shear = None if sample.shear is None else sample.shear[inside]
    part = MovingContacts(replace(sample, **own, shear=shear), contacts.friction)
    free = free[members]
    motion = DampedMotion(part, free)
    start, slack = part.position.copy(), 0.25 * part.skin * 2 * part.smallest
    for step in range(1, MOST_STEPS + 1):
        motion.step()
        if abs(part.position - start).max() > slack:
            break  # Spheres outside the part, which it does not know, come into reach.
        if step % LOOK == 0 and sizes_of_loads(part.load, part.radius)[free].max() <= allowed:
            break
    moved, position = part.sample(), sample.position.copy()
    position[members] = moved.position
    # The contacts of the part are as they have become, all others as they were, in order.
    whole = replace(sample, position=position, shear=None)
    theirs = _within(whole, members)
    shear = np.empty((len(theirs), 2))
    shear[theirs] = moved.shear
    shear[~theirs] = 0 if sample.shear is None else sample.shear[~inside]
    return replace(whole, shear=shear)


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
