"""Make a study's tables from data that name columns and cases.

A column is `QUANTITY | FORMAT | FLAG`. QUANTITY is a quantity or an expression of quantities.
FORMAT is Python's format of a number, or `±` for a value rounded to its error's first digit. FLAG
is a column of yes or no; `no` puts a star after the number.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd

from analysis.case_result import CaseResult
from analysis.estimators.fits import power_law, straight_line
from analysis.frame import mean_with_error, numbers, select, spreads
from analysis.study.captions import UNKNOWN, Captions
from analysis.study.description import following
from analysis.study.fields import fill, number_format
from analysis.study.rules import Rules
from analysis.table import Table, cell, number
from modal.tools.errors import InputError

Spec = Mapping[str, Any]
"""Description of a table, as the file of tables has it."""
TableKind = Literal["means", "limit", "laws", "checks", "side_by_side", "columns", "says"]
TABLE_KINDS: tuple[TableKind, ...] = get_args(TableKind)
"""Keys that name the kind of a table; if a table has several, the first one in this order is
used."""
Cells = tuple[list[str], list[list[str]]]
"""A header, and lines of the same length."""
NAMES_OF_COLUMNS = {
    "case": "case",
    "name": "name",
    "kind": "packing",
    "mu_comp": "mu_comp",
    "stress": "stress_pa",
    "record": "record",
    "unsettled": "settled",
}
"""Columns with which the table of all numbers begins, and their names in that table."""


def make_tables(specs: Sequence[Spec], rules: Rules) -> list[Table]:
    """Return all tables of a study that have a line, in the study's order.

    `name` of a table is the name of its file. Raises InputError if a spec cannot be followed.
    """
    tables = []
    for spec in specs:
        cases = select(rules.frame[rules.frame["there"]], spec.get("select", ""))
        kind = _table_kind(spec)
        with following(spec):
            header, lines = _tabulate(kind, spec, cases, rules)
            tables.append(Table(spec["title"], header, lines, spec["name"]))
    return [table for table in tables if table.rows]


def _table_kind(spec: Spec) -> TableKind:
    """Return the first kind of table that a spec names; InputError if it names none."""
    for kind in TABLE_KINDS:
        if kind in spec:
            return kind
    raise InputError(
        "table_kind", f"table {spec['name']}", remedy=f"give it one of {', '.join(TABLE_KINDS)}"
    )


def _tabulate(kind: TableKind, spec: Spec, cases: pd.DataFrame, rules: Rules) -> Cells:
    """Return header and lines of a table of this kind."""
    if kind == "means":
        return tabulate_means(spec, cases)
    if kind == "limit":
        return tabulate_limits(spec, cases)
    if kind == "laws":
        return tabulate_laws(spec, cases)
    if kind == "checks":
        return tabulate_checks(spec, rules)
    if kind == "side_by_side":
        return tabulate_side_by_side(spec, cases)
    if kind == "says":
        return tabulate_statements(spec, rules)
    return tabulate_columns(spec, cases)


def tabulate_all_numbers(frame: pd.DataFrame) -> Table:
    """Return every number of every case, for files: value, error, and the scatter of samples."""
    present = frame[frame["there"]].replace({"unsettled": {"": "yes"}})
    quantities = dict.fromkeys(name for row in present["row"] for name in row.columns)
    names = [f"{name}{end}" for name in quantities for end in ("", "_error", "_sample_error")]
    names += [name for name in present if name.endswith("_of_state") or name.startswith("plateau_")]
    known_names = [name for name in names if name in present]
    columns = [*NAMES_OF_COLUMNS, "packings", *known_names, "absent"]
    table = present[columns].rename(columns=NAMES_OF_COLUMNS)
    formats = [".3g" if name.endswith("_error") else ".7g" for name in table]
    lines = [list(map(cell, line, formats)) for line in table.to_numpy(object)]
    return Table("All numbers", list(table.columns), lines, "table1")


def tabulate_columns(spec: Spec, cases: pd.DataFrame) -> Cells:
    """Return a line for each case; `require` leaves out cases without a quantity.

    Columns without any number are left out.
    """
    if "require" in spec:
        cases = cases[np.isfinite(numbers(cases, spec["require"]))]
    columns = {}
    for head, text in spec["columns"].items():
        cells = _column(cases, text)
        if any(cells):
            columns[head] = cells
    return list(columns), [list(line) for line in zip(*columns.values(), strict=True)]


def _column(cases: pd.DataFrame, text: str) -> list[str]:
    """Return the cells of one column, described as QUANTITY | FORMAT | FLAG."""
    parts = [part.strip() for part in text.split("|")]
    name, form, flag = (parts + ["", ""])[:3]
    if not form and name in cases and not pd.api.types.is_numeric_dtype(cases[name]):
        return [cell(value) for value in cases[name]]
    values = numbers(cases, name)
    if form == "±":
        cells = list(map(number, values, spreads(cases, name)))
    else:
        digits, *unit = (form or "g").split()
        form_with_unit = " ".join([number_format(digits), *unit])
        cells = [cell(value, form_with_unit) for value in values]
    if not flag:
        return cells
    return [
        f"{text} *" if text and not good else text
        for text, good in zip(cells, cases[flag], strict=True)
    ]


def tabulate_means(spec: Spec, cases: pd.DataFrame) -> Cells:
    """Return means of each column, with errors, over cases that agree in the columns `means`."""
    columns_that_agree = spec["means"]
    lines = []
    for key, members in cases.groupby(columns_that_agree):
        cells = [number(*mean_with_error(members, text)) for text in spec["columns"].values()]
        lines.append([*map(cell, key), *cells, str(len(members))])
    return [*columns_that_agree, *spec["columns"], "packings"], lines


def tabulate_limits(spec: Spec, cases: pd.DataFrame) -> Cells:
    """Return the limits of means over cases as x goes to zero, by a straight line.

    The table also has the mean at the x nearest to `own`, and its distance from a line that is
    fitted without this mean.
    """
    by = spec["limit"]["by"]
    cases = cases.assign(x=numbers(cases, spec["limit"]["x"]))
    lines = []
    for key, members in cases.groupby(by):
        for label, quantity in spec["columns"].items():
            cells = _limit_cells(members, quantity, spec["limit"]["own"])
            lines.append([*map(cell, key), label, *cells])
    header = ["quantity", "as it is", "limit", "distance in errors of the difference"]
    return [*by, *header, "chi^2 a point to spare"], lines


def _limit_cells(members: pd.DataFrame, quantity: str, reference: float) -> list[str]:
    """Return the cells of one limit, with the mean at the x nearest to `reference`."""
    groups = members.groupby("x")
    x = np.array([value for value, _ in groups], float)
    means = np.array([mean_with_error(group, quantity) for _, group in groups]).reshape(-1, 2)
    line = straight_line(x, *means.T)
    nearest = int(abs(x - reference).argmin())
    distance = line.distance(x[nearest], *means[nearest])
    return [
        number(*means[nearest]),
        number(*line.at(0.0)),
        cell(distance, "+.1f"),
        cell(line.chi, ".1f"),
    ]


def tabulate_statements(spec: Spec, rules: Rules) -> Cells:
    """Return a table of published statements beside sentences with the numbers of the cases.

    A sentence with a number that is not known is left out.
    """
    captions = Captions(rules.frame)
    lines = [[stated, captions(text)] for stated, text in spec["says"].items()]
    return ["stated", "here"], [line for line in lines if UNKNOWN not in line[1]]


def tabulate_laws(spec: Spec, cases: pd.DataFrame) -> Cells:
    """Return quantities as powers of others, within the cases of one group or of one stress."""
    lines = []
    for fit in spec["laws"]["fits"]:
        fitted = select(cases, fit.get("select", ""))
        quantities = fit.get("of", spec["laws"]["quantities"])
        for key, members in fitted.groupby(fit["by"], sort=False):
            group = str(key)
            if fit["by"] == "stress":
                group = f"{float(key) / 1e3:g} kPa"
            for label, quantity in quantities.items():
                y = numbers(members, quantity)
                law = power_law(numbers(members, fit["x"]), y)
                if np.isfinite(law.exponent):
                    exponent = [f"{law.exponent:.4f}", cell(law.error, ".2g")]
                    lines.append([group, label, fit["over"], *exponent, str(y.notna().sum())])
    return ["group", "quantity", "power of", "exponent", "standard error", "cases"], lines


def tabulate_checks(spec: Spec, rules: Rules) -> Cells:
    """Return a table of rules side by side: each line applies the same checks to its quantities."""
    checks = spec["checks"]
    lines = []
    for row in checks["rows"]:
        names = {name: fill(text, row) for name, text in checks["names"].items()} | row
        findings = [rules.find(_insert_names(check, names)) for check in checks["columns"].values()]
        cells = [
            f"{cell(finding.met)}: {finding.short}" if np.isfinite(finding.value) else ""
            for finding in findings
        ]
        if any(cells):
            lines.append([row["title"], *cells])
    return ["rule", *checks["columns"]], lines


def _insert_names(check: Any, names: Mapping[str, str]) -> Any:
    """Return a check in which each `<NAME>` is replaced by its quantity in `names`."""
    if isinstance(check, Mapping):
        return {key: _insert_names(value, names) for key, value in check.items()}
    if isinstance(check, str):
        return re.sub(r"<(\w+)>", lambda place: names.get(place[1], place[0]), check)
    return check


def tabulate_side_by_side(spec: Spec, cases: pd.DataFrame) -> Cells:
    """Return the tables `side_by_side` of several cases as one table.

    `quantities` names the quantity of a line: its number then has the error that it has in all
    tables, and the numbers of other lines have none.
    """
    parts = []
    for row in cases["row"]:
        table = row.tables.get(spec["side_by_side"])
        if not table:
            continue
        (first, *heads), *lines = table
        if "quantities" in spec:
            lines = [_with_error_of_quantity(line, spec["quantities"], row) for line in lines]
        names = [row.label]
        if len(heads) > 1:
            names = [f"{head}, {row.label}" for head in heads]
        parts.append(pd.DataFrame(lines, columns=[first, *names]).set_index(first))
    if not parts:
        return [], []
    joined = pd.concat(parts, axis=1).reset_index().fillna("")
    return list(joined), [line for line in joined.to_numpy().tolist() if any(line[1:])]


def _with_error_of_quantity(
    line: Sequence[str], quantities: Mapping[str, str], row: CaseResult
) -> list[str]:
    """Return the line of a table with the error of its quantity, or without one.

    What stands behind the number and its error, such as `no plateau`, stays.
    """
    title, text = line
    shown, _, remark = text.partition(", ")
    shown = shown.partition(" ±")[0]
    column = quantities.get(title, "")
    if shown and np.isfinite(row.value(column)):
        shown = number(row.value(column), row.spread(column))
    return [title, ", ".join(part for part in (shown, remark) if part)]
