"""Which frequencies reach which distance: spectra along the chain and the paper's threshold rule.

The rule (section 5.1 of Otsubo et al. 2017): f_low-pass is the frequency at which the amplitude
falls to 2 % of the maximum. Its result depends on distance, record length and threshold; the
unbiased band edge is in `dispersion`.
"""

from __future__ import annotations

import numpy as np

from modal.signals import Signals


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


def wavelength(velocity: float, f_low_pass: float) -> float:
    """lambda_low-pass, m, of a lattice with this long-wave velocity: 2 l, with Eq. 7 for l."""
    return 2 * velocity / (np.pi * f_low_pass)
