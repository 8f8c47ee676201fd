"""Solve by conjugate gradients and multigrid, if PyAMG and numba are installed, without a factor.

A cycle of the hierarchy (`modal.solvers.hierarchy`) is the preconditioner. Soft motions are nearly
rigid over many diameters, so that the number of steps hardly grows with the packing. Local motions
Z without energy are not smooth. Therefore the hierarchy is built for A + c Z Z^T, in which they are
stiff, and their part of the solution is computed separately. The method gives no inertia.
"""

import importlib.util

import numpy as np
import scipy.sparse as sp

from modal.solvers.conjugate_gradients import conjugate_gradients
from modal.solvers.factor import Cost, Factor, Factorisation, Problem, Shape
from modal.tools.arrays import Array, Floats

LIFT = 0.01
"""Stiffness c that motions without energy get, divided by the largest diagonal entry."""
MAX_LIFTED_ENTRIES = 200
"""Largest number of entries of a motion without energy that is lifted: c Z Z^T couples all of them
with each other. A longer one, as the rigid motion of a cluster, is smooth."""
RELATIVE_ERROR = 1e-11
"""Relative error of a solution in the norm of its energy."""
LOOK_BACK_STEPS = 4
"""Least number of steps over which the error is measured; a step lowers it to a half or less."""
MAX_STEPS = 2000
SETUP_OPERATIONS = 4000
"""Multiplications to make the hierarchy, for each nonzero of the matrix."""
CYCLE_OPERATIONS = 3
"""Multiplications of a cycle, for each nonzero and column of a group of eight."""
STEPS = 30
"""Number of steps of a solution."""
BYTES_PER_NONZERO = 65
"""Memory at the peak, while the hierarchy is made, with all else of the process: 61 bytes for a
million spheres with 4.2 contacts (11.7 GB), 66 for 125,000, 72 for 50,000 with six."""


def _cost(shape: Shape, _: bool) -> Cost:
    """Estimate the cost of the hierarchy, of a solution and of a cycle."""
    cycle = CYCLE_OPERATIONS * shape.nonzeros
    return Cost(
        BYTES_PER_NONZERO * shape.nonzeros,
        SETUP_OPERATIONS * shape.nonzeros,
        STEPS * (cycle + shape.nonzeros),
        cycle,
    )


def _load() -> None:
    """Raise ImportError if numba, which compiles the loops of a cycle, is absent."""
    if importlib.util.find_spec("numba") is None:
        raise ImportError("numba")


def _make(problem: Problem) -> Factor:
    """Make the hierarchy of a positive definite matrix whose soft motions are known."""
    from modal.solvers.elimination import EliminationHierarchy

    soft = problem.soft
    apply = problem.apply
    if soft is None or apply is None:
        raise ValueError("multigrid needs the soft motions of the packing, and a product")
    free = soft.free
    matrix = problem.matrix
    free_energy = np.asarray(free.multiply(matrix @ free).sum(axis=0)).ravel()
    _lift(matrix, free)
    hierarchy = EliminationHierarchy(matrix, soft.rigid, problem.order)

    def hold(columns: Floats) -> Floats:
        if free.shape[1] == 0:
            return columns
        return columns - free @ (free.T @ columns)

    def approximate(load: Floats) -> Floats:
        return hold(hierarchy.apply(hold(load)))

    def solve(load: Array) -> Array:
        columns = load.reshape(len(load), -1)
        solution = conjugate_gradients(
            apply,
            approximate,
            hold(columns),
            lambda work: RELATIVE_ERROR**2 * work,
            np.finfo(float).eps * np.linalg.norm(columns, axis=0),
            look_back=LOOK_BACK_STEPS,
            most_products=MAX_STEPS,
        ).motion
        solution += free @ ((free.T @ columns) / free_energy[:, None])
        return solution.reshape(load.shape)

    return Factor(solve, None, approximate=approximate)


def _lift(matrix: sp.bsr_matrix, free: sp.csc_matrix) -> None:
    """Make local motions without energy stiff, in place."""
    is_local = np.diff(free.indptr) <= MAX_LIFTED_ENTRIES
    local = free[:, is_local]
    largest = float(matrix.diagonal().max())
    total = matrix + (LIFT * largest * (local @ local.T)).tobsr(matrix.blocksize)
    matrix.data, matrix.indices, matrix.indptr = total.data, total.indices, total.indptr


FACTORISATION = Factorisation(
    "multigrid", _make, _cost, package="pyamg", load=_load, unsymmetric=False, direct=False
)
