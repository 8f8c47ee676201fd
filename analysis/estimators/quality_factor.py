"""Read the quality factor as laboratories do: of a resonance, a free decay, or two receivers.

Q is the stored energy divided by the energy lost in a radian. Four ways to read it:

    fitted resonance         the complex response near a peak is that of one damped oscillator, in
                             front of the slow rest of all others
    half-power width         f_r divided by the width of the peak at half of its power
    logarithmic decrement    the natural logarithm of the ratio of successive peaks, pi / Q
    spectral ratio           the amplitude that two receivers see falls as exp(-pi f t / Q), with t
                             the travel time from one to the other (M. N. Toksoz, D. H. Johnston and
                             A. Timur, Geophysics 44, 681, 1979)

The width and the decrement are those of a single oscillator; neighbouring resonances and their own
damping add an error of the order of 1 / Q^2, which the fit avoids.
"""

from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from scipy.interpolate import CubicSpline

from analysis.estimators.fits import straight_line
from analysis.estimators.trace_delay import MIN_SOURCE_AMPLITUDE, PHASE_BAND
from analysis.estimators.trace_pair import RecordPair
from modal.tools.arrays import Complex, Floats
from modal.tools.errors import UnavailableError

FIT_WIDTHS = 4.0
"""Distance from a peak, in its widths at half power, up to which a resonance is fitted."""
BACKGROUND_ORDER = 4
"""Order in the frequency of the polynomial that stands for all other resonances."""
MIN_FITTED_FREQUENCIES = 12
FREQUENCIES = 121
"""Number of frequencies at which the spectra of two receivers are compared."""
MIN_PEAKS = 3
"""Fewest peaks of a free decay from which a decrement is read."""
MIN_PEAK_SHARE = 1e-3
"""Least height of a peak of a free decay, divided by the largest."""


@dataclass(frozen=True)
class QualityFactor:
    """A quality factor, with the frequency of its resonance.

    Attributes
    ----------
    quality, error : float
        Q and its standard error.
    frequency : float
        Frequency at which Q was measured, Hz; for a fitted resonance, the undamped frequency.
    """

    quality: float
    error: float
    frequency: float


def half_power(frequency: Floats, amplitude: Floats) -> QualityFactor:
    """Read Q from the width of the highest peak of an amplitude (nf,) at frequencies (nf,), Hz.

    The peak and the two points of half its power are found on a spline through 1 / amplitude^2,
    which is a parabola for a single resonance. The error is half of the asymmetry of the two
    halves. Raises UnavailableError if the record does not contain both points.

    Examples
    --------
    >>> frequency = np.linspace(90, 110, 201)
    >>> amplitude = abs(1 / (100**2 - frequency**2 - 1j * frequency * 100 / 50))
    >>> round(half_power(frequency, amplitude).quality, 1)
    50.0
    """
    inverse = CubicSpline(frequency, np.asarray(amplitude, float) ** -2.0)
    lowest = inverse.derivative().roots(extrapolate=False)
    lowest = lowest[np.isfinite(lowest)]
    if not len(lowest):
        _refuse_no_resonance("no peak lies inside of the frequencies")
    peak = float(lowest[np.argmin(inverse(lowest))])
    sides = inverse.solve(2 * float(inverse(peak)), extrapolate=False)
    below = sides[sides < peak]
    above = sides[sides > peak]
    if not len(below) or not len(above):
        _refuse_no_resonance("the peak is cut off above half of its power")
    left = peak - float(below.max())
    right = float(above.min()) - peak
    quality = peak / (left + right)
    return QualityFactor(quality, quality * abs(left - right) / (left + right) / 2, peak)


def fitted_resonance(frequency: Floats, response: Complex) -> QualityFactor:
    """Fit one damped oscillator to a complex response (nf,) near its highest peak.

    With time dependence exp(-i omega t), response = (b_0 + b_1 omega + ...) / (omega_1^2 - omega^2
    - i omega omega_1 / Q), with complex b: linear least squares for omega_1^2, omega_1 / Q and b
    (after E. C. Levy, IRE Trans. Autom. Control 4, 37, 1959), over `FIT_WIDTHS` of the peak. The
    error is the change for a background of one order less. Raises UnavailableError if there are too
    few frequencies near the peak.

    Examples
    --------
    >>> omega = 2 * np.pi * np.linspace(90, 110, 201)
    >>> response = (1 + 0.1j) / ((200 * np.pi) ** 2 - omega**2 - 1j * omega * 200 * np.pi / 50)
    >>> found = fitted_resonance(omega / (2 * np.pi), response)
    >>> round(found.frequency, 6), round(found.quality, 6)
    (100.0, 50.0)
    """
    rough = half_power(frequency, np.abs(response))
    distance = FIT_WIDTHS * rough.frequency / rough.quality
    near = abs(frequency - rough.frequency) < distance
    if near.sum() < MIN_FITTED_FREQUENCIES:
        _refuse_no_resonance(f"fewer than {MIN_FITTED_FREQUENCIES} frequencies lie near the peak")
    fits = [_fit(frequency[near], response[near], BACKGROUND_ORDER - less) for less in (0, 1)]
    (resonance, quality), (_, other_quality) = fits
    return QualityFactor(quality, abs(quality - other_quality), resonance)


