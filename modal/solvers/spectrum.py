"""Bound the spectrum of A = M^-1/2 K M^-1/2, and find its highest mode in little memory.

A Chebyshev recurrence needs an interval that holds all omega^2. The largest Ritz value of Lanczos
from a random vector approaches the top from below. The steps themselves show how far below: vector
k + 1 is p_k(A) times the first one, with a polynomial p_k that rises beyond the largest Ritz value.
As no vector is longer than 1, a mode at some larger omega^2 has a component of the first vector
below 1 / p_k there. The probability of this for a random vector follows from its dimension alone
(J. L. M. van Dorsselaer, M. E. Hochstenbach, H. A. van der Vorst, SIAM J. Matrix Anal. Appl. 22,
837, 2000).

Finding the highest mode by running Lanczos twice takes only the memory of a few vectors. The
largest Ritz value of plain Lanczos needs no orthogonal basis: round-off brings back only copies of
values that have converged (C. C. Paige, Linear Algebra Appl. 34, 235, 1980). The first pass finds
how the mode is composed of the Lanczos vectors; the second pass computes the same vectors again, to
the bit, and adds them up. Therefore a mode of millions of spheres fits into the memory, and
products with A take nearly all of the time.
"""

from collections.abc import Iterator
from itertools import islice

import numpy as np
from scipy.linalg import eigh_tridiagonal

from modal.solvers.chebyshev import ScaledOperator
from modal.solvers.lanczos import TOLERANCE, Nearest, start_block
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.tools.progress import progress

MARGIN = 0.04
"""Distance of the bound from the largest Ritz value, divided by this value. An interval that is 1 %
larger costs the recurrence 0.5 % more products; half the margin costs the bound itself a third
more."""
FAILURE_PROBABILITY = 1e-6
"""Probability with which `bound_of_spectrum` may be too low."""
ROWS_TOGETHER = 2**16
"""Number of entries of a vector that are processed together, so that intermediate results stay in a
cache."""
ROUND_OFF_GROWTH = 100 * np.finfo(float).eps
"""Growth of a recurrence by round-off, divided by the square of its order: each order makes an
error, and each error grows at most by a factor of the order."""
GROWTH = {"full": 10.0, "law": 10.0}
"""Largest growth that is allowed for each pre-stress whose tangent is not symmetric, so that its
eigenvectors are not orthogonal. Stable packings of DEM runs showed no growth. Errors relative to a
tolerance grow by the same factor as vectors."""
STEPS_BETWEEN_CHECKS = 5
"""Steps of Lanczos between two computations of the largest Ritz value."""
LanczosStep = tuple[list[float], list[float], Floats]
"""Diagonal and off-diagonal numbers (k each) of the tridiagonal matrix, and vector k (size,)."""


class GrowthError(InputError):
    """Raised if a recurrence grows although it should not, because K has a negative direction."""

    def __init__(self) -> None:
        super().__init__(
            "unstable",
            "the recurrence grows",
            "the network is unstable (strong pre-stress or negative stiffness)",
            "take pre-stress none",
        )


def largest_growth(operator: ScaledOperator, order: int) -> float:
    """Return the limit of |T_order(X) c| / |c|; beyond it, omega^2 lie outside the interval.

    X maps an interval that contains the whole spectrum of omega^2 to -1 ... 1.
    """
    limit = GROWTH.get(operator.pre_stress, 1.0)
    return limit + ROUND_OFF_GROWTH * order**2


