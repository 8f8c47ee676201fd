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

from modal.signals import Signals

DECAY = 7.0
"""gamma T: the cut leaves e^-7 = 1e-3 of the last reflection."""
RESOLUTION = 0.376
"""In f_1 = V / 2 L: maxima lie f_1 apart."""
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
        k = at[0]
        # Near a resonance 1 / g^2 is a parabola.
        before, top, behind = 1 / g[k - 1 : k + 2] ** 2
        bend = before - 2 * top + behind
        shift = 0.5 * (before - behind) / bend
        place = self.frequency[k] + shift * (self.frequency[1] - self.frequency[0])
        return float(place), float((top - 0.25 * (before - behind) * shift) ** -0.5)

    def undamped(self, passage: float) -> float:
        """Height of the maxima of a column without damping under the same window.

        `passage` is the time, s, of a wave from wall to wall.
        """
        return float(1 / np.sinh(np.pi * self.resolution * passage))


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
