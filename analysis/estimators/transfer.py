"""From one wall to the other: the gain factor (Fig. 19), and velocities by the cross spectrum.

The gain is the spectrum of the stress at the receiver wall over that at the source wall.

A record that is cut before the packing has come to rest blurs its spectrum in an uncontrolled way.
Under a window exp(-gamma t) that has fallen to e^-DECAY at the record's end the cut does not
matter, and the resolution is stated: gamma / pi, the full width of a resonance at half its power.
Two records are compared under the same window.

The height of a maximum is that window's. Between rigid walls L apart the gain is 1 / |cos(q L)|,
and under the window Im q = gamma / V even without any damping: 1 / sinh(gamma L / V) on a maximum.
So no height stands alone; beside it stand the resolution and what an undamped column has under it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from modal.packing.network import Network
from modal.tools.arrays import Array, Floats
from modal.waves.signals import Signals

DECAY = 7.0
"""gamma T: the cut leaves e^-7 = 1e-3 of the last reflection."""
RESOLUTION = 0.376
"""In f_1 = V / 2 L: maxima lie f_1 apart."""
REACH = 0.5
"""Highest frequency of the gain of a network, V / D; what a crystal passes ends at 0.45."""
TRAVELS = DECAY / (0.5 * np.pi * RESOLUTION)
"""Travel times from wall to wall in a record that this resolution needs."""

PADDING = 8
"""Of the cross spectrum, in lengths of the record."""
FAINTEST = 2e-3
"""Least receiver stress over source stress of a received wave; a loose packing passes 0.7 %."""
QUIET = 0.5
"""Most of the receiver's peak that it may hear in half of the time until then."""


@dataclass(frozen=True)
class Gain:
    """gain (nf,) at frequency (nf,) Hz, with its resolution in Hz."""

    frequency: Floats
    gain: Floats
    resolution: float

    def first_maximum(self) -> tuple[float, float]:
        """Frequency, Hz, and height of the first local maximum; NaN where there is none."""
        return next(self._summits(), (np.nan, np.nan))

    def maxima(self) -> Floats:
        """Frequencies, Hz, of all local maxima, the lowest first."""
        return np.array([frequency for frequency, _ in self._summits()])

    def _summits(self) -> Iterator[tuple[float, float]]:
        g = self.gain
        tops = 1 + np.flatnonzero((g[1:-1] > g[:-2]) & (g[1:-1] >= g[2:]))
        return (self._summit(int(at)) for at in tops)

    def _summit(self, at: int) -> tuple[float, float]:
        """Frequency, Hz, and height of the maximum near a point of the grid."""
        g = self.gain
        # 1 / g^2, a sum of squares of cosines and constants, is smooth where g itself is sharp.
        near = slice(max(0, at - 3), at + 4)
        step = self.frequency[1] - self.frequency[0]
        x = (self.frequency[near] - self.frequency[at]) / step
        curve = np.polyfit(x, g[near] ** -2, len(x) - 1)
        fine = np.linspace(-1, 1, 401)
        values = np.polyval(curve, fine)
        best = int(np.argmin(values))
        if values[best] <= 0:  # a polynomial through noise
            return float(self.frequency[at]), float(g[at])
        return float(self.frequency[at] + step * fine[best]), float(values[best] ** -0.5)

    def undamped(self, passage: float) -> float:
        """Height of the maxima of a column without damping under the same window.

        `passage` is the time, s, of a wave from wall to wall.
        """
        return float(1 / np.sinh(np.pi * self.resolution * passage))


def gain_settings(network: Network, passage: float) -> dict[str, Any]:
    """Resolution and highest frequency, Hz, of a gain; `passage` (s) from wall to wall."""
    diameters = network.length / (2 * float(network.radius.mean()))
    return {"resolution": RESOLUTION * 0.5 / passage, "highest": REACH * diameters / passage}


def gain_factor(signals: Signals, duration: float, highest: float = 2e4) -> Gain | None:
    """Gain of the first `duration` (s) of a record, to `highest` (Hz); None if it is shorter."""
    time = signals.time
    if time[-1] < duration * (1 - 1e-3):
        return None
    kept = time <= duration * (1 + 1e-9)
    time, step = time[kept], time[1] - time[0]
    gamma = DECAY / duration
    resolution = gamma / np.pi
    frequency = np.arange(resolution / 4, highest, resolution / 4)
    kernel = np.exp((2j * np.pi * frequency[:, None] - gamma) * time) * step
    ratio = (kernel @ signals.receiver_stress[kept]) / (kernel @ signals.source_stress[kept])
    return Gain(frequency, abs(ratio), float(resolution))


def cross_spectrum(
    first: Floats, second: Floats, time: Floats, distance: float
) -> tuple[Array, Array, Array]:
    """Phase and group velocity between two signals (nt,) that are `distance` (m) apart.

    Returns frequency (k,) Hz, phase velocity omega / kappa (k,) m/s, and group velocity d omega /
    d kappa (k,) m/s.
    """
    step = float(np.mean(np.diff(time)))
    n = PADDING * len(time)
    cross = np.fft.rfft(first, n) * np.fft.rfft(second, n).conj()
    frequency = np.fft.rfftfreq(n, step)
    phase = np.unwrap(np.angle(cross))
    amplitude = np.abs(cross) / max(np.abs(cross).max(), np.finfo(float).tiny)
    strong = np.flatnonzero(amplitude > 0.1)
    strong = strong[: max(2, len(strong) // 4)]  # long waves: the phase tends to zero with f
    if len(strong) > 1:
        intercept = np.polyfit(frequency[strong], phase[strong], 1)[1]
        phase -= 2 * np.pi * np.round(intercept / (2 * np.pi))
    with np.errstate(divide="ignore", invalid="ignore"):
        velocity = 2 * np.pi * frequency * distance / phase
        group = 2 * np.pi * distance / np.gradient(phase, frequency)
    return frequency, velocity, group


def wall_velocity(signals: Signals, length: float) -> tuple[Array, ...] | None:
    """`cross_spectrum` of the wall stresses over the sample length; None if not yet received.

    The record for dispersion ends about when the wave reaches the receiver; the phase is then
    meaningless, so the receiver's peak must lie well inside the record. None, too, where the source
    does not move in the record, or the receiver hears as much before a wave can have come.
    """
    received = np.abs(signals.receiver_stress)
    if received.max() < FAINTEST * np.abs(signals.source_stress).max():
        return None
    peak = int(np.argmax(received))
    if peak > 0.9 * len(received) or not np.ptp(signals.source_displacement) > 0:
        return None
    if received[: peak // 2].max(initial=0.0) > QUIET * received[peak]:
        return None
    return cross_spectrum(signals.source_stress, signals.receiver_stress, signals.time, length)
