"""Draw figures 11, 14 and 15: velocities and dispersion."""

from dataclasses import replace
from typing import Any

import numpy as np

from analysis.estimators import damped_transform as disp
from analysis.estimators.wavenumber import frequency_wavenumber
from analysis.figures.picture import BLUE, ORANGE, Panel, Style
from analysis.figures.waves import producer_name
from analysis.packing_data import PackingData
from analysis.quantities.passband import Producer, band_edge, edges, scale, wavelength_at
from analysis.quantities.spectrum import standing_waves
from analysis.quantities.velocity import LOW_ORDER, coherent, first_peak, longest
from modal.theory.fcc import dispersion as eq_9
from modal.tools.arrays import Floats, Ints
from modal.waves.signals import Signals

RAD_PER_S_PER_KHZ = 2e3 * np.pi
"""Angular frequency, rad/s, of 1 kHz."""
MAX_MODE_POINTS = 25
"""Approximate number of modes whose velocities are drawn."""
MAX_RESONANCE_POINTS = 20
"""Approximate number of resonances that are drawn over the dispersion of a crystal."""
POINTS_PER_SIDE = 110
"""Approximate number of points on a side of the map."""
MIN_SHADE_RATIO = 1e-3
"""Smallest amplitude of the map, relative to the largest: -60 dB, of which 50 are shown."""
WAVENUMBERS = 101
"""Number of wave numbers of a curve."""
RIDGE_WAVENUMBERS = 98
"""Number of wave numbers of the damped transform, which ends just below the band edge."""
MIN_RIDGE_MODES = 5
"""Smallest number of standing waves that the coherent wave is compared with."""
MAX_RIDGE_DEVIATION = 0.05
"""Largest relative difference of wave numbers at which the coherent wave follows the ridge."""
FIRST_COMPARED_FREQUENCY = 0.3
"""Frequency above which both are compared, relative to `scale`; few waves fit in below."""


def velocity_frequency(m: PackingData) -> Panel:
    """Draw Fig. 11: phase and group velocity of the linear wave and of modes, and first peaks."""
    top = 0.9 * scale(m)
    speed = longest(m, "linear").value
    lowest_resonance = LOW_ORDER * speed / (2 * m.network.length)
    panel = Panel("frequency (kHz)", "velocity (m/s)", m.label, legend="lower left")
    panel.ylim = ((0.5 if m.crystal else 0.75) * speed, 1.12 * speed)
    panel.xlim = (0, top / 1e3)
    wave = coherent(m, "linear")
    # At the lowest frequencies a derivative by differences is a ratio of small numbers.
    for velocity, label, first, ls in (
        (wave.phase_velocity, "phase, layers", 0.2, "-"),
        (wave.group_velocity, "group, layers", 0.7, ":"),
    ):
        shown = (wave.frequency > first * lowest_resonance) & (wave.frequency < top)
        panel.line(wave.frequency[shown] / 1e3, velocity[shown], label, color="k", ls=ls)
    frequency, kappa = standing_waves(m)
    shown = frequency < top
    if shown.sum() > 2:
        _draw_mode_velocities(panel, frequency[shown], kappa[shown])
    panel.hline(first_peak(m, "linear").value, "dL/dt, first peaks", color=ORANGE, ls="--")
    return panel


