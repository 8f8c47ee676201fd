"""Cholesky factor of a narrow band, block by block, with numpy and scipy alone.

In the reverse Cuthill-McKee order a slender packing's matrix is a band. Cut where the rows of one
block reach no further than the next, it is block-tridiagonal, with Schur complements

    S_1 = A_11,    S_k = A_kk - A_k,k-1 S_k-1^-1 A_k-1,k.

Only their dense Cholesky factors are kept; the sparse blocks beside the diagonal stay as they are.
All work is done on whole blocks, many right-hand sides at once, where LAPACK's band routines take
them one by one and read the whole factor for each.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.sparse.csgraph import reverse_cuthill_mckee

from modal.tools.arrays import Floats
from modal.tools.progress import progress

FEWEST = 200
"""Rows of a block at least, so that free particles do not become a block each."""


class Band:
    """A symmetric matrix in band order, cut into blocks; its factor takes `bytes_needed`."""

    def __init__(self, matrix: sp.csr_matrix) -> None:
        self.order = reverse_cuthill_mckee(matrix, symmetric_mode=True)
        self.matrix = matrix[self.order][:, self.order].tocsr()
        self.matrix.sort_indices()
        self.ends = self._ends()
        self.bytes_needed = 8.0 * float((np.diff(self.ends).astype(float) ** 2).sum())

    def _ends(self) -> list[int]:
        """First row of each block, and the number of rows behind the last."""
        size, last = self.matrix.shape[0], self.matrix.indptr[1:] - 1
        reach = np.maximum.accumulate(np.maximum(self.matrix.indices[last], np.arange(size)))
        ends = [0, 1]
        while ends[-1] < size:
            ends.append(min(size, max(int(reach[ends[-1] - 1]) + 1, ends[-1] + FEWEST)))
        return ends

    def blocks(self) -> list[slice]:
        """Rows of each block."""
        return [slice(a, b) for a, b in zip(self.ends[:-1], self.ends[1:], strict=True)]


class BandCholesky:
    """Factor of a positive definite band; LinAlgError where it is not."""

    def __init__(self, band: Band) -> None:
        self.order, self.blocks = band.order, band.blocks()
        self.factors: list[Floats] = []
        self.beside: list[sp.csc_matrix] = []
        for k in progress(len(self.blocks), "band factor"):
            here = self.blocks[k]
            schur = band.matrix[here, here].toarray(order="F")
            if k > 0:
                beside = band.matrix[self.blocks[k - 1], here].tocsc()
                self.beside.append(beside)
                used = np.flatnonzero(np.diff(beside.indptr))
                half = solve_triangular(
                    self.factors[-1],
                    beside[:, used].toarray(order="F"),
                    lower=True,
                    overwrite_b=True,
                    check_finite=False,
                )
                schur[np.ix_(used, used)] -= half.T @ half
            self.factors.append(cholesky(schur, lower=True, overwrite_a=True, check_finite=False))

    def solve(self, rhs: Floats) -> Floats:
        """The solution x of A x = rhs; both of shape (size,) or (size, k)."""
        x = rhs[self.order]
        for k, here in enumerate(self.blocks):
            if k > 0:
                x[here] -= self.beside[k - 1].T @ x[self.blocks[k - 1]]
            x[here] = self._solve_block(k, x[here])
        for k in range(len(self.blocks) - 2, -1, -1):
            x[self.blocks[k]] -= self._solve_block(k, self.beside[k] @ x[self.blocks[k + 1]])
        result = np.empty_like(x)
        result[self.order] = x
        return result

    def _solve_block(self, k: int, rhs: Floats) -> Floats:
        return cho_solve((self.factors[k], True), rhs, check_finite=False)
