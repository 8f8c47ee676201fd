"""Up to which frequency waves pass: the paper's threshold rule, and without its bias."""

from __future__ import annotations

import numpy as np
from scipy.optimize import isotonic_regression

from analysis.estimators.damped_transform import chain_dispersion
from analysis.estimators.layer_lattice import LayerLattice
from analysis.estimators.low_pass import SHORTEST
from analysis.measuring import Measuring
from analysis.quantities.registry import quantity
from analysis.value import Value, hertz, unknown

LEFT = 0.02
"""Of the amplitude, `SHORTEST` diameters on, at the unbiased low-pass of a random packing."""
SURE = 0.25
"""Largest distance of its crossings, relative, with which that frequency is told."""


def _exact(lattice: LayerLattice) -> float:
    return lattice.low_pass_frequency


@quantity(
    "low_pass",
    "Hz",
    "frequency above which less than 2 % of the amplitude arrives",
    exact=_exact,
    bias=0.03,
)
def low_pass(packing: Measuring) -> Value:
    """The 2 % rule of Otsubo et al. (2017), section 5.1, as `analysis.estimators.low_pass` has it.

    Of random packings the mean over all columns of spheres, with their scatter; of crystals, and of
    records without single particles, along the one chain.
    """
    band, caveats = packing.passband, packing.of_waves
    edge = band.low_pass[0]
    if not edge.flat and np.isfinite(edge.value):
        caveats += (f"no plateau: it changes by {100 * edge.change:.0f} % to either side",)
    length = packing.network.length / packing.diameter
    if not packing.crystal and length < SHORTEST:
        text = f"too short: {length:.1f} D long, the rule needs {SHORTEST:g} D and reads too high"
        caveats += (text,)
    elif not packing.crystal and len(band.of_columns):
        edge = band.mean_of_columns
    if not np.isfinite(edge.value):
        return unknown("Hz", edge.why or "the rule finds no frequency", *caveats)
    caveats += packing.of_frequency(edge.value)
    return Value(edge.value, "Hz", {"chain": edge.error}).with_caveats(*caveats)


@quantity(
    "low_pass_unbiased",
    "Hz",
    "upper end of the band of P-waves, without a threshold on a record",
    exact=_exact,
)
def low_pass_unbiased(packing: Measuring) -> Value:
    """Of a crystal the edge of its band; of disorder where little is left of the coherent wave.

    Disorder has no band edge. What stands for it is the frequency at which the coherent wave fades
    to 2 %, the part of the paper's rule, over 50 D, a length of every packing alike: alpha(f) 50 D
    = ln 50, alpha being free of source, record and length.

    The error is that of one packing: what other windows make of it, how far the crossings lie
    apart, and that its attenuation is one draw for each `Coherent.resolution`: within a line so
    wide the crossing may be anywhere, a standard deviation of the width over root 12. Five packings
    of 4,000 spheres without friction, 69 D long and 7 D wide, gave 20.7 to 26.8 kHz, a scatter of
    2.3 kHz; a line is 9.3 kHz wide there, the error thus 2.7 kHz. It is too large for wide ones,
    whose layers average more: three of 8,000 spheres, 55 D long and 11 D wide, scattered by 1.0
    kHz, with errors of 3.3.
    """
    if packing.crystal:
        value, other = (
            chain_dispersion(packing.wave, order=order).low_pass_frequency for order in (2, 3)
        )
        return Value(value, "Hz", {"fit": abs(value - other)}, packing.of_waves)
    wanted = np.log(1 / LEFT) / (SHORTEST * packing.diameter)
    ends = np.array(
        [_rise(w.frequency, w.attenuation, wanted) for w in packing.coherents]  # (windows, 3)
    )
    if not np.isfinite(ends).all():
        return unknown("Hz", "the coherent wave is lost before it fades as much", *packing.of_waves)
    first, value, last = ends[0]
    caveats = packing.of_frequency(value)
    line = packing.coherent.resolution / np.sqrt(12)
    parts = {"fit": (last - first) / 2, "chain": abs(ends[1, 1] - ends[2, 1]), "resolution": line}
    found = Value(value, "Hz", parts, caveats)
    if not np.hypot(parts["fit"], parts["chain"]) <= SURE * value:
        text = f"no plateau: attenuation rises through it from {hertz(first)} to {hertz(last)}"
        return unknown("Hz", text, *caveats)
    return found


def _rise(frequency: np.ndarray, values: np.ndarray, level: float) -> tuple[float, float, float]:
    """Where values (n,) first rise through a level, where their rising fit does, and where last.

    NaN where they do not, or not before they end.
    """
    known = np.isfinite(values)
    f, v = frequency[known], values[known]
    above = np.flatnonzero(v >= level)
    below = np.flatnonzero(v < level)
    if not len(above) or not len(below) or above[0] == 0 or below[-1] == len(v) - 1:
        return np.nan, np.nan, np.nan

    def crossing(curve: np.ndarray, at: int) -> float:
        return float(np.interp(level, curve[[at - 1, at]], f[[at - 1, at]]))

    rising = isotonic_regression(v).x
    middle = crossing(rising, int(np.searchsorted(rising, level)))
    return crossing(v, above[0]), middle, crossing(v, below[-1] + 1)
