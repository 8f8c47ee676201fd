"""Factorise a symmetric matrix, L D L^T, by a dense front that moves along the packing.

The matrix of a packing is a band in a suitable order of its rows. The rows are eliminated block by
block,

    X_k = S_kk^-1 S_k,    S_ij -= S_ki^T X_kj    for i, j behind k and within its reach,

where S_kk is the diagonal block k after the eliminations before it, and S_k the entries to the
right of it. The inertia of A is the sum of the inertias of all S_kk. Each is factorised by LAPACK:
by Cholesky where it is definite, as nearly all are below the lowest modes, and otherwise with
symmetric pivots. Solutions need the factors of all S_kk and X_k; for the inertia alone only the
front is stored.
"""

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from modal.solvers.factor import (
    BACKWARD,
    Cost,
    Factor,
    Factorisation,
    Problem,
    Shape,
    SingularError,
    certain,
    reach_of,
)
from modal.tools.arrays import Array
from modal.tools.progress import progress

MAX_GROWTH = BACKWARD / np.finfo(float).eps
"""Largest growth of a block's entries for which the signs of its pivots are trusted: round-off has
then moved the eigenvalues by `BACKWARD` of the largest one."""
MIN_BLOCK_ROWS, MAX_BLOCK_ROWS = 128, 256
"""Bounds of the number of rows of a block. Smaller blocks lose time in calls, larger ones work on
zeros beside the band."""
BAND_SHARE = 8
"""Number of rows of the band divided by the number of rows of a block, between the two bounds."""
Solve = Callable[[Array], Array]


class _Elimination(NamedTuple):
    """The elimination of the diagonal block S_kk of one step.

    solve: function that applies S_kk^-1. negative: number of negative eigenvalues of S_kk. solved
    (r, c): X_k = S_kk^-1 S_k, with the entries S_k to the right of the block.
    """

    solve: Solve
    negative: int
    solved: Array


def _block_rows(layer: float) -> int:
    """Return the number of rows of a block for a band of half-width `layer` rows."""
    return int(np.clip(layer / BAND_SHARE, MIN_BLOCK_ROWS, MAX_BLOCK_ROWS))


def _cost(shape: Shape, kept: bool) -> Cost:
    """Estimate the cost: of the whole factor if it is kept, else of the front alone."""
    numbers = 1 + shape.complex
    front = shape.layer + _block_rows(shape.layer)
    entries = shape.rows * front
    stored = entries if kept else front**2
    return Cost(8 * numbers * stored, numbers**2 * entries * front / 2, 2 * entries)


def _factorise(problem: Problem) -> Factor:
    """Factorise a symmetric matrix; the front holds the rows that are not yet eliminated."""
    matrix = problem.matrix
    order = problem.order
    definite = problem.definite
    kept = problem.kept
    size = matrix.shape[0]
    reach = reach_of(matrix, order)
    ordered = matrix[order][:, order].tocsr()
    (gemm,) = get_blas_funcs(("gemm",), (ordered.data,))
    width = _block_rows(float(np.sqrt(((reach - np.arange(size)) ** 2).mean())))
    starts = np.arange(0, size, width)
    # The end of the block that holds the last column of each block of rows.
    ends = np.minimum(width * (np.maximum.reduceat(reach, starts) // width + 1), size)
    solves: list[Solve] = []
    solved_columns: list[Array] = []
    negative = 0
    grown = False
    largest = abs(ordered.data).max(initial=0.0)
    front: deque[Array] = deque()
    opened = 0
    for k in progress(len(starts), "block factor"):
        start = starts[k]
        end = ends[k]
        for first, last in zip(starts[opened:], ends[opened:], strict=True):
            if first >= end:
                break
            front.append(ordered[first : first + width, first:last].toarray(order="F"))
            opened += 1
        rows = front.popleft()
        # Cholesky factors do not grow.
        grown |= not (definite or abs(rows).max() <= MAX_GROWTH * largest)
        block = _eliminate(rows[:, : len(rows)], rows[:, len(rows) :], definite)
        negative += block.negative
        for i, later in enumerate(front, 1):
            a = i * width
            b = min((i + 1) * width, size - start)
            # Whole columns of an array in Fortran order: gemm writes into it.
            changed = later[:, : end - start - a]
            gemm(
                -1.0,
                rows[:, a:b],
                block.solved[:, a - width :],
                beta=1.0,
                c=changed,
                trans_a=True,
                overwrite_c=True,
            )
        if kept:
            solves.append(block.solve)
            solved_columns.append(block.solved)

    def solve(rhs: Array) -> Array:
        x = rhs[order].astype(np.result_type(rhs, ordered))
        for start, end, right in zip(starts, ends, solved_columns, strict=True):
            x[start + width : end] -= right.T @ x[start : start + width]
        for k in range(len(starts) - 1, -1, -1):
            own = slice(starts[k], starts[k] + width)
            x[own] = solves[k](x[own]) - solved_columns[k] @ x[own.stop : ends[k]]
        result = np.empty_like(x)
        result[order] = x
        return result

    if grown or np.iscomplexobj(matrix):
        return Factor(solve, None)
    if kept and not definite:
        return Factor(solve, certain(negative, solve, matrix))
    return Factor(solve, negative)


def _eliminate(diagonal: Array, right: Array, definite: bool) -> _Elimination:
    """Factorise a diagonal block (r, r), and solve for the columns (r, c) right of it.

    Raises SingularError if the block is singular, or not positive definite although `definite` is
    True.
    """
    names = ("posv", "potrs", "sysv", "sysv_lwork", "sytrs")
    posv, potrs, sysv, sysv_lwork, sytrs = get_lapack_funcs(names, (diagonal,))
    # LAPACK takes no matrix without columns.
    columns = right if right.shape[1] else np.ones((len(diagonal), 1))
    if not np.iscomplexobj(diagonal):
        factor, solved, info = posv(diagonal, columns, lower=1)
        if info == 0:
            return _Elimination(partial(_solve, potrs, (factor,)), 0, solved[:, : right.shape[1]])
    if definite:
        raise SingularError(definite)
    lwork = int(sysv_lwork(len(diagonal), lower=1)[0].real)
    factor, pivots, solved, info = sysv(diagonal, columns, lwork=lwork, lower=1)
    if info:
        raise SingularError(definite)
    # A 2 x 2 pivot, marked by two equal negative numbers, has one eigenvalue of each sign.
    double = pivots < 0
    negative = int((factor.diagonal()[~double].real < 0).sum() + double.sum() // 2)
    solve = partial(_solve, sytrs, (factor, pivots))
    return _Elimination(solve, negative, solved[:, : right.shape[1]])


def _solve(routine: Callable[..., tuple[Array, int]], factor: tuple[Array, ...], b: Array) -> Array:
    """Solve by a routine of LAPACK; the solution has the shape of b."""
    return routine(*factor, b, lower=1)[0].reshape(b.shape)


FACTORISATION = Factorisation("blocks", _factorise, _cost, unsymmetric=False)
