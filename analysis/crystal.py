"""The comparison of a crystal: each quantity by theory, eigenmodes, linear wave and YADE.

Theory, modes and the linear wave are those of the springs, without the pre-stress of the contacts;
what that changes of V_P has a row of its own. The linear wave is cut where the run ends. What a
rule reads of a record, theory has where the rule reads the exact lattice's signals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from analysis.estimators import damped_transform as disp
from analysis.estimators import low_pass, transfer
from analysis.estimators.layer_lattice import exact_twin, lattice_signals
from analysis.estimators.travel_time import arrival_times, travelled
from analysis.measuring import Measuring
from analysis.quantities.gain import gain_of
from analysis.quantities.passband import band_edge, edge_wavelength, edges
from analysis.quantities.spectrum import modal_dispersion
from analysis.quantities.velocity import chain, first_peak, longest
from analysis.rows import row_of

COLUMNS = ("theory", "modal", "linear", "yade")
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
translations_only_over_edge | f_max without rotations / f_low-pass | 1
first_peak | V_P, first peaks, middle half | m/s | {biased}
arrival | V_P, 5 % arrival, middle half | m/s | {biased}
f_low_pass_2_khz | f_low-pass, 2 % rule, {stretch} | kHz | {biased}
f_low_pass_1_khz | f_low-pass, 1 % rule, {stretch} | kHz | {biased}
velocity_full | V_P, long waves, with pre-stress | m/s | \
exact tangent of the contact law, not the springs alone
gain_f | gain factor, first maximum | kHz | {resolution}
gain | gain factor at its first maximum | 1 | {resolution}
"""
"""A row a line: id, quantity, unit, and a note."""
OF_MODES = {
    **{name: name for name in ("f_min_khz", "f_max_khz", "f_1_khz", "resonances", "void_ratio")},
    "translations_only_over_edge": "translations_only_over_edge",
    "band_edge_theory_khz": "band_edge_modes_khz",
    "velocity": "v_p_modes_fitted_m_per_s",
}
"""Rows, and the number of the case (`analysis.rows.Row`) that its modes give."""
Numbers = dict[str, float]


def compare(m: Measuring) -> list[list[str]]:
    """Rows for one crystal: id, quantity, unit, what `COLUMNS` has, as far as it is known; note."""
    gains, resolution = _gains(m)
    stretch = "at {:g}-{:g} % of the length".format(*(100 * p for p in low_pass.STRETCH[True]))
    biased = "paper's rule; theory: the rule on exact signals"
    told = ROWS.format(biased=biased, stretch=stretch, resolution=resolution)
    waves = {name: _of_wave(m, name) for name in ("linear", "yade") if name == "linear" or m.yade}
    values = {"theory": _theory(m), "modal": _modes(m), "yade": {}} | waves
    lines = []
    for key, *words in (line.split(" | ") for line in told.strip().splitlines()):
        numbers = [(values[name] | gains.get(name, {})).get(key, np.nan) for name in COLUMNS]
        shown = [f"{v:.6g}" if np.isfinite(v) else "" for v in numbers]
        text, unit, note = [*words, ""][:3]
        lines += [[key, text, unit, *shown, note]] if any(shown) else []
    return lines


def _theory(m: Measuring) -> Numbers:
    """Of the lattice, and by the rules on its exact signals at the times of the record."""
    lattice, (omega, _) = m.lattice, m.lattice.eigenmodes()
    twin, wall = exact_twin(m.yade or m.cut("linear"), lattice), float(m.network.wall_position[0])
    exact = Measuring(m.network, [replace(twin, chain_position=wall + twin.chain_position)])
    exact.linear = m.linear
    return {name: of(exact, "yade") for name, of in BY_RULE.items()} | {
        "f_1_khz": omega[0] / 2e3 / np.pi,
        "f_200_khz": omega[-1] / 2e3 / np.pi,
        "resonances": lattice.layers,
        "band_edge_theory_khz": lattice.low_pass_frequency / 1e3,
        "velocity": lattice.velocity,
        # Eq. 7
        "lambda_edge_yade_over_d": 2
        * lattice.velocity
        / (np.pi * lattice.low_pass_frequency)
        / m.diameter,
    }


def _modes(m: Measuring) -> Numbers:
    found, modes = (
        {key: row_of(m).value(name) for key, name in OF_MODES.items()},
        m.case.read("modes"),
    )
    if modes is not None and modes.resonance_frequency is not None:
        kappa = np.arccos(disp.mode_cosine(modes.resonance_shape)[-1]) / m.lattice.distance
        found["lambda_edge_yade_over_d"] = 2 * np.pi / float(kappa) / m.diameter
        found["f_200_khz"] = modes.resonance_frequency[-1] / 1e3
        found["rms"] = _off_theory(m, modal_dispersion(m))
    return found


def _off_theory(m: Measuring, measured: disp.Dispersion) -> float:
    """Deviation of a dispersion relation from Eq. 9, %."""
    return 100 * disp.rms_deviation(measured, m.lattice.velocity, m.lattice.low_pass_frequency)


def _arrival(m: Measuring, key: str) -> float:
    wall = float(m.network.wall_position[0])
    return travelled(m.cut(key), wall, m.network.length, arrival_times)[0]


BY_RULE: dict[str, Callable[[Measuring, str], float]] = {
    "first_peak": lambda m, key: first_peak(m, key).value,
    "arrival": _arrival,
    "f_low_pass_2_khz": lambda m, key: edges(m, key)[0].value / 1e3,
    "f_low_pass_1_khz": lambda m, key: edges(m, key)[1].value / 1e3,
}
OF_WAVE = BY_RULE | {
    "band_edge_theory_khz": lambda m, key: band_edge(m, key) / 1e3,
    "velocity": lambda m, key: longest(m, key).value,
    "lambda_edge_yade_over_d": edge_wavelength,
    "rms": lambda m, key: _off_theory(m, chain(m, key)),
}
"""Rows, and how a record gives them."""


def _of_wave(m: Measuring, key: str) -> Numbers:
    found = {name: of(m, key) for name, of in OF_WAVE.items()}
    if key == "linear":
        full = m.linear_wave(particles=False, pre_stress="full")
        found["velocity_full"] = disp.chain_dispersion(full).velocity
    return found


def _gains(m: Measuring) -> tuple[dict[str, Numbers], str]:
    """The first maximum of the gain, by column; its resolution, in words."""
    passage = m.network.length / m.lattice.velocity
    duration = transfer.TRAVELS * passage
    time = np.arange(0, duration * (1 + 1e-3), 1e-6)  # ten samples of the pulse of 100 kHz
    gains: dict[str, transfer.Gain | None] = {"linear": gain_of(m)}
    gains["theory"] = transfer.gain_factor(lattice_signals(m.lattice, time), duration)
    gains["yade"] = transfer.gain_factor(m.yade, duration) if m.yade else None
    each = {name: gain.first_maximum() for name, gain in gains.items() if gain is not None}
    found = {name: {"gain_f": f / 1e3, "gain": height} for name, (f, height) in each.items()}
    line, same = gain_of(m).resolution, gain_of(m).undamped(passage)
    return found, f"resolution {line:.0f} Hz: an undamped column has {same:.3g}"
