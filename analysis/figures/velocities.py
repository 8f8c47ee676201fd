"""Figures 6, 11, 16 to 18: velocities and the low-pass frequency, over cases and over frequency."""

from __future__ import annotations

import numpy as np

from analysis.crystal import stress_rows
from analysis.estimators.power_law import power_law
from analysis.estimators.resonances import mode_velocities
from analysis.estimators.transfer import wall_velocity
from analysis.figures.picture import Panel, Picture
from analysis.measures import Measures, groups

MARKERS = "o^vD<>p"
"""Of the random groups, in their order; crystals are squares."""


YADE = {"marker": "x", "ms": 8}
"""Look of what YADE's records say, over that of the group."""


def _marked(cases: list[Measures]) -> list[tuple[str, list[Measures], dict]]:
    """Name, members and style of the points of each group."""
    found, random = [], iter(MARKERS)
    for name, members in groups(cases).items():
        marker, colour = ("s", "k") if name == "FCC" else (next(random), "#c05000")
        style = {"marker": marker, "mfc": "none", "color": colour, "ls": "none"}
        found.append((name, members, style))
    return found


def velocity_cases(cases: list[Measures]) -> Picture:
    """Fig. 6: V_P (first peaks, dL/dt, of the linear wave and of YADE), and fitted exponents."""
    left = Panel("void ratio", "$V_P$, first peaks (m/s)")
    right = Panel("stress (kPa)", "$V_P$ (m/s)", xscale="log", yscale="log")
    for name, members, style in _marked(cases):
        stress = np.array([m.case.stress for m in members])
        for producer, peak, look in (
            ("linear wave", np.array([m.first_peak.value for m in members]), style),
            ("YADE", np.array([m.yade_first_peak.value for m in members]), style | YADE),
        ):
            if not np.isfinite(peak).any():
                continue
            left.line([m.void_ratio for m in members], peak, f"{name}, {producer}", **look)
            law = power_law(stress, peak)
            text = f"{name}, {producer}"
            text += f": {law}" if np.isfinite(law.exponent) else ""
            right.line(stress / 1e3, peak, text, **look)
            if np.isfinite(law.exponent):
                right.line(stress / 1e3, law.factor * stress**law.exponent, color="0.5", lw=0.8)
    return Picture([left, right], columns=2)


