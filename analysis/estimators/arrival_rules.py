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
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple, get_args

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from analysis.caveats import Caveat
from analysis.estimators.fits import straight_line
from analysis.value import Value, unknown
from modal.tools.arrays import Complex, Floats
from modal.tools.errors import UnavailableError, refuse_unknown
from modal.waves.signals import Signals

Rule = Literal["first_arrival", "zero_crossing", "peak_to_peak", "cross_correlation", "phase"]
RULES: tuple[Rule, ...] = get_args(Rule)
ARRIVAL_LEVEL = 0.05
"""Motion, divided by the trace's largest, at which a wave arrives."""
OTHER_ARRIVAL_LEVELS = (0.025, 0.1)
"""Further levels; the range of their times is the error of a first arrival."""
MAJOR_PEAK = 0.5
"""Least height of the first major peak, divided by the trace's largest."""
MIN_SWING_BACK = 0.05
"""Least motion beyond a passage through zero, divided by the trace's largest: a pulse that only
returns to zero does not cross it."""
SENSE_LEVEL = 0.1
"""Motion of the source, divided by its largest, at which its first sense is read."""
END_LEVEL = 1e-3
"""Motion of the source, divided by its largest, below which it has come to its end."""
FADE_IN_PERIODS = 0.5
"""Time over which the end of a direct wave is faded out, and by which the error of the window is
read, in periods of the source."""
MIN_WAVELENGTHS = 2.0
"""Number of wavelengths between the transducers below which P- and S-motion of the source overlap
(I. Sanchez-Salinero, J. M. Roesset and K. H. Stokoe, Univ. of Texas, GR 86-15, 1986)."""
MAX_SIDE_LOBE = 0.95
"""Largest second maximum of a cross-correlation, divided by the first, for which the cycle is
certain."""
ROUND_OFF = 1e-14
"""Error of a time that a root is found to, divided by the length of the record."""
MIN_SOURCE_AMPLITUDE = 0.2
"""Least amplitude of the source's spectrum, divided by its largest, at which a phase is read."""
PHASE_BAND = (0.5, 1.5)
"""Frequencies over which the phase is read, divided by the source's frequency."""
PHASE_FREQUENCIES = 41
"""Number of frequencies in the band; the one in the middle is the source's."""
DECIMATED_ERROR = 1 / 3
"""Error of a time from the sampling, divided by its change if every second sample is left out: that
of a rule of second order."""


@dataclass(frozen=True)
class RecordPair:
    """The motions of a source and of a receiver, or of two receivers, at the same times.

    Attributes
    ----------
    time : ndarray (nt,)
        Evenly spaced times, s.
    source, receiver : ndarray (nt,)
        Motions in any units; those of the source may be a force.
    frequency : float
        Frequency of the source, Hz.

    Examples
    --------
    >>> time = 1e-6 * np.arange(400)
    >>> pulse = lambda t: np.where((t > 0) & (t < 1e-4), np.sin(2e4 * np.pi * t), 0)
    >>> pair = RecordPair(time, pulse(time), 0.1 * pulse(time - 1e-4), 1e4)
    >>> print(f"{1e6 * travel_time(pair, 'cross_correlation').value:.1f} us")
    100.0 us
    """

    time: Floats
    source: Floats
    receiver: Floats
    frequency: float

    @classmethod
    def of(cls, record: Signals, receiver: int = 0, source: int | None = None) -> RecordPair:
        """Return the motions of the source and of one of the receivers of a recorded wave.

        If the number of another receiver is given as `source`, this replaces the source. Raises
        UnavailableError if the wave was not recorded at discs.
        """
        discs = record.disc_displacement
        if discs is None or not np.size(discs):
            raise UnavailableError(
                "no_receivers",
                "the wave was not recorded at discs",
                remedy="record it with `receivers`, or take two traces as a RecordPair",
            )
        motion = record.source_displacement
        if source is not None:
            motion = discs[:, source]
        return cls(record.time, motion, discs[:, receiver], record.input_frequency)

    @property
    def sense(self) -> float:
        """The sign of the source's first motion."""
        size = abs(self.source)
        first = int(np.argmax(size > SENSE_LEVEL * size.max()))
        return float(np.sign(self.source[first])) or 1.0

    @cached_property
    def source_points(self) -> Points:
        """The characteristic points of the source's motion."""
        return _points(self.time, self.sense * self.source)

    @cached_property
    def receiver_points(self) -> Points:
        """The characteristic points of the receiver's motion, in the source's sense."""
        return _points(self.time, self.sense * self.receiver)

    @cached_property
    def decimated(self) -> RecordPair:
        """The pair with every second sample."""
        return RecordPair(self.time[::2], self.source[::2], self.receiver[::2], self.frequency)

    def direct(self, periods: float = 0.0) -> RecordPair:
        """Return the pair without motion after the direct wave.

        The receiver's motion ends as long after its first major peak as the source's motion does
        after its own; it is faded out over half a period. `periods` are added before that.
        """
        moving = abs(self.source) > END_LEVEL * abs(self.source).max()
        source_end = self.time[np.flatnonzero(moving)[-1]]
        peak_delay = self.receiver_points.peak - self.source_points.peak
        if not np.isfinite(peak_delay):
            return self
        end = source_end + peak_delay + periods / self.frequency
        fade = np.clip((self.time - end) * self.frequency / FADE_IN_PERIODS, 0, 1)
        return replace(self, receiver=self.receiver * np.cos(np.pi * fade / 2) ** 2)


