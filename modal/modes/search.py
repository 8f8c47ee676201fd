"""A search for modes near a shift, from the top or below, in rounds until an exact count agrees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from modal.modes.mode_set import Choice, ModeSet
from modal.modes.observables import found_modes
from modal.solvers.factor import Factor, SingularError, factorise
from modal.solvers.lanczos import (
    ROOM,
    WIDTH_ABOVE,
    Held,
    Nearest,
    modes_below,
    modes_from_top,
    modes_nearest,
)
from modal.solvers.low_end import LowEnd
from modal.solvers.spectrum import top_mode
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Bools, Floats, Ints

ABOVE = 1e-7
"""Distance of the shift from the highest mode, at least, relative to its omega^2."""
PRODUCTS = 300
"""Products with A after which the highest mode is looked for about a shift instead."""
PRODUCTS_EACH = 30
"""The same for each further mode. A factor costs about as much as a few hundred products."""


class Search:
    """Modes nearest a shift, found in rounds: each round holds out what the rounds before found.

    A block of start vectors sees as many modes of one frequency as it is wide. Where an exact
    count says that some are missing, another round finds them. The zero modes `null` (size, z) are
    held out.
    """

    def __init__(
        self, system: LinearSystem, null: sp.csc_matrix, sigma: float, *, definite: bool
    ) -> None:
        self.system, self.null, self.sigma, self.definite = system, null, sigma, definite
        self.factor: Factor | None = None
        self.square = np.empty(0)
        self.vector = np.empty((system.size, 0))
        self.spent = 0
        self.solver = ""

    def search_until(self, wanted: int, inside: Callable[[Floats], Bools] = np.isfinite) -> int:
        """Search until `wanted` modes are found, or a round finds none that converges or counts.

        Only modes whose omega^2 fulfil `inside` count; it takes omega^2 (k,) and gives bool (k,).
        As the nearest come first, a round that finds others alone has seen all that are inside.
        Returns how many are missing: 0 if all were found, negative if more were found than wanted.
        """
        going = True
        while going:
            known = len(self.square)
            ask = min(wanted - int(inside(self.square).sum()), self.held().free)
            going = ask > 0 and self.run_round(ask)
            new = inside(self.square[known:])
            going &= not len(new) or bool(new.any())
        return wanted - int(inside(self.square).sum())

    def complete(self, count: int, direction: int, counted: Callable[[float], int]) -> int:
        """Search until an exact count confirms the `count` lowest or highest modes.

        `direction` is 1 for the lowest and -1 for the highest modes. `counted` gives the exact
        number of modes below (for -1: above) a frequency in Hz. The list is complete if it has as
        many modes beyond its last frequency; of several modes at that frequency it may have a part.
        The search ends early where a round finds none that converges. Returns how many modes are
        missing, as `search_until` does.
        """
        missing = self.search_until(count)
        while missing <= 0:
            self.release()
            last = direction * np.sort(direction * self.square)[count - 1]
            edge = float(frequency_of(last)) * (1 - direction * self.system.count_uncertainty(last))

            def beyond(square: Floats, edge: float = edge) -> Bools:
                return direction * frequency_of(square) < direction * edge

            wanted = counted(edge)
            lacking = wanted - int(beyond(self.square).sum())
            if lacking <= count:
                return self.search_until(wanted, beyond)
            # Of a frequency so often degenerate a part is enough: the last mode will be another.
            if not self.run_round(count):
                return count
        return missing

    def held(self) -> Held:
        """The modes that the next round must not find again: zero modes and those found before."""
        return Held(self.null, self.vector)

    def run_round(self, count: int) -> bool:
        """Search for `count` more modes; True if any converged."""
        near = self.near(count)
        self.square = np.concatenate([self.square, near.square[near.converged]])
        vector = _columns(near.vector, np.flatnonzero(near.converged))
        known = self.vector.shape[1] > 0
        self.vector = np.concatenate([self.vector, vector], axis=1) if known else vector
        return bool(near.converged.any())

    def near(self, count: int) -> Nearest:
        """The `count` modes nearest the shift; the factor is made at the first call, and kept."""
        if self.factor is None:
            self.factor = self.factorised()
            self.solver = self.factor.solver
        near = modes_nearest(self.factor.solve, self.system.size, count, self.sigma, self.held())
        self.spent += near.products
        return near

    def factorised(self) -> Factor:
        """A factorisation of A - sigma."""
        return self.system.factor(self.sigma, definite=self.definite)

    def release(self) -> None:
        """Give back the factor's memory, which a count needs."""
        if self.factor is not None:
            self.factor.release()
            self.factor = None

    def description(self) -> str:
        """The solver and what it has spent."""
        return f"lanczos {self.solver}, {self.spent} solves"

    def modes(self, low: float, high: float, choice: Choice, of: int = 0) -> ModeSet:
        """What was found with low <= f < high, Hz, ascending; `of` as in `found_modes`."""
        self.release()
        order = np.argsort(self.square)
        frequency = frequency_of(self.square[order])
        order = order[(frequency >= low) & (frequency < high)]
        listed = [(_columns(self.vector, order), np.arange(len(order)))]
        return found_modes(self.system, self.square[order], listed, choice, self.description(), of)


