"""A study's tables, each described by data: what its columns show of which cases.

A column is `QUANTITY | FORMAT | FLAG`: a quantity or an expression of quantities; Python's format
of a number, `±` for a value to its error's first digit, `numberN` to N digits; and a column of yes
or no, of which `no` puts a star behind the number.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from analysis.estimators.limit import limit
from analysis.estimators.power_law import power_law
from analysis.rows import Row
from analysis.study.powers import powers
from analysis.study.selection import numbers, of_one_producer, select, spreads
from analysis.study.targets import Rules, apart
from analysis.study.words import UNKNOWN, Words, lines_to
from analysis.table import Table, number
from modal.tools.errors import InputError

Spec = Mapping[str, Any]


def tables(
    specs: Sequence[Spec], frame: pd.DataFrame, rules: Rules, rows: list[Row]
) -> list[Table]:
    """All tables of a study that have a line, in its order; `name` is that of their file."""
    kinds: dict[str, Callable[[Spec, pd.DataFrame], Table]] = {
        "means": means,
        "limit": limits,
        "pivot": pivot,
        "laws": laws,
        "checks": lambda spec, cases: checks(spec, rules),
        "side_by_side": lambda spec, cases: side_by_side(spec, cases, rows),
        "columns": of_columns,
        "trend": trend,
        "says": lambda spec, cases: says(spec, rules),
    }
    found = []
    for spec in specs:
        cases = select(frame[frame["there"]], spec.get("select", ""))
        kind = next((name for name in kinds if name in spec), "")
        if not kind:
            raise InputError(f"table {spec.get('name')}: give it one of {', '.join(kinds)}")
        table = kinds[kind](spec, cases)
        table.name = spec["name"]
        found.append(table)
    return [table for table in found if table.rows]


def whole(frame: pd.DataFrame, rows: list[Row]) -> Table:
    """Every number of every case, for files: value, error, and the scatter of samples."""
    words = {"case": "case", "name": "name", "kind": "packing", "mu_comp": "mu_comp"}
    words |= {"stress": "stress_pa", "record": "record", "unsettled": "settled"}
    there = frame[frame["there"]]
    quantities = list(dict.fromkeys(name for row in rows if not row.state for name in row.values))
    names = [f"{q}{end}" for q in quantities for end in ("", "_error", "_sample_error")]
    names += [name for name in there if name.endswith("_of_state") or name.startswith("plateau_")]
    names = [name for name in names if name in there]
    found = there[[*words, "packings", *names, "absent"]].rename(columns=words)
    found["settled"] = found["settled"].replace("", "yes")
    forms = [".3g" if name.endswith("_error") else ".7g" for name in found]
    lines = [list(map(_cell, line, forms)) for line in found.to_numpy(object)]
    return Table("All numbers", list(found.columns), lines, "table1")


def of_columns(spec: Spec, cases: pd.DataFrame) -> Table:
    """One line a case; `require` leaves out cases that do not have a quantity."""
    if "require" in spec:
        cases = cases[np.isfinite(numbers(cases, spec["require"]))]
    shown = {head: _column(cases, *map(str.strip, text.split("|"))) for head, text in
             spec["columns"].items()}  # fmt: skip
    shown = {head: cells for head, cells in shown.items() if any(cells)}
    lines = [list(line) for line in zip(*shown.values(), strict=True)]
    return Table(spec["title"], list(shown), lines)


def _column(cases: pd.DataFrame, text: str, form: str = "", flag: str = "") -> list[str]:
    """Cells of one column."""
    if form == "" and text in cases and not pd.api.types.is_numeric_dtype(cases[text]):
        return [_cell(value) for value in cases[text]]
    if form == "yes":
        known = pd.Series(True, cases.index)
        for name in set(cases.columns) & set(text.replace("(", " ").replace(")", " ").split()):
            known &= cases[name].notna()
        met = cases.eval(text, engine="python")
        return ["" if not k else "yes" if m else "no" for m, k in zip(met, known, strict=True)]
    values = numbers(cases, text)
    spread = spreads(cases, text)
    cells = []
    for name, value in values.items():
        if form == "±":
            cell = number(value, spread[name])
        elif form.startswith("number"):
            cell = number(value, np.nan, int(form[6:] or 4))
        else:
            cell = _cell(value, form or "g")
        star = flag and cell and not cases[flag].get(name)
        cells.append(f"{cell} *" if star else cell)
    return cells


def _cell(value: Any, form: str = "g") -> str:
    """A value as text, empty where it is not known."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, str) or value is None:
        return value or ""
    unit = form[form.index(" ") :] if " " in form else ""
    return f"{value:{form.split()[0]}}{unit}" if np.isfinite(value) else ""


