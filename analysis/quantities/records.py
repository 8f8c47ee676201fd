"""Measure what the files of a case give: its run and the linear wave, modes, theory, spectra.

These quantities are measured on request, because most packings lack the files that they need. If
two programs can give a number, the name of the quantity contains the program: `yade`, the recorded
run, or `linear`, the wave of the springs.
"""

from collections.abc import Callable
from functools import partial
from typing import Literal, NamedTuple, TypeVar

import numpy as np

from analysis.case import AbsentError
from analysis.estimators.excess import Excess
from analysis.estimators.low_pass import Reference, Whose
from analysis.explanation import Step
from analysis.packing_data import PackingData
from analysis.quantities import gain, passband, polarisation, scattering, spectrum, velocity
from analysis.quantities.passband import Producer
from analysis.quantities.registry import on_request
from analysis.spectra_cache import SpectrumKind
from analysis.value import Value, estimate

LOW = 0.05
"""Share of the highest frequency below which modes move the spheres along z together; in the paper
10 of 216 kHz."""
HIGH = 0.07
"""Share of the highest frequency above which modes no longer move the spheres along z together; in
the paper 15 of 216 kHz."""
PERCENT = "2", "1", "3"
"""The first thresholds of f_low-pass in per cent, written as in the names of quantities."""
LAST_RESONANCE_OF_CRYSTAL = 200
"""Order of the last P resonance of the paper's crystals, which have 200 layers."""
MAPS: dict[str, tuple[Whose, Reference]] = {
    "": ("chain", "map"),
    "own_": ("chain", "own"),
    "layers_": ("layers", "map"),
}
"""Variants of the f_low-pass rule by their part of a quantity's name: whose displacement is taken,
and the maximum that thresholds are relative to."""
RECORD_WORDS: dict[Producer, str] = {"yade": "run", "linear": "linear wave"}
"""Programs that compute a record, and what definitions call their record."""

Measure = Callable[[PackingData], float | Value]
Function = TypeVar("Function", bound=Measure)
CASE_QUANTITIES: list[str] = []
"""Names of the quantities of this module, in the order in which results list them."""


def case_quantity(
    unit: str, definition: str, name: str = "", spectrum: SpectrumKind | Literal[""] = ""
) -> Callable[[Function], Function]:
    """Register a function as a quantity on request that is listed in a case's result."""

    def register(function: Function) -> Function:
        key = name or getattr(function, "__name__", "")
        CASE_QUANTITIES.append(key)
        return on_request(unit, name=key, definition=definition, spectrum=spectrum)(function)

    return register


@case_quantity("1", "spheres")
def particles(packing: PackingData) -> float:
    """Return the number of spheres."""
    return packing.network.n_particles


@case_quantity("1", "length, D")
def length_over_d(packing: PackingData) -> float:
    """Return the length in mean diameters."""
    return packing.network.length / packing.diameter


@case_quantity("1", "width, D")
def width_over_d(packing: PackingData) -> float:
    """Return the width along x in mean diameters."""
    return packing.network.cell_size[0] / packing.diameter


@case_quantity("m/s", "V_P of first peaks, mean of columns and their scatter")
def v_p_first_peaks_columns(packing: PackingData) -> Value:
    """Measure V_P of first peaks along all columns of the linear wave."""
    mean, scatter = velocity.columns(packing, "linear")
    step = Step("fit", "fitted", {"velocity": mean, "scatter": scatter})
    return estimate(mean, scatter, steps=(step,))


@case_quantity("m/s", "2 L f_1 of the first resonance (Eqs. 3, 4)")
def v_p_modes_first(packing: PackingData) -> Value:
    """Measure V_P by the frequency of the first P resonance."""
    resonance = _resonance(packing, 1)
    length = packing.network.length
    velocity = 2 * length * resonance.value
    numbers = {"frequency": resonance.value, "packing_length": length, "velocity": velocity}
    return estimate(velocity, steps=(*resonance.steps, Step("window", "read", numbers)))


