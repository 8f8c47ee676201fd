"""A study's targets: numbers that it should find, each with its rule as data.

A target says which cases (`select`), which `quantity` of them, and how near or within which
bounds; stated numbers come from the study's table. Each rule returns a `Finding`. Where it speaks
of several cases, the value is the one that is furthest off, and `why` names the others' range.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from analysis.estimators.power_law import power_law
from analysis.study.description import Study
from analysis.study.powers import powers
from analysis.study.selection import missing, numbers, of_one_producer, runs, select, spreads
from analysis.table import Table, number
from modal.tools.errors import InputError

Spec = Mapping[str, Any]
HEADER = ("id", "value", "error", "target", "rule", "met", "why")
RULES = "near", "rounds", "inside", "power", "apart"


@dataclass(frozen=True)
class Finding:
    """What a rule found: value and error, whether the target is met, and why (or why not).

    `off` is how far the value is from the stated one, where that is one number; `short` the reason
    in few words.
    """

    value: float
    error: float
    met: bool
    why: str
    off: str = ""
    short: str = ""


@dataclass(frozen=True)
class Answer:
    """A target and what was found of it.

    `second` is the finding of another rule, `second_rule`, by which an open question was settled.
    """

    id: str
    stated: str
    rule: str
    finding: Finding
    second: Finding | None = None
    second_rule: str = ""

    @property
    def met(self) -> str:
        """In a word."""
        return "yes" if self.finding.met else "no"


class Rules:
    """The rules, over the frame of a study's cases and its table of stated numbers."""

    def __init__(self, frame: pd.DataFrame, stated: pd.DataFrame) -> None:
        self.frame, self.table = frame, stated

    def find(self, spec: Spec) -> Finding:
        """What the one rule that a target names finds."""
        named = [kind for kind in RULES if kind in spec]
        if len(named) != 1:
            raise InputError(f"target {spec.get('id')}: give it one of {', '.join(RULES)}")
        found: Finding = getattr(self, named[0])(spec[named[0]])
        return found

    def stated(self, quantity: str, cases: pd.DataFrame) -> pd.Series | None:
        """What is stated of a quantity for any of these cases; None where nothing is."""
        for _, line in self.table[self.table["quantity"] == quantity].iterrows():
            text = line["select"] if isinstance(line["select"], str) else ""
            if cases.index.isin(select(self.frame, text).index).any():
                return line
        return None

    def stated_of(self, case: str) -> dict[str, tuple[float, float]]:
        """Lower and upper end of all that is stated of a case, by quantity."""
        found = {}
        for _, line in self.table.iterrows():
            text = line["select"] if isinstance(line["select"], str) else ""
            if case in select(self.frame, text).index:
                low, high = line["low"], line["high"]
                ends = (line["value"],) * 2 if np.isfinite(line["value"]) else (low, high)
                found[line["quantity"]] = (float(ends[0]), float(ends[1]))
        return found

    def _of(self, spec: Spec) -> tuple[pd.DataFrame, str, str]:
        """Cases, producer and quantity of a rule."""
        cases = select(self.frame, spec.get("select", ""))
        return cases, *of_one_producer(cases, spec["quantity"])

    def _wanted(self, spec: Spec, cases: pd.DataFrame) -> float:
        line = self.stated(spec.get("stated", spec["quantity"]), cases)
        if "value" not in spec and line is None:
            raise InputError(f"{spec['quantity']}: no stated value; add it to stated.csv")
        return float(spec["value"] if "value" in spec else line["value"])

    def near(self, spec: Spec) -> Finding:
        """One case's number within so much of the stated; `within` in its unit, or per cent.

        `also` names further quantities and how near these have to be. On no plateau, and of a state
        that has not settled, no number meets a target.
        """
        cases, _, name = self._of(spec)
        values = numbers(cases, name)
        if not np.isfinite(values).any():
            return _absent(missing(cases, name))
        row = cases.loc[np.isfinite(values).idxmax()]
        value, wanted = float(values[row.name]), self._wanted(spec, cases)
        met, by = _near(value, wanted, spec["within"])
        why = f"off by {by}"
        for other, within in spec.get("also", {}).items():
            also, apart = _near(float(row[other]), wanted, within)
            met, why = met and also, f"{why}; {other} {row[other]:.2f}: {apart}"
        if (percent := spec.get("plateau")) and not row.get(f"plateau_{percent}", False):
            met, why = False, f"{why}; on no plateau, where the rule has no answer"
        unsettled = row.get(spec.get("unsettled", "unsettled"))
        if isinstance(unsettled, str) and unsettled:
            where = "inside" if met else "outside"
            met, why = False, f"{why}, {where}, but the state has not settled: {unsettled}"
        error = float(row.get(f"{name}_spread", np.nan))
        return Finding(value, error, met, why + _mention(spec, row), by, f"{value:.4g} ({by})")

    def rounds(self, spec: Spec) -> Finding:
        """One case's number that rounds to the stated digits."""
        cases, _, name = self._of(spec)
        values = numbers(cases, name).dropna()
        if values.empty:
            return _absent(missing(cases, name))
        value, wanted, digits = float(values.iloc[0]), self._wanted(spec, cases), spec["digits"]
        met = round(value, digits) == wanted
        error = float(cases.loc[values.index[0]].get(f"{name}_spread", np.nan))
        off = f"{100 * (value / wanted - 1):+.2f} %"
        return Finding(value, error, met, f"rounds to {value:.{digits}f}", off)

    def inside(self, spec: Spec) -> Finding:
        """Numbers of several cases, all within bounds: `low`, `high`, else the stated ones.

        `aim` is what the furthest is furthest from, by default the middle. `others` are further
        quantities by name, which are only said.
        """
        cases, _, name = self._of(spec)
        values = numbers(cases, name)
        seen = values[np.isfinite(values)]
        low, high = self._bounds(spec, cases)
        if seen.empty:
            return _absent(missing(cases, name))
        middle = spec.get("aim", 0.5 * (low + high))
        far = abs(seen - middle) if np.isfinite(middle) else (-seen if np.isinf(high) else seen)
        worst = cases.loc[far.idxmax()]
        outside = seen[~seen.between(low, high)]
        errors = spreads(cases, name)
        text = f"{seen.min():.5g} to {seen.max():.5g}"
        why = f"case {runs(cases.loc[seen.index, 'case'])}: {text}"
        if len(outside):
            why += f"; outside: case {runs(cases.loc[outside.index, 'case'])}"
        if len(seen) < len(cases):
            why += "; " + missing(cases, name)
        met = outside.empty and (len(seen) == len(cases) or not spec.get("complete", True))
        if "plateau" in spec:
            why += _outside(cases, outside, errors, low, high)
            there = cases[cases["there"]]
            bare = there[there[f"plateau_{spec['plateau']}"] != True]  # noqa: E712
            all_yade = bool((there["record"] == "yade").all())
            why += "; YADE" if all_yade else "; linear wave in some cases"
            if len(bare):
                met, why = False, f"{why}; no plateau at {spec['plateau']} % in case "
                why += runs(bare["case"])
        for text, other in spec.get("others", {}).items():
            known = numbers(cases, of_one_producer(cases, other)[1]).dropna()
            if len(known):
                span = f"{known.min():.3g} to {known.max():.3g}"
                why += f"; {text}: {span}, {known.between(low, high).sum()} of {len(known)} inside"
        short = f"{len(seen) - len(outside)} of {len(seen)}, {seen.min():.3g} to {seen.max():.3g}"
        why += _mention(spec, worst)
        return Finding(float(seen[worst.name]), float(errors[worst.name]), met, why, "", short)

    def _bounds(self, spec: Spec, cases: pd.DataFrame) -> tuple[float, float]:
        """Lower and upper end, of which one may be infinite; a stated value is both."""
        line = self.stated(spec.get("stated", spec.get("quantity", "")), cases)
        found = {} if line is None else {"low": line["low"], "high": line["high"]}
        if line is not None and np.isfinite(line["value"]):
            part = spec.get("within", 0.0)
            found = {"low": line["value"] * (1 - part), "high": line["value"] * (1 + part)}
        found |= {name: spec[name] for name in ("low", "high") if name in spec}
        if not found:
            raise InputError(f"{spec.get('quantity')}: no bounds; give low or high")
        low, high = (float(found.get(name, np.nan)) for name in ("low", "high"))
        return (-np.inf if np.isnan(low) else low), (np.inf if np.isnan(high) else high)

    def power(self, spec: Spec) -> Finding:
        """Quantity `y` as a power of `x` within each group, all inside the stated bounds.

        With `within` the power of all cases is that near to the stated one. `grows`: with the void
        ratio, beyond twice its standard error. `errors`: how many of its own one may be outside.
        """
        cases = select(self.frame, spec.get("select", ""))
        producer, x, y = of_one_producer(cases, spec["x"], spec["y"])
        found = powers(cases, x, y)
        if found is None:
            return _absent(missing(cases, y))
        if "within" in spec:
            wanted = float(self.stated(spec["stated"], cases)["value"])
            value, error = float(found.power[0]), float(found.error[0])
            known = cases[np.isfinite(numbers(cases, y))]
            why = f"over case {runs(known['case'])}, {producer}"
            why += "" if found.whole else "; " + missing(cases, y)
            met = abs(value - wanted) <= spec["within"] and found.whole
            return Finding(value, error, met, why, f"{value - wanted:+.4f}")
        low, high = self._bounds(spec, cases)
        # An error that is not known, as of two stresses, excuses nothing.
        room = np.nan_to_num(spec.get("errors", 0) * found.error)
        inside = (found.power + room > low) & (found.power - room <= high)
        aim = 0.5 * (low + high)
        far = abs(found.power - aim) if np.isfinite(aim) else -found.power
        worst = int(np.argmax(far))
        least, most = found.power.min(), found.power.max()
        share = f"{inside.sum()} of {len(inside)}"
        why = f"{producer}: {share} inside; power = {found}"
        if "plateau" in spec:
            flat = f"plateau_{spec['plateau']}_{'yade' if producer == 'YADE' else 'linear'}"
            there = cases[cases["there"]]
            bare = there[there.get(flat, pd.Series(None, there.index)) != True]  # noqa: E712
            if len(bare):
                why += f"; no plateau at {spec['plateau']} % in case {runs(bare['case'])}"
        for text, other in spec.get("others", {}).items():
            by = powers(cases, x, of_one_producer(cases, other)[1])
            if by is not None:
                why += f"; {text}: {by.power.min():.3g} to {by.power.max():.3g}"
        met = bool(inside.all()) and (found.whole or not spec.get("complete", True))
        met = met and (found.grows or not spec.get("grows"))
        slope, error = found.trend
        short = f"{share} groups, {least:.2f} to {most:.2f}; {slope:+.1f} ± {error:.1g} over e"
        return Finding(float(found.power[worst]), float(found.error[worst]), met, why, "", short)

    def apart(self, spec: Spec) -> Finding:
        """Largest over smallest number of some cases at each stress, less one, in per cent.

        `errors`: how many of its own, by the scatter of samples, it may be above the stated one.
        """
        cases, _, name = self._of(spec)
        found, expected = apart(cases, name), cases["stress"].nunique()
        if found.empty:
            return _absent(missing(cases, name))
        _, high = self._bounds({"stated": spec["stated"]}, self.frame)
        worst = float(found.max())
        error = _error_apart(cases[cases["stress"] == found.idxmax()], name)
        why = "in %: " + ", ".join(f"{v:.2f} at {s / 1e3:g} kPa" for s, v in found.items())
        if len(found) < expected:
            why += "; " + missing(cases, name)
        if worst >= high:
            members = cases[cases["stress"] == found.idxmax()]
            each = (f"{row['group']} {row[name]:.2f}" for _, row in members.iterrows())
            why += f"; at {found.idxmax() / 1e3:g} kPa {', '.join(each)}"
            why += "".join(_mention(spec, row) for _, row in members.iterrows())
            laws = ((g, power_law(m["stress"], m[name])) for g, m in cases.groupby("group"))
            why += "; powers over stress: " + ", ".join(f"{g} {b.exponent:.4f}" for g, b in laws)
        why += f"; of all packings at most {apart(self.frame, name).max():.2f}"
        met = worst - np.nan_to_num(spec.get("errors", 0) * error) < high
        return Finding(worst, error, met and len(found) == expected, why)


