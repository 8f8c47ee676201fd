"""Velocities of the longest waves along z, P and S, and what other ways of reading them give.

The one to quote is that of the coherent wave extrapolated to zero frequency: it does not depend on
a threshold, a chain or the pulse. `v_p_static` comes from no wave at all and should agree. Waves
are called by their names, of `PackingData.record`.
"""

from dataclasses import replace

import numpy as np

from analysis.case import AbsentError
from analysis.caveats import Caveat
from analysis.estimators.coherent import DECAY, Coherent, coherent_wave, longest_waves
from analysis.estimators.damped_transform import Dispersion, chain_dispersion
from analysis.estimators.travel_time import first_peaks_of_columns, travelled
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities.registry import quantity
from analysis.value import Value, hertz, unknown
from modal.elasticity.slab import static_velocity
from modal.tools.errors import UnavailableError

ORDERS = {"z": (2, 3), "x": (5, 6), "y": (5, 6)}
"""Orders of a crystal's neighbour ratio, of the value and of what its error is told by. Layers turn
as they slide, so that S-waves need a higher one."""
LONGEST = 8.0
"""Wavelength, mean diameters, from which on an S-wave of a random packing counts as long."""
OTHERS = DECAY - 1, DECAY + 1
"""Dampings of the window of the coherent wave that tell, beside the estimator's, an error."""
HIGHEST = {True: 0.5, False: 0.2}
"""Highest frequency of the coherent wave, in V / D, of a crystal or not."""
SHORT, TOO_HIGH = 15.0, 0.15
"""Diameters: in shorter random packings the longest waves do not fit beside the walls, and their
velocities read too high, by this part. Of friction 0.2, 8.7 D wide, three seeds each, against 39 D:
V_P by 12, 5 and 3 % at 10, 11 and 14 D (one by 15), V_S by 12, 7 and 8 % (one by 20); at 16 to 25 D
by 1 to 3 and 0 %."""
LOW_ORDER = 10
"""Low frequency means that of the standing wave r = 10, wavelength L / 5."""
LOST = "no coherent wave goes through enough of the packing to be read"
TOO_FAST = 1.1
"""Of a crystal's V_P: what is as fast is noise, as of a pulse far off the band, in kHz for Hz."""


@cached_on_packing
def chain(m: PackingData, key: str, order: int = 0) -> Dispersion:
    """The dispersion of a crystal's chain, to an order of its neighbour ratio."""
    record = m.record(key)
    found = chain_dispersion(record, order=order or ORDERS[record.direction][0])
    if not found.velocity < TOO_FAST * m.lattice.velocity:
        raise UnavailableError(LOST, code="no_coherent_wave")
    return found


@cached_on_packing
def coherent(m: PackingData, key: str, decay: float = DECAY) -> Coherent:
    """The coherent wave of a record, of S-waves as far as they are long."""
    record, length = m.record(key), m.network.length
    if record.direction != "z":
        first = travelled(record, m.network.wall_position)[0]
        highest = first / (LONGEST * m.diameter) if first > 0 else None
        return coherent_wave(record, length, highest=highest, decay=decay)
    if m.crystal:  # slabs a diameter thick would beat with its layers
        record = replace(record, layer_displacement=None)
    highest = HIGHEST[m.crystal] * m.affine_frequency
    return coherent_wave(record, length, highest=highest, decay=decay)


def coherents(m: PackingData) -> list[Coherent]:
    """That of the P-wave under windows of three dampings: how far the window decides."""
    return [coherent(m, "wave"), *(coherent(m, "wave", decay) for decay in OTHERS)]


@cached_on_packing
def longest(m: PackingData, key: str) -> Value:
    """Velocity, m/s, of the longest waves of a record, with its errors of the fit and the window.

    A window moves a velocity in proportion to its damping: by so much from none to its own. Of 30
    velocities in slabs 45 to 90 D long, cut from repeats of cells whose moduli tell V, the fit's
    own errors were a third of what these were off, with this part 1.1 of it.
    """
    record = m.record(key)
    if key == "yade" and not m.crystal and record.layer_displacement is None:
        raise AbsentError
    if m.crystal:
        value, other = (chain(m, key, order).velocity for order in ORDERS[record.direction])
        return Value(value, "m/s", {"fit": abs(value - other)})
    value, error = longest_waves(coherent(m, key))
    less, more = (longest_waves(coherent(m, key, decay))[0] for decay in OTHERS)
    if not np.isfinite(value + less + more):  # as of a pulse much longer than the packing
        return unknown("m/s", Caveat("wave_lost"))
    window = DECAY * abs(more - less) / (OTHERS[1] - OTHERS[0])
    return Value(value, "m/s", {"fit": error, "chain": window})


