"""Find all zero modes, also those that the structure of the contacts does not show.

Spheres with three contacts each cannot move singly without energy; together they may still do so.
The structure of the contacts does not show such collective motions, which occur in packings with
few springs, and in crystals, whose contacts repeat. No test of the structure alone excludes them.
Only the number of eigenvalues of A up to the threshold of zero does, which takes a factorisation.
It is computed where this takes seconds, and in larger packings where the structure is doubtful
(`doubtful`). Elsewhere only the zero modes that the structure shows are returned, and `counted` is
False.
"""

from contextlib import suppress
from dataclasses import replace
from typing import Any, Literal

import scipy.sparse as sp

from modal.modes.counts import count_below
from modal.modes.effort import factorisation
from modal.modes.search import AboutShift, Search
from modal.modes.zero_modes import FloppyModes, by_structure
from modal.packing.rattlers import contacts_that_move
from modal.solvers.factor import SingularError
from modal.solvers.lanczos import BASIS_VECTORS_PER_MODE, Held, orthonormal
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError, UnavailableError
from modal.tools.workload import refuse_above_memory

MAX_EASY_OPERATIONS = 3e10
"""Largest number of multiplications, some seconds, for which a count is made in any packing."""
ZERO_SHIFT = 1e-9
"""Distance below zero of the shift about which zero modes are sought, divided by A's largest
diagonal entry."""
FIRST_UNSTABLE_SHIFT = 1e-6
"""Distance below zero of the first shift that is tried for unstable modes, divided by A's largest
diagonal entry. All unstable modes must lie above the shift."""
NAMES = {"zero": "motions without energy", "unstable": "unstable modes"}
"""Names of the modes in messages."""
CACHE_NAME = "counted zero modes"
"""Name under which a network keeps the result."""


def every_floppy(system: LinearSystem) -> FloppyModes:
    """Return the zero modes, counted where this is cheap or where their structure is doubtful.

    Otherwise only the zero modes that the structure shows are returned. This also happens if a
    count would take too much memory or time, and if K is not symmetric, so that no count is
    possible. Raises InputError if K may have negative directions that cannot be counted.
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
    """Return the numbers of zero modes and of unstable modes by name."""
    floppy = every_floppy(system)
    return {
        "unstable_modes": floppy.unstable,
        "floppy_modes": floppy.total,
        "floppy_modes_by_kind": floppy.kinds,
        "floppy_modes_counted": floppy.counted,
    }


def counted_floppy(system: LinearSystem, at_zero: Floats | None = None) -> FloppyModes:
    """Return the zero modes, their number confirmed by an exact count; kept with the network.

    A complete list of modes from zero on contains all zero modes. Its caller passes as `at_zero`
    (size, c) those that the structure does not show, and no further count is made.
    """
    return system.cached_recent(CACHE_NAME, None, lambda: _count(system, at_zero), lambda _: 0.0)


def _count(system: LinearSystem, at_zero: Floats | None) -> FloppyModes:
    """Return the zero modes as `counted_floppy` does, without the cache."""
    floppy = by_structure(system)
    unstable = sp.csc_matrix((system.size, 0))
    if at_zero is not None:
        collective = sp.csc_matrix(at_zero)
    else:
        collective = sp.csc_matrix((system.size, 0))
        unstable = _find(system, floppy.basis, count_below(system, 0.0), "unstable")
        known = sp.hstack([floppy.basis, unstable], format="csc")
        if floppy.total < system.degrees_of_freedom:
            missing = count_below(system, system.zero_frequency / 2) - known.shape[1]
            collective = _find(system, known, missing, "zero", definite=not unstable.shape[1])
    return replace(
        floppy,
        basis=sp.hstack([floppy.basis, collective, unstable], format="csc"),
        kinds=floppy.kinds | {"collective": collective.shape[1]},
        unstable=unstable.shape[1],
        counted=True,
    )


def _find(
    system: LinearSystem,
    known: sp.csc_matrix,
    count: int,
    kind: Literal["zero", "unstable"],
    *,
    definite: bool = True,
) -> sp.csc_matrix:
    """Find `count` zero or unstable modes beside the `known` modes; orthonormal, (size, count).

    Zero modes are found about a shift sigma just below zero, unstable modes about a shift below all
    of them, so that A - sigma is positive definite. Raises InputError if the modes do not fit into
    the memory, or if not all are found.
    """
    if count <= 0:
        return sp.csc_matrix((system.size, 0))
    threshold = system.zero_threshold
    shift = ZERO_SHIFT if kind == "zero" else FIRST_UNSTABLE_SHIFT
    sigma = -shift * system.diagonal.max(initial=0.0)

    def is_of_kind(square: Floats) -> Bools:
        if kind == "zero":
            return abs(square) <= threshold
        return square < -threshold

    refuse_above_memory(
        8 * BASIS_VECTORS_PER_MODE * system.size * count,
        f"finding {count} {NAMES[kind]}",
        "take a smaller packing",
    )
    missing = None
    while missing is None:
        source = AboutShift(system, sigma, definite=definite)
        search = Search(system, source, known)
        try:
            missing = search.search_until(count, is_of_kind)
        except SingularError:
            sigma *= 4
    vectors = search.vector[:, is_of_kind(search.square)]
    if source.factor is not None and not missing:
        # One more solve makes the components of other modes, which Lanczos leaves, round-off.
        vectors = source.factor.solve(vectors)
    source.release()
    if missing:
        raise UnavailableError(
            "not_converged", f"{count} {NAMES[kind]} were counted, but not all were found"
        )
    return sp.csc_matrix(orthonormal(vectors, Held(known, vectors[:, :0])))


def easy(system: LinearSystem) -> bool:
    """Tell whether an exact count is already known, or should take only a few seconds."""
    counted = bool(system.cached(CACHE_NAME, dict))
    return counted or factorisation(system, kept=False).operations <= MAX_EASY_OPERATIONS


def doubtful(system: LinearSystem, floppy: FloppyModes) -> bool:
    """Tell whether the structure of a disordered packing may fail to show all zero modes.

    The cases are contacts without a tangential spring, fewer springs than motions, a loose part too
    large to be analysed, and motions that may release energy.
    """
    network = system.network
    moves = contacts_that_move(network)
    springs = int((network.stiffness_normal[moves] != 0).sum())
    springs += 2 * int((network.stiffness_tangential[moves] != 0).sum())
    motions = system.degrees_of_freedom - floppy.total
    return not floppy.whole or not network.stiffness_tangential.all() or springs <= motions
