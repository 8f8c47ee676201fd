"""Lists of elastic modes at an end of the spectrum or in an interval, certified by exact counts.

Floppy and unstable modes are held out, so that the lowest modes, and those of an interval, are the
elastic ones. The exact counts of `modal.modes.counts` say whether a list is complete; where modes
did not converge the list ends early, and `missing` says how many it lacks.
"""

from collections.abc import Callable, Iterator

import numpy as np
import scipy.sparse as sp

from modal.modes.collective import counted_floppy, every_floppy
from modal.modes.counts import check_count, count_below
from modal.modes.dense import dense_modes
from modal.modes.mode_set import Choice, ModeSet, certificate
from modal.modes.observables import Piece, found_modes
from modal.modes.search import AboutShift, FromBelow, FromTop, Search
from modal.modes.unsymmetric import modes_at_an_end
from modal.modes.ways import Question
from modal.modes.zero_modes import FloppyModes
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError

SHIFT = 1e-7
"""Shift below zero, relative to the largest diagonal entry, that keeps the factor definite."""
NARROW = 1e-6
"""Relative width of an interval that is not cut further: a degenerate frequency, mostly."""
FURTHER = 1.1
"""Times a frequency below which there are fewer modes than were estimated."""


def listed_modes(system: LinearSystem, choice: Choice, *, certify: bool = True) -> ModeSet:
    """The modes of a choice, in the way that `modal.modes.ways` takes for them."""
    if choice.kind == "between":
        return _of_interval(system, choice, choice)
    of = system.size - (every_floppy(system).held if choice.kind == "lowest" else 0)
    if choice.kind != "all":
        check_count(system, choice.count, of)
    asked = Question(system, choice, choice.count, of)
    if asked.way == "dense":
        return dense_modes(system, choice)
    if asked.way == "arnoldi":
        return modes_at_an_end(system, choice)
    asked.refuse_endless()
    if asked.way == "top":
        return _highest(system, choice, certify)
    if asked.way == "shift":
        return _beside(system, lambda floppy: _lowest(system, choice, floppy))
    high = asked.high
    while True:
        modes = _of_interval(system, Choice("between", low=0.0, high=high), choice)
        if len(modes.frequency) == choice.count or not modes.certified:
            return modes
        high *= FURTHER


def _beside(system: LinearSystem, listed: Callable[[FloppyModes], ModeSet]) -> ModeSet:
    """A list of the modes beside the zero modes, as `listed` makes it for these.

    Where these are not counted, and the list is not complete, they are, and it is made anew.
    """
    modes = listed(every_floppy(system))
    if not modes.certified and not every_floppy(system).counted:
        modes = listed(counted_floppy(system))
    floppy = every_floppy(system)
    return modes.with_zero_modes(floppy.total, floppy.unstable)


def _lowest(system: LinearSystem, choice: Choice, floppy: FloppyModes) -> ModeSet:
    """The lowest modes beside the `floppy` ones, about a shift just below zero."""
    source = AboutShift(system, -SHIFT * system.diagonal.max(), definite=not floppy.unstable)
    search = Search(system, source, floppy.basis)
    missing = search.complete(choice.count, 1, lambda f: count_below(system, f) - floppy.held)
    if not len(search.square):
        raise InputError(
            "no mode converged: the contrast of stiffnesses or masses leaves the lowest modes "
            "below round-off; ask for the highest, or for an interval further up"
        )
    if not missing:
        counted_floppy(system, search.at_zero)
    return _of_search(search, choice, missing)


def _highest(system: LinearSystem, choice: Choice, certify: bool) -> ModeSet:
    """The highest modes; zero modes, far from the top, need not be held out.

    An exact count takes a factorisation, which costs more than a few modes; without `certify`, or
    where it does not fit, it is left out.
    """
    search = Search(system, FromTop(system), sp.csc_matrix((system.size, 0)))
    missing, because = 0, "" if certify else "the exact count was left out, as was asked for"
    if certify:
        try:
            missing = search.complete(
                choice.count, -1, lambda f: system.size - count_below(system, f)
            )
        except InputError as error:
            because = f"no exact count: {error}"
    if because:
        missing = max(search.search_until(choice.count, np.isfinite), 0)
    floppy = every_floppy(system)
    modes = _of_search(search, choice, missing, because)
    return modes.with_zero_modes(floppy.total, floppy.unstable)


