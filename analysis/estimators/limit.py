"""What a straight line through means with errors tends to, and how far from it one of them lies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.tools.arrays import Floats


@dataclass(frozen=True)
class Limit:
    """A straight line through (n,) means, weighted with the inverse squares of their errors.

    `line`: its slope and its value at size 0, with their `covariance` (2, 2); `chi`: chi^2 a point
    to spare, NaN where there are two. Where chi^2 exceeds 1, the points scatter about the line by
    more than their errors say, and all variances are enlarged by it.
    """

    line: Floats
    covariance: Floats
    chi: float

    @property
    def value(self) -> float:
        """The value at size 0."""
        return float(self.line[1])

    @property
    def error(self) -> float:
        """Its standard error."""
        return float(np.sqrt(np.fmax(1.0, self.chi) * self.covariance[1, 1]))

    def distance(self, size: float, value: float, error: float) -> float:
        """How far one of the points lies from the limit, in standard errors of the difference.

        The point has drawn the line towards itself: the two share a part of their errors, whose
        covariance is that of the line's values at 0 and at `size`.
        """
        shared = self.covariance[1] @ [size, 1.0]
        variance = np.fmax(1.0, self.chi) * (error**2 + self.covariance[1, 1] - 2 * shared)
        return float((value - self.value) / np.sqrt(variance)) if variance > 0 else np.nan


def limit(size: Floats, value: Floats, error: Floats) -> Limit:
    """The line through means `value` (n,) at `size` (n,), which have standard errors `error` (n,).

    Points without an error do not count; NaN from fewer than two.
    """
    known = np.isfinite(value) & np.isfinite(error) & (error > 0)
    if known.sum() < 2:
        return Limit(np.full(2, np.nan), np.full((2, 2), np.nan), np.nan)
    x, y, weight = size[known], value[known], 1 / error[known]
    line, covariance = np.polyfit(x, y, 1, w=weight, cov="unscaled")
    left, spare = weight * (y - np.polyval(line, x)), known.sum() - 2
    return Limit(line, covariance, float((left**2).sum() / spare) if spare else np.nan)
