"""Read at which frequency an amplitude falls below a threshold: of a particle, and of a stretch.

The paper's rule (section 5.1 of Otsubo et al. 2017) uses a map of frequency over distance from the
source, shaded by the amplitude of the displacement of one chain of particles. f_low-pass is the
frequency at which the amplitude falls to 2 % (or 1 %) of the maximum value, where it no longer
varies with distance. `low_pass` applies the rule to the records of a packing.
"""

from typing import Literal

import numpy as np

from analysis.caveats import Caveat
from analysis.steps import Step, limit_step
from analysis.value import Value, unknown

Reference = Literal["map", "own"]
"""The maximum that a threshold is relative to: that of the whole map ("map"), or that of each
particle's own spectrum ("own")."""
THRESHOLDS = (0.02, 0.01, 0.03, 0.05)
"""Amplitudes at f_low-pass, divided by the maximum; the two that the paper uses come first."""
NEAR_FIELD = 0.02
"""Length of the source wall's near field, which is never used, divided by the length of the
packing."""
MAX_PLATEAU_CHANGE = 0.1
"""Largest relative difference between the medians of a stretch and of its neighbours for which the
value counts as a plateau."""
KNOWN_RANGE = 0.9
"""Part of the computed frequencies in which a crossing must lie: beyond it, the curve could rise
again where nothing was computed."""
OVERSAMPLING = 4
"""Number of computed frequencies per 1 / T, where T is the length of the record."""
PARTICLES_TOGETHER = 4096
"""Particles whose spectra are computed in one product, which bounds the memory."""
MIN_PARTICLES = 3
"""Fewest particles with a value from which the median of a stretch is taken."""


def last_crossing(
    frequency: np.ndarray, amplitude: np.ndarray, level: np.ndarray | float
) -> np.ndarray:
    """Return the highest frequency (nc,), Hz, at which each column falls through its level.

    The logarithm of the amplitude is interpolated linearly. The result is NaN if a column is
    nowhere above its level, or still above it beyond `KNOWN_RANGE`.

    Parameters
    ----------
    frequency : ndarray (nf,)
        Frequencies, Hz, equally spaced.
    amplitude : ndarray (nf, nc)
    level : ndarray (nc,) or float
        Level of each column, in the unit of the amplitude.

    Examples
    --------
    >>> last_crossing(np.arange(4.0), np.array([[8.0], [8.0], [2.0], [0.1]]), 4.0)
    array([1.5])
    """
    count = len(frequency)
    if count < 2:  # the record is shorter than a period of the highest frequency
        return np.full(amplitude.shape[1], np.nan)
    above = amplitude > level
    last_above = np.minimum(count - 1 - np.argmax(above[::-1], axis=0), count - 2)
    column = np.arange(amplitude.shape[1])
    tiny = np.finfo(float).tiny
    log_above = np.log(np.maximum(amplitude[last_above, column], tiny))
    log_below = np.log(np.maximum(amplitude[last_above + 1, column], tiny))
    log_level = np.log(np.maximum(np.broadcast_to(level, log_above.shape), tiny))
    share = (log_above - log_level) / np.maximum(log_above - log_below, 1e-12)
    step = frequency[1] - frequency[0]
    crossing = frequency[last_above] + step * np.clip(share, 0, 1)
    known = above.any(axis=0) & (last_above <= KNOWN_RANGE * (count - 1))
    return np.where(known, crossing, np.nan)


