"""Figures over all cases: 6, 8, 16 to 19, and what the paper does not have; from their rows."""

from __future__ import annotations

import numpy as np

from analysis.comparable import of_one_producer
from analysis.estimators.power_law import power_law
from analysis.figures.picture import Panel, Picture
from analysis.paper import FRICTIONS, RANGES, stated
from analysis.rows import Row, groups_of, law_of
from modal.formats.hdf5 import InputError

MARKERS = "o^vD<>p"
"""Of the frictions, in their order; crystals are squares."""
SHADES = "#08306b", "#2258a0", "#4080b8", "#6a9a6a", "#b08a30", "#d07028", "#c04000"
"""From friction 0 to 0.4, darkest first: read in grey by the marker."""
PAPER = {"marker": "*", "ls": "none", "ms": 14, "mfc": "none", "color": "#c05000", "mew": 1.2}
STRESS_MARKS = {1e4: "v", 1e5: "o", 1e6: "D", 1e7: "^"}


def _styles(rows: list[Row]) -> list[tuple[str, list[Row], dict]]:
    """Name, members and look of each group."""
    found = []
    for name, members in groups_of(rows).items():
        style = {"marker": "s", "color": "k", "ls": "none", "mfc": "none"}
        if name != "FCC":
            known = np.isfinite(members[0].mu_comp)
            at = int(np.argmin(abs(np.array(FRICTIONS) - members[0].mu_comp))) if known else 0
            style |= {"marker": MARKERS[at], "color": SHADES[at]}
        found.append((name.replace("random, mu_comp", r"$\mu_{comp}$"), members, style))
    return found


def _column(members: list[Row], name: str) -> np.ndarray:
    return np.array([row.value(name) for row in members])


def _points(panel: Panel, x, members: list[Row], name: str, text: str, style: dict, scale=1.0):
    """Points with their error bars; nothing where no case has the number."""
    y = scale * _column(members, name)
    if not np.isfinite(y).any():
        return
    panel.line(x, y, text, **style)
    error = scale * np.array([row.error(name) for row in members])
    known = np.isfinite(error) & (error > 0)
    if known.any():
        style = {"color": style["color"], "lw": 0.8, "capsize": 2}
        panel.add("error", np.asarray(x)[known], y[known], error[known], **style)


def velocity_cases(rows: list[Row]) -> Picture:
    """Fig. 6: V_P by first peaks (dL/dt) against void ratio and stress, with fitted exponents."""
    left = Panel("void ratio", "$V_P$, first peaks (m/s)", "(a)")
    right = Panel("stress (kPa)", "$V_P$, first peaks (m/s)", "(b)", xscale="log", yscale="log")
    right.legend = "upper left"
    for name, members, style in _styles(rows):
        kind, producer = of_one_producer(members, "v_p_first_peaks")
        law = law_of(members, "stress_pa", kind)
        text = f"{name}, {producer}" + (f": {law}" if np.isfinite(law.exponent) else "")
        stress = np.array([row.stress for row in members])
        _points(right, stress / 1e3, members, kind, text, style)
        if np.isfinite(law.exponent):
            right.line(stress / 1e3, law.factor * stress**law.exponent, color="0.6", lw=0.7)
        for row in members:
            mark = STRESS_MARKS.get(float(f"{row.stress:.2g}"), "x")
            look = style | {"marker": mark, "mfc": "k" if row.crystal else "none"}
            _points(left, [row.value("void_ratio")], [row], kind, "", look)
    for level, mark in STRESS_MARKS.items():
        if any(abs(row.stress / level - 1) < 0.1 for row in rows):
            style = {"marker": mark, "color": "k", "ls": "none", "mfc": "none"}
            left.line([np.nan], [np.nan], f"{level / 1e3:g} kPa (FCC filled)", **style)
    slope = np.array([1e4, 1e7])
    start = min(_column(rows, "v_p_first_peaks_m_per_s"), default=np.nan)
    if np.isfinite(start):
        line = 0.93 * start * (slope / slope[0]) ** (1 / 6)
        right.line(slope / 1e3, line, "paper: 1/6 for FCC, more for random", color="k", ls="--")
    return Picture([left, right], columns=2, shape=(10, 4.6))