@case_quantity("m/s", "V_P of modes, kappa = pi r / L, by omega = V kappa (1 + b kappa^2)")
def v_p_modes_eq_4(packing: PackingData) -> Value:
    """Measure V_P by the standing waves among the modes, with their wave numbers by Eq. 4."""
    return spectrum.velocity_of_standing_waves(*spectrum.standing_waves(packing))


case_quantity("m/s", "V_P of modes, kappa fitted", "v_p_modes_fitted")(spectrum.modal_fitted)


@case_quantity("m/s", "V_P of even strains")
def v_p_emt_contacts(packing: PackingData) -> float:
    """Return V_P, m/s, if the mean strain is imposed on all contacts."""
    return packing.affine_velocity


@case_quantity("m/s", "V_P of the lattice")
def v_p_theory(packing: PackingData) -> float:
    """Return V_P, m/s, of the lattice of layers of a crystal."""
    return packing.lattice.velocity


@case_quantity("Hz", "highest natural frequency, of a list where there is one")
def f_max(packing: PackingData) -> Value:
    """Measure the highest natural frequency; a mode from a file has a residual as error."""
    lists = packing.case.read("highest.modes"), packing.case.read("modes")
    return spectrum.natural_frequency(spectrum.f_max(packing), *lists)


@case_quantity("1", "spheres that move there")
def f_max_spheres(packing: PackingData) -> float:
    """Count the spheres that take part in the highest mode."""
    return spectrum.highest_seat(packing)[0]


@case_quantity("1", "contacts of the first")
def f_max_contacts(packing: PackingData) -> float:
    """Count the contacts of the sphere that moves most in the highest mode."""
    return spectrum.highest_seat(packing)[1]


@case_quantity("Hz", "lowest natural frequency")
def f_min(packing: PackingData) -> Value:
    """Measure the lowest natural frequency of a file with modes."""
    modes = packing.case.needed("modes")
    return spectrum.natural_frequency(modes.frequency[0], modes)


@case_quantity("Hz", "first P resonance")
def f_1(packing: PackingData) -> Value:
    """Measure the frequency of the first P resonance."""
    return _resonance(packing, 1)


@case_quantity("Hz", "200th P resonance of a crystal")
def f_200(packing: PackingData) -> Value:
    """Measure the frequency of the last P resonance of a crystal."""
    packing.require_crystal()
    return _resonance(packing, LAST_RESONANCE_OF_CRYSTAL)


@case_quantity("1", "number of P resonances")
def resonances_found(packing: PackingData) -> float:
    """Count the P resonances of a file with modes."""
    packing.case.needed("modes")
    return len(spectrum.standing_waves(packing)[0])


@case_quantity("Hz", "end of a crystal's band, modes")
def band_edge_modes(packing: PackingData) -> Value:
    """Measure the frequency at which a crystal's band ends, by its modes."""
    dispersion = spectrum.modal_dispersion(packing)
    step = spectrum.step_of_dispersion(dispersion)
    return estimate(dispersion.low_pass_frequency, steps=(step,))


@case_quantity("Hz", "end of a crystal's band, lattice")
def band_edge_theory(packing: PackingData) -> float:
    """Return the frequency, Hz, at which the band of a crystal's lattice ends."""
    return packing.lattice.low_pass_frequency


@case_quantity("1", "highest mode without rotations over it")
def translations_only_over_edge(packing: PackingData) -> float:
    """Divide the highest frequency without rotations by that of the lattice's band edge."""
    highest = packing.case.needed("translations.modes").frequency[-1]
    return float(highest / packing.lattice.low_pass_frequency)


@case_quantity("1", "largest chi_z of the chain's modes below 0.05 f_max")
def chi_z_low(packing: PackingData) -> Value:
    """Measure the largest chi_z of the chain among low modes."""
    return _largest_chi(packing, 0.0, LOW)


