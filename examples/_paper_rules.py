"""Rules of Otsubo et al. (2017) for V_P and the low-pass frequency, from the paper's words alone.

Written without sight of `analysis.estimators`. What the paper leaves open is decided here and said
in each function.
"""

import numpy as np

HALF_OF_LARGEST = 0.5
"""Share of its largest displacement that the first peak of a particle must reach."""
MIDDLE_HALF = (0.25, 0.75)
"""Part of the length whose peaks are fitted: away from both walls."""
NEAR_SOURCE = 0.05
"""Distance, m, within which high frequencies are still there in random packings (section 5.1)."""
PASSED_BY = 0.7
"""Part of the length that the pulse has passed well before the record ends."""


def first_peak_time(time, displacement):
    """Return the time, s, of the first peak of a particle, or NaN if it has none.

    The peak is the first local maximum of at least half the largest displacement, at the top of the
    parabola through it and its neighbours.
    """
    inner = displacement[1:-1]
    is_peak = (inner >= displacement[:-2]) & (inner > displacement[2:])
    is_peak &= inner >= HALF_OF_LARGEST * displacement.max()
    if not is_peak.any():
        return np.nan
    index = int(np.argmax(is_peak)) + 1
    before, top, after = displacement[index - 1 : index + 2]
    offset = (before - after) / (2 * (before - 2 * top + after))
    return time[index] + offset * (time[1] - time[0])


def first_peaks_velocity(time, position, displacement, length):
    """Return V_P, m/s: the slope of the straight line through first peaks (section 2, Fig. 5).

    Times (nt,), s; positions (n,) and length, m; displacements (nt, n) along z, m. The line is the
    least-squares one of position over time, in the middle half of the length.
    """
    low, high = np.multiply(MIDDLE_HALF, length)
    inside = (position >= low) & (position <= high)
    peaks = np.array([first_peak_time(time, one) for one in displacement[:, inside].T])
    known = np.isfinite(peaks)
    return np.polyfit(peaks[known], position[inside][known], 1)[0]


def highest_above(frequency, amplitude, threshold):
    """Return the highest frequency, Hz, with an amplitude of the threshold; NaN if there is none.

    Between two frequencies of the transform the amplitude is a straight line.
    """
    above = np.flatnonzero(amplitude[:-1] >= threshold)
    if len(above) == 0:
        return np.nan
    last = above[-1]
    ends = amplitude[[last + 1, last]]
    return np.interp(threshold, ends, frequency[[last + 1, last]])


def low_pass_by_distance(time, displacement, share):
    """Return the highest transmitted frequency (n,), Hz, of each particle (section 5.1, Fig. 12).

    The threshold is a share of the largest amplitude of all particles and frequencies, as in one
    plot of frequency over distance.
    """
    amplitude = np.abs(np.fft.rfft(displacement, axis=0))
    frequency = np.fft.rfftfreq(len(time), time[1] - time[0])
    threshold = share * amplitude.max()
    return np.array([highest_above(frequency, one, threshold) for one in amplitude.T])


def stable_region(length, *, crystal):
    """Return the ends, m, of the part of the length whose low-pass frequencies count.

    In a random packing they are stable from 0.05 m on, as far as the pulse has passed. In a crystal
    they fall with the distance only because the record is short (section 5.1), so that those within
    0.05 m count.
    """
    if crystal:
        return 0.0, NEAR_SOURCE
    return NEAR_SOURCE, PASSED_BY * length


def low_pass_frequency(time, position, displacement, length, region, *, passages=1.0, share=0.02):
    """Return the median low-pass frequency in a region, and half the middle half of its values, Hz.

    The record ends after some passages of the wave: after one it reaches the receiver.
    """
    velocity = first_peaks_velocity(time, position, displacement, length)
    recorded = time <= passages * length / velocity
    values = low_pass_by_distance(time[recorded], displacement[recorded], share)
    low, high = region
    inside = (position >= low) & (position <= high)
    quarter, median, three_quarters = np.nanpercentile(values[inside], (25, 50, 75))
    return median, (three_quarters - quarter) / 2