def means(spec: Spec, cases: pd.DataFrame) -> Table:
    """Mean of each column over the cases that `means` does not tell apart, with standard error."""
    by, lines = spec["means"], []
    for key, members in cases.groupby(by):
        cells = [_cell(value) for value in key]
        for text in spec["columns"].values():
            values = numbers(members, text).dropna()
            cells.append(number(values.mean(), values.std() / np.sqrt(len(values))))
        lines.append([*cells, str(len(members))])
    return Table(spec["title"], [*by, *spec["columns"], "packings"], lines)


def limits(spec: Spec, cases: pd.DataFrame) -> Table:
    """Where means over cases lead as x goes to zero, by a straight line, beside those at `own`."""
    by, own, lines = spec["limit"]["by"], spec["limit"]["own"], []
    cases = cases.assign(x=numbers(cases, spec["limit"]["x"]))
    for key, members in cases.groupby(by):
        for text, name in spec["columns"].items():
            several = members.assign(y=numbers(members, name)).groupby("x")["y"]
            mean, error = several.mean(), several.sem()
            size = mean.index.to_numpy(float)
            found = limit(size, mean.to_numpy(), error.to_numpy())
            at = int(abs(size - own).argmin())
            here = mean.iloc[at], error.iloc[at]
            off = found.distance(size[at], *here)
            cells = [number(*here), number(found.value, found.error), _cell(off, "+.1f")]
            lines.append([*map(_cell, key), text, *cells, _cell(found.chi, ".1f")])
    header = ["quantity", "as it is", "limit", "distance in errors of the difference"]
    return Table(spec["title"], [*by, *header, "chi^2 a point to spare"], lines)


def pivot(spec: Spec, cases: pd.DataFrame) -> Table:
    """One line for each stress, a column for each group, and how far cases are apart, in %."""
    own, form = spec["pivot"], spec["pivot"].get("format", "g")
    found = cases.pivot_table(own["quantity"], "stress", "group", sort=False).sort_index()
    extra = {
        head: apart(select(cases, text), own["quantity"]) for head, text in own["apart"].items()
    }
    lines = [
        [
            f"{stress / 1e3:g}",
            *(_cell(value, form) for value in line),
            *(_cell(series.get(stress, np.nan), ".2f") for series in extra.values()),
        ]
        for stress, line in found.iterrows()
    ]
    return Table(spec["title"], ["stress, kPa", *map(str, found.columns), *extra], lines)


def trend(spec: Spec, cases: pd.DataFrame) -> Table:
    """At each stress the line of a quantity over x through some cases, carried on to others.

    Beside it the line of the quantity's logarithm: how much the form decides.
    """
    own, lines = spec["trend"], []
    producer, name = of_one_producer(cases, own["quantity"])
    for stress, one in lines_to(cases, name, own["x"], own["through"], own["to"]).iterrows():
        line, error, curve, there = one["line"], one["error"], one["curve"], one["there"]
        cells = [f"{stress / 1e3:g}", f"{line:.0f}", f"{error:.0f}", f"{there:.0f}"]
        cells += [f"{100 * (line / there - 1):+.1f}", f"{(line - there) / error:+.1f}"]
        lines.append([*cells, f"{curve:.0f}", f"{100 * (curve / there - 1):+.1f}"])
    header = ["stress, kPa", f"line, {producer}", "±", "there", "line less there, %"]
    header += ["in standard errors", "line of its logarithm", "that less there, %"]
    return Table(spec["title"], header, lines)