def spectra(
    time: np.ndarray, displacement: np.ndarray, highest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (nf,), Hz, up to `highest`, and amplitudes (nf, p) of a motion (nt, p).

    Amplitudes are in single precision, hence in units of the largest displacement.
    """
    largest = float(abs(displacement).max(initial=0.0)) or 1.0
    step = float(time[1] - time[0])
    frequency = np.arange(0, min(highest, 0.5 / step), 1 / (OVERSAMPLING * len(time) * step))
    kernel = np.exp(-2j * np.pi * frequency[:, None] * time)
    amplitude = np.empty((len(frequency), displacement.shape[1]), np.float32)
    for start in range(0, displacement.shape[1], PARTICLES_TOGETHER):
        part = slice(start, start + PARTICLES_TOGETHER)
        u = displacement[:, part] / largest
        # Two real products are half of the work of a complex one.
        amplitude[:, part] = np.hypot(kernel.real @ u, kernel.imag @ u)
    return frequency, amplitude


def threshold_curves(
    frequency: np.ndarray, amplitude: np.ndarray, reference: Reference = "map"
) -> np.ndarray:
    """Return the last crossing (thresholds, p), Hz, of each of `THRESHOLDS` for each particle.

    `frequency` (nf,) is in Hz; the `amplitude` (nf, p) is divided by the maximum of the whole map
    ("map") or of each particle ("own").
    """
    maximum = amplitude.max(axis=0)
    if reference == "map":
        maximum = amplitude.max()
    return np.array([last_crossing(frequency, amplitude, t * maximum) for t in THRESHOLDS])


def at_stretch(
    distance: np.ndarray, values: np.ndarray, length: float, stretch: tuple[float, float]
) -> Value:
    """Return the median value, Hz, over a stretch of the chain, and whether there is a plateau.

    The error is half of the interquartile range. The median is unknown if fewer than
    `MIN_PARTICLES`, or less than half of the particles, have a value. There is a plateau if the
    stretches of equal width before and after this one have nearly the same median; otherwise the
    rule has no definite answer.

    Parameters
    ----------
    distance : ndarray (nc,)
        Distance from the source wall, m.
    values : ndarray (nc,)
        Values of the particles, Hz.
    length : float
        Distance from wall to wall, m.
    stretch : tuple of float
        Ends of the stretch, as fractions of the length.
    """
    low, high = stretch
    width = high - low
    known, particles = _known_values(distance, values, length, (low, high))
    ends = {"stretch_start": max(NEAR_FIELD, low) * length, "stretch_end": high * length}
    window = Step("window", "read", ends)
    steps: tuple[Step, ...] = (window, _step_of_particles(known, particles))
    if not _are_enough(known, particles):
        counts = {"seen": len(known), "particles": particles}
        return unknown("Hz", Caveat("few_particles", counts), steps=steps)
    value = float(np.median(known))
    upper_quartile, lower_quartile = np.percentile(known, [75, 25])
    error = float(upper_quartile - lower_quartile) / 2
    changes = []
    for beside in ((low - width, high - width), (low + width, high + width)):
        known, particles = _known_values(distance, values, length, beside)
        median = np.nan
        if _are_enough(known, particles):
            median = float(np.median(known))
        changes.append(abs(median / value - 1))
    change = float(np.max(changes))
    numbers = {"change": change, "limit": MAX_PLATEAU_CHANGE}
    steps += (limit_step(numbers, "change", "limit"),)
    if change <= MAX_PLATEAU_CHANGE:
        return Value(value, "Hz", {"fit": error}, plateau=True, steps=steps)
    caveat = Caveat("no_plateau_beside")
    if np.isfinite(change):
        caveat = Caveat("no_plateau", {"change": change})
    return Value(value, "Hz", {"fit": error}, (caveat,), plateau=False, steps=steps)


def _step_of_particles(known: np.ndarray, particles: int) -> Step:
    """Return the step that counts the known values (k,) of all `particles` on a stretch."""
    needed = max(MIN_PARTICLES, particles // 2 + 1)
    numbers = {"particles_with_value": len(known), "particles": particles, "needed": needed}
    return limit_step(numbers, "particles_with_value", "needed", least=True)


def _known_values(
    distance: np.ndarray, values: np.ndarray, length: float, stretch: tuple[float, float]
) -> tuple[np.ndarray, int]:
    """Return the finite values (k,) on a stretch, and the number of particles on the stretch.

    The ends of the `stretch` are in parts of `length`.
    """
    low, high = stretch
    inside = (distance >= max(NEAR_FIELD, low) * length) & (distance < high * length)
    return values[inside & np.isfinite(values)], int(inside.sum())


def _are_enough(known: np.ndarray, particles: int) -> bool:
    """Return whether `MIN_PARTICLES`, and over half of all `particles`, have values (k,)."""
    return len(known) >= MIN_PARTICLES and 2 * len(known) > particles
