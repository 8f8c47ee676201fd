"""A hierarchy of ever coarser matrices by smoothed aggregation, and its cycle on several columns.

Bodies that touch are joined to aggregates. The rigid motions of the aggregates, smoothed by a step
of Jacobi's method, are the unknowns of a coarser matrix. Aggregates are joined again in the same
way, until a direct factorisation is cheap (P. Vanek, J. Mandel, M. Brezina, Computing 56, 179,
1996). PyAMG builds the matrices. A cycle is a symmetric, positive definite approximation of the
inverse: a sweep of Gauss-Seidel's method, a correction by the coarser matrix, and a sweep
backwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from modal.solvers import multigrid_loops as loops
from modal.tools.arrays import Floats, Ints

MAX_COARSEST_ROWS = 1000
"""Largest number of rows of the matrix that is factorised."""
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
    blocks, inverses : ndarray (m, 6, 6), (n, 6, 6)
        All blocks, and the inverses of those on the diagonal.
    prolongation : sparse matrix in blocks (6, 6)
    """

    pointers: Ints
    columns: Ints
    diagonal: Ints
    blocks: Floats
    inverses: Floats
    prolongation: sp.bsr_matrix

    @classmethod
    def of(cls, matrix: sp.bsr_matrix, prolongation: sp.bsr_matrix) -> Level:
        """Return the level of a matrix."""
        matrix.sort_indices()
        rows = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
        (diagonal,) = np.nonzero(rows == matrix.indices)
        inverses = np.linalg.inv(matrix.data[diagonal])
        return cls(matrix.indptr, matrix.indices, diagonal, matrix.data, inverses, prolongation)

    def smooth(self, load: Floats) -> tuple[Floats, Floats]:
        """Return a first approximate solution for loads (groups, n, 6, 8), and its residual."""
        pattern = (self.pointers, self.columns, self.diagonal, self.blocks)
        solution = np.empty_like(load)
        residual = np.empty_like(load)
        loops.solve_lower(solution, load, *pattern, self.inverses)
        loops.subtract_upper(solution, residual, *pattern)
        return solution, residual

    def smooth_back(self, solution: Floats, load: Floats) -> None:
        """Improve a solution for loads (groups, n, 6, 8), in place; the transpose of `smooth`."""
        pattern = (self.pointers, self.columns, self.diagonal, self.blocks)
        loops.sweep_back(solution, load, *pattern, self.inverses)

    def restrict(self, residual: Floats) -> Floats:
        """Return the loads (groups, n', 6, 8) of the next coarser level for a residual."""
        P = self.prolongation
        coarse = np.zeros((len(residual), P.shape[1] // loops.ROWS, loops.ROWS, loops.COLUMNS))
        loops.transfer(residual, coarse, P.indptr, P.indices, P.data, False)
        return coarse

    def correct(self, solution: Floats, coarse: Floats) -> None:
        """Add the prolonged solution of the next coarser level to a solution, in place."""
        P = self.prolongation
        loops.transfer(solution, coarse, P.indptr, P.indices, P.data, True)


class Hierarchy:
    """The levels of a symmetric positive definite matrix, as a preconditioner.

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
            max_coarse=MAX_COARSEST_ROWS,
            keep=False,
        )
        self.levels = [Level.of(level.A, level.P) for level in solver.levels[:-1]]
        self.coarsest: SuperLU = splu(sp.csc_matrix(solver.levels[-1].A))

    def apply(self, load: Floats) -> Floats:
        """Return the cycle's approximation of the solution for loads (6 n, k)."""
        size, count = load.shape
        groups = -(-count // loops.COLUMNS)
        filled = np.zeros((groups, size, loops.COLUMNS))
        for column in range(count):
            filled[column // loops.COLUMNS, :, column % loops.COLUMNS] = load[:, column]
        by_body = filled.reshape(groups, size // loops.ROWS, loops.ROWS, loops.COLUMNS)
        solution = self._cycle(by_body, 0).reshape(groups, size, loops.COLUMNS)
        columns = solution.transpose(1, 0, 2).reshape(size, groups * loops.COLUMNS)
        return columns[:, :count]

    def _cycle(self, load: Floats, depth: int) -> Floats:
        """Return the approximate solution of a level for loads (groups, n, 6, 8)."""
        if depth == len(self.levels):
            groups = len(load)
            rows = self.coarsest.shape[0]
            by_row = load.reshape(groups, rows, loops.COLUMNS).transpose(1, 0, 2)
            solution = self.coarsest.solve(by_row.reshape(rows, groups * loops.COLUMNS))
            by_group = solution.reshape(rows, groups, loops.COLUMNS).transpose(1, 0, 2)
            return np.ascontiguousarray(by_group).reshape(load.shape)
        level = self.levels[depth]
        solution, residual = level.smooth(load)
        level.correct(solution, self._cycle(level.restrict(residual), depth + 1))
        level.smooth_back(solution, load)
        return solution


def _adapted(matrix: sp.bsr_matrix, motions: Floats) -> Floats:
    """Return motions (6 n, 6) after sweeps that reduce their energy."""
    level = Level.of(matrix, matrix)
    size, count = motions.shape
    adapted = np.zeros((1, size // loops.ROWS, loops.ROWS, loops.COLUMNS))
    adapted.reshape(size, loops.COLUMNS)[:, :count] = motions
    for _ in range(CANDIDATE_SWEEPS):
        level.smooth_back(adapted, np.zeros_like(adapted))
    return adapted.reshape(size, loops.COLUMNS)[:, :count].copy()
