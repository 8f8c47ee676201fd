"""A search for modes in rounds, until an exact count agrees: about a shift, from below, or the top.

Each round holds out what the rounds before found. A block of start vectors sees as many modes of
one frequency as it is wide; where an exact count says that some are missing, another round finds
them.
"""

from collections.abc import Callable
from contextlib import suppress

import numpy as np
import scipy.sparse as sp

from modal.modes.effort import PRODUCT, factorisation, refuse_endless_search
from modal.modes.observables import Piece
from modal.solvers.factor import Factor, SingularError
from modal.solvers.lanczos import (
    ROOM,
    Held,
    Nearest,
    modes_below,
    modes_from_top,
    modes_nearest,
)
from modal.solvers.low_end import LowEnd
from modal.solvers.spectrum import dot, top_mode
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.memory import memory_at_hand

ABOVE = 1e-7
"""Distance of the shift from the highest mode, at least, relative to its omega^2."""
PRODUCTS = 300
"""Products with A after which the highest mode is looked for about a shift instead, unless the
factor costs more: that of a long, narrow packing costs a few hundred products, of a wide one
thousands."""
PRODUCTS_EACH = 30
"""The same for each further mode."""
MAX_PRODUCTS = 20_000
"""Products with A that are made at most: so many separate omega^2 that differ by 1e-6."""
NEAR_ZERO = 1e3
"""Times the threshold of zero: up to there a search may have found a zero mode, to its round-off.
Which ones are is told by their Rayleigh quotients, whose error is the square of a vector's."""


class AboutShift:
    """The modes nearest to a shift `sigma` in omega^2, 1/s^2, by solves with A - sigma."""

    def __init__(self, system: LinearSystem, sigma: float, *, definite: bool = False) -> None:
        self.system, self.sigma, self.definite = system, sigma, definite
        self.factor: Factor | None = None
        self.solver = "lanczos, solves"

    def factorised(self) -> Factor:
        """The factor of A - sigma, made at the first call, and kept."""
        if self.factor is None:
            self.factor = self.system.factor(self.sigma, definite=self.definite)
            self.solver = f"lanczos, solves by {self.factor.solver}"
        return self.factor

    def near(self, count: int, held: Held) -> Nearest:
        """The `count` nearest modes, but for those that are held."""
        return modes_nearest(self.factorised().solve, count, self.sigma, held)

    def release(self) -> None:
        """Give back the memory of the factor, which a count needs."""
        if self.factor is not None:
            self.factor.release()
            self.factor = None


class FromBelow:
    """The lowest modes, all below a frequency: by a polynomial of A in place of a factorisation."""

    def __init__(self, low_end: LowEnd) -> None:
        self.low_end, self.solver = low_end, f"lanczos, {low_end.degree} products a vector"

    def near(self, count: int, held: Held) -> Nearest:
        """The `count` lowest modes, but for those that are held."""
        return modes_below(self.low_end, count, held)

    def release(self) -> None:
        """There is no factor."""


class FromTop:
    """The highest modes: by products with A, as long as these converge; then about a shift.

    Products alone find modes that stand apart; dense bunches at the top (long crystals, equal
    columns that hardly differ) need the shift, just above the highest of them.
    """

    def __init__(self, system: LinearSystem) -> None:
        self.system, self.highest, self.solver = system, 0.0, "lanczos, products"
        self.about: AboutShift | None = None

    def near(self, count: int, held: Held) -> Nearest:
        """The `count` highest modes, but for those that are held."""
        if self.about is None and held.free > ROOM * count:
            top = self._by_products(count, held)
            self.highest = max(self.highest, top.square.max())
            if top.converged.all():
                return top
            refuse_endless_search(
                self.system,
                factorisation(self.system, kept=True),
                f"the modes at the top lie too close for {self._most_products(count)} products "
                "with K, and solves about a shift take",
                "take a shorter or narrower packing, or ask for the density of states, which "
                "shows where the spectrum ends",
            )
            self.about = self._above(self.highest, self.highest - top.square.min())
        if self.about is None:
            self.about = self._above(self.system.bound, 0.0)
        self.solver = self.about.solver
        return self.about.near(count, held)

    def _by_products(self, count: int, held: Held) -> Nearest:
        """The highest modes as far as a limited number of products finds them."""
        most = self._most_products(count)
        if count == 1 and held.free == self.system.size:
            operator = self.system.renumbered
            top = top_mode(operator, most)
            top.vector = operator.outward(top.vector[:, 0])[:, None]
            return top
        return modes_from_top(self.system.operator.apply, count, held, most)

    def _most_products(self, count: int) -> int:
        """Return how many products with A cost as much as the factor that would be needed else."""
        factor = factorisation(self.system, kept=True)
        affordable = factor.operations / (PRODUCT * self.system.size)
        if factor.bytes > memory_at_hand():
            affordable = MAX_PRODUCTS
        return max(PRODUCTS + PRODUCTS_EACH * count, min(int(affordable), MAX_PRODUCTS))

    def _above(self, highest: float, reach: float) -> AboutShift:
        """About a shift above the `highest` omega^2 that is known, by `reach` at least.

        Where not all eigenvalues of A - sigma are negative, a mode lies above; the shift is raised.
        """
        reach = max(reach, ABOVE * highest)
        while True:
            about = AboutShift(self.system, highest + reach)
            with suppress(SingularError):
                if about.factorised().negative in (None, self.system.size):
                    return about
            about.release()
            reach *= 4

    def release(self) -> None:
        """Give back the memory of a factor."""
        if self.about is not None:
            self.about.release()


