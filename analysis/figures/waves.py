"""Figures 1 to 5, 12, 13: packing, source; signals over time and distance, and their spectra."""

from typing import Any

import numpy as np

from analysis.estimators.layer_lattice import exact_twin
from analysis.estimators.low_pass import threshold_curves
from analysis.estimators.source_motion import cut
from analysis.figures.picture import BLUE, ORANGE, Panel, Picture
from analysis.packing_data import PackingData
from analysis.quantities.passband import edges, passband
from analysis.quantities.velocity import longest
from modal.packing.rattlers import firmly_held
from modal.packing.state import contacts_per_particle, void_ratio
from modal.waves.motions import Pulse
from modal.waves.signals import Signals

DISTANCE = "distance from the source wall (mm)"
POINTS = 130
"""About as many points on a side of a map, and twice as many of a curve."""
SHOWN = 1.3
"""Longest time that is drawn, in passages of the affine wave from wall to wall."""


def samples(m: PackingData) -> Picture:
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


def source(m: PackingData) -> Picture:
    """Fig. 2: displacement of the source wall, a pulse, and its spectrum."""
    left = Panel("time (µs)", "source wall $u$ (nm)", xlim=(0, 20))
    right = Panel("frequency (kHz)", "amplitude over its maximum", xlim=(0, 500))
    pulse = Pulse(m.motion.amplitude, m.motion.frequency)
    style, label = {1e5: "-", 2e5: "--"}.get(pulse.frequency, ":"), f"{pulse.frequency / 1e3:g} kHz"
    time, frequency = np.linspace(0, 2e-5, 401), np.linspace(0, 5e5, 501)
    fine = np.linspace(0, 1 / pulse.frequency, 2001)
    spectrum = abs(np.exp(-2j * np.pi * frequency[:, None] * fine) @ pulse.displacement(fine))
    left.line(1e6 * time, 1e9 * pulse.displacement(time), label, ls=style, color="k")
    right.line(frequency / 1e3, spectrum / spectrum.max(), label, ls=style, color="k")
    return Picture([left, right], columns=2)


