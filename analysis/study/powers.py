"""A power law for each group over its stresses, and how the powers change with void ratio."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from analysis.estimators.fits import power_law, straight_line
from analysis.frame import numbers

COLUMNS = "e", "power", "error", "cases", "moving", "whole"


@dataclass(frozen=True)
class Powers:
    """A line a group in `table`, by void ratio `e`: `power`, its standard `error`, its `cases`.

    `which_e` says of which states the void ratios are, `whole` whether no group and no case of any
    is missing.
    """

    table: pd.DataFrame
    which_e: str
    whole: bool

    @property
    def trend(self) -> tuple[float, float]:
        """Slope of the power over e by least squares, and its standard error; NaN if unknown."""
        line = straight_line(self.table["e"], self.table["power"])
        return float(line.slope), line.error

    def __str__(self) -> str:
        each = self.table[["power", "error", "e"]].itertuples(index=False)
        text = "power " + ", ".join(f"{p:.3f} ± {s:.1g} (e {e:.3f})" for p, s, e in each)
        slope, error = self.trend
        if len(self.table) > 1:
            text += f"; {self.which_e}; slope over e {slope:+.2f} ± {error:.1g}: "
            grows = slope > 2 * error
            text += "grows with e" if grows else "does not grow with e beyond twice the error"
        return text if self.whole else f"{text}; not all groups are whole"


def powers(frame: pd.DataFrame, x: str, y: str) -> Powers:
    """Quantity y as a power of quantity x within each group that has one."""
    names = {"x": x, "y": y, "rest": "void_ratio_of_state", "own": "void_ratio"}
    frame = frame.assign(**{name: numbers(frame, text) for name, text in names.items()})
    by_rest = bool(frame.loc[frame["y"].notna(), "rest"].notna().all())
    groups, lines = frame.sort_values("stress").groupby(["kind", "mu_comp"]), {}
    for (kind, mu), members in groups:
        law, known = power_law(members["x"], members["y"]), members[members["y"].notna()]
        if np.isfinite(law.exponent):
            first = known.iloc[0]
            e, moving = first["own"], False
            if by_rest:
                e, moving = first["rest"], bool(first["unsettled_of_state"])
            whole = len(known) == len(members)
            lines[f"{kind} {mu:g}"] = e, law.exponent, law.error, len(known), moving, whole
    table = pd.DataFrame.from_dict(lines, orient="index", columns=COLUMNS).sort_values("e")
    table = table.astype({"e": float, "power": float, "error": float, "whole": bool})
    which = "e at the lowest stress"
    if by_rest and lines:
        which = f"e at {frame['state_kpa'].iloc[0]:g} kPa"
        moving = table["moving"].sum()
        which += f", {moving} of {len(table)} states not settled" if moving else ""
    whole = len(table) == len(groups) and bool(table["whole"].all())
    return Powers(table, which, whole)
