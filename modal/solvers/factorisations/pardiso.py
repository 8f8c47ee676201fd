"""MKL's PARDISO, where pypardiso is installed: fast, by nested dissection, on several cores.

As it is had here it knows real matrices alone. Of a complex symmetric W + i T it takes
[[W, -T], [-T, -W]], symmetric and of twice the size, whose solution holds both parts.
"""

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from modal.solvers.factor import Cost, Factor, Factorisation, Shape, SingularError, certain
from modal.tools.arrays import Array, Complex, Ints
from modal.tools.errors import InputError

FILL = 0.5
"""Entries of the factor for each nonzero, over the root of a layer's rows: 1.5e8 of 35,201
spheres."""
SYMMETRIC = {1: 1, 2: 2, 8: 0, 10: 8, 21: 1, 24: 1, 37: -100}
"""What is asked of PARDISO in place of its defaults: order by nested dissection, pivots of size
1 and 2, a factorisation for two cores, no refinement of solutions unless a pivot was perturbed, and
rows of equal pattern, those of a sphere, ordered as one (iparm 37: variable blocks).
By default every solution is refined twice, which takes three times as long: from a residual of
4e-12, which Lanczos does not notice, to 1e-13. Row by row the analysis of 35,201 spheres takes
1.1 s instead of 0.3 and holds 240 MB instead of 60."""
UNSYMMETRIC = {1: 1, 2: 2, 8: 2, 10: 13, 11: 1, 13: 1}
"""Where rows must be exchanged: scaled and matched, with solutions refined."""
WITHOUT_MEMORY = -2
"""PARDISO's error code where it found too little memory."""


def _cost(shape: Shape, kept: bool) -> Cost:
    if shape.complex:
        return _cost(Shape(2 * shape.rows, 4 * shape.nonzeros, 2 * shape.layer), kept)
    entries = FILL * shape.nonzeros * np.sqrt(shape.layer)
    return Cost(10 * entries + 40 * shape.nonzeros, entries**2 / shape.rows, 2 * entries)


def _factorise(
    matrix: sp.csr_matrix, order: Ints, definite: bool, symmetric: bool, kept: bool
) -> Factor:
    # Else the package, as it is loaded, and each solver search the disk for MKL: 0.4 s and more.
    for place in Path(sys.prefix, "lib").glob("libmkl_rt.*"):
        os.environ.setdefault("PYPARDISO_MKL_RT", str(place))
    from pypardiso import PyPardisoSolver
    from pypardiso.pardiso_wrapper import PyPardisoError

    if np.iscomplexobj(matrix):
        return _complex(matrix, order, symmetric)
    given = _with_diagonal(matrix, symmetric)
    solver = PyPardisoSolver(mtype=(2 if definite else -2) if symmetric else 11)
    for parameter, value in (SYMMETRIC if symmetric else UNSYMMETRIC).items():
        solver.set_iparm(parameter, value)
    os.environ.setdefault("PYPARDISO_MKL_RT", solver.libmkl._name)

    def solve(rhs: Array) -> Array:
        return solver.solve(given, np.asfortranarray(rhs))

    def release() -> None:
        solver.free_memory(everything=True)

    try:
        solver.factorize(given)
    except PyPardisoError as error:
        if error.value == WITHOUT_MEMORY:
            raise InputError("PARDISO found too little memory; take a smaller packing") from error
        raise SingularError(definite) from error
    # With two levels a negative pivot may pass unnoticed: its root is NaN, and so are solutions.
    if definite and not np.isfinite(solve(np.ones(matrix.shape[0]))).all():
        release()
        raise SingularError(definite)
    if definite or not symmetric:
        return Factor(solve, 0 if definite else None, release)
    # Pivots that were replaced, and those of either sign.
    perturbed, positive, negative = (int(solver.get_iparm(k)) for k in (14, 22, 23))
    whole = perturbed == 0 and positive + negative == matrix.shape[0]
    return Factor(solve, certain(negative, solve, matrix) if whole else None, release)


def _complex(matrix: sp.csr_matrix, order: Ints, symmetric: bool) -> Factor:
    """Factor of a complex matrix, by its real form, which is symmetric where the matrix is."""
    size, W, T = matrix.shape[0], matrix.real, matrix.imag
    way = -1 if symmetric else 1
    both_parts = sp.bmat([[W, -T], [way * T, way * W]], format="csr")
    factor = _factorise(both_parts, order, False, symmetric, True)

    def solve(rhs: Array) -> Complex:
        both = factor.solve(np.concatenate([rhs.real, way * rhs.imag]))
        return both[:size] + 1j * both[size:]

    return replace(factor, solve=solve, negative=None)


def _with_diagonal(matrix: sp.csr_matrix, upper: bool) -> sp.csr_matrix:
    """The matrix, or its upper triangle, with a stored diagonal: PARDISO takes no empty row."""
    given = sp.triu(matrix, format="csr") if upper else matrix.tocsr()
    if not np.diff(given.indptr).all():
        apart, rows = (given - sp.diags(given.diagonal())).tocoo(), np.arange(matrix.shape[0])
        values = np.concatenate([apart.data, matrix.diagonal()])
        places = np.concatenate([apart.row, rows]), np.concatenate([apart.col, rows])
        given = sp.coo_matrix((values, places), shape=matrix.shape).tocsr()
    given.sort_indices()
    return given


FACTORISATION = Factorisation("pardiso", _factorise, _cost, package="pypardiso")
