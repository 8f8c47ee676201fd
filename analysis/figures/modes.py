"""Figures 7 to 10: natural frequencies, the highest, what the modes move, and their shapes."""

from __future__ import annotations

import numpy as np

from analysis.measures import Measures
from analysis.picture import Panel, Picture
from analysis.stress import power_law
from modal.storage import InputError

STYLES = ("-", "--", ":", "-.")


def natural_frequencies(cases: list[Measures]) -> Picture:
    """Fig. 7: cumulative share and density of the natural frequencies, with and without rotations.

    Of all modes where the file has them; else of the density of states.
    """
    left = Panel("natural frequency (kHz)", "cumulative share", legend="lower right")
    right = Panel("natural frequency (kHz)", "density (1/kHz)", legend="upper left")
    curves = []
    for m in cases:
        case = m.case
        dof = 6 * case.network.n_particles
        full = case.modes is not None and len(case.modes.frequency) == dof
        if full:
            curves.append((case.label, case.modes.frequency))
        if full and case.translations is not None:
            curves.append((f"{case.label}, translations only", case.translations.frequency))
        if not full and case.density is not None:
            f, density, below = case.density
            style = {"color": "#c05000", "ls": STYLES[len(curves) % 4]}
            left.line(f / 1e3, below / dof, case.label, **style)
            right.line(f / 1e3, 1e3 * density / dof, case.label, **style)
    for (label, f), style in zip(curves, STYLES * len(cases), strict=False):
        f = np.sort(f) / 1e3
        every = np.unique(np.linspace(0, len(f) - 1, 400).astype(int))
        left.line(f[every], (every + 1) / len(f), label, ls=style, color="k")
        share, edges = np.histogram(f, np.linspace(0, 1.02 * f[-1], 90))
        share = share / (len(f) * np.diff(edges))
        right.line(np.repeat(edges, 2)[1:-1], np.repeat(share, 2), label, ls=style, color="k")
    if not left.series:
        raise InputError("no case has all its modes or a density of states; make one of them first")
    return Picture([left, right], columns=2, shape=(10, 4))


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
        b = power_law(stress, top)
        text = f"{name}: b = {b:.4f}" if np.isfinite(b) else name
        panel.line(stress, top, text, marker=marker, mfc="none", ls="none", color="k", ms=7)
        if kind:
            edge = [m.case.chain.low_pass_frequency / 1e3 for m in members]
            panel.line(stress, edge, "FCC, Eq. 10", ls="--", color="0.5")
            some = [m for m in members if m.case.translations is not None]
            only = [m.case.translations.frequency[-1] / 1e3 for m in some]
            at = [m.case.stress / 1e3 for m in some]
            panel.line(at, only, "FCC, translations only", marker="x", ls="none", color="#0060a8")
    return Picture([panel])


def chi_z(cases: list[Measures]) -> Picture:
    """Fig. 9: correlation index chi_z (Eq. 2) of every mode: all particles, and the chain's."""
    panels = []
    for m in _with_modes(cases):
        modes, f = m.case.modes, m.case.modes.frequency / 1e3
        label = {"ylim": (-0.03, 1.12), "legend": "lower left"}
        panel = Panel("natural frequency (kHz)", r"$\chi_z$", m.case.label, **label)
        dots = {"marker": ".", "ls": "none", "ms": 2}
        every = slice(None, None, max(1, len(f) // 10000))
        panel.line(f[every], modes.chi_z_chain[every], "chain", color="0.8", **dots)
        panel.line(f[every], modes.chi_z[every], "all particles", color="0.35", **dots)
        if modes.resonance_frequency is not None and len(modes.resonance_frequency):
            f_r = modes.resonance_frequency / 1e3
            style = {"marker": "|", "ls": "none", "ms": 8, "color": "k"}
            panel.line(f_r, np.full(len(f_r), 1.05), "P resonances", **style)
        panels.append(panel)
    return Picture(panels, columns=2 if len(panels) > 1 else 1)


def mode_shapes(cases: list[Measures]) -> Picture:
    """Fig. 10: z-shapes along the chain of the P resonances r = 1, 2, 5, 10, 50, 200."""
    panels = []
    for m in _with_modes(cases):
        modes = m.case.modes
        shapes = modes.resonance_shape
        if shapes is None or len(shapes) == 0:
            raise InputError(
                f"{m.case.path('modes')}: has no resonance shapes; make the modes again"
            )
        chain = m.case.record.chain_position
        if len(chain) != shapes.shape[1]:
            chain = m.case.wave.chain_position
        z = 1e3 * (chain - m.case.network.wall_position[0])
        for r in sorted({min(r, len(shapes)) for r in (1, 2, 5, 10, 50, 200)}):
            shape = shapes[r - 1] / abs(shapes[r - 1]).max()
            title = f"{m.case.label}: r = {r}, {modes.resonance_frequency[r - 1] / 1e3:.4g} kHz"
            panel = Panel("distance from source wall (mm)", "$u_z$ (-)", title, ylim=(-1.2, 1.2))
            sign = np.sign(shape[np.argmax(abs(shape) > 1e-3)]) or 1
            panel.line(z, sign * shape, color="k", marker=".", ms=2, lw=0.6)
            panels.append(panel)
    return Picture(panels, columns=2, shape=(11, 0.6 + 1.0 * len(panels)))


def _with_modes(cases: list[Measures]) -> list[Measures]:
    """The cases that have modes; InputError if none does."""
    found = [m for m in cases if m.case.modes is not None]
    if not found:
        raise InputError(f"{cases[0].case.path('modes')}: no such file; make it before this figure")
    return found
