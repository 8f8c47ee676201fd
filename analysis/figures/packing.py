"""Figures 1 and 2: what the packing looks like, and what the source wall does."""

from typing import Any

import numpy as np

from analysis.figures.picture import Panel, Picture
from analysis.figures.waves import DISTANCE
from analysis.measuring import Measuring
from modal.packing.state import contacts_per_particle, void_ratio
from modal.waves.source import Pulse


def samples(m: Measuring) -> Picture:
    """Fig. 1: spheres of a slab one diameter thick, by their number of contacts."""
    network, d = m.network, m.diameter
    off = abs(network.position[:, 1] % network.cell_size[1] - 0.5 * network.cell_size[1])
    near = np.argsort(off)
    chosen = near[off[near] < 0.5 * d]
    x = network.position[chosen, 0] % network.cell_size[0]
    z = network.position[chosen, 2] - network.wall_position[0]
    number = contacts_per_particle(network)
    known = np.isfinite(m.mu_comp) and not m.crystal
    title = m.label + (f", friction {m.mu_comp:g}" if known else "")
    title += f": void ratio {void_ratio(network):.3f}, {number.mean():.2f} contacts a sphere"
    panel = Panel(DISTANCE, "x (mm)", title, equal=True, colour_label="contacts")
    panel.xlim = (0, 1e3 * network.length)
    panel.ylim = (-500 * d, 1e3 * float(network.cell_size[0]) + 500 * d)
    low, high = (float(end) for end in (number[chosen].min(), number[chosen].max()))
    look: dict[str, Any] = {"cmap": "viridis", "clim": (low - (low == high), high)}
    panel.add("spheres", 1e3 * z, 1e3 * x, number[chosen], diameter=1e3 * d, **look)
    return Picture([panel], shape=(11, 2.0))


LINES = {1e5: "-", 2e5: "--"}
"""Of the study's pulses, by their frequency, Hz."""


def source(m: Measuring) -> Picture:
    """Fig. 2: displacement of the source wall, a pulse, and its spectrum."""
    left = Panel("time (µs)", "source wall $u$ (nm)", xlim=(0, 20))
    right = Panel("frequency (kHz)", "amplitude over its maximum", xlim=(0, 500))
    pulse = Pulse(m.linear.amplitude, m.linear.input_frequency)
    style, label = LINES.get(pulse.frequency, ":"), f"{pulse.frequency / 1e3:g} kHz"
    time, frequency = np.linspace(0, 2e-5, 401), np.linspace(0, 5e5, 501)
    fine = np.linspace(0, 1 / pulse.frequency, 2001)
    spectrum = abs(np.exp(-2j * np.pi * frequency[:, None] * fine) @ pulse.displacement(fine))
    left.line(1e6 * time, 1e9 * pulse.displacement(time), label, ls=style, color="k")
    right.line(frequency / 1e3, spectrum / spectrum.max(), label, ls=style, color="k")
    return Picture([left, right], columns=2)
