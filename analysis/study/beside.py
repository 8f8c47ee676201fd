"""One case's numbers beside what theory and other ways give, and beside what a study states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from analysis.frame import frame_of, numbers
from analysis.rows import OF_RECORD, Row
from analysis.study.description import Study
from analysis.study.results import read_results
from analysis.study.targets import Rules
from analysis.table import Table, number
from modal.tools.errors import InputError

SHOWN = ("void_ratio", "coordination_number", "v_p_static_m_per_s", *OF_RECORD)
COLUMNS = "theory", "modal", "linear", "yade"


def table_of(study: Study, results: Path, name: str) -> tuple[Table, list[str]]:
    """A crystal by theory, modes, linear wave and YADE; of other packings the stated numbers.

    And the notes of the case; InputError where its result is not there.
    """
    rows = {row.name: row for row in read_results(results)}
    if name not in rows:
        raise InputError(f"{results}: no result of {name}; run it first")
    row, frame = rows[name], frame_of(rows.values(), study.cases)
    rules = Rules(frame, study.stated())
    case, lines = frame.loc[[name]], []
    if "comparison" in row.tables:
        return _compared(row, case, rules), row.notes
    for key in dict.fromkeys([*SHOWN, *(line["quantity"] for line, _ in rules.lines)]):
        value = float(numbers(case, key).iloc[0])
        stated, off = _stated(key, value, case, rules)
        if np.isfinite(value) and (stated or key in SHOWN):
            lines.append([key, number(value, row.spread(key)), stated, off])
    return Table(row.label, ["quantity", "here", "stated", "deviation"], lines), row.notes


def _stated(name: str, value: float, case: pd.DataFrame, rules: Rules) -> tuple[str, str]:
    """What is stated of a quantity, and how far a value is from it, as text."""
    line = rules.stated(name, case)
    if line is None:
        return "", ""
    if np.isfinite(line["value"]):
        return f"{line['value']:.5g}", f"{100 * (value / line['value'] - 1):+.3f} %"
    low, high = line["low"], line["high"]
    off = "outside" if value < low or value > high else "inside"
    return (f"> {low:.4g}" if np.isnan(high) else f"{low:.4g} to {high:.4g}"), off


def _compared(row: Row, case: pd.DataFrame, rules: Rules) -> Table:
    """The comparison that the case was measured with, and deviations in per cent."""
    lines = []
    for key, quantity, unit, *cells, note in row.tables["comparison"]:
        found = pd.to_numeric(pd.Series(cells, COLUMNS), errors="coerce")
        off = 100 * (found[1:] / found["theory"] - 1)
        percent = ["" if np.isnan(value) else f"{value:+.3f}" for value in off]
        own = found["modal"] if np.isnan(found["yade"]) else found["yade"]
        stated, apart = _stated(key, own, case, rules)
        apart = apart.removesuffix(" %") if np.isfinite(own) else ""
        lines.append([quantity, unit, *cells, stated, *percent, apart, note])
    header = ["quantity", "unit", *COLUMNS, "paper"]
    header += [f"{name}/theory %" for name in COLUMNS[1:]] + ["to paper %", "note"]
    return Table(row.label, header, lines)