class Points(NamedTuple):
    """Characteristic points of a trace, s; NaN for those that it does not have.

    peak: the first major peak. crossing: the passage through zero after the peak. trough: the
    lowest point after the crossing.
    """

    peak: float
    crossing: float
    trough: float


def _points(time: Floats, trace: Floats) -> Points:
    """Find the characteristic points of a trace (nt,) whose first motion is positive."""
    spline = CubicSpline(time, trace)
    extrema = _finite(spline.derivative().roots(extrapolate=False))
    heights = spline(extrema)
    largest = max(float(abs(trace).max()), np.finfo(float).tiny)
    is_peak = (spline(extrema, 2) < 0) & (heights > MAJOR_PEAK * float(trace.max()))
    is_peak &= heights > 0
    if not is_peak.any():
        return Points(np.nan, np.nan, np.nan)
    peak = float(extrema[is_peak][0])
    is_trough = (extrema > peak) & (heights < -MIN_SWING_BACK * largest)
    crossings = _finite(spline.roots(extrapolate=False))
    crossings = crossings[crossings > peak]
    if not is_trough.any() or not len(crossings):
        return Points(peak, np.nan, np.nan)
    return Points(peak, float(crossings[0]), float(extrema[is_trough][0]))


def _finite(times: Floats) -> Floats:
    """Return those times that are finite, ascending; an interval where a trace is zero gave NaN."""
    return np.sort(times[np.isfinite(times)])


def _first_motion(time: Floats, trace: Floats, level: float) -> float:
    """Return the first time, s, at which a trace exceeds `level` times its maximum, or NaN."""
    largest = float(abs(trace).max())
    above = abs(trace) >= level * largest
    if not largest > 0 or above[0]:
        return np.nan
    after = int(np.argmax(above))
    towards = np.sign(trace[after])
    beyond = CubicSpline(time, towards * trace / largest - level)
    if not beyond(time[after]) > 0:  # by round-off: the sample itself is at the level
        return float(time[after])
    return float(brentq(beyond, time[after - 1], time[after], xtol=ROUND_OFF * time[-1]))


