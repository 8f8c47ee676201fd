"""Where the spectrum of A = M^-1/2 K M^-1/2 ends, and what a recurrence that leaves it shows.

A Chebyshev recurrence needs an interval that holds all omega^2. The largest Ritz value of Lanczos
from a random vector comes from below. How far below tell the steps themselves: vector k + 1 is
p_k(A) times the first, with a polynomial p_k that rises beyond the largest Ritz value. No vector is
longer than 1, so that a mode above some omega^2 has a part of the first vector below 1 / p_k there,
which a random one has with a probability that follows from its dimension alone (J. L. M. van
Dorsselaer, M. E. Hochstenbach, H. A. van der Vorst, SIAM J. Matrix Anal. Appl. 22, 837, 2000).

The highest mode alone takes the memory of a few vectors, by Lanczos, twice: the largest Ritz value
of plain Lanczos needs no basis that is kept orthogonal: what round-off brings back are copies of
values that have converged (C. C. Paige, Linear Algebra Appl. 34, 235, 1980). A first pass finds how
the mode is made of the Lanczos vectors. A second one makes the same vectors once more, to the bit,
and adds them up. So a mode of millions of spheres fits beside their contacts, and nothing but
products takes time.
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
"""How far the bound lies above the largest Ritz value, relative. Of an interval larger by 1 % the
recurrence takes 0.5 % more products; half the margin takes a third more of the bound's own."""
FAILURE = 1e-6
"""Probability with which `bound_of_spectrum` may be too low."""
TOGETHER = 2**16
"""Numbers of a vector that are worked on together: what is in between stays in a cache."""
ROUND_OFF = 100 * np.finfo(float).eps
"""Times the order squared: how much round-off may let a recurrence grow. It makes an error at every
order, and each error grows by at most the order."""
GROWTH = {"full": 10.0, "law": 10.0}
"""Growth that is allowed with the tangents whose eigenvectors are not orthogonal because they are
not symmetric. In stable packings of DEM runs no growth was seen. Where vectors grow by a factor,
errors relative to a tolerance grow by it, too."""


class GrowthError(InputError):
    """A recurrence grew although it should not: K has a negative direction."""

    def __init__(self) -> None:
        super().__init__(
            "the recurrence grows: the network is unstable (strong pre-stress or negative "
            "stiffness); take pre-stress none"
        )


def largest_growth(operator: ScaledOperator, order: int) -> float:
    """Largest possible norm of T_order(X) c over that of c if the interval holds the spectrum."""
    limit = GROWTH.get(operator.pre_stress, 1.0)
    return limit + ROUND_OFF * order**2


def bound_of_spectrum(operator: ScaledOperator) -> tuple[float, int]:
    """An upper bound of omega^2, rad^2/s^2, too low with a probability of at most `FAILURE`.

    The second result is the number of products with A. The bound exceeds the top by at most
    `MARGIN`, whatever the spectrum; A is symmetric.
    """
    size = operator.shape[0]
    # Of a random unit vector a given part is below x with a probability below x sqrt(2 size / pi).
    rise = np.sqrt(2 * size / np.pi) / FAILURE
    made = lanczos_steps(operator, start_block(size, 1)[:, 0])
    for diagonal, off, _ in islice(made, size):
        ritz = eigh_tridiagonal(np.array(diagonal), np.array(off[:-1]), eigvals_only=True)
        bound = float(ritz[-1] + MARGIN * abs(ritz[-1]))
        # The product is p_k, whose zeros are the Ritz values.
        if off[-1] == 0 or np.prod((bound - ritz) / off) >= rise:
            break
    return max(bound, 0.0), len(diagonal)


Step = tuple[list[float], list[float], Floats]


def lanczos_steps(operator: ScaledOperator, start: Floats) -> Iterator[Step]:
    """Yield diagonal and off-diagonal (both k) of the tridiagonal matrix, and vector k, at step k.

    The last off-diagonal number couples it to the next vector; zero where there is none. A vector
    (size,) is overwritten two steps later.
    """
    now = start / norm(start)
    del start  # of millions of spheres a vector is half a gigabyte
    before, scale = np.zeros_like(now), 0.0
    diagonal: list[float] = []
    off: list[float] = []
    while not off or off[-1] > 0:
        # In the array of the vector before: A now - (off-diagonal number) before.
        ahead = operator.combine(now, before, 1.0, gamma=-off[-1] if off else 0.0)
        diagonal.append(dot(ahead, now))
        for first in range(0, len(now), TOGETHER):
            part = slice(first, first + TOGETHER)
            ahead[part] -= diagonal[-1] * now[part]
        beta = norm(ahead)
        scale = max(scale, abs(diagonal[-1]) + beta)
        off.append(beta if beta > 1e-12 * scale else 0.0)
        yield diagonal, off, now
        if off[-1] > 0:
            ahead /= beta
            before, now = now, ahead


def dot(a: Floats, b: Floats) -> float:
    """Scalar product, not by BLAS.

    Its threads cost more than they save on vectors, and wait for cores that other programs use.
    """
    return float(np.einsum("i,i", a, b))


def norm(a: Floats) -> float:
    """Length of a vector."""
    return float(np.sqrt(dot(a, a)))


LOOK = 5
"""Steps between two looks at the largest Ritz value."""


def top_mode(operator: ScaledOperator, most: int) -> Nearest:
    """The largest eigenpair of A, if it converges within `most` steps; without its vector if not.

    A residual of `TOLERANCE` relative to its eigenvalue counts as converged, as in
    `modal.solvers.lanczos`. A converged mode has taken two products a step.
    """
    start = start_block(operator.shape[0], 1)[:, 0]
    vector: Floats = np.zeros((len(start), 1))
    steps = zip(progress(most, "Lanczos"), lanczos_steps(operator, start), strict=False)
    for k, (diagonal, off, _) in steps:
        ended = k == most - 1 or off[-1] == 0
        if k % LOOK < LOOK - 1 and not ended:
            continue
        square, share = eigh_tridiagonal(
            np.array(diagonal), np.array(off[:-1]), select="i", select_range=(k, k)
        )
        converged = off[-1] * abs(share[-1, 0]) <= TOLERANCE * abs(square[0])
        if converged or ended:
            break
    if not converged:
        return Nearest(square, vector, np.array([False]), k + 1)
    again = zip(progress(k + 1, "mode"), lanczos_steps(operator, start), strict=False)
    for j, (_, _, now) in again:
        vector[:, 0] += share[j, 0] * now
    vector /= norm(vector[:, 0])
    return Nearest(square, vector, np.array([True]), 2 * (k + 1))
