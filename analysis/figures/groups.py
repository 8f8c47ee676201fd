"""Draw groups of cases in a panel: a colour for each friction, a marker for each stress.

Colours grow lighter with friction, so that they differ in grey, too; crystals are white.
"""

from typing import Any

import numpy as np
import pandas as pd

from analysis.figures.picture import Panel
from analysis.frame import numbers, spreads
from modal.tools.errors import InputError

SHADES = ("#440154", "#463480", "#355f8d", "#25848e", "#22a884", "#5ec962", "#bddf26")
"""Colours of the frictions, from the lowest friction on."""
STRESS_MARKS = {1e4: "o", 1e5: "s", 1e6: "^", 1e7: "D"}
"""Marker of each stress, Pa."""
OTHER_MARK = "X"
"""Marker of any other stress."""
SIDE_BY_SIDE_RATIO = 1.5
"""Factor between the places of the first and the last group of one stress, on a logarithmic
axis."""
EDGE: dict[str, Any] = {"color": "k", "ls": "none", "mec": "k", "mew": 0.5, "ms": 5}
STATED = EDGE | {"marker": "*", "ms": 11, "mfc": "none", "mew": 1.2}
BARS: dict[str, Any] = {"color": "k", "lw": 0.6, "capsize": 1.5, "zorder": 1.9}
THIN: dict[str, Any] = {"lw": 0.7, "ls": "-", "zorder": 1.5}
LOG: dict[str, Any] = {"xscale": "log", "yscale": "log"}
CONTACTS = "coordination_number_bearing"
"""Quantity: mean number of contacts of a sphere that bears force."""
ON_CONTACTS = "contacts a force-bearing sphere (-)"
BEYOND = "contacts a force-bearing sphere, less 4 (-)"
VOID_RATIO = "void ratio (-)"
NAMES_OF_GROUPS = "friction: during compression", "$e_0$: void ratio, lowest stress"
"""Lines at the head of a legend that say what the names of groups mean."""
ISOSTATIC = 4
"""Mean number of contacts of a sphere with friction below which a packing is floppy."""
AXES = {
    VOID_RATIO: "void_ratio",
    "stress (kPa)": "stress / 1000",
    ON_CONTACTS: CONTACTS,
    BEYOND: f"{CONTACTS} - {ISOSTATIC}",
}
"""Quantity of an axis, by the label of the axis."""
LabelledGroup = tuple[str, pd.DataFrame, dict[str, Any]]
"""Label, cases and style of a group."""


def with_curve(cases: pd.DataFrame, curve: str, description: str) -> pd.DataFrame:
    """Return the cases that have a curve; InputError, with its description, if none has."""
    chosen = cases[[curve in row.curves for row in cases["row"]]]
    if chosen.empty:
        raise InputError(
            "no_curve", f"no case has a {description}", remedy="keep one: measure FILE --keep DIR"
        )
    return chosen


def mark(stress: float) -> str:
    """Return the marker of a stress, Pa."""
    return STRESS_MARKS.get(float(f"{stress:.1g}"), OTHER_MARK)


def styles(cases: pd.DataFrame) -> list[LabelledGroup]:
    """Return label, cases and style of each group.

    The label of a friction has its void ratio at the lowest stress, if that is known.
    """
    groups: list[LabelledGroup] = []
    frictions = np.unique(random_of(cases)["mu_comp"]).tolist()
    ordered = cases.sort_values(["kind", "mu_comp", "stress"])
    for name, members in ordered.groupby("group", sort=False):
        label = str(name)
        style = EDGE | {"mfc": "w"}
        kind, friction = members[["kind", "mu_comp"]].iloc[0]
        if kind == "random":
            shade = _shade(friction, frictions)
            style |= {"mfc": shade, "color": shade}
            label = f"friction {friction:g}"
            void_ratio = numbers(members, "void_ratio_of_state").iloc[0]
            if np.isfinite(void_ratio):
                label += rf", $e_0$ {void_ratio:.3f}"
        groups.append((label, members, style))
    return groups


def _shade(friction: float, frictions: list[float]) -> str:
    """Return the colour of a friction among several sorted ones; the first one if unknown."""
    place = 0
    if np.isfinite(friction):
        place = frictions.index(friction)
    last = max(1, len(frictions) - 1)
    return SHADES[round(place * (len(SHADES) - 1) / last)]