class Search:
    """What the rounds have found: omega^2 (k,), 1/s^2, and unit vectors (size, k) of A.

    The modes `null` (size, z), orthonormal, are held out of all rounds. Of a motion without energy
    that was not among them omega^2 is zero exactly.
    """

    def __init__(
        self, system: LinearSystem, source: AboutShift | FromBelow | FromTop, null: sp.csc_matrix
    ) -> None:
        self.system, self.source, self.null = system, source, null
        self.square = np.empty(0)
        self.vector = np.empty((null.shape[0], 0))

    def search_until(self, wanted: int, inside: Callable[[Floats], Bools]) -> int:
        """Search until `wanted` modes are found, or a round finds none that converges or counts.

        Only modes whose omega^2 fulfil `inside` count; it takes omega^2 (k,) and gives bool (k,).
        As the nearest come first, a round that finds others alone has seen all that are inside,
        unless these are zero modes, which lie below the lowest.
        Returns how many are missing: 0 if all were found, negative if more were found than wanted.
        """
        going = True
        while going:
            known = len(self.square)
            ask = min(wanted - int(inside(self.square).sum()), self._held().free)
            going = ask > 0 and self.run_round(ask)
            new = self.square[known:]
            going &= not len(new) or bool((inside(new) | (new == 0)).any())
        return wanted - int(inside(self.square).sum())

    def complete(self, count: int, direction: int, counted: Callable[[float], int]) -> int:
        """Search until an exact count confirms the `count` lowest or highest modes.

        `direction` is 1 for the lowest modes beside those at zero, and -1 for the highest ones.
        `counted` gives the exact number of modes below (for -1: above) a frequency in Hz. The list
        is complete if it has as many modes beyond its last frequency; of several modes at that
        frequency it may have a part. The search ends early where a round finds none that converges.
        Returns how many modes are missing, as `search_until` does.
        """

        def listed(square: Floats) -> Bools:
            return np.isfinite(square) if direction < 0 else square != 0

        missing = self.search_until(count, listed)
        while missing <= 0:
            self.source.release()
            square = self.square[listed(self.square)]
            last = direction * np.sort(direction * square)[count - 1]
            edge = float(frequency_of(last)) * (1 - direction * self.system.count_uncertainty(last))

            def beyond(square: Floats, edge: float = edge) -> Bools:
                return direction * frequency_of(square) < direction * edge

            wanted = counted(edge)
            if wanted - int(beyond(self.square).sum()) <= count:
                return self.search_until(wanted, beyond)
            # Of a frequency so often degenerate a part is enough: the last mode will be another.
            if not self.run_round(count):
                return count
        return missing

    def run_round(self, count: int) -> bool:
        """Search for `count` more modes; True if any converged."""
        near = self.source.near(count, self._held())
        every, some = near.converged.all(), near.converged.any()
        vector = near.vector if every else near.vector[:, near.converged]
        first, square = not len(self.square), near.square[near.converged]
        zero = self.system.zero_threshold
        for k in np.flatnonzero(abs(square) <= NEAR_ZERO * zero):
            lowest = vector[:, k]
            quotient = dot(lowest, self.system.operator.apply(lowest))
            square[k] = 0.0 if abs(quotient) <= zero else quotient
        self.square = np.concatenate([self.square, square])
        self.vector = vector if first else np.concatenate([self.vector, vector], axis=1)
        return bool(some)

    def sorted(self, low: float = -np.inf, high: float = np.inf) -> Ints:
        """Which modes have low <= f < high, Hz, in ascending order; the factor is given back."""
        self.source.release()
        order = np.argsort(self.square)
        frequency = frequency_of(self.square[order])
        return order[(frequency >= low) & (frequency < high)]

    def piece(self, which: Ints, first: int = 0) -> Piece:
        """The modes `which`, in ascending order, as a piece of a list from its place `first` on."""
        places = first + np.arange(len(which))
        return Piece(self.square[which], places, lambda some: self.vector[:, which[some]])

    @property
    def at_zero(self) -> Floats:
        """Shape (size, z): the zero modes that were found, beside those held out."""
        return self.vector[:, self.square == 0]

    def _held(self) -> Held:
        return Held(self.null, self.vector)
