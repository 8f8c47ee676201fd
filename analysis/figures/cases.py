"""Figures over all cases, from their numbers: 6, 8, 16 to 19, and two beyond the paper."""

from typing import Any

import numpy as np
import pandas as pd

from analysis.estimators.fits import power_law, straight_line
from analysis.figures import groups
from analysis.figures.groups import LOG, THIN, legend, mark, points, random_of, scatter, styles
from analysis.figures.picture import BLUE, ORANGE, Panel, Picture
from analysis.frame import numbers
from analysis.rows import CaseResult, of_one_producer


def velocity_cases(cases: pd.DataFrame) -> Picture:
    """Fig. 6: V_P by first peaks against void ratio, with its trend to FCC, and against stress."""
    producer, name = of_one_producer(cases["record"], "v_p_first_peaks_{record}_m_per_s")
    label = f"$V_P$, first peaks, {producer} (m/s)"
    left = Panel("void ratio", label, "(a)", yscale="log", legend="outside")
    right = Panel("stress (kPa)", label, "(b)", legend="outside", **LOG)
    legend(left, cases, frictions=False)
    for _, members in cases.groupby("stress"):
        _trend(left, members, name)
    scatter(left, cases, name)
    for text, members, style in styles(cases):
        at, law = members["stress"], power_law(members["stress"], numbers(members, name))
        right.line(at / 1e3, law.factor * at**law.exponent, color="0.5", **THIN)
        points(right, members, style, name)
        text += f": {law}" if np.isfinite(law.exponent) else ""
        right.line([np.nan], [np.nan], text, marker="o", **style)
    start, slope = numbers(cases, name).min(), np.array([1e4, 1e7])
    if np.isfinite(start):
        sixth = 0.93 * start * (slope / slope[0]) ** (1 / 6)
        right.line(slope / 1e3, sixth, "b = 1/6", color="k", ls="--")
    return Picture([left, right], columns=2, shape=(13, 4.4))


def _trend(panel: Panel, cases: pd.DataFrame, name: str) -> None:
    """The straight line through a quantity of random packings over e, to that of the crystal."""
    random, crystal = random_of(cases), cases[cases["kind"] == "fcc"]
    if crystal.empty or len(random) < 2:
        return
    x, y = numbers(random, "void_ratio"), numbers(random, name)
    at, of_crystal = (numbers(crystal, text).iloc[0] for text in ("void_ratio", name))
    line = straight_line(x, y)
    there, error = line.at(at)
    along = np.linspace(at, x.max(), 30)  # no straight line on a logarithmic axis
    text = rf"line at FCC's e: {there:.0f} $\pm$ {error:.0f}; FCC {of_crystal:.0f} m/s"
    panel.line(along, line.slope * along + line.offset, text, color="0.4", **THIN | {"ls": "--"})
    panel.add("error", [at], [there], [error], color="0.4", lw=0.8, capsize=3)


def highest_frequency(cases: pd.DataFrame) -> Picture:
    """Fig. 8: highest natural frequency over that of FCC at the same stress."""
    crystal = cases[cases["kind"] == "fcc"]
    panel = Panel("stress (kPa)", "$f_{max}$ over that of FCC", xscale="log", legend="outside")
    how: dict[str, Any] = {"side_by_side": True, "stated": "f_max_khz"}
    if crystal.empty:
        panel.ylabel, panel.yscale = "$f_{max}$ (kHz)", "log"
    else:
        of_crystal = cases["stress"].map(numbers(crystal.set_index("stress"), "f_max_khz"))
        cases, how["over"] = cases.assign(of_crystal=of_crystal), "of_crystal"
    scatter(panel, cases, "f_max_khz", **how)
    legend(panel, cases, stresses=False)
    return Picture([panel], shape=(8.6, 4))


def low_pass_cases(cases: pd.DataFrame) -> Picture:
    """Fig. 16: f_low-pass, 2 % of the whole map, against void ratio and stress."""
    producer, name = of_one_producer(cases["record"], "f_low_pass_2_{record}_khz")
    label = f"$f_{{low-pass}}$, 2 %, {producer} (kHz)"
    left = Panel("void ratio", label, "(a)", yscale="log", legend="lower left")
    right = Panel("stress (kPa)", label, "(b)", legend="outside", **LOG)
    for panel in (left, right):
        beside = panel is right
        scatter(panel, cases, name, side_by_side=beside, stated="f_low_pass_2_khz")
        legend(panel, cases, frictions=beside, stresses=not beside)
    return Picture([left, right], columns=2, shape=(12, 4.2))


