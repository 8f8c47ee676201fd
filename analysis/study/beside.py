"""One case's numbers beside what theory and other ways give, and beside what a study states."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.rows import Row
from analysis.study.selection import numbers
from analysis.study.targets import Rules
from analysis.table import Table, number

SHOWN = ("void_ratio", "coordination_number", "v_p_static_m_per_s")
COLUMNS = "theory", "modal", "linear", "yade"


def table_of(row: Row, frame: pd.DataFrame, rules: Rules) -> Table:
    """A crystal by theory, modes, linear wave and YADE; of other packings the stated numbers."""
    case = frame.loc[[row.name]]
    if "comparison" in row.tables:
        return _compared(row, case, rules)
    names = [name for name in (*SHOWN, *row.values) if name in row.of_record or name in SHOWN]
    names += list(rules.table["quantity"])
    lines = []
    for name in dict.fromkeys(names):
        value = float(numbers(case, name).iloc[0])
        stated, off = _stated(name, value, case, rules)
        if np.isfinite(value) and (stated or name in row.of_record or name in SHOWN):
            lines.append([name, number(value, row.spread(name)), stated, off])
    return Table(row.label, ["quantity", "here", "stated", "deviation"], lines)


def _stated(name: str, value: float, case: pd.DataFrame, rules: Rules) -> tuple[str, str]:
    """What is stated of a quantity, and how far a value is from it, as text."""
    line = rules.stated(name, case)
    if line is None:
        return "", ""
    if np.isfinite(line["value"]):
        return f"{line['value']:.5g}", f"{100 * (value / line['value'] - 1):+.3f} %"
    low, high = (-np.inf if np.isnan(line["low"]) else line["low"], line["high"])
    high = np.inf if np.isnan(high) else high
    text = f"{low:.4g} to {high:.4g}" if np.isfinite([low, high]).all() else f"> {low:.4g}"
    return text, "inside" if low <= value <= high else "outside"


def _compared(row: Row, case: pd.DataFrame, rules: Rules) -> Table:
    """The comparison that the case was measured with, and deviations in per cent."""
    lines = []
    for key, quantity, unit, *cells, note in row.tables["comparison"]:
        found = dict(zip(COLUMNS, (float(cell or "nan") for cell in cells), strict=True))
        own = found["yade"] if np.isfinite(found["yade"]) else found["modal"]
        off = [100 * (found[name] / found["theory"] - 1) for name in COLUMNS[1:]]
        percent = [f"{value:+.3f}" if np.isfinite(value) else "" for value in off]
        stated, apart = _stated(key, own, case, rules)
        apart = apart.removesuffix(" %") if np.isfinite(own) else ""
        lines.append([quantity, unit, *cells, stated, *percent, apart, note])
    header = ["quantity", "unit", *COLUMNS, "paper"]
    header += [f"{name}/theory %" for name in COLUMNS[1:]] + ["to paper %", "note"]
    return Table(row.label, header, lines)