def _draw_mode_velocities(panel: Panel, frequency: Floats, kappa: Floats) -> None:
    """Draw the velocities of modes with frequencies (n,), Hz, and wave numbers (n,), 1/m."""
    thin = slice(None, None, max(1, len(frequency) // MAX_MODE_POINTS))
    style: dict[str, Any] = {"ls": "none", "mfc": "none", "color": BLUE, "ms": 5}
    omega = 2 * np.pi * frequency
    for velocity, label, marker in (
        (omega / kappa, "phase, modes (Eq. 4)", "o"),
        (np.gradient(omega, kappa), "group, modes (Eq. 4)", "v"),
    ):
        panel.line(frequency[thin] / 1e3, velocity[thin], label, marker=marker, **style)


def dispersion(m: PackingData) -> Panel:
    """Draw Figs. 14 and 15: f-k amplitude with theory, resonances, and the unbiased estimates."""
    if m.crystal:
        record = m.shown
        layers = ""
        top = 1.1 * band_edge(m, "linear")
    else:
        record = _layers_as_chain(m)
        layers = ", layers"
        top = 2.2 * scale(m)
    widest = float(np.pi / disp.layer_distance(record))
    if not m.crystal:
        widest = float(min(widest, 2.5 * np.pi * top / longest(m, "linear").value))
    title = f"{m.label}, {producer_name(record.producer)}{layers}"
    panel = Panel(r"wave number $\kappa$ (rad/m)", "frequency (kHz)", title, legend="lower right")
    panel.colour_label = "amplitude over the source's (dB)"
    panel.xlim = (0, widest)
    panel.ylim = (0, top / 1e3)
    _draw_map(panel, record, top, widest)
    kappa = np.linspace(0, widest, WAVENUMBERS)
    if m.crystal:
        _draw_dispersion_of_crystal(panel, m, record, kappa)
    else:
        _draw_dispersion_of_random(panel, m, kappa)
    frequency, kappa_of_resonances = standing_waves(m)
    if len(frequency):
        thin = slice(None)
        label = "resonances: modes, then their ridge"
        if m.crystal:
            thin = slice(None, None, max(1, len(frequency) // MAX_RESONANCE_POINTS))
            label = "resonances"
        style: Style = {"marker": "o", "ls": "none", "mfc": "w", "color": BLUE, "ms": 4}
        panel.line(kappa_of_resonances[thin], frequency[thin] / 1e3, label, **style)
    return panel


def _layers_as_chain(m: PackingData) -> Signals:
    """Return the record with means of layers as chain: scatter of a chain hides the ridge."""
    record = m.shown
    if record.layer_displacement is None:
        record = m.linear
    return replace(
        record,
        chain_position=record.layer_position,
        chain_displacement=record.layer_displacement,
    )


def _draw_map(panel: Panel, record: Signals, top: float, widest: float) -> None:
    """Draw amplitudes up to a frequency `top`, Hz, and a wave number `widest`, 1/m.

    Each frequency is divided by the spectrum of the source, so that the map shows the transmitted
    share.
    """
    frequency, kappa, spectrum = frequency_wavenumber(
        record.chain_displacement, record.time, record.chain_position
    )
    rows = _thin(np.flatnonzero(frequency < min(top, 4 * record.input_frequency)))
    columns = _thin(np.flatnonzero((kappa >= 0) & (kappa < widest)))
    amplitude = abs(spectrum[np.ix_(rows, columns)])
    kernel = np.exp(-2j * np.pi * frequency[rows, None] * record.time)
    amplitude = amplitude / abs(kernel @ record.source_displacement)[:, None]
    shade = 20 * np.log10(np.maximum(amplitude / amplitude.max(), MIN_SHADE_RATIO))
    panel.add("map", kappa[columns], frequency[rows] / 1e3, shade, cmap="gray_r", vmin=-50, vmax=0)


def _thin(index: Ints) -> Ints:
    """Return about `POINTS_PER_SIDE` of the indices (n,)."""
    return index[:: max(1, len(index) // POINTS_PER_SIDE)]


def _draw_dispersion_of_crystal(
    panel: Panel, m: PackingData, record: Signals, kappa: Floats
) -> None:
    """Draw theory and the damped transform of the record at wave numbers (k,), rad/m."""
    theory = eq_9(kappa, m.lattice.stiffness, m.lattice.mass, m.lattice.distance)
    panel.line_on_map(kappa, theory / RAD_PER_S_PER_KHZ, "theory (Eq. 9)", lw=1.0, color="k")
    kappa = kappa[:RIDGE_WAVENUMBERS]
    ridge = disp.chain_dispersion(record).omega(kappa)
    label = f"{producer_name(record.producer)}, damped transform"
    panel.line(kappa, ridge / RAD_PER_S_PER_KHZ, label, color=ORANGE, ls="--", lw=2)


def _draw_dispersion_of_random(panel: Panel, m: PackingData, kappa: Floats) -> None:
    """Draw the coherent wave, long waves at wave numbers (k,), rad/m, and f_low-pass."""
    wave = coherent(m, "linear")
    shown = wave.frequency <= _end_of_ridge(m)
    label = "coherent linear wave of the layers"
    style: Style = {"lw": 2, "color": ORANGE, "ls": "--"}
    panel.line_on_map(wave.wavenumber[shown], wave.frequency[shown] / 1e3, label, **style)
    slope = kappa * longest(m, "linear").value / RAD_PER_S_PER_KHZ
    panel.line(kappa, slope, "long waves", color="k", ls=":", lw=0.9)
    producer: Producer = "yade" if m.yade else "linear"
    edge = edges(m, producer)[0].value
    kappa_of_edge = 2 * np.pi / wavelength_at(m, edge, producer)
    look: Style = {"marker": "D", "ls": "none", "color": ORANGE, "ms": 6, "mfc": "w"}
    panel.line([kappa_of_edge], [edge / 1e3], "$f_{low-pass}$ 2 %, one chain", **look)


def _end_of_ridge(m: PackingData) -> float:
    """Return the frequency, Hz, at which the coherent wave leaves the modes' ridge, else infinity.

    Beyond it the means of layers have no wave with a single wave number.
    """
    frequency, kappa = standing_waves(m)
    if m.case.read("structure") is None or len(frequency) < MIN_RIDGE_MODES:
        return np.inf
    wave = coherent(m, "linear")
    rising = np.maximum.accumulate(np.nan_to_num(frequency)) == frequency
    ridge = np.interp(wave.frequency, frequency[rising], kappa[rising], np.nan, np.nan)
    off_ridge = abs(wave.wavenumber / ridge - 1) > MAX_RIDGE_DEVIATION
    off_ridge &= wave.frequency > FIRST_COMPARED_FREQUENCY * scale(m)
    if not off_ridge.any():
        return np.inf
    return float(wave.frequency[np.argmax(off_ridge)])