def _thin(count: int) -> slice:
    return slice(None, None, max(1, count // POINTS))


def producer_name(producer: str) -> str:
    """How a legend calls what made a record."""
    return {"yade": "YADE", "linear": "linear wave"}.get(producer, producer)


def _nearest(m: PackingData, record: Signals, wanted: float) -> tuple[int, float]:
    """Place in the record's chain of the particle nearest to `wanted` diameters; its depth in D."""
    depth = (record.chain_position - m.network.wall_position[0]) / m.diameter
    n = int(np.argmin(abs(depth - wanted)))
    return n, float(depth[n])


def _end(m: PackingData, record: Signals) -> float:
    """Time, s, up to which motions are drawn: before the reflection comes back to 100 D."""
    return min(float(record.time[-1]), SHOWN * m.affine_passage)


def _signal(m: PackingData, wanted: float) -> Panel:
    """The chain particle nearest to `wanted` diameters: the record, and theory or linear wave."""
    record = m.shown
    n, depth = _nearest(m, record, wanted)
    title = f"{m.label}, {depth:.0f} D, pulse {record.input_frequency / 1e3:.3g} kHz"
    u = 1e9 * record.chain_displacement[:, n]
    panel = Panel("time (ms)", "$u_z$ (nm)", title)
    end = _end(m, record)
    # The legend stands above the wave.
    panel.xlim = (0, 1e3 * end)
    panel.ylim = (min(-0.4, 1.15 * float(u.min())), 1.5 * float(u.max()))
    _curve(panel, record, n, end, producer_name(record.producer), color="0.6", lw=2.2)
    thin = {"color": "k", "ls": "--", "lw": 0.9}
    if m.crystal:
        _curve(panel, exact_twin(record, m.lattice), n, end, "exact lattice", **thin)
    elif record is not m.linear:
        own = int(np.flatnonzero(m.linear.chain_particle == record.chain_particle[n])[0])
        _curve(panel, m.linear, own, end, "linear wave", **thin)
    return panel


def _curve(panel: Panel, record: Signals, n: int, end: float, label: str, **style) -> None:
    """Displacement of the chain's n-th particle up to `end` (s)."""
    record = cut(record, end)
    keep = _thin(len(record.time) // 2)
    panel.line(1e3 * record.time[keep], 1e9 * record.chain_displacement[keep, n], label, **style)


DISTANCES = np.array([10.0, 50.0, 100.0])
"""From the source wall, D, of the particles that are shown (Fig. 3)."""


def distances(m: PackingData) -> np.ndarray:
    """`DISTANCES`, D; of a sample that is too short for them, the same parts of the length."""
    length = m.network.length / m.diameter
    return DISTANCES * min(1.0, length / 140)


def signals(m: PackingData) -> Picture:
    """Fig. 3: displacement of particles of the chain at 10, 50 and 100 D from the source wall."""
    return Picture([_signal(m, wanted) for wanted in distances(m)], 3, (11, 2.8))


LOOKS = ("0.5", "-"), ("k", "-"), (BLUE, "--"), (ORANGE, ":")
"""Colour and line of a stress, by its power of ten."""


def signals_stress(m: PackingData) -> Picture:
    """Fig. 4: displacement at 50 D from the source wall, pulse 100 kHz; a panel a friction.

    Time is over that of long waves, by which the first arrivals of all stresses are at one place.
    """
    record = m.case.read("100kHz.signals") or m.shown
    n, depth = _nearest(m, record, distances(m)[1])
    group = "FCC" if m.crystal else rf"$\mu_{{comp}}$ = {m.mu_comp:g}"
    group += f", pulse {record.input_frequency / 1e3:.3g} kHz, {depth:.0f} D"
    axes = "time over that of long waves", "$u_z$ (nm)"
    panel = Panel(*axes, group, xlim=(0.8, 1.8), legend="upper right")
    passed = record.time / (depth * m.diameter / longest(m, "linear").value)
    seen = (passed > 0.8) & (passed < 1.8) & (record.time <= _end(m, record))
    u = 1e9 * record.chain_displacement[seen, n]
    text = f"{m.stress / 1e3:g} kPa, e {void_ratio(m.network):.3f}, "
    text += producer_name(record.producer)
    shade, ls = LOOKS[round(np.log10(m.stress)) % 4 if m.stress > 0 else 0]
    keep = _thin(int(seen.sum()) // 2)
    panel.line(passed[seen][keep], u[keep], text, color=shade, ls=ls)
    return Picture([panel], shape=(12, 3.6))


def space_time(m: PackingData) -> Panel:
    """Fig. 5: displacement over distance and time, and the line of the long-wave velocity."""
    record = cut(m.shown, _end(m, m.shown))
    z = 1e3 * (record.chain_position - m.network.wall_position[0])
    step, every = _thin(len(record.time)), _thin(len(z))  # every second layer alone would beat
    order = np.argsort(z)[every]  # a chain may step back
    u, time = 1e9 * record.chain_displacement[step][:, order], record.time[step]
    top = float(f"{np.percentile(abs(u), 99.9):.3g}") or 1.0
    panel = Panel(DISTANCE, "time (ms)", m.label, legend="upper left")
    panel.colour_label = "$u_z$ (nm)"
    panel.xlim = (float(z.min()), float(z.max()))
    panel.add("map", z[order], 1e3 * time, u, cmap="gray_r", vmin=-top, vmax=top)
    line = z / longest(m, "linear").value
    seen = line < 1e3 * time[-1]
    panel.line(z[seen], line[seen], "long-wave $V_P$", color="k", ls="--")
    return panel


def spectrum_distance(m: PackingData) -> Panel:
    """Figs. 12 and 13: spectra of one chain over distance, and where they fall to 2 % and 1 %."""
    band = passband(m)
    record, falls = m.shown, edges(m, "yade" if m.yade else "linear")
    distance, frequency, amplitude = band.map(record, passages=band.common)
    order = np.argsort(distance)
    if not m.crystal:  # a sphere that little holds swings by itself: an outlying column
        order = order[firmly_held(m.network)[record.chain_particle[order]]]
    distance, amplitude = distance[order], amplitude[:, order]
    top = (0.8 if m.crystal else 0.4) * band.highest
    found = [edge.value for edge in falls[:2] if np.isfinite(edge.value)]
    top = min(max([top, *(1.4 * value for value in found)]), band.highest)  # the legend's room
    rows = np.flatnonzero(frequency < top)[:: max(1, int((frequency < top).sum() // 150))]
    shade = 20 * np.log10(np.maximum(amplitude[rows] / amplitude.max(), 3e-3))
    title = f"{m.label}, {producer_name(record.producer)}"
    panel = Panel(DISTANCE, "frequency (kHz)", title, ylim=(0, top / 1e3))
    panel.colour_label, panel.legend = "amplitude (dB)", ("upper right", "lower left")[m.crystal]
    # A layer is drawn only with all others: every third alone would show a false band.
    panel.add("map", 1e3 * distance, frequency[rows] / 1e3, shade, cmap="gray_r")
    curves = threshold_curves(frequency, amplitude)
    ends = np.array(band.stretch) * m.network.length
    for row, edge, text, ls in zip(curves, falls, ("2 %", "1 %"), ("-", ":"), strict=False):
        middle, level = _slabs(distance, row, m.network.length)
        text_of = f"{text} threshold, medians"
        panel.line_on_map(1e3 * middle, level / 1e3, text_of, 1.2, color=ORANGE, ls=ls)
        if not np.isfinite(edge.value):
            panel.line([np.nan], [np.nan], f"{text}: no answer", color=BLUE, ls=ls)
            continue
        value = f"{text}: {edge.value / 1e3:.1f} kHz"
        if not edge.plateau:
            value += ", no plateau"
        panel.line(1e3 * ends, [edge.value / 1e3] * 2, value, color=BLUE, ls=ls, lw=3)
    if said := m.stated.get("f_low_pass_2_khz"):
        panel.hline(said[0], f"stated: {said[0]:g} kHz", color="k", ls="--", lw=0.8)
    return panel


def _slabs(
    distance: np.ndarray, values: np.ndarray, length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Middle, m, and median of the values of each fortieth of the length, or of three particles."""
    edges = np.linspace(0, length, 1 + max(1, min(40, len(distance) // 3)))
    place = np.where(np.isfinite(values), np.searchsorted(edges, distance, "right"), 0)
    groups = [values[place == k] for k in range(1, len(edges))]
    medians = [np.median(g) if len(g) > 1 else np.nan for g in groups]
    return 0.5 * (edges[1:] + edges[:-1]), np.array(medians)
