"""Which frequencies reach which distance: spectra along the chain and the paper's threshold rule.

The rule (section 5.1 of Otsubo et al. 2017): f_low-pass is the frequency at which the amplitude
falls to 2 % of the maximum. Its result depends on distance, record length and threshold; the
unbiased band edge is in `dispersion`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.waves.signals import Signals

FADE = 0.2
"""Part of a record, at its end, that fades out."""


SURE = 0.9
"""Part of the spectrum below whose end it is seen that nothing more follows."""


def spectrum_with_distance(signals: Signals, padding: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Frequency (nf,) Hz and displacement amplitude (nf, nc), relative to the overall maximum."""
    nt = len(signals.time)
    step = float(np.mean(np.diff(signals.time)))
    frequency = np.fft.rfftfreq(padding * nt, step)
    keep = frequency < 4 * signals.input_frequency
    amplitude = np.abs(np.fft.rfft(signals.chain_displacement, padding * nt, axis=0))[keep]
    return frequency[keep], amplitude / amplitude.max()


def threshold_frequency(
    frequency: np.ndarray, amplitude: np.ndarray, threshold: float = 0.02
) -> np.ndarray:
    """Highest frequency (nc,) Hz at which each column exceeds threshold * its own maximum."""
    above = amplitude > threshold * amplitude.max(axis=0)
    last = amplitude.shape[0] - 1 - np.argmax(above[::-1], axis=0)
    return frequency[last]


def plateau(values: np.ndarray, first: int = 10, last: int = 40) -> float:
    """The rule's value for a crystal: the median over layers first ... last.

    Nearer, the wall's own field counts; farther, the short record has not yet received the slow
    frequencies close to the band edge, and the value falls.
    """
    part = values[first : last + 1]
    return float(np.median(part)) if part.size else np.nan


@dataclass(frozen=True)
class Plateau:
    """Value of a distance curve where it is flattest: median, half the quartile distance, place."""

    value: float
    error: float
    start: float
    end: float


def flattest(
    distance: np.ndarray, values: np.ndarray, width: float, first: float, last: float
) -> Plateau:
    """The plateau of `values` (n,) over `distance` (n,), in m, chosen without an eye.

    Of all stretches of `width` between `first` and `last` the one in which the values change least:
    the least difference of the medians of its two halves, plus half its quartile distance. NaN
    where no stretch fits; values that are NaN do not count. Nearer than some diameters the wall's
    own field counts; farther than the record reaches, it ends before the slow high frequencies
    have come: `first` and `last` keep off both.
    """
    order = np.argsort(distance)
    order = order[np.isfinite(np.asarray(values)[order])]
    z, f = np.asarray(distance)[order], np.asarray(values)[order]
    best = Plateau(np.nan, np.nan, np.nan, np.nan)
    least = np.inf
    for start in np.arange(first, last - width + 1e-9 * width, width / 10):
        inside = (z >= start) & (z <= start + width)
        early = inside & (z < start + width / 2)
        if early.sum() < 2 or (inside & ~early).sum() < 2:
            continue
        half = np.subtract(*np.percentile(f[inside], [75, 25])) / 2
        change = abs(np.median(f[early]) - np.median(f[inside & ~early])) + half
        if change < least:
            least = change
            best = Plateau(float(np.median(f[inside])), float(half), start, start + width)
    return best


def threshold_curves(
    time: np.ndarray,
    displacement: np.ndarray,
    thresholds: tuple[float, ...],
    highest: float,
    fade: float = FADE,
) -> np.ndarray:
    """The threshold rule for every column of `displacement` (nt, p); shape (thresholds, p), Hz.

    NaN where the amplitude is still above the threshold close to `highest` (Hz). Four frequencies a
    record length. The last part, `fade`, of the record fades out by a half cosine: a cut in the
    middle of a motion spreads over all frequencies as 1 / f and would lie above the threshold.
    """
    step = float(time[1] - time[0])
    frequency = np.arange(0, min(highest, 0.5 / step), 1 / (4 * len(time) * step))
    past = np.clip((time - time[0]) / (time[-1] - time[0]) / fade - (1 / fade - 1), 0, 1)
    kernel = np.exp(-2j * np.pi * frequency[:, None] * time) * np.cos(np.pi / 2 * past) ** 2
    found = np.empty((len(thresholds), displacement.shape[1]))
    for start in range(0, displacement.shape[1], 4096):  # some spectra at a time: memory
        part = slice(start, start + 4096)
        amplitude = abs(kernel @ displacement[:, part])
        for row, threshold in zip(found, thresholds, strict=True):
            row[part] = threshold_frequency(frequency, amplitude, threshold)
    found[found > SURE * frequency[-1]] = np.nan
    return found


def wavelength(velocity: float, f_low_pass: float) -> float:
    """lambda_low-pass, m, by Eq. 7, which holds for nearest neighbours alone: theory's 2 l."""
    return 2 * velocity / (np.pi * f_low_pass)
