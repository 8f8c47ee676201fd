"""The comparison of a crystal: each quantity by theory, eigenmodes, linear wave and YADE.

Theory, modes and the linear wave are those of the springs, without the pre-stress of the contacts;
what that changes of V_P has a row of its own. The linear wave is cut where the run ends.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from analysis.estimators import damped_transform as disp
from analysis.estimators import low_pass, transfer
from analysis.estimators.layer_lattice import LayerLattice, exact_twin, lattice_signals
from analysis.estimators.resonances import mode_velocities
from analysis.estimators.travel_time import arrival_times, travelled
from analysis.measuring import Measuring
from analysis.quantities.gain import gain_of
from analysis.quantities.spectrum import modal_dispersion
from analysis.quantities.velocity import chain
from analysis.rows import row_of
from modal.waves.signals import Signals

COLUMNS = ("theory", "modal", "linear", "yade")
SPECTRUM = ("f_min_khz", "f_max_khz", "f_1_khz", "resonances")
OF_ROW = {
    "theory": {"band_edge_theory_khz": "band_edge_theory_khz", "velocity": "v_p_theory_m_per_s"},
    "modal": {"band_edge_theory_khz": "band_edge_modes_khz", "velocity": "v_p_modes_fitted_m_per_s"}
    | {name: name for name in (*SPECTRUM, "void_ratio", "translations_only_over_edge")},
} | {
    producer: {
        "band_edge_theory_khz": f"band_edge_{producer}_khz",
        "velocity": f"v_p_long_waves_{producer}_m_per_s",
        "lambda_edge_yade_over_d": f"lambda_edge_{producer}_over_d",
    }
    for producer in ("linear", "yade")
}
"""By column: rows, and the number of the case (`analysis.rows.Row`) that they show."""
LAYERS = 100, 150
"""Whose own threshold frequencies have rows."""
BIASED = "paper's rule; theory: the rule on exact signals"
Values = dict[str, dict[str, float]]


def compare(m: Measuring) -> list[list[str]]:
    """Rows for one crystal: id, quantity, unit, what `COLUMNS` has, as far as it is known; note."""
    values: Values = defaultdict(dict)
    notes: dict[str, str] = {}
    for column, names in OF_ROW.items():
        for key, name in names.items():
            values[key][column] = row_of(m).value(name)
    _theory(m, values)
    _modes(m, values, notes)
    for column, record in (("linear", m.cut("linear")), ("yade", m.yade)):
        if record is not None:
            _waves(m, values, column, record)
    full = m.linear_wave(particles=False, pre_stress="full")
    values["velocity_full"]["linear"] = disp.chain_dispersion(full).velocity
    _gains(m, values, notes)
    lines = []
    for key, (text, unit, note) in _texts(_inside(m.lattice)).items():
        numbers = [values[key].get(name, np.nan) for name in COLUMNS]
        shown = [f"{v:.6g}" if np.isfinite(v) else "" for v in numbers]
        lines += [[key, text, unit, *shown, notes.get(key, note)]] if any(shown) else []
    return lines


ROWS = """
f_min_khz | lowest natural frequency | kHz
f_max_khz | highest natural frequency | kHz
f_1_khz | first P resonance | kHz
f_200_khz | last P resonance | kHz
resonances | number of P resonances | 1
band_edge_theory_khz | f_low-pass | kHz | theory Eq. 10; others: band edge, unbiased
velocity | V_P, long waves | m/s | theory Eq. 6; others: slope at long waves, unbiased
lambda_edge_yade_over_d | lambda_low-pass / D, band edge | 1 | \
theory Eq. 7; modal: last resonance; others: where the waves turn round
void_ratio | void ratio, wall to wall | 1 | of the contact network
rms | dispersion, RMS deviation from Eq. 9 | % | up to kappa l = 0.9 pi
phase | phase velocity at {inside:g} kHz | m/s
group | group velocity at {inside:g} kHz | m/s
translations_only_over_edge | f_max without rotations / f_low-pass | 1
first_peak | V_P, first peaks, middle half | m/s | {biased}
arrival | V_P, 5 % arrival, middle half | m/s | {biased}
{low_pass}
walls | phase velocity at {inside:g} kHz, walls | m/s
velocity_full | V_P, long waves, with pre-stress | m/s | \
exact tangent of the contact law, not the springs alone
gain_f | gain factor, first maximum | kHz
gain | gain factor at its first maximum | 1
"""
"""A row a line: id, quantity, unit, and a note."""


def _texts(inside: float) -> dict[str, list[str]]:
    """Rows by id: quantity, unit, note; `inside` the band is a frequency, Hz."""
    stretch = "at {:g}-{:g} % of the length".format(*(100 * p for p in low_pass.STRETCH[True]))
    places = {"": stretch} | {f"_{layer}": f"layer {layer}" for layer in LAYERS}
    rules = [
        f"f_low_pass_{percent}_khz{end} | f_low-pass, {percent} % rule, {place} | kHz | {BIASED}"
        for percent in (2, 1)
        for end, place in places.items()
    ]
    told = {"inside": inside / 1e3, "biased": BIASED, "low_pass": "\n".join(rules)}
    lines = [line.split(" | ") for line in ROWS.format(**told).strip().splitlines()]
    return {key: [*cells, ""][:3] for key, *cells in lines}


def _inside(lattice: LayerLattice) -> float:
    """A frequency, Hz, of one digit, about a third of the way to the end of the band."""
    return float(f"{0.36 * lattice.low_pass_frequency:.0e}")


def _theory(m: Measuring, values: Values) -> None:
    lattice, edge = m.lattice, m.lattice.low_pass_frequency
    omega, _ = lattice.eigenmodes()
    half = np.arcsin(min(1.0, _inside(lattice) / edge))
    for key, value in {
        "f_1_khz": omega[0] / 2e3 / np.pi,
        "f_200_khz": omega[-1] / 2e3 / np.pi,
        "resonances": lattice.layers,
        "lambda_edge_yade_over_d": 2 * lattice.velocity / (np.pi * edge) / m.diameter,  # Eq. 7
        "phase": lattice.velocity * np.sin(half) / half,
        "group": lattice.velocity * np.cos(half),
    }.items():
        values[key]["theory"] = value


def _modes(m: Measuring, values: Values, notes: dict[str, str]) -> None:
    modes, lattice = m.case.read("modes"), m.lattice
    if modes is None or modes.resonance_frequency is None:
        return
    values["rms"]["modal"] = _off_theory(lattice, modal_dispersion(m))
    kappa = float(np.arccos(disp.mode_cosine(modes.resonance_shape)[-1])) / lattice.distance
    values["lambda_edge_yade_over_d"]["modal"] = 2 * np.pi / kappa / m.diameter
    f = modes.resonance_frequency
    values["f_200_khz"]["modal"] = f[-1] / 1e3
    speeds = mode_velocities(f, modes.resonance_wavenumber)
    for key, speed in zip(("phase", "group"), speeds, strict=True):
        values[key]["modal"] = transfer.at_frequency(f, speed, _inside(lattice))
        notes[key] = "modal: lambda = 2 L / r (Eq. 4)"


def _off_theory(lattice: LayerLattice, measured: disp.Dispersion) -> float:
    """Deviation of a dispersion relation from Eq. 9, %."""
    return 100 * disp.rms_deviation(measured, lattice.velocity, lattice.low_pass_frequency)


def _waves(m: Measuring, values: Values, column: str, record: Signals) -> None:
    measured = chain(m, column)
    values["rms"][column] = _off_theory(m.lattice, measured)
    omega, step = 2 * np.pi * _inside(m.lattice), 1e-3
    here, near = np.arccos(measured.cosine(omega * np.array([1, 1 + step]))) / measured.distance
    values["phase"][column], values["group"][column] = omega / here, omega * step / (near - here)
    twin, wall = exact_twin(record, m.lattice), float(m.network.wall_position[0])
    for name, wave, origin in (("theory", twin, 0.0), (column, record, wall)):
        for key, value in _by_rule(m, wave, origin).items():
            values[key][name] = value


def _by_rule(m: Measuring, record: Signals, origin: float) -> dict[str, float]:
    """What the paper's rules read of a record, whose source wall is at `origin`, m."""
    length, lattice = m.network.length, m.lattice
    found = {
        "first_peak": travelled(record, origin, length)[0],
        "arrival": travelled(record, origin, length, arrival_times)[0],
    }
    highest = low_pass.REACH[True] * lattice.velocity / m.diameter
    curves = low_pass.threshold_curves(
        *low_pass.spectra(record.time, record.chain_displacement, highest)
    )
    for percent, row in zip((2, 1), curves, strict=False):
        key, distance = f"f_low_pass_{percent}_khz", record.chain_position - origin
        found[key] = low_pass.at_stretch(distance, row, length, low_pass.STRETCH[True]).value / 1e3
        found |= {f"{key}_{layer}": row[layer] / 1e3 for layer in LAYERS if layer < len(row)}
    if (walls := transfer.wall_velocity(record, length)) is not None:
        found["walls"] = transfer.at_frequency(walls[0], walls[1], _inside(lattice))
    return found


def _gains(m: Measuring, values: Values, notes: dict[str, str]) -> None:
    passage = m.network.length / m.lattice.velocity
    duration = transfer.TRAVELS * passage
    time = np.arange(0, duration * (1 + 1e-3), 1e-6)  # ten samples of the pulse of 100 kHz
    gains: dict[str, transfer.Gain | None] = {"linear": gain_of(m)}
    gains["theory"] = transfer.gain_factor(lattice_signals(m.lattice, time), duration)
    gains["yade"] = transfer.gain_factor(m.yade, duration) if m.yade else None
    for column, found in gains.items():
        if found is not None:
            same = found.undamped(passage)
            note = f"resolution {found.resolution:.0f} Hz: an undamped column has {same:.3g}"
            frequency, height = found.first_maximum()
            for key, value in (("gain_f", frequency / 1e3), ("gain", height)):
                values[key][column] = value
                notes.setdefault(key, note)
