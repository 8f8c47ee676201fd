"""Frequency and wave number at once: the double Fourier transform of a record over time and z."""

from __future__ import annotations

import numpy as np

from modal.tools.errors import InputError
from modal.waves.signals import Signals

UNEVEN = 0.5
"""Deviation of a spacing from their mean, in parts of it, beyond which no wave number is known."""
FADED = 0.2
"""Part of a record and of a chain that the map fades out."""
PADDING = 4
"""Of the map, in lengths of the record."""


def far_end(count: int) -> np.ndarray:
    """Shape (count,): 1, and a squared cosine over the last fifth, for what begins at rest."""
    fall = np.cos(np.linspace(-4, 1, count) * np.pi / 2) ** 2
    return np.where(np.arange(count) < (1 - FADED) * count, 1, fall)


def frequency_wavenumber(
    motion: np.ndarray, time: np.ndarray, position: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies (nf,) Hz, wave numbers (nk,) rad/m, complex U (nf, nk) of motion (nt, nl).

    Wave numbers ascend; those of waves towards higher z are positive. Positions ascend, equally
    spaced to half of their distance: InputError where they are not.
    """
    spacing = np.diff(position)
    if len(spacing) == 0 or abs(spacing - spacing.mean()).max() > UNEVEN * abs(spacing.mean()):
        raise InputError("layers are too unequally spaced for a spectrum in space")
    nt, nl = (PADDING * count for count in motion.shape)
    taper = far_end(len(time))[:, None] * far_end(len(position))
    spectrum = np.fft.rfft(motion * taper, nt, axis=0)
    spectrum = np.fft.fft(spectrum.conj(), nl, axis=1)
    frequency = np.fft.rfftfreq(nt, float(np.mean(np.diff(time))))
    wavenumber = 2 * np.pi * np.fft.fftfreq(nl, float(spacing.mean()))
    order = np.argsort(wavenumber)
    return frequency, wavenumber[order], spectrum[:, order]


def fk_map(signals: Signals) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Amplitude over frequency and wave number of a record's chain, to look at.

    Returns frequency (nf,) Hz, wavenumber (nk,) rad/m (both from 0 up, waves towards high z) and
    amplitude (nf, nk) relative to its maximum.
    """
    u, z = signals.chain_displacement, signals.chain_position
    f, k, spectrum = frequency_wavenumber(u, signals.time, z)
    low, ahead = f < 4 * signals.input_frequency, k >= 0
    amplitude = abs(spectrum)[low][:, ahead]
    return f[low], k[ahead], amplitude / amplitude.max()