@case_quantity("1", "largest of them above 0.07 f_max")
def chi_z_high(packing: PackingData) -> Value:
    """Measure the largest chi_z of the chain among high modes."""
    return _largest_chi(packing, HIGH, np.inf)


@case_quantity("1", "the same of all spheres")
def chi_z_high_all(packing: PackingData) -> Value:
    """Measure the largest chi_z of all spheres among high modes."""
    return _largest_chi(packing, HIGH, np.inf, chain=False)


@case_quantity("1", "mean chi_z there")
def chi_z_high_mean(packing: PackingData) -> Value:
    """Measure the mean chi_z of the chain among high modes."""
    return polarisation.mean_chi(packing, HIGH * spectrum.f_max(packing), np.inf)


case_quantity("Hz", "highest frequency of a mode with chi_z above 0.9", "chi_z_pure")(
    polarisation.last_pure
)


@case_quantity("1", "largest gain", spectrum="response")
def gain_maximum(packing: PackingData) -> Value:
    """Measure the largest gain: stress at the receiver wall divided by that at the source wall."""
    response = gain.gain_of(packing)
    return estimate(float(np.max(response.gain)), steps=(gain.step_of_gain(response),))


@case_quantity("Hz", "width of its lines", spectrum="response")
def gain_resolution(packing: PackingData) -> Value:
    """Return the full width of a resonance's line in the gain."""
    response = gain.gain_of(packing)
    return estimate(response.resolution, steps=(gain.step_of_gain(response),))


case_quantity("1", "mean free path there, D", "free_path_at_f_low_pass_over_d")(
    scattering.free_path
)
case_quantity("1", "power of f in the ridge's width there", "ridge_width_power")(
    scattering.width_power
)


@case_quantity("Hz", "the Ioffe-Regel frequency of a kept structure factor")
def ioffe_regel_of_ridge(packing: PackingData) -> Value:
    """Measure the Ioffe-Regel frequency from a file with the structure factor."""
    ridge = scattering.whole_ridge(packing)
    return estimate(ridge.limit, steps=(scattering.step_of_limit(ridge),))


@case_quantity("1", "D f_max^3 / f^2 at 0.1 f_max")
def excess_at_a_tenth(packing: PackingData) -> Value:
    """Measure the density of states at a tenth of the highest frequency."""
    return estimate(_excess(packing).at_a_tenth, steps=_steps_of_density(packing))


@case_quantity("1", "largest D f_max^3 / f^2")
def excess_largest(packing: PackingData) -> Value:
    """Measure the largest ratio of the density of states to that of plane waves."""
    return estimate(_excess(packing).peak, steps=_steps_of_density(packing))


@case_quantity("Hz", "where it is")
def excess_largest_at(packing: PackingData) -> Value:
    """Measure the frequency of the largest ratio of density of states to plane waves."""
    return estimate(_excess(packing).peak_frequency, steps=_steps_of_density(packing))


@case_quantity("1", "drift of the run's energy")
def energy_drift(packing: PackingData) -> float:
    """Return the drift of the run's energy."""
    return _energy(packing, "drift")


@case_quantity("1", "of it to friction")
def energy_to_friction(packing: PackingData) -> float:
    """Return the share of the run's energy that friction dissipates."""
    return _energy(packing, "friction")


@case_quantity("1", "gap to the wall's work")
def energy_gap(packing: PackingData) -> float:
    """Return the difference of the run's energies from the wall's work, divided by this work."""
    return _energy(packing, "gap")


@case_quantity("1", "contacts that opened")
def contacts_opened(packing: PackingData) -> float:
    """Return the number of contacts that opened in the run."""
    return _energy(packing, "opened")


@case_quantity("1", "contacts that slid")
def contacts_slid(packing: PackingData) -> float:
    """Return the number of contacts that slid in the run."""
    return _energy(packing, "slid")


