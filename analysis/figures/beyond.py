"""Figures over all cases of what the paper does not have: isostaticity, gain, scattering, D(f)."""

from typing import Any

import numpy as np
import pandas as pd

from analysis.estimators.fits import straight_line
from analysis.figures import groups
from analysis.figures.groups import LOG, legend, mark, random_of, scatter, styles
from analysis.figures.picture import Panel, Picture
from analysis.frame import numbers
from analysis.rows import Row, of_one_producer
from modal.tools.errors import InputError

SHOWN = 15
"""Maxima of the gain that are drawn."""


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


def gain_orders(cases: pd.DataFrame) -> Picture:
    """Beyond the paper: the gain's maxima as orders of the resonances: r - 1/2, not r.

    A maximum is where the source wall is free of stress: a mode of the column whose source end is
    free and whose receiver end is held. Of the crystal these are known exactly; walls that give way
    make the order a little more than r - 1/2.
    """
    axis = "number r of the maximum"
    left = Panel(axis, "order of its frequency among the resonances", "(a)", ylim=(0, 17))
    right = Panel(axis, "order less (r - 1/2)", "(b)", ylim=(-0.35, 0.65), legend="outside")
    left.legend = "upper left"
    for _, members, style in styles(cases):
        for k, row in enumerate(members["row"]):
            at, expected = (values[:SHOWN] for values in row.curves["gain_orders"])
            look = style | {"ms": 4, "marker": mark(row.stress)}
            left.line(expected + 0.5, at, "", **look)
            right.line(expected + 0.5, at - expected, "", **look)
            exact = row.curves["free_held"][0][:SHOWN]
            if k == 0 and len(exact):
                number = np.arange(1, len(exact) + 1)
                text = "FCC, exact: source free"
                right.line(number, exact - number + 0.5, text, color="k", lw=0.9)
    orders = np.arange(1, SHOWN + 1)
    for held, text, ls in (
        (0.0, "both walls held: r", ":"),
        (0.5, "source free, receiver held: r - 1/2", "--"),
    ):
        left.line(orders, orders - held, text, color="k", ls=ls)
        right.line(orders, 0 * orders + 0.5 - held, color="k", ls=ls)
    legend(right, cases)
    return Picture([left, right], columns=2, shape=(12, 4.4))


def scattering(cases: pd.DataFrame) -> Picture:
    """Beyond the paper: width of the ridge, mean free path, and the Ioffe-Regel limit.

    Frequencies are in units of V_P / D. Curves are of one stress, and end at the limit: beyond it
    the ridge's width is that of no wave.
    """
    members = groups.with_curve(cases, "ridge", "structure factor")
    common = _common_stress(members)
    axis, title = "frequency, $f D / V_P$", f"{common / 1e3:g} kPa"
    width = Panel(axis, "full width of the ridge over $f$", f"(a) {title}", **LOG)
    path = Panel(axis, "mean free path / D", f"(b) {title}", legend="outside", **LOG)
    limit = Panel("void ratio", "Ioffe-Regel frequency (kHz)", "(c)", yscale="log")
    ratio = Panel(
        groups.ON_CONTACTS, "Ioffe-Regel over $f_{low-pass}$, 2 %", "(d)", legend="outside"
    )
    width.hline(1 / np.pi, r"$l = \lambda / 2$ (Ioffe-Regel)", color="k")
    for row, look in _of_stress(members, common):
        f, w, free = row.curves["ridge"]
        look |= {"ms": 3, "lw": 0.8, "ls": "-"}
        width.line(f, w, **look)
        path.line(f, free, **look)
    scatter(limit, members, "ioffe_regel_khz")
    scatter(ratio, members, "ioffe_regel_khz", over="f_low_pass_2_linear_khz")
    legend(path, members, stresses=False)
    legend(ratio, members, frictions=False)
    return Picture([width, path, limit, ratio], columns=2, shape=(12, 7))


def density_excess(cases: pd.DataFrame) -> Picture:
    """Beyond the paper: density of states over f^2, and its size against coordination number."""
    members = cases[np.isfinite(numbers(cases, "excess_at_a_tenth"))]
    if members.empty:
        raise InputError("no case has a density of states; keep one: measure FILE --keep DIR")
    height = Panel(groups.ON_CONTACTS, "$D f_{max}^3 / f^2$ at a tenth of $f_{max}$", yscale="log")
    place = Panel(groups.ON_CONTACTS, "frequency of its maximum over $f_{max}$", legend="outside")
    scatter(height, members, "excess_at_a_tenth")
    scatter(place, members, "excess_peak_khz", over="f_max_khz")
    legend(place, members)
    members = members[["excess" in row.curves for row in members["row"]]]
    panels = [height, place] if members.empty else [_density(members), height, place]
    return Picture(panels, columns=len(panels), shape=(5 * len(panels), 4.2))


def _density(cases: pd.DataFrame) -> Panel:
    """The density over f^2 itself, at one stress."""
    common, axis = _common_stress(cases), "$f / f_{max}$"
    title = f"{common / 1e3:g} kPa"
    panel = Panel(axis, "$D f_{max}^3 / f^2$", title, ylim=(0.1, 2e3), **LOG)
    for row, look in _of_stress(cases, common):
        f, reduced = row.curves["excess"]
        every = np.unique(np.geomspace(1, len(f), 60).astype(int)) - 1
        look |= {"ls": "-", "lw": 0.9, "markevery": 6}
        panel.line(f[every], reduced[every], **look)
    return panel


def _of_stress(cases: pd.DataFrame, stress: float) -> list[tuple[Row, dict[str, Any]]]:
    """The cases under one stress, each with the look of its group and its marker."""
    found, marker = [], {"marker": mark(stress)}
    for _, members, look in styles(cases):
        found += [(row, look | marker) for row in members["row"] if row.stress == stress]
    return found


def _common_stress(cases: pd.DataFrame) -> float:
    """The stress, Pa, under which most of the cases are; of several that nearest to 100 kPa."""
    stresses = sorted(set(cases["stress"]), key=lambda stress: abs(np.log(stress / 1e5)))
    return max(stresses, key=cases["stress"].to_list().count)


def low_pass_rules(cases: pd.DataFrame) -> Picture:
    """Beyond the paper: f_low-pass by each rule over that by the paper's words."""
    random, panels = random_of(cases), []
    look: dict[str, Any] = {"yscale": "log", "ylim": (0.5, 20)}
    for name, text in (
        ("f_low_pass_1_{record}_khz", "1 %"),
        ("f_low_pass_3_{record}_khz", "3 %"),
        ("f_low_pass_2_own_{record}_khz", "2 % of each particle's maximum"),
        ("f_low_pass_2_layers_{record}_khz", "2 % of the map of layer means"),
        ("f_low_pass_2_linear_khz", "2 %, linear wave"),
        ("ioffe_regel_khz", "Ioffe-Regel"),
    ):
        _, own, base = of_one_producer(random["record"], name, "f_low_pass_2_{record}_khz")
        panel = Panel(groups.ON_CONTACTS, "over 2 %, one chain", text, **look)
        panels.append(scatter(panel, random, own, over=base))
        panel.hline(1.0, color="0.6", lw=0.8)
    panels[2].legend = panels[5].legend = "outside"
    legend(panels[2], random, stresses=False)
    legend(panels[5], random, frictions=False)
    return Picture(panels, columns=3, shape=(13, 6))
