"""What is recorded of a motion, as a sum over Chebyshev polynomials of A, and its error.

A record is the sum over the orders k of weights, one for each time or frequency, times moments:
what the receivers read of T_k(X) c, X = 2 A / top - 1. As |T_k(X) c| <= |c|, what is left out of a
record by ending the sum is at most the sum of the further weights, times |c|, times the length of
the receiver's row. The sum goes on until that is below the tolerance times the largest of the
record itself, which is known by then.
The weights of a wave (`Expansion`) and of a response (`Resolvent`) are for omega^2
from zero to `top`, 1/s^2.
"""

import math
from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
import scipy.sparse as sp

from modal.solvers.chebyshev import chebyshev
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


def readings(
    operator: ContactOperator,
    states: Iterator[tuple[int, Floats]],
    receivers: sp.csr_matrix,
    length: float,
    count: int,
) -> Floats:
    """Shape (count, receivers): what rows read of the next `states`, each T_k(X) c with its order.

    `length` is that of c. GrowthError where they grow, as they do when modes lie outside of the
    interval.
    """
    rows = np.empty((count, receivers.shape[0]))
    for row in progress(count, "wave"):
        k, now = next(states)
        rows[row] = receivers @ now
        looked_at = k % LOOK == LOOK - 1 or row == count - 1
        if looked_at and not norm(now) <= largest_growth(operator, k) * length:
            raise GrowthError
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
    series, done = series_for(top), 0
    start = driven.springs.push.toarray()[0]
    length = norm(start)
    states = enumerate(chebyshev(operator, start, 2 / top, -1.0))
    most = largest_growth(operator, 0) * length * driven.reach
    record = driven.blank(series.moved)
    # No record is larger than all weights together allow: it takes so many orders at least.
    orders = series.orders(tolerance * series.left(0))
    while True:
        rows = readings(operator, states, driven.springs.rows, length, orders - done)
        series.add(record, rows, done)
        done = orders
        left, whole = series.left(done) * most, driven.largest(record, apart=series.apart)
        with np.errstate(divide="ignore"):
            error = float(np.divide(left, whole, out=0 * left, where=left > 0).max())
        if error > tolerance:
            orders = series.orders(series.left(done) * tolerance / error)
        if error <= tolerance or orders <= done:
            return series, record, products + max(done - 1, 0), error


CHUNK = 256
"""Times or frequencies evaluated at a time, to bound the memory."""


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
        order = math.ceil(orders_of(top, float(time[-1])))
        # At most 31 times a power of two, of which the Fourier transform is fast.
        even = 1 << (order.bit_length() - 5)
        order = even * math.ceil(order / even)
        angle = np.pi * (np.arange(order) + 0.5) / order
        coefficient = cosines(response(top * (1 + np.cos(angle)) / 2)) / order
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


def cosines(values: Floats) -> Floats:
    """Twice the sum of values (N, nt) times cos(pi k (n + 1/2) / N) over n, for each k < N, even.

    A Fourier transform of the even rows, then the odd ones backwards (J. Makhoul, IEEE Trans.
    Acoust. Speech Signal Process. 28, 27, 1980). scipy.fft has it, but to load it takes as long as
    a hundred products with K of 35,201 spheres.
    """
    count, result = len(values), np.empty_like(values)
    turn = 2 * np.exp(-0.5j * np.pi * np.arange(count // 2 + 1) / count)[:, None]
    for start in range(0, values.shape[1], CHUNK):
        part = values[:, start : start + CHUNK]
        half = turn * np.fft.rfft(np.concatenate([part[::2], part[1::2][::-1]]), axis=0)
        # The transform is of real rows: what stands at N - k is conjugate to k.
        result[:, start : start + CHUNK] = np.concatenate([half.real, -half.imag[-2:0:-1]])
    return result


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
