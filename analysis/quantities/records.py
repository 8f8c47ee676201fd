"""What the files of a case give: by its run and by the linear wave, by modes, theory and spectra.

On request, as each needs files that most packings do not have. A number has one producer in its
name where there are two: `yade`, the recorded run, or `linear`, the wave of the springs.
"""

from collections.abc import Callable

import numpy as np

from analysis.case import AbsentError
from analysis.estimators.low_pass import Reference, Whose
from analysis.estimators.resonances import long_wave_velocity
from analysis.packing_data import PackingData
from analysis.quantities import gain, passband, scattering, spectrum, velocity
from analysis.quantities.passband import Producer
from analysis.quantities.registry import on_request
from analysis.value import Value, estimate

LOW, HIGH = 0.05, 0.07
"""In parts of the highest frequency: below the one modes move along z together, above the other no
more. The paper has 10 and 15 kHz of 216."""
PERCENT = "2", "1", "3"
"""The first of the thresholds of f_low-pass, as their quantities are called."""
MAPS: dict[str, tuple[Whose, Reference]] = {
    "": ("chain", "map"),
    "own_": ("chain", "own"),
    "layers_": ("layers", "map"),
}
"""Rules of f_low-pass by their part of a name: whose motion, relative to which maximum."""
PRODUCERS = {"yade": "run", "linear": "linear wave"}
Number = Callable[[PackingData], float | Value]


def _by(function: Callable[..., float | Value], *given: object) -> Number:
    """A function of a packing and more, as one of the packing alone."""
    return lambda m: function(m, *given)


def _f_max(m: PackingData) -> Value:
    lists = m.case.read("highest.modes"), m.case.read("modes")
    return spectrum.natural_frequency(spectrum.f_max(m), *lists)


def _f_min(m: PackingData) -> Value:
    modes = m.case.needed("modes")
    return spectrum.natural_frequency(modes.frequency[0], modes)


def _resonance(m: PackingData, r: int) -> Value:
    """The r-th P resonance: of its mode, or of the structure factor's ridge."""
    f = spectrum.standing_waves(m)[0]
    if len(f) < r:
        raise AbsentError
    return spectrum.natural_frequency(float(f[r - 1]), m.case.read("modes"))


def _resonances(m: PackingData) -> float:
    m.case.needed("modes")
    return len(spectrum.standing_waves(m)[0])


def _last_of_crystal(m: PackingData) -> Value:
    m.require_crystal()
    return _resonance(m, 200)


def _translations(m: PackingData) -> float:
    highest = m.case.needed("translations.modes").frequency[-1]
    return float(highest / m.lattice.low_pass_frequency)


def _chi(m: PackingData, low: float, high: float, chain: bool = True) -> float:
    top = spectrum.f_max(m)
    return spectrum.largest_chi(m, low * top, high * top, chain)[0]


def _excess(m: PackingData, name: str) -> float:
    """A number of the density of states in a file."""
    m.case.needed("density")
    return float(getattr(spectrum.excess(m), name))


def _of_balance(m: PackingData, name: str) -> float:
    """A number of the energy balance of the YADE run."""
    return float(getattr(m.record("yade").balance, name, np.nan))


def _off_linear(m: PackingData) -> float:
    """YADE less the linear wave at the times of both, relative L2: layers' means, or a chain's.

    Over the whole record.
    """
    run = m.record("yade")
    every = round(float(m.linear.time[1]) / float(run.time[1]))
    seen, wanted = run.layer_displacement, m.linear.layer_displacement
    if m.crystal or seen is None or wanted is None:
        seen, wanted = run.chain_displacement, m.linear.chain_displacement
    seen = seen[::every][: len(wanted)]
    wanted = wanted[: len(seen)]
    return float(np.linalg.norm(seen - wanted) / np.linalg.norm(wanted))


def _low_pass(m: PackingData, producer: Producer, rule: str, threshold: int) -> Value:
    return passband.edges(m, producer, *MAPS[rule])[threshold]


