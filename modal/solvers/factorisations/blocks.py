"""L D L^T of a symmetric matrix by a front of dense rows that moves along the packing.

In a suitable order of its rows a packing's matrix is a band. Block after block of rows is
eliminated,

    X_k = S_kk^-1 S_k,    S_ij -= S_ki^T X_kj    for i, j behind k and within its reach,

where S_k are the entries right of the block's own S_kk as the blocks before have changed them. The
inertia of A is the sum of those of all S_kk. Each is factorised by LAPACK: by Cholesky where it is
definite, as nearly all are below the lowest modes, else with symmetric pivots. For solutions the
factors of S_kk and the X_k are kept; for the inertia alone no more than the front.
"""

from collections import deque
from collections.abc import Callable
from functools import partial

import numpy as np
import scipy.sparse as sp
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from modal.solvers.factor import (
    BACKWARD,
    Cost,
    Factor,
    Factorisation,
    Shape,
    SingularError,
    certain,
    reach_of,
)
from modal.tools.arrays import Array, Ints
from modal.tools.progress import progress

GROWTH = BACKWARD / np.finfo(float).eps
"""Growth of a block's entries up to which its signs count: round-off has then moved the eigenvalues
by `BACKWARD` of the largest one."""
FEWEST, MOST, SHARE = 128, 256, 8
"""Rows of a block: between these, and else this part of the band. Smaller ones waste time in calls,
larger ones work on zeros beside the band."""
Solve = Callable[[Array], Array]


def _width(layer: float) -> int:
    """Rows of a block in a band whose rows reach over so many others."""
    return int(np.clip(layer / SHARE, FEWEST, MOST))


def _cost(shape: Shape, kept: bool) -> Cost:
    numbers = 1 + shape.complex
    front = shape.layer + _width(shape.layer)
    own = shape.rows * front
    held = own if kept else front**2
    return Cost(8 * numbers * held, numbers**2 * own * front / 2, 2 * own)


def _factorise(
    matrix: sp.csr_matrix, order: Ints, definite: bool, symmetric: bool, kept: bool
) -> Factor:
    size = matrix.shape[0]
    reach = reach_of(matrix, order)
    inner = matrix[order][:, order].tocsr()
    (gemm,) = get_blas_funcs(("gemm",), (inner.data,))
    width = _width(float(np.sqrt(((reach - np.arange(size)) ** 2).mean())))
    starts = np.arange(0, size, width)
    # Behind the last column of each block of rows, which is that of a block.
    ends = np.minimum(width * (np.maximum.reduceat(reach, starts) // width + 1), size)
    solves: list[Solve] = []
    beside: list[Array] = []
    negative, grown, largest = 0, False, abs(inner.data).max(initial=0.0)
    front: deque[Array] = deque()
    opened = 0
    for k in progress(len(starts), "block factor"):
        start, end = starts[k], ends[k]
        for first, last in zip(starts[opened:], ends[opened:], strict=True):
            if first >= end:
                break
            front.append(inner[first : first + width, first:last].toarray(order="F"))
            opened += 1
        rows = front.popleft()
        # Cholesky factors do not grow.
        grown |= not (definite or abs(rows).max() <= GROWTH * largest)
        solve, below, solved = _eliminated(rows[:, : len(rows)], rows[:, len(rows) :], definite)
        negative += below
        for i, later in enumerate(front, 1):
            a, b = i * width, min((i + 1) * width, size - start)
            # Whole columns of an array in Fortran's order: gemm writes where it is told to.
            changed = later[:, : end - start - a]
            gemm(
                -1.0,
                rows[:, a:b],
                solved[:, a - width :],
                beta=1.0,
                c=changed,
                trans_a=True,
                overwrite_c=True,
            )
        if kept:
            solves.append(solve)
            beside.append(solved)

    def solution(rhs: Array) -> Array:
        x = rhs[order].astype(np.result_type(rhs, inner))
        for start, end, right in zip(starts, ends, beside, strict=True):
            x[start + width : end] -= right.T @ x[start : start + width]
        for k in range(len(starts) - 1, -1, -1):
            own = slice(starts[k], starts[k] + width)
            x[own] = solves[k](x[own]) - beside[k] @ x[own.stop : ends[k]]
        result = np.empty_like(x)
        result[order] = x
        return result

    count = None if grown or np.iscomplexobj(matrix) else negative
    if kept and not definite and count is not None:
        count = certain(count, solution, matrix)
    return Factor(solution, count)


def _eliminated(own: Array, right: Array, definite: bool) -> tuple[Solve, int, Array]:
    """Solutions with a block, how many of its eigenvalues are negative, and those of its `right`.

    Shapes (r, r) and (r, c). SingularError for a singular block, and where it is not `definite` as
    was promised.
    """
    names = ("posv", "potrs", "sysv", "sysv_lwork", "sytrs")
    posv, potrs, sysv, sysv_lwork, sytrs = get_lapack_funcs(names, (own,))
    # LAPACK takes no matrix without columns.
    columns = right if right.shape[1] else np.ones((len(own), 1))
    if not np.iscomplexobj(own):
        factor, solved, info = posv(own, columns, lower=1)
        if info == 0:
            return partial(_solved, potrs, (factor,)), 0, solved[:, : right.shape[1]]
    if definite:
        raise SingularError(definite)
    lwork = int(sysv_lwork(len(own), lower=1)[0].real)
    factor, pivots, solved, info = sysv(own, columns, lwork=lwork, lower=1)
    if info:
        raise SingularError(definite)
    # A 2 x 2 pivot, marked by two equal negative numbers, has one eigenvalue of each sign.
    double = pivots < 0
    negative = int((factor.diagonal()[~double].real < 0).sum() + double.sum() // 2)
    solve = partial(_solved, sytrs, (factor, pivots))
    return solve, negative, solved[:, : right.shape[1]]


def _solved(
    routine: Callable[..., tuple[Array, int]], factor: tuple[Array, ...], b: Array
) -> Array:
    """The solution by a routine of LAPACK, in the shape of b."""
    return routine(*factor, b, lower=1)[0].reshape(b.shape)


FACTORISATION = Factorisation("blocks", _factorise, _cost, unsymmetric=False)