def _told(value: float, error: float, scatter: float = 0.0) -> Value:
    if not np.isfinite(value):
        return unknown("m/s", Caveat("first_arrival_stands"))
    return Value(value, "m/s", {"fit": error, "chain": float(np.nan_to_num(scatter))})


@cached_on_packing
def first_peak(m: PackingData, key: str) -> Value:
    """dL/dt of a record's first peaks, middle half of the chain, m/s.

    Of P-waves with the error of the fit and of the choice of the chain.
    """
    record = m.record(key)
    if record.direction != "z":
        return _told(*travelled(record, m.network.wall_position))
    scatter = columns(m, "wave" if key == "wave" else "linear")[1]
    return _told(*travelled(m.cut(key), m.network.wall_position), scatter)


@cached_on_packing
def columns(m: PackingData, key: str) -> tuple[float, float]:
    """V_P, m/s, of first peaks along every column, a sphere wide: mean and scatter.

    NaN where single particles are not recorded.
    """
    return first_peaks_of_columns(m.cut(key), m.network)


def of_frequency(m: PackingData, frequency: float) -> tuple[Caveat, ...]:
    """What to know of what is read at a frequency, Hz, where the wave may be wider than the cell.

    As the wave of V_P has it, of which none is shorter at this frequency.
    """
    length = v_p(m).value / frequency / m.diameter
    if m.crystal or not length > m.width:
        return m.of_waves
    values = {"wavelength": length, "frequency": hertz(frequency), "width": m.width}
    return (*m.of_waves, Caveat("wavelength_above_width", values))


def _quoted(m: PackingData, key: str, places: slice) -> Value:
    """By a wave; of a cell without walls, that no wall can push, by its moduli."""
    if m.walls:
        found, length = longest(m, key).with_caveats(*m.of_waves), m.network.length / m.diameter
        if m.crystal or not found.known or length >= SHORT:
            return found
        caveat = Caveat("short", {"length": length, "needed": SHORT, "too_high": TOO_HIGH})
        parts = {**found.parts, "length": TOO_HIGH * found.value}
        return replace(found.with_caveats(caveat), parts=parts)
    value = float(m.moduli.velocities((0, 0, 1))[places].mean())
    why = Caveat("no_walls")
    return Value(value, "m/s", {"fit": 0.5 * value * m.moduli.error}, (why, *m.of_one_sample))


@quantity("m/s", definition="velocity of the longest P-waves along z; the one to quote")
def v_p(m: PackingData) -> Value:
    """Velocity of the longest P-waves along z; the one to quote.

    Of the coherent wave from the wall; of a cell without walls by its moduli.
    """
    return _quoted(m, "wave", slice(0, 1))


@quantity("m/s", definition="velocity of the longest S-waves along z; the one to quote")
def v_s(m: PackingData) -> Value:
    """Velocity of the longest S-waves along z; the one to quote.

    As `v_p`, of a wall that slides along x.
    """
    return _quoted(m, "shear_wave", slice(1, 3))


@quantity("m/s", definition="velocity of P-waves by the springs' answer to a steady push")
def v_p_static(m: PackingData) -> Value:
    """Velocity of P-waves by the springs' answer to a steady push.

    Independent of every rule that reads waves.
    """
    m.require_walls()
    bulk = static_velocity(m.network)
    return Value(bulk.velocity, "m/s", {"fit": bulk.error}, m.of_one_sample)


@quantity("m/s", definition="velocity of first peaks along the chain, as of the paper")
def v_p_first_peaks(m: PackingData) -> Value:
    """Velocity of first peaks along the chain, as of the paper.

    Depends on pulse and chain: of disorder the first peak broadens on its way.
    """
    return first_peak(m, "wave").with_caveats(*m.of_waves)
