"""Compare a density of states with that of a solid that has plane waves only (Debye)."""

from typing import NamedTuple

import numpy as np

from modal.tools.arrays import Floats

MIN_STEPS_OF_DENSITY = 10
"""Number of frequency steps next to zero in which a density of states shows modes of zero
frequency: 2.5 widths of the line of a single mode, as a width has four frequencies
(`modal.modes.density`)."""
COMPARED_SHARE_OF_HIGHEST = 0.1
"""Share of the highest frequency at which the densities of states of packings are compared."""


class Excess(NamedTuple):
    """The ratio D f_max^3 / f^2 at a tenth of the highest frequency, and its largest value.

    D is the density of states as a share of all modes. `peak_frequency`, Hz, is the frequency of
    the largest value; both are NaN if it is at the lowest known frequency.
    """

    at_a_tenth: float
    peak: float
    peak_frequency: float


def excess_of(frequency: Floats, density: Floats, modes: float, highest: float) -> Excess:
    """Compare a density of states with that of plane waves.

    A solid that has plane waves only has D proportional to f^2 (Debye), and the ratio is 3. A
    packing near its loss of rigidity has further modes at low frequency: the ratio has a maximum,
    which is higher and at a lower frequency if spheres have fewer contacts.

    Parameters
    ----------
    frequency : ndarray (n,), Hz
        Frequencies, evenly spaced.
    density : ndarray (n,)
        Modes per Hz.
    modes : float
        Number of all modes.
    highest : float, Hz
        Highest frequency.

    Examples
    --------
    >>> f = np.linspace(0, 1e5, 1001)
    >>> float(round(excess_of(f, 3 * f**2 / 1e5**3 * 600, 600, 1e5).at_a_tenth, 12))
    3.0
    """
    lowest = MIN_STEPS_OF_DENSITY * (frequency[1] - frequency[0])
    inside = (frequency > lowest) & (frequency < highest)
    f = frequency[inside] / highest
    ratio = density[inside] / modes * highest / f**2
    at_a_tenth = np.nan
    if len(f) > 1:
        at_a_tenth = float(np.interp(COMPARED_SHARE_OF_HIGHEST, f, ratio, np.nan, np.nan))
    if not len(f) or np.argmax(ratio) == 0:
        return Excess(at_a_tenth, np.nan, np.nan)
    peak = int(np.argmax(ratio))
    return Excess(at_a_tenth, ratio[peak], f[peak] * highest)
