"""Six strains of a cell, and what each does to the contacts while no sphere leaves the mean field.

A uniform displacement gradient G moves the centre at x by G x, and what is periodic or touches a
wall with it. The spheres turn with the rotation in G. What the strains do to the contacts is in
`modal.system.imposed`. Shears with z slide horizontal planes over each other, as walls can; which
rotation is in G makes no difference to a packing that is free to turn.

A packing under stress is no solid of 21 moduli: a rotation turns its forces, so that a wave asks
for all nine displacement gradients G_kl = du_k / dx_l and the nominal stress P_ij = A_ijkl G_kl;
along n, rho V^2 are the eigenvalues of A_ijkl n_j n_l (the small on large of elasticity). With the
springs alone A is the stiffness tensor C. With forces, to first order,

    V A_ab = sum over contacts of q_a . k q_b

with k the whole tangent and q_a (9) the contact's motion under the springs' own answer to gradient
a: the spheres follow the gradient, turn with it, and move beyond it. What is left out is of the
order of the square of stress over modulus.
"""

import numpy as np

from modal.elasticity.plane_waves import INDEX
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.system.imposed import Gradients
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

STRAINS = ("xx", "yy", "zz", "yz", "zx", "xy")
"""Names of the strains, in the order of Voigt."""
AXES = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
"""Of each: the direction that moves, and that along which the displacement grows."""
NINE = Gradients(np.eye(9).reshape(9, 3, 3))
"""The gradients du_k / dx_l, l the faster."""
STRAINED = Gradients(NINE.gradient[[3 * moving + along for moving, along in AXES]])
"""All spheres follow the six unit strains; shear strains are angles."""


def has_walls(system: LinearSystem) -> bool:
    """Whether the packing stands between two walls along z, and is periodic sideways.

    False where it is periodic in all directions. InputError where it is neither, since there is no
    way to strain it, and for a slab that carries forces.
    """
    network = system.network
    for axis in np.flatnonzero(~network.cell_periodic[:2]):
        raise InputError(
            f"no strain {STRAINS[axis]} can be put on this packing: it is not periodic along "
            f"{'xy'[axis]}; moduli need periods along x and y, and periods or walls along z"
        )
    if network.cell_periodic[2]:
        return False
    if not {SOURCE_WALL, RECEIVER_WALL} <= {*np.unique(network.particle_j).tolist()}:
        raise InputError(
            "no strain zz can be put on this packing: it is not periodic along z and does not "
            "touch two walls there"
        )
    if system.pre_stress != "none":
        raise InputError(
            f"pre-stress {system.pre_stress!r}: in a slab the springs alone are known; take none, "
            "or a cell periodic in all directions"
        )
    return True


def stressed_stiffness(system: LinearSystem, non_affine: Floats) -> Floats:
    """Shape (3, 3, 3, 3), Pa: A of a cell periodic in all directions; not always symmetric.

    `non_affine` (6, n, 6): what the springs let each sphere do beyond the six unit strains.
    """
    coupling = system.put_on(NINE)
    u = non_affine[INDEX.ravel()].reshape(9, -1).T
    resisted = system.root.times(system.operator.apply(system.root.times(u)))
    energy = coupling.held - u.T @ coupling.push - coupling.pull.T @ u + u.T @ resisted
    return (energy / (system.network.area * system.network.length)).reshape(3, 3, 3, 3)
