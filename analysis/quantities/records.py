"""Measure the records of a case: YADE's run and the linear wave, by the same rules.

These quantities are measured on request, because most packings lack the records that they need. A
number that two programs can give has one of them in its name: `yade`, the recorded run, or
`linear`, the wave of the springs.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from analysis.case import AbsentError
from analysis.estimators.low_pass import Whose
from analysis.estimators.threshold_rule import Reference
from analysis.packing_data import PackingData
from analysis.quantities import passband, spectrum, velocity
from analysis.quantities.case_quantity import Measure, case_quantity
from analysis.quantities.passband import Producer
from analysis.steps import Step
from analysis.value import Value, estimate

PERCENT = "2", "1", "3"
"""The first thresholds of f_low-pass in per cent, written as in the names of quantities."""
MAPS: dict[str, tuple[Whose, Reference]] = {
    "": ("chain", "map"),
    "own_": ("chain", "own"),
    "layers_": ("layers", "map"),
}
"""Variants of the f_low-pass rule by their part of a quantity's name: whose displacement is taken,
and the maximum that thresholds are relative to."""
RECORD_WORDS: dict[Producer, str] = {"yade": "run", "linear": "linear wave"}
"""Programs that compute a record, and what definitions call their record."""


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