def picks(pair: RecordPair, rule: Rule) -> tuple[float, float]:
    """Return the times of source and receiver, s, that a rule of single points compares.

    The times are NaN if a trace does not have the point, and for rules that compare whole traces.
    """
    if rule == "first_arrival":
        return (
            _first_motion(pair.time, pair.source, ARRIVAL_LEVEL),
            _first_motion(pair.time, pair.receiver, ARRIVAL_LEVEL),
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
        receiver_time = _first_motion(pair.time, pair.receiver, level)
        times.append(receiver_time - _first_motion(pair.time, pair.source, level))
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
    delay, correlation, side_lobe = _delay(pair.direct())
    longer_delay = _delay(pair.direct(FADE_IN_PERIODS))[0]
    unlike = np.sqrt(max(1 / correlation**2 - 1, 0.0)) / (2 * np.pi * pair.frequency)
    caveats: tuple[Caveat, ...] = ()
    if side_lobe > MAX_SIDE_LOBE:
        caveats = (Caveat("ambiguous_cycle", {"ratio": side_lobe}),)
    parts = {"distortion": float(unlike), "window": abs(longer_delay - delay)}
    return _Reading(delay, parts, caveats)


def _delay(pair: RecordPair) -> tuple[float, float, float]:
    """Return the delay of the receiver, s, its correlation, and the next maximum / this one."""
    step = float(pair.time[1] - pair.time[0])
    size = float(np.linalg.norm(pair.source) * np.linalg.norm(pair.receiver))
    if not size > 0:
        return np.nan, np.nan, np.nan
    count = len(pair.time)
    cross_spectrum = (
        np.fft.rfft(pair.receiver, 2 * count) * np.fft.rfft(pair.source, 2 * count).conj()
    )
    correlation = np.fft.irfft(cross_spectrum)[:count] / size
    spline = CubicSpline(step * np.arange(count), correlation)
    delays = np.append(0.0, _finite(spline.derivative().roots(extrapolate=False)))
    heights = spline(delays)
    order = np.argsort(heights)[::-1]
    best = delays[order[0]]
    # Maxima apart by less than half a period are the same one.
    others = heights[abs(delays - best) > 0.5 / pair.frequency]
    side_lobe = float(others.max(initial=0.0) / heights[order[0]])
    return float(best), min(float(heights[order[0]]), 1.0), side_lobe


@dataclass(frozen=True)
class PhaseDelays:
    """Travel times as a function of frequency, by the phase of two traces' cross-spectrum.

    Attributes
    ----------
    frequency : ndarray (nf,)
        Frequencies in the source's spectrum, Hz.
    phase : ndarray (nf,)
        Phase by which the receiver lags, divided by omega, s: distance divided by phase velocity.
    group : ndarray (nf,)
        Derivative of this phase with respect to omega, s: distance divided by group velocity.
    """

    frequency: Floats
    phase: Floats
    group: Floats


def phase_delays(pair: RecordPair) -> PhaseDelays:
    """Read the travel times of the direct wave of two traces at each frequency.

    The whole number of periods, which a phase does not show, follows from the largest
    cross-correlation.

    Examples
    --------
    >>> time = 1e-6 * np.arange(400)
    >>> pulse = lambda t: np.where((t > 0) & (t < 1e-4), np.sin(2e4 * np.pi * t), 0)
    >>> delays = phase_delays(RecordPair(time, pulse(time), 0.1 * pulse(time - 1e-4), 1e4))
    >>> (1e6 * delays.group[[0, -1]]).round(1)
    array([100., 100.])
    """
    return _phase_delays(pair.direct())


def _phase_delays(pair: RecordPair) -> PhaseDelays:
    """Read the travel times between two whole traces at each frequency."""
    delay = _delay(pair)[0]
    frequency = pair.frequency * np.linspace(*PHASE_BAND, PHASE_FREQUENCIES)
    source = _spectrum(pair.time, pair.source, frequency)
    receiver = _spectrum(pair.time, pair.receiver, frequency)
    is_sent = abs(source) > MIN_SOURCE_AMPLITUDE * abs(source).max()
    omega = 2 * np.pi * frequency
    rest = np.angle(receiver * source.conj() * np.exp(1j * omega * delay))
    middle = PHASE_FREQUENCIES // 2
    unwrapped = np.unwrap(rest)
    lag = omega * delay - (unwrapped - unwrapped[middle] + rest[middle])
    return PhaseDelays(frequency[is_sent], (lag / omega)[is_sent], np.gradient(lag, omega)[is_sent])


def _spectrum(time: Floats, trace: Floats, frequency: Floats) -> Complex:
    """Return the Fourier transform (nf,), time dependence exp(i omega t), of a trace (nt,)."""
    kernel = np.exp(-2j * np.pi * frequency[:, None] * time)
    return np.asarray(kernel @ trace * (time[1] - time[0]), complex)


def _read_phase(pair: RecordPair) -> _Reading:
    """Read the travel time by the phase at the source's frequency.

    The error combines the scatter of the phase about a straight line over the band with the change
    under a window that ends half a period later.
    """
    delays = _phase_delays(pair.direct())
    longer = _phase_delays(pair.direct(FADE_IN_PERIODS))
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
