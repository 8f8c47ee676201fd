"""Change sparse matrices in blocks of bodies: scale and select their blocks."""

from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from modal.solvers.block_products import ROWS
from modal.tools.arrays import Array, Floats, Ints

BLOCKS_AT_ONCE = 20_000
"""Number of blocks that are multiplied at a time, to save memory: 6 MB for each factor."""


def scale_to_unit_blocks(matrix: sp.bsr_matrix) -> Floats:
    """Turn a matrix A into C^T A C, in place, whose own blocks are 1; return C, blocks (n, 6, 6).

    A is symmetric and positive definite. Bodies whose own block is 1 already are skipped.
    """
    places = own_places(matrix)
    unit = np.eye(ROWS)
    scale = np.tile(unit, (len(places), 1, 1))
    bodies = np.flatnonzero(differ_from_unit(matrix.data[places]))
    root = np.linalg.cholesky(matrix.data[places[bodies]])
    scale[bodies] = np.linalg.inv(root).transpose(0, 2, 1)
    multiply_rows(matrix, scale.transpose(0, 2, 1))
    multiply_columns(matrix, scale)
    matrix.data[places] = unit
    return scale


def differ_from_unit(blocks: Array) -> Array:
    """Return which of the blocks (n, 6, 6) are not 1."""
    differ: Array = (blocks != np.eye(ROWS)).any(axis=(1, 2))
    return differ


def own_blocks(matrix: sp.bsr_matrix) -> Floats:
    """Return the own block (n, 6, 6) of each body, on the diagonal."""
    blocks: Floats = matrix.data[own_places(matrix)]
    return blocks


def own_places(matrix: sp.bsr_matrix) -> Ints:
    """Return the place (n,) of each own block among the blocks of a matrix."""
    return np.flatnonzero(rows_of_blocks(matrix) == matrix.indices)


def rows_of_blocks(matrix: sp.bsr_matrix) -> Ints:
    """Return the row (m,), by bodies, of each block of a matrix."""
    return np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))


def multiply_rows(matrix: sp.bsr_matrix, factors: Array) -> None:
    """Multiply the blocks of each row from the left by its factor (n, 6, 6), in place."""
    rows = rows_of_blocks(matrix)
    for part in _parts(differ_from_unit(factors)[rows]):
        matrix.data[part] = factors[rows[part]] @ matrix.data[part]


def multiply_columns(matrix: sp.bsr_matrix, factors: Array) -> None:
    """Multiply the blocks of each column from the right by its factor (n, 6, 6), in place."""
    for part in _parts(differ_from_unit(factors)[matrix.indices]):
        matrix.data[part] = matrix.data[part] @ factors[matrix.indices[part]]


def _parts(is_multiplied: Array) -> list[Ints]:
    """Return the places of the blocks that are multiplied, in parts."""
    places = np.flatnonzero(is_multiplied)
    bounds = [*range(0, len(places), BLOCKS_AT_ONCE), len(places)]
    return [places[first:last] for first, last in pairwise(bounds)]


def some_blocks(matrix: sp.bsr_matrix, rows: Ints, columns: Ints) -> sp.bsr_matrix:
    """Return the blocks of a matrix in the rows of some bodies and the columns of other bodies."""
    shape = (matrix.shape[0] // ROWS, matrix.shape[1] // ROWS)
    places = np.arange(1, len(matrix.data) + 1)
    pattern = sp.csr_matrix((places, matrix.indices, matrix.indptr), shape)
    part = pattern[rows][:, columns]
    part.sort_indices()
    new_shape = (ROWS * len(rows), ROWS * len(columns))
    return sp.bsr_matrix((matrix.data[part.data - 1], part.indices, part.indptr), new_shape)
