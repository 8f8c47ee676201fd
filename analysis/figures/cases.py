"""Figures over all cases: 6, 8, 16 to 19, from their rows."""

from __future__ import annotations

import numpy as np

from analysis.comparable import end_frictions, of_one_producer, spread_of_highest
from analysis.estimators.power_law import power_law
from analysis.figures.groups import STATED, STRESS_MARKS, column, points, styles
from analysis.figures.picture import Panel, Picture
from analysis.rows import Row, law_of
from modal.tools.errors import InputError


def velocity_cases(rows: list[Row]) -> Picture:
    """Fig. 6: V_P by first peaks (dL/dt) against void ratio and stress, with fitted exponents."""
    left = Panel("void ratio", "$V_P$, first peaks (m/s)", "(a)")
    right = Panel("stress (kPa)", "$V_P$, first peaks (m/s)", "(b)", xscale="log", yscale="log")
    right.legend = "outside"
    for name, members, style in styles(rows):
        kind, producer = of_one_producer(members, "v_p_first_peaks")
        law = law_of(members, "stress_pa", kind)
        text = f"{name}, {producer}" + (f": {law}" if np.isfinite(law.exponent) else "")
        stress = np.array([row.stress for row in members])
        points(right, stress / 1e3, members, kind, text, style)
        if np.isfinite(law.exponent):
            right.line(stress / 1e3, law.factor * stress**law.exponent, color="0.6", lw=0.7)
        for row in members:
            mark = STRESS_MARKS.get(float(f"{row.stress:.2g}"), "x")
            look = style | {"marker": mark, "mfc": "k" if row.crystal else "none"}
            points(left, [row.value("void_ratio")], [row], kind, "", look)
    for level, mark in STRESS_MARKS.items():
        if any(abs(row.stress / level - 1) < 0.1 for row in rows):
            style = {"marker": mark, "color": "k", "ls": "none", "mfc": "none"}
            left.line([np.nan], [np.nan], f"{level / 1e3:g} kPa (FCC filled)", **style)
    slope = np.array([1e4, 1e7])
    start = min(column(rows, "v_p_first_peaks_m_per_s"), default=np.nan)
    if np.isfinite(start):
        line = 0.93 * start * (slope / slope[0]) ** (1 / 6)
        right.line(slope / 1e3, line, "1/6", color="k", ls="--")
    return Picture([left, right], columns=2, shape=(12, 4.6))


def highest_frequency(rows: list[Row]) -> Picture:
    """Fig. 8: highest natural frequency against stress, with and without rotations, and Eq. 10."""
    left = Panel("stress (kPa)", "$f_{max}$ (kHz)", "(a)", xscale="log", yscale="log")
    left.legend = "lower right"
    right = Panel("stress (kPa)", "$f_{max}$ over that of FCC", "(c)", xscale="log")
    right.legend = "outside"
    ends = end_frictions(rows)
    of_crystal = {row.stress: row.value("f_max_khz") for row in rows if row.crystal}
    for name, members, style in styles(rows):
        stress = np.array([row.stress for row in members])
        top = column(members, "f_max_khz")
        law = power_law(stress, top)
        text = name + (f": {law}" if np.isfinite(law.exponent) else "")
        if name == "FCC" or members[0].mu_comp in ends:
            left.line(stress / 1e3, top, name, **style)
        over = top / np.array([of_crystal.get(row.stress, np.nan) for row in members])
        if np.isfinite(over).any():
            right.line(stress / 1e3, over, text, **style)
        if name == "FCC":
            edge = column(members, "band_edge_theory_khz")
            left.line(stress / 1e3, edge, "FCC, Eq. 10", ls="--", color="0.5")
            only = edge * column(members, "translations_only_over_edge")
            look = {"marker": "x", "ls": "none", "color": "k"}
            left.line(stress / 1e3, only, "FCC, translations only", **look)
    known = [(r.stress / 1e3, r.stated["f_max_khz"][0]) for r in rows if "f_max_khz" in r.stated]
    if known:
        at, said = zip(*known, strict=True)
        left.line(at, said, "stated", **STATED)
    if not right.series:
        return Picture([left])
    far = Panel("stress (kPa)", "highest over lowest $f_{max}$, less 1 (%)", "(b)", xscale="log")
    for text, chosen, mark in (
        ("FCC, lowest, highest friction", [r for r in rows if r.crystal or r.mu_comp in ends], "o"),
        ("all packings", rows, "x"),
    ):
        apart = spread_of_highest(chosen)
        style = {"marker": mark, "ls": "none", "color": "k", "mfc": "none"}
        far.line([s / 1e3 for s in apart], list(apart.values()), text, **style)
    limit = next((row.stated["f_max_apart"][1] for row in rows if "f_max_apart" in row.stated), 0)
    if limit:
        text = f"stated: less than {limit:g} %"
        far.add("hline", [0], [limit], None, text, color="k", ls="--")
    far.ylim = (0, 1.4 * max([limit, *apart.values()]))
    return Picture([left, far, right], columns=3, shape=(14, 4))


