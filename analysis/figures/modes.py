"""Figures 7 to 10: natural frequencies, the highest, what the modes move, and their shapes."""

from __future__ import annotations

import numpy as np

from analysis.estimators.power_law import power_law
from analysis.figures.picture import Panel, Picture
from analysis.measures import Measures
from modal.formats.hdf5 import InputError

BINS = 90


def natural_frequencies(cases: list[Measures]) -> Picture:
    """Fig. 7: cumulative share and density of the natural frequencies, with and without rotations.

    Of all modes where the file has them; else of the density of states.
    """
    panels = []
    for m in cases:
        case, dof = m.case, 6 * m.case.network.n_particles
        left = Panel("natural frequency (kHz)", "modes below, share", case.label)
        right = Panel("natural frequency (kHz)", "density (1/kHz)", case.label)
        left.legend, right.legend = "upper left", "upper left"
        if case.modes is not None and len(case.modes.frequency) == dof:
            _spectrum(left, right, case.modes.frequency, "all modes", "-")
            if case.translations is not None:
                _spectrum(left, right, case.translations.frequency, "translations only", ":")
        elif case.density is not None:
            f, density, below = case.density
            left.line(f / 1e3, below / dof, "density of states", color="k")
            right.line(f / 1e3, 1e3 * density / dof, "density of states", color="k")
        else:
            continue
        panels += [left, right]
    if not panels:
        raise InputError(
            "no case has all its modes or a density of states; run python -m analysis prepare CASE"
        )
    return Picture(panels, columns=2, shape=(10, 0.4 + 1.25 * len(panels)))


def _spectrum(left: Panel, right: Panel, frequency: np.ndarray, label: str, style: str) -> None:
    f = np.sort(frequency) / 1e3
    every = np.unique(np.linspace(0, len(f) - 1, 400).astype(int))
    left.line(f[every], (every + 1) / len(f), label, ls=style, color="k")
    share, edges = np.histogram(f, np.linspace(0, 1.02 * f[-1], BINS))
    share = share / (len(f) * np.diff(edges))
    right.line(np.repeat(edges, 2)[1:-1], np.repeat(share, 2), label, ls=style, color="k")


def highest_frequency(cases: list[Measures]) -> Picture:
    """Fig. 8: highest natural frequency against stress, with and without rotations, and Eq. 10."""
    panel = Panel("stress (kPa)", "$f_{max}$ (kHz)", xscale="log", yscale="log")
    for kind, marker in ((True, "s"), (False, "o")):
        members = [m for m in cases if m.case.is_crystal is kind]
        if not members:
            continue
        stress = np.array([m.case.stress for m in members]) / 1e3
        top = np.array([m.f_max for m in members]) / 1e3
        name = "FCC" if kind else "random"
        law = power_law(stress, top)
        text = f"{name}: {law}" if np.isfinite(law.exponent) else name
        panel.line(stress, top, text, marker=marker, mfc="none", ls="none", color="k", ms=7)
        if kind:
            edge = [m.case.lattice.low_pass_frequency / 1e3 for m in members]
            panel.line(stress, edge, "FCC, Eq. 10", ls="--", color="0.5")
            some = [m for m in members if m.case.translations is not None]
            only = [m.case.translations.frequency[-1] / 1e3 for m in some]
            at = [m.case.stress / 1e3 for m in some]
            panel.line(at, only, "FCC, translations only", marker="x", ls="none", color="k")
    return Picture([panel])


def chi_z(cases: list[Measures]) -> Picture:
    """Fig. 9: chi_z (Eq. 2) of the modes in the files, not of all; all particles, and the chain."""
    panels = []
    for m in _with_modes(cases):
        panel = Panel("natural frequency (kHz)", r"$\chi_z$", m.case.label, ylim=(-0.03, 1.4))
        panel.legend, panel.legend_columns = "upper left", 3
        for modes in (m.case.modes, m.case.band):
            if modes is None:
                continue
            first = modes is m.case.modes
            for values, text, colour, marker in (
                (modes.chi_z_chain, "chain", "0.65", "x"),
                (modes.chi_z, "all particles", "k", "."),
            ):
                style = {"marker": marker, "ls": "none", "ms": 3, "color": colour}
                f, chi = _distinct(modes.frequency / 1e3, values)
                panel.line(f, chi, text if first else "", **style)
        f_r = m.standing.frequency if m.standing else m.case.modes.resonance_frequency
        if f_r is not None and len(f_r):
            style = {"marker": "|", "ls": "none", "ms": 6, "color": "k"}
            panel.line(f_r / 1e3, np.full(len(f_r), 1.07), "P resonances", **style)
        panels.append(panel)
    return Picture(panels, columns=2 if len(panels) > 1 else 1)


def _distinct(frequency: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points that differ in print: a 500th of the frequencies or of chi_z apart."""
    step = frequency[-1] / 500
    cells = np.column_stack([np.round(frequency / step), np.round(values / 2e-3)])
    _, kept = np.unique(cells, axis=0, return_index=True)
    kept = np.sort(kept)
    return frequency[kept], values[kept]


def mode_shapes(cases: list[Measures]) -> Picture:
    """Fig. 10: z-shapes along the chain of the P resonances r = 1, 2, 5, 10, ..., and the sine."""
    panels = []
    for m in _with_modes(cases):
        case, f, shapes = m.case, m.case.modes.resonance_frequency, m.case.modes.resonance_shape
        chain = case.record
        if m.standing is not None:
            f = m.standing.frequency
            shapes = case.modes.mode_shape[m.standing.row][:, chain.chain_particle, 2]
        if shapes is None or len(shapes) == 0:
            continue
        z = chain.chain_position - case.network.wall_position[0]
        for r in sorted({min(r, len(shapes)) for r in (1, 2, 5, 10, 50, 200)}):
            sine = np.sin(np.pi * r * z / case.network.length)
            shape = shapes[r - 1] * np.sign(shapes[r - 1] @ sine)
            shape = shape / np.percentile(abs(shape), 98)
            title = f"{case.short}: r = {r}, {f[r - 1] / 1e3:.4g} kHz"
            panel = Panel("distance (mm)", "$u_z$ (-)", title, ylim=(-1.3, 1.3))
            if r <= 20:
                panel.line(1e3 * z, sine, color="0.6", lw=2)
            panel.line(1e3 * z, shape, color="k", marker=".", ms=2, lw=0.5)
            panels.append(panel)
    if not panels:
        raise InputError(f"{cases[0].case.path('modes')}: no shapes of resonances; make them again")
    return Picture(panels, columns=3, shape=(11, 0.4 + 1.5 * -(-len(panels) // 3)))


def _with_modes(cases: list[Measures]) -> list[Measures]:
    """The cases that have modes; InputError if none does."""
    found = [m for m in cases if m.case.modes is not None]
    if not found:
        raise InputError(f"{cases[0].case.path('modes')}: no such file; make it before this figure")
    return found
