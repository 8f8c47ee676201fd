"""What is recorded of a motion, as a sum over Chebyshev polynomials of A, and its error.

A record is the sum over the orders k of weights, one for each time or frequency, times moments:
what the receivers read of T_k(X) c, X = 2 A / top - 1. As |T_k(X) c| <= |c|, what is left out of a
record by ending the sum is at most the sum of the further weights, times |c|, times the length of
the receiver's row. The sum goes on until that is below the tolerance times the largest of the
record itself, which is known by then.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from modal.solvers.spectrum import GrowthError, largest_growth, norm, top_of_spectrum, wider_top
from modal.system.operator import ContactOperator
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError
from modal.tools.progress import progress

LOOK = 50
"""Products between two looks at the growth of a recurrence."""
ROUNDING = np.finfo(float).eps
"""Of the sum of all weights: what their own round-off leaves uncertain."""


class Observer(Protocol):
    """What records of a motion are made: `count` numbers, each linear in M^1/2 u."""

    @property
    def count(self) -> int:
        """How many."""

    def observe(self, u: Floats, out: Floats) -> None:
        """Write the numbers (count,) of the motion u (6n,) into `out`."""

    def reach(self) -> Floats:
        """Shape (kinds,): of each kind of record the largest per unit length of M^1/2 u."""

    def largest(self, record: Array, displacement: Floats) -> Floats:
        """Shape (kinds,): the largest of a record (k, count), the source displaced by (k,), m."""


class Series(Protocol):
    """The weights of the orders."""

    def empty(self, count: int) -> Array:
        """The record, with `count` columns, of no order at all."""

    def left(self, orders: int) -> float:
        """Bound of what follows that many orders: the sum of their largest weights."""

    def orders(self, left: float) -> int:
        """The least number of orders that leave no more than this, or than round-off does."""

    def add(self, record: Array, rows: Floats, first: int) -> None:
        """Add to the record what orders from `first` on, of moments `rows` (k, count), give."""


AnySeries = TypeVar("AnySeries", bound=Series)


class Recurrence:
    """T_k(2 A / top - 1) start, one order after the other, and what receivers read of them.

    `operator` is A, `start` (6n,), which is worked on in place, `top` the upper end of the interval
    in omega^2, 1/s^2; the receivers are mass-scaled.
    """

    def __init__(
        self, operator: ContactOperator, start: Floats, top: float, receivers: Observer
    ) -> None:
        self._operator, self._top, self._receivers = operator, top, receivers
        self._before, self._now = start, np.empty_like(start)
        self.length, self.order = norm(start), 0

    def rows(self, count: int) -> Floats:
        """Shape (count, receivers.count): the next orders, from `order` on.

        GrowthError where the vectors grow, as they do when modes lie outside the interval.
        """
        rows = np.empty((count, self._receivers.count))
        for row in progress(count, "wave"):
            k = self.order
            if k == 0:
                self._now[:] = self._before
            elif k == 1:
                self._operator.combine(self._before, self._now, 2 / self._top, beta=-1.0)
            else:
                # T_k = 2 X T_(k-1) - T_(k-2), built in the array of T_(k-2).
                ahead, self._before = self._before, self._now
                self._now = self._operator.combine(
                    self._before, ahead, 4 / self._top, beta=-2.0, gamma=-1.0
                )
            self._receivers.observe(self._now, rows[row])
            if k % LOOK == LOOK - 1 or row == count - 1:
                growth = norm(self._now) / self.length if self.length > 0 else 0.0
                if not growth <= largest_growth(self._operator, k):
                    raise GrowthError(self._now, k)
            self.order += 1
        return rows


def summed(
    operator: ContactOperator,
    start: Callable[[], Floats],
    receivers: Observer,
    series_for: Callable[[float], AnySeries],
    largest: Callable[[AnySeries, Array], Floats],
    tolerance: float,
) -> tuple[AnySeries, Array, int, float]:
    """The series, its record, the number of products with K, and the bound of the record's error.

    `start` makes the start anew for each try; `series_for` gives the series for the end of an
    interval in omega^2, 1/s^2. `largest` (kinds,) of a record is what the error of each kind is
    relative to; it is above `tolerance` only where round-off leaves more. The first interval is an
    estimate. Where the recurrence grows, it was too small and a larger one is tried. Where it does
    not grow, modes a little above it do no harm: the expansion holds there too, and the error of
    leaving out high orders is no larger than inside. InputError where there is no stiffness.
    """
    top, products = top_of_spectrum(operator)
    if top == 0:
        raise InputError("the network has no stiffness; no wave goes through it")
    while True:
        series = series_for(top)
        recurrence = Recurrence(operator, start(), top, receivers)
        most = largest_growth(operator, 0) * recurrence.length * receivers.reach()
        record = series.empty(receivers.count)
        # No record is larger than all weights together allow: it takes so many orders at least.
        orders = series.orders(tolerance * series.left(0))
        try:
            while True:
                first = recurrence.order
                series.add(record, recurrence.rows(orders - first), first)
                left, whole = series.left(orders) * most, largest(series, record)
                with np.errstate(divide="ignore"):
                    error = float(np.divide(left, whole, out=0 * left, where=left > 0).max())
                if error <= tolerance:
                    break
                orders = series.orders(series.left(orders) * tolerance / error)
                if orders <= recurrence.order:
                    break
        except GrowthError as found:
            top, more = wider_top(operator, found, top)
            products += more + found.products
        else:
            return series, record, products + max(recurrence.order - 1, 0), error
