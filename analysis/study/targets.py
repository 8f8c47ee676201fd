"""A study's targets: numbers that it should find, each with its rule as data.

A target says which cases (`select`) and what of them: `near` or `inside` their `quantity`, the
`power` of `y` over `x` in each group, or how far `apart` they are at each stress. The bounds are
its own `low` and `high`, else what is stated; `within`, as 0.01 or 2 %, is about a stated value.
So each rule is numbers between two bounds; the one that is furthest off is the target's value.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from analysis.frame import missing, numbers, powers, runs, select, spreads
from analysis.rows import of_one_producer
from analysis.study.description import Study, following
from analysis.table import Table, cell, number
from modal.tools.errors import InputError

Spec = Mapping[str, Any]
UNKNOWN = np.nan, np.nan


@dataclass(frozen=True)
class Finding:
    """What a rule found: value and error, whether the target is met, why (or not), and in short."""

    value: float
    error: float
    met: bool
    why: str
    short: str = ""

    def cells(self) -> list[str]:
        """Value and error as text; empty where they are not known."""
        return [cell(self.value, ".6g"), cell(self.error, ".2g")]


@dataclass(frozen=True)
class Seen:
    """Numbers that a rule holds against its bounds, by case, group or stress, and their errors.

    `head` says what they are, or what is missing; `bars` why they meet nothing, whatever they are;
    `whole` that none is missing; `slope` is that of powers over void ratio, and its error.
    """

    values: pd.Series
    errors: pd.Series
    head: str
    whole: bool
    bars: Sequence[str] = ()
    slope: tuple[float, float] = UNKNOWN


class Rules:
    """The rules, over the frame of a study's cases and its table of stated numbers."""

    def __init__(self, frame: pd.DataFrame, stated: pd.DataFrame) -> None:
        self.frame = frame
        lines = (line for _, line in stated.iterrows())
        self.lines = [(line, select(frame, line["select"]).index) for line in lines]

    def stated(self, quantity: str, cases: pd.DataFrame) -> pd.Series | None:
        """What is stated of a quantity for any of these cases; None where nothing is."""
        for line, index in self.lines:
            if line["quantity"] == quantity and cases.index.isin(index).any():
                return line
        return None

    def stated_of(self, case: str) -> dict[str, tuple[float, float]]:
        """Lower and upper end of all that is stated of a case, by quantity."""
        lines = (line for line, index in self.lines if case in index)
        return {line["quantity"]: (float(line["low"]), float(line["high"])) for line in lines}

    def find(self, spec: Spec) -> Finding:
        """What the one rule that a target names finds."""
        kinds = {"near": self._numbers, "inside": self._numbers}
        kinds |= {"power": self._powers, "apart": self._apart}
        named = [kind for kind in kinds if kind in spec]
        if len(named) != 1:
            raise InputError(f"target {spec.get('id')}: give it one of {', '.join(kinds)}")
        rule, see = spec[named[0]], kinds[named[0]]
        cases = select(self.frame, rule.get("select", ""))
        (low, high, wanted), seen = self._bounds(rule, cases), see(rule, cases)
        values, grows = seen.values, rule.get("grows", False)
        if values.empty:
            return Finding(*UNKNOWN, False, f"not measured: {seen.head}")
        # An error that is not known, as of two stresses, excuses nothing.
        room = rule.get("errors", 0) * seen.errors.fillna(0)
        inside = values.between(low - room, high + room)
        aim = rule.get("aim", (low + high) / 2)
        far = abs(values - aim) if np.isfinite(aim) else (-values if high == np.inf else values)
        worst, value = far.idxmax(), float(values[far.idxmax()])
        met = bool(inside.all()) and not seen.bars
        met = met and (seen.whole or not rule.get("complete", True))
        met = met and (seen.slope[0] > 2 * seen.slope[1] or not grows)
        off = _off(value, wanted, rule.get("within")) if len(values) == 1 else ""
        short = f"{inside.sum()} of {len(values)} inside, {values.min():.5g} to {values.max():.5g}"
        away = [f"{n}: {number(values[n], seen.errors[n])}" for n in values[~inside].index]
        outside = f"outside: {', '.join(away)}" if away and not off else ""
        told = [f"off by {off}" if off else short, outside, seen.head, *seen.bars]
        for name, within in rule.get("also", {}).items():
            other = {"select": rule["select"], "quantity": name, "value": wanted, "within": within}
            also = self.find({"near": other})
            met, told = met and also.met, [*told, f"{name} {also.short}"]
        for text, name in rule.get("others", {}).items():
            known = see({**rule, "y" if "y" in rule else "quantity": name}, cases).values
            count = f"{known.between(low, high).sum()} of {len(known)} inside"
            told.append(f"{text}: {count}, {known.min():.3g} to {known.max():.3g}")
        rows = cases[(cases.index == worst) | (cases["stress"].map(_kpa) == worst)]
        told += [text for _, row in rows.iterrows() for text in _mentioned(rule, row)]
        why = "; ".join(filter(None, told))
        short = f"{value:.4g} ({off})" if off else short
        short = f"{seen.slope[0]:+.1f} ± {seen.slope[1]:.1g} over e" if grows else short
        return Finding(value, float(seen.errors[worst]), met, why, short)

    def _bounds(self, rule: Spec, cases: pd.DataFrame) -> tuple[float, float, float]:
        """Lower and upper end, either of which may be infinite, and the stated value, or NaN."""
        quantity = rule.get("stated", rule.get("quantity", ""))
        line = self.stated(quantity, cases)
        found = {} if line is None else line[["value", "low", "high"]].to_dict()
        found |= {name: rule[name] for name in ("value", "low", "high") if name in rule}
        wanted, low, high = (float(found.get(name, np.nan)) for name in ("value", "low", "high"))
        if "within" in rule and np.isfinite(wanted):
            size, percent = _within(rule["within"])
            room = size * abs(wanted) / 100 if percent else size
            low, high = wanted - room, wanted + room
        if np.isnan(low) and np.isnan(high):
            raise InputError(f"{quantity}: no bounds; add it to stated.csv, or give low or high")
        return -np.inf if np.isnan(low) else low, np.inf if np.isnan(high) else high, wanted

    def _numbers(self, rule: Spec, cases: pd.DataFrame) -> Seen:
        """A quantity of each case; on no plateau and not settled it meets nothing."""
        _, name, flat = of_one_producer(
            cases["record"].dropna(), rule["quantity"], rule.get("plateau", "")
        )
        values = numbers(cases, name).dropna()
        several = f"case {runs(cases['case'][values.index])}" if len(cases) > 1 else ""
        absent = missing(cases, name) if len(values) < len(cases) else ""
        texts = cases.get(rule.get("unsettled", "unsettled"), pd.Series(dtype=object))
        told = texts[texts.notna()].items()
        bars = [f"{case} has not settled: {text}" for case, text in told if text]
        head = "; ".join(filter(None, [several if len(values) else "", absent]))
        bars += _no_plateau(cases, flat)
        return Seen(values, spreads(cases, name)[values.index], head, not absent, bars)

    def _powers(self, rule: Spec, cases: pd.DataFrame) -> Seen:
        """The power of each group."""
        names = rule["x"], rule["y"], rule.get("plateau", "")
        producer, x, y, flat = of_one_producer(cases["record"].dropna(), *names)
        found = powers(cases, x, y)
        head = f"{producer}: {found}" if len(found.table) else ""
        head = "; ".join(filter(None, [head, "" if found.whole else missing(cases, y)]))
        table, bars = found.table, _no_plateau(cases, flat)
        return Seen(table["power"], table["error"], head, found.whole, bars, found.trend)

    def _apart(self, rule: Spec, cases: pd.DataFrame) -> Seen:
        """Largest over smallest number at each stress, less 1, in %; its error from the samples'.

        Only stresses count at which as many groups are known as anywhere.
        """
        _, name = of_one_producer(cases["record"].dropna(), rule["quantity"])
        known = cases.assign(value=numbers(cases, name), own=spreads(cases, name))
        known, found = known.dropna(subset="value"), {}
        counts = known.groupby("stress")["value"].count()
        for stress in counts.index[(counts == counts.max()) & (counts > 1)]:
            some = known[known["stress"] == stress]
            ends = some.loc[[some["value"].idxmin(), some["value"].idxmax()]]
            error = 100 * (ends["own"] / ends["value"]).pow(2).sum(min_count=1) ** 0.5
            each = ", ".join(some["group"] + some["value"].map(" {:.2f}".format))
            share = 100 * (ends["value"].iloc[1] / ends["value"].iloc[0] - 1)
            found[_kpa(stress)] = share, error, f"{share:.2f} % at {_kpa(stress)} ({each})"
        whole, columns = len(found) == cases["stress"].nunique(), ["value", "error", "text"]
        table = pd.DataFrame.from_dict(found, orient="index", columns=columns)
        head = "; ".join([*table["text"], *([] if whole else [missing(cases, name)])])
        return Seen(table["value"], table["error"], head, whole)