def bound_of_spectrum(operator: ScaledOperator) -> tuple[float, int]:
    """Return an upper bound of omega^2, 1/s^2, and the number of products with A that it took.

    The bound is too low with a probability of at most `FAILURE_PROBABILITY`; it exceeds the highest
    omega^2 by at most `MARGIN`, whatever the spectrum. A must be symmetric.
    """
    size = operator.shape[0]
    # A component of a random unit vector is below x with a probability below x sqrt(2 size / pi).
    needed_rise = np.sqrt(2 * size / np.pi) / FAILURE_PROBABILITY
    steps = lanczos_steps(operator, start_block(size, 1)[:, 0])
    for diagonal, off_diagonal, _ in islice(steps, size):
        ritz_values = eigh_tridiagonal(
            np.array(diagonal), np.array(off_diagonal[:-1]), eigvals_only=True
        )
        bound = float(ritz_values[-1] + MARGIN * abs(ritz_values[-1]))
        # p_k is the product over its zeros, which are the Ritz values.
        if off_diagonal[-1] == 0 or np.prod((bound - ritz_values) / off_diagonal) >= needed_rise:
            break
    return max(bound, 0.0), len(diagonal)


def lanczos_steps(operator: ScaledOperator, start: Floats) -> Iterator[LanczosStep]:
    """Yield, at step k, the tridiagonal matrix so far and Lanczos vector k (size,).

    The last off-diagonal number couples the vector to the next one; it is zero if there is no next
    vector. A vector is overwritten two steps later.
    """
    now = start / norm(start)
    del start  # a vector of millions of spheres takes half a gigabyte
    before = np.zeros_like(now)
    scale = 0.0
    diagonal: list[float] = []
    off_diagonal: list[float] = []
    while not off_diagonal or off_diagonal[-1] > 0:
        coupling = off_diagonal[-1] if off_diagonal else 0.0
        # A now - coupling before, in the array of the vector before.
        ahead = operator.combine(now, before, 1.0, gamma=-coupling)
        diagonal.append(dot(ahead, now))
        for first in range(0, len(now), ROWS_TOGETHER):
            rows = slice(first, first + ROWS_TOGETHER)
            ahead[rows] -= diagonal[-1] * now[rows]
        beta = norm(ahead)
        scale = max(scale, abs(diagonal[-1]) + beta)
        if beta <= 1e-12 * scale:
            beta = 0.0
        off_diagonal.append(beta)
        yield diagonal, off_diagonal, now
        if beta > 0:
            ahead /= beta
            before, now = now, ahead


def dot(a: Floats, b: Floats) -> float:
    """Return the scalar product, without BLAS.

    For vectors the threads of BLAS cost more than they save, and they wait for cores that other
    programs use.
    """
    return float(np.einsum("i,i", a, b))


def norm(a: Floats) -> float:
    """Return the length of a vector."""
    return float(np.sqrt(dot(a, a)))


def top_mode(operator: ScaledOperator, most: int) -> Nearest:
    """Find the largest eigenpair of A within `most` steps.

    A residual of `TOLERANCE` relative to the eigenvalue counts as converged, as in
    `modal.solvers.lanczos`. A converged mode takes two products for each step; a mode that has not
    converged is returned without its vector.
    """
    start = start_block(operator.shape[0], 1)[:, 0]
    vector: Floats = np.zeros((len(start), 1))
    steps = zip(progress(most, "Lanczos"), lanczos_steps(operator, start), strict=False)
    for k, (diagonal, off_diagonal, _) in steps:
        ended = k == most - 1 or off_diagonal[-1] == 0
        if k % STEPS_BETWEEN_CHECKS < STEPS_BETWEEN_CHECKS - 1 and not ended:
            continue
        square, shares = eigh_tridiagonal(
            np.array(diagonal), np.array(off_diagonal[:-1]), select="i", select_range=(k, k)
        )
        converged = off_diagonal[-1] * abs(shares[-1, 0]) <= TOLERANCE * abs(square[0])
        if converged or ended:
            break
    if not converged:
        return Nearest(square, vector, np.array([False]), k + 1)
    second_pass = zip(progress(k + 1, "mode"), lanczos_steps(operator, start), strict=False)
    for j, (_, _, now) in second_pass:
        vector[:, 0] += shares[j, 0] * now
    vector /= norm(vector[:, 0])
    return Nearest(square, vector, np.array([True]), 2 * (k + 1))
