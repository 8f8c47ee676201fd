"""Beyond the paper: S-waves over time and distance, their dispersion beside P, and their gain."""

from __future__ import annotations

import numpy as np

from analysis.estimators.transfer import network_gain
from analysis.figures.picture import Panel, Picture
from analysis.figures.waves import motion, producer_name
from analysis.measuring import Measuring
from analysis.quantities.velocity import chain, coherent, longest
from modal.tools.arrays import Floats
from modal.tools.errors import InputError


def shear_waves(cases: list[Measuring]) -> Picture:
    """Beyond the paper: S-waves of a sliding wall: motion, dispersion beside P-waves, gain."""
    panels = []
    for m in cases:
        for key in (f"shear_{producer}" for producer in m.shear):
            panels += [_motion(m, key), _dispersion(m, key), _gain(m, key)]
    if not panels:
        raise InputError("no record of an S-wave; wave --direction x makes one")
    return Picture(panels, columns=3, shape=(13, 0.6 + 3.2 * (len(panels) // 3)))


def _title(m: Measuring, key: str) -> str:
    return f"{m.label}, {producer_name(key.removeprefix('shear_'))}"


def _motion(m: Measuring, key: str) -> Panel:
    """Displacement along the wall's motion over distance and time, and the line of V_S."""
    record = m.shear[key.removeprefix("shear_")]
    panel = motion(m, record, longest(m, key).value, "$V_S$", np.inf)
    panel.title, panel.ylim = _title(m, key), (0, float(panel.series[0].y[-1]))
    return panel


def dispersion(m: Measuring, key: str) -> tuple[Floats, Floats]:
    """Wave number (k,), rad/m, and frequency (k,), Hz, of a wave as far as it is seen."""
    if m.crystal:
        kappa = np.linspace(0.01, 0.97, 97) * np.pi / chain(m, key).distance
        return kappa, chain(m, key).omega(kappa) / (2 * np.pi)
    wave = coherent(m, key)
    seen = np.isfinite(wave.wavenumber)
    return wave.wavenumber[seen], wave.frequency[seen]


def _dispersion(m: Measuring, key: str) -> Panel:
    """Frequency over wave number of both waves, as far as each is coherent."""
    panel = Panel(
        r"wave number $\kappa$ (rad/m)", "frequency (kHz)", _title(m, key), legend="upper left"
    )
    kappa, f = dispersion(m, "linear")
    own, own_f = dispersion(m, key)
    # Both as far as the longer of the two goes in wave number, or the P-wave's by half of it more.
    near = kappa <= 1.5 * own.max(initial=0.0)
    panel.line(kappa[near], f[near] / 1e3, "P-wave, linear wave", color="0.6", lw=2)
    name = producer_name(key.removeprefix("shear_"))
    panel.line(own, own_f / 1e3, f"S-wave, {name}", color="k")
    straight = np.array([0.0, own.max(initial=0.0)])
    speed = longest(m, key).value / (2e3 * np.pi)
    panel.line(straight, straight * speed, "long-wave $V_S$", color="k", ls=":")
    return panel


def _gain(m: Measuring, key: str) -> Panel:
    """Shear stress on the receiver over that on the source wall, of the springs, over frequency."""
    direction = m.shear[key.removeprefix("shear_")].direction
    found = network_gain(m.network, m.network.length / longest(m, key).value, direction)
    panel = Panel(
        "frequency (kHz)", "shear stress, receiver over source",
        f"{m.label}, resolution {found.resolution:.0f} Hz", yscale="log",
    )  # fmt: skip
    panel.line(found.frequency / 1e3, found.gain, "S-wave, springs", color="k", lw=0.9)
    return panel