@case_quantity("1", "run less linear wave, relative")
def yade_less_linear_layers(packing: PackingData) -> Value:
    """Compute the relative L2 difference between run and linear wave over all common times.

    The compared motions are means over layers; for a crystal, and if layers are not recorded, they
    are those of the chain.
    """
    run = packing.record("yade")
    linear = packing.linear
    every = round(float(linear.time[1]) / float(run.time[1]))
    motion = run.layer_displacement
    reference = linear.layer_displacement
    if packing.crystal or motion is None or reference is None:
        motion = run.chain_displacement
        reference = linear.chain_displacement
    motion = motion[::every][: len(reference)]
    reference = reference[: len(motion)]
    difference = float(np.linalg.norm(motion - reference) / np.linalg.norm(reference))
    numbers = {"samples": len(reference), "record_end": linear.time[len(reference) - 1]}
    return estimate(difference, steps=(Step("window", "read", numbers),))


@case_quantity("1", "passages of the record")
def record_passages(packing: PackingData) -> float:
    """Return the length of the record for the threshold rule, in passages of the wave."""
    return passband.passband(packing).common


def _resonance(packing: PackingData, order: int) -> Value:
    """Measure a P resonance by its mode, or by the ridge of the structure factor, Hz.

    Raises AbsentError if fewer resonances are known.
    """
    frequency = spectrum.standing_waves(packing)[0]
    if len(frequency) < order:
        raise AbsentError
    modes = packing.case.read("modes")
    return spectrum.natural_frequency(float(frequency[order - 1]), modes)


def _largest_chi(packing: PackingData, low: float, high: float, chain: bool = True) -> Value:
    """Measure the largest chi_z of modes between two shares of the highest frequency."""
    highest = spectrum.f_max(packing)
    return polarisation.measure_largest_chi(packing, low * highest, high * highest, chain)


def _excess(packing: PackingData) -> Excess:
    """Return the excess of a density of states in a file; AbsentError without the file."""
    packing.case.needed("density")
    return spectrum.excess(packing)


def _steps_of_density(packing: PackingData) -> tuple[Step]:
    """Return a step that describes the search for the largest excess in a file's density."""
    return (spectrum.step_of_peak(packing),)


def _energy(packing: PackingData, name: str) -> float:
    """Return a number of the energy balance of the YADE run; NaN without a balance."""
    return float(getattr(packing.record("yade").balance, name, np.nan))


class Threshold(NamedTuple):
    """One choice of the threshold rule: the record, the displacement and maximum, the threshold."""

    producer: Producer
    whose: Whose
    reference: Reference
    row: int


def _low_pass(packing: PackingData, threshold: Threshold) -> Value:
    """Measure f_low-pass, Hz, by a threshold."""
    producer, whose, reference, row = threshold
    return passband.edges(packing, producer, whose, reference)[row]


def _wavelength(packing: PackingData, threshold: Threshold) -> Value:
    """Measure the wavelength at f_low-pass, D; its error follows from that of the frequency."""
    edge = _low_pass(packing, threshold)
    if not np.isfinite(edge.value):
        raise AbsentError
    producer = threshold.producer
    frequencies = [edge.value, edge.value - edge.error, edge.value + edge.error]
    wavelengths = []
    steps = list(edge.steps)
    for frequency in frequencies:
        wavelength = passband.wavelength_at(packing, frequency, producer) / packing.diameter
        wavelengths.append(wavelength)
        numbers = {"frequency": frequency, "wavelength": wavelength}
        outcome = "read" if np.isfinite(wavelength) else "does_not_travel"
        steps.append(Step("window", outcome, numbers))
    wavelength, low, high = wavelengths
    return estimate(wavelength, 0.5 * abs(low - high), steps=tuple(steps))


def _band_edge(packing: PackingData, key: str) -> Value:
    """Measure f_low-pass, Hz, of a crystal by the dispersion relation of a record's chain."""
    edge = passband.band_edge(packing, key)
    step = spectrum.step_of_dispersion(velocity.chain(packing, key))
    return estimate(edge, steps=(step,))


