"""Measure how waves fade: attenuation, quality factor, line widths, Ioffe-Regel limit."""

from dataclasses import replace
from functools import partial

import numpy as np

from analysis.caveats import Caveat
from analysis.estimators.coherent import DECAY, STRETCH, Coherent
from analysis.estimators.scattering import POWER_RANGE, Scattering
from analysis.estimators.structure_factor import structure_factor
from analysis.estimators.threshold_rule import spectra
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities.passband import low_pass_2, scale
from analysis.quantities.registry import on_request, quantity
from analysis.quantities.velocity import (
    LOST,
    OTHER_DECAYS,
    coherents,
    longest,
    of_frequency,
    v_p,
)
from analysis.spectra_cache import kept_file
from analysis.steps import Step, UnreadableError, limit_step
from analysis.value import Value, estimate, hertz, unknown
from modal.tools.arrays import Floats

MAX_NEPERS = 8.0
"""Largest decay, as an exponent, over the part of the length that is read. Beyond it the wave is
smaller than what the window leaves of the cut at the record's end."""
MIN_WAVELENGTH_IN_DIAMETERS = 4.0
"""Wavelength of the shortest plane waves whose line widths are read, in mean diameters."""
MIN_ATTENUATION_IN_ERRORS = 2
"""Least attenuation, in its errors, that counts as different from zero."""
MIN_SOURCE_SHARE = 0.02
"""Least amplitude of the source at a frequency, divided by its largest one; below it the source
counts as sending nothing."""
LIMIT_LINE_IN_LINES = 2.0
"""Width of the lines in which the Ioffe-Regel limit is sought, divided by that of the lines of the
whole ridge. At the limit the ridge is a third as wide as its frequency, hence as a tenth of the
highest frequency."""
MAX_FREQUENCY_OF_RIDGE_IN_V_PER_D = 0.75
"""Highest frequency of the structure factor in which the limit is sought."""
WAVES_OF_RIDGE = 8
"""Number of waves in each of the two structure factors from which the limit is read."""


@cached_on_packing
def attenuation_of(packing: PackingData) -> tuple[Value, Floats]:
    """Measure the decay of the coherent amplitude, 1/m, and the group velocity (k,), m/s.

    Both are read at independent frequencies. The error is the change of the value, at a frequency
    or at its neighbours, under a window of other damping, which cuts the record at another time and
    has other noise. This error includes a bias that is proportional to the square of the damping.
    """
    wave, weaker, stronger = coherents(packing)
    step = wave.frequency[1] - wave.frequency[0]
    every = max(1, round(wave.resolution / step))
    independent = np.arange(every - 1, len(wave.frequency), every)
    known = np.ones(len(independent), bool)
    for each in (wave, weaker, stronger):
        known &= np.isfinite(each.attenuation[independent])
    span = (STRETCH[1] - STRETCH[0]) * packing.network.length
    highest_sent = _highest_sent(packing, wave.frequency[-1])
    nepers = wave.attenuation[independent] * span
    not_too_weak = nepers < MAX_NEPERS
    sent = wave.frequency[independent] <= highest_sent
    chosen = independent[known & not_too_weak & sent]
    decay_numbers = {
        "frequencies": (known & not_too_weak).sum(),
        "all_frequencies": known.sum(),
        "nepers": nepers[known].max(initial=-np.inf),
        "limit": MAX_NEPERS,
    }
    source_numbers = {
        "highest": wave.frequency[-1],
        "source_end": highest_sent,
        "least_source_share": MIN_SOURCE_SHARE,
    }
    steps = (
        *map(_step_of_wave, (DECAY, *OTHER_DECAYS), (wave, weaker, stronger)),
        limit_step(decay_numbers, "nepers", "limit"),
        limit_step(source_numbers, "highest", "source_end"),
        _step_of_frequencies(wave.frequency[chosen], len(independent), wave.resolution),
    )
    if not len(chosen):
        raise UnreadableError("no_coherent_wave", "no coherent wave is left to be read", steps)
    change = abs(weaker.attenuation - stronger.attenuation)[chosen]
    error = np.maximum.reduce([change, np.roll(change, 1), np.roll(change, -1)])
    frequency = wave.frequency[chosen]
    caveats = of_frequency(packing, frequency[0])
    if highest_sent < wave.frequency[-1]:
        values = {"frequency": hertz(highest_sent), "share": MIN_SOURCE_SHARE}
        caveats += (Caveat("faint_source", values),)
    value = Value(
        wave.attenuation[chosen], "1/m", {"resolution": error}, caveats, frequency, steps=steps
    )
    return value, wave.group_velocity[chosen]


