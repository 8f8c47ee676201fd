"""Straight lines, weighted or not, with the errors of what is read of them; power laws; summits."""

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


@dataclass(frozen=True)
class Line:
    """A straight line by least squares, and the `covariance` (2, 2) of its slope and offset.

    Where points have errors, `chi` is chi^2 a point to spare, NaN where there are two. Where it
    exceeds 1, they scatter about the line by more than their errors say, and the covariance is
    enlarged by it.
    """

    slope: float
    offset: float
    covariance: Floats
    chi: float = np.nan

    @property
    def error(self) -> float:
        """Standard error of the slope."""
        return float(np.sqrt(self.covariance[0, 0]))

    def at(self, x: float) -> tuple[float, float]:
        """The value at x, and its standard error."""
        there = np.array([x, 1.0])
        value = there @ [self.slope, self.offset]
        return float(value), float(np.sqrt(there @ self.covariance @ there))

    def distance(self, x: float, value: float, error: float) -> float:
        """How far one of the points lies from the value at 0, in standard errors of the difference.

        The point has drawn the line towards itself: the two share a part of their errors, whose
        covariance is that of the line's values at 0 and at x.
        """
        own, shared = np.fmax(1.0, self.chi) * error**2, self.covariance[1] @ [x, 1.0]
        variance = own + self.covariance[1, 1] - 2 * shared
        return float((value - self.offset) / np.sqrt(variance)) if variance > 0 else np.nan


def straight_line(x: Floats, y: Floats, error: Floats | None = None) -> Line:
    """The line through the points that are known, weighted where y has standard errors `error`.

    NaN of fewer than two points and of a single x; without errors, of two points the covariance.

    >>> line = straight_line(np.array([0.0, 1.0]), np.array([0.0, 3.0]))
    >>> "{:.1f} {:.1f}".format(*line.at(4.0))
    '12.0 nan'
    """
    known = np.isfinite(x) & np.isfinite(y)
    if error is not None:
        known &= np.isfinite(error) & (error > 0)
    x, y = np.asarray(x)[known], np.asarray(y)[known]
    if len(x) < 2 or np.ptp(x) == 0:
        return Line(np.nan, np.nan, np.full((2, 2), np.nan))
    weight = np.ones(len(x)) if error is None else 1 / error[known]
    (slope, offset), covariance = np.polyfit(x, y, 1, w=weight, cov="unscaled")
    left, spare = weight * (y - slope * x - offset), len(x) - 2
    chi = float((left**2).sum() / spare) if spare else np.nan
    if error is None:  # the scatter alone says what it is
        return Line(slope, offset, chi * covariance)
    return Line(slope, offset, np.fmax(1.0, chi) * covariance, chi)


def power_law(x: Floats, y: Floats) -> PowerLaw:
    """Least squares of the logarithms; NaN from a single x, and of what has no logarithm."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    known = np.isfinite(x) & np.isfinite(y)
    if (np.minimum(x, y)[known] <= 0).any():
        return PowerLaw(np.nan, np.nan)
    line = straight_line(np.log(x[known]), np.log(y[known]))
    return PowerLaw(float(np.exp(line.offset)), float(line.slope), line.error)


def summit(before: Floats, top: Floats, behind: Floats) -> Floats:
    """Where the parabola through three values at -1, 0, 1 has its extreme value."""
    return 0.5 * (before - behind) / (before - 2 * top + behind)
