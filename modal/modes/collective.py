"""All zero modes: how many there are, by an exact count, and what structure does not show of them.

Spheres that have three contacts each are held one by one; together they may still move without
energy, which the structure of the contacts does not show: where springs are few, and in crystals,
whose contacts repeat. No test of the structure alone excludes it; the number of eigenvalues of A up
to the one threshold of zero does, at the price of a factorisation. It is made wherever it takes
seconds, and in larger packings wherever the structure is doubtful (`doubtful`); elsewhere what is
told of the zero modes is what structure shows, `counted` being False.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
from scipy.linalg import eigvalsh, qr

from modal.modes.counts import count_below, unstable_modes
from modal.modes.effort import factorisation
from modal.modes.search import Search
from modal.modes.zero_modes import FloppyModes, by_structure
from modal.solvers.factor import SingularError
from modal.solvers.lanczos import start_block
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.tools.workload import refuse_above_memory

EASY = 3.0
"""Seconds, by estimate, of a count that is made in any packing."""
SHIFT = 1e-9
"""Shift below zero of the factor that finds them, relative to A's largest diagonal entry."""
UNDER = 1e-6
"""Relative to that entry: first shift below zero tried, of those below all unstable modes."""
STEPS = 40
"""Steps of inverse iteration at most. Each leaves of an elastic mode the share that `SHIFT` has of
its omega^2: three steps mostly do, forty for one that is hardly above zero."""
STILL = 1e-2
"""Times the bound of zero: largest entry of A v of unit vectors v that need no further step."""


def every_floppy(system: LinearSystem) -> FloppyModes:
    """The zero modes, counted where that is easy or where their structure is doubtful.

    Where a count would take more than the memory or the time, and elsewhere, those that structure
    shows; of a K that is not symmetric, which cannot be counted, too. InputError where K may have
    negative directions, and these cannot be counted.
    """
    floppy = by_structure(system)
    if not system.symmetric:
        return floppy
    if not system.semidefinite:
        return counted_floppy(system)
    if doubtful(system, floppy) or easy(system):
        with suppress(InputError):
            return counted_floppy(system)
    return floppy


def summary_at_zero(system: LinearSystem) -> dict[str, Any]:
    """The zero modes, and the unstable ones, in plain numbers by name."""
    floppy = every_floppy(system)
    return {
        "unstable_modes": floppy.unstable,
        "floppy_modes": floppy.total,
        "floppy_modes_by_kind": floppy.by_kind(),
        "floppy_modes_counted": floppy.counted,
    }


def easily_known_floppy(system: LinearSystem) -> FloppyModes:
    """As `every_floppy`, in seconds: of larger packings what structure shows."""
    return every_floppy(system) if easy(system) else by_structure(system)


def counted_floppy(system: LinearSystem) -> FloppyModes:
    """The zero modes, their number by an exact count; made once for all problems of a network."""

    def make() -> FloppyModes:
        floppy, further = by_structure(system), 0
        unstable = _unstable(system, floppy, unstable_modes(system))
        if floppy.total < system.size:
            least = float(frequency_of(np.array([system.zero_threshold]))[0]) / 2
            further = count_below(system, least) - floppy.total - unstable.shape[1]
        return floppy.with_counted(_further(system, floppy, unstable, further), unstable)

    return system.cached("counted zero modes", make)


def _unstable(system: LinearSystem, floppy: FloppyModes, count: int) -> Floats:
    """Shape (size, count): the modes below zero, orthonormal; so many there are.

    From a shift below all of them, where A - sigma is definite, they are the nearest ones.
    """
    sigma = -UNDER * system.diagonal.max(initial=0.0)
    while count:
        search = Search(system, sigma, definite=True, floppy=floppy)
        try:
            missing = search.search_until(count, lambda square: square < -system.zero_threshold)
        except SingularError:
            sigma *= 4
            continue
        search.release()
        if missing:
            raise InputError(f"{count} unstable modes were counted, but not all were found")
        return search.vector[:, search.square < -system.zero_threshold]
    return np.empty((system.size, 0))


def _further(system: LinearSystem, floppy: FloppyModes, unstable: Floats, count: int) -> Floats:
    """Shape (size, count): zero modes beside the `floppy` ones, orthonormal; so many there are.

    By inverse iteration on as many vectors. InputError where these have no room, or do not become
    as still as zero modes are.
    """
    vectors = start_block(system.size, max(count, 0))
    if count <= 0:
        return vectors
    remedy = "take a smaller packing"
    refuse_above_memory(3 * vectors.nbytes, f"finding {count} motions without energy", remedy)
    shift, stable = -SHIFT * system.diagonal.max(), not unstable.shape[1]
    factor = system.factor(shift, definite=stable)
    for _ in range(STEPS):
        vectors = factor.solve(vectors)
        for _ in range(2):
            for known in (floppy.basis, unstable):
                vectors -= known @ (known.T @ vectors)
            vectors = qr(vectors, mode="economic", overwrite_a=True, check_finite=False)[0]
        products = system.operator.apply(np.ascontiguousarray(vectors))
        if abs(products).max() <= STILL * system.zero_threshold:
            break
    factor.release()
    if eigvalsh(vectors.T @ products)[-1] > system.zero_threshold:
        raise InputError(f"{count} motions without energy were counted, but not all were found")
    return vectors


def easy(system: LinearSystem) -> bool:
    """Whether an exact count takes some seconds, by estimate."""
    return factorisation(system, counting=True)[0].seconds <= EASY


def doubtful(system: LinearSystem, floppy: FloppyModes) -> bool:
    """Whether structure may well not show all zero modes of a disordered packing.

    So it is with contacts that lack a tangential spring, with fewer springs than motions, with a
    loose part that is too large to be looked at, and where motions may release energy.
    """
    network = system.network
    springs = int((network.stiffness_normal != 0).sum())
    springs += 2 * int((network.stiffness_tangential != 0).sum())
    left = floppy.basis.shape[0] - floppy.total
    return not floppy.whole or not network.stiffness_tangential.all() or springs <= left
