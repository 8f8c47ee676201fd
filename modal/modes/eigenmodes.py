"""Find the modes of a packing: the lowest, the highest, those of an interval, or all.

Floppy and unstable modes are excluded from the search, so that the lowest modes, and those of an
interval, are elastic. The exact counts of `modal.modes.counts` tell whether a list is complete; if
modes did not converge, the list ends early, and `missing` is the number of modes that it lacks.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from modal.modes.collective import counted_floppy, every_floppy
from modal.modes.counts import check_count, count_below
from modal.modes.dense import dense_modes
from modal.modes.mode_set import Choice, ChoiceKind, ModeSet, certificate
from modal.modes.observables import Piece, found_modes
from modal.modes.search import AboutShift, FromBelow, FromTop, Search, no_mode_converged
from modal.modes.strategy import ModeRequest
from modal.modes.uncounted import search_uncounted
from modal.modes.unsymmetric import modes_at_an_end
from modal.modes.zero_modes import FloppyModes, by_structure
from modal.packing.network import Network
from modal.packing.precision import refuse_few_digits
from modal.system.contacts import PreStress, Sliding
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arguments import checked
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError
from modal.tools.workload import MAX_SECONDS

DEFAULT_COUNT = 10
"""Number of lowest modes that are computed if nothing is requested: enough to see where a spectrum
begins."""
SHIFT_BELOW_ZERO = 1e-7
"""Distance below zero of the shift for the lowest modes, divided by the largest diagonal entry of
A; with this shift A - sigma is positive definite."""
MIN_RELATIVE_WIDTH = 1e-6
"""Relative width of an interval of frequencies that is not cut further: mostly it holds modes of
equal frequency."""
LEFT_OUT = "the exact count was left out, as was asked for"
DOES_NOT_FIT = "an exact count takes too much time or memory"
"""Reasons why a list is not certified."""
FREQUENCY_STEP = 1.1
"""Factor by which a frequency grows if fewer modes lie below it than were estimated."""


@checked
def eigenmodes(
    network: Network,
    *,
    lowest: int | None = None,
    highest: int | None = None,
    below: float | None = None,
    between: tuple[float, float] | None = None,
    all: bool = False,
    translations_only: bool = False,
    sliding: Sliding = "elastic",
    pre_stress: PreStress = "none",
    solver: str | None = None,
    shapes: bool = True,
    certify: bool = True,
    hours: float = MAX_SECONDS / 3600,
) -> ModeSet:
    """Find natural frequencies and mode shapes of a packing, and tell whether any is missing.

    They solve K phi = omega^2 M phi (Otsubo et al. 2017, Eq. 1), with three displacements and three
    rotations for each sphere. The result has the numbers of motions without energy (`floppy_modes`)
    and of motions that release energy (`unstable_modes`); both are left out of the lowest modes and
    of intervals. With the shear forces (`pre_stress` "full" or "law") K is not symmetric: omega^2
    may be complex, the frequency is that of the real part of omega, and with more than 3,000
    degrees of freedom the lowest and the highest modes come without a certificate.

    Parameters
    ----------
    network : Network
        The packing, n spheres.
    lowest, highest : int, optional
        Number of modes to compute from the lower or upper end. Give at most one of lowest, highest,
        below, between and all; the default is lowest=10.
    below : float, optional
        Upper limit, Hz: find all modes below it.
    between : tuple of 2 float, optional
        Interval, Hz: find all modes in it.
    all : bool, default False
        Whether to find all modes, 6n for free spheres.
    translations_only : bool, default False
        Whether to hold the rotations at zero.
    sliding : str, default "elastic"
        With "slip", contacts at the friction limit have only their normal springs.
    pre_stress : str, default "none"
        Terms that the contact forces add: "normal", "full" or "law" (`modal.system.contacts`).
    solver : str, optional
        A factorisation: pardiso, blocks or superlu; or, for the lowest modes, multigrid.
    shapes : bool, default True
        Whether to keep the mode shapes, if they take no more than 2 GB.
    certify : bool, default True
        Whether to count the modes exactly; False is possible with `lowest` and `highest`. If a
        count does not fit into time or memory, the lowest modes are returned without it, with an
        estimate of their number.
    hours : float, default 24
        Longest estimated time of the search, hours; a longer search is refused.

    Returns
    -------
    ModeSet
        k modes: `frequency` (k,) Hz; `chi_z` (k,), the share of motion along z (Eq. 2; for a
        crystal's degenerate pairs that of travelling waves); `mode_shape` (k, n, 6),
        mass-normalised, kg^-1/2; `certified` if an exact count says that none is missing.

    Raises
    ------
    InputError
        If there are no such modes, if the search would take more than `hours` or the free memory,
        or if the packing's overlaps are known to too few digits for single modes.

    Examples
    --------
    >>> import modal
    >>> low = eigenmodes(modal.fcc(cells=(2, 2, 20)), lowest=3)
    >>> low.frequency.round()
    array([6669., 6669., 9313.])
    >>> low.certified, low.mode_shape.shape
    (True, (3, 80, 6))
    """
    refuse_few_digits(network)
    system = LinearSystem.of(
        network,
        pre_stress=pre_stress,
        sliding=sliding,
        translations_only=translations_only,
        solver=solver,
        shapes=shapes,
        hours=hours,
    )
    return modes_of(
        system,
        lowest=lowest,
        highest=highest,
        below=below,
        between=between,
        all=all,
        certify=certify,
    )


def modes_of(
    system: LinearSystem,
    *,
    lowest: int | None = None,
    highest: int | None = None,
    below: float | None = None,
    between: tuple[float, float] | None = None,
    all: bool = False,
    certify: bool = True,
) -> ModeSet:
    """Find modes of a system as `eigenmodes` does; the last lists are kept with its network."""
    choices: dict[str, Any] = {
        "lowest": lowest,
        "highest": highest,
        "below": below,
        "between": between,
        "all": all or None,
    }
    requested = {name: value for name, value in choices.items() if value is not None}
    if len(requested) > 1:
        names = " and ".join(requested)
        raise InputError("mode_choice", f"{names}: which modes?", remedy="ask for one of them")
    kind = next(iter(requested), "lowest")
    value: Any = requested.get(kind)
    if not certify and kind not in ("lowest", "highest"):
        raise InputError(
            "certify",
            "certify=False is for the lowest and the highest modes only",
            "elsewhere the count tells when the list is complete",
            "leave it out",
        )
    if kind == "between" and np.shape(value) != (2,):
        raise InputError(
            "interval",
            f"between {value}",
            remedy="give two frequencies in Hz, the lower one first",
        )
    settings = (certify, system.solver, system.shapes, system.limits, system.hours)
    modes = system.cached_recent(
        "lists of modes",
        (kind, *np.ravel(value).tolist(), *settings),
        lambda: _find(system, kind, value, certify),
        lambda modes: modes.bytes,
    )
    return replace(modes, attributes=dict(modes.attributes))


def _find(system: LinearSystem, kind: str, value: Any, certify: bool) -> ModeSet:
    """Find the modes of one kind; the arrays of the result cannot be written to."""
    if kind == "below":
        interval = Choice.of_interval(0.0, value)
        modes = _find_interval(system, interval, interval)
    elif kind == "between":
        interval = Choice.of_interval(*value)
        modes = _find_interval(system, interval, interval)
    elif kind == "all":
        modes = _find_at_end(system, "all", 0, system.degrees_of_freedom, certify)
    else:
        available = system.degrees_of_freedom
        if kind == "lowest":
            floppy = every_floppy(system) if certify else by_structure(system)
            available -= floppy.held
        count = min(DEFAULT_COUNT, available) if value is None else value
        check_count(system, count, available)
        end: ChoiceKind = "lowest" if kind == "lowest" else "highest"
        modes = _find_at_end(system, end, count, available, certify)
    modes.attributes |= {"packing": system.packing.fingerprint, "pre_stress": system.pre_stress}
    for data in vars(modes).values():
        if isinstance(data, np.ndarray):
            data.flags.writeable = False
    return modes


def _find_at_end(
    system: LinearSystem, kind: ChoiceKind, count: int, available: int, certify: bool
) -> ModeSet:
    """Find all modes, or `count` of the `available` ones at an end.

    The method is the one that is estimated to be fastest.
    """
    choice = Choice(kind, count)
    request = ModeRequest(system, choice, count, available, certify=certify)
    if request.method == "dense":
        return dense_modes(system, choice)
    if request.method == "arnoldi":
        return modes_at_an_end(system, choice)
    request.refuse_endless()
    if request.method == "top":
        return _find_highest(system, choice, certify)
    if request.method in ("multigrid", "lifted") and not request.counted:
        return _find_uncounted(request)
    if request.method == "multigrid":
        return _beside_zero_modes(
            system, lambda floppy: _find_lowest(system, choice, floppy, "multigrid")
        )
    if request.method == "shift":
        return _beside_zero_modes(system, lambda floppy: _find_lowest(system, choice, floppy))
    high = request.upper_frequency
    while True:
        modes = _find_interval(system, Choice("between", low=0.0, high=high), choice)
        if len(modes.frequency) == choice.count or not modes.certified:
            return modes
        high *= FREQUENCY_STEP


def _beside_zero_modes(system: LinearSystem, find: Callable[[FloppyModes], ModeSet]) -> ModeSet:
    """Return the list of modes that `find` makes while the zero modes are excluded.

    If the list is incomplete and the zero modes were not counted exactly, they are counted, and the
    list is made again.
    """
    modes = find(every_floppy(system))
    if not modes.certified and not every_floppy(system).counted:
        modes = find(counted_floppy(system))
    floppy = every_floppy(system)
    return modes.with_zero_modes(floppy.total, floppy.unstable)


def _find_lowest(
    system: LinearSystem, choice: Choice, floppy: FloppyModes, solver: str | None = None
) -> ModeSet:
    """Find the lowest modes besides the `floppy` ones, about a shift just below zero."""
    sigma = -SHIFT_BELOW_ZERO * system.diagonal.max()
    source = AboutShift(system, sigma, definite=not floppy.unstable, by=solver)
    search = Search(system, source, floppy.basis)
    missing = search.complete(choice.count, 1, lambda f: count_below(system, f) - floppy.held)
    if not len(search.square):
        raise no_mode_converged()
    if not missing:
        counted_floppy(system, search.at_zero)
    return _list_found(search, choice, missing)


def _find_uncounted(request: ModeRequest) -> ModeSet:
    """Find the lowest modes without an exact count."""
    system = request.system
    source: AboutShift | FromBelow
    if request.method == "lifted":
        source = FromBelow(request.low_end)
    else:
        sigma = -SHIFT_BELOW_ZERO * system.diagonal.max()
        source = AboutShift(system, sigma, definite=True, by="multigrid")
    result = search_uncounted(system, request.count, source)
    search = result.search
    missing = result.missing
    reason = DOES_NOT_FIT if request.certify else LEFT_OUT
    modes = _list_found(search, request.choice, missing, f"{reason}; {result.evidence}")
    modes.attributes |= result.attributes
    floppy = by_structure(system)
    return modes.with_zero_modes(floppy.total + search.at_zero.shape[1], 0)


def _find_highest(system: LinearSystem, choice: Choice, certify: bool) -> ModeSet:
    """Find the highest modes; zero modes are far from the top and need not be excluded.

    An exact count takes a factorisation, which costs more than a few modes; it is left out without
    `certify`, or if the factorisation does not fit into the memory.
    """
    search = Search(system, FromTop(system), sp.csc_matrix((system.size, 0)))
    missing = 0
    reason = LEFT_OUT
    if certify:
        reason = ""
        try:
            missing = search.complete(
                choice.count, -1, lambda f: system.degrees_of_freedom - count_below(system, f)
            )
        except InputError as error:
            reason = f"no exact count: {error}"
    if reason:
        missing = max(search.search_until(choice.count, np.isfinite), 0)
    floppy = every_floppy(system)
    modes = _list_found(search, choice, missing, reason)
    return modes.with_zero_modes(floppy.total, floppy.unstable)


def _list_found(search: Search, choice: Choice, missing: int, reason: str = "") -> ModeSet:
    """Return the modes of a choice that a search has found, without those that are `missing`.

    `reason` tells why no exact count was made.
    """
    lowest = choice.kind == "lowest"
    indices = search.sorted(search.system.zero_frequency if lowest else -np.inf)
    count = min(choice.count - max(missing, 0), len(indices))
    indices = indices[:count] if lowest else indices[len(indices) - count :]
    modes = found_modes(search.system, [search.piece(indices)], len(indices), choice)
    modes.attributes |= {"solver": search.source.solver} | certificate(missing, reason)
    return modes


def _find_interval(system: LinearSystem, interval: Choice, choice: Choice) -> ModeSet:
    """Find every elastic mode with low <= f < high, Hz, certified by counts just outside both ends.

    The distance from the ends is larger than the round-off of a mode. An interval may therefore end
    on a mode; the computed frequency of this mode decides whether it is in the list. If the
    `choice` is that of the lowest modes, the list is cut at their number.
    """
    if ModeRequest(system, interval, 0, system.degrees_of_freedom).method == "dense":
        return dense_modes(system, interval)
    low = interval.low
    high = interval.high
    if low <= system.zero_frequency:
        low = 0.0
    low -= low * system.count_uncertainty((2 * np.pi * low) ** 2)
    high += high * system.count_uncertainty((2 * np.pi * high) ** 2)

    ends = (low, high)
    return _beside_zero_modes(
        system, lambda floppy: _find_between(system, interval, ends, choice, floppy)
    )


def _find_between(
    system: LinearSystem,
    interval: Choice,
    ends: tuple[float, float],
    choice: Choice,
    floppy: FloppyModes,
) -> ModeSet:
    """Find every mode of an `interval`, counted between the `ends`, Hz, besides `floppy` ones.

    The list has no more modes than the `choice`.
    """
    low, high = ends
    below = {low: floppy.held if low == 0 else count_below(system, low)}
    below[high] = count_below(system, high)
    count = below[high] - below[low]
    request = ModeRequest(
        system,
        Choice("between", low=low, high=high),
        count,
        available=system.degrees_of_freedom - floppy.held,
        from_zero=below[low] == floppy.held and not floppy.unstable,
    )
    if request.method == "dense":
        return dense_modes(system, choice)
    request.refuse_endless()
    max_listed = min(count, choice.count or count)
    missing = list[int]()
    solvers = list[str]()
    zero_modes = [np.empty((system.size, 0))]

    def search_pieces() -> Iterator[Piece]:
        n_listed = 0
        lifted = request.method == "lifted"
        slices = [(low, high)] if lifted else _slices(system, low, high, below)
        for first, last in slices:

            def inside(square: Floats, first: float = first, last: float = last) -> Bools:
                return (frequency_of(square) >= first) & (frequency_of(square) < last)

            # Both ends are equally far in omega^2: the nearest modes are those of the slice. A
            # shift at its lower end, where A - sigma is definite, needs twice as many solves.
            middle = (2 * np.pi) ** 2 * (first**2 + last**2) / 2
            source = FromBelow(request.low_end) if lifted else AboutShift(system, middle)
            search = Search(system, source, floppy.basis)
            missing.append(search.search_until(below[last] - below[first], inside))
            zero_modes.append(search.at_zero)
            lowest_listed = max(first, interval.low, system.zero_frequency)
            indices = search.sorted(lowest_listed, min(last, interval.high))
            indices = indices[: max_listed - n_listed]
            solvers.append(source.solver)
            yield search.piece(indices, n_listed)
            n_listed += len(indices)

    modes = found_modes(system, search_pieces(), max_listed, choice)
    total_missing = sum(max(of_slice, 0) for of_slice in missing)
    modes.attributes |= certificate(total_missing or min(missing, default=0))
    if low == 0 and modes.certified:
        counted_floppy(system, np.concatenate(zero_modes, axis=1))
    solver = solvers[0] if solvers else "count"
    if len(solvers) > 1:
        solver += f"; {len(solvers)} slices"
    modes.attributes["solver"] = solver
    return modes


def _slices(
    system: LinearSystem, low: float, high: float, below: dict[float, int]
) -> Iterator[tuple[float, float]]:
    """Cut [low, high) until exact counts leave `Limits.slice` modes or fewer in each slice.

    Each cut is in the middle of f^3, because the number of waves grows with f^3; a cluster of equal
    frequencies cannot be cut and stays in one slice. The counts are added to `below`.
    """
    count = below[high] - below[low]
    if count <= system.limits.slice or high - low < MIN_RELATIVE_WIDTH * high:
        if count:
            yield low, high
        return
    middle = float(np.cbrt((low**3 + high**3) / 2))
    below[middle] = count_below(system, middle)
    yield from _slices(system, low, middle, below)
    yield from _slices(system, middle, high, below)
