"""Figures 11, 14 and 15: velocities and dispersion."""

from dataclasses import replace

import numpy as np

from analysis.estimators import damped_transform as disp
from analysis.estimators.wavenumber import frequency_wavenumber
from analysis.figures.picture import BLUE, ORANGE, Panel
from analysis.figures.waves import producer_name
from analysis.packing_data import PackingData
from analysis.quantities.passband import Producer, band_edge, edges, scale, wavelength_at
from analysis.quantities.spectrum import standing_waves
from analysis.quantities.velocity import LOW_ORDER, coherent, first_peak, longest
from modal.theory.fcc import dispersion as eq_9
from modal.waves.signals import Signals

KHZ = 2e3 * np.pi
"""rad/s."""


def velocity_frequency(m: PackingData) -> Panel:
    """Fig. 11: phase and group velocity of the linear wave (layers) and of modes; dL/dt."""
    top, speed = 0.9 * scale(m), longest(m, "linear").value
    low = LOW_ORDER * speed / (2 * m.network.length)
    panel = Panel("frequency (kHz)", "velocity (m/s)", m.label, legend="lower left")
    panel.ylim = ((0.5 if m.crystal else 0.75) * speed, 1.12 * speed)
    panel.xlim = (0, top / 1e3)
    wave = coherent(m, "linear")
    # At the lowest frequencies a derivative by differences is a ratio of small numbers.
    for values, text, first, ls in (
        (wave.phase_velocity, "phase, layers", 0.2, "-"),
        (wave.group_velocity, "group, layers", 0.7, ":"),
    ):
        keep = (wave.frequency > first * low) & (wave.frequency < top)
        panel.line(wave.frequency[keep] / 1e3, values[keep], text, color="k", ls=ls)
    f_r, kappa = standing_waves(m)
    keep = f_r < top
    if keep.sum() > 2:
        every = slice(None, None, max(1, keep.sum() // 25))
        style = {"ls": "none", "mfc": "none", "color": BLUE, "ms": 5}
        omega, kappa = 2 * np.pi * f_r[keep], kappa[keep]
        for values, text, marker in (
            (omega / kappa, "phase, modes (Eq. 4)", "o"),
            (np.gradient(omega, kappa), "group, modes (Eq. 4)", "v"),
        ):
            panel.line(f_r[keep][every] / 1e3, values[every], text, marker=marker, **style)
    panel.hline(first_peak(m, "linear").value, "dL/dt, first peaks", color=ORANGE, ls="--")
    return panel


def dispersion(m: PackingData) -> Panel:
    """Figs. 14 and 15: f-k amplitude with theory, resonances, and the unbiased estimates."""
    record, top = m.shown, 1.1 * band_edge(m, "linear") if m.crystal else 2.2 * scale(m)
    if not m.crystal:  # the means of layers; a chain's scatter hides the ridge
        record = record if record.layer_displacement is not None else m.linear
        z, u = record.layer_position, record.layer_displacement
        record = replace(record, chain_position=z, chain_displacement=u)
    title = f"{m.label}, {producer_name(record.producer)}{'' if m.crystal else ', layers'}"
    place = record.chain_position
    f, k, spectrum = frequency_wavenumber(record.chain_displacement, record.time, place)
    widest = float(np.pi / disp.layer_distance(record))
    if not m.crystal:
        widest = float(min(widest, 2.5 * np.pi * top / longest(m, "linear").value))
    rows = np.flatnonzero(f < min(top, 4 * record.input_frequency))
    columns = np.flatnonzero((k >= 0) & (k < widest))
    rows, columns = (v[:: max(1, len(v) // 110)] for v in (rows, columns))
    shade = abs(spectrum[np.ix_(rows, columns)])
    sent = np.exp(-2j * np.pi * f[rows, None] * record.time) @ record.source_displacement
    shade = shade / abs(sent)[:, None]  # over the source: what is left of each frequency
    shade = 20 * np.log10(np.maximum(shade / shade.max(), 1e-3))
    panel = Panel(r"wave number $\kappa$ (rad/m)", "frequency (kHz)", title, legend="lower right")
    panel.colour_label = "amplitude over the source's (dB)"
    panel.xlim, panel.ylim = (0, widest), (0, top / 1e3)
    panel.add("map", k[columns], f[rows] / 1e3, shade, cmap="gray_r", vmin=-50, vmax=0)
    (_of_crystal if m.crystal else _of_random)(panel, m, record, np.linspace(0, widest, 101))
    f_r, k_r = standing_waves(m)
    every = slice(None, None, max(1, len(f_r) // 20)) if m.crystal else slice(None)
    if len(f_r):
        text = "resonances" if m.crystal else "resonances: modes, then their ridge"
        style = {"marker": "o", "ls": "none", "mfc": "w", "color": BLUE, "ms": 4}
        panel.line(k_r[every], f_r[every] / 1e3, text, **style)
    return panel


def _of_crystal(panel: Panel, m: PackingData, record: Signals, kappa: np.ndarray) -> None:
    """Theory, and what the damped transform reads of the record, at wave numbers (k,), rad/m."""
    theory = eq_9(kappa, m.lattice.stiffness, m.lattice.mass, m.lattice.distance) / KHZ
    panel.line_on_map(kappa, theory, "theory (Eq. 9)", 1.0, color="k")
    ridge = disp.chain_dispersion(record).omega(kappa[:98]) / KHZ
    text = f"{producer_name(record.producer)}, damped transform"
    panel.line(kappa[:98], ridge, text, color=ORANGE, ls="--", lw=2)


def _of_random(panel: Panel, m: PackingData, record: Signals, kappa: np.ndarray) -> None:
    """The coherent wave, that of long waves, and f_low-pass."""
    wave = coherent(m, "linear")
    kept = wave.frequency <= _leaves(m)
    at, text = wave.wavenumber[kept], "coherent linear wave of the layers"
    panel.line_on_map(at, wave.frequency[kept] / 1e3, text, 2, color=ORANGE, ls="--")
    slope = kappa * longest(m, "linear").value / KHZ
    panel.line(kappa, slope, "long waves", color="k", ls=":", lw=0.9)
    producer: Producer = "yade" if m.yade else "linear"
    edge = edges(m, producer)[0].value
    style = {"marker": "D", "ls": "none", "color": ORANGE, "ms": 6, "mfc": "w"}
    at_edge = [2 * np.pi / wavelength_at(m, edge, producer)]
    panel.line(at_edge, [edge / 1e3], "$f_{low-pass}$ 2 %, one chain", **style)


def _leaves(m: PackingData) -> float:
    """Frequency, Hz, at which the coherent wave leaves the modes' ridge by 5 %; else infinity.

    Beyond it the layers' means hold no wave of one wave number.
    """
    f_r, kappa = standing_waves(m)
    if m.case.read("structure") is None or len(f_r) < 5:
        return np.inf
    wave = coherent(m, "linear")
    rising = np.maximum.accumulate(np.nan_to_num(f_r)) == f_r
    own = np.interp(wave.frequency, f_r[rising], kappa[rising], np.nan, np.nan)
    off = (abs(wave.wavenumber / own - 1) > 0.05) & (wave.frequency > 0.3 * scale(m))
    return float(wave.frequency[np.argmax(off)]) if off.any() else np.inf
