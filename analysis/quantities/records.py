"""What the files of a case give: by its run and by the linear wave, by modes, theory and spectra.

On request, as each needs files that most packings do not have. A number has one producer in its
name where there are two: `yade`, the recorded run, or `linear`, the wave of the springs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from analysis.estimators.damped_transform import mode_dispersion
from analysis.estimators.low_pass import THRESHOLDS
from analysis.measures import Measures
from analysis.measures.shear_wave import ShearWave
from analysis.measuring import Measuring
from analysis.quantities.registry import QUANTITIES, on_request
from analysis.value import NOTHING, Value, estimate
from modal.modes.mode_set import ModeSet

LOW, HIGH = 0.05, 0.07
"""In parts of the highest frequency: below the one modes move along z together, above the other no
more. The paper has 10 and 15 kHz of 216."""
PERCENT = {0.02: "2", 0.01: "1", 0.03: "3"}
"""Thresholds of f_low-pass, and how their quantities are called."""
MAPS = {"": ("chain", "map"), "own_": ("chain", "own"), "layers_": ("layers", "map")}
"""Rules of f_low-pass by their part of a name: whose motion, relative to which maximum."""
PRODUCERS = "yade", "linear"

Number = Callable[[Measures], float | Value]


def natural_frequency(frequency: float, *lists: ModeSet | None) -> Value:
    """A natural frequency, Hz; its error from the residual in the list that holds it.

    |A v - omega^2 v| of a unit vector bounds the distance of omega^2 from an eigenvalue, for A is
    symmetric: half the relative residual is that of the frequency.
    """
    for modes in lists:
        if modes is not None and frequency in modes.frequency:
            at = int(np.argmax(modes.frequency == frequency))
            return estimate(frequency, 0.5 * frequency * float(modes.residual[at]))
    return estimate(frequency)


def _of_crystal(m: Measures, name: str) -> float:
    return float(getattr(m.case.lattice, name)) if m.case.is_crystal else np.nan


def _modal_edge(m: Measures) -> float:
    modes = m.case.modes
    if not m.case.is_crystal or modes is None or modes.resonance_shape is None:
        return np.nan
    f, shape = modes.resonance_frequency, modes.resonance_shape
    return mode_dispersion(f, shape, m.case.lattice.distance).low_pass_frequency


def _lowest(modes: ModeSet | None) -> Value:
    return NOTHING if modes is None else natural_frequency(float(modes.frequency[0]), modes)


def _resonance(m: Measures, r: int) -> Value:
    """The r-th P resonance: of its mode, or of the structure factor's ridge."""
    f = m.resonances[0]
    return natural_frequency(float(f[r - 1]), m.case.modes) if len(f) >= r else NOTHING


def _width_power(m: Measures) -> Value:
    """Power of the frequency that the ridge's width follows about f_low-pass of the linear wave."""
    if m.scattering is None:
        return NOTHING
    law = m.scattering.power(m.band)
    return estimate(law.exponent, law.error)


def _translations(m: Measures) -> float:
    only = m.case.translations
    if only is None or not m.case.is_crystal:
        return np.nan
    return float(only.frequency[-1] / m.case.lattice.low_pass_frequency)


