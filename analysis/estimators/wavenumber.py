"""Find wave numbers from the record of a chain, at one frequency or at all frequencies.

The dispersion relation of the paper's Figs. 14 and 15 is the ridge of a chain's map of frequency
and wave number, the double Fourier transform over time and z. At one frequency the ridge is the
wave number kappa for which the sum of U(z) exp(-i kappa z) over the chain is largest, where U(z) is
the spectrum of the displacement at z. In this sum the particles may have unequal distances.
"""

import numpy as np

from analysis.estimators.fits import summit
from modal.tools.arrays import Array, Bools, Complex, Floats
from modal.tools.errors import UnavailableError
from modal.waves.signals import Signals

STRETCH = (0.1, 0.6)
"""Ends of the stretch that is used, in parts of the length: it lies beyond the near field of the
source wall, and the wave front has passed it when the record ends."""
SEARCH_RANGE = (0.6, 2.5)
"""Bounds of the search, relative to the wave number of the long waves at the same frequency."""
SEARCH_POINTS = 400
MIN_PARTICLES = 8
MAX_RELATIVE_UNEVENNESS = 0.5
"""Largest deviation of a spacing from the mean spacing, relative to it, for which a spectrum in
space is computed."""
FADED_SHARE = 0.2
"""Part of the record and of the chain, at their ends, that the taper of the map fades out."""
PADDING = 4
"""Length of record and chain after zeros are appended, divided by the original lengths."""


def chain_wavenumber(
    record: Signals, frequency: float, length: float, *, velocity: float, part: Bools | None = None
) -> float:
    """Return the wave number kappa, 1/m, of a record at one frequency; NaN without a ridge.

    Parameters
    ----------
    record : Signals
        A record, whose chain is used within `STRETCH`.
    frequency : float
        Hz.
    length : float
        Distance from wall to wall, m.
    velocity : float
        Velocity of the long waves, m/s; the search covers `SEARCH_RANGE` times their wave number. A
        maximum at the end of this range does not count.
    part : ndarray (nc,) of bool, optional
        The particles of the chain that are used.
    """
    depth = (record.chain_position - record.chain_position.min()) / length
    used = (depth >= STRETCH[0]) & (depth <= STRETCH[1])
    if part is not None:
        used &= part
    if used.sum() < MIN_PARTICLES or not np.isfinite(frequency) or frequency <= 0:
        return np.nan
    z = record.chain_position[used]
    # The wave exp(i kappa z - i omega t) counts as forward.
    rotation = np.exp(2j * np.pi * frequency * record.time)
    field = rotation @ record.chain_displacement[:, used]
    # Particles swing unequally; the phase alone says how far the wave has come.
    field = field / np.maximum(abs(field), np.finfo(float).tiny)
    long_wave = 2 * np.pi * frequency / velocity
    kappa = np.linspace(*SEARCH_RANGE, SEARCH_POINTS) * long_wave
    height = abs(field @ np.exp(-1j * np.outer(z - z[0], kappa)))
    top = int(np.argmax(height))
    if top in (0, SEARCH_POINTS - 1):
        return np.nan
    shift = summit(height[top - 1], height[top], height[top + 1])
    return float(kappa[top] + shift * (kappa[1] - kappa[0]))


def end_taper(count: int) -> Floats:
    """Return a taper (count,) for data that begin at rest: 1, then a squared cosine down to 0.

    The cosine covers the last `FADED_SHARE` of the data, a fifth.
    """
    fall = np.cos(np.linspace(-4, 1, count) * np.pi / 2) ** 2
    return np.where(np.arange(count) < (1 - FADED_SHARE) * count, 1, fall)


def frequency_wavenumber(
    motion: Floats, time: Floats, position: Floats
) -> tuple[Array, Array, Complex]:
    """Return the spectrum of a motion in frequency and wave number.

    Parameters
    ----------
    motion : ndarray (nt, nl)
    time : ndarray (nt,)
        s.
    position : ndarray (nl,)
        Positions, m, ascending. UnavailableError if a spacing differs from the mean by more than
        half of it.

    Returns
    -------
    frequency : ndarray (nf,)
        Hz.
    wavenumber : ndarray (nk,)
        Wave numbers, rad/m, ascending; positive for waves towards higher z.
    spectrum : complex ndarray (nf, nk)
    """
    spacing = np.diff(position)
    uneven = len(spacing) == 0
    if not uneven:
        deviation = abs(spacing - spacing.mean()).max()
        uneven = deviation > MAX_RELATIVE_UNEVENNESS * abs(spacing.mean())
    if uneven:
        raise UnavailableError(
            "uneven_chain", "layers are too unequally spaced for a spectrum in space"
        )
    padded_times = PADDING * motion.shape[0]
    padded_layers = PADDING * motion.shape[1]
    taper = end_taper(len(time))[:, None] * end_taper(len(position))
    spectrum = np.fft.rfft(motion * taper, padded_times, axis=0)
    spectrum = np.fft.fft(spectrum.conj(), padded_layers, axis=1)
    frequency = np.fft.rfftfreq(padded_times, float(np.mean(np.diff(time))))
    wavenumber = 2 * np.pi * np.fft.fftfreq(padded_layers, float(spacing.mean()))
    order = np.argsort(wavenumber)
    return frequency, wavenumber[order], spectrum[:, order]
