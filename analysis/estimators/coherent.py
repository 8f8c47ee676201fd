"""Measure the coherent wave: wave number, attenuation and velocities from means over layers.

Means over slabs remove most of the scattered motion. Under a window exp(-eta t) the transform U(z,
s), s = eta - i omega, of a wave in one direction varies as exp(i q z): Re q is the wave number
kappa, Im q the decay. The ratio of neighbouring layers gives exp(i q l), by least squares over a
stretch of the packing that the reflected wave does not reach before the record is cut. The window
adds eta divided by the group velocity to Im q, which is subtracted; to first order in eta it does
not change kappa.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from analysis.estimators.travel_time import first_peak_times, travel_velocity
from modal.tools.arrays import Ints
from modal.waves.signals import Signals

DECAY = 4.0
"""Damping eta T of the window over a record of length T: at the record's end it is e^-4."""
STRETCH = (0.1, 0.6)
"""Ends of the stretch of layers that is used, in parts of the length: it lies beyond the near field
of the source wall, and the reflection has not reached it."""
PASSAGES = 1.3
"""Longest record, in times that the wave takes from wall to wall: the reflection reaches 0.6 L
after 1.4 of them. A record of 1.73 gives V_P 0.4 % too high, one of 1.95 gives 0.9 %."""
MIN_CORRELATION = 0.9
"""Least correlation of neighbouring layers for which a wave number is known."""
MIN_LAYERS = 3
SPACING_PASSES = 4
"""Number of passes that correct the wave number for unequal distances of layers."""
SKIPPED_FREQUENCIES = 2
"""Number of the lowest frequencies that are left out when velocities are extrapolated to zero."""
MIN_FREQUENCIES = 5
"""Fewest frequencies from which the velocity is extrapolated."""

WaveEnd = Literal["range", "incoherent", "backward", "few_layers"]
"""The rule that ends the coherent wave towards high frequencies.

range: the highest frequency that is read. incoherent: neighbouring layers correlate by less than
`MIN_CORRELATION`. backward: the wave number does not rise with frequency. few_layers: too few
layers for any wave."""


@dataclass(frozen=True)
class Coherent:
    """The coherent wave as a function of frequency; NaN above the frequency where the wave ends.

    Attributes
    ----------
    frequency : ndarray (nf,)
        Hz.
    wavenumber, attenuation : ndarray (nf,)
        Wave number and decay of the amplitude, 1/m.
    resolution : float
        Resolution, Hz: values at frequencies that are closer to each other are not independent.
    ended_by : str
        The rule that ends the wave (`WaveEnd`).
    """

    frequency: np.ndarray
    wavenumber: np.ndarray
    attenuation: np.ndarray
    resolution: float
    ended_by: WaveEnd = "range"

    @property
    def phase_velocity(self) -> np.ndarray:
        """Return omega / kappa (nf,), m/s."""
        return 2 * np.pi * self.frequency / self.wavenumber

    @property
    def group_velocity(self) -> np.ndarray:
        """Return d omega / d kappa (nf,), m/s, by central differences."""
        return np.gradient(2 * np.pi * self.frequency) / np.gradient(self.wavenumber)


def coherent_wave(
    signals: Signals,
    length: float,
    *,
    highest: float | None = None,
    points: int = 120,
    decay: float = DECAY,
) -> Coherent:
    """Measure the coherent wave of a record.

    Parameters
    ----------
    signals : Signals
        A record of layer means; without them, of a chain, whose distances must be equal. It is cut
        before the reflection, whose time follows from the velocity of first peaks.
    length : float
        From wall to wall, m.
    highest : float, optional
        Highest frequency, Hz; by default twice the pulse's, where its spectrum ends.
    points : int
        Number of frequencies.
    decay : float
        Damping eta T of the window over the record.
    """
    if not highest:
        highest = 2 * signals.input_frequency
    frequency = np.linspace(highest / points, highest, points)
    z, u = _used_layers(signals, length)
    if len(z) < MIN_LAYERS:
        unknown = np.full(points, np.nan)
        return Coherent(frequency, unknown, unknown, np.nan, "few_layers")
    velocity, _ = travel_velocity(z, first_peak_times(replace(signals, chain_displacement=u)))
    end = np.inf
    if velocity > 0:
        end = PASSAGES * length / velocity
    used = signals.time - signals.time[0] <= end
    time = signals.time[used]
    u = u[used]
    eta = decay / (time[-1] - time[0])
    kernel = np.exp((2j * np.pi * frequency[:, None] - eta) * time)
    field = kernel @ u
    q, incoherent = _wavenumber_of_neighbours(field, z)
    slowness = np.gradient(q.real, 2 * np.pi * frequency)
    lost = incoherent | (slowness <= 0)
    known = ~np.logical_or.accumulate(lost)
    wavenumber = np.where(known, q.real, np.nan)
    attenuation = np.where(known, q.imag - eta * slowness, np.nan)
    # Noise under the window is correlated as 1 / (1 + (pi df / eta)^2), whose integral is eta.
    return Coherent(frequency, wavenumber, attenuation, eta, _end_rule(incoherent, lost))


