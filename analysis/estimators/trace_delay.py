"""Measure the delay of one trace behind another: by cross-correlation, and by the phase."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from analysis.estimators.trace_pair import RecordPair, finite_times
from modal.tools.arrays import Complex, Floats

MIN_SOURCE_AMPLITUDE = 0.2
"""Least amplitude of the source's spectrum, divided by its largest, at which a phase is read."""
PHASE_BAND = (0.5, 1.5)
"""Frequencies over which the phase is read, divided by the source's frequency."""
PHASE_FREQUENCIES = 41
"""Number of frequencies in the band; the one in the middle is the source's."""


class CorrelationPeak(NamedTuple):
    """The largest cross-correlation of two traces; NaN for a trace without motion.

    delay: of the receiver, s. correlation: at this delay. side_lobe: the next maximum, divided by
    the largest.
    """

    delay: float
    correlation: float
    side_lobe: float


def correlation_peak(pair: RecordPair) -> CorrelationPeak:
    """Find the delay of the receiver at which two traces are most alike."""
    step = float(pair.time[1] - pair.time[0])
    size = float(np.linalg.norm(pair.source) * np.linalg.norm(pair.receiver))
    if not size > 0:
        return CorrelationPeak(np.nan, np.nan, np.nan)
    count = len(pair.time)
    cross_spectrum = (
        np.fft.rfft(pair.receiver, 2 * count) * np.fft.rfft(pair.source, 2 * count).conj()
    )
    correlations = np.fft.irfft(cross_spectrum)[:count] / size
    spline = CubicSpline(step * np.arange(count), correlations)
    delays = np.append(0.0, finite_times(spline.derivative().roots(extrapolate=False)))
    heights = spline(delays)
    order = np.argsort(heights)[::-1]
    best = delays[order[0]]
    # Maxima apart by less than half a period are the same one.
    others = heights[abs(delays - best) > 0.5 / pair.frequency]
    side_lobe = float(others.max(initial=0.0) / heights[order[0]])
    correlation = min(float(heights[order[0]]), 1.0)
    return CorrelationPeak(float(best), correlation, side_lobe)


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
    return phase_delays_of_traces(pair.direct())


def phase_delays_of_traces(pair: RecordPair) -> PhaseDelays:
    """Read the travel times between two whole traces at each frequency."""
    delay = correlation_peak(pair).delay
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
