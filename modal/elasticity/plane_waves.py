"""Plane waves of an elastic solid: velocities and polarisations along any direction.

The longest waves of a packing are those of its stiffness tensor: along the unit vector n, rho V^2
are the eigenvalues of Christoffel's matrix G_ik = C_ijkl n_j n_l, the eigenvectors the directions
in which the spheres move (B. A. Auld, Acoustic Fields and Waves in Solids, 1973, chapter 7).
"""

import numpy as np
from numpy.typing import ArrayLike

from modal.tools.arrays import Floats
from modal.tools.errors import InputError

INDEX = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
"""Of a pair of axes: its place in the order of Voigt."""


def unit_vector(direction: ArrayLike) -> Floats:
    """Shape (3,): the direction as a unit vector; InputError where it is none."""
    try:
        vector = np.asarray(direction, float)
    except (TypeError, ValueError):
        vector = np.zeros(3)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise InputError(f"direction {direction!r}: give three numbers that are not all zero")
    vector = vector / abs(vector).max()  # whose squares are numbers, however long it is
    return vector / np.linalg.norm(vector)


def plane_waves(stiffness: Floats, density: float, direction: ArrayLike) -> tuple[Floats, Floats]:
    """Velocities (3,) of the waves along a direction, m/s, the fastest first, and their motions.

    The motions (3, 3) are unit vectors in rows. `stiffness`, Pa, in Voigt's order (6, 6), or (3, 3,
    3, 3), that of a cell which carries forces; `density` in kg/m^3. A stiffness below zero, which
    is unstable or round-off, gives a negative velocity.
    """
    n, symmetric = unit_vector(direction), stiffness.ndim == 2
    whole = stiffness[INDEX[:, :, None, None], INDEX] if symmetric else stiffness
    matrix = np.einsum("ijkl,j,l->ik", whole, n, n) / density
    # Shear forces make it unsymmetric.
    square, motion = np.linalg.eigh(matrix) if symmetric else np.linalg.eig(matrix)
    order = np.argsort(square.real)[::-1]
    square, motion = square.real[order], motion.real.T[order]
    return np.sign(square) * np.sqrt(abs(square)), motion


def isotropic_mean(stiffness: Floats) -> tuple[float, float]:
    """Bulk and shear modulus, Pa, of the isotropic tensor nearest to a stiffness (6, 6).

    Nearest in the Euclidean norm of tensors; both are Voigt's means over all directions.
    """
    normal, shear = stiffness[:3, :3], np.diag(stiffness)[3:].sum()
    trace, every = np.trace(normal), normal.sum()
    return float(every / 9), float((3 * trace - every) / 30 + shear / 5)


def anisotropy(stiffness: Floats) -> float:
    """Share of a stiffness tensor (6, 6) that its nearest isotropic one leaves, in Euclidean norm.

    0 for an isotropic solid (M. Moakher and A. N. Norris, J. Elasticity 85, 215, 2006).
    """
    bulk, shear = isotropic_mean(stiffness)
    same = np.diag([2 * shear] * 3 + [shear] * 3)
    same[:3, :3] += bulk - 2 / 3 * shear
    # Mandel's weights make the norm of the matrix that of the tensor.
    weight = np.sqrt([1, 1, 1, 2, 2, 2])
    weight = np.outer(weight, weight)
    return float(np.linalg.norm(weight * (stiffness - same)) / np.linalg.norm(weight * stiffness))
