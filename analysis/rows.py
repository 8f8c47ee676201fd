"""The numbers of a case: what the tables and figures over all cases are made of.

A `Row` holds values with their errors, and curves, but none of the case's files: a whole study fits
into memory, and its cases are measured side by side.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from analysis.case import Case
from analysis.estimators.damped_transform import mode_dispersion
from analysis.estimators.low_pass import THRESHOLDS, Edge
from analysis.estimators.power_law import PowerLaw, power_law
from analysis.measures import Measures
from analysis.measures.estimate import Estimate
from modal.formats.hdf5 import InputError
from modal.modes.mode_set import ModeSet

PERCENT = {0.02: "2", 0.01: "1", 0.03: "3"}
"""Thresholds of the tables, and how their columns call them."""
MAPS = {"": ("chain", "map"), "own_": ("chain", "own"), "layers_": ("layers", "map")}
"""Rules of f_low-pass by their part of a column's name: whose motion, relative to which maximum."""
NOTHING = Estimate(np.nan)


@dataclass
class Row:
    """One case: number of the study (None for another packing), name, what it is, its numbers.

    `stress` Pa and `mu_comp` of the compression; `record` is `yade`, or `linear` where no run is
    there; `values` by their column in table1.csv, with the error of the estimator and of the choice
    of the chain; `samples` their scatter over packings of other seeds, `packings` how many these
    are with its own; `flat` says of thresholds whether they stand on a plateau; `curves` are arrays
    by name; `absent` says which products are not there.
    """

    number: int | None
    name: str
    label: str
    crystal: bool
    stress: float
    mu_comp: float
    record: str
    unsettled: str
    values: dict[str, Estimate] = field(default_factory=dict)
    samples: dict[str, float] = field(default_factory=dict)
    packings: int = 1
    flat: dict[str, bool] = field(default_factory=dict)
    curves: dict[str, tuple[np.ndarray, ...]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    absent: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def value(self, name: str) -> float:
        """A number; NaN where it is not known."""
        return self.values.get(name, NOTHING).value

    def error(self, name: str) -> float:
        """Its uncertainty; NaN where that is not known."""
        return self.values.get(name, NOTHING).error

    def spread(self, name: str) -> float:
        """Its uncertainty, or the scatter over packings where that is larger: it has both in it."""
        known = [e for e in (self.error(name), self.samples.get(name, np.nan)) if np.isfinite(e)]
        return max(known, default=np.nan)

    @property
    def group(self) -> str:
        """What the paper joins by lines: FCC, or a friction."""
        return "FCC" if self.crystal else f"random, mu_comp {self.mu_comp:g}"


def number_of(name: str) -> int | None:
    """The case's number in the study, from its name."""
    match = re.fullmatch(r"case(\d\d)", name)
    return int(match[1]) if match and 1 <= int(match[1]) <= 32 else None


def groups_of(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows by kind and friction, in order of stress."""
    found: dict[str, list[Row]] = {}
    for row in sorted(rows, key=lambda r: (not r.crystal, r.mu_comp, r.stress)):
        found.setdefault(row.group, []).append(row)
    return found


def law_of(members: list[Row], x: str, y: str) -> PowerLaw:
    """y as a power of x over the cases of a group; x may be `stress_pa`."""
    at = [row.stress if x == "stress_pa" else row.value(x) for row in members]
    return power_law(np.array(at), np.array([row.value(y) for row in members]))


def _peak(m: Measures, own: Estimate) -> Estimate:
    """First peaks with the error of the fit and the scatter over all columns."""
    chain = m.columns.error if np.isfinite(m.columns.error) else 0.0
    return Estimate(own.value, float(np.hypot(own.error, chain)))


VALUES: dict[str, Callable[[Measures], float | Estimate]] = {
    "particles": lambda m: float(m.case.network.n_particles),
    "length_over_d": lambda m: m.case.network.length / m.case.diameter,
    "width_over_d": lambda m: float(m.case.network.cell_size[0]) / m.case.diameter,
    "void_ratio": lambda m: m.void_ratio,
    "coordination_number": lambda m: m.coordination[0],
    "coordination_number_bearing": lambda m: m.coordination[1],
    "v_p_first_peaks_yade_m_per_s": lambda m: _peak(m, m.yade_first_peak),
    "v_p_first_peaks_linear_m_per_s": lambda m: _peak(m, m.first_peak),
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
    "chi_z_below_10_khz": lambda m: m.largest_chi(0.0, 1e4, chain=True)[0],
    "chi_z_above_15_khz": lambda m: m.largest_chi(1.5e4, np.inf, chain=True)[0],
    "chi_z_above_15_khz_all": lambda m: m.largest_chi(1.5e4, np.inf, chain=False)[0],
    "chi_z_above_15_khz_mean": lambda m: m.mean_chi(1.5e4, np.inf),
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
"""Column of table1.csv, and how it is measured; frequencies and wavelengths follow below."""


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


def row_of(m: Measures) -> Row:
    """All numbers that a case's products allow, each measured once."""
    if m.row is None:
        m.row = _measured(m)
    return m.row


def bare_row(case: Case) -> Row:
    """The row of a case that nothing has been measured of."""
    return Row(
        number_of(case.name),
        case.name,
        case.label,
        case.is_crystal,
        case.stress,
        0.0 if case.is_crystal else case.mu_comp,
        "linear" if case.signals is None else "yade",
        case.unsettled,
    )


def _measured(m: Measures) -> Row:
    case, row = m.case, bare_row(m.case)
    for name, measure in VALUES.items():
        try:
            found = measure(m)
        except InputError as error:
            row.notes.append(f"{name}: {error}")
            continue
        row.values[name] = Estimate.of(found)
    row.values["record_passages"] = Estimate(m.passband.common)
    add_low_pass(row, m, MAPS, m.passband.chain_scatter)
    own = "yade" if row.record == "yade" else "linear"
    row.values["v_p_first_peaks_m_per_s"] = row.values[f"v_p_first_peaks_{own}_m_per_s"]
    for percent in PERCENT.values():
        for quantity, unit in (("f_low_pass", "khz"), ("lambda", "over_d")):
            row.values[f"{quantity}_{percent}_{unit}"] = row.values[
                f"{quantity}_{percent}_{own}_{unit}"
            ]
        row.flat[percent] = row.flat[f"{percent}_{own}"]
    row.texts["gain_height"] = m.gain_height
    row.texts["chi_z_above_15_khz"] = m.largest_chi(1.5e4, np.inf, chain=True)[1]
    _curves(m, row)
    row.absent = [
        kind
        for kind in ("signals", "highest.modes", "modes", "density", "structure", "response")
        if not case.has(kind) and not (case.is_crystal and kind in ("density", "structure"))
    ]
    row.notes += case.notes
    return row


def add_low_pass(
    row: Row,
    m: Measures,
    rules: Mapping[str, tuple[str, str]],
    chain_scatter: Iterable[float] = (np.nan,) * len(THRESHOLDS),
) -> None:
    """f_low-pass and lambda / D of both producers by some of the rules of `MAPS`, to the row.

    `chain_scatter`, Hz, of each of `THRESHOLDS` is that over the packing's columns.
    """
    band = m.passband
    scatter = dict(zip(THRESHOLDS, chain_scatter, strict=True))
    for producer, record in (("yade", m.case.signals), ("linear", m.case.wave)):
        for rule, (whose, reference) in rules.items():
            edges = band.edges(record, whose, reference, band.common)
            of_threshold = dict(zip(THRESHOLDS, edges, strict=True))
            for threshold, percent in PERCENT.items():
                edge, name = of_threshold[threshold], f"{percent}_{rule}{producer}"
                error = edge.error if rule else _error(edge, scatter[threshold])
                row.values[f"f_low_pass_{name}_khz"] = Estimate(edge.value / 1e3, error / 1e3)
                row.flat[name] = edge.flat
                row.values[f"lambda_{name}_over_d"] = _wavelength(m, record, edge.value, error)


def _error(edge: Edge, scatter: float) -> float:
    """Of the choice of the chain, which holds the estimator's own; of one chain its spread."""
    return float(scatter) if np.isfinite(scatter) and scatter > 0 else edge.error


def _wavelength(m: Measures, record, frequency: float, error: float) -> Estimate:
    """lambda / D at a frequency, with what the frequency's error makes of it."""
    if record is None or not np.isfinite(frequency):
        return NOTHING
    at = [m.wavelength_at(frequency + sign * error, record) for sign in (0, -1, 1)]
    here, low, high = (value / m.case.diameter for value in at)
    return Estimate(here, 0.5 * abs(low - high))


def _curves(m: Measures, row: Row) -> None:
    """What figures over several cases draw."""
    gain = m.gain
    row.curves["gain"] = (gain.frequency, gain.gain)
    row.curves["gain_orders"] = m.gain_orders
    row.curves["free_held"] = (m.free_held,)
    row.curves["first"] = (np.array([m.first_resonance]),)
    row.curves["resonances"] = m.resonances
    if m.scattering is not None:
        frequency, width, path = m.scattering.of_waves()
        passed = m.case.diameter / m.long_wave.value
        row.curves["ridge"] = (frequency * passed, width / frequency, path)
    if m.case.density is not None:
        row.curves["excess"] = (m.excess.frequency, m.excess.reduced)
