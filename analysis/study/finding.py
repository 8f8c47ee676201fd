"""Judge numbers by their bounds: whether a target is met, why not, and a text about it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from analysis.study.bounds import Comparison, Spec
from analysis.study.rule_values import RuleValues
from analysis.table import MIN_SHOWN_RELATIVE_ERROR, cell, number

Failure = Literal[
    "not_measured", "outside", "incomplete", "unsettled", "no_plateau", "no_growth", "further"
]
"""Reasons for which a target is not met.

- not_measured: no number is known.
- outside: a number is outside its bounds.
- incomplete: some numbers are not known.
- unsettled: a case has not settled.
- no_plateau: the threshold of a case stands on no plateau.
- no_growth: powers do not grow with void ratio.
- further: a further quantity (`also`) is not near the stated value.
"""
MIN_SLOPE_IN_ERRORS = 2
"""Least slope of powers over void ratio that counts as growth, in its standard errors."""


@dataclass(frozen=True)
class Finding:
    """The result of a rule: a value with its error, why the target is not met, and a text.

    `failures` is empty for a target that is met. `text` explains the verdict in full, `short` in
    few words. `outside` names the cases, groups or stresses whose numbers are outside the bounds.
    """

    value: float
    error: float
    failures: tuple[Failure, ...]
    text: str
    short: str = ""
    outside: tuple[str, ...] = ()

    @property
    def met(self) -> bool:
        """Tell whether the target is met."""
        return not self.failures

    def cells(self) -> list[str]:
        """Return value and error as text; empty if not known, or if no table would show it."""
        error = self.error
        if not error > MIN_SHOWN_RELATIVE_ERROR * abs(self.value):
            error = np.nan
        return [cell(self.value, ".6g"), cell(error, ".2g")]


def list_failures(measured: RuleValues, comparison: Comparison, rule: Spec) -> list[Failure]:
    """Return the reasons for which numbers do not meet a target."""
    failures: list[Failure] = []
    if not comparison.inside.all():
        failures.append("outside")
    if len(measured.unsettled):
        failures.append("unsettled")
    if len(measured.off_plateau):
        failures.append("no_plateau")
    if rule.get("complete", True) and not measured.complete:
        failures.append("incomplete")
    slope = measured.slope
    if rule.get("grows", False) and not slope.value > MIN_SLOPE_IN_ERRORS * slope.error:
        failures.append("no_growth")
    return failures


def describe_comparison(measured: RuleValues, comparison: Comparison) -> list[str]:
    """Describe the comparison of numbers with their bounds, and doubts about the verdict.

    Numbers outside are listed, unless the deviation of a single number says as much.
    """
    if comparison.deviation is not None:
        texts = [f"off by {comparison.deviation}"]
    else:
        texts = [_describe_count(measured, comparison), _describe_outside(measured, comparison)]
    return [*texts, measured.description, *measured.describe_doubts()]


def describe_shortly(measured: RuleValues, comparison: Comparison, rule: Spec) -> str:
    """Describe the finding shortly: slope, deviation, or count of numbers inside the bounds."""
    if rule.get("grows", False):
        return f"{measured.slope.value:+.1f} ± {measured.slope.error:.1g} over e"
    if comparison.deviation is not None:
        return f"{comparison.value:.4g} ({comparison.deviation})"
    return _describe_count(measured, comparison)


def _describe_count(measured: RuleValues, comparison: Comparison) -> str:
    """Describe how many numbers are inside their bounds, and the range of the numbers."""
    values = measured.values
    count = f"{comparison.inside.sum()} of {len(values)} inside"
    return f"{count}, {values.min():.5g} to {values.max():.5g}"


def _describe_outside(measured: RuleValues, comparison: Comparison) -> str:
    """List the numbers outside their bounds; empty if there are none."""
    outside = measured.values[~comparison.inside]
    if outside.empty:
        return ""
    texts = [f"{name}: {number(outside[name], measured.errors[name])}" for name in outside.index]
    return f"outside: {', '.join(texts)}"