def says(spec: Spec, rules: Rules) -> Table:
    """What is stated beside what the cases say, each a sentence with their numbers."""
    words = Words(rules.frame)
    lines = [[stated, words(text)] for stated, text in spec["says"].items()]
    lines = [line for line in lines if UNKNOWN not in line[1]]
    return Table(spec["title"], ["stated", "here"], lines)


def laws(spec: Spec, cases: pd.DataFrame) -> Table:
    """Quantities as powers of others, within the cases of one group or of one stress.

    With `by: trend`, how the powers of the groups change with their void ratio: a slope, no power.
    """
    own, lines = spec["laws"], []
    for fit in own["fits"]:
        some, of = select(cases, fit.get("select", "")), fit.get("of", own["quantities"])
        if fit["by"] == "trend":
            for text, name in of.items():
                found = powers(some, fit["x"], name)
                if found is not None and len(found.e) > 2:
                    slope, error = found.trend
                    cells = [f"{found.which_e} (slope)", f"{slope:.4f}", _cell(error, ".2g")]
                    text = f"{text}: power over {fit['over']}"
                    lines.append(["each group", text, *cells, str(len(found.e))])
            continue
        for key, members in some.groupby(fit["by"], sort=False):
            where = f"{key / 1e3:g} kPa" if fit["by"] == "stress" else str(key)
            for text, name in of.items():
                y = numbers(members, name)
                law = power_law(numbers(members, fit["x"]), y)
                if np.isfinite(law.exponent):
                    cells = [f"{law.exponent:.4f}", _cell(law.error, ".2g"), str(y.notna().sum())]
                    lines.append([where, text, fit["over"], *cells])
    header = ["group", "quantity", "power of", "exponent", "standard error", "cases"]
    return Table(spec["title"], header, lines)


def checks(spec: Spec, rules: Rules) -> Table:
    """Rules side by side: each line holds its own quantities against the same checks."""
    own, lines = spec["checks"], []
    for line in own["rows"]:
        names = {n: text.format(**line) for n, text in own["names"].items()} | line
        cells = []
        for check in own["columns"].values():
            found = rules.find(_filled(check, names))
            known = np.isfinite(found.value)
            cells.append(f"{'yes' if found.met else 'no'}: {found.short}" if known else "")
        if any(cells):
            lines.append([line["title"], *cells])
    return Table(spec["title"], ["rule", *own["columns"]], lines)


def _filled(value: Any, names: Mapping[str, str]) -> Any:
    """A check with the names of a line's quantities in it."""
    if isinstance(value, Mapping):
        return {key: _filled(cell, names) for key, cell in value.items()}
    if isinstance(value, str):
        for name, text in names.items():
            value = value.replace(f"<{name}>", text)
    return value


def side_by_side(spec: Spec, cases: pd.DataFrame, rows: list[Row]) -> Table:
    """A table that each case has, of several cases beside one another."""
    header: list[str] = []
    columns: list[list[str]] = []
    for row in rows:
        own = row.tables.get(spec["side_by_side"], [])
        if row.name not in cases.index or len(own) < 2:
            continue
        head, *lines = own
        if not header:
            header, columns = [head[0]], [[line[0] for line in lines]]
        several = len(head) > 2
        header += [f"{text}, {row.label}" if several else row.label for text in head[1:]]
        columns += [list(column) for column in list(zip(*lines, strict=True))[1:]]
    lines = [list(line) for line in zip(*columns, strict=True)]
    return Table(spec["title"], header, [line for line in lines if any(line[1:])])
