"""A power law for each friction over its stresses, and how the powers change with void ratio."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from analysis.paper import FRICTIONS, STRESSES
from analysis.rows import Row, groups_of, law_of


@dataclass(frozen=True)
class Powers:
    """Of each friction, in order of void ratio: e, the power and its standard error, all (k,).

    `of_1_kpa`: whether each e is that of the state under 1 kPa, by which the paper groups, and not
    under the lowest stress at hand; of the former `unsettled` ones are not at rest. `whole`: all
    frictions of the study over all its stresses.
    """

    e: np.ndarray
    power: np.ndarray
    error: np.ndarray
    of_1_kpa: bool
    unsettled: int
    whole: bool

    @property
    def which_e(self) -> str:
        """Of which states the void ratios are."""
        if not self.of_1_kpa:
            return "e at the lowest stress"
        left = f", {self.unsettled} of {len(self.e)} states not settled" if self.unsettled else ""
        return f"e at 1 kPa{left}"

    @property
    def trend(self) -> tuple[float, float]:
        """Slope of the power over e by least squares, and its standard error; NaN if unknown."""
        count, spread = len(self.e), ((self.e - self.e.mean()) ** 2).sum()
        if count < 2 or spread == 0:
            return np.nan, np.nan
        slope, offset = np.polyfit(self.e, self.power, 1)
        if count == 2:
            return float(slope), np.nan
        left = self.power - slope * self.e - offset
        return float(slope), float(np.sqrt(left @ left / (count - 2) / spread))

    @property
    def grows(self) -> bool:
        """Whether the power grows with e by more than twice the standard error of the slope."""
        slope, error = self.trend
        return bool(slope > 2 * error)

    def __str__(self) -> str:
        each = zip(self.power, self.error, self.e, strict=True)
        text = ", ".join(f"{p:.3f} ± {s:.1g} (e {e:.3f})" for p, s, e in each)
        slope, error = self.trend
        text += f"; {self.which_e}; slope over e {slope:+.2f}"
        if np.isfinite(error):
            text += f" ± {error:.1g}: "
            text += "grows with e" if self.grows else "does not grow with e beyond twice the error"
        else:
            text += ", of two frictions, without an error: whether it grows with e is not known"
        if not self.whole:
            text += f"; {len(self.e)} of {len(FRICTIONS)} frictions, not all over four stresses"
        return text


def powers(rows: Iterable[Row], x: str, y: str) -> Powers | None:
    """Column y as a power of column x within each friction; None where no friction has one."""
    found = []
    for members in groups_of(rows).values():
        law = law_of(members, x, y)
        if np.isfinite(law.exponent):
            at_1_kpa = members[0].value("void_ratio_at_1_kpa")
            known = bool(np.isfinite(at_1_kpa))
            count = sum(bool(np.isfinite(row.value(y))) for row in members)
            e = at_1_kpa if known else members[0].value("void_ratio")
            moving = bool(members[0].texts.get("unsettled_at_1_kpa"))
            found.append((e, law.exponent, law.error, known, moving, count == len(STRESSES)))
    if not found:
        return None
    found.sort()
    voids, powers_, errors, all_known, unsettled, complete = map(np.array, zip(*found, strict=True))
    whole = len(found) == len(FRICTIONS) and bool(complete.all())
    return Powers(voids, powers_, errors, bool(all_known.all()), int(unsettled.sum()), whole)
