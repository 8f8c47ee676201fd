"""Figures over all cases of what the paper does not have: the gain's orders, scattering, D(f)."""

from __future__ import annotations

import numpy as np

from analysis.figures.groups import column, styles
from analysis.figures.picture import Panel, Picture
from analysis.rows import Row
from modal.tools.errors import InputError

SHOWN = 15
"""Maxima of the gain that are drawn."""
ORDERS = "order of its frequency among the resonances"


def gain_orders(rows: list[Row]) -> Picture:
    """Beyond the paper: the gain's maxima as orders of the resonances: r - 1/2, not r.

    A maximum is where the source wall is free of stress: a mode of the column whose source end is
    free and whose receiver end is held. Of the crystal these are known exactly; walls that give way
    make the order a little more than r - 1/2.
    """
    left = Panel("number r of the maximum", ORDERS, "(a)", legend="upper left", ylim=(0, 17))
    right = Panel("number r of the maximum", "order less (r - 1/2)", "(b)", ylim=(-0.35, 0.65))
    right.legend = "outside"
    for name, members, style in styles(rows):
        for k, row in enumerate(members):
            at, expected = (values[:SHOWN] for values in row.curves["gain_orders"])
            look = style | {"ms": 4, "alpha": 0.8}
            left.line(expected + 0.5, at, "", **look)
            right.line(expected + 0.5, at - expected, name if k == 0 else "", **look)
            exact = row.curves["free_held"][0][:SHOWN]
            if k == 0 and len(exact):
                number = np.arange(1, len(exact) + 1)
                text = "FCC, exact: source free"
                right.line(number, exact - number + 0.5, text, color="k", lw=0.9)
    orders = np.arange(1, SHOWN + 1)
    for panel, less in ((left, 0.0), (right, orders - 0.5)):
        free, held = orders - 0.5 - less, orders - less
        text = "" if panel is right else "both walls held: r"
        panel.line(orders, held, text, color="k", ls=":")
        text = "" if panel is right else "source free, receiver held: r - 1/2"
        panel.line(orders, free, text, color="k", ls="--")
    return Picture([left, right], columns=2, shape=(12, 4.4))


STRESS_LINES = {1e4: "-.", 1e5: "-", 1e6: "--", 1e7: ":"}


def scattering(rows: list[Row]) -> Picture:
    """Beyond the paper: width of the ridge, mean free path, and the Ioffe-Regel limit.

    Frequencies are in units of V_P / D, in which the stresses of a friction can be held against
    each other. Curves end at the limit: beyond it the ridge's width is that of no wave.
    """
    members = [row for row in rows if "ridge" in row.curves]
    if not members:
        raise InputError("no case has a structure factor; run python -m analysis prepare CASE")
    width = Panel("frequency, $f D / V_P$", "full width of the ridge over $f$", "(a)")
    path = Panel("frequency, $f D / V_P$", "mean free path / D", "(b)")
    for panel in (width, path):
        panel.xscale = panel.yscale = "log"
    limit = Panel("void ratio", "frequency (kHz)", "(c)", yscale="log")
    limit.legend = "lower left"
    ratio = Panel("stress (kPa)", "Ioffe-Regel over $f_{low-pass}$, 2 %", "(d)", xscale="log")
    path.legend = "outside"
    for name, group, style in styles(members):
        for k, row in enumerate(group):
            f, w, free = row.curves["ridge"]
            look = {"color": style["color"], "marker": style["marker"], "ms": 3, "lw": 0.7}
            look["ls"] = STRESS_LINES.get(float(f"{row.stress:.2g}"), "-")
            width.line(f, w, "", mfc="none", **look)
            path.line(f, free, name if k == 0 else "", mfc="none", **look)
        e = column(group, "void_ratio")
        limit.line(e, column(group, "ioffe_regel_khz"), "", **style)
        two = column(group, "f_low_pass_2_linear_khz")
        limit.line(e, two, "", **style | {"mfc": style["color"], "alpha": 0.5})
        stress = np.array([row.stress for row in group]) / 1e3
        ratio.line(stress, column(group, "ioffe_regel_khz") / two, "", **style)
    text = r"$l = \lambda / 2$ (Ioffe-Regel)"
    width.add("hline", [0], [1 / np.pi], None, text, color="k", lw=0.8)
    for level, ls in STRESS_LINES.items():
        if any(abs(row.stress / level - 1) < 0.1 for row in members):
            width.line([np.nan], [np.nan], f"{level / 1e3:g} kPa", color="k", ls=ls, lw=0.9)
    for fill, text in (("none", "Ioffe-Regel"), ("0.6", "$f_{low-pass}$ 2 %, linear wave")):
        limit.line([np.nan], [np.nan], text, marker="o", ls="none", color="k", mfc=fill)
    return Picture([width, path, limit, ratio], columns=2, shape=(12, 7))


