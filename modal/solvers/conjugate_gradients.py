"""Preconditioned conjugate gradients for several loads at once, stopped by the error in energy.

What the solutions give up in energy is what a stiffness or a compliance computed from them is off.
The steps say how much that is: each lowers the squared error in the energy norm by exactly its
length times the preconditioned residual (M. R. Hestenes and E. Stiefel, J. Res. Nat. Bur. Standards
49, 409, 1952, Eq. 6.1), so that the sum over a few more steps is the error before them, from below
(Z. Strakos and P. Tichy, Electron. Trans. Numer. Anal. 13, 56, 2002).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.tools.progress import Minute

SHARE = 0.25
"""Of the steps: where hundreds are needed, some tens may gain little before others gain more."""
FLAT = 1e-7
"""Cosine between a step and the force against it, below which the step is a motion without energy
that round-off has put in. A mixture of modes has 2 / sqrt(ratio of their omega^2) or more."""


@dataclass(frozen=True)
class Solution:
    """Solutions of A x = b for k loads.

    motion, residual b - A x (size, k); `energy_error` (k,), x^T A x / 2 of what x is off by at
    most, times 2; `products` with A, each of all loads at once.
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
    """Solve A x = b for the columns of `load` (size, k), A symmetric and never negative.

    `apply_stiffness` gives A x, `preconditioner` a symmetric approximation of its inverse, both of
    (size, k) arrays. `allowed` tells the squared error in the energy norm (k,), (x - x')^T A
    (x - x'), at which a column is done, from the energy b^T x (k,) that it has come to. The error
    is measured over the last `look_back` steps, 1 where the preconditioner is nearly the inverse,
    some tens where it is not, and over the last `SHARE` of all steps where these are more. `noise`
    (k,): norm of what round-off leaves of a load, below which a column is left alone. A may be
    singular where the load is in its range: the motions without energy are then those that the
    preconditioner puts in. InputError where `most_products` do not suffice.
    """
    motion, rest = np.zeros_like(load), load.copy()
    eased = preconditioner(rest)
    step = eased.copy()
    size = np.einsum("ik,ik->k", rest, eased)
    gains, energy = np.empty((most_products, load.shape[1])), np.zeros(load.shape[1])
    minute = Minute()
    for products in range(1, most_products + 1):
        stretched = apply_stiffness(step)
        curvature = np.einsum("ik,ik->k", step, stretched)
        flat = FLAT * np.linalg.norm(step, axis=0) * np.linalg.norm(stretched, axis=0)
        moving = (curvature > flat) & (np.linalg.norm(rest, axis=0) > noise)
        length = np.where(moving, size / np.where(moving, curvature, 1), 0.0)
        motion += length * step
        rest -= length * stretched
        gains[products - 1] = length * size
        energy += gains[products - 1]
        back = max(look_back, int(SHARE * products))
        error, bound = gains[max(products - back, 0) : products].sum(axis=0), allowed(energy)
        if products >= back and (error <= bound).all():
            return Solution(motion, load - apply_stiffness(motion), error, products + 1)
        if minute.passed():
            minute.tell(f"static response: {products} products with K, of at most {most_products}")
        eased = preconditioner(rest)
        before, size = size, np.einsum("ik,ik->k", rest, eased)
        step *= np.where(before > 0, size / np.where(before > 0, before, 1), 0.0)
        step += eased
    worst = float((error / bound).max())
    raise InputError(
        f"the springs do not balance the load: after {most_products} products with K the error in "
        f"energy is still {worst:.1e} times what was asked; ask for a larger tolerance, or take "
        "a packing whose stiffnesses differ less"
    )
