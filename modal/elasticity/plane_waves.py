"""Compute plane waves of an elastic solid: velocities and polarisations along any direction.

The longest waves of a packing are those of its stiffness tensor: along the unit vector n, rho V^2
are the eigenvalues of Christoffel's matrix G_ik = C_ijkl n_j n_l, the eigenvectors the directions
in which the spheres move (B. A. Auld, Acoustic Fields and Waves in Solids, 1973, chapter 7).
"""

import numpy as np
from numpy.typing import ArrayLike

from modal.tools.arrays import Floats
from modal.tools.errors import InputError

INDEX = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
"""Index in Voigt's order of each pair of axes."""


def unit_vector(direction: ArrayLike) -> Floats:
    """Return the unit vector (3,) along a direction; InputError for a zero vector."""
    try:
        vector = np.asarray(direction, float)
    except (TypeError, ValueError):
        vector = np.zeros(3)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise InputError(
            "direction",
            f"direction {direction!r}",
            remedy="give three numbers that are not all zero",
        )
    vector = vector / abs(vector).max()  # so that no square overflows or vanishes
    return vector / np.linalg.norm(vector)


def plane_waves(stiffness: Floats, density: float, direction: ArrayLike) -> tuple[Floats, Floats]:
    """Return the velocities and polarisations of the plane waves along a direction.

    Parameters
    ----------
    stiffness : ndarray (6, 6) or (3, 3, 3, 3)
        Stiffness, Pa: in Voigt's order, or that of a cell that carries forces.
    density : float
        Density, kg/m^3.
    direction : array_like (3,)

    Returns
    -------
    velocity : ndarray (3,)
        Velocities, m/s, the fastest first. A negative eigenvalue, which is unstable or round-off,
        gives a negative velocity.
    motion : ndarray (3, 3)
        Unit vectors of the motion in rows.
    """
    n = unit_vector(direction)
    symmetric = stiffness.ndim == 2
    tensor = stiffness
    if symmetric:
        tensor = stiffness[INDEX[:, :, None, None], INDEX]
    christoffel = np.einsum("ijkl,j,l->ik", tensor, n, n) / density
    if symmetric:
        square, motion = np.linalg.eigh(christoffel)
    else:
        square, motion = np.linalg.eig(christoffel)
    order = np.argsort(square.real)[::-1]
    square = square.real[order]
    motion = motion.real.T[order]
    return np.sign(square) * np.sqrt(abs(square)), motion


def isotropic_mean(stiffness: Floats) -> tuple[float, float]:
    """Return bulk and shear modulus, Pa, of the isotropic tensor nearest to a stiffness (6, 6).

    Nearest means in the Euclidean norm of tensors; both are Voigt's means over all directions.
    """
    bulk, shear = isotropic_means(stiffness)
    return float(bulk), float(shear)


def isotropic_means(stiffness: Floats) -> tuple[Floats, Floats]:
    """Return bulk and shear moduli (...,) of many stiffnesses (..., 6, 6), as `isotropic_mean`."""
    diagonal = np.diagonal(stiffness, axis1=-2, axis2=-1)
    trace = diagonal[..., :3].sum(axis=-1)
    shear_trace = diagonal[..., 3:].sum(axis=-1)
    total = stiffness[..., :3, :3].sum(axis=(-2, -1))
    return total / 9, (3 * trace - total) / 30 + shear_trace / 5


def anisotropy(stiffness: Floats) -> float:
    """Return the relative distance of a stiffness (6, 6) from the nearest isotropic tensor.

    The distance is divided by the norm of the stiffness.

    The norm is the Euclidean one of tensors; the result is 0 for an isotropic solid (M. Moakher and
    A. N. Norris, J. Elasticity 85, 215, 2006).
    """
    bulk, shear = isotropic_mean(stiffness)
    isotropic = np.diag([2 * shear] * 3 + [shear] * 3)
    isotropic[:3, :3] += bulk - 2 / 3 * shear
    # Mandel's weights turn the norm of the matrix into that of the tensor.
    weight = np.sqrt([1, 1, 1, 2, 2, 2])
    weights = np.outer(weight, weight)
    difference = np.linalg.norm(weights * (stiffness - isotropic))
    return float(difference / np.linalg.norm(weights * stiffness))
