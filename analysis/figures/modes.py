"""Draw figures 7, 9 and 10: natural frequencies, directions of motion, and mode shapes."""

import numpy as np

from analysis.figures.picture import BLUE, ORANGE, Panel, Picture, Style
from analysis.packing_data import PackingData
from analysis.quantities.case_files import HIGH_MODES_START_IN_F_MAX, LOW_MODES_END_IN_F_MAX
from analysis.quantities.polarisation import chi_lists
from analysis.quantities.spectrum import density, f_max, standing, z_shapes
from analysis.quantities.velocity import longest
from modal.packing.rattlers import firmly_held
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

BINS = 90
"""Number of edges of the histogram of natural frequencies."""
MAX_DENSITY_PER_KHZ = 0.03
"""Highest density that is drawn; the crystal's narrow peaks go on beyond it."""
MAX_CHI_FREQUENCY = 2e4
"""Frequency, Hz, up to which the paper shows chi_z of a random packing."""
POINTS_PER_CURVE = 400
"""Number of points of a cumulative curve: more than a reader can distinguish in print."""
ORDERS_OF_CRYSTAL = (1, 2, 5, 10, 50, 200)
ORDERS_OF_RANDOM = (1, 2, 5, 10, 15, 20)
"""Orders of the P resonances whose shapes are drawn, as in the paper."""
FURTHER_ORDERS = (3, 7)
"""Orders that are drawn in the place of those that a packing does not have."""
MAX_ORDER_OF_SINE = 20
"""Highest order whose sine is drawn; those of higher orders would cover the shape."""


def natural_frequencies(m: PackingData) -> Picture:
    """Draw Fig. 7: cumulative share and density of natural frequencies, also without rotations.

    They are read from a list of all modes if there is one, else from the density of states.
    """
    modes = m.case.read("modes")
    translations = m.case.read("translations.modes")
    degrees_of_freedom = m.network.degrees_of_freedom
    left = Panel("share of modes below (-)", "natural frequency (kHz)", "(a)", legend="upper left")
    right = Panel("natural frequency (kHz)", "density (1/kHz)", "(b)")
    right.ylim = (0, MAX_DENSITY_PER_KHZ)
    if m.crystal and modes is not None and len(modes.frequency) == degrees_of_freedom:
        _draw_spectrum(left, right, modes.frequency, m.label, {"color": "k", "lw": 0.9})
        if translations is not None:
            text = f"{m.label}, translations only"
            dotted: Style = {"color": "0.55", "ls": ":"}
            _draw_spectrum(left, right, translations.frequency, text, dotted)
    elif m.case.has("density"):
        frequency, per_hertz, below = density(m)
        style: Style = {"color": BLUE, "ls": "--"}
        if m.mu_comp > 0.2:
            style = {"color": ORANGE, "ls": "-."}
        # Modes of zero frequency, of rattlers and floppy parts, are below the first of these.
        share = np.append(0.0, below / degrees_of_freedom)
        left.line(share, np.append(0.0, frequency / 1e3), m.label, **style)
        right.line(frequency / 1e3, 1e3 * per_hertz / degrees_of_freedom, **style)
    else:
        raise InputError(
            "no_spectrum",
            f"{m.case.name} has neither all its modes nor a density of states",
            remedy="keep one: measure FILE --keep DIR",
        )
    if "f_max_khz" in m.stated:
        highest = m.stated["f_max_khz"]
        text = "stated, highest" if m.crystal else ""
        left.line([1.0], highest[:1], text, marker="*", ls="none", ms=9, color="k", mfc="#ffd000")
    return Picture([left, right], columns=2, shape=(10, 4))


def _draw_spectrum(left: Panel, right: Panel, frequency: Floats, label: str, style: Style) -> None:
    """Draw the cumulative share of frequencies (n,), Hz, and their histogram."""
    ordered = np.sort(frequency) / 1e3
    shown = np.unique(np.linspace(0, len(ordered) - 1, POINTS_PER_CURVE).astype(int))
    left.line((shown + 1) / len(ordered), ordered[shown], label, **style)
    share, edges = np.histogram(ordered, np.linspace(0, 1.02 * ordered[-1], BINS), density=True)
    right.line(np.repeat(edges, 2)[1:-1], np.repeat(share, 2), **style)


def chi_z(m: PackingData) -> Panel:
    """Draw Fig. 9: chi_z (Eq. 2) of modes: of all particles, of the chain, and of the paper.

    The panel is shaded where no modes of a random packing were computed, up to 20 kHz.
    """
    modes = m.case.needed("modes")
    panel = Panel("natural frequency (kHz)", r"$\chi_z$ (-)", m.label, ylim=(-0.03, 1.12))
    panel.legend = "outside"
    for k, (frequency, chi_of_all, chi_of_chain) in enumerate(chi_lists(m)):
        first = k == 0
        x, y = _distinct(frequency / 1e3, chi_of_all)
        label = "all particles" if first else ""
        panel.line(x, y, label, ls="none", mew=0.6, color="0.45", marker=".", ms=2)
        x, y = _distinct(frequency / 1e3, chi_of_chain)
        label = "chain" if first else ""
        panel.line(x, y, label, ls="none", mew=0.6, color=ORANGE, marker=".", ms=2, alpha=0.5)
    if not m.crystal:
        _shade_gaps(panel, m)
        _mark_waves_across(panel, m)
    bearers = standing(m)
    resonances = bearers.frequency if bearers else modes.resonance_frequency
    if resonances is not None and len(resonances):
        tick_style: Style = {"marker": "|", "ls": "none", "ms": 6, "color": "k"}
        panel.line(resonances / 1e3, np.full(len(resonances), 1.07), "P resonances", **tick_style)
    stated_ranges = (
        ("chi_z_low", (0, LOW_MODES_END_IN_F_MAX), "--"),
        ("chi_z_high", (HIGH_MODES_START_IN_F_MAX, 0.1), ":"),
    )
    for name, ends, ls in stated_ranges:
        if name in m.stated:
            level = m.stated[name][0]
            panel.line(np.array(ends) * f_max(m) / 1e3, [level, level], "stated", color="k", ls=ls)
    return panel


