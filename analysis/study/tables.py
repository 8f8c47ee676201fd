"""A study's tables, each described by data: what its columns show of which cases.

A column is `QUANTITY | FORMAT | FLAG`: a quantity or an expression of quantities; Python's format
of a number, or `±` for a value to its error's first digit; and a column of yes or no, of which
`no` puts a star behind the number.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.crystal import COLUMNS
from analysis.estimators.fits import power_law, straight_line
from analysis.frame import frame_of, mean_with_error, numbers, select, spreads
from analysis.rows import OF_RECORD, CaseResult, read_results
from analysis.study.captions import UNKNOWN, Captions
from analysis.study.description import Study, following
from analysis.study.fields import fill, number_format
from analysis.study.targets import Rules
from analysis.table import Table, cell, number
from modal.tools.errors import InputError

Spec = Mapping[str, Any]
Cells = tuple[list[str], list[list[str]]]
"""A header, and lines as long."""
SHOWN = ("void_ratio", "coordination_number", "v_p_static_m_per_s", *OF_RECORD)
"""Numbers of a case that are shown, stated or not."""


def tables(specs: Sequence[Spec], rules: Rules) -> list[Table]:
    """All tables of a study that have a line, in its order; `name` is that of their file."""
    kinds: dict[str, Callable[[Spec, pd.DataFrame], Cells]] = {
        "means": means,
        "limit": limits,
        "laws": laws,
        "checks": lambda spec, cases: checks(spec["checks"], rules),
        "side_by_side": lambda spec, cases: side_by_side(spec["side_by_side"], cases),
        "columns": of_columns,
        "says": lambda spec, cases: says(spec["says"], rules.frame),
    }
    found = []
    for spec in specs:
        cases = select(rules.frame[rules.frame["there"]], spec.get("select", ""))
        kind = next((name for name in kinds if name in spec), "")
        if not kind:
            raise InputError(
                "input", f"table {spec['name']}", remedy=f"give it one of {', '.join(kinds)}"
            )
        with following(spec):
            found.append(Table(spec["title"], *kinds[kind](spec, cases), spec["name"]))
    return [table for table in found if table.rows]


def whole(frame: pd.DataFrame) -> Table:
    """Every number of every case, for files: value, error, and the scatter of samples."""
    words = {"case": "case", "name": "name", "kind": "packing", "mu_comp": "mu_comp"}
    words |= {"stress": "stress_pa", "record": "record", "unsettled": "settled"}
    there = frame[frame["there"]].replace({"unsettled": {"": "yes"}})
    quantities = dict.fromkeys(name for row in there["row"] for name in row.columns)
    names = [f"{q}{end}" for q in quantities for end in ("", "_error", "_sample_error")]
    names += [name for name in there if name.endswith("_of_state") or name.startswith("plateau_")]
    names = [*words, "packings", *(name for name in names if name in there), "absent"]
    found = there[names].rename(columns=words)
    forms = [".3g" if name.endswith("_error") else ".7g" for name in found]
    lines = [list(map(cell, line, forms)) for line in found.to_numpy(object)]
    return Table("All numbers", list(found.columns), lines, "table1")


def of_columns(spec: Spec, cases: pd.DataFrame) -> Cells:
    """One line a case; `require` leaves out cases that do not have a quantity."""
    if "require" in spec:
        cases = cases[np.isfinite(numbers(cases, spec["require"]))]
    shown = {head: _column(cases, text) for head, text in spec["columns"].items()}
    shown = {head: cells for head, cells in shown.items() if any(cells)}
    return list(shown), [list(line) for line in zip(*shown.values(), strict=True)]


def _column(cases: pd.DataFrame, text: str) -> list[str]:
    """Cells of one column."""
    name, form, flag, *_ = [*map(str.strip, text.split("|")), "", ""]
    if not form and name in cases and not pd.api.types.is_numeric_dtype(cases[name]):
        return [cell(value) for value in cases[name]]
    values = zip(numbers(cases, name), spreads(cases, name), strict=True)
    if form == "±":
        cells = [number(*pair) for pair in values]
    else:
        digits, *unit = (form or "g").split()
        shown = " ".join([number_format(digits), *unit])
        cells = [cell(value, shown) for value, _ in values]
    if not flag:
        return cells
    pairs = zip(cells, cases[flag], strict=True)
    return [f"{text} *" if text and not yes else text for text, yes in pairs]


def means(spec: Spec, cases: pd.DataFrame) -> Cells:
    """Mean of each column over the cases that `means` does not tell apart, with its error."""
    by, lines = spec["means"], []
    for key, members in cases.groupby(by):
        cells = [number(*mean_with_error(members, text)) for text in spec["columns"].values()]
        lines.append([*map(cell, key), *cells, str(len(members))])
    return [*by, *spec["columns"], "packings"], lines


def limits(spec: Spec, cases: pd.DataFrame) -> Cells:
    """Where means over cases lead as x goes to zero, by a straight line, beside those at `own`."""
    by, own, lines = spec["limit"]["by"], spec["limit"]["own"], []
    cases = cases.assign(x=numbers(cases, spec["limit"]["x"]))
    for key, members in cases.groupby(by):
        for text, name in spec["columns"].items():
            groups = members.groupby("x")
            size = np.array([x for x, _ in groups], float)
            several = np.array([mean_with_error(some, name) for _, some in groups]).reshape(-1, 2)
            found = straight_line(size, *several.T)
            at = int(abs(size - own).argmin())
            here = several[at]
            off = found.distance(size[at], *here)
            cells = [number(*here), number(*found.at(0.0)), cell(off, "+.1f")]
            lines.append([*map(cell, key), text, *cells, cell(found.chi, ".1f")])
    header = ["quantity", "as it is", "limit", "distance in errors of the difference"]
    return [*by, *header, "chi^2 a point to spare"], lines


def says(spec: Spec, frame: pd.DataFrame) -> Cells:
    """What is stated beside what the cases say, each a sentence with their numbers."""
    words = Captions(frame)
    lines = [[stated, words(text)] for stated, text in spec.items()]
    return ["stated", "here"], [line for line in lines if UNKNOWN not in line[1]]


def laws(spec: Spec, cases: pd.DataFrame) -> Cells:
    """Quantities as powers of others, within the cases of one group or of one stress."""
    lines = []
    for fit in spec["laws"]["fits"]:
        some, of = select(cases, fit.get("select", "")), fit.get("of", spec["laws"]["quantities"])
        for key, members in some.groupby(fit["by"], sort=False):
            where = f"{float(key) / 1e3:g} kPa" if fit["by"] == "stress" else str(key)
            for text, name in of.items():
                y = numbers(members, name)
                law = power_law(numbers(members, fit["x"]), y)
                if np.isfinite(law.exponent):
                    cells = f"{law.exponent:.4f}", cell(law.error, ".2g"), str(y.notna().sum())
                    lines.append([where, text, fit["over"], *cells])
    return ["group", "quantity", "power of", "exponent", "standard error", "cases"], lines


def checks(spec: Spec, rules: Rules) -> Cells:
    """Rules side by side: each line holds its own quantities against the same checks."""
    lines = []
    for line in spec["rows"]:
        names = {name: fill(text, line) for name, text in spec["names"].items()} | line
        found = [rules.find(_named(check, names)) for check in spec["columns"].values()]
        cells = [f"{cell(one.met)}: {one.short}" if np.isfinite(one.value) else "" for one in found]
        if any(cells):
            lines.append([line["title"], *cells])
    return ["rule", *spec["columns"]], lines


def _named(check: Any, names: Mapping[str, str]) -> Any:
    """Return a check with quantities in the place of each `<NAME>` that a line gives one."""
    if isinstance(check, Mapping):
        return {key: _named(value, names) for key, value in check.items()}
    if isinstance(check, str):
        return re.sub(r"<(\w+)>", lambda place: names.get(place[1], place[0]), check)
    return check


def side_by_side(name: str, cases: pd.DataFrame) -> Cells:
    """A table that each case has, of several cases beside one another."""
    parts = []
    for row in cases["row"]:
        if row.tables.get(name):
            (first, *head), *lines = row.tables[name]
            names = [f"{text}, {row.label}" for text in head] if len(head) > 1 else [row.label]
            parts.append(pd.DataFrame(lines, columns=[first, *names]).set_index(first))
    if not parts:
        return [], []
    found = pd.concat(parts, axis=1).reset_index()
    return list(found), [line for line in found.to_numpy().tolist() if any(line[1:])]


def table_of(study: Study, results: Path, name: str) -> tuple[Table, list[str]]:
    """A crystal by theory, modes, linear wave and YADE; of other packings the stated numbers.

    And the notes of the case; InputError where its result is not there.
    """
    rows = {row.name: row for row in read_results(results)}
    if name not in rows:
        raise InputError("input", f"{results}: no result of {name}", remedy="run it first")
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


def _compared(row: CaseResult, case: pd.DataFrame, rules: Rules) -> Table:
    """The comparison that the case was measured with, and deviations in per cent."""
    lines = []
    for key, quantity, unit, *cells, note in row.tables["comparison"]:
        found = pd.to_numeric(pd.Series(cells, COLUMNS), errors="coerce")
        off = 100 * (found[1:] / found["theory"] - 1)
        percent = [cell(value, "+.3f") for value in off]
        own = found["modal"] if np.isnan(found["yade"]) else found["yade"]
        stated, apart = _stated(key, own, case, rules)
        apart = apart.removesuffix(" %") if np.isfinite(own) else ""
        lines.append([quantity, unit, *cells, stated, *percent, apart, note])
    header = ["quantity", "unit", *COLUMNS, "paper"]
    header += [f"{name}/theory %" for name in COLUMNS[1:]] + ["to paper %", "note"]
    return Table(row.label, header, lines)
