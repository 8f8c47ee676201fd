"""Factorise sparse matrices: register methods with their costs, and choose the fastest.

Each module of `modal.solvers.factorisations` holds one method as its `FACTORISATION`; to add a
method, add a module there. A factor gives solutions and, for a real symmetric matrix, its inertia:
the number of negative eigenvalues, which counts modes (Sylvester's law). An iterative method has no
factor and gives only solutions.
"""

from __future__ import annotations

import importlib.util
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import reverse_cuthill_mckee

from modal.solvers import factorisations
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError, refuse_unknown
from modal.tools.memory import memory_at_hand
from modal.tools.workload import refuse_above_memory

SOLVERS = tuple(sorted(module.name for module in pkgutil.iter_modules(factorisations.__path__)))
"""Names of all factorisations, whether or not the packages that they need are installed."""
BACKWARD = 1e-11
"""Largest backward error |A x - b| / (|A| |x|) of a factor whose negative pivots are taken as the
number of negative eigenvalues. Round-off may have moved the eigenvalues by this share of the
largest one, so that the number is uncertain if a mode is as near (`COUNT_ROUND_OFF` in
`modal.system.linear_system`). Without pivots near zero it is some 1e-16."""
SMALL_ROWS = 3000
"""Largest number of rows for which scipy's own factorisations are taken: loading another package
takes longer."""
MAX_MEMORY_SHARE = 0.5
"""Largest share of the free memory that a factorisation may take before one that takes less is
preferred. The blocks take less if only the inertia is wanted."""
SMALLER = "take a smaller packing"
"""Text of the remedy if the memory is too small."""


class SingularError(InputError):
    """Raised for a matrix that is singular, or not definite although the caller promised it."""

    def __init__(self, definite: bool) -> None:
        if definite:
            super().__init__(
                "unstable",
                "K has a negative direction",
                "the packing is not stable with these springs",
                "ask for the modes of an interval or for a count, which allow it",
            )
        else:
            super().__init__(
                "singular",
                "K - sigma M is exactly singular at this frequency",
                remedy="ask for a slightly different one",
            )


def _release_nothing() -> None:
    """Do nothing: Python frees the memory of the factor."""


def _load_nothing() -> None:
    """Do nothing: scipy is always installed."""


@dataclass
class Factor:
    """A factorised matrix A.

    Attributes
    ----------
    solve : callable
        Function that returns A^-1 b for b of shape (size,) or (size, k).
    negative : int or None
        Number of negative eigenvalues of A. None if it is not certain: A is not real and symmetric,
        a pivot was replaced, rows were exchanged for a pivot, or the backward error of a solution
        exceeds `BACKWARD`.
    release : callable
        Function that frees the memory of the factor outside of Python; do not call `solve`
        afterwards.
    solver : str
        Name of the factorisation.
    bytes : float
        Estimated memory.
    approximate : callable or None
        Function that returns an approximation of A^-1 b at a small part of the cost, by a symmetric
        and positive definite operator; None if `solve` itself is cheap.
    """

    solve: Callable[[Array], Array]
    negative: int | None
    release: Callable[[], None] = _release_nothing
    solver: str = ""
    bytes: float = 0.0
    approximate: Callable[[Floats], Floats] | None = None

    def precondition(self, load: Floats) -> Floats:
        """Return the cheapest available approximation of A^-1 b for b of shape (size, k)."""
        return (self.approximate or self.solve)(load)


@dataclass(frozen=True)
class SoftMotions:
    """Motions of a packing that cost little or no energy, for an iterative method.

    Attributes
    ----------
    rigid : ndarray (size, 6)
        Rigid motions of all bodies together, in the scaled degrees of freedom of the matrix. Soft
        motions are nearly rigid over some diameters.
    free : sparse matrix (size, z)
        An orthonormal basis of motions without energy.
    """

    rigid: Floats
    free: sp.csc_matrix


@dataclass(frozen=True)
class Problem:
    """A matrix to be factorised, and what is known about it.

    Attributes
    ----------
    matrix : sparse matrix (size, size), real or complex
        For an iterative method, in blocks of bodies; this method uses it up, to save memory.
    order : ndarray of int (size,)
        Order of the rows, or of the bodies, in which the matrix is a narrow band.
    definite, symmetric : bool
        Whether the matrix is positive definite, and whether it is symmetric.
    kept : bool
        Whether the factor is kept for solutions; otherwise it gives the inertia alone.
    soft : SoftMotions or None
        Soft motions of the packing, if they are known.
    apply : callable or None
        Function that returns the product of the matrix with b of shape (size, k), for an iterative
        method.
    """

    matrix: sp.csr_matrix | sp.bsr_matrix
    order: Ints
    definite: bool = False
    symmetric: bool = True
    kept: bool = True
    soft: SoftMotions | None = None
    apply: Callable[[Floats], Floats] | None = None