def _columns(vector: Floats, chosen: Ints) -> Floats:
    """The chosen columns of vectors (size, k); all of them in their order are not copied."""
    if np.array_equal(chosen, np.arange(vector.shape[1])):
        return vector
    return vector[:, chosen]


class SearchBelow(Search):
    """The lowest modes, all below a frequency: by a polynomial of A in place of a factorisation."""

    def __init__(self, system: LinearSystem, null: sp.csc_matrix, low_end: LowEnd) -> None:
        super().__init__(system, null, 0.0, definite=True)
        self.low_end = low_end

    def near(self, count: int) -> Nearest:
        """The `count` lowest modes."""
        near = modes_below(self.low_end, self.system.size, count, self.held())
        self.spent += near.products
        return near

    def description(self) -> str:
        """What it has spent."""
        return f"lanczos, {self.spent} products, {self.low_end.degree} a vector"


class SearchFromTop(Search):
    """The highest modes: by products with A, as long as these converge; then about a shift.

    Products alone find modes that stand apart; dense bunches at the top (long crystals, equal
    columns that hardly differ) need the shift, just above the highest of them, where A - sigma is
    negative definite. Zero modes are listed with the others: they need not be held out, as they
    are far from the top.
    """

    def __init__(self, system: LinearSystem) -> None:
        super().__init__(system, sp.csc_matrix((system.size, 0)), np.inf, definite=True)
        self.products = 0
        self.reach = 0.0

    def run_round(self, count: int) -> bool:
        """Search for `count` more modes below those found; True if another round is worthwhile.

        Where products did not converge, the next round works about a shift above the highest mode.
        """
        by_products = np.isinf(self.sigma)
        return super().run_round(count) or bool(by_products and np.isfinite(self.sigma))

    def near(self, count: int) -> Nearest:
        """The `count` highest modes below those found."""
        if np.isinf(self.sigma) and self.held().free <= ROOM * count:
            self._about(self.square.max(initial=self.system.bound), 0.0)
        if np.isfinite(self.sigma):
            return super().near(count)
        most = PRODUCTS + PRODUCTS_EACH * count
        if count == 1 and not len(self.square):
            operator = self.system.renumbered
            top = top_mode(operator, most)
            top.vector = operator.outward(top.vector[:, 0])[:, None]
        else:
            apply, size = self.system.operator.apply, self.system.size
            top = modes_from_top(apply, size, count, self.held(), most)
        self.products += top.products
        if not top.converged.all():
            highest = max(top.square.max(), self.square.max(initial=0.0))
            self._about(highest, highest - top.square.min())
        return top

    def _about(self, highest: float, reach: float) -> None:
        """Go on about a shift above the `highest` omega^2, by `reach` at least."""
        self.reach = max(reach, ABOVE * highest)
        self.sigma = highest + self.reach

    def look_again(self, count: int) -> int:
        """Find the `count` highest modes without an exact count; returns how many are missing.

        Further rounds, each from another start block, follow until one finds nothing above the
        lowest of the `count` modes. That makes a missed mode unlikely; it proves nothing.
        """
        missing = self.search_until(count)
        while missing <= 0 and count > 1:
            known, lowest = len(self.square), np.sort(self.square)[-count]
            if not self.run_round(WIDTH_ABOVE) or self.square[known:].max(initial=0.0) <= lowest:
                break
        return max(missing, 0)

    def factorised(self) -> Factor:
        """A factorisation of A - sigma, made from sigma - A, which is positive definite.

        Where that fails a mode lies above sigma; sigma is then raised and the factor made again.
        """
        factor = None
        while factor is None:
            shifted = -self.system.shifted(self.sigma)
            try:
                factor = factorise(shifted, definite=True, solver=self.system.solver)
            except SingularError:
                self.reach *= 4
                self.sigma += self.reach
        solve = factor.solve
        return replace(factor, solve=lambda rhs: -solve(rhs))

    def description(self) -> str:
        """The solver and what it has spent."""
        spent = f"lanczos, {self.products} products"
        return f"{spent}, {self.solver}, {self.spent} solves" if self.solver else spent
