"""How cases look in figures over many: a colour for each friction, a marker for each stress.

Colours grow lighter with friction, so that they are told apart in grey, too; crystals are white.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from analysis.figures.picture import Panel
from analysis.rows import Row, groups_of

SHADES = "#440154", "#463480", "#355f8d", "#25848e", "#22a884", "#5ec962", "#bddf26"
"""Of the frictions, lowest first."""
STRESS_MARKS = {1e4: "o", 1e5: "s", 1e6: "^", 1e7: "D"}
EDGE: dict[str, Any] = {"color": "k", "ls": "none", "mec": "k", "mew": 0.5, "ms": 5}
STATED = EDGE | {"marker": "*", "ms": 11, "mfc": "none", "mew": 1.2}


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


def column(members: list[Row], name: str) -> np.ndarray:
    """A number of each row, NaN where it is unknown; `stress_kpa` is that of the row."""
    if name == "stress_kpa":
        return np.array([row.stress for row in members]) / 1e3
    return np.array([row.value(name) for row in members])


def points(
    panel: Panel, members: list[Row], x, y: str, style: dict[str, Any], over: Any = 1.0
) -> None:
    """A column of each row, `over` some numbers, with its error bars, against x: (n,), or a column.

    Each has the marker of its stress; cases that do not have the number are left out.
    """
    at = column(members, x) if isinstance(x, str) else np.asarray(x)
    value = column(members, y) / over
    error = np.nan_to_num(np.array([row.spread(y) for row in members]) / over)
    if (error > 0).any():
        known = np.isfinite(value) & (error > 0)
        panel.add(
            "error",
            at[known],
            value[known],
            error[known],
            color="k",
            lw=0.6,
            capsize=1.5,
            zorder=1.9,
        )
    for k in np.flatnonzero(np.isfinite(at) & np.isfinite(value)):
        panel.line(at[k : k + 1], value[k : k + 1], marker=mark(members[k]), **style)


def legend(panel: Panel, rows: list[Row], frictions: bool = True, stresses: bool = True) -> None:
    """Entries for the colours of `rows` and for their markers, beside the panel's own."""
    for name, members, style in styles(rows) if frictions else []:
        panel.line([np.nan], [np.nan], name, marker="s" if members[0].crystal else "o", **style)
    shown = {mark(row): row.stress for row in sorted(rows, key=lambda row: row.stress)}
    for marker, stress in shown.items() if stresses else []:
        text = f"{stress / 1e3:,.3g} kPa" if stress < 1e6 else f"{stress / 1e6:.3g} MPa"
        panel.line([np.nan], [np.nan], text, **EDGE | {"marker": marker, "mfc": "0.7"})


def side_by_side(x: np.ndarray, k: int, count: int) -> np.ndarray:
    """Places on a logarithmic axis, moved a little for the k-th of several groups at the same."""
    return x * 1.5 ** (k / max(1, count - 1) - 0.5)
