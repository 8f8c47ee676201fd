"""Search for modes in rounds until an exact count agrees.

The search is about a shift, from the lower end of the spectrum, or from the top.

Each round searches orthogonally to the modes of earlier rounds. A block of start vectors finds as
many modes of equal frequency as it has columns; if an exact count says that some are missing,
another round finds them.
"""

from collections.abc import Callable
from contextlib import suppress

import numpy as np
import scipy.sparse as sp

from modal.modes.effort import PRODUCT_OPERATIONS, factorisation, refuse_endless_search
from modal.modes.observables import Piece
from modal.modes.soft_motions import soft_motions
from modal.solvers.davidson import TOLERANCE, Operators, lowest_modes
from modal.solvers.factor import Factor, SingularError, named
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
from modal.tools.errors import UnavailableError
from modal.tools.memory import memory_at_hand

MIN_DISTANCE_ABOVE = 1e-7
"""Least distance of the shift from the highest mode, divided by the omega^2 of the mode."""
MIN_PRODUCTS = 300
"""Number of products with A after which the highest modes are sought about a shift instead, unless
the factor costs more: the factor of a long, narrow packing costs as much as a few hundred products,
of a wide one as thousands."""
MIN_PRODUCTS_PER_MODE = 30
"""Number of products with A for each wanted mode, in addition to `MIN_PRODUCTS`."""
MAX_PRODUCTS = 20_000
"""Largest number of products with A: so many are needed to separate values of omega^2 that differ
by 1e-6."""
MAX_SQUARE_IN_THRESHOLDS = 1e3
"""Largest omega^2, divided by the threshold of zero, that may be a zero mode with round-off. The
Rayleigh quotient then decides, because its error is the square of that of the vector."""
EDGE_STEP = 1.2
"""Factor by which the edge of a polynomial, an omega^2, grows if wanted modes lie above it."""
ROUGH_TOLERANCE = 1e-2
"""Relative residual of a mode of which only the place is wanted."""
SHIFT_GROWTH = 4
"""Factor by which the distance of a shift from the highest known mode grows until no mode lies
above the shift."""


class AboutShift:
    """Search for the modes nearest to a shift `sigma` in omega^2, 1/s^2, by solving A - sigma.

    `by` names the solver; the default is the factorisation chosen for the system, else the fastest.
    """

    def __init__(
        self,
        system: LinearSystem,
        sigma: float,
        *,
        definite: bool = False,
        by: str | None = None,
    ) -> None:
        self.system = system
        self.sigma = sigma
        self.definite = definite
        self.by = by or system.direct_solver
        self.factor: Factor | None = None
        self.solver = "lanczos, solves"

    def factorised(self) -> Factor:
        """Return the factor of A - sigma, which is computed at the first call."""
        if self.factor is None:
            soft = None
            if self.by is not None and not named(self.by).direct:
                soft = soft_motions(self.system)
            self.factor = self.system.factor(
                self.sigma, definite=self.definite, solver=self.by, soft=soft
            )
            self.solver = f"lanczos, solves by {self.factor.solver}"
        return self.factor

    def near(self, count: int, held: Held) -> Nearest:
        """Find the `count` nearest modes besides those already excluded."""
        factor = self.factorised()
        if factor.approximate is not None:
            return self.lowest(count, held)
        return modes_nearest(factor.solve, count, self.sigma, held)

    def roughly_lowest(self, held: Held) -> float:
        """Return about the omega^2, 1/s^2, of the lowest mode besides those already excluded."""
        return float(self.lowest(1, held, ROUGH_TOLERANCE).square[0])

    def lowest(self, count: int, held: Held, tolerance: float = TOLERANCE) -> Nearest:
        """Find the `count` lowest modes with an approximate inverse, to a relative residual."""
        factor = self.factorised()
        operators = Operators(self.system.operator.apply, factor.precondition, self.sigma)
        self.solver = f"davidson, cycles of {factor.solver}"
        return lowest_modes(operators, count, held, tolerance)

    def release(self) -> None:
        """Free the memory of the factor, which an exact count needs."""
        if self.factor is not None:
            self.factor.release()
            self.factor = None


