"""Read travel times from one record to another, by the rules of laboratories.

Bender elements and piezo discs give two traces, that of the source and that of the receiver, and
several rules to read a travel time from them. Each compares one property of both traces:

    first_arrival       the motion first exceeds `ARRIVAL_LEVEL` of its largest, in either sense
    zero_crossing       the first passage through zero after the first major peak
    peak_to_peak        the first major peak in the sense of the source's first motion
    cross_correlation   the delay at which the traces are most alike
    phase               the phase of the cross-spectrum at the source's frequency, divided by omega

(V. Jovicic, M. R. Coop and M. Simic, Geotechnique 46, 491, 1996; R. Arulnathan, R. W. Boulanger and
M. F. Riemer, Geotech. Test. J. 21, 120, 1998; Y. Yamashita et al., Soils and Foundations 49, 729,
2009). A pulse that is only delayed has the same travel time by all rules. In grains it also changes
its shape, and near the source P- and S-motion overlap; each rule then gives another time, with an
error that measures the uncertainty of the rule itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple, get_args

import numpy as np

from analysis.caveats import Caveat
from analysis.estimators.fits import straight_line
from analysis.estimators.trace_delay import correlation_peak, phase_delays_of_traces
from analysis.estimators.trace_delay import phase_delays as phase_delays
from analysis.estimators.trace_pair import FADE_IN_PERIODS, first_motion
from analysis.estimators.trace_pair import RecordPair as RecordPair
from analysis.value import Value, unknown
from modal.tools.errors import refuse_unknown
from modal.waves.signals import Signals

Rule = Literal["first_arrival", "zero_crossing", "peak_to_peak", "cross_correlation", "phase"]
RULES: tuple[Rule, ...] = get_args(Rule)
ARRIVAL_LEVEL = 0.05
"""Motion, divided by the trace's largest, at which a wave arrives."""
OTHER_ARRIVAL_LEVELS = (0.025, 0.1)
"""Further levels; the range of their times is the error of a first arrival."""
MIN_WAVELENGTHS = 2.0
"""Number of wavelengths between the transducers below which P- and S-motion of the source overlap
(I. Sanchez-Salinero, J. M. Roesset and K. H. Stokoe, Univ. of Texas, GR 86-15, 1986)."""
MAX_SIDE_LOBE = 0.95
"""Largest second maximum of a cross-correlation, divided by the first, for which the cycle is
certain."""
DECIMATED_ERROR = 1 / 3
"""Error of a time from the sampling, divided by its change if every second sample is left out: that
of a rule of second order."""


def picks(pair: RecordPair, rule: Rule) -> tuple[float, float]:
    """Return the times of source and receiver, s, that a rule of single points compares.

    The times are NaN if a trace does not have the point, and for rules that compare whole traces.
    """
    if rule == "first_arrival":
        return (
            first_motion(pair.time, pair.source, ARRIVAL_LEVEL),
            first_motion(pair.time, pair.receiver, ARRIVAL_LEVEL),
        )
    source = pair.source_points
    receiver = pair.receiver_points
    if rule == "zero_crossing":
        return source.crossing, receiver.crossing
    if rule == "peak_to_peak":
        return source.peak, receiver.peak
    return np.nan, np.nan


class _Reading(NamedTuple):
    """A travel time, s, the parts of its error, s, and its caveats."""

    time: float
    parts: dict[str, float]
    caveats: tuple[Caveat, ...] = ()


def _read_first_arrival(pair: RecordPair) -> _Reading:
    """Read a travel time by first motions; other threshold levels give the error."""
    source, receiver = picks(pair, "first_arrival")
    times = []
    for level in OTHER_ARRIVAL_LEVELS:
        receiver_time = first_motion(pair.time, pair.receiver, level)
        times.append(receiver_time - first_motion(pair.time, pair.source, level))
    return _Reading(receiver - source, {"threshold": float(np.ptp(times)) / 2})


def _read_zero_crossing(pair: RecordPair) -> _Reading:
    """Read a travel time by passages through zero.

    The error is the difference from the mean of the travel times of the extrema before and after.
    """
    source = pair.source_points
    receiver = pair.receiver_points
    crossing = receiver.crossing - source.crossing
    extrema = (receiver.peak - source.peak + receiver.trough - source.trough) / 2
    return _Reading(crossing, {"distortion": abs(crossing - extrema)})


def _read_peak_to_peak(pair: RecordPair) -> _Reading:
    """Read a travel time by first major peaks.

    The error is half the difference from the travel time of the following troughs, if any.
    """
    source = pair.source_points
    receiver = pair.receiver_points
    peak = receiver.peak - source.peak
    trough = receiver.trough - source.trough
    distortion = 0.0
    if np.isfinite(trough):
        distortion = abs(peak - trough) / 2
    return _Reading(peak, {"distortion": distortion})


