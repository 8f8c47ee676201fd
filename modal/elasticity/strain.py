"""Define the six strains of a cell, and the stiffness of a packing that carries forces.

A uniform displacement gradient G moves a centre at x by G x, and moves periods and walls alike. The
spheres turn with the rotation in G. `modal.system.imposed` computes the motion of the contacts.
Shears yz and zx slide horizontal planes over each other, as walls can; the rotation that G contains
has no effect on a packing that is free to turn.

A packing under stress is not a solid with 21 moduli: a rotation turns its forces, so that a wave
depends on all nine displacement gradients G_kl = du_k / dx_l, and the nominal stress is
P_ij = A_ijkl G_kl. Along n, rho V^2 are the eigenvalues of A_ijkl n_j n_l (small motions
superimposed on large ones). With the springs alone A is the stiffness tensor C. With forces, to
first order,

    V A_ab = sum over contacts of q_a . k q_b

with k the whole tangent and q_a (9) the motion of the contact under gradient a, computed with the
springs alone: the spheres follow the gradient, turn with it, and move beyond it. The terms that are
left out are of the order of the square of stress divided by modulus.
"""

import numpy as np

from modal.elasticity.plane_waves import INDEX
from modal.packing.ends import has_two_ends
from modal.system.imposed import Gradients
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import InputError, UnavailableError

STRAINS = ("xx", "yy", "zz", "yz", "zx", "xy")
"""Names of the strains, in Voigt's order."""
AXES = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
"""For each strain: the axis along which points move, and the axis along which the motion grows."""
ALL_GRADIENTS = Gradients(np.eye(9).reshape(9, 3, 3))
"""The nine gradients du_k / dx_l; l varies faster."""
UNIT_STRAINS = Gradients(ALL_GRADIENTS.gradient[[3 * moving + along for moving, along in AXES]])
"""The six unit strains that the spheres follow; shear strains are angles."""


def has_walls(system: LinearSystem) -> bool:
    """Tell whether a packing stands between two walls along z; False if it is periodic along z.

    Walls are flat, or rough (`modal.packing.ends`).

    Raises InputError for a packing that cannot be strained: one that is not periodic along x and y,
    one that is neither periodic along z nor touches two walls, or a slab with pre-stress.
    """
    network = system.network
    for axis in np.flatnonzero(~network.cell_periodic[:2]):
        raise UnavailableError(
            "not_periodic",
            f"no strain {STRAINS[axis]} can be put on this packing",
            "it is not periodic along "
            f"{'xy'[axis]}; moduli need periods along x and y, and periods or walls along z",
            "`python -m modal moduli --inside XLO XHI YLO YHI ZLO ZHI` measures those of a box "
            "inside it; `wave` sends a wave from a wall, or with --plane Z from inside",
        )
    if network.cell_periodic[2]:
        return False
    if not has_two_ends(network):
        raise UnavailableError(
            "no_walls",
            "no strain zz can be put on this packing",
            "it is not periodic along z and does not touch two walls there",
            "`python -m modal moduli --inside XLO XHI YLO YHI ZLO ZHI` measures those of a box "
            "inside it, --layers FILE.csv velocities by depth; `wave` sends a wave from its wall, "
            "or with --plane Z from inside",
        )
    if system.pre_stress != "none":
        raise InputError(
            "pre_stress",
            f"pre-stress {system.pre_stress!r}",
            "in a slab the springs alone are known",
            "take none, or a cell periodic in all directions",
        )
    return True


def stressed_stiffness(system: LinearSystem, non_affine: Floats) -> Floats:
    """Return the stiffness A (3, 3, 3, 3), Pa, of a cell that is periodic in all directions.

    A is not always symmetric. `non_affine` (6, n, 6) is the motion of each sphere, on the springs
    alone, beyond each of the six unit strains.
    """
    coupling = system.put_on(ALL_GRADIENTS)
    motion = non_affine[INDEX.ravel()].reshape(9, -1).T
    force = system.sqrt_mass.times(system.operator.apply(system.sqrt_mass.times(motion)))
    energy = coupling.held - motion.T @ coupling.push - coupling.pull.T @ motion + motion.T @ force
    volume = system.network.area * system.network.length
    return (energy / volume).reshape(3, 3, 3, 3)
