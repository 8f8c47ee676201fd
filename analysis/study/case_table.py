"""Print a case beside theory, other methods and published numbers, with a verdict for each row.

For a crystal there are columns for theory, modes, linear wave and YADE. The table has 80 columns of
text. For other packings each number is compared with a published one or, without one, with that of
another method.
"""

import csv
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from analysis import crystal
from analysis.case_result import CaseResult
from analysis.frame import frame_of, numbers
from analysis.result_file import read_results
from analysis.study.description import Study
from analysis.study.rules import Rules
from analysis.table import number
from modal.tools.errors import InputError

WIDTH = 80
"""Characters a line."""
EXACT_AGREEMENT = 0.5
"""Deviation, %, up to which numbers of a crystal agree. The paper has three to four digits."""
RANDOM_AGREEMENT = 2.0
"""Deviation, %, up to which numbers of a random packing agree; or twice the error, if that is
larger. Velocities of packings of 35,201 spheres scatter by 1.3 %."""
SMALLEST_SHOWN_DEVIATION = 0.01
"""Smaller deviations, %, are shown as this one."""
QUANTITIES: Final[Mapping[str, Mapping[str, str]]] = {
    line["quantity"]: line
    for line in csv.DictReader(Path(__file__).with_name("case_rows.csv").read_text().splitlines())
}
"""How quantities of a random packing are shown: `shown`, the quantity `beside` which each stands
and the `method` of that one, and the cause of a difference (`because`)."""
ALWAYS_SHOWN = (
    "void_ratio",
    "coordination_number",
    "v_p_modes_fitted_m_per_s",
    "v_p_long_waves_linear_m_per_s",
    "v_p_long_waves_yade_m_per_s",
    "v_p_first_peaks_m_per_s",
    "f_low_pass_2_khz",
    "f_low_pass_1_khz",
)
"""Numbers of a random packing that are shown even if nothing is stated of them."""
CRYSTAL_LEGEND = (
    "theory: closed form; modes, linear: eigenmodes and a wave of the contact",
    "springs; YADE: discrete elements. P-waves along z; low-pass: highest frequency",
    "that passes; at 2 %: above it less than 2 % of the amplitude arrives.",
)
RANDOM_LEGEND = (
    "moduli, modes, linear: strains, eigenmodes and a wave of the contact springs;",
    "YADE: discrete elements. P-waves along z; low-pass at 2 %: above this frequency",
    "less than 2 % of the amplitude arrives; D: diameter of a sphere.",
)
READ_NEXT = (
    "Read next: docs/results.md, how sure these numbers are and what disagrees;",
    "docs/workflow.md, other cases, all figures. Measure your own: docs/tutorial.md",
)
UNKNOWN_CAUSE = "of a cause that is not known"


class Verdict(NamedTuple):
    """A text on whether numbers agree; `differs` is None if there is nothing to compare."""

    text: str
    differs: bool | None

    def why(self, agrees_because: str, differs_because: str) -> str:
        """Return a line with the reason for the verdict, without indent; empty without a reason."""
        if self.differs:
            return f"differs because {differs_because or UNKNOWN_CAUSE}"
        if self.differs is False and agrees_because:
            return f"agrees because {agrees_because}"
        return ""


class CaseRow(NamedTuple):
    """A row of the table: quantity, numbers, verdict, and an explanation below the row."""

    shown: str
    cells: Sequence[str]
    verdict: str
    why: str


class Stated(NamedTuple):
    """A published number or range: its text and its two ends, equal for a single number."""

    text: str
    low: float
    high: float
    agrees_because: str
    differs_because: str


def case_text(study: Study, results: Path, name: str) -> tuple[str, list[str]]:
    """Return the table of one case as text of 80 columns, and its notes.

    Raises InputError if the case has no result.
    """
    rows = {row.name: row for row in read_results(results)}
    if name not in rows:
        raise InputError("no_results", f"{results}: no result of {name}", remedy="run it first")
    row = rows[name]
    frame = frame_of(rows.values(), study.cases)
    rules = Rules(frame, study.stated())
    case = frame.loc[[name]]
    if "comparison" in row.tables:
        header = ["quantity", "theory", "modes", "linear", "YADE", "paper"]
        lines = _crystal_rows(row, case, rules)
        legend = CRYSTAL_LEGEND
        widths = [24, 6, 6, 6, 6, 6]
    else:
        header = ["quantity", "here", "beside"]
        lines = _random_rows(row, case, rules)
        legend = RANDOM_LEGEND
        widths = [25, 16, 16]
    text = [row.label, *legend, "", _line([*header, "verdict"], widths)]
    for line in lines:
        text.append(_line([line.shown, *line.cells, line.verdict], widths))
        text += textwrap.wrap(
            line.why,
            WIDTH,
            initial_indent="    ",
            subsequent_indent="    ",
            break_on_hyphens=False,
        )
    return "\n".join([*text, "", *READ_NEXT]), row.notes


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    """Return a line of the table; the last cell is not padded."""
    padded = [cell.ljust(width) for cell, width in zip(cells, widths, strict=False)]
    return " ".join([*padded, cells[-1]]).rstrip()