def _of_search(search: Search, choice: Choice, missing: int, because: str = "") -> ModeSet:
    """The modes of a choice that a search has found, less those that are `missing`."""
    which = search.sorted(search.system.zero_frequency if choice.kind == "lowest" else -np.inf)
    enough = min(choice.count - max(missing, 0), len(which))
    which = which[:enough] if choice.kind == "lowest" else which[len(which) - enough :]
    modes = found_modes(search.system, [search.piece(which)], len(which), choice)
    modes.attributes |= {"solver": search.source.solver} | certificate(missing, because)
    return modes


def _of_interval(system: LinearSystem, interval: Choice, choice: Choice) -> ModeSet:
    """Every elastic mode with low <= f < high, Hz, certified by counts beside both ends.

    These are made outside, as far as round-off reaches, so that an interval may end on a mode:
    whether that is one of the list is then decided by its frequency as it was found. Of a `choice`
    of the lowest modes the list has no more than these.
    """
    if Question(system, interval, 0, system.size).way == "dense":
        return dense_modes(system, interval)
    low, high = interval.low, interval.high
    if low <= system.zero_frequency:
        low = 0.0
    low -= low * system.count_uncertainty((2 * np.pi * low) ** 2)
    high += high * system.count_uncertainty((2 * np.pi * high) ** 2)
    ends = low, high
    return _beside(system, lambda floppy: _between(system, interval, ends, choice, floppy))


def _between(
    system: LinearSystem,
    interval: Choice,
    ends: tuple[float, float],
    choice: Choice,
    floppy: FloppyModes,
) -> ModeSet:
    """Every mode of an `interval`, counted between the `ends`, Hz, beside the `floppy` ones."""
    low, high = ends
    below = {low: floppy.held if low == 0 else count_below(system, low)}
    below[high] = count_below(system, high)
    wanted = below[high] - below[low]
    from_zero = below[low] == floppy.held and not floppy.unstable
    asked = Question(
        system, Choice("between", low=low, high=high), wanted, system.size - floppy.held, from_zero
    )
    if asked.way == "dense":
        return dense_modes(system, choice)
    asked.refuse_endless()
    most = min(wanted, choice.count or wanted)
    missing, solvers, at_zero = list[int](), list[str](), [np.empty((system.size, 0))]

    def pieces() -> Iterator[Piece]:
        first = 0
        lifted = asked.way == "lifted"
        for a, b in [(low, high)] if lifted else _slices(system, low, high, below):

            def inside(square: Floats, a: float = a, b: float = b) -> Bools:
                return (frequency_of(square) >= a) & (frequency_of(square) < b)

            # Both ends are equally far in omega^2: the nearest modes are those of the slice. A
            # shift at its lower end, where A - sigma is definite, needs twice as many solves.
            middle = (2 * np.pi) ** 2 * (a**2 + b**2) / 2
            source = FromBelow(asked.low_end) if lifted else AboutShift(system, middle)
            search = Search(system, source, floppy.basis)
            missing.append(search.search_until(below[b] - below[a], inside))
            at_zero.append(search.at_zero)
            which = search.sorted(
                max(a, interval.low, system.zero_frequency), min(b, interval.high)
            )
            which = which[: most - first]
            solvers.append(source.solver)
            yield search.piece(which, first)
            first += len(which)

    modes = found_modes(system, pieces(), most, choice)
    short = sum(max(lack, 0) for lack in missing)
    modes.attributes |= certificate(short or min(missing, default=0))
    if low == 0 and modes.certified:
        counted_floppy(system, np.concatenate(at_zero, axis=1))
    slices = f"; {len(solvers)} slices" * (len(solvers) > 1)
    modes.attributes["solver"] = "".join(solvers[:1]) + slices or "count"
    return modes


def _slices(
    system: LinearSystem, low: float, high: float, below: dict[float, int]
) -> Iterator[tuple[float, float]]:
    """Cut [low, high) where exact counts leave `Limits.slice` modes or fewer in each slice.

    A cut in the middle of the volume f^3, as the number of waves grows; a cluster of equal
    frequencies that cannot be cut stays whole. The counts are added to those `below`.
    """
    wanted = below[high] - below[low]
    if wanted <= system.limits.slice or high - low < NARROW * high:
        if wanted:
            yield low, high
        return
    middle = float(np.cbrt((low**3 + high**3) / 2))
    below[middle] = count_below(system, middle)
    yield from _slices(system, low, middle, below)
    yield from _slices(system, middle, high, below)
