"""What is recorded of a motion, as a sum over Chebyshev polynomials of A, and its error.

A record is the sum over the orders k of weights, one for each time or frequency, times moments:
what the receivers read of T_k(X) c, X = 2 A / top - 1. As |T_k(X) c| <= |c|, what is left out of a
record by ending the sum is at most the sum of the further weights, times |c|, times the length of
the receiver's row. The sum goes on until that is below the tolerance times the largest of the
record itself, which is known by then.
The weights of a wave (`Expansion`) and of a response (`Resolvent`) are for omega^2
from zero to `top`, 1/s^2.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
import scipy.sparse as sp

from modal.solvers.same_bits import same_bits_product
from modal.solvers.spectrum import GrowthError, largest_growth, norm
from modal.system.operator import ContactOperator
from modal.tools.arrays import Array, Complex, Floats
from modal.tools.errors import InputError
from modal.tools.progress import progress
from modal.waves.driven import Driven

LOOK = 50
"""Products between two looks at the growth of a recurrence."""
ROUNDING = np.finfo(float).eps
"""Of the sum of all weights: what their own round-off leaves uncertain."""


AnySeries = TypeVar("AnySeries", "Expansion", "Resolvent")
"""Weights of the orders, one set for each time or frequency."""


class Recurrence:
    """T_k(2 A / top - 1) start, one order after the other, and what receivers read of them.

    `operator` is A, `start` (6n,), which is worked on in place, `top` the upper end of the interval
    in omega^2, 1/s^2; `receivers` (count, 6n) are rows that read mass-scaled motions.
    """

    def __init__(
        self, operator: ContactOperator, start: Floats, top: float, receivers: sp.csr_matrix
    ) -> None:
        self._operator, self._top, self._receivers = operator, top, receivers
        self._before, self._now = start, np.empty_like(start)
        self.length, self.order = norm(start), 0

    def rows(self, count: int) -> Floats:
        """Shape (count, receivers): the next orders, from `order` on.

        GrowthError where the vectors grow, as they do when modes lie outside the interval.
        """
        rows = np.empty((count, self._receivers.shape[0]))
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
            rows[row] = self._receivers @ self._now
            if k % LOOK == LOOK - 1 or row == count - 1:
                growth = norm(self._now) / self.length if self.length > 0 else 0.0
                if not growth <= largest_growth(self._operator, k):
                    raise GrowthError
            self.order += 1
        return rows


def summed(
    driven: Driven, series_for: Callable[[float], AnySeries], tolerance: float
) -> tuple[AnySeries, Array, int, float]:
    """The series, its record, the number of products with K, and the bound of the record's error.

    `series_for` gives the series for the `top` of an interval in omega^2, 1/s^2. The error is
    relative to the largest of each kind in the record (`Driven.largest`); it is above `tolerance`
    only where round-off leaves more. GrowthError where K has negative directions, InputError where
    there is no stiffness.
    """
    operator, (top, products) = driven.springs.operator, driven.system.end
    if top == 0:
        raise InputError("the network has no stiffness; no wave goes through it")
    series = series_for(top)
    recurrence = Recurrence(operator, driven.springs.push.toarray()[0], top, driven.springs.rows)
    most = largest_growth(operator, 0) * recurrence.length * driven.reach()
    record = driven.blank(series.moved)
    # No record is larger than all weights together allow: it takes so many orders at least.
    orders = series.orders(tolerance * series.left(0))
    while True:
        first = recurrence.order
        series.add(record, recurrence.rows(orders - first), first)
        left = series.left(orders) * most
        whole = driven.largest(record, apart=series.apart)
        with np.errstate(divide="ignore"):
            error = float(np.divide(left, whole, out=0 * left, where=left > 0).max())
        if error > tolerance:
            orders = series.orders(series.left(orders) * tolerance / error)
        if error <= tolerance or orders <= recurrence.order:
            break
    return series, record, products + max(recurrence.order - 1, 0), error


CHUNK = 256
"""Frequencies evaluated at a time, to bound the memory."""


class Expansion:
    """Chebyshev coefficients of what a motion does to an oscillator, y(top (1 + x) / 2, t).

    Times (nt,), s, at which the source has `moved` by (nt,), m; `response` gives y (nw, nt), m s^2,
    for omega^2 (nw,), 1/s^2. `coefficient` (count, nt), m s^2: of all orders that round-off does
    not hide. The error is relative to the larger of both stresses: the wave may not yet have come
    to the receiver wall.
    """

    apart = False

    def __init__(
        self, response: Callable[[Floats], Floats], time: Floats, moved: Floats, top: float
    ) -> None:
        from scipy.fft import dct, next_fast_len  # not at import: it takes 50 ms

        order = next_fast_len(int(orders_of(top, float(time[-1]))), real=True)
        angle = np.pi * (np.arange(order) + 0.5) / order
        coefficient = dct(response(top * (1 + np.cos(angle)) / 2), axis=0) / order
        coefficient[0] /= 2
        size = abs(coefficient).max(axis=1)
        count = int(np.append(0, 1 + np.flatnonzero(size > ROUNDING * size.max()))[-1])
        self.time, self.moved, self.coefficient = time, moved, coefficient[:count]
        left = np.append(size[:count][::-1].cumsum()[::-1], 0.0)
        self._left = left + ROUNDING * left[0]

    def left(self, orders: int) -> float:
        """The largest coefficients of further orders, added up; m s^2."""
        return float(self._left[orders])

    def orders(self, left: float) -> int:
        """The least number that leaves so much, or round-off."""
        return int(np.argmax(self._left <= max(left, self._left[-1])))

    def add(self, record: Floats, rows: Floats, first: int) -> None:
        """What the orders from `first` on give."""
        same_bits_product(self.coefficient[first : first + len(rows)].T, rows, record)


def orders_of(top: float, duration: float) -> float:
    """Number of Chebyshev orders beyond which the coefficients of a wave are negligible.

    `top`: upper end of the interval in omega^2, 1/s^2; `duration` of the wave in s.
    """
    return 1.1 * float(np.sqrt(top)) * duration / 2 + 60


class Resolvent:
    """Powers of 1 / w at each `frequency` (nf,), Hz, under the window exp(-gamma t), gamma in 1/s.

    With s = (omega + i gamma)^2, z = 2 s / top - 1 and w = z + (z^2 - 1)^1/2 outside of the circle.
    The error is relative to the largest of each kind at any frequency.
    """

    apart = True

    def __init__(self, frequency: Floats, gamma: float, top: float) -> None:
        self.frequency, self.moved = frequency, np.ones(len(frequency), complex)
        z = 2 * (2 * np.pi * frequency + 1j * gamma) ** 2 / top - 1
        root = np.sqrt(z * z - 1)
        w = np.where(abs(z + root) > 1, z + root, z - root)
        self._log = np.log(w)
        # A - s = top / 2 (X - z), hence the sign.
        self._scale = -8 / top / (w - 1 / w)
        # The sum of all further powers of 1 / |w|.
        self._sum = abs(self._scale) / (1 - 1 / abs(w))

    def left(self, orders: int) -> float:
        """The weights of further orders, added up; s^2."""
        left = (self._sum * np.exp(-self._log.real * orders)).max()
        return float(max(left, ROUNDING * self._sum.max()))

    def orders(self, left: float) -> int:
        """The least number that leaves so much, or round-off."""
        share = np.maximum(left, ROUNDING * self._sum.max()) / self._sum
        return int(np.ceil((-np.log(share) / self._log.real).max(initial=0.0)))

    def add(self, record: Complex, rows: Floats, first: int) -> None:
        """What the orders from `first` on give."""
        order = np.arange(first, first + len(rows))
        for start in range(0, len(record), CHUNK):
            part = slice(start, start + CHUNK)
            power = np.exp(-self._log[part, None] * order)
            power[:, order == 0] /= 2
            same_bits_product(self._scale[part, None] * power, rows, record[part])
