"""Sparse factorisations behind one registry: what each can do, what it costs, which one is taken.

Each module of `modal.solvers.factorisations` holds one as its `FACTORISATION`; a further one needs
a module there and nothing else. They give solutions, and of a real symmetric matrix its inertia:
the number of negative eigenvalues, which counts modes (Sylvester's law).
"""

from __future__ import annotations

import importlib.util
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import reverse_cuthill_mckee

from modal.solvers import factorisations
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError, refuse_unknown
from modal.tools.workload import memory_at_hand, refuse_above_memory

SOLVERS = tuple(sorted(module.name for module in pkgutil.iter_modules(factorisations.__path__)))
"""Names of all factorisations, whether or not what they need is installed."""
BACKWARD = 1e-11
"""Largest |A x - b| / (|A| |x|) of a factor whose signs are a count: so far, relative to the
largest one, round-off may have moved the eigenvalues, and so near to a mode no count is exact
(`COUNTED` of `modal.system.linear_system`). Without pivots near zero it is some 1e-16."""
SMALL = 3000
"""Rows up to which scipy's own factorisations are taken: to load another package takes longer."""
SHARE = 0.5
"""Of the free memory: a factorisation that takes more is left for one that takes less, as the
blocks do where the inertia alone is wanted."""
SMALLER = "take a smaller packing"
"""What to do where memory does not suffice."""


class SingularError(InputError):
    """A matrix that is singular, or that is not definite as was promised."""

    def __init__(self, definite: bool) -> None:
        super().__init__(
            "K has a negative direction: the packing is not stable with these springs; ask for the "
            "modes of an interval or for a count, which allow it"
            if definite
            else "K - sigma M is exactly singular at this frequency; ask for a slightly different "
            "one"
        )


@dataclass
class Factor:
    """A factorised matrix A.

    `solve` gives A^-1 b for b of shape (size,) or (size, k). `negative` is the number of negative
    eigenvalues of A; None where A is not real and symmetric, where a pivot was replaced, where rows
    were exchanged for a pivot, or where solutions are less accurate than `BACKWARD`: such a factor
    solves, but its signs are no count. `solver` names the factorisation. `release` frees the memory
    that it holds outside of Python; `solve` must not be called after it. `bytes`: its memory, by
    estimate.
    """

    solve: Callable[[Array], Array]
    negative: int | None
    release: Callable[[], None] = lambda: None
    solver: str = ""
    bytes: float = 0.0


@dataclass(frozen=True)
class Shape:
    """What the cost of a factorisation depends on.

    `rows` and `nonzeros` of the matrix, `layer`: rows of one of the layers in which contacts follow
    each other along the packing, `complex`: whether its numbers are.
    """

    rows: float
    nonzeros: float
    layer: float
    complex: bool = False

    @classmethod
    def of(cls, matrix: sp.csr_matrix, reach: Ints | None = None) -> Shape:
        """The shape of a matrix, whose layers are the `reach` of the rows of its `band`."""
        size = matrix.shape[0]
        wide = (band(matrix)[1] if reach is None else reach) - np.arange(size, dtype=float)
        layer = float(np.sqrt((wide**2).mean())) + 1
        return cls(size, matrix.nnz, layer, np.iscomplexobj(matrix))


@dataclass(frozen=True)
class Cost:
    """Bytes of a factor, multiplications of factorising and of solving for one column."""

    bytes: float
    operations: float
    each: float = 0.0


@dataclass(frozen=True)
class Factorisation:
    """One way to factorise, what it can, and what it costs.

    `package`: what must be installed besides scipy. `unsymmetric`: whether it takes such matrices;
    all take symmetric ones, real or complex, definite or not. `cost` estimates from a `Shape`, and
    from whether the factor is kept for solutions or only its inertia is wanted. `make` takes the
    matrix, the order of rows in which it is a narrow band, whether it is positive definite, whether
    it is symmetric, and again whether it is kept; it raises SingularError.
    """

    name: str
    make: Callable[[sp.csr_matrix, Ints, bool, bool, bool], Factor]
    cost: Callable[[Shape, bool], Cost]
    package: str | None = None
    unsymmetric: bool = True


def named(solver: str) -> Factorisation:
    """The factorisation of a name; InputError where there is none."""
    refuse_unknown("solver", solver, SOLVERS)
    return importlib.import_module(f"{factorisations.__name__}.{solver}").FACTORISATION