def _wavelength(m: PackingData, producer: Producer, rule: str, threshold: int) -> Value:
    """lambda / D at the frequency of a rule, with what the frequency's error makes of it."""
    edge = passband.edges(m, producer, *MAPS[rule])[threshold]
    if not np.isfinite(edge.value):
        raise AbsentError
    at = [passband.wavelength_at(m, edge.value + s * edge.error, producer) for s in (0, -1, 1)]
    here, low, high = (value / m.diameter for value in at)
    return estimate(here, 0.5 * abs(low - high))


def _shear_edge(m: PackingData, key: str) -> Value:
    return passband.passband(m, key).low_pass[0]


CASE_QUANTITIES: dict[str, tuple[str, str, Number]] = {
    "particles": ("1", "spheres", lambda m: m.network.n_particles),
    "length_over_d": ("1", "length, D", lambda m: m.network.length / m.diameter),
    "width_over_d": ("1", "width, D", lambda m: m.network.cell_size[0] / m.diameter),
    "v_p_first_peaks_columns": (
        *("m/s", "V_P of first peaks, mean of columns and their scatter"),
        lambda m: estimate(*velocity.columns(m, "linear")),
    ),
    "v_p_modes_first": (
        *("m/s", "2 L f_1 of the first resonance (Eqs. 3, 4)"),
        lambda m: 2 * m.network.length * _resonance(m, 1).value,
    ),
    "v_p_modes_eq_4": (
        *("m/s", "V_P of modes, kappa = pi r / L, by omega = V kappa (1 + b kappa^2)"),
        lambda m: estimate(*long_wave_velocity(*spectrum.standing_waves(m))),
    ),
    "v_p_modes_fitted": ("m/s", "V_P of modes, kappa fitted", spectrum.modal_fitted),
    "v_p_emt_contacts": ("m/s", "V_P of even strains", lambda m: m.affine_velocity),
    "v_p_theory": ("m/s", "V_P of the lattice", lambda m: m.lattice.velocity),
    "f_max": ("Hz", "highest natural frequency, of a list where there is one", _f_max),
    "f_max_spheres": ("1", "spheres that move there", lambda m: spectrum.highest_seat(m)[0]),
    "f_max_contacts": ("1", "contacts of the first", lambda m: spectrum.highest_seat(m)[1]),
    "f_min": ("Hz", "lowest natural frequency", _f_min),
    "f_1": ("Hz", "first P resonance", _by(_resonance, 1)),
    "f_200": ("Hz", "200th P resonance of a crystal", _last_of_crystal),
    "resonances_found": ("1", "number of P resonances", _resonances),
    "band_edge_modes": (
        *("Hz", "end of a crystal's band, modes"),
        lambda m: spectrum.modal_dispersion(m).low_pass_frequency,
    ),
    "band_edge_theory": (
        *("Hz", "end of a crystal's band, lattice"),
        lambda m: m.lattice.low_pass_frequency,
    ),
    "translations_only_over_edge": ("1", "highest mode without rotations over it", _translations),
    "chi_z_low": ("1", "largest chi_z of the chain's modes below 0.05 f_max", _by(_chi, 0.0, LOW)),
    "chi_z_high": ("1", "largest of them above 0.07 f_max", _by(_chi, HIGH, np.inf)),
    "chi_z_high_all": ("1", "the same of all spheres", _by(_chi, HIGH, np.inf, False)),
    "chi_z_high_mean": (
        *("1", "mean chi_z there"),
        lambda m: spectrum.mean_chi(m, HIGH * spectrum.f_max(m), np.inf),
    ),
    "chi_z_pure": ("Hz", "highest frequency of a mode with chi_z above 0.9", spectrum.last_pure),
    "gain_maximum": ("1", "largest gain", lambda m: float(np.max(gain.gain_of(m).gain))),
    "gain_resolution": ("Hz", "width of its lines", lambda m: gain.gain_of(m).resolution),
    "free_path_at_f_low_pass_over_d": ("1", "mean free path there, D", scattering.free_path),
    "ridge_width_power": ("1", "power of f in the ridge's width there", scattering.width_power),
    "ioffe_regel_of_ridge": (
        *("Hz", "the Ioffe-Regel frequency of a kept structure factor"),
        lambda m: scattering.whole_ridge(m).limit,
    ),
    "excess_at_a_tenth": ("1", "D f_max^3 / f^2 at 0.1 f_max", _by(_excess, "at_a_tenth")),
    "excess_largest": ("1", "largest D f_max^3 / f^2", _by(_excess, "peak")),
    "excess_largest_at": ("Hz", "where it is", _by(_excess, "peak_frequency")),
    "energy_drift": ("1", "drift of the run's energy", _by(_of_balance, "drift")),
    "energy_to_friction": ("1", "of it to friction", _by(_of_balance, "friction")),
    "energy_gap": ("1", "gap to the wall's work", _by(_of_balance, "gap")),
    "contacts_opened": ("1", "contacts that opened", _by(_of_balance, "opened")),
    "contacts_slid": ("1", "contacts that slid", _by(_of_balance, "slid")),
    "yade_less_linear_layers": ("1", "run less linear wave, relative", _off_linear),
    "record_passages": ("1", "passages of the record", lambda m: passband.passband(m).common),
}
"""Name: unit, what it is, and how it is measured."""
OF_WAVE = (
    ("v_p_first_peaks_{}", "m/s", "V_P of first peaks", velocity.first_peak, "{}"),
    ("v_p_long_waves_{}", "m/s", "V_P of the longest waves", velocity.longest, "{}"),
    ("band_edge_{}", "Hz", "end of a crystal's band", passband.band_edge, "{}"),
    ("lambda_edge_{}_over_d", "1", "wavelength there, D", passband.edge_wavelength, "{}"),
    ("v_s_long_waves_{}", "m/s", "V_S of the longest waves", velocity.longest, "shear_{}"),
    ("v_s_first_peaks_{}", "m/s", "V_S of first peaks", velocity.first_peak, "shear_{}"),
    ("f_low_pass_2_shear_{}", "Hz", "f_low-pass of S-waves, 2 %", _shear_edge, "shear_{}"),
)
"""Of each producer's wave: name, unit, what it is, how it is measured, and of which record."""
LOW_PASS: dict[str, tuple[str, str]] = {}
"""Thresholds' quantities: name of f_low-pass, and of lambda / D there, by NUMBER_RULEPRODUCER."""
SHEAR: dict[str, str] = {}
"""Quantities of S-waves, and whose record they need."""
for _producer, _told in PRODUCERS.items():
    for _name, _unit, _text, _rule_of, _key in OF_WAVE:
        _name, _key = _name.format(_producer), _key.format(_producer)
        CASE_QUANTITIES[_name] = _unit, f"{_text}, {_told}", _by(_rule_of, _key)
        SHEAR |= {_name: _producer} if _key.startswith("shear") else {}
    for _rule, (_whose, _reference) in MAPS.items():
        for _threshold, _percent in enumerate(PERCENT):
            _key, _which = f"{_percent}_{_rule}{_producer}", (_producer, _rule, _threshold)
            _text = f"{_percent} % of the maximum, {_whose}, {_reference}; {_told}"
            LOW_PASS[_key] = _names = f"f_low_pass_{_key}", f"lambda_{_key}_over_d"
            CASE_QUANTITIES[_names[0]] = "Hz", f"f_low-pass, {_text}", _by(_low_pass, *_which)
            CASE_QUANTITIES[_names[1]] = (
                "1",
                f"wavelength there, D, {_text}",
                _by(_wavelength, *_which),
            )
for _name, (_unit, _text, _number) in CASE_QUANTITIES.items():
    on_request(_unit, name=_name, definition=_text)(_number)
OF_MODULI = "bulk_modulus", "shear_modulus", "poisson", "v_p_moduli", "v_s_moduli"
OF_PACKING = "void_ratio", "coordination", "coordination_of_bearing", "v_p_static"
OF_CASE = *OF_PACKING, *CASE_QUANTITIES, *OF_MODULI
"""What the result of a case has, as far as its files are there."""
