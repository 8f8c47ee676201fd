"""Compute the moments of a spectrum: traces of Chebyshev polynomials of A, for each component.

Estimated from products of K with random vectors, or exact from the whole spectrum.
"""

import numpy as np
from scipy.linalg import eigh

from modal.solvers.chebyshev import WIDTHS, chebyshev
from modal.solvers.spectrum import largest_growth
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator, component_sums
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError
from modal.tools.progress import progress

MAX_BLOCK_NUMBERS = 2**26
"""Largest number of entries of a block of vectors that are multiplied together."""


def multiplied_vectors(size: int, vectors: int) -> int:
    """Return the number of vectors after rounding `vectors` up to whole blocks."""
    width = block_width(size)
    return width * int(np.ceil(vectors / width))


def exact_moments(system: LinearSystem, top: float, count: int) -> tuple[Floats, Floats]:
    """Compute the traces of elastic modes, (1, 6, count), and the shares of zero modes, (6,)."""
    rows = system.free_rows
    square, vector = eigh(system.dynamical_matrix[rows][:, rows].toarray(), overwrite_a=True)
    at_zero = square <= system.zero_threshold
    angle = np.arccos(np.clip(2 * square[~at_zero] / top - 1, -1, 1))
    component = rows % 6
    share = np.array([(vector[component == k] ** 2).sum(axis=0) for k in range(6)])
    moments = share[:, ~at_zero] @ np.cos(angle[:, None] * np.arange(count))
    return moments[None], share[:, at_zero].sum(axis=1)


def block_width(size: int) -> int:
    """Return how many vectors (size,) are multiplied together."""
    return max(1, min(WIDTHS[0], MAX_BLOCK_NUMBERS // size))


def moments_of(
    operator: ContactOperator, start: Floats, top: float, count: int, label: str
) -> Floats:
    """Compute <r| P_c T_j(X) |r> for start vectors r (6n, k), components c and j < count.

    The shape is (k, 6, count); `start` may be overwritten. One product gives two moments, since
    tr P_c T_j T_k = tr T_j P_c T_k and 2 T_j T_k = T_(j+k) + T_|j-k|. Raises InputError if the
    spectrum is not within 0 to `top`.
    """
    n_vectors = start.shape[1]
    moments = np.empty((n_vectors, 6, count + 2))
    sums = np.empty((2, 6, n_vectors))
    orders = chebyshev(operator, operator.inward(start), 2 / top, -1.0, sums)
    before = next(orders)
    now = next(orders)
    for k in progress(count // 2, label):
        # The next step sums T_k r times itself, and times `now` = T_(k+1) r.
        before = now
        now = next(orders)
        if k == 0:
            moments[:, :, :2] = sums.T
        else:
            moments[:, :, 2 * k : 2 * k + 2] = 2 * sums.T - moments[:, :, :2]
    last = 2 * (count // 2)
    moments[:, :, last] = 2 * component_sums(before, now)[0].T - moments[:, :, 0]
    first_sum = moments[:, :, 0].sum(axis=1)
    last_sum = moments[:, :, last].sum(axis=1)
    if not (abs(last_sum) <= largest_growth(operator, last) * first_sum).all():
        raise UnavailableError(
            "not_converged", "the top of the spectrum was not found", remedy="ask with another seed"
        )
    return moments[:, :, :count]
