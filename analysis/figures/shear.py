"""Beyond the paper: S-waves over time and distance, their dispersion beside P, and their gain."""

from __future__ import annotations

import numpy as np

from analysis.estimators.damped_transform import chain_dispersion
from analysis.figures.picture import Panel, Picture
from analysis.figures.waves import POINTS
from analysis.measures import Measures
from analysis.measures.shear_wave import ShearWave
from modal.tools.errors import InputError


def shear_waves(cases: list[Measures]) -> Picture:
    """Beyond the paper: S-waves of a sliding wall: motion, dispersion beside P-waves, gain."""
    panels = []
    for m in cases:
        for wave in m.shear:
            panels += [_motion(m, wave), _dispersion(m, wave), _gain(m, wave)]
    if not panels:
        raise InputError("no record of an S-wave; wave --direction x makes one")
    return Picture(panels, columns=3, shape=(13, 0.6 + 3.2 * (len(panels) // 3)))


def _title(m: Measures, wave: ShearWave) -> str:
    return f"{m.case.label}, {wave.producer}"


def _motion(m: Measures, wave: ShearWave) -> Panel:
    """Displacement along the wall's motion over distance and time, and the line of V_S."""
    record, case = wave.record, m.case
    order = np.argsort(record.chain_position)[:: max(1, len(record.chain_position) // POINTS)]
    step = slice(None, None, max(1, len(record.time) // POINTS))
    z = 1e3 * (record.chain_position[order] - case.network.wall_position[0])
    time, u = 1e3 * record.time[step], 1e9 * record.chain_displacement[step][:, order]
    top = float(f"{np.percentile(abs(u), 99.9):.3g}") or 1.0
    panel = Panel(
        "distance from the source wall (mm)", "time (ms)", _title(m, wave),
        colour_label=f"$u_{record.direction}$ (nm)", legend="upper left",
        xlim=(float(z.min()), float(z.max())), ylim=(0, float(time[-1])),
    )  # fmt: skip
    panel.map(z, time, u, cmap="gray_r", vmin=-top, vmax=top)
    line = z / wave.long_wave.value
    seen = line < time[-1]
    panel.line(z[seen], line[seen], "long-wave $V_S$", color="k", ls="--")
    return panel


def _dispersion(m: Measures, wave: ShearWave) -> Panel:
    """Frequency over wave number of both waves, as far as each is coherent."""
    panel = Panel(
        r"wave number $\kappa$ (rad/m)", "frequency (kHz)", _title(m, wave), legend="upper left"
    )
    if m.case.is_crystal:
        chain = chain_dispersion(m.case.wave)
        kappa = np.linspace(0.01, 0.97, 97) * np.pi / chain.distance
        f = chain.omega(kappa) / (2 * np.pi)
    else:
        seen = np.isfinite(m.coherent.wavenumber)
        kappa, f = m.coherent.wavenumber[seen], m.coherent.frequency[seen]
    own, own_f = wave.dispersion
    # Both as far as the longer of the two goes in wave number, or the P-wave's by half of it more.
    near = kappa <= 1.5 * own.max(initial=0.0)
    panel.line(kappa[near], f[near] / 1e3, "P-wave, linear wave", color="0.6", lw=2)
    panel.line(own, own_f / 1e3, f"S-wave, {wave.producer}", color="k")
    straight = np.array([0.0, own.max(initial=0.0)])
    speed = wave.long_wave.value / (2e3 * np.pi)
    panel.line(straight, straight * speed, "long-wave $V_S$", color="k", ls=":")
    return panel


def _gain(m: Measures, wave: ShearWave) -> Panel:
    """Gain factor of shear stresses over frequency."""
    found = wave.gain
    panel = Panel(
        "frequency (kHz)", "shear stress, receiver over source",
        f"{m.case.label}, resolution {found.resolution:.0f} Hz", yscale="log",
    )  # fmt: skip
    panel.line(found.frequency / 1e3, found.gain, "S-wave, springs", color="k", lw=0.9)
    return panel
