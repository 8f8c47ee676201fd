"""How cases look in figures over many: a colour for each friction, a marker for each stress.

Colours grow lighter with friction, so that they are told apart in grey, too; crystals are white.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from analysis.figures.picture import Panel
from analysis.rows import Row, groups_of, of_one_producer
from modal.tools.errors import InputError

SHADES = "#440154", "#463480", "#355f8d", "#25848e", "#22a884", "#5ec962", "#bddf26"
"""Of the frictions, lowest first."""
STRESS_MARKS = {1e4: "o", 1e5: "s", 1e6: "^", 1e7: "D"}
EDGE: dict[str, Any] = {"color": "k", "ls": "none", "mec": "k", "mew": 0.5, "ms": 5}
STATED = EDGE | {"marker": "*", "ms": 11, "mfc": "none", "mew": 1.2}
BARS: dict[str, Any] = {"color": "k", "lw": 0.6, "capsize": 1.5, "zorder": 1.9}
THIN: dict[str, Any] = {"lw": 0.7, "ls": "-", "zorder": 1.5}
LOG: dict[str, Any] = {"xscale": "log", "yscale": "log"}
CONTACTS = "coordination_number_bearing"
ON_CONTACTS = "contacts a force-bearing sphere"
BEYOND = f"{ON_CONTACTS}, less 4"
ISOSTATIC = 4
"""Contacts of a sphere with friction below which a packing is floppy."""
Number = str | Callable[[Row], float]
"""Of a case: a column of its row, or what is made of several."""
AXES: dict[str, Number] = {
    "void ratio": "void_ratio",
    "stress (kPa)": lambda row: row.stress / 1e3,
    ON_CONTACTS: CONTACTS,
    BEYOND: lambda row: row.value(CONTACTS) - ISOSTATIC,
}
"""What cases are drawn against, by its label."""


def with_curve(rows: list[Row], name: str, what: str) -> list[Row]:
    """The rows that have a curve; InputError, saying `what` they lack, where none has."""
    if found := [row for row in rows if name in row.curves]:
        return found
    raise InputError(f"no case has a {what}; keep one: measure FILE --keep DIR")


def of_record(rows: list[Row], *columns: str) -> tuple[str, ...]:
    """Columns with `{record}` in them as those of one producer of all rows, its name first."""
    return of_one_producer((row.record for row in rows), *columns)


def mark(row: Row) -> str:
    """The marker of a case's stress."""
    return STRESS_MARKS.get(float(f"{row.stress:.1g}"), "X")


def styles(rows: list[Row]) -> list[tuple[str, list[Row], dict[str, Any]]]:
    """Name, members and look of each group; of a friction also its void ratio at 1 kPa."""
    found = []
    frictions = sorted({row.mu_comp for row in rows if not row.crystal})
    for name, members in groups_of(rows).items():
        style = EDGE | {"mfc": "w"}
        if not members[0].crystal:
            mu = members[0].mu_comp
            at = frictions.index(mu) if np.isfinite(mu) else 0
            shade = SHADES[round(at * (len(SHADES) - 1) / max(1, len(frictions) - 1))]
            style |= {"mfc": shade, "color": shade}
            name = rf"$\mu_{{comp}}$ {mu:g}"
            e = members[0].value("void_ratio_of_state")
            name += rf", $e_0$ {e:.3f}" if np.isfinite(e) else ""
        found.append((name, members, style))
    return found


def column(members: list[Row], number: Number) -> np.ndarray:
    """A number of each row (n,), NaN where it is unknown."""
    of = number if callable(number) else lambda row: row.value(number)
    return np.array([of(row) for row in members])


def random_of(rows: list[Row]) -> list[Row]:
    """Those that are no crystals."""
    return [row for row in rows if not row.crystal]


def points(
    panel: Panel,
    members: list[Row],
    style: dict[str, Any],
    y: str,
    x: Number = "",
    over: Number = lambda row: 1.0,
    moved: float = 0.0,
    stated: str = "",
) -> None:
    """A column of each row, `over` another number, against x, by default that of the panel's label.

    Each has the marker of its stress and its error bar; cases that do not have the number are left
    out. With `moved`, a factor of x, they are joined by a line; `stated` is the number of a study
    that stars are drawn at.
    """
    at, scale = column(members, x or AXES[panel.xlabel]), column(members, over)
    value = column(members, y) / scale
    error = np.nan_to_num(column(members, lambda row: row.spread(y)) / scale)
    if moved:
        at = at * moved
        panel.line(at, value, color=style["color"], **THIN)
    known = np.isfinite(value) & (error > 0)
    if (error > 0).any():
        panel.add("error", at[known], value[known], error[known], **BARS)
    for k in np.flatnonzero(np.isfinite(at) & np.isfinite(value)):
        panel.line(at[k : k + 1], value[k : k + 1], marker=mark(members[k]), **style)
    for row, place, one in zip(members, at, scale, strict=True):
        if said := row.stated.get(stated):
            first = all(series.label != "stated" for series in panel.series)
            panel.line([place], [said[0] / one], "stated" if first else "", **STATED)


def scatter(
    panel: Panel, rows: list[Row], y: str, *, side_by_side: bool = False, **given: Any
) -> Panel:
    """The panel with the `points` of all groups.

    `side_by_side`: a little apart on a logarithmic axis, joined.
    """
    groups = styles(rows)
    for k, (_, members, style) in enumerate(groups):
        middle = (len(groups) - 1) / 2
        moved = 1.5 ** ((k - middle) / max(1.0, 2 * middle)) if side_by_side else 0.0
        points(panel, members, style, y, moved=moved, **given)
    return panel


def legend(panel: Panel, rows: list[Row], frictions: bool = True, stresses: bool = True) -> None:
    """Entries for the colours of `rows` and for their markers, beside the panel's own."""
    for name, members, style in styles(rows) if frictions else []:
        panel.line([np.nan], [np.nan], name, marker="s" if members[0].crystal else "o", **style)
    shown = {mark(row): row.stress for row in sorted(rows, key=lambda row: row.stress)}
    for marker, stress in shown.items() if stresses else []:
        text = f"{stress / 1e3:,.3g} kPa" if stress < 1e6 else f"{stress / 1e6:.3g} MPa"
        panel.line([np.nan], [np.nan], text, **EDGE | {"marker": marker, "mfc": "0.7"})
