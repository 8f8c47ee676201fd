"""Compare numbers with two bounds: find which are inside, and which is furthest off."""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

Spec = Mapping[str, Any]
"""Description of a target, or of one of its rules, as the file of targets has it."""


class Bounds(NamedTuple):
    """Lower and upper bound, each of which may be infinite, and the published value, or NaN."""

    low: float
    high: float
    stated: float


class Tolerance(NamedTuple):
    """A distance from a published value, in the unit of the value or in per cent of it."""

    size: float
    percent: bool

    @classmethod
    def parse(cls, text: str | float) -> "Tolerance":
        """Return the tolerance given by a text such as 0.01 or 2 %."""
        percent = re.fullmatch(r"([\d.]+) %", str(text))
        if percent:
            return cls(float(percent[1]), True)
        return cls(float(text), False)

    def around(self, value: float) -> tuple[float, float]:
        """Return the bounds around a value."""
        distance = self.size
        if self.percent:
            distance = self.size * abs(value) / 100
        return value - distance, value + distance

    def describe_deviation(self, value: float, stated: float) -> str:
        """Describe the deviation of a value from the stated one, in the tolerance's unit."""
        if self.percent:
            return f"{100 * (value / stated - 1):+.2f} %"
        return f"{value - stated:+.4f}"


class Comparison(NamedTuple):
    """Numbers compared with their bounds: which are inside, and which is furthest off.

    `deviation` describes the distance of a single number from the stated value; else None.
    """

    inside: pd.Series
    worst: Any
    value: float
    error: float
    deviation: str | None


def compare_with_bounds(
    values: pd.Series, errors: pd.Series, bounds: Bounds, rule: Spec
) -> Comparison:
    """Compare numbers with their bounds.

    The bounds are widened by `errors` standard errors, a setting of the rule.
    """
    # An unknown error, such as that of a power from two stresses, widens nothing.
    margin = rule.get("errors", 0) * errors.fillna(0)
    inside = values.between(bounds.low - margin, bounds.high + margin)
    worst = _distance(values, bounds, rule).idxmax()
    value = float(values[worst])
    within = rule.get("within")
    deviation = None
    if len(values) == 1 and within is not None and np.isfinite(bounds.stated):
        deviation = Tolerance.parse(within).describe_deviation(value, bounds.stated)
    return Comparison(inside, worst, value, float(errors[worst]), deviation)


def _distance(values: pd.Series, bounds: Bounds, rule: Spec) -> pd.Series:
    """Return the distance of values from the aim of the rule, by default the middle of the bounds.

    With a single finite bound there is no middle; the distance then grows towards the bound and
    beyond.
    """
    aim = rule.get("aim", (bounds.low + bounds.high) / 2)
    if np.isfinite(aim):
        return abs(values - aim)
    if bounds.high == np.inf:
        return -values
    return values
