"""SuperLU, which scipy brings: any matrix, in much memory.

A symmetric one is factorised in symmetric mode with diagonal pivots. Where the row permutation
equals the column permutation, U's diagonal holds the D of an L D L^T and its signs are the inertia.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from modal.solvers.factor import Cost, Factor, Factorisation, Shape, SingularError, certain
from modal.tools.arrays import Ints

FILL = 0.04
"""Entries of L for each nonzero, over a layer's rows, with minimum degrees: 12 GB of L and U of
35,201 spheres."""
SLOW = 8
"""In a solve each entry is met alone, which takes as long as so many multiplications of a block."""


def _cost(shape: Shape, _: bool) -> Cost:
    entries, numbers = FILL * shape.nonzeros * shape.layer, 1 + shape.complex
    # L and U, each entry with its row.
    operations = 2 * numbers**2 * entries**2 / shape.rows
    return Cost((8 + 16 * numbers) * entries, operations, 2 * SLOW * entries)


def _factorise(
    matrix: sp.csr_matrix, order: Ints, definite: bool, symmetric: bool, kept: bool
) -> Factor:
    options = {}
    if symmetric and not np.iscomplexobj(matrix):
        options = {
            "permc_spec": "MMD_AT_PLUS_A",
            "diag_pivot_thresh": 0.0,
            "options": {"SymmetricMode": True},
        }
    try:
        lu = splu(matrix.tocsc(), **options)
    except RuntimeError as error:
        raise SingularError(definite) from error
    if not options or not np.array_equal(lu.perm_r, lu.perm_c):
        return Factor(lu.solve, None)
    negative = int((lu.U.diagonal() < 0).sum())
    if definite and negative:
        raise SingularError(definite)
    return Factor(lu.solve, certain(negative, lu.solve, matrix))


FACTORISATION = Factorisation("superlu", _factorise, _cost)