VALUES: dict[str, tuple[str, str, Number]] = {
    "particles": ("1", "spheres", lambda m: m.case.network.n_particles),
    "length_over_d": ("1", "length, D", lambda m: m.case.network.length / m.case.diameter),
    "width_over_d": (
        "1",
        "width, D",
        lambda m: m.case.network.cell_size[0] / m.case.diameter,
    ),
    "v_p_first_peaks_yade": ("m/s", "V_P of first peaks, run", lambda m: m.yade_first_peak),
    "v_p_first_peaks_linear": ("m/s", "V_P of first peaks", lambda m: m.first_peak),
    "v_p_first_peaks_all_columns": ("m/s", "the same, mean of columns", lambda m: m.columns),
    "v_p_long_waves_yade": ("m/s", "V_P of the longest waves, run", lambda m: m.yade_long_wave),
    "v_p_long_waves_linear": ("m/s", "V_P of the longest waves", lambda m: m.long_wave),
    "v_p_modes_first": ("m/s", "2 L f_1 of the first resonance", lambda m: m.modal_first),
    "v_p_modes_eq_4": ("m/s", "V_P of modes, kappa = pi r / L", lambda m: m.modal),
    "v_p_modes_fitted": ("m/s", "V_P of modes, kappa fitted", lambda m: m.modal_fitted),
    "v_p_walls_phase": ("m/s", "phase velocity wall to wall, L / 5", lambda m: m.walls[0]),
    "v_p_walls_group": ("m/s", "group velocity wall to wall, L / 5", lambda m: m.walls[1]),
    "v_p_emt_contacts": ("m/s", "V_P of even strains, contacts", lambda m: m.effective[0]),
    "v_p_emt_means": ("m/s", "V_P of even strains, means of e and Z", lambda m: m.effective[1]),
    "v_p_theory": ("m/s", "V_P of the lattice", lambda m: _of_crystal(m, "velocity")),
    "f_max": (
        *("Hz", "highest natural frequency, of a list where there is one"),
        lambda m: natural_frequency(m.f_max, m.case.highest, m.case.modes),
    ),
    "f_max_spheres": ("1", "spheres that move in that mode", lambda m: m.highest_seat[0]),
    "f_max_contacts": ("1", "contacts of the first of them", lambda m: m.highest_seat[1]),
    "f_min": ("Hz", "lowest natural frequency", lambda m: _lowest(m.case.modes)),
    "f_1": ("Hz", "first P resonance", lambda m: _resonance(m, 1)),
    "f_200": (
        *("Hz", "200th P resonance of a crystal"),
        lambda m: _resonance(m, 200) if m.case.is_crystal else NOTHING,
    ),
    "resonances_found": (
        *("1", "number of P resonances"),
        lambda m: len(m.resonances[0]) if m.case.modes else np.nan,
    ),
    "band_edge_linear": ("Hz", "end of a crystal's band", lambda m: m.band_edge),
    "band_edge_yade": ("Hz", "end of a crystal's band, run", lambda m: m.yade_band_edge),
    "band_edge_modes": ("Hz", "end of a crystal's band, modes", _modal_edge),
    "band_edge_theory": (
        *("Hz", "end of a crystal's band, lattice"),
        lambda m: _of_crystal(m, "low_pass_frequency"),
    ),
    "lambda_edge_linear_over_d": ("1", "wavelength there, D", lambda m: m.edge_wavelength[0]),
    "lambda_edge_yade_over_d": ("1", "the same of the run", lambda m: m.edge_wavelength[1]),
    "translations_only_over_edge": ("1", "highest mode without rotations over it", _translations),
    "chi_z_low": (
        *("1", "largest chi_z of the chain's modes below 0.05 f_max"),
        lambda m: m.largest_chi(0.0, LOW * m.f_max, chain=True)[0],
    ),
    "chi_z_high": (
        *("1", "largest chi_z of the chain's modes above 0.07 f_max"),
        lambda m: m.largest_chi(HIGH * m.f_max, np.inf, chain=True)[0],
    ),
    "chi_z_high_all": (
        *("1", "the same of all spheres"),
        lambda m: m.largest_chi(HIGH * m.f_max, np.inf, chain=False)[0],
    ),
    "chi_z_high_mean": ("1", "mean chi_z there", lambda m: m.mean_chi(HIGH * m.f_max, np.inf)),
    "gain_maximum": ("1", "largest gain", lambda m: float(np.max(m.gain.gain))),
    "gain_resolution": ("Hz", "width of its lines", lambda m: m.gain.resolution),
    "free_path_at_f_low_pass_over_d": ("1", "mean free path there, D", lambda m: m.free_path),
    "ridge_width_power": ("1", "power of f in the ridge's width there", _width_power),
    "ioffe_regel_of_ridge": (
        *("Hz", "the Ioffe-Regel frequency of a kept structure factor"),
        lambda m: np.nan if m.scattering is None else m.scattering.limit,
    ),
    "excess_at_a_tenth": ("1", "D f_max^3 / f^2 at 0.1 f_max", lambda m: m.excess.at_a_tenth),
    "excess_largest": ("1", "largest D f_max^3 / f^2", lambda m: m.excess.peak),
    "excess_largest_at": ("Hz", "where it is", lambda m: m.excess.peak_frequency),
    "energy_drift": ("1", "drift of the run's energy", lambda m: m.of_balance("drift")),
    "energy_to_friction": ("1", "of it to friction", lambda m: m.of_balance("friction")),
    "energy_gap": ("1", "gap to the wall's work", lambda m: m.of_balance("gap")),
    "contacts_opened": ("1", "contacts that opened", lambda m: m.of_balance("opened")),
    "contacts_slid": ("1", "contacts that slid", lambda m: m.of_balance("slid")),
    "yade_less_linear_layers": ("1", "run less linear wave, relative", lambda m: m.off_linear),
    "record_passages": ("1", "passages of the record", lambda m: m.passband.common),
}
"""Name: unit, what it is, and how it is measured."""


def _low_pass(producer: str, rule: str, threshold: float) -> Callable[[Measuring], Value]:
    def measure(packing: Measuring) -> Value:
        edge = packing.measures.edges(producer, *MAPS[rule])[THRESHOLDS.index(threshold)]
        caveats = (edge.why,) if edge.why else () if edge.flat else ("no plateau",)
        return Value(edge.value, "Hz", {"fit": edge.error}, caveats)

    return measure


