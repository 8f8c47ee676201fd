"""Estimate the time and memory of a search for modes before it starts, and refuse it if too much.

Multiplications are counted, and divided by one fixed rate: the estimate of time is right within a
factor of two or three, and is the same on any machine.
"""

from dataclasses import replace

import numpy as np

from modal.solvers.davidson import BLOCKS, GUARDS, WIDTH
from modal.solvers.factor import Cost, Shape, choose, named
from modal.system.linear_system import LinearSystem
from modal.tools.memory import memory_at_hand
from modal.tools.workload import refuse_above

OPERATIONS_PER_SECOND = 1e10
"""Multiplications, with their additions, that one core at 2.5 GHz does in a second. Products of
dense blocks are up to three times as fast, of sparse ones half as fast."""
PRODUCT_OPERATIONS = 200
"""Multiplications that would take as long as the product A v, for each degree of freedom: the
product is slow because it waits for memory."""
BLOCK_PRODUCT_OPERATIONS = 0.8
"""Multiplications that would take as long as the product of A with a block, for each nonzero of A
and each vector of the block. Without numba the product takes some six times as long."""
ORTHOGONALISATION_OPERATIONS = 4
"""Multiplications to make a vector orthogonal to a basis, for each number of the basis."""
VECTORS_PER_LIFTED_MODE = 1.75
MORE_LIFTED_VECTORS = 60
"""Vectors of a search by a polynomial for each mode, and besides; of a second one as many as
besides."""
VECTORS_PER_MODE = 4
MORE_VECTORS = 100
"""Vectors of a search by solves for each mode, and besides."""
KEPT_SHARE = 0.8
"""Share of the memory of multigrid's set-up that is still in use during the search."""
DAVIDSON_COPIES = 5
"""Blocks of new vectors that exist besides the basis at the peak."""
CYCLES_PER_MODE = 45
MORE_CYCLES = 150
"""Cycles of multigrid for each mode that Davidson's method finds, and besides for a second
search."""
DAVIDSON_OPERATIONS = 14
"""Multiplications of Davidson's method besides cycles and products, for each vector and each number
of the basis."""
DENSE_OPERATIONS = 5
"""Multiplications of a dense eigenproblem, divided by the cube of its rows. Two blocks of opposite
wave vectors share one complex eigenproblem, which costs about as much as two real ones."""


def shape_of(system: LinearSystem) -> Shape:
    """Return the shape of A without assembling it.

    The rows are ordered in layers along the longest side.
    """
    network = system.network
    diameter = 2 * network.radius.mean()
    layers = np.ptp(network.position, axis=0).max() / diameter + 1
    pairs = int((network.particle_j >= 0).sum())
    nonzeros = float(system.dof**2 * (network.n_particles + 2 * pairs))
    return Shape(system.size, nonzeros, system.size / layers)


def factorisation(system: LinearSystem, *, kept: bool) -> Cost:
    """Estimate the cost of a factorisation of A and of the matrix itself.

    The factor is `kept` in memory for solutions, or gives the inertia alone.
    """
    shape = shape_of(system)
    cost = choose(shape, system.direct_solver, kept=kept).cost(shape, kept)
    return replace(cost, bytes=cost.bytes + 40 * shape.nonzeros)


def _lanczos(system: LinearSystem, vectors: int, operations_each: float) -> Cost:
    """Estimate the cost of a Lanczos basis of `vectors`, each of which takes `operations_each`."""
    orthogonal = ORTHOGONALISATION_OPERATIONS * system.size * vectors
    return Cost(8.0 * system.size * vectors, vectors * (operations_each + orthogonal))


def near_a_shift(system: LinearSystem, count: int) -> Cost:
    """Estimate the cost of finding `count` modes about shifts.

    The modes are cut into slices of about `Limits.slice` modes, each with its own factorisation,
    exact count and Lanczos basis.
    """
    largest_slice = system.limits.slice
    slices = 1
    if count > largest_slice:
        slices = int(np.ceil(count / (0.7 * largest_slice)))
    factor = factorisation(system, kept=True)
    counting = factorisation(system, kept=False)
    modes_of_slice = -(-count // slices)
    search = _lanczos(system, VECTORS_PER_MODE * modes_of_slice + MORE_VECTORS, factor.each)
    operations = factor.operations + counting.operations + search.operations
    return Cost(max(factor.bytes + search.bytes, counting.bytes), slices * operations)


def by_multigrid(system: LinearSystem, count: int) -> Cost:
    """Estimate the cost of the `count` lowest modes by multigrid, without an exact count."""
    shape = shape_of(system)
    solver = named("multigrid").cost(shape, True)
    cycles = CYCLES_PER_MODE * count + MORE_CYCLES
    basis = count + GUARDS + (BLOCKS + 1) * WIDTH
    vectors = basis + DAVIDSON_COPIES * WIDTH
    product = BLOCK_PRODUCT_OPERATIONS * shape.nonzeros
    orthogonal = DAVIDSON_OPERATIONS * system.size * basis
    each = solver.approximation + 2 * product + orthogonal
    kept = KEPT_SHARE * solver.bytes + 8.0 * system.size * vectors
    return Cost(max(solver.bytes, kept), solver.operations + cycles * each)


def below_an_edge(system: LinearSystem, count: int, degree: int, *, counted: bool) -> Cost:
    """Estimate the cost of the `count` lowest modes by `degree` products with A for each vector.

    One exact count is made, which needs a factorisation, unless the list is not `counted`.
    """
    counting = factorisation(system, kept=False) if counted else Cost(0.0, 0.0)
    products = BLOCK_PRODUCT_OPERATIONS * shape_of(system).nonzeros * degree
    vectors = int(VECTORS_PER_LIFTED_MODE * count) + MORE_LIFTED_VECTORS
    if not counted:
        vectors += MORE_LIFTED_VECTORS
    search = _lanczos(system, vectors, products)
    operations = counting.operations + search.operations
    return Cost(max(search.bytes, counting.bytes), operations)


def from_the_top(system: LinearSystem, count: int) -> Cost:
    """Estimate the cost of the `count` highest modes by products with A, without an exact count."""
    if count == 1:
        # Two passes of three vectors (`modal.solvers.spectrum`); then as many hold its observables.
        return Cost(80.0 * system.size, 400.0 * system.size * PRODUCT_OPERATIONS)
    basis = 3 * count + 40
    products = 300 + 15 * count
    each = system.size * (PRODUCT_OPERATIONS + 4 / 3 * ORTHOGONALISATION_OPERATIONS * basis)
    return Cost(8.0 * system.size * (basis + 2 * count), products * each)


def of_blocks(rows: int, blocks: int) -> Cost:
    """Estimate the cost of all modes of dense complex blocks, solved one after the other."""
    return Cost(48.0 * rows**2, float(blocks * DENSE_OPERATIONS * rows**3))


def is_endless(system: LinearSystem, cost: Cost) -> bool:
    """Tell whether a search takes more time or memory than it may."""
    seconds = cost.operations / OPERATIONS_PER_SECOND
    return seconds > 3600 * system.hours or cost.bytes > memory_at_hand()


def refuse_endless_search(system: LinearSystem, cost: Cost, task: str, remedy: str) -> None:
    """Raise InputError, with the estimate, if a search takes more time or memory than it may."""
    max_seconds = 3600 * system.hours
    seconds = cost.operations / OPERATIONS_PER_SECOND
    if seconds > max_seconds:
        remedy += f", or allow more hours than {system.hours:g}"
    refuse_above(seconds, cost.bytes, f"{task} about", remedy, max_seconds)