def _step_of_wave(decay: float, wave: Coherent) -> Step:
    """Return a step that describes the coherent wave under one damping of the window."""
    known = wave.frequency[np.isfinite(wave.attenuation)]
    outcome = "read" if len(known) else "no_wave"
    numbers = {"damping": decay, "end_frequency": known.max(initial=-np.inf)}
    return Step("window", outcome, numbers, wave.ended_by)


def _step_of_frequencies(chosen: Floats, count: int, resolution: float) -> Step:
    """Return the step that chooses some of `count` independent frequencies, (k,), Hz."""
    outcome = "read" if len(chosen) else "none_left"
    numbers = {
        "resolution": resolution,
        "frequencies": len(chosen),
        "all_frequencies": count,
        "lowest": chosen.min(initial=np.inf),
        "highest": chosen.max(initial=-np.inf),
    }
    return Step("window", outcome, numbers)


def _highest_sent(packing: PackingData, highest: float) -> float:
    """Return the frequency, Hz, up to which the source excites waves, at most `highest`."""
    record = packing.wave
    displacement = record.source_displacement[:, None]
    frequency, amplitude = spectra(record.time, displacement, 1.01 * highest)
    faint = np.flatnonzero(amplitude[:, 0] < MIN_SOURCE_SHARE * amplitude.max())
    strongest = frequency[np.argmax(amplitude)]
    faint = faint[frequency[faint] > strongest]
    if len(faint):
        return float(frequency[faint[0]])
    return highest


@quantity("1/m", definition="decay of the coherent wave's amplitude along z, over frequency")
def attenuation(packing: PackingData) -> Value:
    """Measure the attenuation, 1/m, of layers' mean motion after a pulse of the wall."""
    return attenuation_of(packing)[0]


@quantity("1", definition="quality factor omega / (2 alpha v) of the coherent wave, over frequency")
def quality(packing: PackingData) -> Value:
    """Measure the quality factor: the frequency divided by the width of the line of the decay.

    alpha is the attenuation, v the group velocity. The value is unknown where alpha is less than
    `MIN_ATTENUATION_IN_ERRORS` errors above zero.
    """
    alpha = attenuation_of(packing)[0]
    line = scattering_of_pulse(packing)
    above_zero = alpha.value > MIN_ATTENUATION_IN_ERRORS * alpha.error
    numbers = {
        "frequencies": above_zero.sum(),
        "all_frequencies": len(above_zero),
        "attenuation_in_errors": _largest_in_errors(alpha),
        "limit": MIN_ATTENUATION_IN_ERRORS,
    }
    limit = limit_step(numbers, "attenuation_in_errors", "limit", least=True)
    steps = (*alpha.steps, limit)
    if not above_zero.any():
        return unknown("1", Caveat("no_attenuation"), *alpha.caveats, steps=steps)
    width = np.where(above_zero, line.value, np.nan)
    value = alpha.at / width
    parts = {name: value * part / width for name, part in line.parts.items()}
    return Value(value, "1", parts, alpha.caveats, alpha.at, steps=steps)


