"""All zero modes: how many there are, by an exact count, and what structure does not show of them.

Spheres that have three contacts each are held one by one; together they may still move without
energy, which the structure of the contacts does not show: where springs are few, and in crystals,
whose contacts repeat. No test of the structure alone excludes it; the number of eigenvalues of A up
to the one threshold of zero does, at the price of a factorisation. It is made wherever it takes
seconds, and in larger packings wherever the structure is doubtful (`doubtful`); elsewhere what is
told of the zero modes is what structure shows, `counted` being False.
"""

from contextlib import suppress
from dataclasses import replace
from typing import Any

import scipy.sparse as sp

from modal.modes.counts import count_below
from modal.modes.effort import factorisation
from modal.modes.search import AboutShift, Search
from modal.modes.zero_modes import FloppyModes, by_structure
from modal.solvers.factor import SingularError
from modal.solvers.lanczos import BASIS_VECTORS_PER_MODE, Held, orthonormal
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError, UnavailableError
from modal.tools.workload import refuse_above_memory

EASY = 3e10
"""Multiplications, of some seconds, of a count that is made in any packing."""
SHIFT = 1e-9
"""Shift below zero about which they are sought, relative to A's largest diagonal entry."""
UNDER = 1e-6
"""Relative to that entry: first shift below zero tried, of those below all unstable modes."""
ZERO, UNSTABLE = "motions without energy", "unstable modes"
COUNTED = "counted zero modes"


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
        "floppy_modes_by_kind": floppy.kinds,
        "floppy_modes_counted": floppy.counted,
    }


def counted_floppy(system: LinearSystem, at_zero: Floats | None = None) -> FloppyModes:
    """The zero modes, their number by an exact count; made once for all problems of a network.

    A complete list from zero on gives those `at_zero` (size, c) that it has found beside those of
    the structure: the count at its end leaves room for no others.
    """
    return system.kept(COUNTED, None, lambda: _counted(system, at_zero), lambda _: 0.0)


def _counted(system: LinearSystem, at_zero: Floats | None) -> FloppyModes:
    """As `counted_floppy`."""
    floppy, unstable = by_structure(system), sp.csc_matrix((system.size, 0))
    collective = sp.csc_matrix(unstable if at_zero is None else at_zero)
    if at_zero is None:
        unstable = _found(system, floppy.basis, count_below(system, 0.0), UNSTABLE)
        others = sp.hstack([floppy.basis, unstable], format="csc")
        if floppy.total < system.size:
            further = count_below(system, system.zero_frequency / 2) - others.shape[1]
            definite = not unstable.shape[1]
            collective = _found(system, others, further, ZERO, definite=definite)
    return replace(
        floppy,
        basis=sp.hstack([floppy.basis, collective, unstable], format="csc"),
        kinds=floppy.kinds | {"collective": collective.shape[1]},
        unstable=unstable.shape[1],
        counted=True,
    )


def _found(
    system: LinearSystem, known: sp.csc_matrix, count: int, what: str, *, definite: bool = True
) -> sp.csc_matrix:
    """Shape (size, count): orthonormal vectors of `what` there is beside the `known` modes.

    Zero modes are nearest to a shift just below zero, unstable ones to a shift below all of them,
    from where on A - sigma is definite. InputError where they have no room, or not all are found.
    """
    threshold, largest = system.zero_threshold, system.diagonal.max(initial=0.0)
    sigma = -(SHIFT if what == ZERO else UNDER) * largest

    def inside(square: Floats) -> Bools:
        return abs(square) <= threshold if what == ZERO else square < -threshold

    if count <= 0:
        return sp.csc_matrix((system.size, 0))
    remedy = "take a smaller packing"
    refuse_above_memory(
        8 * BASIS_VECTORS_PER_MODE * system.size * count, f"finding {count} {what}", remedy
    )
    missing = None
    while missing is None:
        source = AboutShift(system, sigma, definite=definite)
        search = Search(system, source, known)
        try:
            missing = search.search_until(count, inside)
        except SingularError:
            sigma *= 4
    vectors = search.vector[:, inside(search.square)]
    if source.factor is not None and not missing:
        # What Lanczos leaves of other modes, one more solve makes as small as round-off.
        vectors = source.factor.solve(vectors)
    source.release()
    if missing:
        raise UnavailableError(
            "not_converged", f"{count} {what} were counted, but not all were found"
        )
    return sp.csc_matrix(orthonormal(vectors, Held(known, vectors[:, :0])))


def easy(system: LinearSystem) -> bool:
    """Whether an exact count takes some seconds, by estimate, or none as it was made."""
    counted = bool(system.cached(COUNTED, dict))
    return counted or factorisation(system, kept=False).operations <= EASY


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
