"""The last steps to rest: where springs put a packing.

Damped motion ends in a long elastic tail: nothing slides any more, and what is left are the longest
waves along the packing, which die slowly. The springs say at once how far each sphere still has to
go: K d = F, with the present overlaps' stiffnesses and the net forces F (a step of Newton's method
without the change of direction of the forces, which gains two or three digits at a time). Spheres
that slide, or that springs alone would send far, know no such rest: their own net force is left out
and they follow their neighbours.
"""

from __future__ import annotations

import numpy as np

from modal.dem.contacts import MovingContacts
from modal.packing.sample import Sample
from modal.packing.state import friction_used
from modal.solvers.conjugate_gradients import conjugate_gradients
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
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
