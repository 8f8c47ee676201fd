"""How cases look in figures over many: a colour for each friction, a marker for each stress.

Colours grow lighter with friction, so that they are told apart in grey, too; crystals are white.
"""

from typing import Any

import numpy as np
import pandas as pd

from analysis.figures.picture import Panel
from analysis.frame import numbers, spreads
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
AXES = {
    "void ratio": "void_ratio",
    "stress (kPa)": "stress / 1000",
    ON_CONTACTS: CONTACTS,
    BEYOND: f"{CONTACTS} - {ISOSTATIC}",
}
"""What cases are drawn against, by its label."""


def with_curve(cases: pd.DataFrame, name: str, what: str) -> pd.DataFrame:
    """The cases that have a curve; InputError, saying `what` they lack, where none has."""
    found = cases[[name in row.curves for row in cases["row"]]]
    if found.empty:
        raise InputError(
            "input", f"no case has a {what}", remedy="keep one: measure FILE --keep DIR"
        )
    return found


def mark(stress: float) -> str:
    """The marker of a stress, Pa."""
    return STRESS_MARKS.get(float(f"{stress:.1g}"), "X")


def styles(cases: pd.DataFrame) -> list[tuple[str, pd.DataFrame, dict[str, Any]]]:
    """Name, members and look of each group; of a friction also its void ratio at 1 kPa."""
    found, frictions = [], np.unique(random_of(cases)["mu_comp"]).tolist()
    ordered = cases.sort_values(["kind", "mu_comp", "stress"])
    for name, members in ordered.groupby("group", sort=False):
        style, (kind, mu) = EDGE | {"mfc": "w"}, members[["kind", "mu_comp"]].iloc[0]
        if kind == "random":
            at = frictions.index(mu) if np.isfinite(mu) else 0
            shade = SHADES[round(at * (len(SHADES) - 1) / max(1, len(frictions) - 1))]
            style |= {"mfc": shade, "color": shade}
            name = rf"$\mu_{{comp}}$ {mu:g}"
            e = numbers(members, "void_ratio_of_state").iloc[0]
            name += rf", $e_0$ {e:.3f}" if np.isfinite(e) else ""
        found.append((str(name), members, style))
    return found


def random_of(cases: pd.DataFrame) -> pd.DataFrame:
    """Those that are no crystals."""
    return cases[cases["kind"] == "random"]


def stated_ends(cases: pd.DataFrame, name: str) -> list[float]:
    """Lower and upper end of what a study states of a quantity; empty where it states nothing."""
    ends = [numbers(cases, f"{name}_stated{end}").dropna() for end in ("", "_to")]
    return [end.iloc[0] for end in ends if len(end)]


def points(
    panel: Panel,
    members: pd.DataFrame,
    style: dict[str, Any],
    y: str,
    x: str = "",
    over: str = "",
    moved: float = 0.0,
    stated: str = "",
) -> None:
    """A quantity of each case, `over` another, against x, by default that of the panel's label.

    Each has the marker of its stress and its error bar; cases that do not have the number are left
    out. With `moved`, a factor of x, they are joined by a line; `stated` is the number of a study
    that stars are drawn at.
    """
    scale = numbers(members, over) if over else 1.0
    value, error = numbers(members, y) / scale, (spreads(members, y) / scale).fillna(0)
    at = numbers(members, x or AXES[panel.xlabel]) * (moved or 1.0)
    if moved:
        panel.line(at, value, color=style["color"], **THIN)
    known = np.isfinite(value) & (error > 0)
    if (error > 0).any():
        panel.add("error", at[known], value[known], error[known], **BARS)
    for k in np.flatnonzero(np.isfinite(at) & np.isfinite(value)):
        panel.line(at[k : k + 1], value[k : k + 1], marker=mark(members["stress"].iloc[k]), **style)
    for place, said in zip(at, numbers(members, f"{stated}_stated") / scale, strict=True):
        if np.isfinite(said):
            first = all(series.label != "stated" for series in panel.series)
            panel.line([place], [said], "stated" if first else "", **STATED)


def scatter(
    panel: Panel, cases: pd.DataFrame, y: str, *, side_by_side: bool = False, **given: Any
) -> None:
    """The `points` of all groups.

    `side_by_side`: a little apart on a logarithmic axis, joined.
    """
    groups = styles(cases)
    for k, (_, members, style) in enumerate(groups):
        middle = (len(groups) - 1) / 2
        moved = 1.5 ** ((k - middle) / max(1.0, 2 * middle)) if side_by_side else 0.0
        points(panel, members, style, y, moved=moved, **given)


def legend(
    panel: Panel, cases: pd.DataFrame, frictions: bool = True, stresses: bool = True
) -> None:
    """Entries for the colours of `cases` and for their markers, beside the panel's own."""
    for name, members, style in styles(cases) if frictions else []:
        marker = "o" if members["kind"].iloc[0] == "random" else "s"
        panel.line([np.nan], [np.nan], name, marker=marker, **style)
    shown = {mark(stress): stress for stress in np.unique(cases["stress"])}
    for marker, stress in shown.items() if stresses else []:
        text = f"{stress / 1e3:,.3g} kPa" if stress < 1e6 else f"{stress / 1e6:.3g} MPa"
        panel.line([np.nan], [np.nan], text, **EDGE | {"marker": marker, "mfc": "0.7"})