def velocity_frequency(cases: list[Measures]) -> Picture:
    """Fig. 11: phase and group velocity of the linear wave (walls, layers) and modes; dL/dt."""
    panels = []
    for m in cases:
        case = m.case
        top = 0.9 * m.band
        panel = Panel(
            "frequency (kHz)", "velocity (m/s)", case.label, legend="lower left",
            ylim=(0, 1.25 * m.long_wave.value), xlim=(0, top / 1e3),
        )  # fmt: skip
        walls = wall_velocity(case.wave, case.network.length)
        if walls is not None:
            f, phase, group, _ = walls
            keep = (f > 0.3 * m.low_frequency) & (f < top)
            panel.line(f[keep] / 1e3, phase[keep], "phase, walls", color="0.6")
            panel.line(f[keep] / 1e3, group[keep], "group, walls", color="0.6", ls=":")
        wave = m.coherent
        keep = wave.frequency < top
        f = wave.frequency[keep] / 1e3
        panel.line(f, wave.phase_velocity[keep], "phase, layers", color="k")
        panel.line(f, wave.group_velocity[keep], "group, layers", color="k", ls=":")
        f_r, kappa = m.resonances
        keep = f_r < top
        if keep.sum() > 2:
            phase, group = mode_velocities(f_r[keep], kappa[keep])
            every = slice(None, None, max(1, len(phase) // 25))
            style = {"ls": "none", "mfc": "none", "color": "#0060a8", "ms": 5}
            panel.line(f_r[keep][every] / 1e3, phase[every], "phase, modes", marker="o", **style)
            panel.line(f_r[keep][every] / 1e3, group[every], "group, modes", marker="v", **style)
        panel.add("hline", [0], [m.first_peak.value], None, "first peaks", color="#c05000", ls="--")
        panels.append(panel)
    return Picture(panels, columns=2 if len(panels) > 1 else 1)


def low_pass_cases(cases: list[Measures]) -> Picture:
    """Fig. 16: f_low-pass of the linear wave against void ratio and stress, 2 % and 1 % rule."""
    left = Panel("void ratio", "$f_{low-pass}$, 2 % (kHz)", yscale="log")
    right = Panel("stress (kPa)", "$f_{low-pass}$ (kHz)", xscale="log", yscale="log")
    for name, members, style in _marked(cases):
        stress = np.array([m.case.stress for m in members]) / 1e3
        two, one = (np.array([m.low_pass[k].value for m in members]) / 1e3 for k in (0, 1))
        left.line([m.void_ratio for m in members], two, name, **style)
        right.line(stress, two, **style)
        text = "1 % rule" if len(right.series) == 1 else ""
        right.line(stress, one, text, marker="+", ls="none", color="0.4")
    return Picture([left, right], columns=2)


def velocity_low_pass(cases: list[Measures]) -> Picture:
    """Fig. 17: f_low-pass against V_P, both of the linear wave; slope through each group."""
    panel = Panel("$V_P$, first peaks (m/s)", "$f_{low-pass}$, 2 % (kHz)", "")
    panel.xscale = panel.yscale = "log"
    for name, members, style in _marked(cases):
        v = np.array([m.first_peak.value for m in members])
        f = np.array([m.low_pass[0].value for m in members]) / 1e3
        law = power_law(v, f)
        text = f"{name}: slope {law.exponent:.2f}" if np.isfinite(law.exponent) else name
        panel.line(v, f, text, **style)
    return Picture([panel])


def wavelength_cases(cases: list[Measures]) -> Picture:
    """Fig. 18: lambda_low-pass / D against void ratio, 2 % and 1 % rule; crystals: band edge."""
    panel = Panel("void ratio", r"$\lambda_{low-pass}/D$", yscale="log")
    for name, members, style in _marked(cases):
        e = [m.void_ratio for m in members]
        if name == "FCC":
            edge = [m.edge_wavelength[0] for m in members]
            panel.line(e, edge, f"{name}, band edge", **style)
            continue
        two, one = ([m.low_pass_wavelength(k) for m in members] for k in (0, 1))
        panel.line(e, two, f"{name}, 2 %", **style)
        panel.line(e, one, "1 %" if len(panel.series) == 1 else "", **style | {"marker": "+"})
    panel.add("hline", [0], [2**0.5], None, r"FCC theory, $\sqrt{2}$", color="0.5", ls=":")
    return Picture([panel])


def stress_dependence(cases: list[Measures]) -> Picture:
    """Long-wave velocity and band edge of the crystals: theory, modes, signals, with exponents."""
    left = Panel("stress (kPa)", "$V_P$, long waves (m/s)", xscale="log", yscale="log")
    right = Panel("stress (kPa)", "$f_{low-pass}$ (kHz)", xscale="log", yscale="log")
    columns = stress_rows([m.case for m in cases if m.case.is_crystal])
    stress = columns["stress_Pa"]
    for name, marker, size in (("theory", "s", 9), ("modal", "o", 6), ("yade", "x", 6)):
        label = "YADE" if name == "yade" else name
        for panel, key, scale in (
            (left, f"velocity_{name}_m_per_s", 1),
            (right, f"f_low_pass_{name}_Hz", 1e-3),
        ):
            value = scale * columns[key]
            law = power_law(stress, value)
            text = f"{label}: {law}" if np.isfinite(law.exponent) else label
            style = {"marker": marker, "mfc": "none", "ls": "none", "color": "k", "ms": size}
            panel.line(stress / 1e3, value, text, **style)
    return Picture([left, right], columns=2)
