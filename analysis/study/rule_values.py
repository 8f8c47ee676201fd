"""Collect the numbers that a rule compares with its bounds, by case, group or stress."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from analysis.case_columns import of_one_producer
from analysis.frame import missing, numbers, powers, runs, spreads
from analysis.study.bounds import Spec

RuleKind = Literal["near", "inside", "power", "apart"]


class Slope(NamedTuple):
    """A slope and its standard error; NaN if unknown."""

    value: float = np.nan
    error: float = np.nan


class Unsettled(NamedTuple):
    """A case that has not settled, and the properties of its state that have not."""

    case: str
    reason: str


@dataclass(frozen=True)
class RuleValues:
    """The numbers that a rule compares with its bounds, by case, group or stress, with errors.

    description: what the numbers are, or which are missing. complete: whether no number is missing.
    unsettled: cases that have not settled. off_plateau: numbers of the cases whose frequency at the
    threshold, `threshold` in per cent, is not on a plateau. A target with such cases is not met.
    slope: slope of the power-law exponents against void ratio.
    """

    values: pd.Series
    errors: pd.Series
    description: str
    complete: bool
    unsettled: Sequence[Unsettled] = ()
    off_plateau: Sequence[int] = ()
    threshold: str = ""
    slope: Slope = Slope()

    def describe_doubts(self) -> list[str]:
        """Describe which cases have not settled or are not on a plateau."""
        texts = [f"{case} has not settled: {reason}" for case, reason in self.unsettled]
        if len(self.off_plateau):
            texts.append(f"no plateau at {self.threshold} % in case {runs(self.off_plateau)}")
        return texts


def collect_values(kind: RuleKind, rule: Spec, cases: pd.DataFrame) -> RuleValues:
    """Return the numbers that a rule compares with its bounds."""
    if kind == "power":
        return _collect_powers(rule, cases)
    if kind == "apart":
        return _collect_contrasts(rule, cases)
    return _collect_numbers(rule, cases)


def _collect_numbers(rule: Spec, cases: pd.DataFrame) -> RuleValues:
    """Return a quantity of each case."""
    _, name, plateau = of_one_producer(
        cases["record"].dropna(), rule["quantity"], rule.get("plateau", "")
    )
    values = numbers(cases, name).dropna()
    complete = len(values) == len(cases)
    descriptions = []
    if len(cases) > 1 and len(values):
        descriptions.append(f"case {runs(cases['case'][values.index])}")
    if not complete:
        descriptions.append(missing(cases, name))
    return RuleValues(
        values,
        spreads(cases, name)[values.index],
        "; ".join(descriptions),
        complete,
        unsettled=_list_unsettled(cases, rule.get("unsettled", "unsettled")),
        off_plateau=_cases_off_plateau(cases, plateau),
        threshold=_threshold_percent(plateau),
    )


def _collect_powers(rule: Spec, cases: pd.DataFrame) -> RuleValues:
    """Return the exponent of `y` as a power of `x` in each group."""
    producer, x, y, plateau = of_one_producer(
        cases["record"].dropna(), rule["x"], rule["y"], rule.get("plateau", "")
    )
    groups = powers(cases, x, y)
    descriptions = []
    if len(groups.table):
        descriptions.append(f"{producer}: {groups}")
    if not groups.whole:
        descriptions.append(missing(cases, y))
    return RuleValues(
        groups.table["power"],
        groups.table["error"],
        "; ".join(descriptions),
        groups.whole,
        off_plateau=_cases_off_plateau(cases, plateau),
        threshold=_threshold_percent(plateau),
        slope=Slope(*groups.trend),
    )


def _collect_contrasts(rule: Spec, cases: pd.DataFrame) -> RuleValues:
    """Return the largest number at each stress divided by the smallest, minus 1, in %.

    The error follows from those of the two numbers. Stresses at which fewer groups have a
    number than at other stresses are left out.
    """
    _, name = of_one_producer(cases["record"].dropna(), rule["quantity"])
    known = cases.assign(value=numbers(cases, name), error=spreads(cases, name))
    known = known.dropna(subset="value")
    counts = known.groupby("stress")["value"].count()
    stresses = counts.index[(counts == counts.max()) & (counts > 1)]
    contrasts = {kilopascals(stress): _compare_extremes(known, stress) for stress in stresses}
    table = pd.DataFrame.from_dict(contrasts, orient="index", columns=Contrast._fields)
    complete = len(contrasts) == cases["stress"].nunique()
    descriptions = list(table["description"])
    if not complete:
        descriptions.append(missing(cases, name))
    return RuleValues(table["percent"], table["error"], "; ".join(descriptions), complete)


class Contrast(NamedTuple):
    """The distance of the groups at one stress, in per cent, with its error."""

    percent: float
    error: float
    description: str


def _compare_extremes(known: pd.DataFrame, stress: float) -> Contrast:
    """Compare the largest number of the groups at one stress with the smallest."""
    groups = known[known["stress"] == stress]
    extremes = groups.loc[[groups["value"].idxmin(), groups["value"].idxmax()]]
    smallest, largest = extremes["value"]
    percent = 100 * (largest / smallest - 1)
    relative_errors = extremes["error"] / extremes["value"]
    error = 100 * relative_errors.pow(2).sum(min_count=1) ** 0.5
    listed = ", ".join(groups["group"] + groups["value"].map(": {:.2f}".format))
    return Contrast(percent, error, f"{percent:.2f} % at {kilopascals(stress)} ({listed})")


def kilopascals(stress: float) -> str:
    """Return a stress, Pa, as text in kPa."""
    return f"{stress / 1e3:g} kPa"


def _list_unsettled(cases: pd.DataFrame, column: str) -> list[Unsettled]:
    """Return the cases that have not settled: those with a reason in the column."""
    reasons = cases.get(column, pd.Series(dtype=object)).dropna()
    return [Unsettled(case, reason) for case, reason in reasons.items() if reason]


def _cases_off_plateau(cases: pd.DataFrame, plateau: str) -> pd.Series:
    """Return the numbers of the cases without the named plateau, if any."""
    present = cases[cases["there"]]
    if not plateau:
        return present["case"][:0]
    column = present.get(f"plateau_{plateau}", pd.Series(False, present.index))
    on_plateau = column.fillna(False).astype(bool)
    return present["case"][~on_plateau]


def _threshold_percent(plateau: str) -> str:
    """Return the threshold, in per cent, in the name of a plateau: 2 for "2_linear"."""
    return plateau.split("_")[0]
