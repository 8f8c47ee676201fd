"""L D L^T of a symmetric matrix, block by block along the packing, with numpy and scipy alone.

In the reverse Cuthill-McKee order a packing's matrix is a band. Cut where the rows of one block
reach no further than the next, it is block-tridiagonal, with Schur complements

    S_1 = A_11,    S_k = A_kk - A_k,k-1 S_k-1^-1 A_k-1,k.

The inertia of A is the sum of theirs. Each is dense and factorised by LAPACK: by Cholesky where it
is definite, as nearly all are below the lowest modes, else with symmetric pivots. Only these
factors are kept, the sparse blocks beside the diagonal stay as they are; for the inertia alone not
even that. All work is done on whole blocks, many right-hand sides at once.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import scipy.sparse as sp
from scipy.linalg import get_lapack_funcs
from scipy.sparse.csgraph import reverse_cuthill_mckee

from modal.solvers.factor import (
    BACKWARD,
    Cost,
    Factor,
    Factorisation,
    Shape,
    SingularError,
    certain,
    ends_of_blocks,
)
from modal.tools.arrays import Array
from modal.tools.progress import progress

NAME = "blocks"
GROWTH = BACKWARD / np.finfo(float).eps
"""Growth of a block's entries up to which its signs count: round-off has then moved the eigenvalues
by `BACKWARD` of the largest one."""
Solve = Callable[[Array], Array]


def _cost(shape: Shape) -> Cost:
    numbers = 1 + shape.complex
    own = shape.rows * shape.layer
    # A sixth of the cube for a factor, the cube for its solutions for the next block.
    # Five squares stand in memory at once.
    counting = 40 * numbers * shape.layer**2
    return Cost(8 * numbers * own, 7 / 6 * numbers**2 * own * shape.layer, 2 * own, counting)


def _factorise(matrix: sp.csr_matrix, definite: bool, symmetric: bool, kept: bool) -> Factor:
    order = reverse_cuthill_mckee(matrix, symmetric_mode=True)
    inner = matrix[order][:, order].tocsr()
    ends = ends_of_blocks(matrix, order)
    blocks = [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]
    solves: list[Solve] = []
    beside: list[sp.csr_matrix] = []
    negative, grown, largest = 0, False, abs(inner.data).max(initial=0.0)
    used, change = np.empty(0, int), np.empty((0, 0))
    for k in progress(len(blocks), "block factor"):
        schur = inner[blocks[k], blocks[k]].toarray(order="F")
        if len(used) == len(schur):
            schur -= change
        else:
            schur[np.ix_(used, used)] -= change
        # Cholesky factors do not grow.
        grown |= not (definite or abs(schur).max() <= GROWTH * largest)
        coupling = inner[blocks[k + 1], blocks[k]] if k + 1 < len(blocks) else inner[:0, blocks[k]]
        used = np.flatnonzero(np.diff(coupling.indptr))
        solve, below, solved = _eliminated(schur, coupling[used].toarray().T, definite)
        change = coupling[used] @ solved
        negative += below
        if kept:
            solves.append(solve)
            beside.append(coupling)

    def solution(rhs: Array) -> Array:
        x = rhs[order].astype(np.result_type(rhs, inner))
        for k, here in enumerate(blocks):
            if k > 0:
                x[here] -= beside[k - 1] @ x[blocks[k - 1]]
            x[here] = solves[k](x[here])
        for k in range(len(blocks) - 2, -1, -1):
            x[blocks[k]] -= solves[k](beside[k].T @ x[blocks[k + 1]])
        result = np.empty_like(x)
        result[order] = x
        return result

    count = None if grown or np.iscomplexobj(matrix) else negative
    if kept and not definite and count is not None:
        count = certain(count, solution, matrix)
    return Factor(solution, count, NAME)


def _eliminated(schur: Array, coupling: Array, definite: bool) -> tuple[Solve, int, Array]:
    """Solutions with a block, how many of its eigenvalues are negative, and those of `coupling`.

    Shapes (r, r) and (r, c). SingularError for a singular block, and where it is not `definite` as
    was promised.
    """
    names = ("posv", "potrs", "sysv", "sysv_lwork", "sytrs")
    posv, potrs, sysv, sysv_lwork, sytrs = get_lapack_funcs(names, (schur,))
    # LAPACK takes no matrix without columns.
    columns = coupling if coupling.shape[1] else np.ones((len(schur), 1))
    if not np.iscomplexobj(schur):
        # Where the block is not definite the columns are left as they are.
        factor, solved, info = posv(schur, columns, lower=1, overwrite_a=definite, overwrite_b=True)
        if info == 0:
            return partial(_solved, potrs, (factor,)), 0, solved[:, : coupling.shape[1]]
    if definite:
        raise SingularError(definite)
    lwork = int(sysv_lwork(len(schur), lower=1)[0].real)
    factor, pivots, solved, info = sysv(
        schur, columns, lwork=lwork, lower=1, overwrite_a=True, overwrite_b=True
    )
    if info:
        raise SingularError(definite)
    # A 2 x 2 pivot, marked by two equal negative numbers, has one eigenvalue of each sign.
    double = pivots < 0
    negative = int((factor.diagonal()[~double].real < 0).sum() + double.sum() // 2)
    solve = partial(_solved, sytrs, (factor, pivots))
    return solve, negative, solved[:, : coupling.shape[1]]


def _solved(
    routine: Callable[..., tuple[Array, int]], factor: tuple[Array, ...], b: Array
) -> Array:
    """The solution by a routine of LAPACK, in the shape of b."""
    return routine(*factor, b, lower=1)[0].reshape(b.shape)


FACTORISATION = Factorisation(NAME, _factorise, _cost, unsymmetric=False)
