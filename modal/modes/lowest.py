"""The lowest modes, or those of an interval, by block Lanczos, certified.

It runs on a factorised A - sigma, or, for many modes from the lowest one on, on a polynomial of A
that lifts them (`modal.solvers.low_end`): then only the count needs a factorisation. Floppy modes
are held out, so that the list is that of the elastic ones, and the exact counts of
`modal.modes.counts` say whether it is complete.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from modal.modes.collective import counted_floppy, every_floppy
from modal.modes.counts import check_count, count_below
from modal.modes.dense import dense_modes, whole_pays
from modal.modes.density import density_of
from modal.modes.effort import below_an_edge, near_a_shift, refuse_endless_search
from modal.modes.mode_set import Choice, ModeSet, certificate, joined, subset
from modal.modes.search import Search, SearchBelow
from modal.modes.zero_modes import FloppyModes
from modal.solvers.factor import Cost
from modal.solvers.low_end import LowEnd
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError
from modal.tools.workload import memory_at_hand

SHIFT = 1e-7
"""Shift below zero, relative to the largest diagonal entry, that keeps the factor definite."""
NEAR_ZERO = 1e3
"""Times the bound of zero: up to there a search may have found a zero mode, to its round-off."""
FEWER = "ask for fewer, or for the density or a count"
"""What to do instead of finding each of very many modes."""
ENOUGH = 1.15
"""Modes below a frequency that has enough, by an estimate, over those that are wanted: its error is
sqrt(2 / (6 count)) of them, 4 % of 200."""
COARSEST, SHARP = 32, 3.0
"""Parts of the spectrum that the first estimate tells apart; resolutions below the frequency."""
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
    elastic = system.size - every_floppy(system).held
    check_count(system, count, elastic)
    choice = Choice("lowest", count)
    if whole_pays(system, count, elastic):
        return dense_modes(system, choice)
    cost = near_a_shift(system, count)
    if system.solver is None and system.size > system.limits.dense:
        high = _frequency_with(system, count)
        if _quickest(system, high, count, cost)[0] is not None:
            return _below_enough(system, choice, high)
    refuse_endless_search(system, cost, f"the lowest {count} modes take", FEWER)
    if count > system.limits.slice:
        return _below_enough(system, choice, _frequency_with(system, count))
    return _beside(system, lambda floppy: _nearest_zero(system, choice, floppy))


def _beside(system: LinearSystem, listed: Callable[[FloppyModes], ModeSet]) -> ModeSet:
    """A list of the modes beside the zero modes, as `listed` makes it for these.

    Where these are not counted, and the list does not agree with them, they are.
    """
    floppy = every_floppy(system)
    modes = listed(floppy)
    near = np.sqrt(NEAR_ZERO) * system.zero_frequency
    if not floppy.counted and (not modes.certified or (modes.frequency <= near).any()):
        floppy = counted_floppy(system)
        modes = listed(floppy)
    modes.attributes.setdefault("floppy_modes", floppy.total)
    modes.attributes.setdefault("unstable_modes", floppy.unstable)
    return modes


def _nearest_zero(system: LinearSystem, choice: Choice, floppy: FloppyModes) -> ModeSet:
    """The lowest modes beside the `floppy` ones, about a shift just below zero."""
    sigma, count = -SHIFT * system.diagonal.max(), choice.count
    search = Search(system, floppy.basis, sigma, definite=not floppy.unstable)
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


def _frequency_with(system: LinearSystem, count: int) -> float:
    """A frequency, Hz, with about `count` elastic modes below it, by a density of states.

    The resolution is refined until it is finer than this frequency.
    """
    resolution, wanted = float(np.sqrt(system.bound)) / (2 * np.pi) / COARSEST, ENOUGH * count
    while True:
        states = density_of(system, resolution)
        grid = states.grid()
        below = states.count_below(grid)[0][:, 6] - states.zero_modes.sum()
        high = float(np.interp(wanted, np.maximum.accumulate(below), grid))
        if high > SHARP * resolution:
            return high
        resolution /= 2


def _below_enough(system: LinearSystem, choice: Choice, high: float) -> ModeSet:
    """The lowest modes as those below a frequency that has enough, `high`, Hz, or above it."""
    modes = modes_between(system, 0.0, high)
    while len(modes.frequency) < choice.count and modes.certified:
        high *= 1.1
        modes = modes_between(system, 0.0, high)
    return subset(modes, slice(0, choice.count), choice)


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
    choice = Choice("between", low=max(float(low), 0.0), high=float(high))
    if system.size <= system.limits.small or not system.symmetric:
        return dense_modes(system, choice)
    low, high = choice.low, choice.high
    if low <= system.zero_frequency:
        low = 0.0
    low -= low * system.count_uncertainty((2 * np.pi * low) ** 2)
    high += high * system.count_uncertainty((2 * np.pi * high) ** 2)
    modes = _beside(system, lambda floppy: _between(system, low, high, choice, floppy))
    return subset(modes, choice.part(modes.frequency, system.zero_frequency), choice)


def _between(
    system: LinearSystem, low: float, high: float, choice: Choice, floppy: FloppyModes
) -> ModeSet:
    """Every mode with low <= f < high, Hz, beside the `floppy` ones; by all modes if that pays."""
    below = {low: floppy.held if low == 0 else count_below(system, low)}
    below[high] = count_below(system, high)
    wanted = below[high] - below[low]
    elastic = system.size - floppy.held
    if system.size <= system.limits.dense and wanted > elastic // system.limits.part:
        return dense_modes(system, choice)
    cost = near_a_shift(system, wanted)
    low_end, from_zero = None, below[low] == floppy.held and not floppy.unstable
    if from_zero and wanted and system.solver is None:
        low_end, cost = _quickest(system, high, wanted, cost)
    refuse_endless_search(system, cost, f"the {wanted} modes of this interval take", FEWER)
    if low_end is not None:
        parts = [_found(SearchBelow(system, floppy.basis, low_end), low, high, wanted, wanted)]
    else:
        parts = []
        for a, b in _slices(system, low, high, below):
            # Both ends are equally far in omega^2: the nearest modes are those of the slice. A
            # shift at its lower end, where A - sigma is definite, needs twice as many solves.
            sigma = (2 * np.pi) ** 2 * (a**2 + b**2) / 2
            search = Search(system, floppy.basis, sigma, definite=False)
            parts.append(_found(search, a, b, below[b] - below[a], wanted))
    return joined(parts, choice)


def _quickest(
    system: LinearSystem, high: float, wanted: int, in_slices: Cost
) -> tuple[LowEnd | None, Cost]:
    """The polynomial that lifts all modes below `high`, Hz, and its cost, where that is less.

    Where it is not, or does not fit the memory, None and the cost of slices.
    """
    edge = (2 * np.pi * MARGIN * high) ** 2
    if edge > WIDEST * system.top:
        return None, in_slices
    low_end = LowEnd(system.renumbered, edge, system.top)
    lifted = below_an_edge(system, wanted, low_end.degree)
    quicker = lifted.operations <= in_slices.operations and lifted.bytes <= memory_at_hand()
    return (low_end, lifted) if quicker else (None, in_slices)


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


def _found(search: Search, low: float, high: float, wanted: int, of: int) -> ModeSet:
    """The modes with low <= f < high that a search finds, certified if they are `wanted`.

    They are a part of a list of `of` modes.
    """

    def inside(square: Floats) -> Bools:
        return (frequency_of(square) >= low) & (frequency_of(square) < high)

    missing = search.search_until(wanted, inside)
    modes = search.modes(low, high, Choice("between", low=low, high=high), of)
    modes.attributes |= certificate(missing)
    return modes
