"""Solve for several loads at once by preconditioned conjugate gradients, to an error in energy.

The loads share all search directions: each step minimises the energy of every solution over the
directions of all of them (D. P. O'Leary, Linear Algebra Appl. 29, 293, 1980). Soft local motions,
which cost a single load one or more steps each, then cost fewer: before soft pairs were eliminated
(`modal.solvers.elimination`), the moduli of 125,000 spheres with 4.2 contacts took 114 steps with
six loads together, and 320 with each load alone. Directions that have become dependent are left
out (H. Ji and Y. Li, BIT Numer. Math. 57, 379, 2017).

A stiffness or a compliance that is computed from the solutions has an error equal to the error of
the energy. The steps show this error: each lowers the squared error in the energy norm by its gain
of energy (M. R. Hestenes and E. Stiefel, J. Res. Nat. Bur. Standards 49, 409, 1952, Eq. 6.1). The
sum over a few more steps is therefore a lower bound of the error before them (Z. Strakos and P.
Tichy, Electron. Trans. Numer. Anal. 13, 56, 2002).
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
MIN_INDEPENDENCE = 1e-10
"""Least eigenvalue of the scalar products of directions of length 1 that counts as independent:
round-off of a direction with it is 1e-6."""


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
        Largest number of steps, each a product with A. One more product gives the residual.

    Raises
    ------
    UnavailableError
        If `most_products` do not suffice; code "not_converged".
    """
    motion = np.zeros_like(load)
    residual = load.copy()
    gains = np.zeros((most_products, load.shape[1]))
    energy = np.zeros(load.shape[1])
    direction = _independent(_preconditioned(preconditioner, residual, noise))
    minute = Minute()
    for products in range(1, most_products + 1):
        if direction.shape[1] == 0:
            error = np.zeros(load.shape[1])
            return Solution(motion, load - apply_stiffness(motion), error, products)
        force = apply_stiffness(direction)
        step = _unit_steps(direction, force)
        lengths = step.T @ (direction.T @ residual)
        motion += direction @ (step @ lengths)
        residual -= force @ (step @ lengths)
        gains[products - 1] = (lengths**2).sum(axis=0)
        energy += gains[products - 1]
        back = max(look_back, int(LOOK_BACK_SHARE * products))
        error = gains[max(products - back, 0) : products].sum(axis=0)
        bound = allowed(energy)
        if products >= back and (error <= bound).all():
            return Solution(motion, load - apply_stiffness(motion), error, products + 1)
        if minute.passed():
            minute.tell(f"static response: {products} products with K, of at most {most_products}")
        following = _preconditioned(preconditioner, residual, noise)
        following -= direction @ (step @ (step.T @ (force.T @ following)))
        direction = _independent(following)
    worst = float((error / bound).max())
    raise UnavailableError(
        "not_converged",
        "the springs do not balance the load",
        f"after {most_products} products with K the error in "
        f"energy is still {worst:.1e} times what was asked",
        "ask for a larger tolerance, or take a packing whose stiffnesses differ less",
    )


def _preconditioned(
    preconditioner: Callable[[Floats], Floats], residual: Floats, noise: Floats
) -> Floats:
    """Return the preconditioned residuals (size, j) of the columns that are more than noise."""
    is_moving = np.einsum("ik,ik->k", residual, residual) > noise**2
    if is_moving.all():
        return preconditioner(residual)
    moving = residual[:, is_moving]
    return preconditioner(moving) if is_moving.any() else moving


def _unit_steps(direction: Floats, force: Floats) -> Floats:
    """Return combinations T (j, i) of directions P with T^T P^T A P T = 1, where `force` is A P.

    Combinations without energy are left out.
    """
    curvature = direction.T @ force
    stiffness, combination = np.linalg.eigh((curvature + curvature.T) / 2)
    opposing = combination.T @ (force.T @ force) @ combination
    norm = np.sqrt(opposing.diagonal().clip(0.0))
    bears = stiffness > MIN_CURVATURE_COSINE * norm
    return combination[:, bears] / np.sqrt(stiffness[bears])


def _independent(directions: Floats) -> Floats:
    """Return orthonormal combinations (size, i) of directions (size, j), without dependent ones."""
    products = directions.T @ directions
    length = np.sqrt(products.diagonal())
    length[length == 0] = 1.0
    size, combination = np.linalg.eigh(products / np.outer(length, length))
    is_new = size > MIN_INDEPENDENCE
    return directions @ (combination[:, is_new] / np.sqrt(size[is_new]) / length[:, None])