def _kpa(stress: float) -> str:
    return f"{stress / 1e3:g} kPa"


def _within(text: str | float) -> tuple[float, bool]:
    """How near, and whether that is in per cent."""
    percent = re.fullmatch(r"([\d.]+) %", str(text))
    return (float(percent[1]), True) if percent else (float(text), False)


def _off(value: float, wanted: float, within: str | float | None) -> str:
    """How far a value is from the wanted one, in per cent where its distance is; as text."""
    if not np.isfinite(wanted) or within is None:
        return ""
    percent = _within(within)[1]
    return f"{100 * (value / wanted - 1):+.2f} %" if percent else f"{value - wanted:+.4f}"


def _no_plateau(cases: pd.DataFrame, name: str) -> list[str]:
    """Which cases have their threshold on no plateau of this name, in one line."""
    there = cases[cases["there"]]
    flat = there.get(f"plateau_{name}", pd.Series(False, there.index)).fillna(False).astype(bool)
    bare = there["case"][~flat]
    percent = name.split("_")[0]
    return [f"no plateau at {percent} % in case {runs(bare)}"] if name and len(bare) else []


def _mentioned(rule: Spec, row: pd.Series) -> list[str]:
    """What a target says besides, of one case: texts with its numbers, if these are known."""
    known = {name for name, value in row.items() if value == value and value != ""}
    texts = rule.get("mention", [])
    return [text.format(**row) for text in texts if set(re.findall(r"{(\w+)", text)) <= known]