def apart(frame: pd.DataFrame, name: str) -> pd.Series:
    """Largest over smallest number at each stress, Pa, less 1, in %; where two or more are known.

    Only stresses at which as many groups are known as anywhere count.
    """
    by = frame.assign(value=numbers(frame, name)).dropna(subset="value").groupby("stress")["value"]
    found = 100 * (by.max() / by.min() - 1)
    return found[(by.count() > 1) & (by.count() == by.count().max())]


def _error_apart(cases: pd.DataFrame, name: str) -> float:
    """Of the largest over the smallest, %, by the scatter of samples; NaN where none is known."""
    values, scatter = numbers(cases, name), spreads(cases, name)
    shares = (100 * scatter / values)[[values.idxmin(), values.idxmax()]]
    return float(np.sqrt((shares**2).sum())) if shares.notna().any() else np.nan


def _near(value: float, wanted: float, within: str | float) -> tuple[bool, str]:
    """Whether a value is so near to another, and how far off it is."""
    percent = re.fullmatch(r"([\d.]+) %", str(within))
    if percent:
        off = 100 * (value / wanted - 1)
        return bool(abs(off) <= float(percent[1])), f"{off:+.2f} %"
    off = value - wanted
    return bool(abs(off) <= float(within)), f"{off:+.4f}"