def _fit(frequency: Floats, response: Complex, order: int) -> tuple[float, float]:
    """Return the resonance, Hz, and Q of the oscillator that fits a response best."""
    scale = float(frequency.mean())
    omega = frequency / scale
    weight = 1 / abs(response).max()
    background = [-(omega**power) for power in range(order + 1)]
    # response (omega_1^2 - i omega omega_1 / Q) - sum of b omega^power = response omega^2
    columns = [weight * response, -1j * omega * weight * response]
    columns += background
    columns += [1j * column for column in background]
    matrix = np.column_stack(columns)
    wanted = weight * response * omega**2
    solution = np.linalg.lstsq(
        np.concatenate([matrix.real, matrix.imag]),
        np.concatenate([wanted.real, wanted.imag]),
        rcond=None,
    )[0]
    resonance = float(np.sqrt(solution[0]))
    return resonance * scale, resonance / float(solution[1])


def logarithmic_decrement(time: Floats, trace: Floats) -> QualityFactor:
    """Read Q from the peaks of a free decay, a trace (nt,) at evenly spaced times (nt,), s.

    The logarithms of all positive and negative peaks fall by the decrement delta in a period; the
    damping ratio is delta / sqrt(4 pi^2 + delta^2), and Q = 1 / (2 ratio). Raises UnavailableError
    for fewer than `MIN_PEAKS` peaks.

    Examples
    --------
    >>> time = np.linspace(0, 0.1, 2001)
    >>> decay = np.exp(-np.pi * 100 * time / 20) * np.cos(2 * np.pi * 100 * time)
    >>> round(logarithmic_decrement(time, decay).quality, 2)
    20.01
    """
    spline = CubicSpline(time, trace)
    peaks = spline.derivative().roots(extrapolate=False)
    peaks = np.sort(peaks[np.isfinite(peaks)])
    height = abs(spline(peaks))
    significant = height > MIN_PEAK_SHARE * height.max(initial=0.0)
    peaks = peaks[significant]
    if len(peaks) < MIN_PEAKS:
        _refuse_no_resonance(f"the decay has fewer than {MIN_PEAKS} peaks")
    half_periods = np.arange(len(peaks)) / 2
    decay = straight_line(half_periods, np.log(height[significant]))
    decrement = -decay.slope
    period = straight_line(half_periods, peaks).slope
    ratio = decrement / np.hypot(2 * np.pi, decrement)
    quality = 1 / (2 * ratio)
    return QualityFactor(quality, quality * abs(decay.error / decrement), 1 / period)


@dataclass(frozen=True)
class SpectralRatio:
    """Attenuation between two receivers at each frequency, and the constant Q that fits it.

    Attributes
    ----------
    frequency : ndarray (nf,)
        Frequencies, Hz.
    attenuation : ndarray (nf,)
        Logarithm of the ratio of amplitudes, nepers; it includes the spreading of the wave.
    quality : QualityFactor
        Quality factor from the slope of the attenuation against frequency, which spreading does not
        change.
    """

    frequency: Floats
    attenuation: Floats
    quality: QualityFactor


def spectral_ratio(pair: RecordPair, travel_time: float) -> SpectralRatio:
    """Read Q between two receivers from the ratio of their spectra, and their travel time, s.

    The frequencies are those of the pulse, and only the direct waves are compared.

    Examples
    --------
    >>> time = 1e-6 * np.arange(600)
    >>> pulse = np.where(time < 1e-4, np.sin(2e4 * np.pi * time), 0)
    >>> found = spectral_ratio(RecordPair(time, pulse, 0.5 * np.roll(pulse, 150), 1e4), 1.5e-4)
    >>> abs(found.quality.quality) > 1e6, found.attenuation[0].round(3)
    (True, np.float64(0.693))
    """
    direct = pair.direct()
    frequency = pair.frequency * np.linspace(*PHASE_BAND, FREQUENCIES)
    kernel = np.exp(-2j * np.pi * frequency[:, None] * pair.time)
    source = abs(kernel @ direct.source)
    receiver = abs(kernel @ direct.receiver)
    sent = source > MIN_SOURCE_AMPLITUDE * source.max()
    attenuation = np.log(source[sent] / receiver[sent])
    line = straight_line(frequency[sent], attenuation)
    quality = np.pi * travel_time / line.slope
    error = abs(quality * line.error / line.slope)
    factor = QualityFactor(float(quality), float(error), pair.frequency)
    return SpectralRatio(frequency[sent], attenuation, factor)


def _refuse_no_resonance(reason: str) -> NoReturn:
    """Raise UnavailableError: a response or a decay has no resonance that can be read."""
    raise UnavailableError(
        "no_resonance", "no resonance that can be read", reason, "record more, or finer"
    )
