"""Figures 14 and 15, and the structure factor: dispersion, and its width."""

from __future__ import annotations

import numpy as np

from analysis.estimators import damped_transform as disp
from analysis.estimators.fk import fk_map
from analysis.figures.picture import Panel, Picture, each
from analysis.figures.waves import producer_name
from analysis.measuring import Measuring
from analysis.quantities.passband import band_edge, low_pass_2, passband, scale, wavelength_at
from analysis.quantities.scattering import whole_ridge
from analysis.quantities.spectrum import standing_waves
from analysis.quantities.velocity import coherent, longest
from modal.theory.fcc import dispersion as eq_9
from modal.tools.errors import InputError
from modal.waves.signals import Signals


@each
def dispersion(m: Measuring) -> Panel:
    """Figs. 14 and 15: f-k amplitude with theory, resonances, and the unbiased estimates."""
    record, speed = m.shown, longest(m, "linear").value
    title = f"{m.label}, {producer_name(record.producer)}"
    if not m.crystal:  # the means of layers; a chain's scatter hides the ridge
        if record.layer_displacement is None:
            record, title = m.linear, f"{m.label}, {producer_name(m.linear.producer)}"
        record, title = _of_layers(record), f"{title}, layers"
    f, k, amplitude = fk_map(record)
    top = 1.1 * band_edge(m, "linear") if m.crystal else 2.2 * scale(m)
    widest = np.pi / disp.layer_distance(record)
    widest = widest if m.crystal else min(widest, 2.5 * np.pi * top / longest(m, "linear").value)
    rows, columns = np.flatnonzero(f < top), np.flatnonzero(k < widest)
    rows, columns = (v[:: max(1, len(v) // 110)] for v in (rows, columns))
    shade = amplitude[np.ix_(rows, columns)]
    sent = np.exp(-2j * np.pi * f[rows, None] * record.time) @ record.source_displacement
    shade = shade / abs(sent)[:, None]  # over the source: what is left of each frequency
    shade = 20 * np.log10(np.maximum(shade / shade.max(), 1e-3))
    panel = Panel(
        r"wave number $\kappa$ (rad/m)", "frequency (kHz)", title, legend="lower right",
        colour_label="amplitude over the source's (dB)", xlim=(0, float(widest)),
        ylim=(0, top / 1e3),
    )  # fmt: skip
    panel.map(k[columns], f[rows] / 1e3, shade, cmap="gray_r", vmin=-50, vmax=0)
    kappa = kappa_line = np.linspace(0, widest, 101)
    if m.crystal:
        lattice = m.lattice
        theory = eq_9(kappa, lattice.stiffness, lattice.mass, lattice.distance) / (2e3 * np.pi)
        panel.line_on_map(kappa, theory, "theory (Eq. 9)", 1.0, color="k")
        ridge = disp.chain_dispersion(record).omega(kappa[:98]) / (2e3 * np.pi)
        text = f"{producer_name(record.producer)}, damped transform"
        panel.line(kappa[:98], ridge, text, color="#c05000", ls="--", lw=2)
    else:
        wave = coherent(m, "linear")
        text = "coherent linear wave of the layers"
        kept = wave.frequency <= _leaves(m)
        kappa, f_c = wave.wavenumber[kept], wave.frequency[kept] / 1e3
        panel.line_on_map(kappa, f_c, text, 2, color="#c05000", ls="--")
        slope = kappa_line * speed / (2e3 * np.pi)
        panel.line(kappa_line, slope, "long waves", color="k", ls=":", lw=0.9)
        edge = passband(m).of_yade if m.yade else passband(m).low_pass
        producer = "yade" if m.yade else "linear"
        kappa_e = 2 * np.pi / wavelength_at(m, edge[0].value, producer)
        style = {"marker": "D", "ls": "none", "color": "#c05000", "ms": 6, "mfc": "w"}
        text = "$f_{low-pass}$ 2 %, one chain"
        panel.line([kappa_e], [edge[0].value / 1e3], text, **style)
    f_r, k_r = standing_waves(m)
    every = slice(None, None, max(1, len(f_r) // 20)) if m.crystal else slice(None)
    if len(f_r):
        text = "resonances" if m.crystal else "resonances: modes, then their ridge"
        style = {"marker": "o", "ls": "none", "mfc": "w", "color": "#0060a8", "ms": 4}
        panel.line(k_r[every], f_r[every] / 1e3, text, **style)
    return panel


def _leaves(m: Measuring) -> float:
    """Frequency, Hz, at which the coherent wave leaves the modes' ridge by 5 %; else infinity.

    Beyond it the layers' means hold no wave of one wave number.
    """
    f_r, kappa = standing_waves(m)
    if m.case.read("structure") is None or len(f_r) < 5:
        return np.inf
    wave = coherent(m, "linear")
    rising = np.maximum.accumulate(np.nan_to_num(f_r)) == f_r
    own = np.interp(wave.frequency, f_r[rising], kappa[rising], np.nan, np.nan)
    off = np.flatnonzero(
        (abs(wave.wavenumber / own - 1) > 0.05) & (wave.frequency > 0.3 * scale(m))
    )
    return float(wave.frequency[off[0]]) if len(off) else np.inf


def _of_layers(record: Signals) -> Signals:
    """The record with layers in place of the chain's particles, for the f-k map."""
    changed = Signals(**vars(record))
    changed.chain_position = record.layer_position
    changed.chain_displacement = record.layer_displacement
    return changed


def structure(cases: list[Measuring]) -> Picture:
    """Beyond the paper: the modes' spatial spectrum, its ridge, and the ridge's width."""
    panels = []
    for m in cases:
        found = m.case.read("structure")
        if found is None:
            continue
        peak = found.ridge()[0]
        f, top = found.frequency, 1.2 * np.nanmax(peak)
        rows = np.flatnonzero(f < top)
        rows = rows[:: max(1, len(rows) // 200)]
        shade = found.power[:, rows] / found.power[:, rows].max(axis=1, keepdims=True)
        grid = np.linspace(found.wavenumber[0], found.wavenumber[-1], 120)
        nearest = np.argmin(abs(found.wavenumber[:, None] - grid), axis=0)
        panel = Panel(
            r"wave number $\kappa_r = \pi r / L$ (rad/m)", "frequency (kHz)", m.label,
            colour_label="$S_r(f)$ over its maximum", ylim=(0, top / 1e3), legend="lower right",
        )  # fmt: skip
        panel.map(grid, f[rows] / 1e3, shade[nearest].T, cmap="gray_r")
        panel.line_on_map(
            found.wavenumber, peak / 1e3, "ridge", 1, marker="o", mfc="w", ms=3, color="#c05000"
        )
        line = found.wavenumber * longest(m, "linear").value / (2e3 * np.pi)
        panel.line_on_map(found.wavenumber, line, "long waves", 1, color="#0060a8", ls="--")
        narrow = Panel("frequency (kHz)", "full width (kHz)", m.label, xscale="log", yscale="log")
        text, style = "structure factor", {"marker": "o", "mfc": "w", "color": "k"}
        if whole_ridge(m) is not None:
            f_ridge, own, _ = whole_ridge(m).of_waves()
            narrow.line(f_ridge / 1e3, own / 1e3, text, **style)
            if len(own):  # a tenth of the resolution is no width any more
                narrow.ylim = (1e-4 * found.resolution, 3e-3 * float(own.max()))
        wave = coherent(m, "linear")
        rate = wave.attenuation * wave.group_velocity / np.pi
        seen = (rate > 0) & (wave.frequency > 0.1 * scale(m))
        text = "2 Im(q) $V_g$ / 2$\\pi$ of the coherent wave"
        narrow.line(wave.frequency[seen] / 1e3, rate[seen] / 1e3, text, color="#c05000", ls="--")
        narrow.add("vline", [low_pass_2(m) / 1e3], [0], None, "$f_{low-pass}$, 2 %", ls=":")
        narrow.add("hline", [0], [found.resolution / 2e3], None, "half a resolution", color="0.7")
        panels += [panel, narrow]
    if not panels:
        raise InputError("no case has a structure factor; keep one: measure FILE --keep DIR")
    return Picture(panels, columns=2, shape=(11, 0.4 + 3.6 * len(panels) / 2))
