"""Apply the rule of a target to the numbers of a study.

A rule is data. It names the cases (`select`), and one of four conditions: their `quantity` is
`near` or `inside` the published number, `y` is proportional to a `power` of `x` in each group, or
the cases are not too far `apart` at each stress. The bounds are the target's own `low` and `high`,
or the published ones; `within`, such as 0.01 or 2 %, sets them around a published value. Each rule
thus compares numbers with two bounds, and the number that is furthest off is the value of the
target.
"""

from typing import Any, get_args

import numpy as np
import pandas as pd

from analysis.case_columns import unit_of_column
from analysis.expressions import short
from analysis.frame import select
from analysis.study.bounds import Bounds, Spec, Tolerance, compare_with_bounds
from analysis.study.fields import field_names, fill
from analysis.study.finding import (
    Finding,
    describe_comparison,
    describe_shortly,
    list_failures,
)
from analysis.study.rule_values import RuleKind, collect_values, kilopascals
from modal.tools.errors import InputError
from modal.tools.units import says

RULE_KINDS: tuple[RuleKind, ...] = get_args(RuleKind)
UNKNOWN = (np.nan, np.nan)
"""Value and error of a number that is not known."""


class Rules:
    """The rules, applied to the frame of a study's cases and its table of stated numbers.

    `statements` are the rows of this table, each with the names of its cases.
    """

    def __init__(self, frame: pd.DataFrame, stated: pd.DataFrame) -> None:
        _refuse_other_units(stated)
        self.frame = frame
        self.statements = [
            (row, select(frame, row["select"]).index) for _, row in stated.iterrows()
        ]

    def stated_row(self, quantity: str, cases: pd.DataFrame) -> pd.Series | None:
        """Return the stated row for a quantity of any of these cases; None if there is none."""
        for row, names in self.statements:
            if row["quantity"] == quantity and cases.index.isin(names).any():
                return row
        return None

    def stated_intervals(self, case: str) -> dict[str, tuple[float, float]]:
        """Return the lower and upper end of all stated numbers of a case, by quantity."""
        rows = [row for row, names in self.statements if case in names]
        return {row["quantity"]: (float(row["low"]), float(row["high"])) for row in rows}

    def find(self, spec: Spec) -> Finding:
        """Apply the rule that a target names, and tell whether the target is met.

        Raises InputError if the target names no rule or several, or if the rule has no bounds.
        """
        kind = _rule_kind(spec)
        rule = spec[kind]
        cases = select(self.frame, rule.get("select", ""))
        bounds = self._bounds(rule, cases)
        measured = collect_values(kind, rule, cases)
        if measured.values.empty:
            text = f"not measured: {measured.description}"
            return Finding(*UNKNOWN, ("not_measured",), text)
        comparison = compare_with_bounds(measured.values, measured.errors, bounds, rule)
        further = self._find_further(rule, bounds)
        failures = list_failures(measured, comparison, rule)
        if not all(finding.met for finding in further.values()):
            failures.append("further")
        texts = [
            *describe_comparison(measured, comparison),
            *[f"{name} {finding.short}" for name, finding in further.items()],
            *self._describe_others(kind, rule, cases, bounds),
            *_mention(rule, _worst_cases(cases, comparison.worst)),
        ]
        return Finding(
            comparison.value,
            comparison.error,
            tuple(failures),
            "; ".join(filter(None, texts)),
            describe_shortly(measured, comparison, rule),
            tuple(map(str, comparison.inside.index[~comparison.inside])),
        )

    def _find_further(self, rule: Spec, bounds: Bounds) -> dict[str, Finding]:
        """Compare further quantities (`also`) with the stated value, each within its tolerance."""
        findings = {}
        for quantity, within in rule.get("also", {}).items():
            near = {
                "select": rule["select"],
                "quantity": quantity,
                "value": bounds.stated,
                "within": within,
            }
            findings[quantity] = self.find({"near": near})
        return findings

    def _describe_others(
        self, kind: RuleKind, rule: Spec, cases: pd.DataFrame, bounds: Bounds
    ) -> list[str]:
        """Describe how many numbers of other quantities (`others`) lie inside the same bounds."""
        replaced = "y" if "y" in rule else "quantity"
        texts = []
        for label, quantity in rule.get("others", {}).items():
            values = collect_values(kind, {**rule, replaced: quantity}, cases).values
            count = f"{values.between(bounds.low, bounds.high).sum()} of {len(values)} inside"
            texts.append(f"{label}: {count}, {values.min():.3g} to {values.max():.3g}")
        return texts

    def _bounds(self, rule: Spec, cases: pd.DataFrame) -> Bounds:
        """Return the bounds of a rule.

        These are the rule's own bounds, bounds around a stated value, or stated bounds.
        """
        quantity = rule.get("stated", rule.get("quantity", ""))
        names = ["value", "low", "high"]
        numbers_by_name = {}
        row = self.stated_row(quantity, cases)
        if row is not None:
            numbers_by_name = row[names].to_dict()
        numbers_by_name |= {name: rule[name] for name in names if name in rule}
        value, low, high = (float(numbers_by_name.get(name, np.nan)) for name in names)
        if "within" in rule and np.isfinite(value):
            low, high = Tolerance.parse(rule["within"]).around(value)
        if np.isnan(low) and np.isnan(high):
            raise InputError(
                "no_bounds",
                f"{short(quantity)}: no bounds",
                remedy="add it to stated.csv, or give low or high",
            )
        if low > high:
            raise InputError(
                "bounds",
                f"{short(quantity)}: no number lies between {low:g} and {high:g}",
                remedy="give the lower bound as low",
            )
        if np.isnan(low):
            low = -np.inf
        if np.isnan(high):
            high = np.inf
        return Bounds(low, high, value)


def _refuse_other_units(stated: pd.DataFrame) -> None:
    """Raise InputError for a stated number in another unit than the column of its quantity.

    Numbers are compared without conversion: a velocity in km/s would be a thousand times too low.
    """
    for _, row in stated.iterrows():
        expected = unit_of_column(row["quantity"])
        unit = row.get("unit")
        is_stated = isinstance(unit, str) and unit.strip() != expected
        if expected and is_stated and not says(unit, expected):
            raise InputError(
                "unit",
                f"stated.csv: {row['quantity']} is in {expected}, not in {short(unit)}",
                remedy="convert the number",
            )


def _rule_kind(spec: Spec) -> RuleKind:
    """Return which rule a target names; InputError unless it names exactly one."""
    kinds = [kind for kind in RULE_KINDS if kind in spec]
    if len(kinds) != 1:
        raise InputError(
            "rule_kind",
            f"target {spec.get('id')}",
            remedy=f"give it one of {', '.join(RULE_KINDS)}",
        )
    return kinds[0]


def _worst_cases(cases: pd.DataFrame, worst: Any) -> pd.DataFrame:
    """Return the case of the worst number, or the cases at its stress."""
    return cases[(cases.index == worst) | (cases["stress"].map(kilopascals) == worst)]


def _mention(rule: Spec, cases: pd.DataFrame) -> list[str]:
    """Fill in the `mention` texts of a target for each case whose numbers are known."""
    texts = []
    for _, row in cases.iterrows():
        known = {name for name, value in row.items() if value == value and value != ""}
        for template in rule.get("mention", []):
            if field_names(template) <= known:
                texts.append(fill(template, row))
    return texts