def _mark_waves_across(panel: Panel, m: PackingData) -> None:
    """Mark the frequencies at which the first waves fit across a random packing.

    Below these frequencies only waves along the packing exist.
    """
    width = float(min(m.network.cell_size[:2]))
    moduli = m.case.read("moduli")
    shear_velocity = np.nan
    if moduli is not None:
        shear_velocity = moduli.velocities((0, 0, 1))[1:].mean()
    for velocity, text, ls in (
        (shear_velocity, "$V_S$ / width", "-."),
        (longest(m, "linear").value, "$V_P$ / width", ":"),
    ):
        if np.isfinite(velocity):
            panel.vlines([velocity / width / 1e3], text, color=BLUE, ls=ls)


def _shade_gaps(panel: Panel, m: PackingData) -> None:
    """Shade frequencies, up to `MAX_CHI_FREQUENCY`, between and beyond the lists of modes."""
    ends = [(float(frequency[0]), float(frequency[-1])) for frequency, _, _ in chi_lists(m)]
    next_starts = [first for first, _ in ends[1:]] + [MAX_CHI_FREQUENCY]
    text = "not computed"
    for (_, last), start in zip(ends, next_starts, strict=True):
        if start - last > 0.02 * MAX_CHI_FREQUENCY:  # more than the distance of two modes
            panel.band([last / 1e3, start / 1e3], 0, 1, text, color="0.9")
            text = ""


def _distinct(frequency: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return points that differ in print: by a 500th of the frequencies or of chi_z."""
    step = frequency[-1] / 500
    cells = np.column_stack([np.round(frequency / step), np.round(values / 2e-3)])
    _, indices = np.unique(cells, axis=0, return_index=True)
    indices = np.sort(indices)
    return frequency[indices], values[indices]


def mode_shapes(m: PackingData) -> Picture:
    """Draw Fig. 10: z-shapes along the chain of P resonances r = 1, 2, 5, 10, ..., and the sine."""
    modes = m.case.needed("modes")
    bearers = standing(m)
    frequency = modes.resonance_frequency
    shapes = modes.resonance_shape
    chain = m.shown.chain_particle
    if bearers is not None:
        # A sphere that is hardly held swings by itself, far beyond the standing wave.
        chain = chain[firmly_held(m.network)[chain]]
        frequency = bearers.frequency
        shapes_of_all = z_shapes(m)
        assert shapes_of_all is not None  # the file of modes is there
        shapes = shapes_of_all[bearers.row][:, chain]
    if shapes is None or len(shapes) == 0:
        raise InputError(
            "no_shapes",
            f"{m.case.path('modes')}: no shapes of resonances",
            remedy="make them again",
        )
    z = m.network.position[chain, 2] - m.network.wall_position[0]
    orders = _shown_orders(len(shapes), ORDERS_OF_CRYSTAL if m.crystal else ORDERS_OF_RANDOM)
    panels = []
    for order in orders:
        title = f"{m.case.short}: r = {order}, {frequency[order - 1] / 1e3:.4g} kHz"
        panel = _draw_shape(shapes[order - 1], z, order, m.network.length, title)
        if f"f_{order}_khz" in m.stated:
            stated = m.stated[f"f_{order}_khz"][0]
            panel.series[-1].label += f"; stated: {stated:g} kHz"
        panels.append(panel)
    rows = -(-len(panels) // 3)
    return Picture(panels, columns=3, shape=(11, 0.4 + 1.5 * rows))


def _shown_orders(count: int, wanted: tuple[int, ...]) -> list[int]:
    """Return the orders to draw, of `count` shapes; others replace missing ones."""
    orders = sorted({min(order, count) for order in wanted})
    missing = len(wanted) - len(orders)
    further = [order for order in FURTHER_ORDERS if order < count]
    return sorted(orders + further[:missing])


def _draw_shape(shape: Floats, z: Floats, order: int, length: float, title: str) -> Panel:
    """Draw the shape (k,) of a mode at z (k,), m, and the sine of its order over a length, m."""
    sine = np.sin(np.pi * order * z / length)
    shape = shape * np.sign(shape @ sine)
    shape = shape / np.percentile(abs(shape), 98)
    panel = Panel("distance (mm)", "$u_z$ (-)", title, ylim=(-1.3, 2.2))
    panel.legend = "upper right"
    panel.legend_columns = 2
    if order <= MAX_ORDER_OF_SINE:
        by_place = np.argsort(z)
        panel.line(1e3 * z[by_place], sine[by_place], "Eq. 3", color="0.6", lw=2)
    panel.line(1e3 * z, shape, "mode", color="k", marker=".", ms=2, lw=0.5)
    return panel
