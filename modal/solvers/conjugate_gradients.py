"""Solve for several loads at once by preconditioned conjugate gradients, to an error in energy.

A stiffness or a compliance that is computed from the solutions has an error equal to the error of
the energy. The steps show this error: each lowers the squared error in the energy norm by exactly
its length times the preconditioned residual (M. R. Hestenes and E. Stiefel, J. Res. Nat. Bur.
Standards 49, 409, 1952, Eq. 6.1). The sum over a few more steps is therefore a lower bound of the
error before them (Z. Strakos and P. Tichy, Electron. Trans. Numer. Anal. 13, 56, 2002).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError
from modal.tools.progress import Minute

LOOK_BACK_SHARE = 0.25
"""Share of all steps over which the error is measured: if hundreds of steps are needed, tens of
them may reduce the error little before others reduce it more."""
MIN_CURVATURE_COSINE = 1e-7
"""Least cosine between a step and the force that opposes the step. Below it the step is a motion
without energy that comes from round-off. A mixture of modes has at least 2 / sqrt(ratio of their
omega^2)."""


@dataclass(frozen=True)
class Solution:
    """The solutions of A x = b for k loads.

    Attributes
    ----------
    motion : ndarray (size, k)
        The solutions x.
    residual : ndarray (size, k)
        The residuals b - A x.
    energy_error : ndarray (k,)
        Squared error in the energy norm, e^T A e, of the error e of x.
    products : int
        Number of products with A, each of all loads at once.
    """

    motion: Floats
    residual: Floats
    energy_error: Floats
    products: int


def conjugate_gradients(
    apply_stiffness: Callable[[Floats], Floats],
    preconditioner: Callable[[Floats], Floats],
    load: Floats,
    allowed: Callable[[Floats], Floats],
    noise: Floats,
    *,
    look_back: int,
    most_products: int,
) -> Solution:
    """Solve A x = b for the columns of a load, A symmetric and positive semidefinite.

    A may be singular where the load is in its range; the solutions may then contain motions without
    energy, which come from the preconditioner.

    Parameters
    ----------
    apply_stiffness, preconditioner : callable
        Functions that apply A, and a symmetric approximation of its inverse, to an array (size, k).
    load : ndarray (size, k)
        The loads b.
    allowed : callable
        Function that returns the allowed squared error in the energy norm (k,) from the energy b^T
        x (k,) of the present solutions.
    noise : ndarray (k,)
        Norm of a residual that is only round-off; a column below it is not iterated further.
    look_back : int
        Least number of steps over which the error is measured: 1 if the preconditioner is nearly
        the inverse, some tens otherwise. `LOOK_BACK_SHARE` of all steps is used if this is more.
    most_products : int
        Largest number of products with A.

    Raises
    ------
    InputError
        If `most_products` do not suffice; code "not_converged".
    """
    motion = np.zeros_like(load)
    residual = load.copy()
    preconditioned = preconditioner(residual)
    direction = preconditioned.copy()
    size = _column_products(residual, preconditioned)
    gains = np.empty((most_products, load.shape[1]))
    energy = np.zeros(load.shape[1])
    minute = Minute()
    for products in range(1, most_products + 1):
        force = apply_stiffness(direction)
        curvature = _column_products(direction, force)
        round_off = (
            MIN_CURVATURE_COSINE * np.linalg.norm(direction, axis=0) * np.linalg.norm(force, axis=0)
        )
        moving = (curvature > round_off) & (np.linalg.norm(residual, axis=0) > noise)
        length = np.where(moving, size / np.where(moving, curvature, 1), 0.0)
        motion += length * direction
        residual -= length * force
        gains[products - 1] = length * size
        energy += gains[products - 1]
        back = max(look_back, int(LOOK_BACK_SHARE * products))
        error = gains[max(products - back, 0) : products].sum(axis=0)
        bound = allowed(energy)
        if products >= back and (error <= bound).all():
            return Solution(motion, load - apply_stiffness(motion), error, products + 1)
        if minute.passed():
            minute.tell(f"static response: {products} products with K, of at most {most_products}")
        preconditioned = preconditioner(residual)
        size_before = size
        size = _column_products(residual, preconditioned)
        advanced = size_before > 0
        direction *= np.where(advanced, size / np.where(advanced, size_before, 1), 0.0)
        direction += preconditioned
    worst = float((error / bound).max())
    raise UnavailableError(
        "not_converged",
        "the springs do not balance the load",
        f"after {most_products} products with K the error in "
        f"energy is still {worst:.1e} times what was asked",
        "ask for a larger tolerance, or take a packing whose stiffnesses differ less",
    )


def _column_products(a: Floats, b: Floats) -> Floats:
    """Return the scalar product (k,) of each pair of columns of two arrays (size, k)."""
    return np.einsum("ik,ik->k", a, b)
