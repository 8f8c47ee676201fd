"""Density of states over that of plane waves, D(f) / f^2: how many soft modes a packing has.

In a solid of plane waves alone D grows as f^2 (Debye) and the ratio is level. A packing near its
loss of rigidity has modes at low frequency beside the waves: the ratio has a maximum, the higher
and the lower in frequency the fewer contacts hold a sphere. Frequencies are in units of the
highest, which makes the ratio a number: 3 for Debye's density with no other modes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FIRST_LINES = 10
"""Steps between the frequencies of a density below which modes of zero frequency are seen: 2.5
widths of a single mode's line, as four frequencies stand in a width (`modal.modes.density`)."""
TENTH = 0.1
"""Part of the highest frequency at which packings are compared."""


@dataclass(frozen=True)
class Excess:
    """frequency (n,) over the highest, `highest` Hz; reduced (n,) D f_max^3 / f^2, D a share."""

    frequency: np.ndarray
    reduced: np.ndarray
    highest: float

    @staticmethod
    def of(frequency: np.ndarray, density: np.ndarray, modes: float, highest: float) -> Excess:
        """From modes per Hz (n,) at evenly spaced frequencies (n,) Hz, `modes` in all.

        >>> f = np.linspace(0, 1e5, 1001)
        >>> debye = Excess.of(f, 3 * f**2 / 1e5**3 * 600, 600, 1e5)
        >>> float(round(debye.at_a_tenth, 12))
        3.0
        """
        first = FIRST_LINES * (frequency[1] - frequency[0])
        keep = (frequency > first) & (frequency < highest)
        f = frequency[keep] / highest
        return Excess(f, density[keep] / modes * highest / f**2, highest)

    @property
    def at_a_tenth(self) -> float:
        """The ratio at a tenth of the highest frequency; NaN where the density is not known."""
        if len(self.frequency) < 2:
            return np.nan
        return float(np.interp(TENTH, self.frequency, self.reduced, np.nan, np.nan))

    @property
    def _top(self) -> int:
        """Place of the maximum; 0, where it may lie below all that is known."""
        return int(np.argmax(self.reduced)) if len(self.reduced) else 0

    @property
    def peak(self) -> float:
        """The largest ratio; NaN where it is at the lowest frequency known."""
        return float(self.reduced[self._top]) if self._top else np.nan

    @property
    def peak_frequency(self) -> float:
        """Hz of the largest ratio; NaN likewise."""
        return float(self.frequency[self._top] * self.highest) if self._top else np.nan


UNKNOWN = Excess(np.empty(0), np.empty(0), np.nan)