def highest_frequency(rows: list[Row]) -> Picture:
    """Fig. 8: highest natural frequency against stress, with and without rotations, and Eq. 10."""
    left = Panel("stress (kPa)", "$f_{max}$ (kHz)", "(a)", xscale="log", yscale="log")
    right = Panel("stress (kPa)", "$f_{max}$ over that of FCC or its law", "(b)", xscale="log")
    crystal = [row for row in rows if row.crystal]
    reference = law_of(crystal, "stress_pa", "f_max_khz") if len(crystal) > 1 else None
    for name, members, style in _styles(rows):
        stress = np.array([row.stress for row in members])
        top = _column(members, "f_max_khz")
        law = power_law(stress, top)
        text = name + (f": {law}" if np.isfinite(law.exponent) else "")
        left.line(stress / 1e3, top, text, **style)
        if reference is not None and np.isfinite(reference.exponent):
            over = top / (reference.factor * stress**reference.exponent)
            right.line(stress / 1e3, over, name, **style)
        if name == "FCC":
            edge = _column(members, "band_edge_theory_khz")
            left.line(stress / 1e3, edge, "FCC, Eq. 10", ls="--", color="0.5")
            only = edge * _column(members, "translations_only_over_edge")
            look = {"marker": "x", "ls": "none", "color": "k"}
            left.line(stress / 1e3, only, "FCC, translations only", **look)
    known = [(r.stress / 1e3, stated("f_max", r.number)) for r in rows if stated("f_max", r.number)]
    if known:
        at, said = zip(*known, strict=True)
        left.line(at, said, "paper", **PAPER)
    if right.series:
        right.add("band", [8, 1.25e4], [0.97] * 2, [1.03] * 2, "paper: within 3 %", color="0.85")
        return Picture([left, right], columns=2)
    return Picture([left])


def low_pass_cases(rows: list[Row]) -> Picture:
    """Fig. 16: f_low-pass, 2 % of the whole map, against void ratio and stress; 1 % as crosses."""
    left = Panel("void ratio", "$f_{low-pass}$, 2 % (kHz)", "(a)", yscale="log")
    right = Panel("stress (kPa)", "$f_{low-pass}$ (kHz)", "(b)", xscale="log", yscale="log")
    for name, members, style in _styles(rows):
        kind, producer = of_one_producer(members, "f_low_pass_2")
        stress = np.array([row.stress for row in members]) / 1e3
        _points(left, _column(members, "void_ratio"), members, kind, f"{name}, {producer}", style)
        _points(right, stress, members, kind, "", style)
        one = _column(members, of_one_producer(members, "f_low_pass_1")[0])
        text = "1 %" if not any(s.label == "1 %" for s in right.series) else ""
        right.line(stress, one, text, marker="+", ls="none", color="0.4")
    known = [(r, stated("threshold_2", r.number)) for r in rows if stated("threshold_2", r.number)]
    if known:
        left.line(
            [r.value("void_ratio") for r, _ in known], [f for _, f in known], "paper", **PAPER
        )
        right.line([r.stress / 1e3 for r, _ in known], [f for _, f in known], "paper", **PAPER)
    return Picture([left, right], columns=2, shape=(10, 4.4))


def velocity_low_pass(rows: list[Row]) -> Picture:
    """Fig. 17: f_low-pass, 2 %, against V_P by first peaks; slope through each group."""
    panel = Panel("$V_P$, first peaks (m/s)", "$f_{low-pass}$, 2 % (kHz)", "")
    panel.xscale = panel.yscale = "log"
    for name, members, style in _styles(rows):
        velocity, producer = of_one_producer(members, "v_p_first_peaks")
        kind = of_one_producer(members, "f_low_pass_2")[0]
        law = law_of(members, velocity, kind)
        text = f"{name}, {producer}"
        text += f": slope {law.exponent:.2f}" if np.isfinite(law.exponent) else ""
        _points(panel, _column(members, velocity), members, kind, text, style)
    random = [row for row in rows if not row.crystal]
    if random:
        first = min(random, key=lambda row: row.value("v_p_first_peaks_m_per_s"))
        v, f = first.value("v_p_first_peaks_m_per_s"), first.value("f_low_pass_2_khz")
        span = np.array([1, 3.0])
        for slope, ls in ((1.2, "--"), (1.4, ":")):
            panel.line(v * span, 0.8 * f * span**slope, f"paper: {slope}", color="k", ls=ls, lw=0.9)
    return Picture([panel], shape=(6.4, 4.8))


