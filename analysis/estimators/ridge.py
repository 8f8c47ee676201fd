"""Frequency of the wave of each wave number, and the wavelength at the band edge, from a record.

The sum over the chain of u exp(-i kappa z) turns at the frequency of the wave number kappa. It is
read after the source wall has come to rest and before the far end has turned the waves. No law of
the lattice enters: a wave that leaves the source has a positive group velocity, hence turns forward
up to the wave number of the highest frequency; beyond it the same energy is seen to turn backward.
There the band ends, and its wavelength is whatever the record has: 2 l only where neighbours alone
act on each other.
"""

from dataclasses import dataclass

import numpy as np

from analysis.estimators.damped_transform import layer_distance
from analysis.estimators.fits import summit
from analysis.estimators.source_motion import at_rest
from modal.waves.signals import Signals

POINTS = 260
"""Wave numbers, to `REACH` times that of two particles a wavelength."""
REACH = 1.3
PADDING = 4
AROUND = 0.25
"""Part of the edge's wave number, to both sides, whose points decide where the highest is."""
SURE = 0.9
"""Least agreement of the senses of turning: 1 where all below turn forward and all above back."""
REFUSED, ROUGH = 4.0, 3e-3
"""Distance from the curve, in median ones, of a point that is none of the ridge; and the median
one, relative, from which on the points are no curve."""
LEAST = 12
"""Points that a curve of the fourth order is trusted with."""
PASSAGES = 1.3
"""Length of the record that is used, in passages along the chain: the far end turns waves back."""


@dataclass(frozen=True)
class Ridge:
    """wavenumber (n,) 1/m; frequency (n,) Hz, positive where the wave turns forward.

    edge_wavenumber (1/m) and edge_frequency (Hz): where the band ends; NaN where it is not seen.
    """

    wavenumber: np.ndarray
    frequency: np.ndarray
    edge_wavenumber: float
    edge_frequency: float

    @property
    def edge_wavelength(self) -> float:
        """Wavelength at the band edge, m: the shortest that leaves the source."""
        return 2 * np.pi / self.edge_wavenumber

    def wavelength(self, frequency: float) -> float:
        """Wavelength, m, at a frequency, Hz; NaN beyond the band edge, where no wave travels."""
        inside = (self.wavenumber < self.edge_wavenumber) & (self.frequency > 0)
        f = np.append(self.frequency[inside], self.edge_frequency)
        kappa = np.append(self.wavenumber[inside], self.edge_wavenumber)
        if not f[0] <= frequency <= self.edge_frequency:
            return np.nan
        return float(2 * np.pi / np.interp(frequency, np.maximum.accumulate(f), kappa))


def ridge(signals: Signals) -> Ridge:
    """The ridge of a chain of equal distances, e.g. of one particle a layer of a crystal.

    Waves above the pulse's spectrum, which ends at twice its frequency, are not looked for.
    """
    highest = REACH * np.pi / layer_distance(signals)
    kappa = np.linspace(highest / POINTS, highest, POINTS)
    start = at_rest(signals) - float(signals.time[0])
    whole = _frequencies(signals, kappa, start, np.inf)
    long = slice(POINTS // 50, POINTS // 10)
    velocity = 2 * np.pi * float(np.median(abs(whole[long]) / kappa[long]))
    if not velocity > 0:  # nothing turns: no wave is in the record
        return Ridge(kappa, np.full(POINTS, np.nan), np.nan, np.nan)
    span = float(np.ptp(signals.chain_position))
    cut = _frequencies(signals, kappa, start, start + PASSAGES * span / velocity)
    frequency = cut if np.isfinite(cut).all() else whole
    return Ridge(kappa, frequency, *_edge(kappa, frequency))


def _frequencies(signals: Signals, kappa: np.ndarray, start: float, end: float) -> np.ndarray:
    """Shape (n,), Hz, of wave numbers (n,) between two times, s; NaN if there are too few."""
    time = signals.time - signals.time[0]
    used = (time >= start) & (time <= end)
    count = int(used.sum())
    if count < 16:
        return np.full(len(kappa), np.nan)
    z = signals.chain_position - signals.chain_position[0]
    window = np.hanning(count + 2)[1:-1]
    # Conjugate: the wave exp(i kappa z - i omega t) counts as forward.
    turning = (signals.chain_displacement[used] @ np.exp(-1j * np.outer(z, kappa))).conj()
    length = PADDING * count
    spectrum = abs(np.fft.fft(window[:, None] * turning, length, axis=0))
    f = np.fft.fftfreq(length, time[1] - time[0])
    spectrum[abs(f) > 2 * signals.input_frequency] = 0
    power = np.log(spectrum + np.finfo(float).tiny)
    top, column = np.argmax(power, axis=0), np.arange(len(kappa))
    before, peak, behind = (power[(top + d) % length, column] for d in (-1, 0, 1))
    shift = 0.5 * (before - behind) / np.minimum(before - 2 * peak + behind, -1e-12)
    return f[top] + f[1] * np.clip(shift, -0.5, 0.5)


def _edge(kappa: np.ndarray, frequency: np.ndarray) -> tuple[float, float]:
    """Wave number and frequency of the highest point where the sense of turning changes."""
    sense = np.append(0, np.cumsum(np.sign(frequency)))
    count = np.arange(POINTS + 1)
    low, high = (np.round((1 + side) * count).astype(int) for side in (-AROUND, AROUND))
    fits = (high <= POINTS) & (count - low >= 4)
    agreement = np.full(POINTS + 1, -1.0)
    k, low, high = count[fits], low[fits], high[fits]
    agreement[fits] = (2 * sense[k] - sense[low] - sense[high]) / (high - low)
    if agreement.max() < SURE:
        return np.nan, np.nan
    first = int(np.argmax(agreement >= SURE))
    middle = first + int(np.argmax(agreement[first : int((1 + AROUND) * first)]))
    near = slice(*np.round(middle * np.array([1 - AROUND, 1 + AROUND])).astype(int))
    x, f = kappa[near] / kappa[middle - 1] - 1, abs(frequency[near])
    kept = abs(f / np.median(f) - 1) < AROUND
    for _ in range(4):
        if kept.sum() < LEAST:
            return np.nan, np.nan
        curve = np.polyfit(x[kept], f[kept], 4)
        off = abs(np.polyval(curve, x) - f) / np.median(f)
        middling = float(np.median(off[kept]))
        kept = off <= REFUSED * middling + 1e-9
    fine = np.linspace(x[0], x[-1], 2001)
    values = np.polyval(curve, fine)
    at = int(np.argmax(values))
    if at in (0, len(fine) - 1) or middling > ROUGH:
        return np.nan, np.nan
    # Between the points of the grid, which round-off else chooses among.
    shift = summit(*values[at - 1 : at + 2]) * (fine[1] - fine[0])
    return float(kappa[middle - 1] * (1 + fine[at] + shift)), float(values[at])