class FromBelow:
    """Search for the lowest modes by a polynomial of A, without a factorisation."""

    def __init__(self, low_end: LowEnd) -> None:
        self.low_end = low_end
        self.solver = f"lanczos, {low_end.degree} products a vector"

    def near(self, count: int, held: Held) -> Nearest:
        """Find the `count` lowest modes besides those already excluded, those below the edge.

        If not all of them are found there, the next search has a higher edge; if none is, the edge
        is raised until one is.
        """
        while True:
            lowest = modes_below(self.low_end, count, held)
            lowest.converged &= lowest.square < self.low_end.edge
            if lowest.converged.all() or self.low_end.highest:
                return lowest
            self.low_end = self.low_end.raised(EDGE_STEP)
            if lowest.converged.any():
                return lowest

    def roughly_lowest(self, held: Held) -> float:
        """Return about the omega^2, 1/s^2, of the lowest mode besides those already excluded."""
        return float(modes_below(self.low_end, 1, held, ROUGH_TOLERANCE).square[0])

    def release(self) -> None:
        """Do nothing: there is no factor."""


class FromTop:
    """Search for the highest modes by products with A, and about a shift if these converge slowly.

    Products alone find modes that stand apart; modes that lie close together at the top of the
    spectrum (long crystals, nearly equal columns) need a shift just above the highest of them.
    """

    def __init__(self, system: LinearSystem) -> None:
        self.system = system
        self.highest = 0.0
        self.solver = "lanczos, products"
        self.about: AboutShift | None = None

    def near(self, count: int, held: Held) -> Nearest:
        """Find the `count` highest modes besides those already excluded.

        Raises InputError if products do not suffice and a factorisation would take too much.
        """
        if self.about is None and held.free > ROOM * count:
            top = self._find_by_products(count, held)
            self.highest = max(self.highest, top.square.max())
            if top.converged.all():
                return top
            refuse_endless_search(
                self.system,
                factorisation(self.system, kept=True),
                f"the modes at the top lie too close for {self._max_products(count)} products "
                "with K, and solves about a shift take",
                "take a shorter or narrower packing, or ask for the density of states, which "
                "shows where the spectrum ends",
            )
            self.about = self._shift_above(self.highest, self.highest - top.square.min())
        if self.about is None:
            self.about = self._shift_above(self.system.row_sum_bound, 0.0)
        self.solver = self.about.solver
        return self.about.near(count, held)

    def _find_by_products(self, count: int, held: Held) -> Nearest:
        """Find as many of the highest modes as a limited number of products allows."""
        max_products = self._max_products(count)
        if count == 1 and held.free == self.system.degrees_of_freedom:
            operator = self.system.renumbered
            top = top_mode(operator, max_products)
            top.vector = operator.outward(top.vector[:, 0])[:, None]
            return top
        return modes_from_top(self.system.operator.apply, count, held, max_products)

    def _max_products(self, count: int) -> int:
        """Return how many products with A cost as much as a factorisation instead."""
        factor = factorisation(self.system, kept=True)
        affordable = factor.operations / (PRODUCT_OPERATIONS * self.system.size)
        if factor.bytes > memory_at_hand():
            affordable = MAX_PRODUCTS
        least = MIN_PRODUCTS + MIN_PRODUCTS_PER_MODE * count
        return max(least, min(int(affordable), MAX_PRODUCTS))

    def _shift_above(self, highest: float, distance: float) -> AboutShift:
        """Return a search about a shift at least `distance` above the `highest` known omega^2.

        If not all eigenvalues of A - sigma are negative, a mode lies above the shift sigma, which
        is then raised. All are in 1/s^2.
        """
        distance = max(distance, MIN_DISTANCE_ABOVE * highest)
        while True:
            about = AboutShift(self.system, highest + distance)
            with suppress(SingularError):
                if about.factorised().negative in (None, self.system.degrees_of_freedom):
                    return about
            about.release()
            distance *= SHIFT_GROWTH

    def release(self) -> None:
        """Free the memory of a factor."""
        if self.about is not None:
            self.about.release()


