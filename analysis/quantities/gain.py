"""What is heard of one wall at the other: the gain factor, and where its maxima lie."""

import numpy as np

from analysis.caveats import Caveat
from analysis.packing_data import PackingData, cached_on_packing
from analysis.prepare import kept_file, made
from analysis.quantities.passband import low_pass_2
from analysis.quantities.registry import on_request
from analysis.quantities.spectrum import standing_waves
from analysis.quantities.velocity import longest
from analysis.value import Value, hertz
from modal.tools.arrays import Floats
from modal.waves.response import Response, maxima

MISCOUNTED = 0.75
"""Orders between a maximum and where it is expected, above which it is another's: 1/2 would be a
resonance of two held walls, 1 the next maximum."""


@cached_on_packing
def gain_of(m: PackingData) -> Response:
    """The response that has the gain factor of P-waves from wall to wall, without damping."""
    m.require_walls()
    return kept_file(m, "response") or made(m, "response")


@on_request("1", definition="stress on the receiver over that on the source wall, over frequency")
def gain(m: PackingData) -> Value:
    """Stress on the receiver over that on the source wall, over frequency.

    Of P-waves, without damping.
    """
    found = gain_of(m)
    caveat = Caveat("gain_resolution", {"width": hertz(found.resolution)})
    return Value(found.gain, "1", {}, (caveat, *m.of_waves), found.frequency)


def passage(m: PackingData) -> float:
    """Time, s, of the longest waves from wall to wall."""
    return m.network.length / longest(m, "linear").value


def first_resonance(m: PackingData) -> float:
    """f_1, Hz, of the first P resonance: of its mode, else V_P / 2 L of the long waves."""
    f = standing_waves(m)[0]
    return float(f[0]) if len(f) else 0.5 / passage(m)


def orders(m: PackingData) -> Floats:
    """The gain's maxima (k,) as orders r of a column with both walls held: f = r f_1.

    Each is looked up among the measured resonances r f_1, which bend with dispersion: the order r
    at which a standing wave has its frequency, by interpolation. Where the source wall is free of
    stress 1/2, 3/2, ... are expected. They end where a maximum is missing or one too many, an order
    off, and they no longer count.
    """
    f, end = gain_of(m).gain_maxima(), low_pass_2(m)
    if np.isfinite(end):  # beyond it the walls hear no common wave
        f = f[f < end]
    f_r, kappa = standing_waves(m)
    rising = np.isfinite(f_r) & (np.maximum.accumulate(np.nan_to_num(f_r)) == f_r)
    found = f / first_resonance(m)
    if rising.sum() > 1:
        order = np.append(0.0, kappa[rising] * m.network.length / np.pi)
        found = np.interp(f, np.append(0.0, f_r[rising]), order, right=np.nan)
    lost = np.flatnonzero(~(abs(found - np.arange(0.5, len(f))) < MISCOUNTED))
    return found[: lost[0] if len(lost) else None]


def height(m: PackingData) -> str:
    """The gain at its first maximum with its resolution, and an undamped column's under it."""
    found = gain_of(m)
    same = 1 / np.sinh(np.pi * found.resolution * passage(m))
    told = f"at {found.resolution:.0f} Hz (undamped column: {same:.3g})"
    heights = maxima(found.frequency, found.gain)[1]
    return f"{heights[0]:.3g} {told}" if len(heights) else ""
