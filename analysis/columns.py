"""The columns of table1.csv, and how each is measured."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from analysis.estimators.damped_transform import mode_dispersion
from analysis.measures import Measures
from analysis.measures.estimate import NOTHING, Estimate
from modal.modes.mode_set import ModeSet

LOW, HIGH = 0.05, 0.07
"""In parts of the highest frequency: below the one modes move along z together, above the other no
more. The paper has 10 and 15 kHz of 216."""

VALUES: dict[str, Callable[[Measures], float | Estimate]] = {
    "particles": lambda m: float(m.case.network.n_particles),
    "length_over_d": lambda m: m.case.network.length / m.case.diameter,
    "width_over_d": lambda m: float(m.case.network.cell_size[0]) / m.case.diameter,
    "void_ratio": lambda m: m.void_ratio,
    "coordination_number": lambda m: m.coordination[0],
    "coordination_number_bearing": lambda m: m.coordination[1],
    "v_p_first_peaks_yade_m_per_s": lambda m: m.yade_first_peak,
    "v_p_first_peaks_linear_m_per_s": lambda m: m.first_peak,
    "v_p_first_peaks_columns_m_per_s": lambda m: m.columns,
    "v_p_long_waves_yade_m_per_s": lambda m: m.yade_long_wave,
    "v_p_long_waves_linear_m_per_s": lambda m: m.long_wave,
    "v_p_modes_first_m_per_s": lambda m: m.modal_first,
    "v_p_modes_eq_4_m_per_s": lambda m: m.modal,
    "v_p_modes_fitted_m_per_s": lambda m: m.modal_fitted,
    "v_p_walls_phase_m_per_s": lambda m: m.walls[0],
    "v_p_walls_group_m_per_s": lambda m: float(m.walls[1]),
    "v_p_static_m_per_s": lambda m: m.static,
    "v_p_emt_contacts_m_per_s": lambda m: m.effective[0],
    "v_p_emt_means_m_per_s": lambda m: m.effective[1],
    "f_max_khz": lambda m: natural_frequency(m.f_max, m.case.highest, m.case.modes),
    "f_max_spheres": lambda m: m.highest_seat[0],
    "f_max_contacts": lambda m: m.highest_seat[1],
    "f_1_khz": lambda m: _resonance(m, 1),
    "band_edge_linear_khz": lambda m: m.band_edge / 1e3,
    "band_edge_yade_khz": lambda m: m.yade_band_edge / 1e3,
    "band_edge_theory_khz": lambda m: _of_crystal(m, "low_pass_frequency") / 1e3,
    "v_p_theory_m_per_s": lambda m: _of_crystal(m, "velocity"),
    "band_edge_modes_khz": lambda m: _modal_edge(m) / 1e3,
    "lambda_edge_linear_over_d": lambda m: m.edge_wavelength[0],
    "lambda_edge_yade_over_d": lambda m: m.edge_wavelength[1],
    "f_min_khz": lambda m: _lowest(m.case.modes),
    "f_200_khz": lambda m: _resonance(m, 200) if m.case.is_crystal else NOTHING,
    "resonances": lambda m: float(len(m.resonances[0])) if m.case.modes else np.nan,
    "translations_only_over_edge": lambda m: _translations(m),
    "chi_z_low": lambda m: m.largest_chi(0.0, LOW * m.f_max, chain=True)[0],
    "chi_z_high": lambda m: m.largest_chi(HIGH * m.f_max, np.inf, chain=True)[0],
    "chi_z_high_all": lambda m: m.largest_chi(HIGH * m.f_max, np.inf, chain=False)[0],
    "chi_z_high_mean": lambda m: m.mean_chi(HIGH * m.f_max, np.inf),
    "gain_maximum": lambda m: float(np.max(m.gain.gain)),
    "gain_resolution_hz": lambda m: m.gain.resolution,
    "free_path_at_f_low_pass_over_d": lambda m: m.free_path,
    "ridge_width_power": lambda m: _width_power(m),
    "ioffe_regel_khz": lambda m: np.nan if m.scattering is None else m.scattering.limit / 1e3,
    "excess_at_a_tenth": lambda m: m.excess.at_a_tenth,
    "excess_peak": lambda m: m.excess.peak,
    "excess_peak_khz": lambda m: m.excess.peak_frequency / 1e3,
    "energy_drift": lambda m: m.of_balance("drift"),
    "energy_to_friction": lambda m: m.of_balance("friction"),
    "energy_gap": lambda m: m.of_balance("gap"),
    "contacts_opened": lambda m: m.of_balance("opened"),
    "contacts_slid": lambda m: m.of_balance("slid"),
    "yade_less_linear_layers": lambda m: m.off_linear,
}
"""Column of table1.csv, and how it is measured; f_low-pass and its wavelength by several rules
follow in `analysis.rows`."""


def _of_crystal(m: Measures, name: str) -> float:
    return float(getattr(m.case.lattice, name)) if m.case.is_crystal else np.nan


def _modal_edge(m: Measures) -> float:
    modes = m.case.modes
    if not m.case.is_crystal or modes is None or modes.resonance_shape is None:
        return np.nan
    found = mode_dispersion(
        modes.resonance_frequency, modes.resonance_shape, m.case.lattice.distance
    )
    return found.low_pass_frequency


def natural_frequency(frequency: float, *lists: ModeSet | None) -> Estimate:
    """A natural frequency in kHz; its error from the residual in the list that holds it.

    |A v - omega^2 v| of a unit vector bounds the distance of omega^2 from an eigenvalue, for A is
    symmetric: half the relative residual is that of the frequency.
    """
    for modes in lists:
        if modes is not None and frequency in modes.frequency:
            at = int(np.argmax(modes.frequency == frequency))
            return Estimate(frequency / 1e3, 5e-4 * frequency * float(modes.residual[at]))
    return Estimate(frequency / 1e3)


def _lowest(modes: ModeSet | None) -> Estimate:
    return NOTHING if modes is None else natural_frequency(float(modes.frequency[0]), modes)


def _resonance(m: Measures, r: int) -> Estimate:
    """The r-th P resonance in kHz: of its mode, or of the structure factor's ridge."""
    f = m.resonances[0]
    return natural_frequency(float(f[r - 1]), m.case.modes) if len(f) >= r else NOTHING


def _width_power(m: Measures) -> Estimate:
    """Power of the frequency that the ridge's width follows about f_low-pass of the linear wave."""
    if m.scattering is None:
        return NOTHING
    law = m.scattering.power(m.band)
    return Estimate(law.exponent, law.error)


def _translations(m: Measures) -> float:
    only = m.case.translations
    if only is None or not m.case.is_crystal:
        return np.nan
    return float(only.frequency[-1] / m.case.lattice.low_pass_frequency)