def density_excess(rows: list[Row]) -> Picture:
    """Beyond the paper: density of states over f^2, and its size against coordination number."""
    members = [row for row in rows if "excess" in row.curves]
    if not members:
        raise InputError("no case has a density of states; run python -m analysis prepare CASE")
    left = Panel("$f / f_{max}$", "$D f_{max}^3 / f^2$", "(a)", xscale="log", yscale="log")
    left.ylim = (0.1, 2e3)
    height = Panel("", "$D f_{max}^3 / f^2$ at a tenth of $f_{max}$", "(b)", yscale="log")
    place = Panel("", "frequency of its maximum over $f_{max}$", "(c)", legend="outside")
    common = _common_stress(members)
    left.title += f" {common / 1e3:g} kPa"
    for name, group, style in styles(members):
        for row in group:
            f, reduced = row.curves["excess"]
            if row.stress == common:
                every = np.unique(np.geomspace(1, len(f), 60).astype(int)) - 1
                look = {"color": style["color"], "lw": 0.9, "ms": 4, "mfc": "none"}
                look |= {"marker": style["marker"], "markevery": 6}
                left.line(f[every], reduced[every], "", **look)
        z = column(group, "coordination_number_bearing")
        height.line(z, column(group, "excess_at_a_tenth"), "", **style)
        peak = column(group, "excess_peak_khz") / column(group, "f_max_khz")
        place.line(z, peak, name, **style)
    height.xlabel = place.xlabel = "contacts a force-bearing sphere"
    return Picture([left, height, place], columns=3, shape=(15, 4.2))


def _common_stress(rows: list[Row]) -> float:
    """The stress, Pa, under which most of the cases are; of several the lowest."""
    stresses = sorted({row.stress for row in rows})
    return max(stresses, key=lambda stress: sum(row.stress == stress for row in rows))


def low_pass_rules(rows: list[Row]) -> Picture:
    """Beyond the paper: f_low-pass by each rule over that by the paper's words, linear and YADE."""
    panel = Panel("case", "frequency over 2 % of the whole map, one chain", legend="outside")
    panel.yscale = "log"
    number = [row.number or 0 for row in rows]
    base = column(rows, "f_low_pass_2_khz")
    for name, text, marker in (
        ("f_low_pass_1_khz", "1 %", "^"),
        ("f_low_pass_3_khz", "3 %", "v"),
        ("f_low_pass_2_own_{}_khz", "2 % of each particle's maximum", "x"),
        ("f_low_pass_2_layers_{}_khz", "2 % of the map of layer means", "_"),
        ("f_low_pass_2_linear_khz", "2 %, linear wave", "o"),
        ("ioffe_regel_khz", "Ioffe-Regel", "*"),
    ):
        y = np.array([row.value(name.format(row.record)) for row in rows]) / base
        if np.isfinite(y).any():
            style = {"marker": marker, "ls": "none", "mfc": "none", "ms": 6}
            colour = "k" if marker in "ov^" else "#c05000"
            panel.line(number, y, text, color=colour, **style)
    panel.add("hline", [0], [1.0], None, "", color="0.6", lw=0.8)
    return Picture([panel], shape=(11, 4))
