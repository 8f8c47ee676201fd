"""Which way a list of modes is found: one table, and what each way will take."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from modal.modes.density import density_of
from modal.modes.effort import below_an_edge, from_the_top, near_a_shift, refuse_endless_search
from modal.modes.mode_set import Choice
from modal.solvers.factor import Cost
from modal.solvers.low_end import LowEnd
from modal.system.linear_system import LinearSystem
from modal.tools.workload import memory_at_hand

ENOUGH = 1.15
"""Modes below a frequency that has enough, by an estimate, over those that are wanted: its error is
sqrt(2 / (6 count)) of them, 4 % of 200."""
COARSEST, SHARP = 32, 3.0
"""Parts of the spectrum that the first estimate tells apart; resolutions below the frequency."""
MARGIN = 1.04
"""From where modes are not lifted, over the frequency below which all are asked for. The last of
them must stand out: at 1 twice as many vectors are needed, from 1.02 to 1.06 equally many."""
WIDEST = 0.25
"""Share of the spectrum, in omega^2, of which the low end is lifted at most."""
FEWER = "ask for fewer, or for the density or a count"
"""What to do instead of finding each of very many modes."""


@dataclass
class Question:
    """A list that is asked for, of `count` modes out of so many that are `listed`.

    `count` is 0 for an interval whose modes are not yet counted. `from_zero`: whether nothing but
    zero modes lies below the list.
    """

    system: LinearSystem
    choice: Choice
    count: int = 0
    listed: int = 0
    from_zero: bool = True

    @cached_property
    def way(self) -> str:
        """The name of the first of `WAYS` that gives such a list and is taken for it."""
        kind = self.choice.kind
        return next(name for name, way in WAYS.items() if kind in way.gives and way.taken(self))

    @cached_property
    def high(self) -> float:
        """Frequency, Hz, below which the modes lie; of the lowest ones an estimate, with enough.

        It is that of a density of states, refined until its resolution is finer.
        """
        if self.choice.kind == "between":
            return self.choice.high
        resolution = float(np.sqrt(self.system.bound)) / (2 * np.pi) / COARSEST
        while True:
            states = density_of(self.system, resolution)
            grid = states.grid()
            below = states.count_below(grid)[0][:, 6] - states.zero_modes.sum()
            high = float(np.interp(ENOUGH * self.count, np.maximum.accumulate(below), grid))
            if high > SHARP * resolution:
                return high
            resolution /= 2

    @cached_property
    def low_end(self) -> LowEnd:
        """The polynomial that lifts all modes below `high`."""
        edge = (2 * np.pi * MARGIN * self.high) ** 2
        return LowEnd(self.system.renumbered, edge, self.system.top)

    def refuse_endless(self) -> None:
        """InputError where the way takes longer than it may, or more memory than there is."""
        task = f"the {self.choice.kind} {self.count} modes take"
        if self.choice.kind == "between":
            task = f"the {self.count} modes of this interval take"
        remedy = "ask for fewer" if self.choice.kind == "highest" else FEWER
        refuse_endless_search(self.system, WAYS[self.way].cost(self), task, remedy)


def _unsymmetric(asked: Question) -> bool:
    system = asked.system
    return not system.symmetric and system.size > system.limits.unsymmetric


def _whole(asked: Question) -> bool:
    system, limits = asked.system, asked.system.limits
    if asked.choice.kind == "all" or not system.symmetric or system.size <= limits.small:
        return True
    large_part = asked.count > asked.listed // limits.part
    return large_part and (asked.choice.kind == "highest" or system.size <= limits.dense)


def _lifting_pays(asked: Question) -> bool:
    """The range is not too wide, and the work less than that of slices.

    To know how far the lowest modes reach takes a density of states, which small packings save.
    """
    system, known = asked.system, asked.choice.kind == "between"
    if system.solver or not (asked.count and asked.from_zero):
        return False
    if not (known or system.size > system.limits.dense) or asked.low_end.edge > WIDEST * system.top:
        return False
    lifted, cut = (WAYS[name].cost(asked) for name in ("lifted", "slices"))
    return lifted.operations <= cut.operations and lifted.bytes <= memory_at_hand()


class Way(NamedTuple):
    """One way: the kinds of lists that it gives, when it is taken, and what it will take."""

    gives: tuple[str, ...]
    taken: Callable[[Question], bool]
    cost: Callable[[Question], Cost] = lambda q: near_a_shift(q.system, q.count)


WAYS = {
    # Arnoldi, without a certificate: large packings whose K has no law of inertia.
    "arnoldi": Way(("lowest", "highest"), _unsymmetric),
    # Whole matrices, or blocks of a crystal's symmetry: all modes, a large part, small packings.
    "dense": Way(("lowest", "highest", "between", "all"), _whole),
    # Products with A, then solves about a shift above: no other way is as cheap for a few modes.
    "top": Way(("highest",), lambda asked: True, lambda q: from_the_top(q.system, q.count)),
    # A polynomial of A in place of factors: many modes of large, wide packings, from zero on.
    "lifted": Way(
        ("lowest", "between"),
        _lifting_pays,
        lambda q: below_an_edge(q.system, q.count, q.low_end.degree),
    ),
    # Solves about one shift just below zero, or about one in each slice of an interval.
    "shift": Way(("lowest",), lambda asked: asked.count <= asked.system.limits.slice),
    "slices": Way(("lowest", "between"), lambda asked: True),
}
"""In this order; the first one that gives the kind of list and is taken for it finds it."""
