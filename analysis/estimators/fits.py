"""Straight lines, weighted or not, with the errors of what is read of them; power laws; summits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modal.tools.arrays import Floats


class PowerLaw(NamedTuple):
    """y = factor x^exponent; the exponent's standard error, NaN from fewer than three points."""

    factor: float
    exponent: float
    error: float = np.nan

    def __str__(self) -> str:
        text = f"b = {self.exponent:.4f}"
        return f"{text} ± {self.error:.1g}" if np.isfinite(self.error) else text


def straight_line(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slope and offset by least squares of the points that are known, and their covariance (2, 2).

    Of two points the covariance is NaN, of a single x all.
    """
    known = np.isfinite(x) & np.isfinite(y)
    x, y, unknown = np.asarray(x)[known], np.asarray(y)[known], np.full((2, 2), np.nan)
    if len(x) < 2 or np.ptp(x) == 0:
        return unknown[0], unknown
    if len(x) == 2:
        return np.polyfit(x, y, 1), unknown
    line, covariance = np.polyfit(x, y, 1, cov=True)
    return line, covariance


def power_law(x: np.ndarray, y: np.ndarray) -> PowerLaw:
    """Least squares of the logarithms; NaN from a single x, and of what has no logarithm."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    known = np.isfinite(x) & np.isfinite(y)
    if (np.minimum(x, y)[known] <= 0).any():
        return PowerLaw(np.nan, np.nan)
    (exponent, offset), spread = straight_line(np.log(x[known]), np.log(y[known]))
    return PowerLaw(float(np.exp(offset)), float(exponent), float(np.sqrt(spread[0, 0])))


def straight_to(x: np.ndarray, y: np.ndarray, at: float) -> tuple[float, float]:
    """The least-squares line of y over x, carried on to `at`, and its standard error there.

    Of two points the line has no error, of a single one no value: NaN.

    >>> "{:.1f} {:.1f}".format(*straight_to(np.array([0.0, 1.0]), np.array([0.0, 3.0]), 4.0))
    '12.0 nan'
    """
    (line, spread), there = straight_line(x, y), np.array([at, 1.0])
    return float(there @ line), float(np.sqrt(there @ spread @ there))


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


def summit(before: np.ndarray, top: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """Where the parabola through three values at -1, 0, 1 has its extreme value."""
    return 0.5 * (before - behind) / (before - 2 * top + behind)
