"""Draw figures 1 to 5, 12 and 13: packing and source, signals and their spectra."""

from typing import Unpack

import numpy as np

from analysis.estimators.layer_lattice import exact_twin
from analysis.estimators.source_motion import cut
from analysis.estimators.threshold_rule import threshold_curves
from analysis.figures.picture import BLUE, ORANGE, Panel, Picture, Style
from analysis.packing_data import PackingData
from analysis.quantities.passband import edges, passband
from analysis.quantities.velocity import longest
from analysis.value import Value
from modal.packing.rattlers import firmly_held
from modal.packing.state import contacts_per_particle, void_ratio
from modal.tools.arrays import Floats, Ints
from modal.waves.motions import Pulse
from modal.waves.signals import Signals

DISTANCE_LABEL = "distance from the source wall (mm)"
POINTS_PER_SIDE = 130
"""Approximate number of points on a side of a map; a curve has twice as many. More are not told
apart in print."""
MAX_SHOWN_PASSAGES = 1.3
"""Longest time that is drawn, in passages of the affine wave from wall to wall."""
DISTANCES_IN_D = np.array([10.0, 50.0, 100.0])
"""Distances from the source wall, D, of the particles that Fig. 3 shows, as in the paper."""
LENGTH_FOR_DISTANCES_IN_D = 140
"""Length of the paper's samples, D; in a shorter one the distances shrink with its length."""
PULSE_LINES = {1e5: "-", 2e5: "--"}
"""Line of a pulse by its frequency, Hz; any other is dotted."""
STRESS_LINES = (("0.5", "-"), ("k", "-"), (BLUE, "--"), (ORANGE, ":"))
"""Colour and line style of a stress, by its power of ten."""
FIRST_ARRIVAL_WINDOW = (0.8, 1.8)
"""Times that Fig. 4 shows, relative to the travel time of long waves."""
MAX_SPECTRUM_ROWS = 150
"""Approximate number of frequencies of a map of spectra."""
MIN_SHADE_RATIO = 3e-3
"""Smallest amplitude that has a shade of its own, relative to the largest: -50 dB."""
SLABS = 40
"""Number of parts of the length in which medians of a threshold are taken."""
PARTICLES_PER_SLAB = 3
"""Smallest mean number of particles of a slab."""


def samples(m: PackingData) -> Picture:
    """Draw Fig. 1: spheres of a slab one diameter thick, by their number of contacts."""
    network = m.network
    d = m.diameter
    off_middle = abs(network.position[:, 1] % network.cell_size[1] - 0.5 * network.cell_size[1])
    nearest = np.argsort(off_middle)
    chosen = nearest[off_middle[nearest] < 0.5 * d]
    x = network.position[chosen, 0] % network.cell_size[0]
    z = network.position[chosen, 2] - network.wall_position[0]
    contacts = contacts_per_particle(network)
    title = m.label
    if np.isfinite(m.mu_comp) and not m.crystal:
        title += f", friction {m.mu_comp:g}"
    title += f": void ratio {void_ratio(network):.3f}, {contacts.mean():.2f} contacts a sphere"
    panel = Panel(DISTANCE_LABEL, "x (mm)", title, equal=True, colour_label="contacts (-)")
    panel.xlim = (0, 1e3 * network.length)
    panel.ylim = (-500 * d, 1e3 * float(network.cell_size[0]) + 500 * d)
    low = float(contacts[chosen].min())
    high = float(contacts[chosen].max())
    if low == high:
        low -= 1  # a range of colours has two ends
    style: Style = {"diameter": 1e3 * d, "cmap": "viridis", "clim": (low, high)}
    panel.add("spheres", 1e3 * z, 1e3 * x, contacts[chosen], **style)
    return Picture([panel], shape=(11, 2.0))


def source(m: PackingData) -> Picture:
    """Draw Fig. 2: displacement of the source wall, a pulse, and its spectrum."""
    left = Panel("time (µs)", "source wall $u$ (nm)", xlim=(0, 20))
    right = Panel("frequency (kHz)", "amplitude over its maximum (-)", xlim=(0, 500))
    pulse = Pulse(m.motion.amplitude, m.motion.frequency)
    label = f"{pulse.frequency / 1e3:g} kHz"
    style: Style = {"ls": PULSE_LINES.get(pulse.frequency, ":"), "color": "k"}
    time = np.linspace(0, 2e-5, 401)
    frequency = np.linspace(0, 5e5, 501)
    pulse_time = np.linspace(0, 1 / pulse.frequency, 2001)
    kernel = np.exp(-2j * np.pi * frequency[:, None] * pulse_time)
    spectrum = abs(kernel @ pulse.displacement(pulse_time))
    left.line(1e6 * time, 1e9 * pulse.displacement(time), label, **style)
    right.line(frequency / 1e3, spectrum / spectrum.max(), label, **style)
    return Picture([left, right], columns=2)


