"""Find how far a wave goes before disorder scatters it, by the width of its ridge.

A wave loses its energy to others at a rate of 2 pi times the full width, in Hz, of the ridge. The
mean free path is the velocity divided by this rate. Where it falls to half a wavelength, l = lambda
/ 2 (pi times the width is then the frequency), there is no plane wave any more: this is the limit
of Ioffe and Regel, a low-pass frequency that needs no threshold.
"""

from dataclasses import dataclass

import numpy as np

from analysis.estimators.fits import PowerLaw, power_law

POWER_RANGE = (0.7, 1.3)
"""Range of frequencies, relative to a central one, in which the width's power law is fitted."""
LOST_WIDTH_RATIO = 0.5
"""A width below this part of the largest width at lower frequencies is not that of a ridge: the
maximum is a single line of noise."""


@dataclass(frozen=True)
class Scattering:
    """The ridge of a structure factor, where its width is larger than the resolution.

    Attributes
    ----------
    frequency : ndarray (n,)
        Frequencies, Hz, rising.
    width : ndarray (n,)
        Full width at half height, Hz.
    velocity : float
        Velocity of the long waves, m/s.
    diameter : float
        Mean diameter of the spheres, m.
    """

    frequency: np.ndarray
    width: np.ndarray
    velocity: float
    diameter: float

    def free_path(self, frequency: float) -> float:
        """Return the mean free path at a frequency, Hz, in diameters: V / (2 pi width).

        The logarithm of the width is interpolated linearly in that of the frequency; NaN outside
        the ridge.
        """
        if len(self.width) < 2 or not np.isfinite(frequency) or frequency <= 0:
            return np.nan
        log_width = np.interp(
            np.log(frequency), np.log(self.frequency), np.log(self.width), np.nan, np.nan
        )
        return float(self.velocity / (2 * np.pi * np.exp(log_width)) / self.diameter)

    @property
    def limit(self) -> float:
        """Return the Ioffe-Regel frequency, Hz: the lowest that equals pi times the width.

        NaN if pi times the width is below the frequency everywhere, or above it at the first point.
        """
        excess = np.pi * self.width / self.frequency
        beyond = np.flatnonzero(excess >= 1)
        if not len(beyond) or beyond[0] == 0:
            return np.nan
        pair = [beyond[0] - 1, beyond[0]]
        log_frequency = np.interp(0, np.log(excess[pair]), np.log(self.frequency[pair]))
        return float(np.exp(log_frequency))

    def of_waves(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return frequency, Hz, width, Hz, and mean free path, D, up to the Ioffe-Regel frequency.

        The arrays end earlier where the width falls below `LOST_WIDTH_RATIO` of the largest width
        at lower frequencies: there the maximum is not a ridge but a single line of noise.
        """
        largest_width = np.maximum.accumulate(self.width)
        lost = np.append(self.width < LOST_WIDTH_RATIO * largest_width, True)
        beyond = np.append(np.pi * self.width >= self.frequency, True)
        count = min(int(np.argmax(lost)), int(np.argmax(beyond)) + 1)
        width = self.width[:count]
        free_path = self.velocity / (2 * np.pi * width) / self.diameter
        return self.frequency[:count], width, free_path

    def power(self, frequency: float) -> PowerLaw:
        """Fit the width as a power of the frequency, within `POWER_RANGE` of `frequency`, Hz."""
        low = POWER_RANGE[0] * frequency
        high = POWER_RANGE[1] * frequency
        near = (self.frequency > low) & (self.frequency < high)
        return power_law(self.frequency[near], self.width[near])
