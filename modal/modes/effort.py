"""What a search for modes will take, estimated before it starts.

The constants were fitted on one core at 2.5 GHz to crystals of 4 x 4 x 200 and 10 x 10 x 30 and a
random packing of 35,201 spheres; these came out within a factor of two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.solvers.factor import available
from modal.system.linear_system import LinearSystem
from modal.tools.workload import refuse_above

FILL = 1.2
"""Entries of a nested-dissection factor for each nonzero of A and sphere across the packing."""
COSTS = {
    "pardiso": (10.0, 4e-9, 2.5e-10),
    "banded": (25.0, 8e-8, 5e-9),
    "superlu": (82.0, 1.4e-7, 6e-9),
    "layers": (0.2, 1.4e-7, 0.0),
}
"""For each solver three numbers: bytes of memory for each entry of a nested-dissection factor;
seconds of a factorisation for each such entry and each sphere across; seconds of a solve for each
such entry. A nested-dissection factor is the measure, whatever the solver itself stores."""
ASSEMBLY = 5e-7
"""Seconds for each nonzero of A."""
ORTHOGONAL = 2e-10
"""Seconds for each multiplication and addition of a dense product."""
PRODUCT = 2e-8
"""Seconds of A v for each degree of freedom."""
PRODUCT_OF_BLOCK = 1.2e-10
"""Seconds of A v for each nonzero of A and vector of a block; without numba four times as long."""
DENSE = 5e-10
"""Seconds of a dense eigenproblem over the cube of its rows. Two blocks of opposite wavevectors
share one complex eigenproblem, which costs about as much as two real ones."""


@dataclass(frozen=True)
class Effort:
    """Seconds on one core, and bytes at the peak."""

    seconds: float
    bytes: float


def nonzeros(system: LinearSystem) -> float:
    """Number of nonzero entries of A."""
    pairs = int((system.network.particle_j >= 0).sum())
    return float(system.dof**2 * (system.network.n_particles + 2 * pairs))


def factorisation(system: LinearSystem, *, counting: bool = False) -> tuple[Effort, float]:
    """The effort of a factorisation, assembly of A included, and the seconds of one solve.

    `counting` asks for a factorisation whose inertia is counted. Nested dissection cuts a packing
    across its longest side, so the factor grows with the other two.
    """
    solver = system.solver or ("pardiso" if available("pardiso") else "banded")
    if solver == "banded" and counting:
        solver = "layers"
    diameter = 2 * system.network.radius.mean()
    sides = np.sort(np.ptp(system.network.position, axis=0) / diameter + 1)
    across = float(np.sqrt(sides[0] * sides[1]))
    bytes_each, seconds_each, solve_each = COSTS[solver]
    entries = FILL * nonzeros(system) * across
    seconds = ASSEMBLY * nonzeros(system) + seconds_each * entries * across
    return Effort(seconds, bytes_each * entries + 40 * nonzeros(system)), solve_each * entries


def basis_of(count: int) -> int:
    """About how many Lanczos vectors it takes to find `count` modes about a shift."""
    return 4 * count + 100


def near_a_shift(system: LinearSystem, count: int, slice_size: int) -> Effort:
    """The effort of finding `count` modes about shifts.

    They are cut into slices of about `slice_size` modes, each with its own factorisation, exact
    count and Lanczos basis.
    """
    slices = 1 if count <= slice_size else int(np.ceil(count / (0.7 * slice_size)))
    basis = basis_of(-(-count // slices))
    factor, solve = factorisation(system)
    counting, _ = factorisation(system, counting=True)
    orthogonal = 2 * ORTHOGONAL * system.size * basis**2
    seconds = factor.seconds + counting.seconds + basis * solve + orthogonal
    vectors = 8.0 * system.size * basis
    return Effort(slices * seconds, max(factor.bytes + vectors, counting.bytes))


def below_an_edge(system: LinearSystem, count: int, degree: int) -> Effort:
    """The effort of finding the `count` lowest modes by `degree` products with A for each vector.

    One exact count is made, which needs a factorisation.
    """
    basis = 1.6 * count + 130
    counting, _ = factorisation(system, counting=True)
    products = PRODUCT_OF_BLOCK * nonzeros(system) * degree * basis
    orthogonal = 2 * ORTHOGONAL * system.size * basis**2
    vectors = 8.0 * system.size * basis
    return Effort(products + orthogonal + counting.seconds, max(vectors, counting.bytes))


def from_the_top(system: LinearSystem, count: int) -> Effort:
    """The effort of the `count` highest modes by products with A, without an exact count."""
    if count == 1:
        # Two passes of three vectors (`modal.solvers.top_mode`); then as many hold its observables.
        return Effort(400 * system.size * PRODUCT, 80.0 * system.size)
    basis, products = 3 * count + 40, 300 + 15 * count
    each = system.size * (PRODUCT + 4 * ORTHOGONAL * 2 / 3 * basis)
    return Effort(products * each, 8.0 * system.size * (basis + 2 * count))


def of_blocks(rows: int, blocks: int) -> Effort:
    """The effort of all modes of dense complex blocks, solved one after the other."""
    return Effort(blocks * DENSE * rows**3, 48.0 * rows**2)


def refuse_endless_search(system: LinearSystem, effort: Effort, task: str, remedy: str) -> None:
    """InputError, with the estimate, where a search takes longer or more memory than it may."""
    longest = 3600 * system.hours
    if effort.seconds > longest:
        remedy += f", or allow more hours than {system.hours:g}"
    refuse_above(effort.seconds, effort.bytes, f"{task} about", remedy, longest)