def wavelength_cases(rows: list[Row]) -> Picture:
    """Fig. 18: lambda_low-pass / D against void ratio, 2 % and 1 %; the paper's ranges."""
    panels = []
    for percent, key, letter in (("2", "lambda_over_d", "(a)"), ("1", "lambda_over_d_1", "(b)")):
        panel = Panel("void ratio", rf"$\lambda_{{low-pass}}/D$, {percent} %", letter, yscale="log")
        panel.ylim = (1, 40)
        for name, members, style in _styles(rows):
            e = _column(members, "void_ratio")
            if name == "FCC":
                kind, producer = of_one_producer(members, "lambda_edge", "over_d")
                panel.line(e, _column(members, kind), f"{name}, band edge, {producer}", **style)
                continue
            kind, producer = of_one_producer(members, f"lambda_{percent}")
            _points(panel, e, members, kind, f"{name}, {producer}", style)
            if percent == "2":
                text = "of each particle's maximum"
                text = "" if any(s.label == text for s in panel.series) else text
                own = _column(members, "lambda_2_own_over_d")
                panel.line(e, own, text, marker=".", ls="none", color="0.55", ms=4)
        limits = next(r for r in RANGES if r.id == key)
        span = [0.5, 0.75]
        text = f"paper: {limits.text}"
        panel.add("band", span, [limits.low] * 2, [limits.high] * 2, text, color="0.88", zorder=0)
        panel.add("hline", [0], [2**0.5], None, r"FCC, $\sqrt{2}$", color="0.5", ls=":")
        panels.append(panel)
    return Picture(panels, columns=2, shape=(10, 4.4))


