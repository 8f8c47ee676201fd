"""The lowest modes, or those of an interval, by block Lanczos, certified.

It runs on a factorised A - sigma, or, for many modes from the lowest one on, on a polynomial of A
that lifts them (`modal.solvers.low_end`): then only the count needs a factorisation. Floppy modes
are held out, so that the list is that of the elastic ones, and the exact counts of
`modal.modes.counts` say whether it is complete.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from modal.modes.collective import counted_floppy, every_floppy
from modal.modes.counts import check_count, count_below
from modal.modes.dense import dense_modes, whole_pays
from modal.modes.effort import Effort, below_an_edge, near_a_shift, refuse_endless_search
from modal.modes.mode_set import Choice, ModeSet, certificate, subset
from modal.modes.search import Search, SearchBelow
from modal.modes.zero_modes import FloppyModes
from modal.solvers.low_end import LowEnd
from modal.solvers.spectrum import bound_of_spectrum
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.tools.workload import memory_at_hand

SHIFT = 1e-7
"""Shift below zero, relative to the largest diagonal entry, that keeps the factor definite."""
NEAR_ZERO = 1e3
"""Times the bound of zero: up to there a search may have found a zero mode, to its round-off."""
FEWER = "ask for fewer, or for the density or a count"
"""What to do instead of finding each of very many modes."""
NARROW = 1e-6
"""Relative width of an interval that is not cut further: a degenerate frequency, mostly."""
MARGIN = 1.04
"""From where modes are not lifted, over the frequency below which all are asked for. The last of
them must stand out: at 1 twice as many vectors are needed, from 1.02 to 1.06 equally many."""
WIDEST = 0.25
"""Share of the spectrum, in omega^2, of which the low end is lifted at most."""


def lowest_modes(system: LinearSystem, count: int) -> ModeSet:
    """The `count` lowest elastic modes; floppy modes are counted, not listed.

    Certified: the exact count below the highest of them is that of the modes found. Where modes
    did not converge the list ends early, and `missing` says how many it lacks.
    """
    check_count(system, count, system.size - every_floppy(system).held)
    choice = Choice("lowest", count)

    def lowest(frequency: Floats) -> slice:
        first = _zero_modes(system, frequency)
        return slice(first, first + count)

    if whole_pays(system, count):
        return dense_modes(system, lowest, choice)
    effort = near_a_shift(system, count)
    refuse_endless_search(system, effort, f"the lowest {count} modes take", FEWER)
    if count > system.limits.slice:
        return _lowest_by_slices(system, count)
    return _beside(system, lambda floppy: _nearest_zero(system, count, choice, floppy))


def _beside(system: LinearSystem, listed: Callable[[FloppyModes], ModeSet]) -> ModeSet:
    """A list of the modes beside the zero modes, as `listed` makes it for these.

    Where these are not counted, and the list does not agree with them, they are.
    """
    floppy = every_floppy(system)
    modes = listed(floppy)
    near = frequency_of(np.array([NEAR_ZERO * system.zero_threshold]))[0]
    if not floppy.counted and (not modes.certified or (modes.frequency <= near).any()):
        floppy = counted_floppy(system)
        modes = listed(floppy)
    modes.attributes.setdefault("floppy_modes", floppy.total)
    modes.attributes.setdefault("unstable_modes", floppy.unstable)
    return modes


def _nearest_zero(system: LinearSystem, count: int, choice: Choice, floppy: FloppyModes) -> ModeSet:
    """The `count` lowest modes beside the `floppy` ones, about a shift just below zero."""
    stable, sigma = not floppy.unstable, -SHIFT * system.diagonal.max()
    search = Search(system, sigma, definite=stable, floppy=floppy)
    missing = search.complete(count, 1, lambda edge: count_below(system, edge) - floppy.held)
    if len(search.square) == 0:
        raise InputError(
            "no mode converged: the contrast of stiffnesses or masses leaves the lowest modes "
            "below round-off; ask for the highest, or for an interval further up"
        )
    modes = search.modes(0.0, np.inf, choice)
    short = count - len(modes.frequency)
    missing = max(missing, short) if short > 0 else missing
    modes = subset(modes, slice(0, count - max(missing, 0)), choice)
    modes.attributes |= certificate(missing)
    return modes


def modes_between(system: LinearSystem, low: float, high: float) -> ModeSet:
    """Every elastic mode with low <= f < high, Hz, certified by counts beside both ends.

    These are made outside, as far as round-off reaches, so that an interval may end on a mode:
    whether that is one of the list is then decided by its frequency as it was found. Where no modes
    but floppy ones lie below `low` they may be found all at once, by a polynomial. Other intervals
    with more than `Limits.slice` modes are cut into slices, each with its own factorisation and its
    own certificate.
    """
    if high == np.inf:
        raise InputError("an interval without an end: ask for all modes")
    if not (np.isfinite(low) and np.isfinite(high)) or high <= low or high <= 0:
        raise InputError(f"the interval {low:g} to {high:g} Hz is empty; give the lower end first")
    low, high = max(float(low), 0.0), float(high)
    choice = Choice("between", low=low, high=high)
    if low <= frequency_of(np.array([system.zero_threshold]))[0]:
        low = 0.0

    def inside(frequency: Floats) -> slice:
        first = max(int((frequency < choice.low).sum()), _zero_modes(system, frequency))
        return slice(first, max(first, int((frequency < choice.high).sum())))

    if system.size <= system.limits.small or not system.symmetric:
        return dense_modes(system, inside, choice)
    low -= low * system.count_uncertainty((2 * np.pi * low) ** 2)
    high += high * system.count_uncertainty((2 * np.pi * high) ** 2)
    modes = _beside(system, lambda floppy: _between(system, low, high, inside, choice, floppy))
    return subset(modes, inside(modes.frequency), choice)


def _between(
    system: LinearSystem,
    low: float,
    high: float,
    inside: Callable[[Floats], slice],
    choice: Choice,
    floppy: FloppyModes,
) -> ModeSet:
    """Every mode with low <= f < high, Hz, beside the `floppy` ones; dense those `inside`."""
    below = {low: floppy.held if low == 0 else count_below(system, low)}
    below[high] = count_below(system, high)
    wanted = below[high] - below[low]
    if system.size <= system.limits.dense and wanted > system.size // system.limits.part:
        return dense_modes(system, inside, choice)
    effort, low_end = near_a_shift(system, wanted), None
    if wanted > 0 and below[low] == floppy.held and not floppy.unstable:
        effort, low_end = _quickest(system, high, wanted, effort)
    refuse_endless_search(system, effort, f"the {wanted} modes of this interval take", FEWER)
    if low_end is not None:
        search = SearchBelow(system, low_end, floppy)
        return _joined([_found(search, low, high, wanted, wanted)], choice)
    slices = _cut(system, low, high, below)
    parts = [_slice(system, a, b, below[b] - below[a], wanted, floppy) for a, b in slices]
    return _joined(parts, choice)


def _quickest(
    system: LinearSystem, high: float, wanted: int, in_slices: Effort
) -> tuple[Effort, LowEnd | None]:
    """What lifts the `wanted` modes below `high`, Hz, and its effort, if that is less.

    Else the effort of slices, as given, and None: of few modes, of a wide part of the spectrum,
    where the basis has no room in memory, or where the user names what factorises.
    """
    if system.solver is not None:
        return in_slices, None
    operator = system.operator.renumbered()
    top, _ = bound_of_spectrum(operator)
    edge = (2 * np.pi * MARGIN * high) ** 2
    if edge > WIDEST * top:
        return in_slices, None
    low_end = LowEnd(operator, edge, top)
    lifted = below_an_edge(system, wanted, low_end.degree)
    if lifted.seconds > in_slices.seconds or lifted.bytes > memory_at_hand():
        return in_slices, None
    return lifted, low_end


def _cut(
    system: LinearSystem, low: float, high: float, below: dict[float, int]
) -> list[tuple[float, float]]:
    """Cut [low, high) where exact counts leave `Limits.slice` modes or fewer in each slice.

    A cut in the middle of the volume f^3, as the number of waves grows; a cluster of equal
    frequencies that cannot be cut stays whole.
    """
    wanted = below[high] - below[low]
    if wanted <= system.limits.slice or high - low < NARROW * high:
        return [(low, high)] if wanted else []
    middle = float(np.cbrt((low**3 + high**3) / 2))
    below[middle] = count_below(system, middle)
    return [
        *_cut(system, low, middle, below),
        *_cut(system, middle, high, below),
    ]


def _slice(
    system: LinearSystem, low: float, high: float, wanted: int, of: int, floppy: FloppyModes
) -> ModeSet:
    """The `wanted` modes of one slice, of `of` in all of them, about a shift."""
    # Both ends are equally far in omega^2: the nearest modes are those of the slice. A shift at its
    # lower end, where A - sigma is definite, needs twice as many solves.
    sigma = (2 * np.pi) ** 2 * (low**2 + high**2) / 2
    search = Search(system, sigma, definite=False, floppy=floppy)
    return _found(search, low, high, wanted, of)


def _found(search: Search, low: float, high: float, wanted: int, of: int) -> ModeSet:
    """The modes with low <= f < high that a search finds, certified if they are `wanted`."""
    missing = search.search_until(
        wanted, lambda square: (frequency_of(square) >= low) & (frequency_of(square) < high)
    )
    modes = search.modes(low, high, Choice("between", low=low, high=high), of)
    modes.attributes |= certificate(missing)
    return modes


def _zero_modes(system: LinearSystem, frequency: Floats) -> int:
    """How many of all frequencies, ascending, Hz, belong to modes that are no elastic ones."""
    return int((frequency <= frequency_of(np.array([system.zero_threshold]))[0]).sum())


def _lowest_by_slices(system: LinearSystem, count: int) -> ModeSet:
    """The `count` lowest modes, many of them, as all modes below a frequency that has enough.

    The frequency is found by exact counts, each a third of an octave above the last.
    """
    top = frequency_of(np.array([system.bound]))[0]
    high, total = top / 64, counted_floppy(system).held
    while high < top and count_below(system, high) - total < count:
        high *= 2 ** (1 / 3)
    modes = modes_between(system, 0.0, high)
    return subset(modes, slice(0, count), Choice("lowest", count))


def _joined(parts: list[ModeSet], choice: Choice) -> ModeSet:
    """One list from the lists of ascending intervals; complete if each of them is."""
    if not parts:
        empty = np.empty(0)
        attributes = choice.attributes | {"solver": "count"} | certificate(0)
        return ModeSet(empty, empty, empty, empty, empty, attributes=attributes)
    whole = parts[0]
    if len(parts) > 1:
        arrays: dict[str, Any] = {}
        for name in vars(whole):
            columns = [getattr(part, name) for part in parts]
            if name != "attributes" and all(column is not None for column in columns):
                arrays[name] = np.concatenate(columns)
        whole = ModeSet(**arrays)
    missing = sum(part.missing for part in parts)
    if not missing and not all(part.certified for part in parts):
        missing = -1
    whole.attributes = {
        **parts[0].attributes,
        **choice.attributes,
        "solver": parts[0].attributes["solver"] + f"; {len(parts)} slices" * (len(parts) > 1),
        **certificate(missing),
    }
    return whole