def available(solver: str) -> bool:
    """Whether what the factorisation needs is installed."""
    package = named(solver).package
    return package is None or importlib.util.find_spec(package) is not None


def choose(
    shape: Shape, solver: str | None, *, kept: bool, unsymmetric: bool = False
) -> Factorisation:
    """The factorisation for a matrix: the one that is named, or else the fastest that can do it.

    One whose package was installed for it comes first where the matrix is not small, then the one
    with the fewest operations; one that takes much of the free memory comes last. InputError for a
    `solver` that is unknown, not installed, or cannot do what is asked for.
    """
    if solver is None:
        every = [named(name) for name in SOLVERS if available(name)]
        able = [way for way in every if way.unsymmetric or not unsymmetric]
        most, small = SHARE * memory_at_hand(), shape.rows <= SMALL

        def rank(way: Factorisation) -> tuple[bool, bool, float]:
            cost = way.cost(shape, kept)
            return cost.bytes > most, (way.package is None) is not small, cost.operations

        return min(able, key=rank)
    way = named(solver)
    if not available(solver):
        raise InputError(
            f"solver {solver}: the package {way.package} is not installed; install it or choose "
            + " or ".join(name for name in SOLVERS if available(name))
        )
    if unsymmetric and not way.unsymmetric:
        raise InputError(f"solver {solver}: it takes no shear forces in K; take another")
    return way


def factorise(
    matrix: sp.csr_matrix,
    *,
    definite: bool = False,
    symmetric: bool = True,
    solver: str | None = None,
    kept: bool = True,
    along: Floats | None = None,
    remedy: str = SMALLER,
) -> Factor:
    """Factorise a matrix, real or complex; `definite` promises that it is positive definite.

    Where the factor is not `kept`, it gives the inertia and no solutions, which may take less
    memory. `along` (size,) are places of the rows along the packing, if they are known. InputError
    for an unsuitable `solver`, a singular matrix, or where the factor would take more than the free
    memory, with a `remedy`.
    """
    order, reach = band(matrix, along)
    shape = Shape.of(matrix, reach)
    way = choose(shape, solver, kept=kept, unsymmetric=not symmetric)
    if way.package is None:
        remedy += ", or install pypardiso, which needs less"
    needed = way.cost(shape, kept).bytes
    refuse_above_memory(needed, f"a factorisation by {way.name}", remedy)
    factor = way.make(matrix, order, definite, symmetric, kept)
    return replace(factor, solver=way.name, bytes=needed)


def band(matrix: sp.csr_matrix, along: Floats | None = None) -> tuple[Ints, Ints]:
    """Order of a matrix's rows in which it is a narrow band, and how far each row reaches.

    The reverse Cuthill-McKee order, or that of places `along` the packing: where it is wide, the
    former starts at a corner and cuts obliquely. The second is the last row, in this order, that a
    row or one before it shares an entry with.
    """
    orders = [reverse_cuthill_mckee(matrix, symmetric_mode=True)]
    if along is not None:
        orders.append(np.lexsort((np.argsort(orders[0]), along)))
    ways = [(order, reach_of(matrix, order)) for order in orders]
    return min(
        ways, key=lambda way: ((way[1] - np.arange(matrix.shape[0], dtype=float)) ** 2).sum()
    )


def reach_of(matrix: sp.csr_matrix, order: Ints) -> Ints:
    """Of rows in this order the last that each, or one before it, shares an entry with."""
    size = matrix.shape[0]
    rank = np.empty(size, np.int64)
    rank[order] = np.arange(size)
    reach = np.arange(size)
    filled = np.flatnonzero(np.diff(matrix.indptr))
    farthest = np.maximum.reduceat(rank[matrix.indices], matrix.indptr[filled])
    reach[rank[filled]] = np.maximum(rank[filled], farthest)
    return np.maximum.accumulate(reach)


def certain(negative: int, solve: Callable[[Array], Array], matrix: sp.csr_matrix) -> int | None:
    """The number of negative pivots if the factor is accurate, tried on one right-hand side."""
    rhs = np.random.default_rng(matrix.shape[0]).standard_normal(matrix.shape[0])
    found = solve(rhs)
    error, size = np.linalg.norm(matrix @ found - rhs), np.linalg.norm(found)
    return negative if error <= BACKWARD * abs(matrix.data).max() * size else None