def _shear_low_pass(packing: PackingData, key: str) -> Value:
    """Measure f_low-pass, Hz, of an S-wave by the 2 % rule."""
    return passband.passband(packing, key).low_pass[0]


class RecordQuantity(NamedTuple):
    """A quantity that is measured on the record of each program.

    In `name` and `key`, `{}` stands for the program. The key is the record's name, as in
    `PackingData.record`.
    """

    name: str
    unit: str
    definition: str
    measure: Callable[[PackingData, str], float | Value]
    key: str


RECORD_QUANTITIES = (
    RecordQuantity("v_p_first_peaks_{}", "m/s", "V_P of first peaks", velocity.first_peak, "{}"),
    RecordQuantity("v_p_long_waves_{}", "m/s", "V_P of the longest waves", velocity.longest, "{}"),
    RecordQuantity("band_edge_{}", "Hz", "end of a crystal's band", _band_edge, "{}"),
    RecordQuantity(
        "lambda_edge_{}_over_d", "1", "wavelength there, D", passband.edge_wavelength, "{}"
    ),
    RecordQuantity(
        "v_s_long_waves_{}", "m/s", "V_S of the longest waves", velocity.longest, "shear_{}"
    ),
    RecordQuantity(
        "v_s_first_peaks_{}", "m/s", "V_S of first peaks", velocity.first_peak, "shear_{}"
    ),
    RecordQuantity(
        "f_low_pass_2_shear_{}", "Hz", "f_low-pass of S-waves, 2 %", _shear_low_pass, "shear_{}"
    ),
)
LOW_PASS: dict[str, tuple[str, str]] = {}
"""Names of the quantities f_low-pass and lambda / D at f_low-pass, by threshold, rule and program,
as in "2_yade"."""
SHEAR: dict[str, str] = {}
"""Quantities of S-waves, and the program whose record they need."""


def _of_record(measure: Callable[[PackingData, str], float | Value], key: str) -> Measure:
    """Return a function of a packing that measures a quantity on one of its records."""

    def measure_record(packing: PackingData) -> float | Value:
        return measure(packing, key)

    return measure_record


def _register_record_quantities(producer: Producer) -> None:
    """Register the quantities of the record that a program computes."""
    for each in RECORD_QUANTITIES:
        name = each.name.format(producer)
        key = each.key.format(producer)
        if key.startswith("shear"):
            SHEAR[name] = producer
        definition = f"{each.definition}, {RECORD_WORDS[producer]}"
        case_quantity(each.unit, definition, name)(_of_record(each.measure, key))


def _register_thresholds(producer: Producer) -> None:
    """Register f_low-pass, and the wavelength at f_low-pass, for each rule and threshold."""
    for rule, (whose, reference) in MAPS.items():
        for index, percent in enumerate(PERCENT):
            key = f"{percent}_{rule}{producer}"
            frequency = f"f_low_pass_{key}"
            wavelength = f"lambda_{key}_over_d"
            LOW_PASS[key] = (frequency, wavelength)
            text = f"{percent} % of the maximum, {whose}, {reference}; {RECORD_WORDS[producer]}"
            threshold = Threshold(producer, whose, reference, index)
            case_quantity("Hz", f"f_low-pass, {text}", frequency)(
                partial(_low_pass, threshold=threshold)
            )
            case_quantity("1", f"wavelength there, D, {text}", wavelength)(
                partial(_wavelength, threshold=threshold)
            )


for _producer in RECORD_WORDS:
    _register_record_quantities(_producer)
    _register_thresholds(_producer)
OF_MODULI = "bulk_modulus", "shear_modulus", "poisson", "v_p_moduli", "v_s_moduli"
"""Quantities of a case's result that need a file with moduli."""
OF_PACKING = "void_ratio", "coordination", "coordination_of_bearing", "v_p_static"
"""Quantities of a case's result that need the packing alone."""
OF_CASE = *OF_PACKING, *CASE_QUANTITIES, *OF_MODULI
"""Quantities of a case's result, as far as the files that they need exist."""