def velocity_low_pass(cases: pd.DataFrame) -> Picture:
    """Fig. 17: f_low-pass, 2 %, against V_P by first peaks; slope through each group."""
    columns = "v_p_first_peaks_{record}_m_per_s", "f_low_pass_2_{record}_khz"
    producer, velocity, name = of_one_producer(cases["record"], *columns)
    random = random_of(cases)
    axes = f"$V_P$, first peaks, {producer} (m/s)", f"$f_{{low-pass}}$, 2 %, {producer} (kHz)"
    panel = Panel(*axes, legend="outside", **LOG)
    v, f = np.log(numbers(random, velocity)), np.log(numbers(random, name))
    known = np.isfinite(v) & np.isfinite(f)
    slopes = groups.stated_ends(random, "low_pass_power_of_v_p")
    for slope, ls in zip(slopes, ("--", ":"), strict=False):
        if known.any():  # through the middle of the points, over their range
            ends = np.array([v[known].min(), v[known].max()])
            line = f[known].mean() + slope * (ends - v[known].mean())
            panel.line(np.exp(ends), np.exp(line), f"stated: {slope}", color="k", ls=ls, lw=0.9)
    for text, members, style in styles(cases):
        law = power_law(numbers(members, velocity), numbers(members, name))
        text += f": slope {law.exponent:.2f}" if np.isfinite(law.exponent) else ""
        text += rf" $\pm$ {law.error:.1g}" if np.isfinite(law.error) else ""
        points(panel, members, style, name, velocity)
        panel.line([np.nan], [np.nan], text, marker="o", **style)
    legend(panel, cases, frictions=False)
    return Picture([panel], shape=(8.6, 4.8))


def wavelength_cases(cases: pd.DataFrame) -> Picture:
    """Fig. 18: lambda_low-pass / D of random packings against void ratio, 2 % and 1 %."""
    panels, random = [], random_of(cases)
    seen, width = [*numbers(random, "void_ratio"), 0.6], numbers(random, "width_over_d").median()
    span = np.nanmin(seen) - 0.01, np.nanmax(seen) + 0.01
    for percent, letter in (("2", "(a)"), ("1", "(b)")):
        key = f"lambda_{percent}_over_d"
        producer, name = of_one_producer(cases["record"], f"lambda_{percent}_{{record}}_over_d")
        panel = Panel("void ratio", rf"$\lambda_{{low-pass}}/D$, {percent} %, {producer}", letter)
        panel.yscale, panel.xlim, panel.legend = "log", span, "outside"
        if ends := groups.stated_ends(cases, key):
            low, high = ends
            panel.band(span, low, high, f"stated: {low:g} to {high:g}", color="0.88", zorder=0)
        panel.hline(2**0.5, r"FCC, $\sqrt{2}$", color="0.5", ls=":")
        if np.isfinite(width):
            panel.hline(width, f"width, {width:.3g} D", color="k", lw=0.8)
        scatter(panel, random, name)
        panels.append(panel)
    legend(panels[0], cases, frictions=False)
    legend(panels[1], random, stresses=False)
    return Picture(panels, columns=2, shape=(13, 4.2))


def gain_cases(cases: pd.DataFrame) -> Picture:
    """Fig. 19: gain factor of FCC and the lowest friction over stress; below, the resonances."""
    own = styles(groups.with_curve(cases, "gain", "gain factor"))
    two, panels, below = [members for _, members, _ in own][:2], [], []
    for letter, other, members in zip(("(a)", "(b)"), ("(c)", "(d)"), two, strict=False):
        title = f"{letter} {members['group'].iloc[0]}"
        title += ", each stress a decade lower" if len(members) > 1 else ""
        panel = Panel("frequency over $f_1$", "gain factor", title, yscale="log", ylim=(1e-6, 10))
        for k, row in enumerate(members["row"]):  # the curves of all stresses are nearly one
            f, height = row.curves["gain"]
            width = row.value("gain_resolution_hz")
            text = f"{row.stress / 1e3:g} kPa, resolution {width:.0f} Hz"
            # Of a random packing as far as more than its noise is received.
            edge = np.inf if row.crystal else 2 * 1e3 * row.value("f_low_pass_2_linear_khz")
            f, height = (values[~(f > edge)] for values in (f, height))
            look = {"color": ("k", "0.5")[k % 2], "ls": "-", "lw": 0.9}
            panel.line(f / row.curves["first"][0], height / 10**k, text, **look)
            panel.hline(10.0**-k, color="0.6", lw=0.6)
        panels.append(panel)
        below.append(_gain(members["row"].iloc[min(1, len(members) - 1)], other))
    panels += below
    return Picture(panels, columns=2, shape=(10, 0.3 + 3.1 * -(-len(panels) // 2)))


def _gain(row: CaseResult, letter: str) -> Panel:
    """Gain factor (receiver over source stress) of the springs, and the resonances.

    Between rigid walls the stress ratio of a rod is 1 / |cos kappa L|: its maxima lie midway
    between the resonances sin kappa L = 0, not on them.
    """
    f, height = row.curves["gain"]
    f_r, top = row.curves["resonances"][0], 10 * row.curves["first"][0][0]
    keep = f < top
    title = f"{letter} {row.label}"
    panel = Panel("frequency (kHz)", "gain factor", title, legend="upper right")
    panel.xlim, panel.ylim = (0, top / 1e3), (0, 1.4 * float(height[keep].max()))
    panel.line(f[keep] / 1e3, height[keep], "gain", color="k")
    f_r = f_r[f_r < top] / 1e3
    if len(f_r):
        panel.vlines(f_r, "resonances $f_r$, both walls held", color=BLUE, ls=":", lw=1)
        middle = 0.5 * (np.append(0, f_r[:-1]) + f_r)
        panel.vlines(middle, "half way, source free of stress", color=ORANGE, ls="--", lw=0.8)
    return panel


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
