"""Figures 7, 9 and 10: natural frequencies, what the modes move, and their shapes."""

import numpy as np

from analysis.figures.picture import BLUE, ORANGE, Panel, Picture
from analysis.packing_data import PackingData
from analysis.quantities.records import HIGH, LOW
from analysis.quantities.spectrum import chi_lists, density, f_max, standing, z_shapes
from analysis.quantities.velocity import longest
from modal.packing.rattlers import firmly_held
from modal.tools.errors import InputError

BINS = 90
TOP = 0.03
"""Highest density that is drawn, 1/kHz; the crystal's narrow peaks go on beyond it."""


def natural_frequencies(m: PackingData) -> Picture:
    """Fig. 7: cumulative share and density of the natural frequencies, with and without rotations.

    Of all modes where the file has them; else of the density of states.
    """
    modes, only = m.case.read("modes"), m.case.read("translations.modes")
    dof = 6 * m.network.n_particles
    left = Panel("share of modes below", "natural frequency (kHz)", "(a)", legend="upper left")
    right = Panel("natural frequency (kHz)", "density (1/kHz)", "(b)")
    right.ylim = (0, TOP)
    if m.crystal and modes is not None and len(modes.frequency) == dof:
        _spectrum(left, right, modes.frequency, m.label, color="k", lw=0.9)
        if only is not None:
            text = f"{m.label}, translations only"
            _spectrum(left, right, only.frequency, text, color="0.55", ls=":")
    elif m.case.has("density"):
        f, per_hertz, below = density(m)
        loose = m.mu_comp > 0.2
        look = {"color": ORANGE, "ls": "-."} if loose else {"color": BLUE, "ls": "--"}
        # Modes of zero frequency, of rattlers and floppy parts, are below the first of these.
        share, height = np.append(0.0, below / dof), np.append(0.0, f / 1e3)
        left.line(share, height, m.label, **look)
        right.line(f / 1e3, 1e3 * per_hertz / dof, **look)
    else:
        lack = f"{m.case.name} has neither all its modes nor a density of states"
        raise InputError("input", f"{lack}", remedy="keep one: measure FILE --keep DIR")
    if top := m.stated.get("f_max_khz"):
        text = "stated, highest" if m.crystal else ""
        left.line([1.0], top[:1], text, marker="*", ls="none", ms=9, color="k", mfc="#ffd000")
    return Picture([left, right], columns=2, shape=(10, 4))


def _spectrum(left: Panel, right: Panel, frequency: np.ndarray, label: str, **look) -> None:
    f = np.sort(frequency) / 1e3
    every = np.unique(np.linspace(0, len(f) - 1, 400).astype(int))
    left.line((every + 1) / len(f), f[every], label, **look)
    share, edges = np.histogram(f, np.linspace(0, 1.02 * f[-1], BINS), density=True)
    right.line(np.repeat(edges, 2)[1:-1], np.repeat(share, 2), **look)


def chi_z(m: PackingData) -> Panel:
    """Fig. 9: chi_z (Eq. 2) of the modes in the files; all particles, the chain, and the paper's.

    Where no mode of a random packing was computed, up to 20 kHz, the panel is shaded.
    """
    modes = m.case.needed("modes")
    panel = Panel("natural frequency (kHz)", r"$\chi_z$", m.label, ylim=(-0.03, 1.12))
    panel.legend = "outside"
    for k, (frequency, every, along) in enumerate(chi_lists(m)):
        for values, text, style in (
            (every, "all particles", {"color": "0.45", "marker": ".", "ms": 2}),
            (along, "chain", {"color": ORANGE, "marker": ".", "ms": 2, "alpha": 0.5}),
        ):
            f, chi = _distinct(frequency / 1e3, values)
            panel.line(f, chi, text if k == 0 else "", ls="none", mew=0.6, **style)
    if not m.crystal:
        _not_computed(panel, m)
        _across(panel, m)
    bearers = standing(m)
    f_r = bearers.frequency if bearers else modes.resonance_frequency
    if f_r is not None and len(f_r):
        style = {"marker": "|", "ls": "none", "ms": 6, "color": "k"}
        panel.line(f_r / 1e3, np.full(len(f_r), 1.07), "P resonances", **style)
    for name, ends, ls in (("chi_z_low", (0, LOW), "--"), ("chi_z_high", (HIGH, 0.1), ":")):
        if name in m.stated:
            at, level = np.array(ends) * f_max(m) / 1e3, [m.stated[name][0]] * 2
            panel.line(at, level, "stated", color="k", ls=ls)
    return panel


