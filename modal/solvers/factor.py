"""Factorisations of a shifted, symmetric A - sigma: solves for shift-invert, and inertia.

One interface, three back ends. PARDISO (pypardiso) is used where it is installed; with scipy alone
a definite matrix is factorised as a band along the packing, an indefinite one by SuperLU in
symmetric mode. Which one is chosen by what is asked and by the memory that it will need.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from modal.solvers.band import Band, BandCholesky
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.tools.workload import memory_at_hand

SOLVERS = ("pardiso", "banded", "superlu")
SUPERLU_FILL = 1.4e3
"""Bytes of a SuperLU factor for each nonzero of a packing's matrix: 12 GB for 9 million."""
PARDISO = {1: 1, 2: 2, 8: 0, 10: 8, 21: 1, 24: 1, 37: -100}
"""What is asked of PARDISO in place of its defaults: order by nested dissection, pivots of size
1 and 2, a factorisation for two cores, no refinement of solutions unless a pivot was perturbed, and
rows of equal pattern, those of a sphere, ordered as one (iparm 37: variable blocks).
By default every solution is refined twice, which takes three times as long: from a residual of
4e-12, which Lanczos does not notice, to 1e-13. Row by row the analysis of 35,201 spheres takes
1.1 s instead of 0.3 and holds 240 MB instead of 60."""
PARDISO_WITHOUT_MEMORY = -2
"""PARDISO's error code where it found too little memory."""


class SingularError(InputError):
    """A matrix that is singular, or that is not definite as was promised."""


BACKWARD = 1e-11
"""Largest |A x - b| / (|A| |x|) of a factor whose signs are a count: so far, relative to the
largest one, round-off may have moved the eigenvalues, and so near to a mode no count is exact
(`COUNTED` of `modal.system.linear_system`). Without pivots near zero it is some 1e-16."""


@dataclass
class Factor:
    """A factorised matrix A.

    `solve` gives A^-1 b for b of shape (size,) or (size, k). `negative` is the number of negative
    eigenvalues of A; None where a pivot was replaced, where rows were exchanged for a pivot, or
    where solutions are less accurate than `BACKWARD`: such a factor solves, but its signs are no
    count. `solver` names the back end. `release` frees the memory that a back end holds outside of
    Python; `solve` must not be called after it.
    """

    solve: Callable[[Floats], Floats]
    negative: int | None
    solver: str
    release: Callable[[], None] = lambda: None


def available(solver: str) -> bool:
    """Whether the back end is installed."""
    return solver != "pardiso" or importlib.util.find_spec("pypardiso") is not None


def factorise(matrix: sp.csr_matrix, *, definite: bool, solver: str | None = None) -> Factor:
    """Factorise a symmetric matrix; `definite` promises that it is positive definite.

    InputError for an unknown or unsuitable `solver`, one that is not installed, an exactly
    singular matrix, or more memory than the machine has.
    """
    if solver is None:
        solver = "pardiso" if available("pardiso") else _scipy_choice(matrix, definite)
    if solver not in SOLVERS:
        raise InputError(f"solver {solver}: unknown; choose from {', '.join(SOLVERS)}")
    if not available(solver):
        raise InputError(
            "solver pardiso: the package pypardiso is not installed; install it or choose "
            "banded or superlu"
        )
    if not definite and solver == "banded":
        raise InputError(
            f"solver {solver}: only for the low end of the spectrum; take pardiso or superlu"
        )
    back_end = {"pardiso": _pardiso, "banded": _banded, "superlu": _superlu}[solver]
    return back_end(matrix, definite)


def _scipy_choice(matrix: sp.csr_matrix, definite: bool) -> str:
    """Band or SuperLU: the smaller one in memory."""
    if definite and Band(matrix).bytes_needed < SUPERLU_FILL * matrix.nnz:
        return "banded"
    return "superlu"


def _refuse_above_memory(bytes_needed: float, what: str) -> None:
    at_hand = memory_at_hand()
    if bytes_needed > at_hand:
        raise InputError(
            f"{what} needs about {bytes_needed / 1e9:.1f} GB, {at_hand / 1e9:.1f} GB are free; "
            "install pypardiso, which needs a sixth, or take a smaller packing"
        )


