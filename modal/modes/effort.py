"""What a search for modes will take, estimated before it starts; refused where it is too much.

Multiplications are counted, and taken at one rate for all of them: the estimate of time is good to
a factor of two or three, and the same on any machine.
"""

from dataclasses import replace

import numpy as np

from modal.solvers.factor import Cost, Shape, choose
from modal.system.linear_system import LinearSystem
from modal.tools.workload import refuse_above

RATE = 1e10
"""Multiplications a second on one core at 2.5 GHz, additions included: of dense blocks there may be
three times as many, of sparse ones half."""
PRODUCT = 200
"""Multiplications that take as long as A v for each degree of freedom, which waits for memory."""
SPARSE = 1.2
"""The same for each nonzero of A and vector of a block; without numba four times as many."""
ORTHOGONAL = 4
"""The same for each number of a basis and each of its vectors, to keep it orthogonal."""
DENSE = 5
"""Multiplications of a dense eigenproblem over the cube of its rows. Two blocks of opposite
wavevectors share one complex eigenproblem, which costs about as much as two real ones."""


def shape_of(system: LinearSystem) -> Shape:
    """The shape of A, without assembling it: its layers lie along the longest side."""
    network = system.network
    longest = np.ptp(network.position, axis=0).max() / (2 * network.radius.mean()) + 1
    pairs = int((network.particle_j >= 0).sum())
    nonzeros = float(system.dof**2 * (network.n_particles + 2 * pairs))
    return Shape(system.size, nonzeros, system.size / longest)


def factorisation(system: LinearSystem, *, kept: bool) -> Cost:
    """The cost of a factorisation, `kept` or for the inertia alone, and of its matrix."""
    shape = shape_of(system)
    cost = choose(shape, system.solver, kept=kept).cost(shape, kept)
    return replace(cost, bytes=cost.bytes + 40 * shape.nonzeros)


def _lanczos(system: LinearSystem, vectors: int, each: float) -> Cost:
    """The cost of a basis of so many vectors, each of which takes so many operations."""
    orthogonal = ORTHOGONAL * system.size * vectors
    return Cost(8.0 * system.size * vectors, vectors * (each + orthogonal))


def near_a_shift(system: LinearSystem, count: int) -> Cost:
    """The cost of finding `count` modes about shifts.

    They are cut into slices of about `Limits.slice` modes, each with its own factorisation, exact
    count and Lanczos basis.
    """
    most = system.limits.slice
    slices = 1 if count <= most else int(np.ceil(count / (0.7 * most)))
    factor, counting = (factorisation(system, kept=kept) for kept in (True, False))
    # About four vectors for each mode, and a hundred.
    search = _lanczos(system, 4 * -(-count // slices) + 100, factor.each)
    operations = factor.operations + counting.operations + search.operations
    return Cost(max(factor.bytes + search.bytes, counting.bytes), slices * operations)


def below_an_edge(system: LinearSystem, count: int, degree: int) -> Cost:
    """The cost of finding the `count` lowest modes by `degree` products with A for each vector.

    One exact count is made, which needs a factorisation.
    """
    counting = factorisation(system, kept=False)
    products = SPARSE * shape_of(system).nonzeros * degree
    search = _lanczos(system, count + count // 2 + 130, products)
    operations = counting.operations + search.operations
    return Cost(max(search.bytes, counting.bytes), operations)


def from_the_top(system: LinearSystem, count: int) -> Cost:
    """The cost of the `count` highest modes by products with A, without an exact count."""
    if count == 1:
        # Two passes of three vectors (`modal.solvers.spectrum`); then as many hold its observables.
        return Cost(80.0 * system.size, 400.0 * system.size * PRODUCT)
    basis, products = 3 * count + 40, 300 + 15 * count
    each = system.size * (PRODUCT + 4 / 3 * ORTHOGONAL * basis)
    return Cost(8.0 * system.size * (basis + 2 * count), products * each)


def of_blocks(rows: int, blocks: int) -> Cost:
    """The cost of all modes of dense complex blocks, solved one after the other."""
    return Cost(48.0 * rows**2, float(blocks * DENSE * rows**3))


def refuse_endless_search(system: LinearSystem, cost: Cost, task: str, remedy: str) -> None:
    """InputError, with the estimate, where a search takes longer or more memory than it may."""
    longest, seconds = 3600 * system.hours, cost.operations / RATE
    if seconds > longest:
        remedy += f", or allow more hours than {system.hours:g}"
    refuse_above(seconds, cost.bytes, f"{task} about", remedy, longest)