class Search:
    """The modes found so far: omega^2 (k,), 1/s^2, and unit eigenvectors (size, k) of A.

    The orthonormal modes `null` (size, z) are excluded from all rounds, and so are held motions. A
    mode without energy that is not in `null` is given an omega^2 of exactly zero.
    """

    def __init__(
        self, system: LinearSystem, source: AboutShift | FromBelow | FromTop, null: sp.csc_matrix
    ) -> None:
        self.system = system
        self.source = source
        self.null = null
        if system.network.fixed is not None:
            self.null = sp.hstack([null, system.held_motions], format="csc")
        self.square = np.empty(0)
        self.vector = np.empty((null.shape[0], 0))

    def search_until(self, wanted: int, inside: Callable[[Floats], Bools]) -> int:
        """Search until `wanted` modes are found, or a round finds no further converged mode inside.

        Only modes inside a range count: the function `inside` takes omega^2 (k,) and returns bool
        (k,). The nearest modes are found first. Therefore a round that finds only modes outside
        shows that none inside is left, unless it found zero modes, which lie below the lowest.
        Returns the number of missing modes: 0 if all were found, negative if more were found than
        wanted.
        """
        going = True
        while going:
            n_known = len(self.square)
            missing = wanted - int(inside(self.square).sum())
            count = min(missing, self.held().free)
            going = count > 0 and self.run_round(count)
            new = self.square[n_known:]
            going &= not len(new) or bool((inside(new) | (new == 0)).any())
        return wanted - int(inside(self.square).sum())

    def complete(self, count: int, direction: int, exact_count: Callable[[float], int]) -> int:
        """Search until an exact count confirms the `count` lowest or highest modes.

        `direction` is 1 for the lowest modes except those at zero, and -1 for the highest ones.
        `exact_count` returns the number of modes below (for -1: above) a frequency in Hz. The list
        is complete if it contains as many modes as were counted up to its last frequency; of
        several modes at that frequency it may contain a part. The search ends early if no mode of a
        round converges. Returns how many modes are missing, as `search_until` does.
        """

        def listed(square: Floats) -> Bools:
            return np.isfinite(square) if direction < 0 else square != 0

        missing = self.search_until(count, listed)
        while missing <= 0:
            self.source.release()
            square = self.square[listed(self.square)]
            last = direction * np.sort(direction * square)[count - 1]
            uncertainty = self.system.count_uncertainty(last)
            edge = float(frequency_of(last)) * (1 - direction * uncertainty)

            def beyond(square: Floats, edge: float = edge) -> Bools:
                return direction * frequency_of(square) < direction * edge

            wanted = exact_count(edge)
            if wanted - int(beyond(self.square).sum()) <= count:
                return self.search_until(wanted, beyond)
            # So many modes share one frequency that a part is enough; the last mode is another.
            if not self.run_round(count):
                return count
        return missing

    def run_round(self, count: int) -> bool:
        """Search for `count` more modes; return whether any converged."""
        nearest = self.source.near(count, self.held())
        vector = nearest.vector
        if not nearest.converged.all():
            vector = vector[:, nearest.converged]
        square = nearest.square[nearest.converged]
        threshold = self.system.zero_threshold
        for k in np.flatnonzero(abs(square) <= MAX_SQUARE_IN_THRESHOLDS * threshold):
            unit = vector[:, k]
            quotient = dot(unit, self.system.operator.apply(unit))
            square[k] = 0.0 if abs(quotient) <= threshold else quotient
        if len(self.square):
            vector = np.concatenate([self.vector, vector], axis=1)
        self.vector = vector
        self.square = np.concatenate([self.square, square])
        return bool(nearest.converged.any())

    def sorted(self, low: float = -np.inf, high: float = np.inf) -> Ints:
        """Return the indices of the modes with low <= f < high, Hz, ascending; free the factor."""
        self.source.release()
        order = np.argsort(self.square)
        frequency = frequency_of(self.square[order])
        return order[(frequency >= low) & (frequency < high)]

    def piece(self, indices: Ints, first: int = 0) -> Piece:
        """Return modes, in ascending order, as a piece of a list that begins at place `first`."""
        places = first + np.arange(len(indices))
        return Piece(self.square[indices], places, lambda some: self.vector[:, indices[some]])

    @property
    def at_zero(self) -> Floats:
        """The zero modes (size, z) that were found in addition to those in `null`."""
        return self.vector[:, self.square == 0]

    def held(self) -> Held:
        """Return all modes that the next round excludes."""
        return Held(self.null, self.vector)


def no_mode_converged() -> UnavailableError:
    """Return the refusal of a search that found nothing."""
    return UnavailableError(
        "not_converged",
        "no mode converged",
        "the contrast of stiffnesses or masses leaves the lowest modes below round-off",
        "ask for the highest, or for an interval further up",
    )