@dataclass(frozen=True)
class Shape:
    """The properties of a matrix that the cost of its factorisation depends on.

    Attributes
    ----------
    rows, nonzeros : float
        Numbers of rows and of stored entries.
    layer : float
        Number of rows in one layer across the packing: a contact joins neighbouring layers at most.
    complex : bool
        Whether the entries are complex.
    """

    rows: float
    nonzeros: float
    layer: float
    complex: bool = False

    @classmethod
    def of(cls, matrix: sp.csr_matrix | sp.bsr_matrix, reach: Ints | None = None) -> Shape:
        """Measure the shape of a matrix; `reach` is the second result of `band`."""
        if reach is None:
            _, reach = band(matrix)
        size = matrix.shape[0]
        distance = reach - np.arange(len(reach), dtype=float)
        layer = size / len(reach) * float(np.sqrt((distance**2).mean())) + 1
        return cls(size, matrix.nnz, layer, np.iscomplexobj(matrix))


@dataclass(frozen=True)
class Cost:
    """The estimated cost of a factorisation.

    Attributes
    ----------
    bytes : float
        Memory of the factor.
    operations, each : float
        Multiplications of factorising, and of solving for one column.
    approximation : float
        Multiplications of an approximate solution for one column; 0 where there is none.
    """

    bytes: float
    operations: float
    each: float = 0.0
    approximation: float = 0.0


@dataclass(frozen=True)
class Factorisation:
    """A method to factorise matrices.

    Attributes
    ----------
    name : str
    make : callable
        Function that takes a `Problem`, and returns the `Factor` or raises SingularError.
    cost : callable
        Function that estimates the `Cost` from a `Shape` and from whether the factor is kept for
        solutions.
    package : str or None
        Package that the method needs besides scipy.
    load : callable
        Function that loads this package; it raises ImportError if that fails.
    unsymmetric : bool
        Whether the method accepts unsymmetric matrices.
    direct : bool
        Whether the method factorises symmetric matrices, real or complex, definite or not, and
        gives the inertia of real ones. An iterative method only solves, for real, positive definite
        matrices whose `SoftMotions` are known.
    """

    name: str
    make: Callable[[Problem], Factor]
    cost: Callable[[Shape, bool], Cost]
    package: str | None = None
    load: Callable[[], None] = _load_nothing
    unsymmetric: bool = True
    direct: bool = True


def named(solver: str) -> Factorisation:
    """Return the factorisation with a name; raise InputError if it is unknown."""
    refuse_unknown("solver", solver, SOLVERS)
    return importlib.import_module(f"{factorisations.__name__}.{solver}").FACTORISATION


@cache
def direct_solvers() -> tuple[str, ...]:
    """Return the names of the factorisations that give an inertia, and so count modes."""
    return tuple(name for name in SOLVERS if named(name).direct)


def available(solver: str) -> bool:
    """Tell whether the package that a factorisation needs is installed and can be loaded.

    A package whose own libraries are missing, such as pypardiso without MKL, counts as absent.
    """
    return _installed(solver) and _loads(solver)


def _installed(solver: str) -> bool:
    """Tell whether the package of a factorisation is installed, without loading it."""
    package = named(solver).package
    return package is None or importlib.util.find_spec(package) is not None


@cache
def _loads(solver: str) -> bool:
    """Load the package of a factorisation, and tell whether this succeeds."""
    try:
        named(solver).load()
    except ImportError:
        return False
    return True


def choose(
    shape: Shape, solver: str | None, *, kept: bool, unsymmetric: bool = False
) -> Factorisation:
    """Choose the factorisation of a matrix: the named one, or the fastest direct one.

    `kept` tells whether the factor is kept for solutions. Raises InputError if `solver` is unknown
    or not installed, if it gives no inertia and only the inertia is requested, or if it does not
    accept an unsymmetric matrix.
    """
    if solver is None:
        return _fastest(shape, kept, unsymmetric)
    factorisation = named(solver)
    if not available(solver):
        others = " or ".join(name for name in SOLVERS if available(name))
        raise InputError(
            "not_installed",
            f"solver {solver}",
            f"the package {factorisation.package} is not installed, or cannot be loaded",
            f"install it or choose {others}",
        )
    if not kept and not factorisation.direct:
        raise InputError(
            "no_inertia",
            f"solver {solver}",
            "it counts no modes",
            f"choose {' or '.join(direct_solvers())}",
        )
    if unsymmetric and not factorisation.unsymmetric:
        raise InputError(
            "unsymmetric", f"solver {solver}", "it takes no shear forces in K", "take another"
        )
    return factorisation


def _fastest(shape: Shape, kept: bool, unsymmetric: bool) -> Factorisation:
    """Return the fastest direct factorisation that is available.

    Factorisations that take much of the free memory are ranked last. For a small matrix the
    factorisation of scipy is ranked first; for a larger one those of optional packages, which were
    installed for speed. Otherwise the number of operations decides.
    """
    able = []
    for name in direct_solvers():
        if _installed(name) and (named(name).unsymmetric or not unsymmetric):
            able.append(named(name))
    max_bytes = MAX_MEMORY_SHARE * memory_at_hand()
    prefers_package = shape.rows > SMALL_ROWS

    def rank(factorisation: Factorisation) -> tuple[bool, bool, float]:
        cost = factorisation.cost(shape, kept)
        from_package = factorisation.package is not None
        return cost.bytes > max_bytes, from_package != prefers_package, cost.operations

    # To load a package takes time: only the first choices are tried.
    return next(
        factorisation for factorisation in sorted(able, key=rank) if _loads(factorisation.name)
    )


