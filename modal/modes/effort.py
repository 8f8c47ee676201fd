"""What a search for modes will take, estimated before it starts.

Multiplications are counted, and taken at one rate for all of them: the estimate of time is good to
a factor of two or three, and the same on any machine, since it also decides how modes are sought.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.solvers.factor import Shape, choose
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


@dataclass(frozen=True)
class Effort:
    """Seconds on one core, and bytes at the peak."""

    seconds: float
    bytes: float


def nonzeros(system: LinearSystem) -> float:
    """Number of nonzero entries of A."""
    pairs = int((system.network.particle_j >= 0).sum())
    return float(system.dof**2 * (system.network.n_particles + 2 * pairs))


def shape_of(system: LinearSystem) -> Shape:
    """The shape of A, without assembling it: its layers lie along the longest side."""
    diameter = 2 * system.network.radius.mean()
    longest = np.ptp(system.network.position, axis=0).max() / diameter + 1
    return Shape(system.size, nonzeros(system), system.size / longest)


def factorisation(system: LinearSystem, *, counting: bool = False) -> tuple[Effort, float]:
    """The effort of a factorisation, and the seconds of one solve.

    `counting` asks for the inertia alone.
    """
    shape = shape_of(system)
    cost = choose(shape, system.solver, inertia=counting).cost(shape)
    needed = cost.memory(not counting) + 40 * shape.nonzeros
    return Effort(cost.operations / RATE, needed), cost.each / RATE


def basis_of(count: int) -> int:
    """About how many Lanczos vectors it takes to find `count` modes about a shift."""
    return 4 * count + 100


def near_a_shift(system: LinearSystem, count: int) -> Effort:
    """The effort of finding `count` modes about shifts.

    They are cut into slices of about `Limits.slice` modes, each with its own factorisation, exact
    count and Lanczos basis.
    """
    most = system.limits.slice
    slices = 1 if count <= most else int(np.ceil(count / (0.7 * most)))
    basis = basis_of(-(-count // slices))
    factor, solve = factorisation(system)
    counting, _ = factorisation(system, counting=True)
    orthogonal = ORTHOGONAL * system.size * basis**2 / RATE
    seconds = factor.seconds + counting.seconds + basis * solve + orthogonal
    vectors = 8.0 * system.size * basis
    return Effort(slices * seconds, max(factor.bytes + vectors, counting.bytes))


def below_an_edge(system: LinearSystem, count: int, degree: int) -> Effort:
    """The effort of finding the `count` lowest modes by `degree` products with A for each vector.

    One exact count is made, which needs a factorisation.
    """
    basis = 1.5 * count + 130
    counting, _ = factorisation(system, counting=True)
    products = SPARSE * nonzeros(system) * degree * basis
    orthogonal = ORTHOGONAL * system.size * basis**2
    vectors = 8.0 * system.size * basis
    seconds = (products + orthogonal) / RATE + counting.seconds
    return Effort(seconds, max(vectors, counting.bytes))


def from_the_top(system: LinearSystem, count: int) -> Effort:
    """The effort of the `count` highest modes by products with A, without an exact count."""
    if count == 1:
        # Two passes of three vectors (`modal.solvers.spectrum`); then as many hold its observables.
        return Effort(400 * system.size * PRODUCT / RATE, 80.0 * system.size)
    basis, products = 3 * count + 40, 300 + 15 * count
    each = system.size * (PRODUCT + 4 / 3 * ORTHOGONAL * basis)
    return Effort(products * each / RATE, 8.0 * system.size * (basis + 2 * count))


def of_blocks(rows: int, blocks: int) -> Effort:
    """The effort of all modes of dense complex blocks, solved one after the other."""
    return Effort(blocks * DENSE * rows**3 / RATE, 48.0 * rows**2)


def refuse_endless_search(system: LinearSystem, effort: Effort, task: str, remedy: str) -> None:
    """InputError, with the estimate, where a search takes longer or more memory than it may."""
    longest = 3600 * system.hours
    if effort.seconds > longest:
        remedy += f", or allow more hours than {system.hours:g}"
    refuse_above(effort.seconds, effort.bytes, f"{task} about", remedy, longest)
