"""A hierarchy of ever coarser matrices by smoothed aggregation, and its cycle on several columns.

Bodies that touch are joined to aggregates. The rigid motions of the aggregates, smoothed by a step
of Jacobi's method, are the unknowns of a coarser matrix. Aggregates are joined again in the same
way, until the inverse of the matrix is cheap (P. Vanek, J. Mandel, M. Brezina, Computing 56, 179,
1996). PyAMG builds the matrices. A cycle is an approximation of the inverse, symmetric and positive
definite up to round-off: a sweep of Gauss-Seidel's method, a correction by the coarser matrix, and
a sweep backwards. The matrices are made in double precision and kept in single precision.

Further motions of the aggregates, random ones after sweeps, lower the number of steps of conjugate
gradients near isostaticity, but not the time: with 24 motions instead of six, 2,500 spheres with
3.8 contacts took 49 steps instead of 102 (with one round of `modal.solvers.elimination`), each of
which took 2.9 times as long.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from modal.solvers import multigrid_loops as loops
from modal.solvers.block_matrices import (
    multiply_columns,
    multiply_rows,
    own_places,
    scale_to_unit_blocks,
    some_blocks,
)
from modal.solvers.block_products import COLUMNS, ROWS
from modal.solvers.factor import band
from modal.tools.arrays import Floats, Ints, Singles
from modal.tools.slabs import ENOUGH, slab_bounds

MAX_COARSEST_ROWS = 1000
"""Largest number of rows of the matrix whose inverse is computed: a full one, since a product with
it is many times faster than a solution by a sparse factor."""
JACOBI_WEIGHT = 4 / 3
"""Weight of the step of Jacobi's method, relative to the inverse of the largest eigenvalue."""
CANDIDATE_SWEEPS = 4
"""Number of sweeps that adapt the rigid motions to bodies that are held loosely."""
SEED = 1
"""Seed of the random vectors with which PyAMG estimates the largest eigenvalue of each matrix."""


class InSlabs(NamedTuple):
    """An order of n bodies in slabs, every other one of which can be computed at the same time.

    order: the bodies, first those of even slabs, then those of odd ones. bounds: the first place of
    each slab in this order, and n. halves (3,): 0, the number of even slabs, and the number of all
    slabs. Even slabs do not touch each other, nor do odd ones.
    """

    order: Ints
    bounds: Ints
    halves: Ints


def in_slabs(matrix: sp.bsr_matrix) -> InSlabs:
    """Cut the bodies of a matrix into slabs; packings too small for threads have one."""
    order, reach = band(matrix)
    bounds = slab_bounds(reach)
    if len(order) < ENOUGH:
        bounds = bounds[[0, -1]]
    parts = [order[first:last] for first, last in pairwise(bounds)]
    even = parts[::2]
    odd = parts[1::2]
    sizes = [len(part) for part in even + odd]
    return InSlabs(
        np.concatenate(even + odd),
        np.append(0, np.cumsum(sizes)),
        np.array([0, len(even), len(parts)]),
    )


@dataclass(frozen=True)
class Level:
    """One level: a matrix in blocks of n bodies whose own blocks, on the diagonal, are 1.

    Attributes
    ----------
    slabs : InSlabs
        The order of the bodies in all other attributes.
    pointers, columns, diagonal : ndarray of int (n + 1,), (m,), (n,)
        Rows of blocks as in scipy's BSR format, and the place of each block on the diagonal.
    blocks : ndarray of float32 (m, 6, 6)
    """

    slabs: InSlabs
    pointers: Ints
    columns: Ints
    diagonal: Ints
    blocks: Singles

    @classmethod
    def of(cls, matrix: sp.bsr_matrix) -> Level:
        """Return the level of a matrix."""
        parts = in_slabs(matrix)
        matrix = some_blocks(matrix.astype(np.float32), parts.order, parts.order)
        return cls(parts, matrix.indptr, matrix.indices, own_places(matrix), matrix.data)

    @property
    def _pattern(self) -> tuple[Ints, Ints, Ints, Singles]:
        return self.pointers, self.columns, self.diagonal, self.blocks

    def smooth(self, load: Singles) -> tuple[Singles, Singles]:
        """Return a first approximate solution for a load (n, 6, 8), and its residual."""
        solution = load.copy()
        residual = np.zeros_like(load)
        _, bounds, halves = self.slabs
        loops.solve_lower(solution, bounds, halves, *self._pattern)
        loops.subtract_upper(residual, solution, *self._pattern)
        return solution, residual

    def smooth_back(self, solution: Singles, load: Singles) -> None:
        """Improve a solution for a load (n, 6, 8), in place; the transpose of `smooth`."""
        _, bounds, halves = self.slabs
        loops.sweep_back(solution, load, bounds, halves, *self._pattern)


