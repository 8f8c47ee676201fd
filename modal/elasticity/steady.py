"""The steady motion of all spheres under several loads, at once.

Conjugate gradients with one of two preconditioners: a factor of K held by a very small shift, which
takes a few steps, where PARDISO is installed and the factor costs less than what it saves; else
each sphere's own block of K, which takes some hundreds. Both work on the mass-scaled matrix A =
M^-1/2 K M^-1/2, so that parts which nothing holds stay where the load leaves them.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from modal.modes.effort import factorisation
from modal.solvers.conjugate_gradients import Solution, conjugate_gradients
from modal.solvers.factor import Factor, available
from modal.system.imposed import Coupling
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import refuse_unknown
from modal.tools.memory import memory_at_hand

SOLVERS = ("pardiso", "gradients")
"""With a factor of K, or with the own blocks of the spheres."""
SHIFT = 1e-8
"""Of A's largest diagonal entry, held below the factor. The softest elastic motion of 150 layers
lies at 1e-5 of it, motions without energy at zero."""
LOOK_BACK = {"pardiso": 1, "gradients": 30}
"""Steps over which the error is measured."""
MOST_PRODUCTS = 20000
ROUNDED = 10.0
"""Roundings that may have been made on the way to a load."""
FACTOR_OPERATIONS = 6e11
"""Multiplications, of a minute or so: a factor that takes more is left out."""


def steady_motion(
    system: LinearSystem,
    coupling: Coupling,
    allowed: Callable[[Floats], Floats],
    solver: str | None = None,
) -> tuple[Solution, str]:
    """Solve K u = the push of a coupling, (6n, k), to an energy error; and the solver's name.

    `allowed` gives it (k,), J, from the work push u (k,), J, of the motion so far. The solution's
    motion is u (6n, k), its residual that of the push. `solver` is one of `SOLVERS`, by default the
    one that is likely to be faster.
    """
    if solver is None:
        cost = factorisation(system, kept=True)
        fits = cost.bytes < 0.8 * memory_at_hand() and cost.operations < FACTOR_OPERATIONS
        solver = "pardiso" if fits and available("pardiso") else "gradients"
    refuse_unknown("solver", solver, SOLVERS)
    root, operator = system.root, system.renumbered
    inward, outward = operator.inward, operator.outward
    if solver == "pardiso":
        # Spheres that touch but their own images have no stiffness at all: any shift will do.
        sigma = -SHIFT * system.diagonal.max() or -1.0
        factor = system.factor(sigma, definite=True, solver="pardiso")
    else:
        factor = _own_blocks(system)
    found = conjugate_gradients(
        operator.apply,
        lambda rest: inward(factor.solve(outward(rest))),
        np.ascontiguousarray(inward(root.over(coupling.push.toarray()))),
        allowed,
        ROUNDED * np.finfo(float).eps * np.linalg.norm(root.over(coupling.terms.toarray()), axis=0),
        look_back=LOOK_BACK[solver],
        most_products=MOST_PRODUCTS,
    )
    factor.release()
    motion, residual = root.over(outward(found.motion)), root.times(outward(found.residual))
    return replace(found, motion=motion, residual=residual), solver


def _own_blocks(system: LinearSystem) -> Factor:
    """The inverse of A's diagonal blocks, one for each sphere, all of them held a little.

    Rattlers have no stiffness, and smooth spheres have but round-off against turning.
    """
    n = system.network.n_particles

    def inverted() -> Floats:
        blocks = system.own_blocks
        held = np.einsum("nii->ni", blocks).mean(axis=0).max() or 1.0
        return np.asarray(np.linalg.inv(blocks + 1e-8 * held * np.eye(6)), float)

    inverse = system.cached("inverse of own blocks", inverted, 288.0 * n)
    return Factor(lambda b: (inverse @ b.reshape(n, 6, -1)).reshape(b.shape), None)
