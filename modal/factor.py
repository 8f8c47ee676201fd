"""Factorisations of K - sigma M: solves for shift-invert, inertia for exact mode counts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from modal.storage import InputError


def factorise(matrix: sp.csr_matrix) -> tuple[Callable[[np.ndarray], np.ndarray], int | None]:
    """Solve function and number of negative eigenvalues (inertia) of a symmetric matrix.

    SuperLU in symmetric mode with diagonal pivots: where the row permutation equals the column
    permutation, U's diagonal holds the D of an L D L^T and its signs are the inertia
    (Sylvester); otherwise the count is None.
    """
    try:
        lu = splu(
            matrix.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise InputError(
            "K - sigma M is exactly singular at this frequency; ask for a slightly different one"
        ) from error
    symmetric = np.array_equal(lu.perm_r, lu.perm_c)
    negative = int((lu.U.diagonal() < 0).sum()) if symmetric else None
    return lu.solve, negative