def _thin(count: int) -> slice:
    """Return the slice that leaves about `POINTS_PER_SIDE` of `count` points."""
    return slice(None, None, max(1, count // POINTS_PER_SIDE))


def producer_name(producer: str) -> str:
    """Return the name, for a legend, of the program that has made a record."""
    return {"yade": "YADE", "linear": "linear wave"}.get(producer, producer)


def _nearest(m: PackingData, record: Signals, distance: float) -> tuple[int, float]:
    """Return index and distance, D, of the chain's particle nearest to a given distance, D."""
    depth = (record.chain_position - m.network.wall_position[0]) / m.diameter
    index = int(np.argmin(abs(depth - distance)))
    return index, float(depth[index])


def _last_time(m: PackingData, record: Signals) -> float:
    """Return the time, s, up to which motions are drawn: before the reflection returns to 100 D."""
    return min(float(record.time[-1]), MAX_SHOWN_PASSAGES * m.affine_passage)


def _signal(m: PackingData, distance: float) -> Panel:
    """Draw the motion of a particle at a distance, D: recorded, and by theory or linear wave."""
    record = m.shown
    index, depth = _nearest(m, record, distance)
    title = f"{m.label}, {depth:.0f} D, pulse {record.input_frequency / 1e3:.3g} kHz"
    u = 1e9 * record.chain_displacement[:, index]
    panel = Panel("time (ms)", "$u_z$ (nm)", title)
    end = _last_time(m, record)
    panel.xlim = (0, 1e3 * end)
    # The legend stands above the wave.
    panel.ylim = (min(-0.4, 1.15 * float(u.min())), 1.5 * float(u.max()))
    _curve(panel, record, index, end, producer_name(record.producer), color="0.6", lw=2.2)
    style: Style = {"color": "k", "ls": "--", "lw": 0.9}
    if m.crystal:
        _curve(panel, exact_twin(record, m.lattice), index, end, "exact lattice", **style)
    elif record is not m.linear:
        same_particle = m.linear.chain_particle == record.chain_particle[index]
        _curve(panel, m.linear, int(np.flatnonzero(same_particle)[0]), end, "linear wave", **style)
    return panel


def _curve(
    panel: Panel, record: Signals, index: int, end: float, label: str, **style: Unpack[Style]
) -> None:
    """Draw the displacement of the chain's particle `index` up to the time `end`, s."""
    record = cut(record, end)
    shown = _thin(len(record.time) // 2)
    u = record.chain_displacement[shown, index]
    panel.line(1e3 * record.time[shown], 1e9 * u, label, **style)


def distances(m: PackingData) -> Floats:
    """Return `DISTANCES_IN_D`; for a shorter sample, the same shares of its length."""
    length = m.network.length / m.diameter
    return DISTANCES_IN_D * min(1.0, length / LENGTH_FOR_DISTANCES_IN_D)


def signals(m: PackingData) -> Picture:
    """Draw Fig. 3: displacement of particles of the chain at 10, 50 and 100 D from the source."""
    return Picture([_signal(m, distance) for distance in distances(m)], 3, (11, 2.8))


def signals_stress(m: PackingData) -> Picture:
    """Draw Fig. 4: displacement at 50 D from the wall, 100 kHz; a panel for each friction.

    Time is divided by the travel time of long waves, so that the first arrivals of all stresses
    coincide.
    """
    record = m.case.read("100kHz.signals") or m.shown
    index, depth = _nearest(m, record, distances(m)[1])
    title = "FCC" if m.crystal else f"friction {m.mu_comp:g}"
    title += f", pulse {record.input_frequency / 1e3:.3g} kHz, {depth:.0f} D"
    low, high = FIRST_ARRIVAL_WINDOW
    panel = Panel("time over that of long waves (-)", "$u_z$ (nm)", title, legend="upper right")
    panel.xlim = (low, high)
    travel_time = depth * m.diameter / longest(m, "linear").value
    relative_time = record.time / travel_time
    shown = (relative_time > low) & (relative_time < high)
    shown &= record.time <= _last_time(m, record)
    u = 1e9 * record.chain_displacement[shown, index]
    label = f"{m.stress / 1e3:g} kPa, e {void_ratio(m.network):.3f}, "
    label += producer_name(record.producer)
    colour, ls = _stress_line(m.stress)
    thin = _thin(int(shown.sum()) // 2)
    panel.line(relative_time[shown][thin], u[thin], label, color=colour, ls=ls)
    return Picture([panel], shape=(12, 3.6))


def _stress_line(stress: float) -> tuple[str, str]:
    """Return colour and line of a stress, Pa."""
    if stress > 0:
        return STRESS_LINES[round(np.log10(stress)) % len(STRESS_LINES)]
    return STRESS_LINES[0]


def space_time(m: PackingData) -> Panel:
    """Draw Fig. 5: displacement against distance and time, with the velocity of long waves."""
    record = cut(m.shown, _last_time(m, m.shown))
    z = 1e3 * (record.chain_position - m.network.wall_position[0])
    times = _thin(len(record.time))
    layers = _thin(len(z))  # every second layer alone would beat
    order = np.argsort(z)[layers]  # a chain may step back
    u = 1e9 * record.chain_displacement[times][:, order]
    time = record.time[times]
    top = float(f"{np.percentile(abs(u), 99.9):.3g}") or 1.0
    panel = Panel(DISTANCE_LABEL, "time (ms)", m.label, legend="upper left")
    panel.colour_label = "$u_z$ (nm)"
    panel.xlim = (float(z.min()), float(z.max()))
    panel.add("map", z[order], 1e3 * time, u, cmap="gray_r", vmin=-top, vmax=top)
    arrival = z / longest(m, "linear").value
    shown = arrival < 1e3 * time[-1]
    panel.line(z[shown], arrival[shown], "long-wave $V_P$", color="k", ls="--")
    return panel


def spectrum_distance(m: PackingData) -> Panel:
    """Draw Figs. 12 and 13: spectra along a chain, and where they fall to 2 and 1 %."""
    band = passband(m)
    record = m.shown
    band_edges = edges(m, "yade" if m.yade else "linear")
    distance, frequency, amplitude = band.map(record, passages=band.common)
    order = _firm_order(m, record, distance)
    distance = distance[order]
    amplitude = amplitude[:, order]
    top = _top_frequency(m, band.highest, band_edges[:2])
    below_top = np.flatnonzero(frequency < top)
    rows = below_top[:: max(1, len(below_top) // MAX_SPECTRUM_ROWS)]
    ratio = amplitude[rows] / amplitude.max()
    shade = 20 * np.log10(np.maximum(ratio, MIN_SHADE_RATIO))
    title = f"{m.label}, {producer_name(record.producer)}"
    panel = Panel(DISTANCE_LABEL, "frequency (kHz)", title, ylim=(0, top / 1e3))
    panel.colour_label = "amplitude (dB)"
    panel.legend = "lower left" if m.crystal else "upper right"
    # A layer is drawn only with all others: every third alone would show a false band.
    panel.add("map", 1e3 * distance, frequency[rows] / 1e3, shade, cmap="gray_r")
    curves = threshold_curves(frequency, amplitude)
    stretch = np.array(band.stretch) * m.network.length
    for curve, edge, percent, ls in zip(
        curves, band_edges, ("2 %", "1 %"), ("-", ":"), strict=False
    ):
        middle, median = _slab_medians(distance, curve, m.network.length)
        label = f"{percent} threshold, medians"
        panel.line_on_map(1e3 * middle, median / 1e3, label, lw=1.2, color=ORANGE, ls=ls)
        _draw_edge(panel, edge, percent, stretch, ls)
    if "f_low_pass_2_khz" in m.stated:
        stated = m.stated["f_low_pass_2_khz"][0]
        panel.hline(stated, f"stated: {stated:g} kHz", color="k", ls="--", lw=0.8)
    return panel


def _firm_order(m: PackingData, record: Signals, distance: Floats) -> Ints:
    """Return the chain's particles (k,) sorted by distance, without loose ones in random packings.

    A loosely held sphere swings by itself and would be an outlier in the map.
    """
    order = np.argsort(distance)
    if m.crystal:
        return order
    return order[firmly_held(m.network)[record.chain_particle[order]]]


def _top_frequency(m: PackingData, highest: float, band_edges: list[Value]) -> float:
    """Return the highest frequency to draw, Hz, with room for a legend above the band edges."""
    share = 0.8 if m.crystal else 0.4
    tops = [share * highest]
    tops += [1.4 * edge.value for edge in band_edges if np.isfinite(edge.value)]
    return min(max(tops), highest)


def _draw_edge(panel: Panel, edge: Value, percent: str, stretch: Floats, ls: str) -> None:
    """Draw a low-pass frequency, Hz, over its `stretch` (2,), m, or only its legend entry."""
    if not np.isfinite(edge.value):
        panel.line([np.nan], [np.nan], f"{percent}: no answer", color=BLUE, ls=ls)
        return
    label = f"{percent}: {edge.value / 1e3:.1f} kHz"
    if not edge.plateau:
        label += ", no plateau"
    panel.line(1e3 * stretch, [edge.value / 1e3] * 2, label, color=BLUE, ls=ls, lw=3)


def _slab_medians(distance: Floats, values: Floats, length: float) -> tuple[Floats, Floats]:
    """Return the middles, m, of slabs (k,) of the length, and the medians of their values.

    A slab with fewer than two known values has NaN.
    """
    slabs = max(1, min(SLABS, len(distance) // PARTICLES_PER_SLAB))
    borders = np.linspace(0, length, 1 + slabs)
    slab = np.where(np.isfinite(values), np.searchsorted(borders, distance, "right"), 0)
    medians = np.full(slabs, np.nan)
    for k in range(slabs):
        members = values[slab == k + 1]
        if len(members) > 1:
            medians[k] = np.median(members)
    return 0.5 * (borders[1:] + borders[:-1]), medians
