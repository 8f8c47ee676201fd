"""Weights of the Chebyshev polynomials in what is recorded: of a wave, and of a response.

Both are a `Series` of `modal.waves.chebyshev`, for omega^2 from zero to `top`, 1/s^2.
"""

from __future__ import annotations

import numpy as np

from modal.solvers.same_bits import same_bits_product
from modal.tools.arrays import Complex, Floats
from modal.waves.chebyshev import ROUNDING
from modal.waves.source import Motion

CHUNK = 256
"""Frequencies evaluated at a time, to bound the memory."""


class Expansion:
    """Chebyshev coefficients of y(top (1 + x) / 2, t) of a motion, at `time` (nt,), s.

    `coefficient` (count, nt), m s^2, of all orders that round-off does not hide.
    """

    def __init__(self, motion: Motion, time: Floats, top: float) -> None:
        order = fast_length(orders_of(top, float(time[-1])))
        angle = np.pi * (np.arange(order) + 0.5) / order
        response = motion.response(top * (1 + np.cos(angle)) / 2, time)
        coefficient = _cosines(response) / order
        coefficient[0] /= 2
        size = abs(coefficient).max(axis=1)
        count = int(np.append(0, 1 + np.flatnonzero(size > ROUNDING * size.max()))[-1])
        self.time, self.coefficient = time, coefficient[:count]
        left = np.append(size[:count][::-1].cumsum()[::-1], 0.0)
        self._left = left + ROUNDING * left[0]

    def empty(self, count: int) -> Floats:
        """Shape (nt, count)."""
        return np.zeros((len(self.time), count))

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


def fast_length(order: float) -> int:
    """The next number without prime factors above 5, whose Fourier transform is fast."""
    odd = (3**a * 5**b for a in range(21) for b in range(21))
    return min(part << ((int(order) - 1) // part).bit_length() for part in odd)


def _cosines(values: Floats) -> Floats:
    """Twice the sum of values (N, nt) times cos(pi k (n + 1/2) / N) over n, for each k < N.

    A Fourier transform of the even rows, then the odd ones backwards (J. Makhoul, IEEE Trans.
    Acoust. Speech Signal Process. 28, 27, 1980). scipy.fft would take a tenth of a second to load.
    """
    count = len(values)
    half = np.fft.rfft(np.concatenate([values[::2], values[1::2][::-1]]), axis=0)
    half *= 2 * np.exp(-0.5j * np.pi * np.arange(len(half)) / count)[:, None]
    whole = np.empty_like(values)
    whole[: len(half)] = half.real
    # The transform of real rows: what stands at N - k is conjugate to k.
    whole[len(half) :] = -half.imag[count - len(half) : 0 : -1]
    return whole


class Resolvent:
    """Powers of 1 / w at each `frequency` (nf,), Hz, under the window exp(-gamma t), gamma in 1/s.

    With s = (omega + i gamma)^2, z = 2 s / top - 1 and w = z + (z^2 - 1)^1/2 outside of the circle.
    """

    def __init__(self, frequency: Floats, gamma: float, top: float) -> None:
        self.frequency = frequency
        z = 2 * (2 * np.pi * frequency + 1j * gamma) ** 2 / top - 1
        root = np.sqrt(z * z - 1)
        w = np.where(abs(z + root) > 1, z + root, z - root)
        self._log = np.log(w)
        # A - s = top / 2 (X - z), hence the sign.
        self._scale = -8 / top / (w - 1 / w)
        # The sum of all further powers of 1 / |w|.
        self._sum = abs(self._scale) / (1 - 1 / abs(w))

    def empty(self, count: int) -> Complex:
        """Shape (nf, count)."""
        return np.zeros((len(self.frequency), count), complex)

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