class Transfer:
    """The products with a matrix P of blocks (6, 6), and with its transpose, in single precision.

    Parameters
    ----------
    matrix : sparse matrix (6 n, 6 m) in blocks (6, 6)

    Attributes
    ----------
    bodies : tuple of int
        The numbers n, m.
    """

    def __init__(self, matrix: sp.bsr_matrix) -> None:
        matrix = matrix.astype(np.float32)
        self.matrix = matrix
        self.transposed = matrix.T.tobsr((ROWS, ROWS))
        self.bodies = (matrix.shape[0] // ROWS, matrix.shape[1] // ROWS)

    def add(self, result: Singles, vector: Singles) -> None:
        """Add P times a vector (m, 6, 8) to a result (n, 6, 8), in place."""
        P = self.matrix
        loops.add_transfer(result, vector, P.indptr, P.indices, P.data)

    def add_back(self, result: Singles, vector: Singles) -> None:
        """Add P^T times a vector (n, 6, 8) to a result (m, 6, 8), in place."""
        P = self.transposed
        loops.add_transfer(result, vector, P.indptr, P.indices, P.data)


class Hierarchy:
    """The levels of a symmetric positive definite matrix, as a preconditioner.

    Parameters
    ----------
    matrix : sparse matrix (6 n, 6 n) in blocks (6, 6)
        Its own blocks, on the diagonal, are 1.
    smooth_motions : ndarray (6 n, 6)
        Motions that cost little energy and vary slowly: every aggregate can make them.

    Attributes
    ----------
    order : ndarray of int (n,)
        Order of the bodies in which `cycle` takes and returns vectors.
    """

    def __init__(self, matrix: sp.bsr_matrix, smooth_motions: Floats) -> None:
        import pyamg

        adapted = _adapted(matrix, smooth_motions)
        with _repeatable():
            solver = pyamg.smoothed_aggregation_solver(
                matrix,
                B=adapted,
                strength=("symmetric", {"theta": 0.0}),
                smooth=("jacobi", {"omega": JACOBI_WEIGHT}),
                improve_candidates=None,
                presmoother=None,
                postsmoother=None,
                max_coarse=MAX_COARSEST_ROWS // ROWS,
                keep=False,
            )
        self.levels = []
        prolongations: list[sp.bsr_matrix] = []
        for level in solver.levels[:-1]:
            if prolongations:
                level.A = _regular(level.A)
                scale = scale_to_unit_blocks(level.A)
                multiply_columns(prolongations[-1], scale)
                multiply_rows(level.P, np.linalg.inv(scale))
            self.levels.append(Level.of(level.A))
            prolongations.append(level.P)
            del level.A, level.P
        coarsest = _regular(solver.levels[-1].A).toarray()
        self.coarsest_inverse = np.linalg.inv(coarsest)
        orders = [level.slabs.order for level in self.levels]
        orders.append(np.arange(len(coarsest) // ROWS))
        self.order = orders[0]
        self.prolongations = []
        for prolongation, (fine, coarse) in zip(prolongations, pairwise(orders), strict=True):
            self.prolongations.append(Transfer(some_blocks(prolongation, fine, coarse)))

    def cycle(self, load: Singles, depth: int = 0) -> Singles:
        """Return the approximate solution of a level for a load (n, 6, 8)."""
        if depth == len(self.levels):
            by_row = load.reshape(-1, COLUMNS).astype(float)
            return (self.coarsest_inverse @ by_row).reshape(load.shape).astype(np.float32)
        level = self.levels[depth]
        prolongation = self.prolongations[depth]
        solution, residual = level.smooth(load)
        coarse = np.zeros((prolongation.bodies[1], ROWS, COLUMNS), np.float32)
        prolongation.add_back(coarse, residual)
        prolongation.add(solution, self.cycle(coarse, depth + 1))
        level.smooth_back(solution, load)
        return solution


@contextmanager
def _repeatable() -> Iterator[None]:
    """Seed numpy's global generator, from which PyAMG takes vectors, and restore it afterwards."""
    before = np.random.get_state()  # noqa: NPY002
    np.random.seed(SEED)  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(before)  # noqa: NPY002


def _regular(matrix: sp.bsr_matrix) -> sp.bsr_matrix:
    """Return a coarse matrix with 1 on the diagonal of its empty rows.

    They belong to motions that an aggregate cannot make, because all its bodies are held, or that
    no aggregate stands for, because nothing touches.
    """
    is_empty = matrix.diagonal() == 0
    if not is_empty.any():
        return matrix
    return (matrix + sp.diags(is_empty.astype(float))).tobsr((ROWS, ROWS))


def _adapted(matrix: sp.bsr_matrix, motions: Floats) -> Floats:
    """Return motions (6 n, 6) after sweeps that reduce their energy."""
    level = Level.of(matrix)
    order = level.slabs.order
    vectors = np.empty((len(order), ROWS, COLUMNS), np.float32)
    loops.gather(vectors, motions, order, 1.0)
    for _ in range(CANDIDATE_SWEEPS):
        level.smooth_back(vectors, np.zeros_like(vectors))
    adapted = np.empty_like(motions)
    loops.scatter(vectors, adapted, order, 1.0)
    return adapted
