"""Power laws, as of velocity over stress, by least squares of the logarithms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PowerLaw:
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
