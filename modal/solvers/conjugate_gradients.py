"""Preconditioned conjugate gradients for several loads at once, stopped by the error in energy.

What the solutions give up in energy is what a stiffness or a compliance computed from them is off.
The steps say how much that is: each lowers the squared error in the energy norm by exactly its
length times the preconditioned residual (M. R. Hestenes and E. Stiefel, J. Res. Nat. Bur. Standards
49, 409, 1952, Eq. 6.1), so that the sum over a few more steps is the error before them, from below
(Z. Strakos and P. Tichy, Electron. Trans. Numer. Anal. 13, 56, 2002).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modal.formats.arrays import Floats
from modal.formats.hdf5 import InputError


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
    resist: Callable[[Floats], Floats],
    ease: Callable[[Floats], Floats],
    load: Floats,
    allowed: Floats,
    noise: Floats,
    *,
    look_back: int,
    most_products: int,
) -> Solution:
    """Solve A x = b for the columns of `load` (size, k), A symmetric and never negative.

    `resist` gives A x, `ease` a symmetric approximation of its inverse, both of (size, k) arrays.
    `allowed` (k,): squared error in the energy norm, (x - x')^T A (x - x'), at which a column is
    done. It is measured over the last `look_back` steps: 1 where `ease` is nearly the inverse, some
    tens where it is not. `noise` (k,): norm of what round-off leaves of a load, below which a
    column is left alone. A may be singular where the load is in its range: the motions without
    energy are then those that `ease` puts in. InputError where `most_products` do not suffice.
    """
    motion, rest = np.zeros_like(load), load.copy()
    eased = ease(rest)
    step = eased.copy()
    size = np.einsum("ik,ik->k", rest, eased)
    gains: list[Floats] = []
    for products in range(1, most_products + 1):
        stretched = resist(step)
        curvature = np.einsum("ik,ik->k", step, stretched)
        moving = (curvature > 0) & (np.linalg.norm(rest, axis=0) > noise)
        length = np.where(moving, size / np.where(moving, curvature, 1), 0.0)
        motion += length * step
        rest -= length * stretched
        gains.append(length * size)
        error = np.sum(gains[-look_back:], axis=0)
        if len(gains) >= look_back and (error <= allowed).all():
            return Solution(motion, load - resist(motion), error, products + 1)
        eased = ease(rest)
        before, size = size, np.einsum("ik,ik->k", rest, eased)
        step *= np.where(before > 0, size / np.where(before > 0, before, 1), 0.0)
        step += eased
    worst = float((error / allowed).max())
    raise InputError(
        f"the springs do not balance the load: after {most_products} products with K the error in "
        f"energy is still {worst:.1e} times what was asked; ask for a larger tolerance, or take "
        "a packing whose stiffnesses differ less"
    )