def _absent(what: str) -> Finding:
    """A number that no case gives, and what is not there."""
    return Finding(np.nan, np.nan, False, f"not measured: {what}")


def _mention(spec: Spec, row: pd.Series) -> str:
    """What a target says besides, of one case: texts with its numbers, if these are known."""
    found = ""
    for text in spec.get("mention", []):
        names = re.findall(r"{(\w+)", text)
        if all(name in row and row[name] == row[name] and row[name] != "" for name in names):
            found += "; " + text.format(**row)
    return found


def _outside(
    cases: pd.DataFrame, outside: pd.Series, errors: pd.Series, low: float, high: float
) -> str:
    """Each case outside with its error, and of how many the range is within twice that."""
    if outside.empty:
        return ""
    each = [f"{cases['case'][n]}: {number(value, errors[n])}" for n, value in outside.items()]
    gap = np.maximum(outside - high, low - outside)
    near = (gap <= 2 * errors[outside.index]).sum()
    return f" ({', '.join(each)}; {near} of them by less than twice their error)"


def answers(study: Study, frame: pd.DataFrame) -> list[Answer]:
    """Of every target of a study."""
    rules, found = Rules(frame, study.stated()), []
    for spec in study.part("targets"):
        first, other = rules.find(spec), spec.get("second")
        if spec.get("calibrated"):
            first = replace(first, why=f"{first.why}; no test: {spec['calibrated']}")
        second = rules.find({"id": spec["id"]} | other) if other else None
        told = first, second, other["rule"] if other else ""
        found.append(Answer(spec["id"], spec["stated"], spec["rule"], *told))
    return found


