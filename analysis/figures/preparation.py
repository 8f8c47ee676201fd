"""What the settings of a compression change: e, Z, V_P along each ladder, with its limit."""

from __future__ import annotations

import numpy as np

from analysis.figures.picture import Panel, Picture
from analysis.packings.convergence import LADDERS, Ladder, Row, rungs
from analysis.packings.limit import limit

QUANTITIES = {
    **{"e": "void ratio", "Z": "contacts of a sphere", "V_P": "$V_P$ (m/s)"},
    "f_low_pass": "$f_{low-pass}$ (Hz)",
}
"""The last where the packings are long enough for it."""
LOGARITHMIC = 8.0
"""Ratio of the largest size to the smallest from which an axis is logarithmic."""


def ladder_picture(ladder: Ladder, rows: list[Row], stress: float = 1e5) -> Picture | None:
    """A row of panels for each friction, one a quantity; None without such rows.

    Bars are standard errors, the cross is the base, the line the limit with its error.
    """
    frictions = sorted({row.friction for row in rows}, reverse=True)
    ladders = [found for mu in frictions if (found := rungs(ladder, rows, mu, stress))]
    steps = [row for found in ladders for row in found]
    shown = [name for name in QUANTITIES if any(row.mean(name)[2] for row in steps)]
    panels = [_panel(ladder, found, name) for found in ladders for name in shown]
    return Picture(panels, columns=len(shown)) if panels else None


def _panel(ladder: Ladder, found: list[Row], quantity: str) -> Panel:
    panel = Panel(ladder.title, QUANTITIES[quantity], f"friction {found[0].friction:g}")
    size = np.array([ladder.size(row) for row in found])
    value, error = np.array([row.mean(quantity)[:2] for row in found]).T
    if size.min() > 0 and size.max() > LOGARITHMIC * size.min():
        panel.xscale = "log"
    if ladder.error:
        there = limit(size, value, error)
        level = np.full(len(size), there.value)
        panel.add("band", size, level - there.error, level + there.error, color="0.85")
        panel.line(size, level, color="0.3", lw=0.8)
    for x, y, s in zip(size, value, np.nan_to_num(error), strict=True):
        panel.line([x, x], [y - s, y + s], color="k", lw=1.0)
    panel.line(size, value, ls=":", marker="o", color="k")
    base = next(row for row in found if row.name == ladder.base)
    panel.line([ladder.size(base)], base.mean(quantity)[:1], marker="x", ls="none", color="#c05000")
    return panel


def ladder_pictures(rows: list[Row]) -> dict[str, Picture]:
    """Pictures by name, one for each ladder that has rungs."""
    found = {}
    for ladder in LADDERS:
        picture = ladder_picture(ladder, rows)
        if picture is not None:
            found["_".join([ladder.base, *sorted(ladder.columns)])] = picture
    return found
