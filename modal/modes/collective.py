"""Zero modes that many spheres share, which the structure of the contacts does not show.

Spheres that have three contacts each are held one by one; together they may still move without
energy where springs are few: in packings without tangential springs, mostly. Such modes come back
from a search at an omega^2 of plus or minus round-off. They are no elastic modes: they are added
to the floppy ones, so that they are held out, and counted as what they are.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from modal.formats.arrays import Floats
from modal.modes.effort import near_a_shift
from modal.modes.problem import SMALL, Eigenproblem
from modal.modes.zero_modes import FloppyModes
from modal.packing.network import Network
from modal.solvers.factor import factorise
from modal.solvers.lanczos import BLOCK, Held, modes_nearest
from modal.workload import memory_at_hand

SHIFT = 1e-7
"""Shift below zero, relative to the largest diagonal entry, that keeps the factor definite."""
NEAR_ZERO = 1e3
"""Times the bound of zero: what a search gives below it is looked at once more, by its energy."""
HARDLY = 1.5
"""Springs for each motion that is left, up to which some of these motions may well be free: more
than one, as some springs hold what others hold already."""
LONGEST = 10.0
"""Seconds that a search for these modes may take by estimate."""


def every_floppy(problem: Eigenproblem) -> FloppyModes:
    """The zero modes with the collective ones, which are searched for where springs are few.

    Up to `SMALL` degrees of freedom the dense spectrum shows them all. Of larger networks those
    with fewer springs than motions are searched, and those with contacts that lack a tangential
    spring up to `HARDLY` springs for each, if that is estimated to take less than `LONGEST`; the
    others are taken to be held.
    """
    floppy = problem.floppy
    if not floppy.all_known:
        left = problem.size - floppy.total
        if problem.size <= SMALL:
            square, vector = eigh(problem.scaled.toarray())
            add_from_spectrum(problem, square, vector)
        elif springs(problem.network) <= left * (HARDLY if _slippery(problem.network) else 1):
            _search(problem)
        floppy.all_known = True
    return floppy


def springs(network: Network) -> int:
    """Number of springs: the rank of K is no higher."""
    along, across = network.stiffness_normal != 0, network.stiffness_tangential != 0
    return int(along.sum() + 2 * across.sum())


def _slippery(network: Network) -> bool:
    """Whether some contact has no tangential spring."""
    return not network.stiffness_tangential.all()


def lacking(problem: Eigenproblem) -> int:
    """How many zero modes are unknown, at least: so many springs are missing."""
    return max(0, problem.size - problem.floppy.total - springs(problem.network))


def add_from_spectrum(problem: Eigenproblem, square: Floats, vector: Floats) -> None:
    """Add what all eigenvectors (size, size) with their omega^2 (size,) show of zero modes."""
    zero = np.abs(square) <= problem.zero
    if int(zero.sum()) > problem.floppy.total:
        problem.floppy.add(vector[:, zero])
    problem.floppy.all_known = True


def _search(problem: Eigenproblem) -> None:
    """Add zero modes that are found about a shift, until a round finds none."""
    effort = near_a_shift(problem, lacking(problem) + BLOCK, problem.size)
    if effort.seconds > LONGEST or effort.bytes > memory_at_hand():
        return
    sigma = -SHIFT * problem.diagonal.max()
    solver = None if problem.solver == "layers" else problem.solver
    factor = factorise(problem.shifted(sigma), definite=True, solver=solver)
    nothing, found, new = np.empty((problem.size, 0)), 0, 1
    while new:
        held = Held(problem.floppy.basis, nothing, round=found)
        ask = min(max(lacking(problem), BLOCK), held.free)
        if ask == 0:
            break
        near = modes_nearest(factor.solve, problem.size, ask, sigma, held)
        zero, _, _ = split(problem, near.square[near.converged], near.vector[:, near.converged])
        # One more solve takes out what is left in them of the stiffest motions.
        zero = factor.solve(zero) * -sigma if zero.shape[1] else zero
        new = problem.floppy.add(zero)
        found += new
    factor.release()


def split(problem: Eigenproblem, square: Floats, vector: Floats) -> tuple[Floats, Floats, Floats]:
    """Zero modes (size, z), and omega^2 (k,) and unit vectors (size, k) of all others.

    `square` and `vector` are modes as a search gives them. Those near zero are told apart by their
    energies: the eigenvalues of A among them, from products with A, whose round-off is far below
    that of a factorisation.
    """
    near = np.abs(square) <= NEAR_ZERO * problem.zero
    if not near.any():
        return vector[:, near], square, vector
    some = np.ascontiguousarray(vector[:, near])
    energy, mixing = eigh(some.T @ problem.operator.apply(some))
    some = some @ mixing
    zero = np.abs(energy) <= problem.zero
    square = np.concatenate([energy[~zero], square[~near]])
    return some[:, zero], square, np.concatenate([some[:, ~zero], vector[:, ~near]], axis=1)
