"""Factorise by MKL's PARDISO, if pypardiso is installed: nested dissection on several cores.

pypardiso accepts only real matrices. A complex symmetric matrix W + i T is passed as [[W, -T], [-T,
-W]], which is symmetric and of twice the size; its solution contains real and imaginary part.
"""

import importlib
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from modal.solvers.factor import Cost, Factor, Factorisation, Problem, Shape, SingularError, certain
from modal.tools.arrays import Array, Complex
from modal.tools.errors import UnavailableError

ENTRIES_PER_NONZERO = 0.5
"""Entries of the factor divided by the nonzeros and by the root of the rows of a layer: 1.5e8
entries for 35,201 spheres."""
SYMMETRIC = {1: 1, 2: 2, 8: 0, 10: 8, 21: 1, 24: 1, 37: -100}
"""Parameters (iparm) other than the defaults: order by nested dissection, pivots of size 1 and 2, a
factorisation for two cores, no refinement of solutions unless a pivot was perturbed, and rows
of equal pattern, those of a sphere, ordered together (iparm 37: variable blocks).
By default each solution is refined twice, which takes three times as long and lowers the residual
from 4e-12, which Lanczos does not notice, to 1e-13. If rows are ordered one by one, the analysis of
35,201 spheres takes 1.1 s instead of 0.3 s and holds 240 MB instead of 60 MB."""
UNSYMMETRIC = {1: 1, 2: 2, 8: 2, 10: 13, 11: 1, 13: 1}
"""Parameters for matrices whose rows must be exchanged: scaled, matched, solutions refined."""
OUT_OF_MEMORY = -2
"""PARDISO's error code for too little memory."""
PERTURBED_PIVOTS, POSITIVE_PIVOTS, NEGATIVE_PIVOTS = 14, 22, 23
"""Parameters in which PARDISO returns numbers of pivots."""
POSITIVE_DEFINITE, INDEFINITE, GENERAL = 2, -2, 11
"""PARDISO's types of real matrices (mtype)."""


def _cost(shape: Shape, kept: bool) -> Cost:
    """Estimate the cost; a complex matrix costs as much as its real form."""
    if shape.complex:
        return _cost(Shape(2 * shape.rows, 4 * shape.nonzeros, 2 * shape.layer), kept)
    entries = ENTRIES_PER_NONZERO * shape.nonzeros * np.sqrt(shape.layer)
    return Cost(10 * entries + 40 * shape.nonzeros, entries**2 / shape.rows, 2 * entries)


def _load() -> None:
    """Load pypardiso; raise ImportError if it lacks MKL."""
    # Without this, the package and each solver search the disk for MKL: 0.4 s and more.
    for path in Path(sys.prefix, "lib").glob("libmkl_rt.*"):
        os.environ.setdefault("PYPARDISO_MKL_RT", str(path))
    importlib.import_module("pypardiso")


def _factorise(problem: Problem) -> Factor:
    """Factorise; PARDISO finds its own order of rows."""
    matrix = problem.matrix
    definite = problem.definite
    symmetric = problem.symmetric
    _load()
    from pypardiso import PyPardisoSolver
    from pypardiso.pardiso_wrapper import PyPardisoError

    if np.iscomplexobj(matrix):
        return _factorise_complex(problem)
    stored = _with_diagonal(matrix, symmetric)
    matrix_type, parameters = GENERAL, UNSYMMETRIC
    if symmetric:
        matrix_type = POSITIVE_DEFINITE if definite else INDEFINITE
        parameters = SYMMETRIC
    solver = PyPardisoSolver(mtype=matrix_type)
    for parameter, value in parameters.items():
        solver.set_iparm(parameter, value)
    os.environ.setdefault("PYPARDISO_MKL_RT", solver.libmkl._name)

    def solve(rhs: Array) -> Array:
        return solver.solve(stored, np.asfortranarray(rhs))

    def release() -> None:
        solver.free_memory(everything=True)

    try:
        solver.factorize(stored)
    except PyPardisoError as error:
        if error.value == OUT_OF_MEMORY:
            raise UnavailableError(
                "memory", "PARDISO found too little memory", remedy="take a smaller packing"
            ) from error
        raise SingularError(definite) from error
    # With two-level factorisation a negative pivot may pass unnoticed: its root, and solutions with
    # it, are NaN.
    if definite and not np.isfinite(solve(np.ones(matrix.shape[0]))).all():
        release()
        raise SingularError(definite)
    if not symmetric:
        return Factor(solve, None, release)
    if definite:
        return Factor(solve, 0, release)
    positive = int(solver.get_iparm(POSITIVE_PIVOTS))
    negative = int(solver.get_iparm(NEGATIVE_PIVOTS))
    perturbed = int(solver.get_iparm(PERTURBED_PIVOTS))
    if perturbed or positive + negative != matrix.shape[0]:
        return Factor(solve, None, release)
    return Factor(solve, certain(negative, solve, matrix), release)


def _factorise_complex(problem: Problem) -> Factor:
    """Factorise a complex matrix by its real form, which is symmetric if the matrix is."""
    matrix = problem.matrix
    size = matrix.shape[0]
    W = matrix.real
    T = matrix.imag
    sign = -1 if problem.symmetric else 1
    both_parts = sp.bmat([[W, -T], [sign * T, sign * W]], format="csr")
    factor = _factorise(Problem(both_parts, problem.order, symmetric=problem.symmetric))

    def solve(rhs: Array) -> Complex:
        both = factor.solve(np.concatenate([rhs.real, sign * rhs.imag]))
        return both[:size] + 1j * both[size:]

    return replace(factor, solve=solve, negative=None)


def _with_diagonal(matrix: sp.csr_matrix, upper: bool) -> sp.csr_matrix:
    """Return the matrix, or its upper triangle, without empty rows, which PARDISO would refuse.

    If a row is empty, the whole diagonal is stored, zeros included.
    """
    stored = sp.triu(matrix, format="csr") if upper else matrix.tocsr()
    if not np.diff(stored.indptr).all():
        beside_diagonal = (stored - sp.diags(stored.diagonal())).tocoo()
        rows = np.arange(matrix.shape[0])
        values = np.concatenate([beside_diagonal.data, matrix.diagonal()])
        row = np.concatenate([beside_diagonal.row, rows])
        column = np.concatenate([beside_diagonal.col, rows])
        stored = sp.coo_matrix((values, (row, column)), shape=matrix.shape).tocsr()
    stored.sort_indices()
    return stored


FACTORISATION = Factorisation("pardiso", _factorise, _cost, package="pypardiso", load=_load)
