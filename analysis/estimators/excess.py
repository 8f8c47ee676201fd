"""Density of states over that of plane waves, D(f) / f^2: how many soft modes a packing has.

In a solid of plane waves alone D grows as f^2 (Debye) and the ratio is level. A packing near its
loss of rigidity has modes at low frequency beside the waves: the ratio has a maximum, the higher
and the lower in frequency the fewer contacts hold a sphere. Frequencies are in units of the
highest, which makes the ratio a number: 3 for Debye's density with no other modes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

FIRST_LINES = 10
"""Steps between the frequencies of a density below which modes of zero frequency are seen: 2.5
widths of a single mode's line, as four frequencies stand in a width (`modal.modes.density`)."""
TENTH = 0.1
"""Part of the highest frequency at which packings are compared."""


class Excess(NamedTuple):
    """frequency (n,) over the highest; reduced (n,) D f_max^3 / f^2, D a share of all modes.

    `at_a_tenth` is the ratio at a tenth of the highest frequency, `peak` the largest, at
    `peak_frequency`, Hz; NaN where they are not known, the peak also at the lowest frequency known.
    """

    frequency: np.ndarray
    reduced: np.ndarray
    at_a_tenth: float
    peak: float
    peak_frequency: float

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
        reduced = density[keep] / modes * highest / f**2
        tenth = float(np.interp(TENTH, f, reduced, np.nan, np.nan)) if len(f) > 1 else np.nan
        top = int(np.argmax(reduced)) if len(f) else 0
        peak = (float(reduced[top]), float(f[top] * highest)) if top else (np.nan, np.nan)
        return Excess(f, reduced, tenth, *peak)
