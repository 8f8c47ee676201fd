"""Figures over all cases of what the paper does not have: isostaticity and scattering."""

import numpy as np
import pandas as pd

from analysis.estimators.fits import straight_line
from analysis.figures import groups
from analysis.figures.groups import LOG, legend, mark, random_of, scatter, styles
from analysis.figures.picture import Panel, Picture
from analysis.frame import numbers


def isostaticity(cases: pd.DataFrame) -> Picture:
    """Beyond the paper: three frequencies over the highest against contacts beyond isostaticity."""
    random, panels = random_of(cases), list[Panel]()
    z, top = (numbers(random, name) for name in (groups.AXES[groups.BEYOND], "f_max_khz"))
    along = np.array([0.0, np.nanmax([0.0, *z])])
    for name, title in (
        ("f_low_pass_2_linear_khz", "low-pass frequency, 2 %"),
        ("excess_peak_khz", "peak of $D(f) / f^2$"),
        ("ioffe_regel_khz", "Ioffe-Regel limit"),
    ):
        y = numbers(random, name) / top
        panel = Panel(groups.BEYOND, "", title, legend="upper left")
        if (np.isfinite(y) & np.isfinite(z)).sum() > 2:
            line = straight_line(z, y)
            text = f"{line.slope:.3f} (z - {groups.ISOSTATIC - line.offset / line.slope:.2f})"
            panel.line(along, line.slope * along + line.offset, text, color="k", lw=0.8)
        scatter(panel, random, name, over="f_max_khz")
        panels.append(panel)
    panels[0].ylabel, panels[2].legend = "frequency over the highest", "outside"
    legend(panels[2], random)
    return Picture(panels, columns=3, shape=(13, 3.8))


def scattering(cases: pd.DataFrame) -> Picture:
    """Beyond the paper: width of the ridge, mean free path, and the Ioffe-Regel limit.

    Frequencies are in units of V_P / D. Curves are of one stress, and end at the limit: beyond it
    the ridge's width is that of no wave.
    """
    members = groups.with_curve(cases, "ridge", "structure factor")
    # Most cases are under it; of several that nearest to 100 kPa.
    common = min(members["stress"].mode(), key=lambda stress: abs(np.log(stress / 1e5)))
    axis, title = "frequency, $f D / V_P$", f"{common / 1e3:g} kPa"
    width = Panel(axis, "full width of the ridge over $f$", f"(a) {title}", **LOG)
    path = Panel(axis, "mean free path / D", f"(b) {title}", legend="outside", **LOG)
    limit = Panel("void ratio", "Ioffe-Regel frequency (kHz)", "(c)", yscale="log")
    ratio = Panel(
        groups.ON_CONTACTS, "Ioffe-Regel over $f_{low-pass}$, 2 %", "(d)", legend="outside"
    )
    width.hline(1 / np.pi, r"$l = \lambda / 2$ (Ioffe-Regel)", color="k")
    for _, some, look in styles(members):
        look |= {"marker": mark(common), "ms": 3, "lw": 0.8, "ls": "-"}
        for row in some["row"][some["stress"] == common]:
            f, w, free = row.curves["ridge"]
            width.line(f, w, **look)
            path.line(f, free, **look)
    scatter(limit, members, "ioffe_regel_khz")
    scatter(ratio, members, "ioffe_regel_khz", over="f_low_pass_2_linear_khz")
    legend(path, members, stresses=False)
    legend(ratio, members, frictions=False)
    return Picture([width, path, limit, ratio], columns=2, shape=(12, 7))