def low_pass_cases(rows: list[Row]) -> Picture:
    """Fig. 16: f_low-pass, 2 % of the whole map, against void ratio and stress; 1 % as crosses."""
    left = Panel("void ratio", "$f_{low-pass}$, 2 % (kHz)", "(a)", yscale="log")
    right = Panel("stress (kPa)", "$f_{low-pass}$ (kHz)", "(b)", xscale="log", yscale="log")
    right.legend = "outside"
    for name, members, style in styles(rows):
        kind, producer = of_one_producer(members, "f_low_pass_2")
        stress = np.array([row.stress for row in members]) / 1e3
        points(left, column(members, "void_ratio"), members, kind, "", style)
        points(right, stress, members, kind, f"{name}, {producer}", style)
        one = column(members, of_one_producer(members, "f_low_pass_1")[0])
        text = "1 %" if not any(s.label == "1 %" for s in right.series) else ""
        right.line(stress, one, text, marker="+", ls="none", color="0.4")
    known = [row for row in rows if "f_low_pass_2_khz" in row.stated]
    if known:
        said = [row.stated["f_low_pass_2_khz"][0] for row in known]
        left.line(column(known, "void_ratio"), said, **STATED)
        right.line([row.stress / 1e3 for row in known], said, "stated", **STATED)
    return Picture([left, right], columns=2, shape=(12, 4.4))


def velocity_low_pass(rows: list[Row]) -> Picture:
    """Fig. 17: f_low-pass, 2 %, against V_P by first peaks; slope through each group."""
    panel = Panel("$V_P$, first peaks (m/s)", "$f_{low-pass}$, 2 % (kHz)", "")
    panel.xscale = panel.yscale = "log"
    panel.legend = "outside"
    for name, members, style in styles(rows):
        velocity, producer = of_one_producer(members, "v_p_first_peaks")
        kind = of_one_producer(members, "f_low_pass_2")[0]
        law = law_of(members, velocity, kind)
        text = f"{name}, {producer}"
        text += f": slope {law.exponent:.2f}" if np.isfinite(law.exponent) else ""
        text += rf" $\pm$ {law.error:.1g}" if np.isfinite(law.error) else ""
        points(panel, column(members, velocity), members, kind, text, style)
    random = [row for row in rows if not row.crystal]
    if random:
        first = min(random, key=lambda row: row.value("v_p_first_peaks_m_per_s"))
        v, f = first.value("v_p_first_peaks_m_per_s"), first.value("f_low_pass_2_khz")
        span = np.array([1, 3.0])
        for slope, ls in zip(
            first.stated.get("low_pass_power_of_v_p", ()), ("--", ":"), strict=False
        ):
            text = f"stated: {slope}"
            panel.line(v * span, 0.8 * f * span**slope, text, color="k", ls=ls, lw=0.9)
    return Picture([panel], shape=(8.4, 4.8))


