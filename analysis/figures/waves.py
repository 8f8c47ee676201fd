"""Figures 3 to 5, 12, 13: signals over time and distance, and their spectra over distance."""

from __future__ import annotations

import numpy as np

from analysis.case import Case
from analysis.estimators.layer_lattice import exact_twin
from analysis.figures.picture import Panel, Picture
from analysis.measures import Measures
from modal.waves.signals import Signals

POINTS = 130
"""About as many points on a side of a map, and twice as many of a curve."""


def _thin(count: int) -> slice:
    return slice(None, None, max(1, count // POINTS))


def producer_name(record: Signals) -> str:
    """How a legend calls what made a record."""
    known = {"yade": "YADE", "linear": "linear wave (no YADE run)"}
    return known.get(record.producer, record.producer)


def _signal(case: Case, wanted: float) -> Panel:
    """The chain particle nearest to `wanted` diameters: the record, and theory or linear wave."""
    record = case.record
    depth = (record.chain_position - case.network.wall_position[0]) / case.diameter
    n = int(np.argmin(abs(depth - wanted)))
    title = (
        f"{case.short}{case.under_stress}, {depth[n]:.0f} D from source, "
        f"pulse {record.input_frequency / 1e3:g} kHz"
    )
    u = 1e9 * record.chain_displacement[:, n]
    panel = Panel("time (ms)", "$u_z$ (nm)", title, legend="upper right")
    panel.ylim = (1.15 * float(u.min()), 1.5 * float(u.max()))  # the legend stands above the wave
    _curve(panel, record, n, record.time[-1], producer_name(record), color="0.6", lw=2.2)
    thin = {"color": "k", "ls": "--", "lw": 0.9}
    if case.is_crystal:
        twin = exact_twin(record, case.lattice)
        _curve(panel, twin, n, record.time[-1], "exact chain", **thin)
    elif record is not case.wave:
        m = int(np.flatnonzero(case.wave.chain_particle == record.chain_particle[n])[0])
        _curve(panel, case.wave, m, record.time[-1], "linear wave", **thin)
    return panel


def _curve(panel: Panel, record: Signals, n: int, end: float, label: str, **style) -> None:
    """Displacement of the chain's n-th particle up to `end` (s)."""
    inside = np.flatnonzero(record.time <= end * (1 + 1e-9))
    keep = inside[_thin(len(inside) // 2)]
    u = record.chain_displacement[keep, n]
    panel.line(1e3 * record.time[keep], 1e9 * u, label, **style)


def signals(cases: list[Measures]) -> Picture:
    """Fig. 3: displacement of particles of the chain at 10, 50 and 100 D from the source wall."""
    panels = [_signal(m.case, wanted) for m in cases for wanted in (10, 50, 100)]
    return Picture(panels, columns=3, shape=(11, 0.6 + 2.2 * len(cases)))


def signals_stress(cases: list[Measures]) -> Picture:
    """Fig. 4: displacement at 50 D from the source wall; each panel names its pulse's frequency."""
    ordered = sorted(cases, key=lambda m: (not m.case.is_crystal, m.case.stress))
    panels = [_signal(m.case, 50) for m in ordered]
    return Picture(panels, shape=(5.5, 0.5 + 1.9 * len(panels)))


def space_time(cases: list[Measures]) -> Picture:
    """Fig. 5: displacement over distance and time, and the line of the long-wave velocity."""
    panels = []
    for measured in cases:
        record, case = measured.case.record, measured.case
        z = 1e3 * (record.chain_position - case.network.wall_position[0])
        step, every = _thin(len(record.time)), _thin(2 * len(z))
        order = np.argsort(z)[every]  # a chain may step back
        u = 1e9 * record.chain_displacement[step][:, order]
        top = float(f"{np.percentile(abs(u), 99.9):.3g}")
        panel = Panel(
            "distance from the source wall (mm)", "time (ms)", title=case.label,
            colour_label="$u_z$ (nm)", legend="upper left",
        )  # fmt: skip
        panel.map(z[order], 1e3 * record.time[step], u, cmap="gray_r", vmin=-top, vmax=top)
        line = z / measured.long_wave.value
        seen = line < 1e3 * record.time[-1]
        panel.line(z[seen], line[seen], "long-wave $V_P$", color="k", ls="--")
        panels.append(panel)
    return Picture(panels, columns=2 if len(panels) > 1 else 1)


def spectrum_distance(cases: list[Measures]) -> Picture:
    """Figs. 12 and 13: spectral amplitude over distance (layer means), thresholds and plateau."""
    panels = []
    for measured in cases:
        case = measured.case
        distance, found = measured.passband.layers
        wave = case.wave
        u = wave.chain_displacement if case.is_crystal else wave.layer_displacement
        top = (
            0.55 * measured.passband.highest
            if not case.is_crystal
            else 0.8 * measured.passband.highest
        )
        frequency = np.linspace(0, top, 150)
        amplitude = abs(np.exp(-2j * np.pi * frequency[:, None] * wave.time) @ u)
        shade = 20 * np.log10(np.maximum(amplitude / amplitude.max(), 1e-3))
        every = _thin(2 * len(distance))
        panel = Panel(
            "distance from the source wall (mm)", "frequency (kHz)", title=case.label,
            colour_label="amplitude (dB)", ylim=(0, top / 1e3),
            legend="lower left" if case.is_crystal else "upper right",
        )  # fmt: skip
        panel.map(1e3 * distance[every], frequency / 1e3, shade[:, every], cmap="gray_r")
        for row, plateau, text, style in zip(
            found[:2], measured.low_pass[:2], ("2 %", "1 %"), ("-", ":"), strict=True
        ):
            panel.line(1e3 * distance, row / 1e3, f"{text} threshold", color="#c05000", ls=style)
            ends = 1e3 * np.array([plateau.start, plateau.end])
            panel.line(
                ends, [plateau.value / 1e3] * 2, f"plateau {text}", color="#0060a8", ls=style, lw=3
            )
        panels.append(panel)
    return Picture(panels, columns=2 if len(panels) > 1 else 1)


def low_pass_chains(cases: list[Measures]) -> Picture:
    """Beyond the paper: f_low-pass (2 %) of every particle against that of the layers."""
    panels = []
    for measured in cases:
        case = measured.case
        distance, found = measured.passband.particles
        edges = np.linspace(0, case.network.length, 41)
        middle = 0.5e3 * (edges[1:] + edges[:-1])
        with np.errstate(all="ignore"):
            slabs = zip(edges[:-1], edges[1:], strict=True)
            groups = [found[0][(distance >= a) & (distance < b)] for a, b in slabs]
            groups = [g[np.isfinite(g)] for g in groups]
            low, mid, high = np.array(
                [np.percentile(g, (16, 50, 84)) if len(g) > 2 else [np.nan] * 3 for g in groups]
            ).T
        panel = Panel("distance from the source wall (mm)", "$f_{low-pass}$ (kHz)", case.label)
        panel.add("band", middle, low / 1e3, high / 1e3, "particles, 16-84 %", color="0.8")
        panel.line(middle, mid / 1e3, "particles, median", color="k", ls="--")
        z, layers = measured.passband.layers
        panel.line(1e3 * z, layers[0] / 1e3, "layer means", color="#c05000")
        panels.append(panel)
    return Picture(panels, columns=2 if len(panels) > 1 else 1)