Answer = tuple[Spec, Finding, Finding | None]
"""A target, what was found of it, and what by a second rule that settles an open question."""


def answers(study: Study, frame: pd.DataFrame) -> list[Answer]:
    """Of every target of a study."""
    rules, found = Rules(frame, study.stated()), []
    for spec in study.part("targets"):
        with following(spec):
            first, other = rules.find(spec), spec.get("second")
            if spec.get("calibrated"):
                first = replace(first, why=f"{first.why}; no test: {spec['calibrated']}")
            found.append((spec, first, rules.find({"id": spec["id"], **other}) if other else None))
    return found


def targets(found: list[Answer]) -> Table:
    """The table of targets."""
    header = ["id", "value", "error", "target", "rule", "met", "why"]
    cells = [
        [spec["id"], *one.cells(), spec["stated"], spec["rule"], cell(one.met), one.why]
        for spec, one, _ in found
    ]
    return Table("Targets", header, cells, "targets")


def second_verdicts(found: list[Answer]) -> Table:
    """Of the targets that have a second rule: both verdicts side by side."""
    header = ["target", "stated", "met by the rule", "second rule", "here", "±", "met by it", "why"]
    cells = []
    for spec, first, two in found:
        if two is not None:
            told = spec["id"], spec["stated"], cell(first.met), spec["second"]["rule"]
            cells.append([*told, *two.cells(), cell(two.met), two.why])
    return Table("Targets by a second rule", header, cells, "second_verdicts")
