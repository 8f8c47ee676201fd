"""What the forces that the contacts carry already do to the elastic stiffness, to first order.

A packing under stress is no solid of 21 moduli: a rotation turns its forces, so that a wave asks
for all nine displacement gradients G_kl = du_k / dx_l and the nominal stress P_ij = A_ijkl G_kl;
along n, rho V^2 are the eigenvalues of A_ijkl n_j n_l (the small on large of elasticity). With the
springs alone A is the stiffness tensor C. With forces, to first order,

    V A_ab = sum over contacts of q_a . k q_b

with k the whole tangent and q_a (9) the contact's motion under the springs' own answer to gradient
a: the spheres follow the gradient, turn with it, and move beyond it. What is left out is of the
order of the square of stress over modulus.
"""

from __future__ import annotations

import numpy as np

from modal.elasticity.plane_waves import INDEX
from modal.elasticity.strain import has_walls
from modal.system.imposed import Gradients
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

NINE = Gradients(np.eye(9).reshape(9, 3, 3))
"""The gradients du_k / dx_l, l the faster."""


def refuse_walls(system: LinearSystem) -> None:
    """InputError for a slab that carries forces."""
    if system.pre_stress != "none" and has_walls(system.network):
        raise InputError(
            f"pre-stress {system.pre_stress!r}: in a slab the springs alone are known; take none, "
            "or a cell periodic in all directions"
        )


def stressed_stiffness(system: LinearSystem, non_affine: Floats) -> Floats:
    """Shape (3, 3, 3, 3), Pa: A of a cell periodic in all directions; not always symmetric.

    `non_affine` (6, n, 6): what the springs let each sphere do beyond the six unit strains.
    """
    coupling = system.put_on(NINE)
    u = non_affine[INDEX.ravel()].reshape(9, -1).T
    resisted = system.root.times(system.operator.apply(system.root.times(u)))
    energy = coupling.held - u.T @ coupling.push - coupling.pull.T @ u + u.T @ resisted
    return (energy / (system.network.area * system.network.length)).reshape(3, 3, 3, 3)
