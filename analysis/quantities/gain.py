"""Measure how strongly waves pass from wall to wall: the gain factor and its maxima."""

import numpy as np

from analysis.caveats import Caveat
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities.passband import low_pass_2
from analysis.quantities.registry import on_request
from analysis.quantities.spectrum import standing_waves
from analysis.quantities.velocity import longest
from analysis.spectra_cache import compute_spectrum, kept_file
from analysis.steps import Step
from analysis.value import Value, hertz
from modal.tools.arrays import Floats
from modal.waves.response import Response, maxima

MAX_ORDER_ERROR = 0.75
"""Largest distance between the order of a maximum and the expected one. A distance of 1/2 would be
a resonance between two held walls, 1 the next maximum."""


@cached_on_packing
def gain_of(packing: PackingData) -> Response:
    """Return the response to P-waves from wall to wall without damping; it contains the gain."""
    packing.require_walls()
    return kept_file(packing, "response") or compute_spectrum(packing, "response")


@on_request(
    "1",
    definition="stress on the receiver over that on the source wall, over frequency",
    spectrum="response",
)
def gain(packing: PackingData) -> Value:
    """Measure the gain factor of P-waves without damping at each frequency."""
    response = gain_of(packing)
    caveat = Caveat("gain_resolution", {"width": hertz(response.resolution)})
    caveats = (caveat, *packing.of_waves)
    steps = (step_of_gain(response),)
    return Value(response.gain, "1", {}, caveats, response.frequency, steps=steps)


def step_of_gain(response: Response) -> Step:
    """Return a step with the frequency range of the gain, and its first maximum."""
    frequency, height = maxima(response.frequency, response.gain)
    numbers = {
        "lowest": response.frequency[0],
        "highest": response.frequency[-1],
        "frequencies": len(response.frequency),
        "resolution": response.resolution,
        "maxima": len(frequency),
    }
    if len(frequency):
        numbers["first_gain"] = height[0]
        numbers["first_gain_frequency"] = frequency[0]
    return Step("window", "read", numbers)


def passage(packing: PackingData) -> float:
    """Return the time, s, that the longest waves take from wall to wall."""
    return packing.network.length / longest(packing, "linear").value


def first_resonance(packing: PackingData) -> float:
    """Return the frequency f_1 of the first P resonance, Hz.

    It is the frequency of the first standing wave among the modes; if this is not known, it is V_P
    / 2 L, with the velocity V_P of the longest waves.
    """
    frequency = standing_waves(packing)[0]
    if len(frequency):
        return float(frequency[0])
    return 0.5 / passage(packing)


def orders(packing: PackingData) -> Floats:
    """Return the maxima (k,) of the gain as orders r of a column with both walls held, f = r f_1.

    The order of a maximum is the r at which a standing wave has its frequency, interpolated between
    the measured resonances, which include dispersion. The source wall is free of stress, so that
    1/2, 3/2, ... are expected. The list ends at the first missing or additional maximum, after
    which orders would be wrong by one.
    """
    frequency = gain_of(packing).gain_maxima()
    end = low_pass_2(packing)
    if np.isfinite(end):
        # Above the low-pass frequency no wave reaches both walls.
        frequency = frequency[frequency < end]
    resonance, wavenumber = standing_waves(packing)
    highest_so_far = np.maximum.accumulate(np.nan_to_num(resonance))
    rising = np.isfinite(resonance) & (highest_so_far == resonance)
    order = frequency / first_resonance(packing)
    if rising.sum() > 1:
        known_order = np.append(0.0, wavenumber[rising] * packing.network.length / np.pi)
        known_frequency = np.append(0.0, resonance[rising])
        order = np.interp(frequency, known_frequency, known_order, right=np.nan)
    expected = np.arange(0.5, len(frequency))
    # NaN counts as wrong.
    wrong = np.flatnonzero(~(abs(order - expected) < MAX_ORDER_ERROR))
    if len(wrong):
        return order[: wrong[0]]
    return order


def height(packing: PackingData) -> str:
    """Describe the gain at its first maximum, its resolution, and that of an undamped column."""
    response = gain_of(packing)
    heights = maxima(response.frequency, response.gain)[1]
    if not len(heights):
        return ""
    of_column = 1 / np.sinh(np.pi * response.resolution * passage(packing))
    resolution = f"{response.resolution:.0f} Hz"
    return f"{heights[0]:.3g} at {resolution} (undamped column: {of_column:.3g})"
