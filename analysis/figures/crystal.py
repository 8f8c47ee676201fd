"""Figures of the eigenmodes, and of velocity and band edge against stress."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from analysis import dispersion as disp
from analysis.products import Products
from modal.storage import InputError

Columns = dict[str, np.ndarray]


def natural_frequencies(axes: np.ndarray, case: Products) -> Columns:
    """Cumulative number and density of the natural frequencies, with and without rotations."""
    sets = [("with rotations", case.modes), ("translations only", case.translations)]
    sets = [(label, modes) for label, modes in sets if modes is not None]
    top = max(modes.frequency[-1] for _, modes in sets) / 1e3
    edges = np.linspace(0, 1.05 * top, 90)
    columns = {"bin_low_kHz": edges[:-1], "bin_high_kHz": edges[1:]}
    for (label, modes), style in zip(sets, ("-", "--"), strict=False):
        f = np.sort(modes.frequency) / 1e3
        axes[0].plot(f, np.arange(1, len(f) + 1) / len(f), ls=style, color="k", label=label)
        density = np.histogram(f, edges)[0] / (len(f) * np.diff(edges))
        axes[1].stairs(
            density, edges, ls=style, color="k" if style == "-" else "#c05000", label=label
        )
        columns[f"density_{label.replace(' ', '_')}_per_kHz"] = density
    axes[0].set_ylabel("cumulative share")
    axes[1].set(ylabel="density (1/kHz)", xlabel="natural frequency (kHz)")
    for ax in axes:
        ax.axvline(case.chain.low_pass_frequency / 1e3, color="0.5", ls=":", label="Eq. 10")
        ax.legend()
    return columns


def chi_z(ax: Axes, case: Products) -> Columns:
    """Correlation index chi_z (Eq. 2) against natural frequency."""
    modes = case.modes
    f = modes.frequency / 1e3
    ax.plot(f, modes.chi_z, ".", ms=1.5, color="0.6", label="all modes", rasterized=True)
    if modes.resonance_frequency is not None:
        f_r = modes.resonance_frequency / 1e3
        ax.plot(f_r, np.ones(len(f_r)), "k|", ms=7, label="P resonances")
    ax.set(xlabel="natural frequency (kHz)", ylabel=r"$\chi_z$", ylim=(-0.03, 1.08))
    ax.legend(loc="center right")
    return {"frequency_kHz": f, "chi_z": modes.chi_z}


def mode_shapes(axes: np.ndarray, case: Products) -> Columns:
    """Shapes of the P resonances r = 1, 2, 5, 10, 50, 200 along the chain."""
    modes, chain = case.modes, case.chain
    if modes.resonance_shape is None or len(modes.resonance_shape) < 1:
        raise InputError(f"{case.path('modes')}: has no resonance shapes; make the modes again")
    shapes = modes.resonance_shape
    z = 1e3 * (chain.wall_gap + chain.distance * np.arange(shapes.shape[1]))
    columns = {"distance_mm": z}
    orders = [min(r, len(shapes)) for r in (1, 2, 5, 10, 50, 200)]
    for ax, r in zip(axes, orders, strict=True):
        shape = shapes[r - 1] / np.abs(shapes[r - 1]).max()
        ax.plot(z, shape * (np.sign(shape[0]) or 1), "k-", marker=".", ms=2, lw=0.6)
        ax.set_title(
            f"r = {r}, f = {modes.resonance_frequency[r - 1] / 1e3:.4g} kHz",
            fontsize=8,
            loc="left",
            pad=2,
        )
        ax.set(ylim=(-1.2, 1.2), ylabel=r"$u_z$ (-)")
        ax.tick_params(labelbottom=ax is axes[-1])
        columns[f"r_{r}"] = shape
    axes[-1].set_xlabel("distance from the source wall (mm)")
    return columns


def power_law(stress: np.ndarray, value: np.ndarray) -> float:
    """Exponent b of value = a stress^b by least squares of the logarithms; NaN for one point."""
    known = np.isfinite(value)
    if known.sum() < 2:
        return np.nan
    return float(np.polyfit(np.log(stress[known]), np.log(value[known]), 1)[0])


def stress_rows(cases: list[Products]) -> Columns:
    """Stress (Pa), V_P (m/s) and f_low-pass (Hz) of each case by theory, modes and signals."""
    for case in cases:
        if not float(case.network.study.get("stress", 0)) > 0:
            raise InputError(f"{case.path('network')}: study has no stress; export it again")
    columns = {"stress_Pa": np.array([float(case.network.study["stress"]) for case in cases])}
    table = {"theory": [], "modal": [], "yade": []}
    for case in cases:
        chain, modes = case.chain, case.modes
        table["theory"].append((chain.velocity, chain.low_pass_frequency))
        found = None
        if modes is not None and modes.resonance_shape is not None:
            found = disp.mode_dispersion(
                modes.resonance_frequency, modes.resonance_shape, chain.distance
            )
        seen = None if case.signals is None else disp.chain_dispersion(case.signals)
        for name, result in (("modal", found), ("yade", seen)):
            pair = (result.velocity, result.low_pass_frequency) if result else (np.nan, np.nan)
            table[name].append(pair)
    for name, pairs in table.items():
        columns[f"velocity_{name}_m_per_s"], columns[f"f_low_pass_{name}_Hz"] = np.array(pairs).T
    return columns


def stress_dependence(axes: np.ndarray, cases: list[Products]) -> Columns:
    """V_P and f_low-pass against stress, with the fitted exponents."""
    columns = stress_rows(cases)
    stress = columns["stress_Pa"]
    for ax, key, label in (
        (axes[0], "velocity_{}_m_per_s", "$V_P$ (m/s)"),
        (axes[1], "f_low_pass_{}_Hz", "$f_{low-pass}$ (Hz)"),
    ):
        for name, marker, size in (("theory", "s", 9), ("modal", "o", 6), ("yade", "x", 6)):
            value = columns[key.format(name)]
            if np.isfinite(value).any():
                exponent = power_law(stress, value)
                text = name + (f", exponent {exponent:.4f}" if np.isfinite(exponent) else "")
                ax.loglog(stress / 1e3, value, marker, mfc="none", ms=size, label=text)
                columns["exponent_" + key.format(name)] = np.array([exponent])
        ax.set_ylabel(label)
        ax.legend()
    axes[-1].set_xlabel("stress (kPa)")
    return columns
