"""Solve for the static response of all spheres to several loads at once.

Conjugate gradients run with one of three preconditioners. With a PARDISO factorisation of K plus a
very small shift they take a few steps. With a cycle of multigrid they take tens of steps, or a
hundred and more where contacts are few; it is prepared faster and takes less memory. With the
inverse of each sphere's own block of K they need no package, and take hundreds of steps. All work
on the mass-scaled matrix A = M^-1/2 K M^-1/2, so that motions without energy stay zero: the load
does no work on them.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from modal.modes.effort import BLOCK_PRODUCT_OPERATIONS, factorisation, shape_of
from modal.modes.soft_motions import soft_motions
from modal.solvers.conjugate_gradients import Solution, conjugate_gradients
from modal.solvers.factor import Factor, available, named
from modal.system.imposed import Coupling
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import refuse_unknown
from modal.tools.memory import memory_at_hand

SOLVERS = ("pardiso", "multigrid", "gradients")
"""Names of the preconditioners: a factor of K, a hierarchy of coarser matrices, or the inverses of
the spheres' own blocks."""
SHIFT_SHARE = 1e-8
"""Shift of A below zero, divided by the largest diagonal entry of A. The softest elastic motion of
150 layers has an eigenvalue of 1e-5 of that entry, motions without energy have zero. With 1e-8,
3e-8 and 1e-7 the moduli of 125,000 spheres with 4.2 contacts take 30, 35 and 42 steps of multigrid:
some soft motions lie there."""
LOOK_BACK_STEPS = {"pardiso": 1, "multigrid": 4, "gradients": 30}
"""Number of steps of conjugate gradients over which the error is measured, by the
preconditioner."""
MAX_PRODUCTS = 20000
"""Largest number of products with K, after which a solution is refused."""
LOAD_ROUNDINGS = 10.0
"""Round-off of a load, in units of machine epsilon times the size of its terms."""
MULTIGRID_STEPS = 30
"""Number of steps of conjugate gradients with multigrid: 24 for the moduli of case 6."""
FEW_CONTACTS = 5.0
"""Mean number of contacts of a sphere below which more steps are taken."""
STEPS_WITH_FEW_CONTACTS = 80
"""Number of steps with few contacts: case 29, with 3.8, takes 80."""
STEP_OPERATIONS = 200
"""Multiplications that would take as long as a step besides product and cycle, for each row and
load."""
MIN_MULTIGRID_ROWS = 1e5
"""Least number of rows for which multigrid is taken: smaller packings take seconds in any way, and
PARDISO's few steps give more digits."""
MAX_FACTOR_OPERATIONS = 6e11
"""Largest number of multiplications of a factor that is used, about a minute."""
MAX_FACTOR_MEMORY_SHARE = 0.8
"""Largest share of the free memory that a factor may take."""


def steady_motion(
    system: LinearSystem,
    coupling: Coupling,
    allowed: Callable[[Floats], Floats],
    solver: str | None = None,
) -> tuple[Solution, str]:
    """Solve K u = p for the load p of a coupling, to a given error in energy.

    Parameters
    ----------
    system : LinearSystem
        The packing of n spheres.
    coupling : Coupling
        Its `push` (6n, k) is the load p, N and N m.
    allowed : callable
        Function that returns the allowed error in energy (k,), J, from the work p u (k,), J, of the
        motion so far.
    solver : str, optional
        One of `SOLVERS`, by default the one that is likely to be faster.

    Returns
    -------
    solution : Solution
        `motion` is u (6n, k), m and rad; `residual` is p - K u, N and N m.
    solver : str
        Name of the solver that was used.
    """
    if solver is None:
        solver = _faster_solver(system, coupling.push.shape[1])
    refuse_unknown("solver", solver, SOLVERS)
    root = system.sqrt_mass
    operator = system.renumbered
    if solver == "gradients":
        factor = _own_blocks(system)
    else:
        # Spheres that touch only their own images have no stiffness at all: any shift will do.
        sigma = -SHIFT_SHARE * system.diagonal.max() or -1.0
        soft = soft_motions(system) if solver == "multigrid" else None
        factor = system.factor(sigma, definite=True, solver=solver, soft=soft)
    load = root.over(coupling.push.toarray())
    load_terms = root.over(coupling.terms.toarray())
    round_off = LOAD_ROUNDINGS * np.finfo(float).eps * np.linalg.norm(load_terms, axis=0)

    def precondition(residual: Floats) -> Floats:
        return operator.inward(factor.precondition(operator.outward(residual)))

    scaled = conjugate_gradients(
        operator.apply,
        precondition,
        np.ascontiguousarray(operator.inward(load)),
        allowed,
        round_off,
        look_back=LOOK_BACK_STEPS[solver],
        most_products=MAX_PRODUCTS,
    )
    factor.release()
    motion = root.over(operator.outward(scaled.motion))
    residual = root.times(operator.outward(scaled.residual))
    return replace(scaled, motion=motion, residual=residual), solver


def _faster_solver(system: LinearSystem, columns: int) -> str:
    """Return the name of the solver that is likely to be faster for `columns` loads."""
    free = MAX_FACTOR_MEMORY_SHARE * memory_at_hand()
    shape = shape_of(system)
    operations = {}
    factor = factorisation(system, kept=True)
    fits = factor.bytes < free and factor.operations < MAX_FACTOR_OPERATIONS
    if fits and available("pardiso"):
        operations["pardiso"] = factor.operations
    hierarchy = named("multigrid").cost(shape, True)
    suitable = shape.rows > MIN_MULTIGRID_ROWS and available("multigrid")
    if suitable and hierarchy.bytes < free:
        contacts_per_sphere = 2 * system.network.n_contacts / system.network.n_particles
        few = contacts_per_sphere < FEW_CONTACTS
        steps = STEPS_WITH_FEW_CONTACTS if few else MULTIGRID_STEPS
        product = BLOCK_PRODUCT_OPERATIONS * shape.nonzeros
        step = hierarchy.approximation + product + STEP_OPERATIONS * shape.rows
        operations["multigrid"] = hierarchy.operations + steps * columns * step
    if not operations:
        return "gradients"
    return min(operations, key=lambda name: operations[name])


def _own_blocks(system: LinearSystem) -> Factor:
    """Return the inverse of A's diagonal blocks, one for each sphere, each shifted a little.

    Without the shift the blocks of rattlers would be singular; so would those of frictionless
    spheres, which have no stiffness against turning.
    """
    n = system.network.n_particles

    def invert() -> Floats:
        blocks = system.diagonal_blocks
        typical = np.einsum("nii->ni", blocks).mean(axis=0).max() or 1.0
        return np.asarray(np.linalg.inv(blocks + 1e-8 * typical * np.eye(6)), float)

    inverse = system.cached("inverse of own blocks", invert, 288.0 * n)
    return Factor(lambda b: (inverse @ b.reshape(n, 6, -1)).reshape(b.shape), None)
