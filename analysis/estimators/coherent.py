"""The coherent wave: wave number, attenuation, velocities over frequency from means of layers.

Means over slabs average away most of what disorder scatters. Under a window exp(-eta t) the
transform U(z, s), s = eta - i omega, of a wave that runs one way is U exp(i q z), Re q = kappa the
wave number, Im q the decay; the ratio of neighbouring layers gives exp(i q l), by least squares
over a stretch that the reflected wave has not reached when the record is cut. The window's own
share of Im q, eta over the group velocity, is taken off; to first order in eta it leaves kappa as
it is.
"""

from dataclasses import dataclass, replace

import numpy as np

from analysis.estimators.travel_time import first_peak_times, travel_velocity
from modal.waves.signals import Signals

DECAY = 4.0
"""eta T: the cut at the record's end is damped to e^-4."""
STRETCH = (0.1, 0.6)
"""Part of the length that is used: behind the source wall's own field, ahead of the reflection."""
PASSAGES = 1.3
"""Longest record, in passages of the measured wave: the reflection is at 0.6 L after 1.4. A record
of 1.73 passages gives V_P 0.4 % too high, one of 1.95 passages 0.9 %."""
COHERENCE = 0.9
"""Least correlation of neighbouring layers for which a wave number is given."""


@dataclass(frozen=True)
class Coherent:
    """frequency (nf,) Hz; wavenumber, attenuation (nf,) 1/m; NaN where no coherent wave is left.

    Of frequencies nearer to each other than `resolution`, Hz, the record says the same once only.
    """

    frequency: np.ndarray
    wavenumber: np.ndarray
    attenuation: np.ndarray
    resolution: float

    @property
    def phase_velocity(self) -> np.ndarray:
        """omega / kappa (nf,), m/s."""
        return 2 * np.pi * self.frequency / self.wavenumber

    @property
    def group_velocity(self) -> np.ndarray:
        """d omega / d kappa (nf,), m/s, by central differences."""
        return np.gradient(2 * np.pi * self.frequency) / np.gradient(self.wavenumber)


def coherent_wave(
    signals: Signals,
    length: float,
    *,
    highest: float | None = None,
    points: int = 120,
    decay: float = DECAY,
) -> Coherent:
    """Wave number of a record in a sample of `length` (m), to `highest` Hz (the whole pulse).

    Layer means where the record has them, else the chain, whose distances must then be equal. A
    record that holds the reflection is cut before it, by the speed of its own first peaks.
    """
    z, u = signals.chain_position, signals.chain_displacement
    if signals.layer_displacement is not None:
        z, u = signals.layer_position, signals.layer_displacement
    order, depth = np.argsort(z), (z - z.min()) / length
    part = order[((depth >= STRETCH[0]) & (depth <= STRETCH[1]))[order]]
    nan = np.full(points, np.nan)
    highest = highest or 2 * signals.input_frequency
    frequency = np.linspace(highest / points, highest, points)
    if len(part) < 3:
        return Coherent(frequency, nan, nan, np.nan)
    z, u = z[part], u[:, part]
    speed, _ = travel_velocity(z, first_peak_times(replace(signals, chain_displacement=u)))
    reflected = PASSAGES * length / speed if speed > 0 else np.inf
    kept = signals.time - signals.time[0] <= reflected
    time, u = signals.time[kept], u[kept]
    eta = decay / (time[-1] - time[0])
    kernel = np.exp((2j * np.pi * frequency[:, None] - eta) * time)
    field = kernel @ u
    before, after = field[:, :-1], field[:, 1:]
    distance = float(np.mean(np.diff(z)))
    # Layers are not quite equally far apart: each step is turned back to the mean distance.
    excess, kappa = np.diff(z) - distance, np.zeros(points)
    for _ in range(4):
        product = before.conj() * after * np.exp(-1j * kappa[:, None] * excess)
        product = product.sum(axis=1)
        q = -1j * np.log(product / (abs(before) ** 2).sum(axis=1)) / distance
        kappa = q.real
    power = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    slowness = np.gradient(kappa, 2 * np.pi * frequency)
    lost = (abs(product) < COHERENCE * power) | (slowness <= 0)
    wave = np.array([kappa, q.imag - eta * slowness])
    wave[:, np.logical_or.accumulate(lost)] = np.nan
    # Noise under the window is correlated as 1 / (1 + (pi df / eta)^2), whose integral is eta.
    return Coherent(frequency, wave[0], wave[1], eta)


def longest_waves(wave: Coherent) -> tuple[float, float]:
    """V_P, m/s, and its standard error: kappa over omega, extrapolated in f^2 to zero.

    From the lowest third of the frequencies. An error of kappa that is the same at all of them goes
    as 1 / f in the slowness; as many points are independent as `resolution` has room for.
    The error so found is 1.2 times the scatter of records with white noise.
    """
    slowness = 1 / wave.phase_velocity
    known = np.flatnonzero(np.isfinite(slowness))
    known = known[2 : max(8, len(known) // 3)]
    if len(known) < 5:
        return np.nan, np.nan
    frequency = wave.frequency[known]
    # Squares of Hz beside 1 would lose the intercept to round-off where waves are fast or small.
    square = (frequency / frequency[-1]) ** 2
    fit = np.linalg.pinv(np.stack([square, np.ones(len(known))], axis=1))
    curvature, intercept = fit @ slowness[known]
    off = (slowness[known] - curvature * square - intercept) * frequency
    together = max(1.0, wave.resolution / (wave.frequency[1] - wave.frequency[0]))
    variance = together * (off**2).sum() / (len(known) - 2) * ((fit[1] / frequency) ** 2).sum()
    return float(1 / intercept), float(np.sqrt(variance) / intercept**2)