def factorise(
    matrix: sp.csr_matrix | sp.bsr_matrix,
    *,
    definite: bool = False,
    symmetric: bool = True,
    solver: str | None = None,
    kept: bool = True,
    along: Floats | None = None,
    soft: SoftMotions | None = None,
    apply: Callable[[Floats], Floats] | None = None,
    remedy: str = SMALLER,
) -> Factor:
    """Factorise a sparse matrix.

    Parameters
    ----------
    matrix : sparse matrix (size, size), real or complex
        In blocks of bodies (BSR) for an iterative method, by rows (CSR) for a direct one.
    definite : bool
        Whether the caller knows that the matrix is positive definite.
    symmetric : bool
        Whether the matrix is symmetric.
    solver : str, optional
        Name of the factorisation; by default the fastest is chosen.
    kept : bool
        Whether the factor is kept for solutions. Without, it gives the inertia alone, which may
        take less memory.
    along : ndarray (size,), optional
        Places of the rows, or of the bodies, along the packing.
    soft : SoftMotions, optional
        Soft motions of the packing, without which an iterative method does not work.
    apply : callable, optional
        Function that multiplies by the matrix, likewise; the method uses the matrix itself up.
    remedy : str
        Remedy for the error message if memory does not suffice.

    Raises
    ------
    InputError
        If `solver` is unsuitable, the matrix is singular (SingularError), or the factor would take
        more than the free memory.
    """
    order, reach = band(matrix, along)
    shape = Shape.of(matrix, reach)
    factorisation = choose(shape, solver, kept=kept, unsymmetric=not symmetric)
    if factorisation.package is None and not _installed("pardiso"):
        remedy += ", or install pypardiso, which needs less"
    needed_bytes = factorisation.cost(shape, kept).bytes
    refuse_above_memory(needed_bytes, f"a factorisation by {factorisation.name}", remedy)
    if not factorisation.direct and (soft is None or not definite):
        raise InputError(
            "no_inertia",
            f"solver {factorisation.name}",
            "it solves below the lowest mode alone",
            "ask for the lowest modes, or take another",
        )
    factor = factorisation.make(Problem(matrix, order, definite, symmetric, kept, soft, apply))
    return replace(factor, solver=factorisation.name, bytes=needed_bytes)


def band(matrix: sp.csr_matrix | sp.bsr_matrix, along: Floats | None = None) -> tuple[Ints, Ints]:
    """Return an order of rows that makes a matrix a narrow band, and the `reach_of` its rows.

    A matrix in blocks of bodies has one row for each body here. The order is that of reverse
    Cuthill-McKee or that of the places `along` (size,) the packing, whichever gives the narrower
    band: in a wide packing the layers of the former start at a corner and are oblique.
    """
    if matrix.format == "bsr":
        n = len(matrix.indptr) - 1
        touches = np.ones(len(matrix.indices), np.int8)
        matrix = sp.csr_matrix((touches, matrix.indices, matrix.indptr), (n, n))
    orders = [reverse_cuthill_mckee(matrix, symmetric_mode=True)]
    if along is not None:
        orders.append(np.lexsort((np.argsort(orders[0]), along)))
    rows = np.arange(matrix.shape[0], dtype=float)
    reaches = [reach_of(matrix, order) for order in orders]
    widths = [((reach - rows) ** 2).sum() for reach in reaches]
    narrowest = int(np.argmin(widths))
    return orders[narrowest], reaches[narrowest]


def reach_of(matrix: sp.csr_matrix, order: Ints) -> Ints:
    """Return, for each row in an order, the last row coupled to this row or to an earlier one."""
    size = matrix.shape[0]
    rank = np.empty(size, np.int64)
    rank[order] = np.arange(size)
    reach = np.arange(size)
    filled = np.flatnonzero(np.diff(matrix.indptr))
    farthest = np.maximum.reduceat(rank[matrix.indices], matrix.indptr[filled])
    reach[rank[filled]] = np.maximum(rank[filled], farthest)
    return np.maximum.accumulate(reach)


def certain(negative: int, solve: Callable[[Array], Array], matrix: sp.csr_matrix) -> int | None:
    """Return `negative`, the number of negative pivots; None if a trial solution is inaccurate."""
    rhs = np.random.default_rng(matrix.shape[0]).standard_normal(matrix.shape[0])
    solution = solve(rhs)
    error = np.linalg.norm(matrix @ solution - rhs)
    size = np.linalg.norm(solution)
    if error <= BACKWARD * abs(matrix.data).max() * size:
        return negative
    return None