def wavelength_cases(rows: list[Row]) -> Picture:
    """Fig. 18: lambda_low-pass / D against void ratio, 2 % and 1 %; the paper's ranges."""
    panels = []
    for percent, letter in (("2", "(a)"), ("1", "(b)")):
        panel = Panel("void ratio", rf"$\lambda_{{low-pass}}/D$, {percent} %", letter, yscale="log")
        seen = [row.value(f"lambda_{percent}_over_d") for row in rows]
        panel.ylim = (1, max(40.0, 1.3 * np.nanmax([*seen, 0.0])))
        panel.legend = "outside" if percent == "1" else "upper left"
        for name, members, style in styles(rows):
            e = column(members, "void_ratio")
            if name == "FCC":
                kind, producer = of_one_producer(members, "lambda_edge", "over_d")
                text = f"{name}, band edge, {producer}" if percent == "1" else ""
                panel.line(e, column(members, kind), text, **style)
                continue
            kind, producer = of_one_producer(members, f"lambda_{percent}")
            text = f"{name}, {producer}" if percent == "1" else ""
            points(panel, e, members, kind, text, style)
            if percent == "2":
                text = "of each particle's maximum"
                text = "" if any(s.label == text for s in panel.series) else text
                own = column(members, of_one_producer(members, "lambda_2_own")[0])
                panel.line(e, own, text, marker=".", ls="none", color="0.55", ms=4)
        said = [r.stated[k] for r in rows if (k := f"lambda_{percent}_over_d") in r.stated]
        for low, high in said[:1]:
            text, ends = f"stated: {low:g} to {high:g}", ([low] * 2, [high] * 2)
            panel.add("band", [0.5, 0.75], *ends, text, color="0.88", zorder=0)
        panel.add("hline", [0], [2**0.5], None, r"FCC, $\sqrt{2}$", color="0.5", ls=":")
        panels.append(panel)
    return Picture(panels, columns=2, shape=(12, 4.4))


def gain_cases(rows: list[Row]) -> Picture:
    """Fig. 19: gain factor of FCC and the lowest friction over stress; below, the resonances."""
    known = [row for row in rows if "gain" in row.curves]
    if not known:
        raise InputError("no case has a gain factor; measure one")
    groups = [members for _, members, _ in styles(known)][:2]
    panels = []
    looks = ("k", "-"), ("#0060a8", "--"), ("#c05000", ":"), ("0.5", "-.")
    for letter, members in zip(("(a)", "(b)"), groups, strict=False):
        title = f"{letter} {members[0].group}"
        panel = Panel("frequency over $f_1$", "gain factor", title, yscale="log", ylim=(1e-6, 10))
        for row, (colour, ls) in zip(members, looks, strict=False):
            f, gain = row.curves["gain"]
            width = row.value("gain_resolution_hz")
            text = f"{row.stress / 1e3:g} kPa, resolution {width:.0f} Hz"
            # Of a random packing as far as more than its noise is received.
            edge = np.inf if row.crystal else 2 * 1e3 * row.value("f_low_pass_2_linear_khz")
            f, gain = (values[~(f > edge)] for values in (f, gain))
            panel.line(f / row.curves["first"][0], gain, text, color=colour, ls=ls, lw=0.9)
        panel.add("hline", [0], [1.0], None, "1", color="0.5", lw=0.8)
        panels.append(panel)
    for letter, members in zip(("(c)", "(d)"), groups, strict=False):
        row = members[min(1, len(members) - 1)]
        f, gain = row.curves["gain"]
        f_r = row.curves["resonances"][0]
        top = 10 * row.curves["first"][0][0]
        keep = f < top
        panel = Panel("frequency (kHz)", "gain factor", f"{letter} {row.label}")
        panel.xlim = (0, top / 1e3)
        panel.line(f[keep] / 1e3, gain[keep], "gain", color="k")
        f_r = f_r[f_r < top] / 1e3
        if len(f_r):
            style = {"color": "#0060a8", "ls": ":", "lw": 1}
            panel.add("vline", f_r, 0 * f_r, None, "resonances $f_r$, both walls held", **style)
            middle = 0.5 * (np.append(0, f_r[:-1]) + f_r)
            style = {"color": "#c05000", "ls": "--", "lw": 0.8}
            panel.add("vline", middle, 0 * middle, None, "half way, source free of stress", **style)
        panel.ylim = (0, 1.4 * float(gain[keep].max()))
        panel.legend = "upper right"
        panels.append(panel)
    return Picture(panels, columns=2, shape=(10, 0.3 + 3.1 * -(-len(panels) // 2)))
