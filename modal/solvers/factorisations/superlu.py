"""Factorise by SuperLU, a part of scipy: it accepts any matrix, and needs much memory.

A symmetric matrix is factorised in symmetric mode with diagonal pivots. If the permutation of rows
equals that of columns, the diagonal of U is the D of an L D L^T, and its signs are the inertia.
"""

import numpy as np
from scipy.sparse.linalg import splu

from modal.solvers.factor import Cost, Factor, Factorisation, Problem, Shape, SingularError, certain

ENTRIES_PER_NONZERO_AND_LAYER_ROW = 0.04
"""Entries of L divided by the nonzeros and by the rows of a layer, with rows ordered by minimum
degree: 12 GB for L and U of 35,201 spheres."""
MULTIPLICATIONS_PER_ENTRY = 8
"""A solve reads each entry alone, which takes as long as this many multiplications of a block."""


def _cost(shape: Shape, _: bool) -> Cost:
    """Estimate the cost; L and U are kept in any case."""
    entries = ENTRIES_PER_NONZERO_AND_LAYER_ROW * shape.nonzeros * shape.layer
    numbers = 1 + shape.complex
    # L and U, each entry with its row.
    operations = 2 * numbers**2 * entries**2 / shape.rows
    solving = 2 * MULTIPLICATIONS_PER_ENTRY * entries
    return Cost((8 + 16 * numbers) * entries, operations, solving)


def _factorise(problem: Problem) -> Factor:
    """Factorise, in symmetric mode if the matrix is real and symmetric."""
    matrix = problem.matrix
    definite = problem.definite
    symmetric_mode = problem.symmetric and not np.iscomplexobj(matrix)
    options = {}
    if symmetric_mode:
        options = {
            "permc_spec": "MMD_AT_PLUS_A",
            "diag_pivot_thresh": 0.0,
            "options": {"SymmetricMode": True},
        }
    try:
        lu = splu(matrix.tocsc(), **options)
    except RuntimeError as error:
        raise SingularError(definite) from error
    if not symmetric_mode or not np.array_equal(lu.perm_r, lu.perm_c):
        return Factor(lu.solve, None)
    negative = int((lu.U.diagonal() < 0).sum())
    if definite and negative:
        raise SingularError(definite)
    return Factor(lu.solve, certain(negative, lu.solve, matrix))


FACTORISATION = Factorisation("superlu", _factorise, _cost)