def gain_cases(rows: list[Row]) -> Picture:
    """Fig. 19: gain factor of FCC and friction 0 over stress, and below 10 kHz the resonances."""
    panels = []
    numbered = {row.number: row for row in rows}
    for letter, cases, what in (
        ("(a)", (2, 3, 4), "FCC"),
        ("(b)", (6, 7, 8), "random, friction 0"),
    ):
        members = [numbered[n] for n in cases if n in numbered]
        if not members:
            continue
        panel = Panel("frequency over $f_1$", "gain factor", f"{letter} {what}", yscale="log")
        for row, (colour, ls) in zip(
            members, (("k", "-"), ("#0060a8", "--"), ("#c05000", ":")), strict=False
        ):
            f, gain = row.curves["gain"]
            width = row.value("gain_resolution_hz")
            text = f"{row.stress / 1e3:g} kPa, resolution {width:.0f} Hz"
            panel.line(f / row.curves["first"][0], gain, text, color=colour, ls=ls)
        panel.add("hline", [0], [1.0], None, "paper: maximum above 1", color="0.5", lw=0.8)
        panels.append(panel)
    for letter, case in (("(c)", 2), ("(d)", 6)):
        if case not in numbered:
            continue
        row = numbered[case]
        f, gain = row.curves["gain"]
        f_r = row.curves["resonances"][0]
        keep, top = f < 1e4, 10.0
        panel = Panel("frequency (kHz)", "gain factor", f"{letter} {row.label}", xlim=(0, top))
        panel.line(f[keep] / 1e3, gain[keep], "gain", color="k")
        f_r = f_r[f_r < 1e4] / 1e3
        if len(f_r):
            style = {"color": "#0060a8", "ls": ":", "lw": 1}
            panel.add("vline", f_r, 0 * f_r, None, "resonances $f_r$, both walls held", **style)
            middle = 0.5 * (np.append(0, f_r[:-1]) + f_r)
            style = {"color": "#c05000", "ls": "--", "lw": 0.8}
            panel.add("vline", middle, 0 * middle, None, "half way, source free of stress", **style)
        panel.ylim = (0, 1.4 * float(gain[keep].max()))
        panel.legend = "upper right"
        panels.append(panel)
    if not panels:
        raise InputError("none of the cases 2, 3, 4, 6, 7, 8 is there")
    return Picture(panels, columns=2, shape=(10, 0.3 + 3.1 * -(-len(panels) // 2)))


def gain_orders(rows: list[Row]) -> Picture:
    """Beyond the paper: the gain's maxima as orders of the resonances: r - 1/2, not r."""
    left = Panel("maximum", "order of its frequency", "(a)", legend="upper left")
    right = Panel("maximum", "order less (number - 1/2)", "(b)", ylim=(-0.3, 0.6))
    for name, members, style in _styles(rows):
        for k, row in enumerate(members):
            at, expected = row.curves["gain_orders"]
            count = min(len(at), 15)
            number = expected[:count] + 0.5
            look = style | {"ms": 4, "alpha": 0.8}
            left.line(number, at[:count], name if k == 0 else "", **look)
            right.line(number, at[:count] - expected[:count], "", **look)
    orders = np.arange(1, 16)
    left.line(orders, orders, "both walls held: r", color="k", ls=":")
    left.line(orders, orders - 0.5, "source free, receiver held: r - 1/2", color="k", ls="--")
    right.add("hline", [0], [0.5], None, "both walls held", color="k", ls=":")
    right.add("hline", [0], [0.0], None, "source free, receiver held", color="k", ls="--")
    return Picture([left, right], columns=2)


def scattering(rows: list[Row]) -> Picture:
    """Beyond the paper: width of the ridge, mean free path, and the Ioffe-Regel limit."""
    members = [row for row in rows if "ridge" in row.curves]
    if not members:
        raise InputError("no case has a structure factor; run python -m analysis prepare CASE")
    width = Panel("frequency (kHz)", "full width of the ridge (kHz)", "(a)")
    path = Panel("frequency (kHz)", "mean free path / D", "(b)")
    for panel in (width, path):
        panel.xscale = panel.yscale = "log"
    limit = Panel("void ratio", "frequency (kHz)", "(c)", yscale="log")
    ratio = Panel("stress (kPa)", "Ioffe-Regel over $f_{low-pass}$, 2 %", "(d)", xscale="log")
    diameter = 2 * 1.27e-3
    for name, group, style in _styles(members):
        for k, row in enumerate(group):
            f, w = row.curves["ridge"]
            v = row.value("v_p_long_waves_linear_m_per_s")
            text = name if k == 0 else ""
            look = {"color": style["color"], "marker": style["marker"], "ms": 3, "lw": 0.7}
            width.line(f / 1e3, w / 1e3, text, mfc="none", **look)
            path.line(f / 1e3, v / (2 * np.pi * w * diameter), "", mfc="none", **look)
        e = _column(group, "void_ratio")
        limit.line(e, _column(group, "ioffe_regel_khz"), f"{name}, Ioffe-Regel", **style)
        two = _column(group, "f_low_pass_2_linear_khz")
        filled = style | {"mfc": style["color"], "alpha": 0.5}
        limit.line(e, two, f"{name}, $f_{{low-pass}}$ 2 %", **filled)
        stress = np.array([row.stress for row in group]) / 1e3
        ratio.line(stress, _column(group, "ioffe_regel_khz") / two, name, **style)
    f = np.geomspace(
        *np.nanpercentile(np.concatenate([r.curves["ridge"][0] for r in members]), (5, 100))
    )
    width.line(f / 1e3, f / 1e3 / np.pi, r"$l = \lambda / 2$", color="k", ls="--")
    return Picture([width, path, limit, ratio], columns=2, shape=(10, 7))


def density_excess(rows: list[Row]) -> Picture:
    """Beyond the paper: density of states over f^2, and its size against coordination number."""
    members = [row for row in rows if "density" in row.curves]
    if not members:
        raise InputError("no case has a density of states; run python -m analysis prepare CASE")
    left = Panel("$f / f_{max}$", "$D f_{max}^3 / f^2$", "(a)", xscale="log", yscale="log")
    left.ylim = (0.1, 2e3)
    right = Panel("coordination number", "$D f_{max}^3 / f^2$ at a tenth of $f_{max}$", "(b)")
    right.yscale = "log"
    for name, group, style in _styles(members):
        z, height = [], []
        for k, row in enumerate(group):
            f, density, _ = row.curves["density"]
            top = 1e3 * row.value("f_max_khz")
            keep = (f > FIRST_LINES) & (f < top)
            reduced = density[keep] * top**3 / f[keep] ** 2
            left.line(f[keep] / top, reduced, name if k == 0 else "", color=style["color"], lw=0.9)
            z.append(row.value("coordination_number_bearing"))
            height.append(float(np.interp(0.1, f[keep] / top, reduced)))
        right.line(z, height, name, **style)
    right.xlabel = "coordination number of force-bearing spheres"
    return Picture([left, right], columns=2)


FIRST_LINES = 5e3
"""Hz below which modes of zero frequency are seen, whose line is 2 kHz wide."""


def low_pass_rules(rows: list[Row]) -> Picture:
    """Beyond the paper: f_low-pass by each rule over that by the paper's words, linear and YADE."""
    panel = Panel("case", "frequency over 2 % of the whole map, one chain", "")
    number = [row.number or 0 for row in rows]
    base = _column(rows, "f_low_pass_2_khz")
    for name, text, marker in (
        ("f_low_pass_1_khz", "1 %", "^"),
        ("f_low_pass_3_khz", "3 %", "v"),
        ("f_low_pass_2_own_khz", "2 % of each particle's maximum", "x"),
        ("f_low_pass_2_layers_khz", "2 % of the map of layer means", "_"),
        ("f_low_pass_2_linear_khz", "2 %, linear wave", "o"),
        ("ioffe_regel_khz", "Ioffe-Regel", "*"),
    ):
        y = _column(rows, name) / base
        if np.isfinite(y).any():
            style = {"marker": marker, "ls": "none", "mfc": "none", "ms": 6}
            colour = "k" if marker in "ov^" else "#c05000"
            panel.line(number, y, text, color=colour, **style)
    panel.add("hline", [0], [1.0], None, "", color="0.6", lw=0.8)
    return Picture([panel], shape=(9, 4))
