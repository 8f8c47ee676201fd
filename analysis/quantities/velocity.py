"""Measure the velocities of the longest P- and S-waves along z, and other readings of them.

The velocity to quote is that of the coherent wave, extrapolated to zero frequency: it depends
neither on a threshold, nor on a chain, nor on the pulse. `v_p_static` needs no wave at all and
should agree with it. The argument `key` is the name of a wave, as in `PackingData.record`.
"""

from dataclasses import replace

import numpy as np

from analysis.case import AbsentError
from analysis.caveats import Caveat
from analysis.estimators.coherent import (
    DECAY,
    MIN_FREQUENCIES,
    Coherent,
    coherent_wave,
    fitted_frequencies,
    longest_waves,
)
from analysis.estimators.damped_transform import Dispersion, chain_dispersion
from analysis.estimators.travel_time import first_peaks_of_columns, layers_above, travelled
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities.few_digits import part_of_moduli_error
from analysis.quantities.registry import on_request, quantity
from analysis.steps import Step, UnreadableError, limit_step
from analysis.value import Value, hertz, unknown
from modal.elasticity.slab import static_velocity

FIT_ORDERS = {"z": (2, 3), "x": (5, 6), "y": (5, 6)}
"""Orders of the fit to a crystal's neighbour ratio, by direction: the order of the value, and the
order whose value differs from it by the error. Layers rotate as they slide, so that S-waves need a
higher order."""
MIN_SHEAR_WAVELENGTH_IN_DIAMETERS = 8.0
"""Least wavelength, in mean diameters, at which an S-wave of a random packing counts as long."""
OTHER_DECAYS = DECAY - 1, DECAY + 1
"""Dampings eta T of two further windows; the difference of the results is the error that the choice
of the window makes."""
MAX_FREQUENCY_IN_V_PER_D_OF_CRYSTAL = 0.5
"""Highest frequency, in V / D, up to which the coherent wave of a crystal is read: its band ends at
0.45."""
MAX_FREQUENCY_IN_V_PER_D_OF_RANDOM = 0.2
"""Highest frequency, in V / D, up to which the coherent wave of a random packing is sought, far
above the frequency at which it is lost."""
MIN_LENGTH_IN_DIAMETERS = 15.0
"""Least length of a random packing, in mean diameters, in which the longest waves fit between the
walls; in shorter packings velocities are too high. Packings of friction 0.2, 8.7 D wide, of three
seeds each, were compared with packings of 39 D: V_P was higher by 12, 5 and 3 % at 10, 11 and 14 D
(in one by 15 %), V_S by 12, 7 and 8 % (in one by 20 %); at 16 to 25 D they were higher by 1 to 3 %
and by 0 %."""
RELATIVE_EXCESS_IN_SHORT_PACKING = 0.15
"""Relative error of a velocity in a packing shorter than `MIN_LENGTH_IN_DIAMETERS`."""
LOW_ORDER = 10
"""Highest order of the frequencies that count as low: that of the standing wave r = 10, with the
wavelength L / 5."""
LOST = "no coherent wave goes through enough of the packing to be read"
MAX_VELOCITY_IN_CRYSTAL = 1.1
"""Largest velocity divided by the V_P of the crystal's lattice. A faster wave is noise, which is
what remains if the pulse is far outside the band, as when its frequency is given in kHz instead of
Hz."""


@cached_on_packing
def chain(packing: PackingData, key: str, order: int = 0) -> Dispersion:
    """Measure the dispersion relation along a crystal's chain.

    `order` is the order of the fit to the neighbour ratio; 0 means the default order.
    """
    record = packing.record(key)
    order = order or FIT_ORDERS[record.direction][0]
    dispersion = chain_dispersion(record, order=order)
    largest = MAX_VELOCITY_IN_CRYSTAL * packing.lattice.velocity
    if not dispersion.velocity < largest:
        numbers = {"velocity": dispersion.velocity, "largest_velocity": largest}
        step = limit_step(numbers, "velocity", "largest_velocity")
        raise UnreadableError("no_coherent_wave", LOST, [step])
    return dispersion


@cached_on_packing
def coherent(packing: PackingData, key: str, decay: float = DECAY) -> Coherent:
    """Measure the coherent wave of a record; of an S-wave, only long waves.

    `decay` is the damping of the window over the record.
    """
    record = packing.record(key)
    length = packing.network.length
    if record.direction != "z":
        velocity = travelled(record, packing.network.wall_position)[0]
        highest = None
        if velocity > 0:
            highest = velocity / (MIN_SHEAR_WAVELENGTH_IN_DIAMETERS * packing.diameter)
        return coherent_wave(record, length, highest=highest, decay=decay)
    highest = MAX_FREQUENCY_IN_V_PER_D_OF_RANDOM * packing.affine_frequency
    if packing.crystal:
        highest = MAX_FREQUENCY_IN_V_PER_D_OF_CRYSTAL * packing.affine_frequency
        # Means over slabs of one diameter would beat with the layers of the crystal.
        record = replace(record, layer_displacement=None)
    return coherent_wave(record, length, highest=highest, decay=decay)


