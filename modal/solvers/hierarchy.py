"""A hierarchy of ever coarser matrices by smoothed aggregation, and its cycle on several columns.

Bodies that touch are joined to aggregates. The rigid motions of the aggregates, smoothed by a step
of Jacobi's method, are the unknowns of a coarser matrix. Aggregates are joined again in the same
way, until the inverse of the matrix is cheap (P. Vanek, J. Mandel, M. Brezina, Computing 56, 179,
1996). PyAMG builds the matrices. A cycle is a symmetric, positive definite approximation of the
inverse: a sweep of Gauss-Seidel's method, a correction by the coarser matrix, and a sweep
backwards. The matrices are made in double precision and kept in single precision.

Further motions of the aggregates, random ones after sweeps, lower the number of steps of conjugate
gradients near isostaticity, but not the time: with 24 motions instead of six, 2,500 spheres with
3.8 contacts take 49 steps instead of 102, each of which takes 2.9 times as long.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from modal.solvers import multigrid_loops as loops
from modal.tools.arrays import Floats, Ints, Singles

MAX_COARSEST_ROWS = 1000
"""Largest number of rows of the matrix whose inverse is computed: a full one, since a product with
it is many times faster than a solution by a sparse factor."""
JACOBI_WEIGHT = 4 / 3
"""Weight of the step of Jacobi's method, relative to the inverse of the largest eigenvalue."""
CANDIDATE_SWEEPS = 4
"""Number of sweeps that adapt the rigid motions to bodies that are held loosely."""


@dataclass(frozen=True)
class Level:
    """One level: a matrix in blocks of n bodies, and the prolongation from the next coarser level.

    Attributes
    ----------
    pointers, columns, diagonal : ndarray of int (n + 1,), (m,), (n,)
        Rows of blocks as in scipy's BSR format, and the place of each block on the diagonal.
    blocks, inverses : ndarray of float32 (m, 6, 6), (n, 6, 6)
        All blocks, and the inverses of those on the diagonal.
    prolongation : sparse matrix of float32 in blocks (6, 6)
    """

    pointers: Ints
    columns: Ints
    diagonal: Ints
    blocks: Singles
    inverses: Singles
    prolongation: sp.bsr_matrix

    @classmethod
    def of(cls, matrix: sp.bsr_matrix, prolongation: sp.bsr_matrix) -> Level:
        """Return the level of a matrix."""
        matrix.sort_indices()
        rows = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
        (diagonal,) = np.nonzero(rows == matrix.indices)
        inverses = np.linalg.inv(matrix.data[diagonal]).astype(np.float32)
        blocks = matrix.data.astype(np.float32)
        in_single = prolongation.astype(np.float32)
        return cls(matrix.indptr, matrix.indices, diagonal, blocks, inverses, in_single)

    def smooth(self, load: Singles) -> tuple[Singles, Singles]:
        """Return a first approximate solution for loads (groups, n, 6, 8), and its residual."""
        pattern = (self.pointers, self.columns, self.diagonal, self.blocks)
        solution = np.empty_like(load)
        residual = np.empty_like(load)
        loops.solve_lower(solution, load, *pattern, self.inverses)
        loops.subtract_upper(solution, residual, *pattern)
        return solution, residual

    def smooth_back(self, solution: Singles, load: Singles) -> None:
        """Improve a solution for loads (groups, n, 6, 8), in place; the transpose of `smooth`."""
        pattern = (self.pointers, self.columns, self.diagonal, self.blocks)
        loops.sweep_back(solution, load, *pattern, self.inverses)

    def restrict(self, residual: Singles) -> Singles:
        """Return the loads (groups, n', 6, 8) of the next coarser level for a residual."""
        P = self.prolongation
        bodies = P.shape[1] // loops.ROWS
        coarse = np.zeros((len(residual), bodies, loops.ROWS, loops.COLUMNS), np.float32)
        loops.transfer(residual, coarse, P.indptr, P.indices, P.data, False)
        return coarse

    def correct(self, solution: Singles, coarse: Singles) -> None:
        """Add the prolonged solution of the next coarser level to a solution, in place."""
        P = self.prolongation
        loops.transfer(solution, coarse, P.indptr, P.indices, P.data, True)


class Hierarchy:
    """The levels of a symmetric positive definite matrix, as a preconditioner.

    The entries of the matrix should be of order 1, as single precision asks for.

    Parameters
    ----------
    matrix : sparse matrix (6 n, 6 n) in blocks (6, 6)
        Bodies that touch should have neighbouring rows.
    smooth_motions : ndarray (6 n, 6)
        Motions that cost little energy and vary slowly: every aggregate can make them.
    """

    def __init__(self, matrix: sp.bsr_matrix, smooth_motions: Floats) -> None:
        import pyamg

        solver = pyamg.smoothed_aggregation_solver(
            matrix,
            B=_adapted(matrix, smooth_motions),
            strength=("symmetric", {"theta": 0.0}),
            smooth=("jacobi", {"omega": JACOBI_WEIGHT}),
            improve_candidates=None,
            presmoother=None,
            postsmoother=None,
            max_coarse=MAX_COARSEST_ROWS // loops.ROWS,
            keep=False,
        )
        self.levels = []
        for level in solver.levels[:-1]:
            self.levels.append(Level.of(level.A, level.P))
            del level.A, level.P
        coarsest = solver.levels[-1].A.toarray()
        self.coarsest_inverse = np.linalg.inv(coarsest).astype(np.float32)

    def cycle(self, load: Singles, depth: int = 0) -> Singles:
        """Return the approximate solution of a level for loads (groups, n, 6, 8)."""
        if depth == len(self.levels):
            by_row = load.reshape(len(load), len(self.coarsest_inverse), loops.COLUMNS)
            return (self.coarsest_inverse @ by_row).reshape(load.shape)
        level = self.levels[depth]
        solution, residual = level.smooth(load)
        level.correct(solution, self.cycle(level.restrict(residual), depth + 1))
        level.smooth_back(solution, load)
        return solution


def _adapted(matrix: sp.bsr_matrix, motions: Floats) -> Floats:
    """Return motions (6 n, 6) after sweeps that reduce their energy."""
    nothing = sp.bsr_matrix(matrix.shape, blocksize=(loops.ROWS, loops.ROWS))
    level = Level.of(matrix, nothing)
    size, count = motions.shape
    adapted = np.zeros((1, size // loops.ROWS, loops.ROWS, loops.COLUMNS), np.float32)
    by_row = adapted.reshape(size, loops.COLUMNS)
    by_row[:, :count] = motions
    for _ in range(CANDIDATE_SWEEPS):
        level.smooth_back(adapted, np.zeros_like(adapted))
    return by_row[:, :count].astype(float)
