"""Wave number of the wave along a chain, from its record: at one frequency, and of all at once.

The dispersion relation of the paper's Figs. 14 and 15 is the ridge of the frequency - wave number
map of a chain, its double Fourier transform over time and z. At one frequency that is the kappa at
which the sum of U(z) exp(-i kappa z) over the chain is largest, U(z) the spectrum of the
displacement at z; distances need not be equal.
"""

import numpy as np

from analysis.estimators.fits import summit
from modal.tools.arrays import Array, Bools, Complex, Floats
from modal.tools.errors import UnavailableError
from modal.waves.signals import Signals

STRETCH = (0.1, 0.6)
"""Part of the length that is used: behind the source wall's own field, ahead of the front's end."""
POINTS = 400
UNEVEN = 0.5
"""Deviation of a spacing from their mean, in parts of it, beyond which no wave number is known."""
FADED = 0.2
"""Part of a record and of a chain that the map fades out."""
PADDING = 4
"""Of the map, in lengths of the record."""


def chain_wavenumber(
    record: Signals, frequency: float, length: float, *, velocity: float, part: Bools | None = None
) -> float:
    """kappa, 1/m, at `frequency` (Hz) of a record; NaN where there is no ridge.

    `velocity` (m/s) of the long waves bounds the search: 0.6 to 2.5 times its wave number. `part`
    (nc,) bool leaves out particles of the chain. A maximum on the bound is none.
    """
    depth = (record.chain_position - record.chain_position.min()) / length
    used = (depth >= STRETCH[0]) & (depth <= STRETCH[1])
    if part is not None:
        used &= part
    if used.sum() < 8 or not np.isfinite(frequency) or frequency <= 0:
        return np.nan
    z, u = record.chain_position[used], record.chain_displacement[:, used]
    # The wave exp(i kappa z - i omega t) counts as forward.
    field = np.exp(2j * np.pi * frequency * record.time) @ u
    # Particles swing unequally; the phase alone says how far the wave has come.
    field = field / np.maximum(abs(field), np.finfo(float).tiny)
    slowest = 2 * np.pi * frequency / velocity
    kappa = np.linspace(0.6, 2.5, POINTS) * slowest
    height = abs(field @ np.exp(-1j * np.outer(z - z[0], kappa)))
    top = int(np.argmax(height))
    if top in (0, POINTS - 1):
        return np.nan
    return float(kappa[top] + summit(*height[top - 1 : top + 2]) * (kappa[1] - kappa[0]))


def far_end(count: int) -> Floats:
    """Shape (count,): 1, and a squared cosine over the last fifth, for what begins at rest."""
    fall = np.cos(np.linspace(-4, 1, count) * np.pi / 2) ** 2
    return np.where(np.arange(count) < (1 - FADED) * count, 1, fall)


def frequency_wavenumber(
    motion: Floats, time: Floats, position: Floats
) -> tuple[Array, Array, Complex]:
    """Frequencies (nf,) Hz, wave numbers (nk,) rad/m, complex U (nf, nk) of motion (nt, nl).

    Wave numbers ascend; those of waves towards higher z are positive. Positions ascend, equally
    spaced to half of their distance: InputError where they are not.
    """
    spacing = np.diff(position)
    if len(spacing) == 0 or abs(spacing - spacing.mean()).max() > UNEVEN * abs(spacing.mean()):
        raise UnavailableError(
            "layers are too unequally spaced for a spectrum in space", code="uneven_chain"
        )
    nt, nl = (PADDING * count for count in motion.shape)
    taper = far_end(len(time))[:, None] * far_end(len(position))
    spectrum = np.fft.rfft(motion * taper, nt, axis=0)
    spectrum = np.fft.fft(spectrum.conj(), nl, axis=1)
    frequency = np.fft.rfftfreq(nt, float(np.mean(np.diff(time))))
    wavenumber = 2 * np.pi * np.fft.fftfreq(nl, float(spacing.mean()))
    order = np.argsort(wavenumber)
    return frequency, wavenumber[order], spectrum[:, order]
