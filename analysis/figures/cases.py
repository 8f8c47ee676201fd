"""Figures over all cases: 6, 8, 16 to 19, from their rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from analysis.estimators.fits import straight_to
from analysis.figures import groups
from analysis.figures.groups import LOG, THIN, column, legend, points, random_of, scatter, styles
from analysis.figures.picture import BLUE, ORANGE, Panel, Picture, each
from analysis.rows import Row, law_of

STRESS = groups.AXES["stress (kPa)"]


def velocity_cases(rows: list[Row]) -> Picture:
    """Fig. 6: V_P by first peaks against void ratio, with its trend to FCC, and against stress."""
    producer, name = groups.of_record(rows, "v_p_first_peaks_{record}_m_per_s")
    label = f"$V_P$, first peaks, {producer} (m/s)"
    left = Panel("void ratio", label, "(a)", yscale="log", legend="outside")
    right = Panel("stress (kPa)", label, "(b)", legend="outside", **LOG)
    legend(left, rows, frictions=False)
    for level in sorted({row.stress for row in rows}):
        _trend(left, [row for row in rows if row.stress == level], name)
    scatter(left, rows, name)
    for text, members, style in styles(rows):
        law, at = law_of(members, "stress_pa", name), column(members, STRESS)
        right.line(at, law.factor * (1e3 * at) ** law.exponent, color="0.5", **THIN)
        points(right, members, style, name)
        text += f": {law}" if np.isfinite(law.exponent) else ""
        right.line([np.nan], [np.nan], text, marker="o", **style)
    start, slope = np.nanmin([np.inf, *column(rows, name)]), np.array([1e4, 1e7])
    if np.isfinite(start):
        sixth = 0.93 * start * (slope / slope[0]) ** (1 / 6)
        right.line(slope / 1e3, sixth, "b = 1/6", color="k", ls="--")
    return Picture([left, right], columns=2, shape=(13, 4.4))


def _trend(panel: Panel, rows: list[Row], name: str) -> None:
    """The straight line through a quantity of random packings over e, to that of the crystal."""
    crystal, random = [row for row in rows if row.crystal], random_of(rows)
    if not crystal or len(random) < 2:
        return
    x, y, at = column(random, "void_ratio"), column(random, name), crystal[0].value("void_ratio")
    there, error = straight_to(x, y, at)
    along = np.linspace(at, np.nanmax(x), 30)  # no straight line on a logarithmic axis
    text = rf"line at FCC's e: {there:.0f} $\pm$ {error:.0f}; FCC {crystal[0].value(name):.0f} m/s"
    line = [straight_to(x, y, e)[0] for e in along]
    panel.line(along, line, text, color="0.4", **THIN | {"ls": "--"})
    panel.add("error", [at], [there], [error], color="0.4", lw=0.8, capsize=3)


def highest_frequency(rows: list[Row]) -> Picture:
    """Fig. 8: highest natural frequency over that of FCC at the same stress."""
    of_crystal = {row.stress: row.value("f_max_khz") for row in rows if row.crystal}
    panel = Panel("stress (kPa)", "$f_{max}$ over that of FCC", xscale="log", legend="outside")
    if not of_crystal:
        panel.ylabel, panel.yscale = "$f_{max}$ (kHz)", "log"

    def over(row: Row) -> float:
        return of_crystal.get(row.stress, np.nan if of_crystal else 1.0)

    scatter(panel, rows, "f_max_khz", over=over, side_by_side=True, stated="f_max_khz")
    legend(panel, rows, stresses=False)
    return Picture([panel], shape=(8.6, 4))


def low_pass_cases(rows: list[Row]) -> Picture:
    """Fig. 16: f_low-pass, 2 % of the whole map, against void ratio and stress."""
    producer, name = groups.of_record(rows, "f_low_pass_2_{record}_khz")
    label = f"$f_{{low-pass}}$, 2 %, {producer} (kHz)"
    left = Panel("void ratio", label, "(a)", yscale="log", legend="lower left")
    right = Panel("stress (kPa)", label, "(b)", legend="outside", **LOG)
    for panel in (left, right):
        beside = panel is right
        scatter(panel, rows, name, side_by_side=beside, stated="f_low_pass_2_khz")
        legend(panel, rows, frictions=beside, stresses=not beside)
    return Picture([left, right], columns=2, shape=(12, 4.2))


def velocity_low_pass(rows: list[Row]) -> Picture:
    """Fig. 17: f_low-pass, 2 %, against V_P by first peaks; slope through each group."""
    columns = "v_p_first_peaks_{record}_m_per_s", "f_low_pass_2_{record}_khz"
    (producer, velocity, name), random = groups.of_record(rows, *columns), random_of(rows)
    axes = f"$V_P$, first peaks, {producer} (m/s)", f"$f_{{low-pass}}$, 2 %, {producer} (kHz)"
    panel = Panel(*axes, legend="outside", **LOG)
    v, f = np.log(column(random, velocity)), np.log(column(random, name))
    known = np.isfinite(v) & np.isfinite(f)
    slopes = next((s for row in random if (s := row.stated.get("low_pass_power_of_v_p"))), ())
    for slope, ls in zip(slopes, ("--", ":"), strict=False):
        if known.any():  # through the middle of the points, over their range
            ends = np.array([v[known].min(), v[known].max()])
            line = f[known].mean() + slope * (ends - v[known].mean())
            panel.line(np.exp(ends), np.exp(line), f"stated: {slope}", color="k", ls=ls, lw=0.9)
    for text, members, style in styles(rows):
        law = law_of(members, velocity, name)
        text += f": slope {law.exponent:.2f}" if np.isfinite(law.exponent) else ""
        text += rf" $\pm$ {law.error:.1g}" if np.isfinite(law.error) else ""
        points(panel, members, style, name, velocity)
        panel.line([np.nan], [np.nan], text, marker="o", **style)
    legend(panel, rows, frictions=False)
    return Picture([panel], shape=(8.6, 4.8))


def wavelength_cases(rows: list[Row]) -> Picture:
    """Fig. 18: lambda_low-pass / D of random packings against void ratio, 2 % and 1 %."""
    panels, random = [], random_of(rows)
    seen, width = [*column(random, "void_ratio"), 0.6], column(random, "width_over_d")
    span = np.nanmin(seen) - 0.01, np.nanmax(seen) + 0.01
    for percent, letter in (("2", "(a)"), ("1", "(b)")):
        key = f"lambda_{percent}_over_d"
        producer, name = groups.of_record(rows, f"lambda_{percent}_{{record}}_over_d")
        panel = Panel("void ratio", rf"$\lambda_{{low-pass}}/D$, {percent} %, {producer}", letter)
        panel.yscale, panel.xlim, panel.legend = "log", span, "outside"
        for low, high in [row.stated[key] for row in rows if key in row.stated][:1]:
            panel.band(span, low, high, f"stated: {low:g} to {high:g}", color="0.88", zorder=0)
        panel.hline(2**0.5, r"FCC, $\sqrt{2}$", color="0.5", ls=":")
        if np.isfinite(width).any():
            across = float(np.nanmedian(width))
            panel.hline(across, f"width, {across:.3g} D", color="k", lw=0.8)
        scatter(panel, random, name)
        panels.append(panel)
    legend(panels[0], rows, frictions=False)
    legend(panels[1], random, stresses=False)
    return Picture(panels, columns=2, shape=(13, 4.2))


def gain_cases(rows: list[Row]) -> Picture:
    """Fig. 19: gain factor of FCC and the lowest friction over stress; below, the resonances."""
    own = styles(groups.with_curve(rows, "gain", "gain factor"))
    two, panels = [members for _, members, _ in own][:2], []
    for letter, members in zip(("(a)", "(b)"), two, strict=False):
        title = f"{letter} {members[0].group}"
        title += ", each stress a decade lower" if len(members) > 1 else ""
        panel = Panel("frequency over $f_1$", "gain factor", title, yscale="log", ylim=(1e-6, 10))
        for k, row in enumerate(members):  # the curves of all stresses are nearly one
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
    below = gain([members[min(1, len(members) - 1)] for members in two]).panels
    for letter, panel in zip(("(c)", "(d)"), below, strict=False):
        panel.title = f"{letter} {panel.title}"
    panels += below
    return Picture(panels, columns=2, shape=(10, 0.3 + 3.1 * -(-len(panels) // 2)))


@each
def gain(row: Row) -> Panel:
    """Fig. 19: gain factor (receiver over source stress) of the springs, and the resonances.

    Between rigid walls the stress ratio of a rod is 1 / |cos kappa L|: its maxima lie midway
    between the resonances sin kappa L = 0, not on them.
    """
    f, height = row.curves["gain"]
    f_r, top = row.curves["resonances"][0], 10 * row.curves["first"][0][0]
    keep = f < top
    panel = Panel("frequency (kHz)", "gain factor", row.label, legend="upper right")
    panel.xlim, panel.ylim = (0, top / 1e3), (0, 1.4 * float(height[keep].max()))
    panel.line(f[keep] / 1e3, height[keep], "gain", color="k")
    f_r = f_r[f_r < top] / 1e3
    held: dict[str, Any] = {"color": BLUE, "ls": ":", "lw": 1}
    free: dict[str, Any] = {"color": ORANGE, "ls": "--", "lw": 0.8}
    if len(f_r):
        panel.vlines(f_r, "resonances $f_r$, both walls held", **held)
        middle = 0.5 * (np.append(0, f_r[:-1]) + f_r)
        panel.vlines(middle, "half way, source free of stress", **free)
    return panel