def _across(panel: Panel, m: PackingData) -> None:
    """Where the first waves fit across a random packing: below them only waves along it exist."""
    width = float(min(m.network.cell_size[:2]))
    moduli = m.case.read("moduli")
    shear = np.nan if moduli is None else moduli.velocities((0, 0, 1))[1:].mean()
    for velocity, text, ls in (
        (shear, "$V_S$ / width", "-."),
        (longest(m, "linear").value, "$V_P$ / width", ":"),
    ):
        if np.isfinite(velocity):
            panel.vlines([velocity / width / 1e3], text, color=BLUE, ls=ls)


TO = 2e4
"""Hz up to which the paper shows chi_z of a random packing."""


def _not_computed(panel: Panel, m: PackingData) -> None:
    """Shade frequencies of a random packing, up to `TO`, between and beyond the lists of modes."""
    ends = [(float(f[0]), float(f[-1])) for f, _, _ in chi_lists(m)]
    above = [first for first, _ in ends[1:]] + [TO]
    text = "not computed"
    for (_, last), first in zip(ends, above, strict=True):
        if first - last > 0.02 * TO:  # more than the distance of two modes
            panel.band([last / 1e3, first / 1e3], 0, 1, text, color="0.9")
            text = ""


def _distinct(frequency: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points that differ in print: a 500th of the frequencies or of chi_z apart."""
    step = frequency[-1] / 500
    cells = np.column_stack([np.round(frequency / step), np.round(values / 2e-3)])
    _, kept = np.unique(cells, axis=0, return_index=True)
    kept = np.sort(kept)
    return frequency[kept], values[kept]


def mode_shapes(m: PackingData) -> Picture:
    """Fig. 10: z-shapes along the chain of the P resonances r = 1, 2, 5, 10, ..., and the sine."""
    panels, modes, bearers = [], m.case.needed("modes"), standing(m)
    f, shapes = modes.resonance_frequency, modes.resonance_shape
    chain = m.shown.chain_particle
    if bearers is not None:
        # A sphere that little holds swings by itself, far beyond the standing wave.
        chain = chain[firmly_held(m.network)[chain]]
        f, shapes = bearers.frequency, z_shapes(m)[bearers.row][:, chain]
    if shapes is None or len(shapes) == 0:
        raise InputError(
            "input", f"{m.case.path('modes')}: no shapes of resonances", remedy="make them again"
        )
    z = m.network.position[chain, 2] - m.network.wall_position[0]
    orders = (1, 2, 5, 10, 50, 200) if m.crystal else (1, 2, 5, 10, 15, 20)
    known = sorted({min(r, len(shapes)) for r in orders})
    known += [r for r in (3, 7) if r < len(shapes)][: len(orders) - len(known)]
    for r in sorted(known):
        sine = np.sin(np.pi * r * z / m.network.length)
        shape = shapes[r - 1] * np.sign(shapes[r - 1] @ sine)
        shape = shape / np.percentile(abs(shape), 98)
        title = f"{m.case.short}: r = {r}, {f[r - 1] / 1e3:.4g} kHz"
        panel = Panel("distance (mm)", "$u_z$ (-)", title, ylim=(-1.3, 2.2))
        panel.legend, panel.legend_columns = "upper right", 2
        if r <= 20:
            order = np.argsort(z)
            panel.line(1e3 * z[order], sine[order], "Eq. 3", color="0.6", lw=2)
        text = "mode"
        if said := m.stated.get(f"f_{r}_khz"):
            text += f"; stated: {said[0]:g} kHz"
        panel.line(1e3 * z, shape, text, color="k", marker=".", ms=2, lw=0.5)
        panels.append(panel)
    return Picture(panels, columns=3, shape=(11, 0.4 + 1.5 * -(-len(panels) // 3)))