def _largest_in_errors(value: Value) -> float:
    """Return the largest number of an array divided by its error; infinite for an exact one."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nanmax(value.value / value.error, initial=-np.inf))


@quantity(
    "Hz",
    definition="frequency at which the mean free path falls to half a wavelength",
    spectrum="structure",
)
def ioffe_regel(packing: PackingData) -> Value:
    """Measure the Ioffe-Regel frequency between two standing waves.

    The two waves are neighbours between whose frequencies the limit lies. The error is half of the
    distance of these frequencies.
    """
    if packing.crystal:
        return unknown("Hz", Caveat("crystal"))
    ridge = scattering(packing)
    steps = (step_of_limit(ridge),)
    if not np.isfinite(ridge.limit):
        caveat = Caveat("no_short_free_path")
        if steps[0].outcome == "starts_beyond":
            caveat = Caveat("beyond_limit", {"lowest": steps[0].numbers["lowest"]})
        return unknown("Hz", caveat, steps=steps)
    distance = np.sort(abs(ridge.frequency - ridge.limit))[:2].sum()
    caveats = packing.of_one_sample
    wavelength = ridge.velocity / ridge.limit
    if wavelength > packing.width * packing.diameter:
        caveats = of_frequency(packing, ridge.limit)
    return Value(ridge.limit, "Hz", {"resolution": distance / 2}, caveats, steps=steps)


def step_of_limit(ridge: Scattering) -> Step:
    """Return a step that describes the search for the Ioffe-Regel limit on a ridge."""
    ratio = np.pi * ridge.width / ridge.frequency
    numbers = {
        "waves": len(ratio),
        "lowest": ridge.frequency.min(initial=np.inf),
        "highest": ridge.frequency.max(initial=-np.inf),
        "scattering_ratio": ratio.max(initial=-np.inf),
        "limit": 1.0,
    }
    outcome = "reached"
    if not (ratio >= 1).any():
        outcome = "not_reached"
    elif ratio[0] >= 1:
        outcome = "starts_beyond"
    return Step("limit", outcome, numbers)


@on_request("Hz", definition="width of the line that a pulse's decay makes, alpha v / pi")
def scattering_of_pulse(packing: PackingData) -> Value:
    """Measure the line width of a decaying pulse at each frequency.

    A wave that fades as exp(-alpha x) in space fades as exp(-alpha v t) in time, with the measured
    group velocity v at which energy travels. Its line width is alpha v / pi. Under the window
    exp(-eta t) the wave number is smaller by eta d alpha / d omega, and the error of the slowness
    is the derivative of this change. This change is added to the error and not corrected, because
    second derivatives are noise.
    """
    alpha, velocity = attenuation_of(packing)
    assert alpha.at is not None
    wave = coherents(packing)[0]
    omega = 2 * np.pi * wave.frequency
    curvature = np.gradient(np.gradient(wave.attenuation, omega), omega)
    bias = velocity * wave.resolution * np.interp(alpha.at, wave.frequency, curvature)
    value = velocity / np.pi * alpha.value
    parts = {"fit": value * bias, "resolution": velocity / np.pi * alpha.error}
    return Value(value, "Hz", parts, alpha.caveats, alpha.at, steps=alpha.steps)


def _width_of_lines(packing: PackingData, polarisation: str) -> Value:
    """Measure the full width of the line of plane waves along the axes of a periodic cell, Hz.

    The waves with the same number of periods along x, y and z make one line. The error combines the
    scatter of the widths along the axes with the scatter of the frequencies, which widens the line.
    """
    network = packing.network
    if not network.cell_periodic.all():
        return unknown("Hz", Caveat("walls"))
    network.refuse_angles("width of lines along the axes")
    shortest = MIN_WAVELENGTH_IN_DIAMETERS * packing.diameter
    most_periods = int(network.cell_size.min() / shortest)
    if most_periods < 1:
        return unknown("Hz", Caveat("narrow_for_waves"))
    axes = np.eye(3, dtype=int)
    orders = np.concatenate([periods * axes for periods in range(1, most_periods + 1)])
    highest = 1.5 * v_p(packing).value / shortest
    structure = structure_factor(network, orders, packing.line, highest, polarisation)
    peaks_of_axes, widths_of_axes = (each.reshape(most_periods, 3) for each in structure.ridge())
    power = structure.power.reshape(most_periods, 3, -1).mean(axis=1)
    peak, width = replace(structure, order=orders[::3], power=power).ridge()
    known = np.isfinite(peak) & np.isfinite(width)
    numbers = {
        "periods": most_periods,
        "resolution": packing.line,
        "lines": known.sum(),
        "lowest": peak[known].min(initial=np.inf),
        "highest": peak[known].max(initial=-np.inf),
    }
    if not known.any():
        return unknown("Hz", Caveat("no_line"), steps=(Step("window", "none_left", numbers),))
    steps = (Step("window", "read", numbers),)
    error_of_width = np.nanstd(widths_of_axes, axis=1) / np.sqrt(3)
    scatter_of_peaks = np.nanstd(peaks_of_axes, axis=1)
    error = np.hypot(np.hypot(error_of_width, scatter_of_peaks), packing.line / 10)
    parts = {"fit": error[known]}
    return Value(width[known], "Hz", parts, packing.of_one_sample, peak[known], steps=steps)


# 2 pi times this width is the rate at which disorder takes energy from a plane wave.
for _wave, _polarisation in (("p", "L"), ("s", "T")):
    _definition = f"full width of the line of plane {_wave.upper()}-waves, over its frequency"
    on_request("Hz", name=f"scattering_of_{_wave}", definition=_definition)(
        partial(_width_of_lines, polarisation=_polarisation)
    )


@cached_on_packing
def scattering(packing: PackingData) -> Scattering:
    """Measure the width of the ridge of standing waves at each frequency, up to its limit.

    A few waves of all wavelengths are computed first. If the Ioffe-Regel limit lies among them,
    more waves on both sides of the limit give the result.
    """
    long_wave = v_p(packing)
    velocity = long_wave.value
    structure = kept_file(packing, "structure")
    if not velocity > 0:
        raise UnreadableError("no_coherent_wave", LOST, long_wave.steps)
    if structure is not None:
        return structure.scattering(velocity, packing.diameter)
    length = packing.network.length
    # Between walls a wave of order 1 has half a wavelength in the length, in a periodic cell a
    # whole one.
    orders_per_wavelength = 1
    if packing.walls:
        orders_per_wavelength = 2
    most = max(1.0, 0.5 * orders_per_wavelength * length / packing.diameter)
    lowest = max(1.0, most / 20)
    coarse = _ridge_of_orders(packing, velocity, np.geomspace(lowest, most, WAVES_OF_RIDGE))
    if not np.isfinite(coarse.limit):
        return coarse
    order = orders_per_wavelength * length * coarse.limit / velocity
    near_limit = np.linspace(0.7 * order, 1.2 * order, WAVES_OF_RIDGE)
    return _ridge_of_orders(packing, velocity, near_limit)


def _ridge_of_orders(packing: PackingData, velocity: float, orders: Floats) -> Scattering:
    """Return the ridge of the structure factor at some orders along z, rounded to whole numbers."""
    whole = np.unique(orders.round()).astype(int)
    if not packing.walls:
        whole = whole[:, None] * np.array([0, 0, 1])
    line = LIMIT_LINE_IN_LINES * packing.line
    highest = MAX_FREQUENCY_OF_RIDGE_IN_V_PER_D * velocity / packing.diameter
    structure = structure_factor(packing.network, whole, line, highest)
    return structure.scattering(velocity, packing.diameter)


@cached_on_packing
def whole_ridge(packing: PackingData) -> Scattering:
    """Return the ridge, with its width, of all waves in a file with the structure factor."""
    structure = packing.case.needed("structure")
    velocity = longest(packing, "linear").value
    return structure.scattering(velocity, packing.diameter)


def free_path(packing: PackingData) -> Value:
    """Measure the mean free path of the coherent wave at f_low-pass (2 %), in diameters."""
    ridge = whole_ridge(packing)
    frequency = low_pass_2(packing)
    numbers = {
        "lowest": ridge.frequency.min(initial=np.inf),
        "highest": ridge.frequency.max(initial=-np.inf),
        "velocity": ridge.velocity,
        "frequency": frequency,
    }
    path = ridge.free_path(frequency)
    outcome = "read" if np.isfinite(path) else "none_left"
    return estimate(path, steps=(Step("window", outcome, numbers),))


def width_power(packing: PackingData) -> Value:
    """Fit the power of the frequency that the ridge's width follows near f_low-pass."""
    frequency = scale(packing)
    law = whole_ridge(packing).power(frequency)
    low, high = POWER_RANGE
    numbers = {
        "lowest": low * frequency,
        "highest": high * frequency,
        "exponent": law.exponent,
        "exponent_error": law.error,
    }
    outcome = "fitted" if np.isfinite(law.exponent) else "too_few"
    return estimate(law.exponent, law.error, steps=(Step("fit", outcome, numbers),))
