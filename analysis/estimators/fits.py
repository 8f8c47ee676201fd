"""Fit straight lines and power laws with their errors; find summits."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modal.tools.arrays import Floats


class PowerLaw(NamedTuple):
    """A power law y = factor x^exponent.

    error: the standard error of the exponent, NaN for fewer than three points.
    """

    factor: float
    exponent: float
    error: float = np.nan

    def __str__(self) -> str:
        text = f"b = {self.exponent:.4f}"
        if np.isfinite(self.error):
            text += f" ± {self.error:.1g}"
        return text


@dataclass(frozen=True)
class Line:
    """A straight line by least squares, value = slope x + offset.

    Attributes
    ----------
    slope, offset : float
    covariance : ndarray (2, 2)
        Covariance of slope and offset. If `chi` exceeds 1, the points scatter about the line by
        more than their errors, and the covariance has been multiplied by `chi`.
    chi : float
        chi^2 per degree of freedom; NaN for two points and for points without errors.
    """

    slope: float
    offset: float
    covariance: Floats
    chi: float = np.nan

    @property
    def error(self) -> float:
        """Return the standard error of the line's slope."""
        return float(np.sqrt(self.covariance[0, 0]))

    def at(self, x: float) -> tuple[float, float]:
        """Return the value of the line at x, and its standard error."""
        gradient = np.array([x, 1.0])
        value = gradient @ [self.slope, self.offset]
        return float(value), float(np.sqrt(gradient @ self.covariance @ gradient))

    def distance(self, x: float, value: float, error: float) -> float:
        """Return how far a fitted point lies from the line's offset, in standard errors.

        The point at x, with its `value` and `error`, was used in the fit. Therefore the errors of
        offset and point are correlated; their covariance is that of the line's values at 0 and x.
        The result is NaN if the variance of the difference is not positive.
        """
        point_variance = np.fmax(1.0, self.chi) * error**2
        shared = self.covariance[1] @ [x, 1.0]
        variance = point_variance + self.covariance[1, 1] - 2 * shared
        if not variance > 0:
            return np.nan
        return float((value - self.offset) / np.sqrt(variance))


def straight_line(x: Floats, y: Floats, error: Floats | None = None) -> Line:
    """Fit a line to the points (n,) whose coordinates are finite.

    With standard errors `error` (n,) of y, points are weighted, and those without a positive error
    are left out. All numbers are NaN for fewer than two points and for a single x; without errors
    the covariance is NaN for two points.

    >>> line = straight_line(np.array([0.0, 1.0]), np.array([0.0, 3.0]))
    >>> "{:.1f} {:.1f}".format(*line.at(4.0))
    '12.0 nan'
    """
    known = np.isfinite(x) & np.isfinite(y)
    if error is not None:
        known &= np.isfinite(error) & (error > 0)
    x = np.asarray(x)[known]
    y = np.asarray(y)[known]
    if len(x) < 2 or np.ptp(x) == 0:
        return Line(np.nan, np.nan, np.full((2, 2), np.nan))
    weight = np.ones(len(x))
    if error is not None:
        weight = 1 / error[known]
    (slope, offset), covariance = np.polyfit(x, y, 1, w=weight, cov="unscaled")
    residual = weight * (y - slope * x - offset)
    degrees_of_freedom = len(x) - 2
    chi = np.nan
    if degrees_of_freedom:
        chi = float((residual**2).sum() / degrees_of_freedom)
    if error is None:  # the scatter alone gives the errors
        return Line(slope, offset, chi * covariance)
    return Line(slope, offset, np.fmax(1.0, chi) * covariance, chi)


def power_law(x: Floats, y: Floats) -> PowerLaw:
    """Fit a power law to points (n,) by least squares of the logarithms.

    Points that are not finite are left out. The law is NaN for a single x, and if any other x or y
    is not positive.
    """
    x = np.asarray(x, float)
    y = np.asarray(y, float)
    known = np.isfinite(x) & np.isfinite(y)
    if (np.minimum(x, y)[known] <= 0).any():
        return PowerLaw(np.nan, np.nan)
    line = straight_line(np.log(x[known]), np.log(y[known]))
    return PowerLaw(float(np.exp(line.offset)), float(line.slope), line.error)


def summit(before: Floats, top: Floats, behind: Floats) -> Floats:
    """Return the position of the extremum of a parabola through values at -1, 0 and 1."""
    return 0.5 * (before - behind) / (before - 2 * top + behind)
