"""Which way a list of modes is found, and what each way will take."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.modes import effort
from modal.modes.density import density_of
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
        """How the list is found.

        arnoldi: without a certificate, of large packings whose K has no law of inertia. dense:
        whole matrices, or blocks of a crystal's symmetry: all modes, a large part, small packings.
        top: products with A, then solves about a shift above: no other way is as cheap for a few
        modes. lifted: a polynomial of A in place of factors, for many modes of large, wide
        packings, from zero on. shift, slices: solves about one shift just below zero, or about one
        in each slice of an interval.
        """
        system, kind = self.system, self.choice.kind
        unsymmetric = not system.symmetric and system.size > system.limits.unsymmetric
        if unsymmetric and kind in ("lowest", "highest"):
            return "arnoldi"
        if self._whole:
            return "dense"
        if kind == "highest":
            return "top"
        if self._lifting_pays:
            return "lifted"
        return "shift" if kind == "lowest" and self._few else "slices"

    def cost(self, way: str) -> Cost:
        """What a way will take that is no dense one."""
        if way == "top":
            return effort.from_the_top(self.system, self.count)
        if way == "lifted":
            return effort.below_an_edge(self.system, self.count, self.low_end.degree)
        return effort.near_a_shift(self.system, self.count)

    @property
    def _few(self) -> bool:
        return self.count <= self.system.limits.slice

    @property
    def _whole(self) -> bool:
        system, limits = self.system, self.system.limits
        if self.choice.kind == "all" or not system.symmetric or system.size <= limits.small:
            return True
        large_part = self.count > self.listed // limits.part
        return large_part and (self.choice.kind == "highest" or system.size <= limits.dense)

    @property
    def _lifting_pays(self) -> bool:
        """The range is not too wide, and the work less than that of slices.

        To know how far the lowest modes reach takes a density of states, which small packings save.
        """
        system, known = self.system, self.choice.kind == "between"
        if system.solver or not (self.count and self.from_zero):
            return False
        if not (known or system.size > system.limits.dense):
            return False
        if self.low_end.edge > WIDEST * system.top:
            return False
        lifted = self.cost("lifted")
        cheap = lifted.operations <= self.cost("slices").operations
        return cheap and lifted.bytes <= memory_at_hand()

    @cached_property
    def high(self) -> float:
        """Frequency, Hz, below which the modes lie; of the lowest ones an estimate, with enough.

        It is that of a density of states, refined until its resolution is finer; infinite where
        that would take longer than to find the modes about a shift, which asks for no frequency.
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
            finer = effort.PRODUCT * self.system.size * 2 * states.products
            if self._few and finer > self.cost("shift").operations:
                return np.inf

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
        effort.refuse_endless_search(self.system, self.cost(self.way), task, remedy)
