"""Hold two traces of a wave, that of the source and that of the receiver, and find their points.

The points of a trace are its first motion, its first major peak, the passage through zero after
the peak, and the trough that follows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError
from modal.waves.signals import Signals

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
ROUND_OFF = 1e-14
"""Error of a time that a root is found to, divided by the length of the record."""


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
    >>> print(f"{1e6 * (pair.receiver_points.peak - pair.source_points.peak):.1f} us")
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
    extrema = finite_times(spline.derivative().roots(extrapolate=False))
    heights = spline(extrema)
    largest = max(float(abs(trace).max()), np.finfo(float).tiny)
    is_peak = (spline(extrema, 2) < 0) & (heights > MAJOR_PEAK * float(trace.max()))
    is_peak &= heights > 0
    if not is_peak.any():
        return Points(np.nan, np.nan, np.nan)
    peak = float(extrema[is_peak][0])
    is_trough = (extrema > peak) & (heights < -MIN_SWING_BACK * largest)
    crossings = finite_times(spline.roots(extrapolate=False))
    crossings = crossings[crossings > peak]
    if not is_trough.any() or not len(crossings):
        return Points(peak, np.nan, np.nan)
    return Points(peak, float(crossings[0]), float(extrema[is_trough][0]))


def finite_times(times: Floats) -> Floats:
    """Return those times that are finite, ascending; an interval where a trace is zero gave NaN."""
    return np.sort(times[np.isfinite(times)])


def first_motion(time: Floats, trace: Floats, level: float) -> float:
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