def coherents(packing: PackingData) -> list[Coherent]:
    """Return the coherent P-wave under the usual, a weaker and a stronger damping of the window."""
    return [coherent(packing, "wave", decay) for decay in (DECAY, *OTHER_DECAYS)]


@cached_on_packing
def longest(packing: PackingData, key: str) -> Value:
    """Measure the velocity of the longest waves of a record, m/s.

    The error combines that of the fit and that of the window. The window changes a velocity in
    proportion to the damping; this part of the error is the change from zero damping to the
    default. In a test with 30 velocities in slabs 45 to 90 D long, cut from repeated cells whose V
    follows from the moduli, the errors of the fit were a third of the true errors, and those of the
    window 1.1 times the true errors.
    """
    record = packing.record(key)
    if key == "yade" and not packing.crystal and record.layer_displacement is None:
        raise AbsentError
    if packing.crystal:
        order, next_order = FIT_ORDERS[record.direction]
        velocity = chain(packing, key, order).velocity
        next_velocity = chain(packing, key, next_order).velocity
        fits = (_step_of_order(order, velocity), _step_of_order(next_order, next_velocity))
        return Value(velocity, "m/s", {"fit": abs(velocity - next_velocity)}, steps=fits)
    steps = tuple(_step_of_damping(packing, key, decay) for decay in (DECAY, *OTHER_DECAYS))
    velocity, error = longest_waves(coherent(packing, key))
    weaker, stronger = OTHER_DECAYS
    under_weaker = longest_waves(coherent(packing, key, weaker))[0]
    under_stronger = longest_waves(coherent(packing, key, stronger))[0]
    if not np.isfinite(velocity + under_weaker + under_stronger):
        # As after a pulse that is much longer than the packing.
        return unknown("m/s", Caveat("wave_lost"), steps=steps)
    window = DECAY * abs(under_stronger - under_weaker) / (stronger - weaker)
    return Value(velocity, "m/s", {"fit": error, "window": window}, steps=steps)


def _step_of_order(order: int, velocity: float) -> Step:
    """Return a step that describes the fit of this order to a crystal's neighbour ratio."""
    return Step("fit", "fitted", {"order": order, "velocity": velocity})


def _step_of_damping(packing: PackingData, key: str, decay: float) -> Step:
    """Return a step that describes the fit to the longest waves under one damping."""
    wave = coherent(packing, key, decay)
    known = wave.frequency[np.isfinite(wave.attenuation)]
    frequency = wave.frequency[fitted_frequencies(wave)]
    velocity, error = longest_waves(wave)
    numbers = {
        "damping": decay,
        "velocity": velocity,
        "error": error,
        "frequencies": len(frequency),
        "needed": MIN_FREQUENCIES,
        "lowest": frequency.min(initial=np.inf),
        "highest": frequency.max(initial=-np.inf),
        "end_frequency": known.max(initial=-np.inf),
    }
    outcome = "fitted" if np.isfinite(velocity) else "too_few"
    return Step("window", outcome, numbers, wave.ended_by)


def _value_of_arrivals(velocity: float, error: float, scatter: float = 0.0) -> Value:
    """Return a velocity of first peaks; unknown if the fit found none."""
    numbers = {"velocity": velocity, "error": error}
    if not np.isfinite(velocity):
        steps = (Step("fit", "stands", numbers),)
        return unknown("m/s", Caveat("first_arrival_stands"), steps=steps)
    steps = (Step("fit", "fitted", numbers),)
    parts = {"fit": error, "chain": float(np.nan_to_num(scatter))}
    return Value(velocity, "m/s", parts, steps=steps)


@cached_on_packing
def first_peak(packing: PackingData, key: str) -> Value:
    """Measure the velocity of a record's first peaks over the middle half of the chain, m/s.

    The error of a P-wave includes the scatter between chains.
    """
    record = packing.record(key)
    walls = packing.network.wall_position
    if record.direction != "z":
        return _value_of_arrivals(*travelled(record, walls))
    key_of_columns = "linear"
    if key == "wave":
        key_of_columns = "wave"
    scatter = columns(packing, key_of_columns)[1]
    return _value_of_arrivals(*travelled(packing.cut(key), walls), scatter)


@cached_on_packing
def columns(packing: PackingData, key: str) -> tuple[float, float]:
    """Return mean and scatter of V_P, m/s, of first peaks along all columns one sphere wide.

    NaN if single particles are not recorded.
    """
    return first_peaks_of_columns(packing.cut(key), packing.network)