def _pardiso(matrix: sp.csr_matrix, definite: bool) -> Factor:
    """MKL PARDISO: Cholesky, or L D L^T with pivots whose signs are the inertia."""
    from pypardiso import PyPardisoSolver
    from pypardiso.pardiso_wrapper import PyPardisoError

    upper = _upper_triangle(matrix)
    solver = PyPardisoSolver(mtype=2 if definite else -2)
    for parameter, value in PARDISO.items():
        solver.set_iparm(parameter, value)
    # Each solver searches the disk for MKL, for 0.1 s and more: the next ones are told where it is.
    os.environ.setdefault("PYPARDISO_MKL_RT", solver.libmkl._name)
    try:
        solver.factorize(upper)
    except PyPardisoError as error:
        if error.value == PARDISO_WITHOUT_MEMORY:
            raise InputError("PARDISO found too little memory; take a smaller packing") from error
        raise SingularError(_singular(definite)) from error

    def solve(rhs: Floats) -> Floats:
        return solver.solve(upper, np.asfortranarray(rhs))

    # With two levels a negative pivot may pass unnoticed: its root is NaN, and so are solutions.
    if definite and not np.isfinite(solve(np.ones(matrix.shape[0]))).all():
        solver.free_memory(everything=True)
        raise SingularError(_singular(definite))

    def release() -> None:
        solver.free_memory(everything=True)

    # Pivots that were replaced, and those of either sign.
    perturbed, positive, negative = (int(solver.get_iparm(k)) for k in (14, 22, 23))
    whole = perturbed == 0 and positive + negative == matrix.shape[0]
    count = 0 if definite else _certain(negative if whole else None, solve, matrix)
    return Factor(solve, count, "pardiso", release)


def _certain(
    negative: int | None, solve: Callable[[Floats], Floats], matrix: sp.csr_matrix
) -> int | None:
    """The number of negative pivots if the factor is accurate, tried on one right-hand side."""
    if negative is None:
        return None
    rhs = np.random.default_rng(matrix.shape[0]).standard_normal(matrix.shape[0])
    found = solve(rhs)
    error, size = np.linalg.norm(matrix @ found - rhs), np.linalg.norm(found)
    return negative if error <= BACKWARD * abs(matrix.data).max() * size else None


def _upper_triangle(matrix: sp.csr_matrix) -> sp.csr_matrix:
    """The upper triangle, with a stored diagonal: PARDISO takes no empty row."""
    upper = sp.triu(matrix, format="csr")
    if not np.diff(upper.indptr).all():
        above, rows = sp.triu(matrix, k=1, format="coo"), np.arange(matrix.shape[0])
        values = np.concatenate([above.data, matrix.diagonal()])
        places = np.concatenate([above.row, rows]), np.concatenate([above.col, rows])
        upper = sp.coo_matrix((values, places), shape=matrix.shape).tocsr()
    upper.sort_indices()
    return upper


def _banded(matrix: sp.csr_matrix, definite: bool) -> Factor:
    """Cholesky in the order that keeps the band of a slender packing narrow."""
    band = Band(matrix)
    _refuse_above_memory(band.bytes_needed, "the band of this packing")
    try:
        return Factor(BandCholesky(band).solve, 0, "banded")
    except np.linalg.LinAlgError as error:
        raise SingularError(_singular(definite)) from error


def _superlu(matrix: sp.csr_matrix, definite: bool) -> Factor:
    """SuperLU in symmetric mode with diagonal pivots.

    Where the row permutation equals the column permutation, U's diagonal holds the D of an
    L D L^T and its signs are the inertia (Sylvester).
    """
    _refuse_above_memory(SUPERLU_FILL * matrix.nnz, "SuperLU")
    options = {"SymmetricMode": True}
    try:
        lu = splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
        )
    except RuntimeError as error:
        raise SingularError(_singular(definite)) from error
    symmetric = np.array_equal(lu.perm_r, lu.perm_c)
    negative = int((lu.U.diagonal() < 0).sum()) if symmetric else None
    if definite and negative:
        raise SingularError(_singular(definite))
    return Factor(lu.solve, _certain(negative, lu.solve, matrix), "superlu")


def _singular(definite: bool) -> str:
    if definite:
        return (
            "K has a negative direction: the packing is not stable with these springs; ask for the "
            "modes of an interval or for a count, which allow it"
        )
    return "K - sigma M is exactly singular at this frequency; ask for a slightly different one"
