"""How disorder scatters the coherent wave: width of the ridge, mean free path, Ioffe-Regel limit.

The full width of the ridge of the dynamic structure factor is the rate, in Hz, at which a standing
wave loses its energy to others, over 2 pi. The mean free path is the velocity over that rate. Where
it falls to half a wavelength, l = lambda / 2 (pi times the width is then the frequency), a plane
wave is no longer one: the limit of Ioffe and Regel, a low-pass that needs no threshold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.estimators.fits import PowerLaw, power_law
from analysis.estimators.structure_factor import StructureFactor

AROUND = 0.7, 1.3
"""Part of a frequency between which the width's power of the frequency is fitted."""


@dataclass(frozen=True)
class Scattering:
    """frequency (n,) Hz of the ridge, rising; width (n,) Hz, full at half height; velocity m/s.

    diameter in m. Widths that are not told from zero are NaN.
    """

    frequency: np.ndarray
    width: np.ndarray
    velocity: float
    diameter: float

    @staticmethod
    def of(found: StructureFactor, velocity: float, diameter: float) -> Scattering:
        """From the ridge of a structure factor, as far as its frequency rises."""
        peak, width = found.ridge()
        rising = np.isfinite(peak) & (np.maximum.accumulate(np.nan_to_num(peak)) == peak)
        width = np.where(width > found.resolution / 2, width, np.nan)
        return Scattering(peak[rising], width[rising], velocity, diameter)

    def width_at(self, frequency: float) -> float:
        """Width, Hz, at a frequency, Hz, straight between the ridge's logarithms; NaN outside."""
        known = np.isfinite(self.width)
        if known.sum() < 2 or not np.isfinite(frequency) or frequency <= 0:
            return np.nan
        f, width = np.log(self.frequency[known]), np.log(self.width[known])
        return float(np.exp(np.interp(np.log(frequency), f, width, np.nan, np.nan)))

    def free_path(self, frequency: float) -> float:
        """Mean free path at a frequency (Hz), in diameters: V / (2 pi width)."""
        return self.velocity / (2 * np.pi * self.width_at(frequency)) / self.diameter

    @property
    def limit(self) -> float:
        """Ioffe-Regel frequency, Hz: the first at which pi times the width reaches it; else NaN."""
        known = np.isfinite(self.width)
        f, excess = self.frequency[known], np.pi * self.width[known] / self.frequency[known]
        beyond = np.flatnonzero(excess >= 1)
        if not len(beyond) or beyond[0] == 0:
            return np.nan
        pair = [beyond[0] - 1, beyond[0]]
        return float(np.exp(np.interp(0, np.log(excess[pair]), np.log(f[pair]))))

    def of_waves(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Frequency, Hz, width, Hz, and mean free path, D, up to the Ioffe-Regel frequency.

        Or up to where the width falls back to half of its largest: what stands out is then no ridge
        but a single line of its noise.
        """
        known = np.isfinite(self.width)
        f, width = self.frequency[known], self.width[known]
        lost = np.append(width < 0.5 * np.maximum.accumulate(width), True)
        beyond = np.append(np.pi * width >= f, True)
        kept = slice(0, min(int(np.argmax(lost)), int(np.argmax(beyond)) + 1))
        f, width = f[kept], width[kept]
        return f, width, self.velocity / (2 * np.pi * width) / self.diameter

    def power(self, frequency: float) -> PowerLaw:
        """The width as a power of the frequency, about a frequency in Hz."""
        low, high = (part * frequency for part in AROUND)
        steep = (self.frequency > low) & (self.frequency < high) & np.isfinite(self.width)
        return power_law(self.frequency[steep], self.width[steep])
