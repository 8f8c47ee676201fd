"""Expand a recorded motion in Chebyshev polynomials of A, with a bound of its error.

A record is a sum over the orders k of weights, one for each time or frequency, times moments. The
moments are the readings of the receivers for the vectors T_k(X) c, with X = 2 A / top - 1. Since
|T_k(X) c| <= |c|, a truncated sum lacks at most the sum of the remaining weights, times |c|, times
the length of the receiver's row. Terms are added until this bound is below the tolerance times the
largest value of the record so far. The weights of a wave (`Expansion`) and of a response
(`Resolvent`) are for omega^2 from zero to `top`, 1/s^2.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np
import scipy.sparse as sp

from modal.solvers.chebyshev import chebyshev
from modal.solvers.same_bits import same_bits_product
from modal.solvers.spectrum import GrowthError, largest_growth, norm
from modal.system.operator import ContactOperator
from modal.tools.arrays import Array, Complex, Floats
from modal.tools.errors import UnavailableError
from modal.tools.progress import progress
from modal.waves.forced_system import ForcedSystem

PRODUCTS_BETWEEN_CHECKS = 50
"""Number of products with A between two checks of the growth of a recurrence."""
ROUND_OFF = np.finfo(float).eps
"""Round-off of the weights, divided by the sum of all of them."""
CHUNK = 256
"""Number of times or frequencies that are evaluated together, which bounds the memory."""


AnySeries = TypeVar("AnySeries", "Expansion", "Resolvent")
"""Either series of weights of the orders: one set for each time or frequency."""


class Summation(NamedTuple, Generic[AnySeries]):
    """The result of summing a series.

    series: the weights. record (k, count): the sum. products: number of products with K. error:
    bound of the truncation error, relative to the largest force and the largest motion of the
    record.
    """

    series: AnySeries
    record: Array
    products: int
    error: float


def readings(
    operator: ContactOperator,
    states: Iterator[tuple[int, Floats]],
    receivers: sp.csr_matrix,
    length: float,
    count: int,
) -> Floats:
    """Return the readings (count, receivers) of `receivers` for the next `count` states.

    The `states` yield k and T_k(X) c; `length` is that of c. Raises GrowthError if the states grow,
    because modes lie outside of the interval.
    """
    rows = np.empty((count, receivers.shape[0]))
    for row in progress(count, "wave"):
        k, state = next(states)
        rows[row] = receivers @ state
        checked = k % PRODUCTS_BETWEEN_CHECKS == PRODUCTS_BETWEEN_CHECKS - 1 or row == count - 1
        if checked and not norm(state) <= largest_growth(operator, k) * length:
            raise GrowthError
    return rows


def summed(
    forced: ForcedSystem, series_for: Callable[[float], Sequence[AnySeries]], tolerance: float
) -> list[Summation[AnySeries]]:
    """Sum each series up to a relative error of `tolerance`, with common products with K.

    `series_for` returns the series for the `top` of an interval in omega^2, 1/s^2. The error is
    relative to `ForcedSystem.largest` of each series' own record, and exceeds `tolerance` only if
    round-off is larger. Raises GrowthError if K has negative directions, InputError if there is no
    stiffness.
    """
    operator = forced.springs.operator
    top, products = forced.system.spectral_bound_and_cost
    if top == 0:
        raise UnavailableError(
            "no_stiffness", "the network has no stiffness", remedy="no wave goes through it"
        )
    all_series = series_for(top)
    records = [forced.blank(series.moved) for series in all_series]
    start = forced.springs.push.toarray()[0]
    length = norm(start)
    states = enumerate(chebyshev(operator, start, 2 / top, -1.0))
    max_reading = largest_growth(operator, 0) * length * forced.reach
    orders_done = 0
    # No record exceeds what all weights together allow, so that at least this many orders count.
    orders = max(series.orders(tolerance * series.left(0)) for series in all_series)
    while True:
        rows = readings(operator, states, forced.springs.rows, length, orders - orders_done)
        errors = []
        for series, record in zip(all_series, records, strict=True):
            series.add(record, rows, orders_done)
            left = series.left(orders) * max_reading
            largest = forced.largest(record, apart=series.apart)
            with np.errstate(divide="ignore"):
                relative = np.divide(left, largest, out=0 * left, where=left > 0)
            errors.append(float(relative.max()))
        orders_done = orders
        for series, error in zip(all_series, errors, strict=True):
            if error > tolerance:
                needed = series.orders(series.left(orders_done) * tolerance / error)
                orders = max(orders, needed)
        if orders <= orders_done:
            break
    products += max(orders_done - 1, 0)
    summations = []
    for series, record, error in zip(all_series, records, errors, strict=True):
        summations.append(Summation(series, record, products, error))
    return summations


class Expansion:
    """The Chebyshev coefficients of an oscillator's motion y(top (1 + x) / 2, t).

    The error is relative to the larger of both stresses, because the wave may not have reached the
    receiver wall.

    Attributes
    ----------
    time : ndarray (nt,)
        Times, s.
    moved : ndarray (nt,)
        Displacement of the source, m.
    coefficient : ndarray (count, nt)
        Coefficients, m s^2, of all orders above round-off.
    """

    apart = False

    def __init__(
        self, response: Callable[[Floats], Floats], time: Floats, moved: Floats, top: float
    ) -> None:
        """Expand `response`, which maps omega^2 (nw,), 1/s^2, to y (nw, nt), m s^2."""
        min_orders = math.ceil(orders_of(top, float(time[-1])))
        # At most 31 times a power of two, of which the Fourier transform is fast.
        power_of_two = 1 << (min_orders.bit_length() - 5)
        orders = power_of_two * math.ceil(min_orders / power_of_two)
        angle = np.pi * (np.arange(orders) + 0.5) / orders
        coefficient = cosines(response(top * (1 + np.cos(angle)) / 2)) / orders
        coefficient[0] /= 2
        size = abs(coefficient).max(axis=1)
        significant = np.flatnonzero(size > ROUND_OFF * size.max())
        count = int(np.append(0, 1 + significant)[-1])
        self.time = time
        self.moved = moved
        self.coefficient = coefficient[:count]
        left = np.append(size[:count][::-1].cumsum()[::-1], 0.0)
        self._left = left + ROUND_OFF * left[0]

    def left(self, orders: int) -> float:
        """Return the sum of the largest coefficients of all orders from `orders` on, m s^2."""
        return float(self._left[min(orders, len(self._left) - 1)])

    def orders(self, left: float) -> int:
        """Return the least number of orders whose remaining sum is at most `left`, or round-off."""
        return int(np.argmax(self._left <= max(left, self._left[-1])))

    def add(self, record: Floats, rows: Floats, first: int) -> None:
        """Add to a record the terms of the orders from `first` on, whose moments are `rows`.

        Orders below round-off have no coefficient and are ignored.
        """
        coefficient = self.coefficient[first : first + len(rows)]
        same_bits_product(coefficient.T, rows[: len(coefficient)], record)


def orders_of(top: float, duration: float) -> float:
    """Return the number of orders beyond which the coefficients of a wave are negligible.

    `top` is the upper end of the interval in omega^2, 1/s^2; `duration` is the length of the
    record, s.
    """
    return 1.1 * float(np.sqrt(top)) * duration / 2 + 60


def cosines(values: Floats) -> Floats:
    """Return twice the sum over n of values (N, nt) times cos(pi k (n + 1/2) / N), for each k < N.

    N is even. The cosine transform is a Fourier transform of the even rows, followed by the odd
    ones backwards (J. Makhoul, IEEE Trans. Acoust. Speech Signal Process. 28, 27, 1980). scipy.fft
    is not used, because loading it takes as long as a hundred products with K of 35,201 spheres.
    """
    count = len(values)
    result = np.empty_like(values)
    phase = 2 * np.exp(-0.5j * np.pi * np.arange(count // 2 + 1) / count)[:, None]
    for start in range(0, values.shape[1], CHUNK):
        columns = values[:, start : start + CHUNK]
        reordered = np.concatenate([columns[::2], columns[1::2][::-1]])
        half = phase * np.fft.rfft(reordered, axis=0)
        # The rows are real: the transform at N - k is the conjugate of that at k.
        result[:, start : start + CHUNK] = np.concatenate([half.real, -half.imag[-2:0:-1]])
    return result


class Resolvent:
    """The weights of a frequency response under the window exp(-gamma t): powers of 1 / w.

    With s = (omega + i gamma)^2, z = 2 s / top - 1 and w = z + (z^2 - 1)^1/2 outside of the unit
    circle. The error is relative to the largest value of each kind at any frequency.

    Attributes
    ----------
    frequency : ndarray (nf,)
        Frequencies, Hz.
    moved : ndarray (nf,)
        Ones: the response is per unit motion of the source.
    """

    apart = True

    def __init__(self, frequency: Floats, gamma: float, top: float) -> None:
        """Prepare the weights at frequencies (nf,), Hz, under a window of `gamma`, 1/s."""
        self.frequency = frequency
        self.moved = np.ones(len(frequency), complex)
        z = 2 * (2 * np.pi * frequency + 1j * gamma) ** 2 / top - 1
        root = np.sqrt(z * z - 1)
        w = np.where(abs(z + root) > 1, z + root, z - root)
        self._log = np.log(w)
        # A - s = top / 2 (X - z), hence the sign.
        self._scale = -8 / top / (w - 1 / w)
        # The sum of all powers of 1 / |w|.
        self._sum = abs(self._scale) / (1 - 1 / abs(w))

    def left(self, orders: int) -> float:
        """Return the sum of the weights of all orders from `orders` on, s^2."""
        left = (self._sum * np.exp(-self._log.real * orders)).max()
        return float(max(left, ROUND_OFF * self._sum.max()))

    def orders(self, left: float) -> int:
        """Return the least number of orders whose remaining sum is at most `left`, or round-off."""
        share = np.maximum(left, ROUND_OFF * self._sum.max()) / self._sum
        return int(np.ceil((-np.log(share) / self._log.real).max(initial=0.0)))

    def add(self, record: Complex, rows: Floats, first: int) -> None:
        """Add to a record the terms of the orders from `first` on, whose moments are `rows`."""
        order = np.arange(first, first + len(rows))
        for start in range(0, len(record), CHUNK):
            part = slice(start, start + CHUNK)
            power = np.exp(-self._log[part, None] * order)
            power[:, order == 0] /= 2
            same_bits_product(self._scale[part, None] * power, rows, record[part])