def _end_rule(incoherent: np.ndarray, lost: np.ndarray) -> WaveEnd:
    """Return the rule that ends the wave at the first frequency where the wave is `lost` (nf,).

    `incoherent` (nf,) marks frequencies at which neighbouring layers do not correlate.
    """
    if not lost.any():
        return "range"
    if incoherent[np.argmax(lost)]:
        return "incoherent"
    return "backward"


def _used_layers(signals: Signals, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return position (k,), m, and displacement (nt, k) of the layers in `STRETCH`, ascending."""
    z = signals.chain_position
    u = signals.chain_displacement
    if signals.layer_displacement is not None:
        z = signals.layer_position
        u = signals.layer_displacement
    order = np.argsort(z)
    depth = ((z - z.min()) / length)[order]
    used = order[(depth >= STRETCH[0]) & (depth <= STRETCH[1])]
    return z[used], u[:, used]


def _wavenumber_of_neighbours(field: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the complex wave number q (nf,), 1/m, and where neighbours are incoherent (nf,).

    `field` (nf, k) has the transforms of layers at `z` (k,), m. Neighbours are incoherent if their
    correlation is below `MIN_CORRELATION`.
    """
    before = field[:, :-1]
    after = field[:, 1:]
    power_before = (abs(before) ** 2).sum(axis=1)
    power = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    distance = float(np.mean(np.diff(z)))
    # Layers are not quite equally far apart: each step is turned back to the mean distance.
    excess = np.diff(z) - distance
    kappa = np.zeros(len(field))
    for _ in range(SPACING_PASSES):
        product = before.conj() * after * np.exp(-1j * kappa[:, None] * excess)
        product = product.sum(axis=1)
        q = -1j * np.log(product / power_before) / distance
        kappa = q.real
    return q, abs(product) < MIN_CORRELATION * power


def fitted_frequencies(wave: Coherent) -> Ints:
    """Return the indices (k,) of the frequencies from which `longest_waves` extrapolates."""
    known = np.flatnonzero(np.isfinite(1 / wave.phase_velocity))
    return known[SKIPPED_FREQUENCIES : max(8, len(known) // 3)]


def longest_waves(wave: Coherent) -> tuple[float, float]:
    """Return V_P of the longest waves and its standard error, m/s.

    kappa / omega is extrapolated linearly in f^2 to zero, from the lowest third of the frequencies.
    An equal error of kappa at all frequencies makes an error of the slowness proportional to 1 / f.
    Only points that are `resolution` apart are independent. The stated error is 1.2 times the
    scatter that was found in records with white noise. NaN for fewer than `MIN_FREQUENCIES`
    frequencies.
    """
    slowness = 1 / wave.phase_velocity
    known = fitted_frequencies(wave)
    if len(known) < MIN_FREQUENCIES:
        return np.nan, np.nan
    frequency = wave.frequency[known]
    # Squares in Hz^2, beside 1, would lose the intercept to round-off for fast waves.
    square = (frequency / frequency[-1]) ** 2
    solve = np.linalg.pinv(np.stack([square, np.ones(len(known))], axis=1))
    curvature, intercept = solve @ slowness[known]
    residual = (slowness[known] - curvature * square - intercept) * frequency
    dependent_points = max(1.0, wave.resolution / (wave.frequency[1] - wave.frequency[0]))
    wavenumber_variance = dependent_points * (residual**2).sum() / (len(known) - 2)
    variance = wavenumber_variance * ((solve[1] / frequency) ** 2).sum()
    return float(1 / intercept), float(np.sqrt(variance) / intercept**2)