def _read_cross_correlation(pair: RecordPair) -> _Reading:
    """Read a travel time by the largest cross-correlation of the direct waves.

    The error of a delay between traces of correlation rho is sqrt(1 / rho^2 - 1) / omega, if the
    rest of one trace, which the other does not explain, is equally large at any phase.
    """
    peak = correlation_peak(pair.direct())
    longer_window = correlation_peak(pair.direct(FADE_IN_PERIODS))
    unlike = np.sqrt(max(1 / peak.correlation**2 - 1, 0.0)) / (2 * np.pi * pair.frequency)
    caveats: tuple[Caveat, ...] = ()
    if peak.side_lobe > MAX_SIDE_LOBE:
        caveats = (Caveat("ambiguous_cycle", {"ratio": peak.side_lobe}),)
    parts = {"distortion": float(unlike), "window": abs(longer_window.delay - peak.delay)}
    return _Reading(peak.delay, parts, caveats)


def _read_phase(pair: RecordPair) -> _Reading:
    """Read the travel time by the phase at the source's frequency.

    The error combines the scatter of the phase about a straight line over the band with the change
    under a window that ends half a period later.
    """
    delays = phase_delays_of_traces(pair.direct())
    longer = phase_delays_of_traces(pair.direct(FADE_IN_PERIODS))
    time = float(np.interp(pair.frequency, delays.frequency, delays.phase))
    longer_time = float(np.interp(pair.frequency, longer.frequency, longer.phase))
    omega = 2 * np.pi * delays.frequency
    line = straight_line(omega, omega * delays.phase)
    scatter = np.std(omega * delays.phase - line.slope * omega - line.offset)
    parts = {
        "fit": float(scatter) / (2 * np.pi * pair.frequency),
        "window": abs(longer_time - time),
    }
    return _Reading(time, parts)


READERS: dict[Rule, Callable[[RecordPair], _Reading]] = {
    "first_arrival": _read_first_arrival,
    "zero_crossing": _read_zero_crossing,
    "peak_to_peak": _read_peak_to_peak,
    "cross_correlation": _read_cross_correlation,
    "phase": _read_phase,
}
"""Function that reads a travel time, by the name of the rule."""


def travel_time(record: Signals | RecordPair, rule: Rule, *, receiver: int = 0) -> Value:
    """Read the travel time from a source to a receiver by a rule.

    Parameters
    ----------
    record : Signals or RecordPair
        A wave recorded at discs (`modal.propagate` with `receivers`), or two traces.
    rule : str
        One of `RULES`.
    receiver : int, default 0
        Number of the receiver of a recorded wave.

    Returns
    -------
    Value
        Travel time, s, with its error. It is unknown, with a caveat that says why, if the rule
        cannot be applied to a trace. The distance of the transducers divided by the time is a
        velocity.

    Raises
    ------
    InputError
        If the rule is unknown, or the wave has no receivers.

    Examples
    --------
    >>> import modal, analysis
    >>> from modal.motions import SineBurst
    >>> from modal.sources import Disc
    >>> crystal = modal.fcc(cells=(2, 2, 60))
    >>> height = crystal.length / 3
    >>> wave = modal.propagate(
    ...     crystal, 2e-4, source=Disc((0, 0, height), 0.02), motion=SineBurst(1e-9, 2e4),
    ...     receivers=[Disc((0, 0, 2 * height), 0.02)],
    ... )
    >>> time = analysis.travel_time(wave.signals, "peak_to_peak")
    >>> time.unit, time.value > 0
    ('s', True)
    """
    refuse_unknown("rule", rule, RULES)
    pair = record if isinstance(record, RecordPair) else RecordPair.of(record, receiver)
    reading = READERS[rule](pair)
    if not reading.time > 0:
        return unknown("s", Caveat("no_such_point", {"rule": rule}))
    coarser = READERS[rule](pair.decimated).time
    sampling = np.nan_to_num(abs(coarser - reading.time) * DECIMATED_ERROR)
    caveats = list(reading.caveats)
    wavelengths = reading.time * pair.frequency
    if wavelengths < MIN_WAVELENGTHS:
        caveats.append(
            Caveat("near_field", {"wavelengths": wavelengths, "needed": MIN_WAVELENGTHS})
        )
    parts = {**reading.parts, "sampling": float(sampling)}
    return Value(reading.time, "s", parts, tuple(caveats))
