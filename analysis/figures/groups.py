"""How cases look in figures over many: a marker and a colour for each friction, FCC as squares."""

from __future__ import annotations

from typing import Any

import numpy as np

from analysis.figures.picture import Panel
from analysis.rows import Row, groups_of

MARKERS = "o^vD<>p"
"""Of the frictions, in their order; crystals are squares."""
SHADES = "#08306b", "#2258a0", "#4080b8", "#6a9a6a", "#b08a30", "#d07028", "#c04000"
"""Of the same, darkest first: read in grey by the marker."""
STATED: dict[str, Any] = {
    "marker": "*",
    "ls": "none",
    "ms": 10,
    "mfc": "none",
    "color": "k",
    "mew": 1.2,
}
STRESS_MARKS = {1e4: "v", 1e5: "o", 1e6: "D", 1e7: "^"}


def styles(rows: list[Row]) -> list[tuple[str, list[Row], dict[str, Any]]]:
    """Name, members and look of each group; of a friction also its void ratio at 1 kPa."""
    found = []
    frictions = sorted({row.mu_comp for row in rows if not row.crystal})
    for name, members in groups_of(rows).items():
        style: dict[str, Any] = {"marker": "s", "color": "k", "ls": "none", "mfc": "none"}
        if not members[0].crystal:
            mu = members[0].mu_comp
            at = frictions.index(mu) if np.isfinite(mu) else 0
            style |= {"marker": MARKERS[at % len(MARKERS)], "color": SHADES[at % len(SHADES)]}
            name = rf"$\mu_{{comp}}$ {mu:g}"
            e = members[0].value("void_ratio_of_state")
            name += rf", $e_0$ {e:.3f}" if np.isfinite(e) else ""
        found.append((name, members, style))
    return found


def column(members: list[Row], name: str) -> np.ndarray:
    """A number of each row, NaN where it is unknown."""
    return np.array([row.value(name) for row in members])


def points(panel: Panel, x, members: list[Row], name: str, text: str, style: dict) -> None:
    """Points with their error bars; nothing where no case has the number."""
    y = column(members, name)
    if not np.isfinite(y).any():
        return
    panel.line(x, y, text, **style)
    error = np.array([row.spread(name) for row in members])
    known = np.isfinite(error) & (error > 0)
    if known.any():
        look = {"color": style["color"], "lw": 0.8, "capsize": 2}
        panel.add("error", np.asarray(x)[known], y[known], error[known], **look)