def targets(found: list[Answer]) -> Table:
    """The table of targets, for files."""
    cells = [[a.id, *_value(a), a.stated, a.rule, a.met, a.finding.why] for a in found]
    return Table("Targets", HEADER, cells, "targets")


def targets_seen(found: list[Answer]) -> Table:
    """The same for readers, with how far each is from what is stated."""
    header = ["target", "here", "±", "stated", "deviation", "rule", "met", "why"]
    cells = [
        [a.id, *_value(a), a.stated, a.finding.off, a.rule, a.met, a.finding.why] for a in found
    ]
    return Table("Targets", header, cells, "targets")


def second_verdicts(found: list[Answer]) -> Table:
    """Of the targets that have a second rule: both verdicts side by side."""
    header = ["target", "stated", "met by the rule", "second rule", "here", "±", "met by it", "why"]
    cells = []
    for a in found:
        if a.second is not None:
            numbers_ = _text(a.second.value), _text(a.second.error, 2)
            met = "yes" if a.second.met else "no"
            cells.append([a.id, a.stated, a.met, a.second_rule, *numbers_, met, a.second.why])
    return Table("Targets by a second rule", header, cells, "second_verdicts")


def _value(answer: Answer) -> tuple[str, str]:
    return _text(answer.finding.value), _text(answer.finding.error, 2)


def _text(value: float, digits: int = 6) -> str:
    return f"{value:.{digits}g}" if np.isfinite(value) else ""
