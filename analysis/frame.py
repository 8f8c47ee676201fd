"""The cases of a study, or of a call, one line each: numbers by name, and expressions of them.

And a power law for each group over its stresses, and how the powers change with void ratio.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from analysis.estimators.fits import power_law, straight_line
from analysis.expressions import UnknownNameError, evaluate, names_in, short
from analysis.mean import mean_of_values
from analysis.rows import CaseResult
from analysis.value import COMMON, Value
from modal.tools.arrays import Floats
from modal.tools.errors import InputError


def frame_of(rows: Iterable[CaseResult], cases: pd.DataFrame | None = None) -> pd.DataFrame:
    """The study's cases, one line each, with all numbers; NaN where a case has no result.

    Columns besides those of `cases` (what a study says of each; without one what the rows say):
    `there`; the words of its result (`record`, `group`, `unsettled`, ...) and the `row` itself;
    each quantity, `QUANTITY_error`, the part of it that is `QUANTITY_common` to all packings,
    `QUANTITY_spread`, which is the scatter of samples where that is larger, and
    `QUANTITY_sample_error`; `plateau_NAME`. The numbers of states that are no cases
    stand beside all cases of their compression, their stress in the name: `void_ratio_at_1_kpa`; of
    the lowest also as `void_ratio_of_state`, `state_kpa`, ...
    """
    rows = list(rows)
    if cases is None:
        own = {r.name: (("random", "fcc")[r.crystal], r.mu_comp, r.stress) for r in rows}
        cases = pd.DataFrame.from_dict(own, "index", columns=["kind", "mu_comp", "stress"])
    lines = {row.name: _line(row) for row in rows if not row.state}
    found = pd.DataFrame.from_dict(lines, orient="index").reindex(cases.index)
    found["there"] = cases.index.isin(list(lines))
    # A quantity that is called as a setting, `particles`, is what was measured.
    frame = cases.drop(columns=cases.columns.intersection(found.columns)).join(found).copy()
    for state in sorted((row for row in rows if row.state), key=lambda row: -row.stress):
        same = (frame["mu_comp"] == state.mu_comp) & (frame["kind"] == "random")
        numbers: dict[str, Any] = {name: cell.value for name, cell in state.columns.items()}
        for name, value in (numbers | {"unsettled": state.unsettled}).items():
            columns = [f"{name}_at_{state.stress / 1e3:g}_kpa", f"{name}_of_state"]
            frame.loc[same, columns] = value
        frame.loc[same, "state_kpa"] = state.stress / 1e3
    return frame


def _line(row: CaseResult) -> dict[str, Any]:
    """A result as one line of the frame."""
    words = "label", "record", "unsettled", "group", "packings"
    line: dict[str, Any] = {name: getattr(row, name) for name in words}
    line |= {"absent": " ".join(row.absent), "row": row}
    line |= {f"{name}_text": text for name, text in row.texts.items()}
    for name, cell in row.columns.items():
        line[name] = cell.value
        line[f"{name}_error"] = cell.error
        line[f"{name}_spread"] = float(np.fmax(cell.error, row.samples.get(name, np.nan)))
        if cell.common:
            line[f"{name}_common"] = cell.common
    line |= {f"{name}_sample_error": value for name, value in row.samples.items()}
    return line | {f"plateau_{name}": flat for name, flat in row.flat.items()}


def select(frame: pd.DataFrame, text: str) -> pd.DataFrame:
    """Return the cases that an expression of their columns is true of; all for an empty one."""
    if text == "":
        return frame
    chosen = evaluate(text, frame)
    if not isinstance(chosen, pd.Series) or chosen.dtype != bool:
        raise InputError(
            "selection",
            "select",
            f"{short(text)}: is true or false of no case",
            "write as stress == 1e5",
        )
    return frame[chosen]


def numbers(frame: pd.DataFrame, text: str) -> pd.Series:
    """Return a quantity of each case, or an expression of quantities; NaN where not known."""
    unknown = pd.Series(np.nan, frame.index)
    if isinstance(text, str) and text in frame.columns:
        return pd.to_numeric(frame[text], errors="coerce")
    if isinstance(text, str) and text.isidentifier():
        return unknown
    try:
        value = evaluate(text, frame)
    except UnknownNameError:
        return unknown
    if isinstance(value, bool | float):
        return unknown.fillna(float(value))
    if isinstance(value, pd.Series) and pd.api.types.is_numeric_dtype(value):
        return value.astype(float)
    raise InputError(
        "quantity", f"quantity {short(text)}", "is no number", "write names of quantities"
    )


def spreads(frame: pd.DataFrame, text: str) -> pd.Series:
    """Uncertainty of a quantity of each case; NaN where it is not known, as of an expression."""
    return numbers(frame, f"{text}_spread" if text.isidentifier() else "unknown")


def mean_with_error(cases: pd.DataFrame, text: str) -> tuple[float, float]:
    """Return the mean of a quantity, or an expression, over cases and its error.

    By the rule of `measure` over packings. NaN where no case has it; an error that is not known
    counts as none of the case's own.
    """
    value = numbers(cases, text)
    cases, value = cases[np.isfinite(value)], value[np.isfinite(value)]
    if cases.empty:
        return np.nan, np.nan
    own, common = _errors(cases, text, value)
    each = [
        Value(number, "", {"fit": fit, COMMON: part})
        for number, fit, part in zip(value, own, common, strict=True)
    ]
    mean = mean_of_values(each)
    return float(mean.value), mean.error or np.nan


def _errors(cases: pd.DataFrame, text: str, value: pd.Series) -> tuple[Floats, Floats]:
    """Errors (k,) of an expression's `value` (k,): of its quantities' own, and of what is common.

    By how much it changes with them: own errors one quantity after the other, common ones at once.
    """
    squares = np.zeros(len(cases))
    common: dict[str, pd.Series] = {}
    for name in {text} if text in cases else names_in(text):
        if f"{name}_error" not in cases:
            continue
        error = cases[f"{name}_error"].fillna(0.0)
        if f"{name}_common" in cases:
            part = cases[f"{name}_common"].fillna(0.0)
            common[name] = cases[name] + part
            error = np.sqrt(np.maximum(error**2 - part**2, 0.0))
        change = numbers(cases.assign(**{name: cases[name] + error}), text) - value
        squares += np.nan_to_num(change.to_numpy(float)) ** 2
    change = numbers(cases.assign(**common), text) - value
    return np.sqrt(squares), abs(np.nan_to_num(change.to_numpy(float)))


def runs(cases: Iterable[int]) -> str:
    """Numbers of cases as 1-4, 7."""
    each = np.sort(list(cases))
    found = np.split(each, np.flatnonzero(np.diff(each) > 1) + 1)
    parts = (f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in found if len(run))
    return ", ".join(parts)


def missing(frame: pd.DataFrame, text: str) -> str:
    """What is not there for a quantity of these cases."""
    away = frame[~frame["there"]]
    blank = frame[frame["there"] & ~np.isfinite(numbers(frame, text))]
    parts = [f"no packing of case {runs(away['case'])}"] if len(away) else []
    if len(blank):
        absent = sorted({kind for kinds in blank["absent"] for kind in kinds.split()})
        why = f" (absent: {', '.join(absent)})" if absent else ""
        parts.append(f"case {runs(blank['case'])} does not give it{why}")
    return "; ".join(parts) or "nothing to measure it on"


OF_POWERS = "e", "power", "error", "cases", "moving", "whole"


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
    table = pd.DataFrame.from_dict(lines, orient="index", columns=OF_POWERS).sort_values("e")
    table = table.astype({"e": float, "power": float, "error": float, "whole": bool})
    which = "e at the lowest stress"
    if by_rest and lines:
        which = f"e at {frame['state_kpa'].iloc[0]:g} kPa"
        moving = table["moving"].sum()
        which += f", {moving} of {len(table)} states not settled" if moving else ""
    whole = len(table) == len(groups) and bool(table["whole"].all())
    return Powers(table, which, whole)
