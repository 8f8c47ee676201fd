"""Up to which frequency waves pass: the paper's threshold rule, and without its bias."""

import numpy as np

from analysis.estimators.low_pass import SHORTEST, Passband
from analysis.estimators.ridge import Ridge, ridge
from analysis.estimators.source_motion import cut
from analysis.estimators.wavenumber import chain_wavenumber
from analysis.measuring import Measuring, once
from analysis.quantities.registry import quantity
from analysis.quantities.velocity import LOST, chain, coherent, coherents, longest, of_frequency
from analysis.value import Value, hertz, unknown
from modal.packing.rattlers import force_bearing
from modal.tools.errors import InputError

LEFT = 0.02
"""Of the amplitude, `SHORTEST` diameters on, at the unbiased low-pass of a random packing."""
SURE = 0.25
"""Largest distance of its crossings, relative, with which that frequency is told."""


@once
def passband(m: Measuring, key: str = "linear") -> Passband:
    """The threshold rule on a record; on the linear wave with a run beside it."""
    m.require_walls()
    record, velocity = m.record(key), longest(m, key).value
    if not velocity > 0:
        raise InputError(LOST)
    run = m.yade if key == "linear" else None
    return Passband(m.network, record, run, velocity, m.crystal)


@once
def edges(m: Measuring, producer: str, whose: str = "chain", reference: str = "map") -> list[Value]:
    """f_low-pass by the thresholds, of `yade` or `linear`: `Passband.edges`.

    By the paper's words with the error of the choice of the chain.
    """
    band = passband(m)
    found = band.edges(m.record(producer), whose, reference, band.common)
    return band.of_any_chain(found) if (whose, reference) == ("chain", "map") else found


def low_pass_2(m: Measuring) -> float:
    """f_low-pass, Hz, by the 2 % rule of the paper on the linear wave."""
    return passband(m).low_pass[0].value


def scale(m: Measuring) -> float:
    """What figures scale their frequencies by, Hz: f_low-pass, or a guess without one."""
    found = low_pass_2(m)
    return found if np.isfinite(found) else 0.05 * longest(m, "linear").value / m.diameter


def band_edge(m: Measuring, key: str) -> float:
    """f_low-pass of a crystal, Hz, without the threshold's bias."""
    m.require_crystal()
    return chain(m, key).low_pass_frequency


@once
def ridge_of(m: Measuring, key: str) -> Ridge:
    """Frequency over wave number along the chain of a crystal."""
    return ridge(m.record(key))


def edge_wavelength(m: Measuring, key: str) -> float:
    """Wavelength at a crystal's band edge / D.

    Measured where the waves of the record turn round, not computed from the lattice (Eq. 7).
    """
    m.require_crystal()
    return ridge_of(m, key).edge_wavelength / m.diameter


def wavelength_at(m: Measuring, frequency: float, key: str) -> float:
    """Wavelength, m, along the chain of a record at a frequency, Hz.

    From the record as the threshold rule cuts it. Of a crystal from its ridge; NaN beyond the
    band edge, where no wave travels.
    """
    if m.crystal:
        return ridge_of(m, key).wavelength(frequency)
    record, band = m.record(key), passband(m)
    record, bearing = cut(record, band.end(record, band.common)), force_bearing(m.network)
    part, length = bearing[record.chain_particle], m.network.length
    kappa = chain_wavenumber(record, frequency, length, velocity=band.velocity, part=part)
    return 2 * np.pi / kappa


@quantity("Hz")
def low_pass(m: Measuring) -> Value:
    """Frequency above which less than 2 % of the amplitude arrives.

    The 2 % rule of Otsubo et al. (2017), section 5.1, as `analysis.estimators.low_pass` has it.

    Of random packings the mean over all columns of spheres, with their scatter; of crystals, and of
    records without single particles, along the one chain.
    """
    band = passband(m, "wave")
    edge = band.low_pass[0]
    caveats = m.of_waves + (edge.caveats if edge.known else ())
    length = m.network.length / m.diameter
    if not m.crystal and length < SHORTEST:
        text = f"too short: {length:.1f} D long, the rule needs {SHORTEST:g} D and reads too high"
        caveats += (text,)
    elif not m.crystal and len(band.of_columns):
        edge = band.mean_of_columns
    if not edge.known:
        return unknown("Hz", *edge.caveats, *caveats)
    caveats += of_frequency(m, edge.value)
    return Value(edge.value, "Hz", {"chain": edge.error}).with_caveats(*caveats)


@quantity("Hz")
def low_pass_unbiased(m: Measuring) -> Value:
    """Upper end of the band of P-waves, without a threshold on a record.

    Of a crystal the edge of its band; of disorder where little is left of the coherent wave.

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
    if m.crystal:
        value, other = (chain(m, "wave", order).low_pass_frequency for order in (2, 3))
        return Value(value, "Hz", {"fit": abs(value - other)}, m.of_waves)
    wanted = np.log(1 / LEFT) / (SHORTEST * m.diameter)
    ends = np.array([_rise(w.frequency, w.attenuation, wanted) for w in coherents(m)])
    if not np.isfinite(ends).all():
        return unknown("Hz", "the coherent wave is lost before it fades as much", *m.of_waves)
    first, value, last = ends[0]
    caveats = of_frequency(m, value)
    line = coherent(m, "wave").resolution / np.sqrt(12)
    parts = {"fit": (last - first) / 2, "chain": abs(ends[1, 1] - ends[2, 1]), "resolution": line}
    if not np.hypot(parts["fit"], parts["chain"]) <= SURE * value:
        text = f"no plateau: attenuation rises through it from {hertz(first)} to {hertz(last)}"
        return unknown("Hz", text, *caveats)
    return Value(value, "Hz", parts, caveats)


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

    from scipy.optimize import isotonic_regression  # takes a third of a second to load

    def crossing(curve: np.ndarray, at: int) -> float:
        return float(np.interp(level, curve[[at - 1, at]], f[[at - 1, at]]))

    rising = isotonic_regression(v).x
    middle = crossing(rising, int(np.searchsorted(rising, level)))
    return crossing(v, above[0]), middle, crossing(v, below[-1] + 1)
