"""A power law for each group over its stresses, and how the powers change with void ratio."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from analysis.estimators.power_law import power_law, straight_line
from analysis.study.selection import numbers


@dataclass(frozen=True)
class Powers:
    """Of each group, by void ratio: `e`, `power` and its standard error, all (k,), and `count`.

    `which_e` says of which states the void ratios are, `whole` whether no group and no case of any
    is missing.
    """

    e: np.ndarray
    power: np.ndarray
    error: np.ndarray
    count: np.ndarray
    which_e: str
    whole: bool

    @property
    def trend(self) -> tuple[float, float]:
        """Slope of the power over e by least squares, and its standard error; NaN if unknown."""
        (slope, _), spread = straight_line(self.e, self.power)
        return float(slope), float(np.sqrt(spread[0, 0]))

    @property
    def grows(self) -> bool:
        """Whether the power grows with e by more than twice the standard error of the slope."""
        slope, error = self.trend
        return bool(slope > 2 * error)

    def __str__(self) -> str:
        each = zip(self.power, self.error, self.e, strict=True)
        text = ", ".join(f"{p:.3f} ± {s:.1g} (e {e:.3f})" for p, s, e in each)
        slope, error = self.trend
        if len(self.e) > 1:
            text += f"; {self.which_e}; slope over e {slope:+.2f}"
        if np.isfinite(error):
            text += f" ± {error:.1g}: "
            text += "grows with e" if self.grows else "does not grow with e beyond twice the error"
        elif len(self.e) == 2:
            text += ", of two groups, without an error: whether it grows with e is not known"
        return text if self.whole else f"{text}; {len(self.e)} groups, not all of them whole"


def powers(frame: pd.DataFrame, x: str, y: str) -> Powers | None:
    """Quantity y as a power of quantity x within each group; None where no group has one."""
    of_state = numbers(frame, "void_ratio_of_state")
    frame = frame.assign(x=numbers(frame, x), y=numbers(frame, y), e=of_state)
    by_rest = bool(frame.loc[np.isfinite(frame["y"]), "e"].notna().all())
    moving, found, groups = 0, [], 0
    for _, members in frame.groupby(["kind", "mu_comp"]):
        members = members.sort_values("stress")
        law = power_law(members["x"].to_numpy(float), members["y"].to_numpy(float))
        groups += 1
        if np.isfinite(law.exponent):
            known = members[np.isfinite(members["y"])]
            e = members["e"].iloc[0] if by_rest else numbers(known, "void_ratio").iloc[0]
            moving += bool(by_rest and known["unsettled_of_state"].iloc[0])
            found.append((e, law.exponent, law.error, len(known), len(known) == len(members)))
    if not found:
        return None
    e, power, error, count, complete = map(np.array, zip(*sorted(found), strict=True))
    which = "e at the lowest stress"
    if by_rest:
        which = f"e at {frame['state_kpa'].iloc[0]:g} kPa"
        which += f", {moving} of {len(e)} states not settled" if moving else ""
    whole = len(found) == groups and bool(complete.all())
    return Powers(e, power, error, count, which, whole)
