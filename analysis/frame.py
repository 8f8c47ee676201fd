"""Hold the cases of a study in a frame, one line each; evaluate expressions of their numbers.

Also fit a power law within each group over its stresses, and how the powers change with void ratio.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from analysis.case_result import CaseResult
from analysis.estimators.fits import power_law, straight_line
from analysis.expressions import UnknownNameError, evaluate, names_in, short
from analysis.mean import mean_of_values
from analysis.value import COMMON, Value
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

NO_COLUMN = "unknown"
"""Name that stands for an unknown column: no column has it."""


def frame_of(rows: Iterable[CaseResult], cases: pd.DataFrame | None = None) -> pd.DataFrame:
    """Return the study's cases, one line each, with all numbers; NaN if a case has no result.

    The columns of `cases` are the settings of the study. Further columns are `there`, whether the
    case has a result; words of the result (`record`, `group`, `unsettled`, ...); the `row` itself;
    and `plateau_NAME`. For each quantity there are `QUANTITY`, `QUANTITY_error`, `QUANTITY_common`
    (part of the error that all packings share), `QUANTITY_spread` (the larger of error and scatter
    of samples) and `QUANTITY_sample_error`.

    The numbers of other states of a compression are columns of all cases of this compression, with
    the state's stress in the name: `void_ratio_at_1_kpa`; those of the lowest stress also as
    `void_ratio_of_state`, `state_kpa`, ...
    """
    rows = list(rows)
    if cases is None:
        cases = _cases_of(rows)
    lines = {row.name: _line(row) for row in rows if not row.state}
    results = pd.DataFrame.from_dict(lines, orient="index").reindex(cases.index)
    results["there"] = cases.index.isin(list(lines))
    # A quantity with the name of a setting, `particles`, is the measured one.
    settings = cases.drop(columns=cases.columns.intersection(results.columns))
    frame = settings.join(results).copy()
    states = [row for row in rows if row.state]
    for state in sorted(states, key=lambda row: -row.stress):
        _add_state(frame, state)
    return frame


def _cases_of(rows: Iterable[CaseResult]) -> pd.DataFrame:
    """Return kind, friction and stress of each case, from the results."""
    lines = {}
    for row in rows:
        kind = "random"
        if row.crystal:
            kind = "fcc"
        lines[row.name] = kind, row.mu_comp, row.stress
    return pd.DataFrame.from_dict(lines, "index", columns=["kind", "mu_comp", "stress"])


def _add_state(frame: pd.DataFrame, state: CaseResult) -> None:
    """Add the numbers of a state to all cases of its compression."""
    same = (frame["mu_comp"] == state.mu_comp) & (frame["kind"] == "random")
    stress = state.stress / 1e3
    values: dict[str, Any] = {name: cell.value for name, cell in state.columns.items()}
    values["unsettled"] = state.unsettled
    for name, value in values.items():
        frame.loc[same, [f"{name}_at_{stress:g}_kpa", f"{name}_of_state"]] = value
    frame.loc[same, "state_kpa"] = stress


def _line(row: CaseResult) -> dict[str, Any]:
    """Return a result as one line of the frame."""
    line: dict[str, Any] = {
        "label": row.label,
        "record": row.record,
        "unsettled": row.unsettled,
        "group": row.group,
        "packings": row.packings,
        "absent": " ".join(row.absent),
        "row": row,
    }
    for name, text in row.texts.items():
        line[f"{name}_text"] = text
    for name, cell in row.columns.items():
        line[name] = cell.value
        line[f"{name}_error"] = cell.error
        line[f"{name}_spread"] = row.spread(name)
        if cell.common:
            line[f"{name}_common"] = cell.common
    for name, scatter in row.samples.items():
        line[f"{name}_sample_error"] = scatter
    for name, flat in row.flat.items():
        line[f"plateau_{name}"] = flat
    return line


def select(frame: pd.DataFrame, text: str) -> pd.DataFrame:
    """Return the cases for which an expression of columns is true; all for an empty text.

    Raises InputError for an expression that is not true or false for each case.
    """
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
    """Return a quantity of each case, or an expression of quantities; NaN if it is not known.

    Raises InputError for an expression that does not give a number.
    """
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
    """Return the uncertainty of a quantity of each case; NaN if unknown, and for an expression."""
    if text.isidentifier():
        return numbers(frame, f"{text}_spread")
    return numbers(frame, NO_COLUMN)


def mean_with_error(cases: pd.DataFrame, text: str) -> tuple[float, float]:
    """Return the mean of a quantity, or of an expression, over cases, and its error.

    Errors are combined as `measure` does over several packings. NaN if no case has the quantity; an
    unknown error of a case counts as zero.
    """
    value = numbers(cases, text)
    known = np.isfinite(value)
    cases = cases[known]
    value = value[known]
    if cases.empty:
        return np.nan, np.nan
    errors = _errors(cases, text, value)
    values = []
    for number, independent, common in zip(value, *errors, strict=True):
        values.append(Value(number, "", {"fit": independent, COMMON: common}))
    mean = mean_of_values(values)
    return float(mean.value), mean.error or np.nan


class Errors(NamedTuple):
    """Errors (k,) of an expression for k cases.

    independent: from the errors that differ between cases; common: from the errors that all
    packings share.
    """

    independent: Floats
    common: Floats


def _errors(cases: pd.DataFrame, text: str, value: pd.Series) -> Errors:
    """Return the errors of an expression with the `value` (k,) for k cases.

    `independent` is the root of the sum of squares of the changes when each quantity is increased
    by its own error alone. `common` is the change when all quantities are increased by their common
    errors at once.
    """
    names = {text}
    if text not in cases:
        names = names_in(text)
    squares = np.zeros(len(cases))
    moved_by_common: dict[str, pd.Series] = {}
    for name in names:
        if f"{name}_error" not in cases:
            continue
        error = cases[f"{name}_error"].fillna(0.0)
        if f"{name}_common" in cases:
            common = cases[f"{name}_common"].fillna(0.0)
            moved_by_common[name] = cases[name] + common
            error = np.sqrt(np.maximum(error**2 - common**2, 0.0))
        change = numbers(cases.assign(**{name: cases[name] + error}), text) - value
        squares += np.nan_to_num(change.to_numpy(float)) ** 2
    change = numbers(cases.assign(**moved_by_common), text) - value
    return Errors(np.sqrt(squares), abs(np.nan_to_num(change.to_numpy(float))))


def runs(cases: Iterable[int]) -> str:
    """Return numbers of cases as a text in which successive numbers are joined to ranges.

    >>> runs([1, 2, 3, 4, 7])
    '1-4, 7'
    """
    ordered = np.sort(list(cases))
    gaps = np.flatnonzero(np.diff(ordered) > 1) + 1
    texts = []
    for run in np.split(ordered, gaps):
        if len(run) == 1:
            texts.append(str(run[0]))
        elif len(run):
            texts.append(f"{run[0]}-{run[-1]}")
    return ", ".join(texts)


def missing(frame: pd.DataFrame, text: str) -> str:
    """Return a text that lists the cases without a number for a quantity."""
    texts = []
    without_result = frame[~frame["there"]]
    if len(without_result):
        texts.append(f"no packing of case {runs(without_result['case'])}")
    without_number = frame[frame["there"] & ~np.isfinite(numbers(frame, text))]
    if len(without_number):
        absent: set[str] = set()
        for kinds in without_number["absent"]:
            absent.update(kinds.split())
        lacking = f"case {runs(without_number['case'])} does not give it"
        if absent:
            lacking += f" (absent: {', '.join(sorted(absent))})"
        texts.append(lacking)
    return "; ".join(texts) or "nothing to measure it on"


class GroupPower(NamedTuple):
    """A power law fitted within one group of cases.

    e: void ratio. power, error: exponent and its standard error. cases: number of its cases with a
    value. moving: whether the state that gave the void ratio had not settled. whole: whether every
    case of the group has a value.
    """

    e: float
    power: float
    error: float
    cases: int
    moving: bool
    whole: bool


@dataclass(frozen=True)
class Powers:
    """The powers of all groups.

    Attributes
    ----------
    table : DataFrame
        A line for each group, sorted by void ratio, with the columns of `GroupPower`.
    which_e : str
        Description of the states that gave the void ratios.
    whole : bool
        Whether no group, and no case of a group, is missing.
    """

    table: pd.DataFrame
    which_e: str
    whole: bool

    @property
    def trend(self) -> tuple[float, float]:
        """Return the slope of the exponents against void ratio, by least squares, and its error.

        Both are NaN if unknown.
        """
        line = straight_line(self.table["e"], self.table["power"])
        return float(line.slope), line.error

    @property
    def grows(self) -> bool:
        """Tell whether the power grows with e by more than twice the error of the slope."""
        slope, error = self.trend
        return slope > 2 * error

    def __str__(self) -> str:
        groups = []
        for power, error, e in self.table[["power", "error", "e"]].itertuples(index=False):
            groups.append(f"{power:.3f} ± {error:.1g} (e {e:.3f})")
        text = "power " + ", ".join(groups)
        if len(self.table) > 1:
            slope, error = self.trend
            text += f"; {self.which_e}; slope over e {slope:+.2f} ± {error:.1g}: "
            if self.grows:
                text += "grows with e"
            else:
                text += "does not grow with e beyond twice the error"
        if not self.whole:
            text += "; not all groups are whole"
        return text


def powers(frame: pd.DataFrame, x: str, y: str) -> Powers:
    """Fit quantity y as a power of quantity x within each group that has a power law."""
    frame = frame.assign(
        x=numbers(frame, x),
        y=numbers(frame, y),
        e_of_state=numbers(frame, "void_ratio_of_state"),
        e_of_case=numbers(frame, "void_ratio"),
    )
    by_state = bool(frame.loc[frame["y"].notna(), "e_of_state"].notna().all())
    groups = frame.sort_values("stress").groupby(["kind", "mu_comp"])
    lines = {}
    for (kind, friction), members in groups:
        line = _power_of_group(members, by_state)
        if np.isfinite(line.power):
            lines[f"{kind} with friction {friction:g}"] = line
    columns = list(GroupPower._fields)
    table = pd.DataFrame.from_dict(lines, orient="index", columns=columns).sort_values("e")
    table = table.astype({"e": float, "power": float, "error": float, "whole": bool})
    which = "e at the lowest stress"
    if by_state and lines:
        which = f"e at {frame['state_kpa'].iloc[0]:g} kPa"
        moving = table["moving"].sum()
        if moving:
            which += f", {moving} of {len(table)} states not settled"
    whole = len(table) == len(groups) and bool(table["whole"].all())
    return Powers(table, which, whole)


def _power_of_group(members: pd.DataFrame, by_state: bool) -> GroupPower:
    """Fit the power law of a group, with the void ratio of the group's state or first case."""
    law = power_law(members["x"], members["y"])
    known = members[members["y"].notna()]
    if not np.isfinite(law.exponent):
        return GroupPower(np.nan, np.nan, np.nan, len(known), False, False)
    first = known.iloc[0]
    whole = len(known) == len(members)
    e = first["e_of_case"]
    moving = False
    if by_state:
        e = first["e_of_state"]
        moving = bool(first["unsettled_of_state"])
    return GroupPower(e, law.exponent, law.error, len(known), moving, whole)
