"""Find the frequency for each wave number of a record, and the wavelength at the band edge.

The sum over the chain of u exp(-i kappa z) turns in the complex plane at the frequency of the wave
number kappa. This frequency is read after the source wall has come to rest and before waves return
from the far end. No law of the lattice is assumed: a wave that leaves the source has a positive
group velocity, hence turns forward up to the wave number of the highest frequency; beyond this wave
number the same energy appears to turn backward. There the band ends. The wavelength at this end is
2 l only if each layer acts on its nearest neighbours alone.
"""

from dataclasses import dataclass

import numpy as np

from analysis.estimators.damped_transform import layer_distance
from analysis.estimators.fits import summit
from analysis.estimators.source_motion import at_rest
from modal.waves.signals import Signals

POINTS = 260
"""Number of wave numbers for which the frequency of the ridge is sought."""
HIGHEST_WAVENUMBER_RATIO = 1.3
"""Highest wave number, relative to that of two particles per wavelength."""
LONG_WAVES = slice(POINTS // 50, POINTS // 10)
"""Points of the ridge from which the velocity of long waves is taken."""
MIN_TIMES = 16
PADDING = 4
"""Length of the record after zeros are appended, divided by the original length."""
EDGE_RANGE = 0.25
"""Distance from the edge's wave number, divided by it, within which points on both sides decide
where the edge is."""
MIN_POINTS_BELOW_EDGE = 4
MIN_AGREEMENT = 0.9
"""Least agreement of the senses of turning around the edge, for which the edge counts. The
agreement is 1 if all points below the edge turn forward and all above it backward."""
CURVE_DEGREE = 4
MIN_CURVE_POINTS = 12
"""Fewest points to which a curve of the fourth degree is fitted."""
CURVE_PASSES = 4
"""Number of fits of the curve; each leaves out the outliers of the fit before."""
CURVE_SAMPLES = 2001
OUTLIER_DISTANCE = 4.0
"""Distance from the curve, relative to the median distance, beyond which a point is an outlier."""
MAX_RELATIVE_SCATTER = 3e-3
"""Largest median distance of points from the curve, relative to the frequency, for which the curve
is trusted."""
PASSAGES = 1.3
"""Length of the record that is used, in passages along the chain: the far end turns waves back."""


@dataclass(frozen=True)
class Ridge:
    """Frequency as a function of wave number, and the band edge.

    Attributes
    ----------
    wavenumber : ndarray (n,)
        Wave numbers, 1/m, ascending.
    frequency : ndarray (n,)
        Frequencies, Hz, positive for forward rotation.
    edge_wavenumber, edge_frequency : float
        Wave number, 1/m, and frequency, Hz, of the band edge; NaN if the record does not show it.
    """

    wavenumber: np.ndarray
    frequency: np.ndarray
    edge_wavenumber: float
    edge_frequency: float

    @property
    def edge_wavelength(self) -> float:
        """Return the wavelength at the band edge, m: the shortest that leaves the source."""
        return 2 * np.pi / self.edge_wavenumber

    def wavelength(self, frequency: float) -> float:
        """Return the wavelength, m, at a frequency, Hz.

        NaN below the first frequency of the ridge and above the band edge, where no wave travels.
        """
        inside = (self.wavenumber < self.edge_wavenumber) & (self.frequency > 0)
        frequencies = np.append(self.frequency[inside], self.edge_frequency)
        kappa = np.append(self.wavenumber[inside], self.edge_wavenumber)
        if not frequencies[0] <= frequency <= self.edge_frequency:
            return np.nan
        rising = np.maximum.accumulate(frequencies)
        return float(2 * np.pi / np.interp(frequency, rising, kappa))


def ridge(signals: Signals) -> Ridge:
    """Find the ridge of a chain of equal distances, such as one particle per layer of a crystal.

    The search ends at twice the pulse's frequency, where the spectrum of the pulse ends. All
    frequencies are NaN if there is no wave in the record.
    """
    highest = HIGHEST_WAVENUMBER_RATIO * np.pi / layer_distance(signals)
    kappa = np.linspace(highest / POINTS, highest, POINTS)
    start = at_rest(signals) - float(signals.time[0])
    frequency = _turning_frequencies(signals, kappa, start, np.inf)
    phase_velocity = abs(frequency[LONG_WAVES]) / kappa[LONG_WAVES]
    velocity = 2 * np.pi * float(np.median(phase_velocity))
    if not velocity > 0:  # the sums do not turn
        return Ridge(kappa, np.full(POINTS, np.nan), np.nan, np.nan)
    passage = float(np.ptp(signals.chain_position)) / velocity
    before_reflection = _turning_frequencies(signals, kappa, start, start + PASSAGES * passage)
    if np.isfinite(before_reflection).all():
        frequency = before_reflection
    edge_wavenumber, edge_frequency = _find_edge(kappa, frequency)
    return Ridge(kappa, frequency, edge_wavenumber, edge_frequency)


def _turning_frequencies(
    signals: Signals, kappa: np.ndarray, start: float, end: float
) -> np.ndarray:
    """Return the frequency (n,), Hz, of the sum of each wave number `kappa` (n,), 1/m.

    This is how fast the sum of u exp(-i kappa z) rotates in the complex plane. Only times from
    `start` to `end`, s after the record begins, are used. The frequencies are NaN for fewer than
    `MIN_TIMES` times.
    """
    time = signals.time - signals.time[0]
    used = (time >= start) & (time <= end)
    count = int(used.sum())
    if count < MIN_TIMES:
        return np.full(len(kappa), np.nan)
    z = signals.chain_position - signals.chain_position[0]
    window = np.hanning(count + 2)[1:-1]
    # Conjugate: the wave exp(i kappa z - i omega t) counts as forward.
    turning = (signals.chain_displacement[used] @ np.exp(-1j * np.outer(z, kappa))).conj()
    length = PADDING * count
    spectrum = abs(np.fft.fft(window[:, None] * turning, length, axis=0))
    frequency = np.fft.fftfreq(length, time[1] - time[0])
    spectrum[abs(frequency) > 2 * signals.input_frequency] = 0
    power = np.log(spectrum + np.finfo(float).tiny)
    top = np.argmax(power, axis=0)
    column = np.arange(len(kappa))
    before = power[(top - 1) % length, column]
    peak = power[top, column]
    behind = power[(top + 1) % length, column]
    # As `summit`, but the denominator stays negative where the spectrum is flat.
    shift = 0.5 * (before - behind) / np.minimum(before - 2 * peak + behind, -1e-12)
    return frequency[top] + frequency[1] * np.clip(shift, -0.5, 0.5)


def _find_edge(kappa: np.ndarray, frequency: np.ndarray) -> tuple[float, float]:
    """Return wave number, 1/m, and frequency, Hz, at which the sense of rotation reverses.

    Both are NaN if no reversal is clear, or if the points around it do not lie on a curve.
    """
    edge = _count_forward_points(frequency)
    if edge is None:
        return np.nan, np.nan
    low, high = np.round(edge * np.array([1 - EDGE_RANGE, 1 + EDGE_RANGE])).astype(int)
    edge_kappa = kappa[edge - 1]
    x = kappa[low:high] / edge_kappa - 1
    f = abs(frequency[low:high])
    kept = abs(f / np.median(f) - 1) < EDGE_RANGE
    for _ in range(CURVE_PASSES):
        if kept.sum() < MIN_CURVE_POINTS:
            return np.nan, np.nan
        curve = np.polyfit(x[kept], f[kept], CURVE_DEGREE)
        distance = abs(np.polyval(curve, x) - f) / np.median(f)
        median_distance = float(np.median(distance[kept]))
        kept = distance <= OUTLIER_DISTANCE * median_distance + 1e-9
    fine = np.linspace(x[0], x[-1], CURVE_SAMPLES)
    values = np.polyval(curve, fine)
    top = int(np.argmax(values))
    if top in (0, len(fine) - 1) or median_distance > MAX_RELATIVE_SCATTER:
        return np.nan, np.nan
    # Without the parabola, round-off would choose among the points of the grid.
    shift = summit(values[top - 1], values[top], values[top + 1]) * (fine[1] - fine[0])
    return float(edge_kappa * (1 + fine[top] + shift)), float(values[top])


def _count_forward_points(frequency: np.ndarray) -> int | None:
    """Return how many points of a ridge precede the reversal of its sense of rotation.

    A positive `frequency` (n,), Hz, means forward rotation. The result is None if no reversal is
    clear: the points near it must agree with it by `MIN_AGREEMENT`.
    """
    sense = np.append(0, np.cumsum(np.sign(frequency)))
    count = np.arange(POINTS + 1)
    low = np.round((1 - EDGE_RANGE) * count).astype(int)
    high = np.round((1 + EDGE_RANGE) * count).astype(int)
    possible = (high <= POINTS) & (count - low >= MIN_POINTS_BELOW_EDGE)
    count = count[possible]
    low = low[possible]
    high = high[possible]
    agreement = np.full(POINTS + 1, -1.0)
    agreement[possible] = (2 * sense[count] - sense[low] - sense[high]) / (high - low)
    if agreement.max() < MIN_AGREEMENT:
        return None
    first = int(np.argmax(agreement >= MIN_AGREEMENT))
    end = int((1 + EDGE_RANGE) * first)
    return first + int(np.argmax(agreement[first:end]))
