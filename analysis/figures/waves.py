"""Figures of a wave run: signals, space-time, spectrum against distance, dispersion."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from analysis import dispersion as disp
from analysis.exact_chain import exact_twin
from analysis.lowpass import spectrum_with_distance, threshold_frequency
from analysis.products import Products
from modal.lattice import dispersion as eq_9

Columns = dict[str, np.ndarray]


def signals(axes: np.ndarray, case: Products) -> Columns:
    """Displacement at 10, 50 and 100 diameters from the source wall, beside the exact chain."""
    record = case.signals
    twin = exact_twin(record, case.chain)
    diameter = 2 * float(case.network.radius.mean())
    depth = (record.chain_position - case.network.wall_position[0]) / diameter
    columns = {"time_ms": 1e3 * record.time}
    for ax, wanted in zip(axes, (10, 50, 100), strict=True):
        n = int(np.argmin(np.abs(depth - wanted)))
        u = 1e9 * record.chain_displacement[:, n]
        ax.plot(columns["time_ms"], u, label=record.producer, color="0.55", lw=2.2, ls="-")
        columns[f"u_{wanted}D_nm"] = u
        if twin.chain_displacement.shape[1] == len(depth):
            exact = 1e9 * twin.chain_displacement[:, n]
            ax.plot(columns["time_ms"], exact, label="exact chain", color="k", ls="--", lw=0.9)
            columns[f"u_{wanted}D_exact_nm"] = exact
        ax.set_ylabel("$u_z$ (nm)")
        ax.set_title(f"{depth[n]:.1f} D from the source wall", fontsize=9, loc="left")
    axes[0].legend(loc="upper right")
    axes[-1].set_xlabel("time (ms)")
    return columns


def space_time(ax: Axes, case: Products) -> Columns:
    """Displacement over distance and time, with the line of the long-wave velocity."""
    record = case.signals
    z = 1e3 * (record.chain_position - case.network.wall_position[0])
    step = max(1, len(record.time) // 800)
    t = 1e3 * record.time[::step]
    u = 1e9 * record.chain_displacement[::step]
    top = np.abs(u).max()
    mesh = ax.pcolormesh(z, t, u, cmap="RdGy_r", vmin=-top, vmax=top, rasterized=True)
    ax.figure.colorbar(mesh, ax=ax, label="$u_z$ (nm)")
    line = 1e3 * z / (1e3 * case.chain.velocity)
    ax.plot(z, line, color="k", ls="--", label="$V_P$ of Eq. 6")
    ax.set(xlabel="distance from the source wall (mm)", ylabel="time (ms)", ylim=(t[0], t[-1]))
    ax.legend(loc="upper left")
    return {"distance_mm": z, "long_wave_arrival_ms": line}


def spectrum_distance(ax: Axes, case: Products) -> Columns:
    """Spectral amplitude of the chain over distance, with the threshold frequencies."""
    record = case.signals
    z = 1e3 * (record.chain_position - case.network.wall_position[0])
    frequency, amplitude = spectrum_with_distance(record)
    keep = frequency < 1.5 * case.chain.low_pass_frequency
    f = frequency[keep] / 1e3
    shade = 20 * np.log10(np.maximum(amplitude[keep], 1e-3))
    mesh = ax.pcolormesh(z, f, shade, rasterized=True)
    ax.figure.colorbar(mesh, ax=ax, label="amplitude (dB of the maximum)")
    columns = {"distance_mm": z}
    for percent, style in ((2, "-"), (1, ":")):
        edge = threshold_frequency(frequency, amplitude, percent / 100) / 1e3
        ax.plot(z, edge, color="#c05000", ls=style, label=f"{percent} % threshold")
        columns[f"f_low_pass_{percent}pct_kHz"] = edge
    ax.axhline(case.chain.low_pass_frequency / 1e3, color="#0060a8", ls="--", label="Eq. 10")
    ax.set(xlabel="distance from the source wall (mm)", ylabel="frequency (kHz)", ylim=(0, f[-1]))
    ax.grid(False)
    ax.legend(loc="lower left")
    return columns


def dispersion(ax: Axes, case: Products) -> Columns:
    """Frequency over wavenumber: f-k map, its unbiased ridge, resonances and Eq. 9."""
    chain, record, modes = case.chain, case.signals, case.modes
    kappa = np.linspace(0, 1, 101) * np.pi / chain.distance
    theory = eq_9(kappa, chain.stiffness, chain.mass, chain.distance) / (2e3 * np.pi)
    columns = {"kappa_per_m": kappa, "theory_kHz": theory}
    if record is not None:
        f, k, amplitude = disp.fk_map(record)
        keep = f < 1.15e3 * theory.max()
        shade = 20 * np.log10(np.maximum(amplitude[keep], 1e-3))
        mesh = ax.pcolormesh(k, f[keep] / 1e3, shade, rasterized=True, alpha=0.6)
        ax.figure.colorbar(mesh, ax=ax, label=f"f-k amplitude, {record.producer} (dB)")
    ax.plot(kappa, theory, color="k", ls="-", label="theory (Eq. 9)")
    if modes is not None and modes.resonance_frequency is not None:
        f_r, k_r = modes.resonance_frequency / 1e3, modes.resonance_wavenumber
        ax.plot(
            k_r[4::10],
            f_r[4::10],
            "o",
            mfc="w",
            color="#0060a8",
            ms=4.5,
            label="resonances (every tenth)",
        )
        columns |= {"resonance_kappa_per_m": k_r, "resonance_kHz": f_r}
    if record is not None:
        ridge = disp.chain_dispersion(record).omega(kappa) / (2e3 * np.pi)
        inside = kappa <= 0.98 * kappa[-1]
        ax.plot(
            kappa[inside],
            ridge[inside],
            color="#c05000",
            ls="--",
            lw=2,
            label=f"{record.producer}, damped transform",
        )
        columns["signals_kHz"] = ridge
    ax.set(xlabel=r"wavenumber $\kappa$ (rad/m)", ylabel="frequency (kHz)")
    ax.set(xlim=(0, kappa[-1]), ylim=(0, 1.12 * theory.max()))
    ax.grid(False)
    ax.legend(loc="lower right")
    return columns