def random_of(cases: pd.DataFrame) -> pd.DataFrame:
    """Return the cases that are not crystals."""
    return cases[cases["kind"] == "random"]


def stated_ends(cases: pd.DataFrame, name: str) -> list[float]:
    """Return the ends of the interval that a study states of a quantity; empty without one."""
    columns = [numbers(cases, f"{name}_stated{end}").dropna() for end in ("", "_to")]
    return [column.iloc[0] for column in columns if len(column)]


def points(
    panel: Panel,
    members: pd.DataFrame,
    style: dict[str, Any],
    y: str,
    *,
    x: str = "",
    over: str = "",
    x_factor: float | None = None,
    stated: str = "",
) -> None:
    """Draw a quantity of each case against x, with its error bar and the marker of its stress.

    Parameters
    ----------
    panel : Panel
        The panel to draw in.
    members : DataFrame
        The cases of a group. Those without the number are left out.
    style : dict
        Matplotlib's style of the group.
    y : str
        The quantity.
    x : str
        Quantity of the x axis; by default that of the panel's label.
    over : str
        Quantity to divide y by.
    x_factor : float, optional
        Factor that shifts the points; they are then joined by a line.
    stated : str
        Quantity whose stated numbers are drawn as stars.
    """
    scale = numbers(members, over) if over else 1.0
    value = numbers(members, y) / scale
    error = (spreads(members, y) / scale).fillna(0)
    x_values = numbers(members, x or AXES[panel.xlabel])
    if x_factor is not None:
        x_values = x_values * x_factor
        panel.line(x_values, value, color=style["color"], **THIN)
    with_error = np.isfinite(value) & (error > 0)
    if (error > 0).any():
        panel.add("error", x_values[with_error], value[with_error], error[with_error], **BARS)
    for k in np.flatnonzero(np.isfinite(x_values) & np.isfinite(value)):
        marker = mark(members["stress"].iloc[k])
        panel.line(x_values[k : k + 1], value[k : k + 1], marker=marker, **style)
    stated_values = numbers(members, f"{stated}_stated") / scale
    for place, stated_value in zip(x_values, stated_values, strict=True):
        if np.isfinite(stated_value):
            first = all(series.label != "stated" for series in panel.series)
            panel.line([place], [stated_value], "stated" if first else "", **STATED)


def scatter(
    panel: Panel,
    cases: pd.DataFrame,
    y: str,
    *,
    over: str = "",
    stated: str = "",
    side_by_side: bool = False,
) -> None:
    """Draw the `points` of all groups of cases.

    With `side_by_side` the groups stand a little apart on a logarithmic axis, each joined by a
    line.
    """
    groups = styles(cases)
    middle = (len(groups) - 1) / 2
    for k, (_, members, style) in enumerate(groups):
        x_factor = None
        if side_by_side:
            x_factor = SIDE_BY_SIDE_RATIO ** ((k - middle) / max(1.0, 2 * middle))
        points(panel, members, style, y, over=over, x_factor=x_factor, stated=stated)


def explain_groups(panel: Panel, cases: pd.DataFrame) -> None:
    """Say in a panel's legend what the names of its groups mean, if there are random packings."""
    if random_of(cases).empty:
        return
    for text in NAMES_OF_GROUPS:
        panel.line([np.nan], [np.nan], text, ls="none")


def legend(
    panel: Panel, cases: pd.DataFrame, *, frictions: bool = True, stresses: bool = True
) -> None:
    """Add entries for the colours of cases and for their markers to a panel's legend."""
    if frictions:
        explain_groups(panel, cases)
        for label, members, style in styles(cases):
            marker = "o" if members["kind"].iloc[0] == "random" else "s"
            panel.line([np.nan], [np.nan], label, marker=marker, **style)
    if stresses:
        stress_of_marker = {mark(stress): stress for stress in np.unique(cases["stress"])}
        for marker, stress in stress_of_marker.items():
            text = f"{stress / 1e3:,.3g} kPa" if stress < 1e6 else f"{stress / 1e6:.3g} MPa"
            panel.line([np.nan], [np.nan], text, **EDGE | {"marker": marker, "mfc": "0.7"})
