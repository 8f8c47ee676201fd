"""Gain factor: spectrum of the stress at the receiver wall over that at the source wall (Fig. 19).

A record that is cut before the packing has come to rest blurs its spectrum in an uncontrolled way.
Under a window exp(-gamma t) that has fallen to e^-DECAY at the record's end the cut does not
matter, and the resolution is stated: gamma / pi, the full width of a resonance at half its power.
Two records are compared under the same window.

The height of a maximum is that window's. Between rigid walls L apart the gain is 1 / |cos(q L)|,
and under the window Im q = gamma / V even without any damping: 1 / sinh(gamma L / V) on a maximum.
So no height stands alone; beside it stand the resolution and what an undamped column has under it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.packing.network import Network
from modal.waves.response import frequency_response
from modal.waves.signals import Signals

DECAY = 7.0
"""gamma T: the cut leaves e^-7 = 1e-3 of the last reflection."""
RESOLUTION = 0.376
"""In f_1 = V / 2 L: maxima lie f_1 apart."""
REACH = 18
"""Highest frequency of the gain of a network, in f_1 as well."""
TRAVELS = DECAY / (0.5 * np.pi * RESOLUTION)
"""Travel times from wall to wall in a record that this resolution needs."""


@dataclass(frozen=True)
class Gain:
    """gain (nf,) at frequency (nf,) Hz, with its resolution in Hz."""

    frequency: np.ndarray
    gain: np.ndarray
    resolution: float

    def first_maximum(self) -> tuple[float, float]:
        """Frequency, Hz, and height of the first local maximum; NaN where there is none."""
        g = self.gain
        at = 1 + np.flatnonzero((g[1:-1] > g[:-2]) & (g[1:-1] >= g[2:]))
        if not len(at):
            return np.nan, np.nan
        # 1 / g^2, a sum of squares of cosines and constants, is smooth where g itself is sharp.
        near = slice(max(0, at[0] - 3), at[0] + 4)
        step = self.frequency[1] - self.frequency[0]
        x = (self.frequency[near] - self.frequency[at[0]]) / step
        curve = np.polyfit(x, g[near] ** -2, len(x) - 1)
        fine = np.linspace(-1, 1, 401)
        values = np.polyval(curve, fine)
        best = int(np.argmin(values))
        return float(self.frequency[at[0]] + step * fine[best]), float(values[best] ** -0.5)

    def undamped(self, passage: float) -> float:
        """Height of the maxima of a column without damping under the same window.

        `passage` is the time, s, of a wave from wall to wall.
        """
        return float(1 / np.sinh(np.pi * self.resolution * passage))


def network_gain(network: Network, passage: float) -> Gain:
    """Gain of the springs at `RESOLUTION`, without a record; `passage` (s) from wall to wall."""
    first = 0.5 / passage
    found = frequency_response(network, highest=REACH * first, resolution=RESOLUTION * first)
    return Gain(found.frequency, found.gain, found.resolution)


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
