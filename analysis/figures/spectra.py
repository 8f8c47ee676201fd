"""Figures 14, 15 and 19, and the structure factor: dispersion, its width, and the gain factor."""

from __future__ import annotations

import numpy as np

from analysis.estimators import damped_transform as disp
from analysis.estimators.fk import fk_map
from analysis.figures.picture import Panel, Picture
from analysis.figures.waves import producer_name
from analysis.measures import Measures
from modal.formats.hdf5 import InputError
from modal.theory.fcc import dispersion as eq_9
from modal.waves.signals import Signals


def dispersion(cases: list[Measures]) -> Picture:
    """Figs. 14 and 15: f-k amplitude with theory, resonances, and the unbiased estimates."""
    panels = []
    for m in cases:
        case, record = m.case, m.case.record
        if not case.is_crystal:  # the layers of the linear wave; a chain's scatter hides the ridge
            record = case.wave
            record = _of_layers(record)
        f, k, amplitude = fk_map(record)
        top = 1.1 * m.band_edge if case.is_crystal else 2.2 * m.band
        widest = np.pi / disp.layer_distance(record)
        widest = widest if case.is_crystal else min(widest, 2.5 * np.pi * top / m.long_wave.value)
        rows, columns = np.flatnonzero(f < top), np.flatnonzero(k < widest)
        rows, columns = (v[:: max(1, len(v) // 110)] for v in (rows, columns))
        shade = 20 * np.log10(np.maximum(amplitude[np.ix_(rows, columns)], 1e-3))
        panel = Panel(
            r"wave number $\kappa$ (rad/m)", "frequency (kHz)", case.label, legend="lower right",
            colour_label="f-k amplitude (dB)", xlim=(0, float(widest)), ylim=(0, top / 1e3),
        )  # fmt: skip
        panel.map(k[columns], f[rows] / 1e3, shade, cmap="gray_r", alpha=0.6)
        kappa = np.linspace(0, widest, 101)
        if case.is_crystal:
            chain = case.lattice
            theory = eq_9(kappa, chain.stiffness, chain.mass, chain.distance) / (2e3 * np.pi)
            panel.line(kappa, theory, "theory (Eq. 9)", color="k")
            ridge = disp.chain_dispersion(record).omega(kappa[:98]) / (2e3 * np.pi)
            text = f"{producer_name(record)}, damped transform"
            panel.line(kappa[:98], ridge, text, color="#c05000", ls="--", lw=2)
        else:
            wave = m.coherent
            text = "coherent wave of the layers"
            panel.line(wave.wavenumber, wave.frequency / 1e3, text, color="#c05000", ls="--", lw=2)
        f_r, k_r = m.resonances
        every = slice(None, None, max(1, len(f_r) // 20)) if case.is_crystal else slice(None)
        if len(f_r):
            text = "resonances" if case.is_crystal else "modes (structure factor)"
            style = {"marker": "o", "ls": "none", "mfc": "w", "color": "#0060a8", "ms": 4}
            panel.line(k_r[every], f_r[every] / 1e3, text, **style)
        panels.append(panel)
    return Picture(panels, columns=2 if len(panels) > 1 else 1)


def _of_layers(record: Signals) -> Signals:
    """The record with layers in place of the chain's particles, for the f-k map."""
    changed = Signals(**vars(record))
    changed.chain_position = record.layer_position
    changed.chain_displacement = record.layer_displacement
    return changed


def structure(cases: list[Measures]) -> Picture:
    """Beyond the paper: the modes' spatial spectrum, its ridge, and the ridge's width."""
    panels = []
    for m in cases:
        found = m.case.structure
        if found is None:
            continue
        peak, width = found.ridge()
        f, top = found.frequency, 1.2 * np.nanmax(peak)
        rows = np.flatnonzero(f < top)
        rows = rows[:: max(1, len(rows) // 200)]
        shade = found.power[:, rows] / found.power[:, rows].max(axis=1, keepdims=True)
        grid = np.linspace(found.wavenumber[0], found.wavenumber[-1], 120)
        nearest = np.argmin(abs(found.wavenumber[:, None] - grid), axis=0)
        panel = Panel(
            r"wave number $\kappa_r = \pi r / L$ (rad/m)", "frequency (kHz)", m.case.label,
            colour_label="$S_r(f)$ over its maximum", ylim=(0, top / 1e3), legend="lower right",
        )  # fmt: skip
        panel.map(grid, f[rows] / 1e3, shade[nearest].T, cmap="gray_r")
        panel.line(
            found.wavenumber, peak / 1e3, "ridge", marker="o", mfc="w", ms=3, color="#c05000"
        )
        line = found.wavenumber * m.long_wave.value / (2e3 * np.pi)
        panel.line(found.wavenumber, line, "long waves", color="#0060a8", ls="--")
        narrow = Panel(
            "frequency (kHz)", "full width (kHz)", m.case.label, xscale="log", yscale="log"
        )
        seen = width > found.resolution / 2
        narrow.line(
            peak[seen] / 1e3, width[seen] / 1e3, "structure factor", marker="o", mfc="w", color="k"
        )
        wave = m.coherent
        rate = wave.attenuation * wave.group_velocity / np.pi
        seen = (rate > 0) & (wave.frequency > 0.1 * m.band)
        text = "2 Im(q) $V_g$ / 2$\\pi$ of the coherent wave"
        narrow.line(wave.frequency[seen] / 1e3, rate[seen] / 1e3, text, color="#c05000", ls="--")
        narrow.add("vline", [m.low_pass[0].value / 1e3], [0], None, "$f_{low-pass}$, 2 %", ls=":")
        narrow.add("hline", [0], [found.resolution / 2e3], None, "half a resolution", color="0.7")
        panels += [panel, narrow]
    if not panels:
        raise InputError("no case has a structure factor; run python -m analysis prepare CASE")
    return Picture(panels, columns=2, shape=(11, 0.4 + 3.6 * len(panels) / 2))


def gain(cases: list[Measures]) -> Picture:
    """Fig. 19: gain factor (receiver over source stress) of the springs, and the resonances.

    Between rigid walls the stress ratio of a rod is 1 / |cos kappa L|: its maxima lie midway
    between the resonances sin kappa L = 0, not on them.
    """
    panels = []
    for m in cases:
        found = m.gain
        top = 12 * m.long_wave.value / (2 * m.case.network.length)
        title = f"{m.case.label}, resolution {found.resolution:.0f} Hz"
        panel = Panel("frequency (kHz)", "gain factor", title, legend="upper right")
        panel.xlim = (0, top / 1e3)
        keep = found.frequency < top
        panel.ylim = (0, 1.25 * float(found.gain[keep].max()))
        panel.line(found.frequency[keep] / 1e3, found.gain[keep], "gain", color="k")
        f_r, _ = m.resonances
        f_r = f_r[f_r < top]
        if len(f_r):
            style = {"color": "#0060a8", "ls": ":", "lw": 1}
            panel.add("vline", f_r / 1e3, 0 * f_r, None, "resonances", **style)
        panels.append(panel)
    return Picture(panels, columns=2 if len(panels) > 1 else 1)
