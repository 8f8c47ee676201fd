"""What the forces that the contacts carry already do to the elastic stiffness, to first order.

A packing under stress is no solid of 21 moduli: a rotation turns its forces, so that a wave asks
for all nine displacement gradients G_kl = du_k / dx_l and the nominal stress P_ij = A_ijkl G_kl;
along n, rho V^2 are the eigenvalues of A_ijkl n_j n_l (the small on large of elasticity). With the
springs alone A is the stiffness tensor C. The tangent of the law adds dk to each contact, and to
first order

    V dA_ab = sum over contacts of q_a . dk q_b

with q_a (9) the contact's motion under the springs' own answer to gradient a: the spheres follow
the gradient, turn with it, and move beyond it. What is left out is of the order of the square of
stress over modulus.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from modal.elasticity.moduli import ElasticModuli
from modal.elasticity.strain import has_walls
from modal.elasticity.waves import INDEX, unit_vector
from modal.packing.network import Network
from modal.system.contacts import Contacts, terms_of
from modal.system.imposed import Gradients
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

AT_ONCE = 20_000
"""Contacts whose 9 x 9 tangents are held at once."""


def stressed_stiffness(network: Network, moduli: ElasticModuli, pre_stress: str) -> Floats:
    """Shape (3, 3, 3, 3), Pa: A of a cell periodic in all directions, not symmetric.

    `moduli` are those of its springs, with `non_affine`; `pre_stress` is one of `TANGENTS`
    (`modal.system.contacts`). InputError for a packing with walls.
    """
    if moduli.non_affine is None:
        raise InputError("the moduli lack the motions; ask for non_affine")
    if has_walls(network):
        raise InputError(
            f"pre-stress {pre_stress!r}: in a slab the springs alone are known; take none, or a "
            "cell periodic in all directions"
        )
    change = np.zeros((9, 9))
    for first in range(0, network.n_contacts, AT_ONCE):
        rows = np.arange(first, min(first + AT_ONCE, network.n_contacts))
        some = network.some(rows)
        dk = Contacts.of(some, terms_of(pre_stress)).tangent() - Contacts.of(some).tangent()
        q = _motion(some, moduli.non_affine)
        change += np.einsum("aci,cij,bcj->ab", q, dk, q, optimize=True)
    springs = moduli.stiffness[INDEX[:, :, None, None], INDEX[None, None]]
    volume = network.area * network.length
    return springs + change.reshape(3, 3, 3, 3) / volume


def _motion(network: Network, non_affine: Floats) -> Floats:
    """Shape (9, m, 9): motions of the contacts under the gradients du_k / dx_l, l the faster."""
    unit = np.eye(9).reshape(9, 3, 3)
    q = Gradients(unit).on(network)
    contacts = Contacts.of(network)
    for row, (moved, along) in zip(q, np.ndindex(3, 3), strict=True):
        row += contacts.motion(non_affine[INDEX[moved, along]])
    return q


def stressed_velocities(stiffness: Floats, density: float, direction: ArrayLike) -> Floats:
    """Shape (3,), m/s, the fastest first: the longest waves along a direction of a stressed cell.

    `stiffness` as of `stressed_stiffness`, whose parts in shear forces make it unsymmetric.
    """
    n = unit_vector(direction)
    square = np.linalg.eigvals(np.einsum("ijkl,j,l->ik", stiffness, n, n) / density).real
    square.sort()
    velocity: Floats = (np.sign(square) * np.sqrt(abs(square)))[::-1]
    return velocity