def _wavelength(producer: str, rule: str, threshold: float) -> Number:
    """lambda / D at the frequency of a rule, with what the frequency's error makes of it."""

    def measure(m: Measures) -> Value:
        edge = m.edges(producer, *MAPS[rule])[THRESHOLDS.index(threshold)]
        record = m.case.signals if producer == "yade" else m.case.wave
        if record is None or not np.isfinite(edge.value):
            return NOTHING
        at = [m.wavelength_at(edge.value + sign * edge.error, record) for sign in (0, -1, 1)]
        here, low, high = (value / m.case.diameter for value in at)
        return estimate(here, 0.5 * abs(low - high))

    return measure


def _of_shear(producer: str, number: Callable[[ShearWave], Value]) -> Number:
    def measure(m: Measures) -> Value:
        found = [wave for wave in m.shear if wave.record.producer == producer]
        return number(found[0]) if found else NOTHING

    return measure


def _shear_edge(wave: ShearWave) -> Value:
    return estimate(wave.low_pass.value, wave.low_pass.error)


def _measured(unit: str, number: Number) -> Callable[[Measuring], Value]:
    def measure(packing: Measuring) -> Value:
        found = number(packing.measures)
        return replace(found if isinstance(found, Value) else estimate(found), unit=unit)

    return measure


LOW_PASS: dict[str, tuple[str, str]] = {}
"""Thresholds' quantities: name of f_low-pass, and of lambda / D there, by NUMBER_RULEPRODUCER."""
SHEAR: dict[str, str] = {}
"""Quantities of S-waves, and whose record they need."""
for _producer in PRODUCERS:
    _by = "run" if _producer == "yade" else "linear wave"
    for _rule, (_whose, _reference) in MAPS.items():
        for _threshold, _percent in PERCENT.items():
            _key, _of = f"{_percent}_{_rule}{_producer}", (_producer, _rule, _threshold)
            _text = f"{_percent} % of the maximum, {_whose}, {_reference}; {_by}"
            LOW_PASS[_key] = f"f_low_pass_{_key}", f"lambda_{_key}_over_d"
            on_request(LOW_PASS[_key][0], "Hz", f"f_low-pass, {_text}")(_low_pass(*_of))
            VALUES[LOW_PASS[_key][1]] = ("1", f"wavelength there, D, {_text}", _wavelength(*_of))
    for _name, _unit, _text, _number in (
        ("v_s_long_waves", "m/s", "V_S of the longest waves", lambda wave: wave.long_wave),
        ("v_s_first_peaks", "m/s", "V_S of first peaks", lambda wave: wave.first_peak),
        ("f_low_pass_2_shear", "Hz", "f_low-pass of S-waves, 2 %", _shear_edge),
    ):
        SHEAR[f"{_name}_{_producer}"] = _producer
        VALUES[f"{_name}_{_producer}"] = (_unit, f"{_text}, {_by}", _of_shear(_producer, _number))
for _name, (_unit, _text, _number) in VALUES.items():
    on_request(_name, _unit, _text)(_measured(_unit, _number))
OF_MODULI = "bulk_modulus", "shear_modulus", "poisson", "v_p_moduli", "v_s_moduli"
OF_PACKING = "void_ratio", "coordination", "coordination_of_bearing", "v_p_static"
OF_CASE = *OF_PACKING, *VALUES, *(name for name, _ in LOW_PASS.values()), *OF_MODULI
"""What the result of a case has, as far as its files are there."""
COLUMNS = {
    "v_p_first_peaks_all_columns": ("v_p_first_peaks_columns_m_per_s", 1.0),
    "coordination": ("coordination_number", 1.0),
    "coordination_of_bearing": ("coordination_number_bearing", 1.0),
    "resonances_found": ("resonances", 1.0),
    "gain_resolution": ("gain_resolution_hz", 1.0),
    "ioffe_regel_of_ridge": ("ioffe_regel_khz", 1e-3),
    "excess_largest": ("excess_peak", 1.0),
    "excess_largest_at": ("excess_peak_khz", 1e-3),
}
UNITS = {"m/s": ("_m_per_s", 1.0), "Hz": ("_khz", 1e-3), "Pa": ("_mpa", 1e-6), "1": ("", 1.0)}


def column_of(name: str, value: Value) -> tuple[str, Value]:
    """Column of a quantity in the tables over cases, and its value in the column's unit."""
    end, factor = UNITS[QUANTITIES[name].unit]
    column, factor = COLUMNS.get(name, (name + end, factor))
    return column, estimate(factor * value.value, factor * value.error or np.nan)