def _crystal_rows(row: CaseResult, case: pd.DataFrame, rules: Rules) -> list[CaseRow]:
    """Return the rows of a crystal that compare at least two numbers."""
    shown = {line["id"]: line for line in crystal.table_lines()}
    lines = []
    for key, _, _, *cells, _ in row.tables["comparison"]:
        description = shown.get(key)
        if description is None or not description["shown"]:
            continue
        values = list(pd.to_numeric(pd.Series(cells), errors="coerce"))
        stated = _stated(rules, key, case)
        low = np.nan
        if stated is not None and stated.low == stated.high:
            low = stated.low
        if key == crystal.DEVIATION_ROW:
            # These numbers are deviations from theory themselves.
            deviation = float(np.nanmax(values))
        else:
            deviation = _largest_deviation(values, low)
        verdict = verdict_of(deviation, EXACT_AGREEMENT)
        why = verdict.why("", description["because"])
        texts = [*map(_short, values), _short(low)]
        lines.append(CaseRow(description["shown"], texts, verdict.text, why))
    return lines


def _largest_deviation(values: Sequence[float], stated: float) -> float:
    """Return the largest deviation from the first known value, %.

    The stated number is compared with the last known value: YADE's, if there is one.
    """
    known = [value for value in values if np.isfinite(value)]
    deviations = [abs(value / known[0] - 1) for value in known[1:]]
    if np.isfinite(stated):
        deviations.append(abs(known[-1] / stated - 1))
    return 100 * max(deviations, default=np.nan)


def _random_rows(row: CaseResult, case: pd.DataFrame, rules: Rules) -> list[CaseRow]:
    """Return the rows of a packing that is not a crystal."""
    stated_quantities = [statement["quantity"] for statement, _ in rules.statements]
    lines = []
    for quantity in dict.fromkeys([*ALWAYS_SHOWN, *stated_quantities]):
        value = float(numbers(case, quantity).iloc[0])
        stated = _stated(rules, quantity, case)
        if not np.isfinite(value) or (stated is None and quantity not in ALWAYS_SHOWN):
            continue
        error = float(np.nan_to_num(row.spread(quantity)))
        description = QUANTITIES.get(quantity, {"shown": quantity, "beside": "", "because": ""})
        if not description["shown"]:
            continue
        beside = ""
        verdict = Verdict("nothing to compare", None)
        why = ""
        if stated is not None:
            beside = f"{stated.text} paper"
            verdict = _verdict_beside(value, error, stated.low, stated.high)
            why = verdict.why(stated.agrees_because, stated.differs_because)
        elif _is_from_another_method(description["beside"], row):
            other = row.value(description["beside"])
            other_error = float(np.nan_to_num(row.spread(description["beside"])))
            other_text, _, _ = number(other, other_error).partition(" ±")
            beside = f"{other_text} {description['method']}"
            verdict = _verdict_beside(value, float(np.hypot(error, other_error)), other, other)
            why = verdict.why("", description["because"])
        cells = [number(value, error), beside]
        lines.append(CaseRow(description["shown"], cells, verdict.text, why))
    return lines


def _is_from_another_method(beside: str, row: CaseResult) -> bool:
    """Return whether the quantity `beside` is known, and not read from the linear wave itself."""
    is_own = row.record == "linear" and beside.startswith("f_low_pass")
    return bool(beside) and np.isfinite(row.value(beside)) and not is_own


def _verdict_beside(value: float, error: float, low: float, high: float) -> Verdict:
    """Return the verdict on a value beside a number or a range.

    A range is not widened by the error of the value.
    """
    if low == high:
        percent = abs(low) / 100
        return verdict_of(abs(value - low) / percent, max(RANDOM_AGREEMENT, 2 * error / percent))
    nearest = float(np.clip(value, low, high))
    if value == nearest:
        return Verdict("agrees within range", False)
    return verdict_of(100 * abs(value / nearest - 1), 0.0)


def verdict_of(deviation: float, agreement: float) -> Verdict:
    """Return the verdict on a deviation, %, whose shown digits are rounded up.

    `agreement` is the largest deviation, %, of numbers that agree.

    >>> verdict_of(0.0123, 0.5).text, verdict_of(59.5, 2.0).text
    ('agrees within 0.02 %', 'differs by 60 %')
    """
    if np.isnan(deviation):
        return Verdict("nothing to compare", None)
    if deviation == 0:
        return Verdict("agrees exactly", False)
    largest = max(deviation, SMALLEST_SHOWN_DEVIATION)
    step = 10.0 ** np.floor(np.log10(largest))
    if largest >= 1:
        step = step / 10
    # Round-off does not lift 0.02 to 0.03.
    shown = np.ceil(largest / step * (1 - 1e-9)) * step
    if deviation > agreement:
        return Verdict(f"differs by {shown:.3g} %", True)
    return Verdict(f"agrees within {shown:.3g} %", False)


def _stated(rules: Rules, quantity: str, case: pd.DataFrame) -> Stated | None:
    """Return the published number for a quantity of a case; None if there is none."""
    row = rules.stated_row(quantity, case)
    if row is None:
        return None
    reasons = [row.get(name) for name in ("agrees_because", "differs_because")]
    texts = [reason if isinstance(reason, str) else "" for reason in reasons]
    if np.isfinite(row["value"]):
        return Stated(f"{row['value']:.5g}", row["value"], row["value"], *texts)
    low, high = row["low"], row["high"]
    if np.isnan(high):
        return Stated(f"> {low:.4g}", low, np.inf, *texts)
    if np.isnan(low):
        return Stated(f"< {high:.4g}", -np.inf, high, *texts)
    return Stated(f"{low:.4g} to {high:.4g}", low, high, *texts)


def _short(value: float) -> str:
    """Return a number in at most six characters; empty if it is not known."""
    if not np.isfinite(value):
        return ""
    if 0 < abs(value) < 1e-3:
        return f"{value:.0e}"
    if abs(value) < 1:
        return f"{value:.4f}"
    return f"{value:.5g}"