def of_frequency(packing: PackingData, frequency: float) -> tuple[Caveat, ...]:
    """Return the caveats of a quantity that is read at a frequency, Hz.

    One caveat says if the wave is longer than the cell is wide. The wavelength is estimated from
    V_P.
    """
    wavelength = v_p(packing).value / frequency / packing.diameter
    if packing.crystal or not wavelength > packing.width:
        return packing.of_waves
    values = {
        "wavelength": wavelength,
        "frequency": hertz(frequency),
        "width": packing.width,
    }
    return (*packing.of_waves, Caveat("wavelength_above_width", values))


def _measure_long_waves(packing: PackingData, key: str) -> Value:
    """Measure the velocity of the longest waves between two walls, m/s.

    In a short random packing velocities are too high, and the error includes this bias.
    """
    velocity = longest(packing, key).with_caveats(*packing.of_waves)
    length = packing.network.length / packing.diameter
    if packing.crystal:
        return velocity
    numbers = {"length": length, "limit": MIN_LENGTH_IN_DIAMETERS}
    is_short = length < MIN_LENGTH_IN_DIAMETERS
    if is_short:
        numbers["short_excess"] = RELATIVE_EXCESS_IN_SHORT_PACKING
    limit = limit_step(numbers, "length", "limit", least=True)
    velocity = replace(velocity, steps=(*velocity.steps, limit))
    if not velocity.known or not is_short:
        return velocity
    values = {
        "length": length,
        "needed": MIN_LENGTH_IN_DIAMETERS,
        "too_high": RELATIVE_EXCESS_IN_SHORT_PACKING,
    }
    parts = {**velocity.parts, "length": RELATIVE_EXCESS_IN_SHORT_PACKING * velocity.value}
    return replace(velocity.with_caveats(Caveat("short", values)), parts=parts)


def _velocity_by_moduli(packing: PackingData, polarisations: slice) -> Value:
    """Return the mean velocity, m/s, of plane waves along z by the moduli.

    The `polarisations` select velocities of `ElasticModuli.velocities`, which descend: the first is
    that of the P-wave.
    """
    velocity = float(packing.moduli.velocities((0, 0, 1))[polarisations].mean())
    error = 0.5 * velocity * packing.moduli.error
    steps = (Step("fit", "converged", {"residual": packing.moduli.error}),)
    caveats = (Caveat("no_walls"), *packing.of_one_sample)
    parts = {part_of_moduli_error(packing.network): error}
    return Value(velocity, "m/s", parts, caveats, steps=steps)


@quantity("m/s", definition="velocity of the longest P-waves along z; the one to quote")
def v_p(packing: PackingData) -> Value:
    """Measure V_P by the coherent wave from the wall; by the moduli in a cell without walls."""
    if packing.walls:
        return _measure_long_waves(packing, "wave")
    return _velocity_by_moduli(packing, slice(0, 1))


@quantity("m/s", definition="velocity of the longest S-waves along z; the one to quote")
def v_s(packing: PackingData) -> Value:
    """Measure V_S like V_P, by the wave from a wall that slides along x."""
    if packing.walls:
        return _measure_long_waves(packing, "shear_wave")
    return _velocity_by_moduli(packing, slice(1, 3))


@quantity("m/s", definition="velocity of P-waves by the springs' answer to a steady push")
def v_p_static(packing: PackingData) -> Value:
    """Measure V_P by the static response to a push, independent of all rules that read waves."""
    packing.require_walls()
    response = static_velocity(packing.network)
    numbers = {"velocity": response.velocity, "error": response.error}
    steps = (Step("fit", "fitted", numbers),)
    parts = {"fit": response.error}
    return Value(response.velocity, "m/s", parts, packing.of_one_sample, steps=steps)


@quantity("m/s", definition="velocity of first peaks along the chain, as of the paper")
def v_p_first_peaks(packing: PackingData) -> Value:
    """Measure V_P by first peaks along the chain, like Otsubo et al. (2017).

    The value depends on pulse and chain, because disorder broadens the first peak on its way.
    """
    return first_peak(packing, "wave").with_caveats(*packing.of_waves)


@on_request("m/s", definition="velocity of first peaks of layers above a source inside")
def v_other_source(packing: PackingData) -> Value:
    """Measure the velocity of a recorded wave from a plane, a sphere or a disc, or of torsion.

    The velocity is read from first peaks in the means over layers above the source. Near a small
    source there is no plane wave: use `python -m analysis transducers` for two discs.
    """
    record = packing.of_other_source
    if record is None:
        raise AbsentError
    velocity, error = layers_above(record, packing.network)
    return _value_of_arrivals(velocity, error).with_caveats(*packing.of_waves)
