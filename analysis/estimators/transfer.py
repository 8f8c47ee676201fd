"""From one wall to the other: the gain factor (Fig. 19), and velocities by the cross spectrum.

The gain is the spectrum of the stress at the receiver wall over that at the source wall.

Its resolution is stated: gamma / pi, the full width of a resonance at half its power under a window
exp(-gamma t).

The height of a maximum is that window's. Between rigid walls L apart the gain is 1 / |cos(q L)|,
and under the window Im q = gamma / V even without any damping: 1 / sinh(gamma L / V) on a maximum.
So no height stands alone; beside it stand the resolution and what an undamped column has under it.
"""

from typing import Any

import numpy as np

from modal.packing.network import Network
from modal.tools.arrays import Array, Floats
from modal.waves.signals import Signals

RESOLUTION = 0.376
"""In f_1 = V / 2 L: maxima lie f_1 apart."""
REACH = 0.5
"""Highest frequency of the gain of a network, V / D; what a crystal passes ends at 0.45."""
PADDING = 8
"""Of the cross spectrum, in lengths of the record."""
FAINTEST = 2e-3
"""Least receiver stress over source stress of a received wave; a loose packing passes 0.7 %."""
QUIET = 0.5
"""Most of the receiver's peak that it may hear in half of the time until then."""


def gain_settings(network: Network, passage: float) -> dict[str, Any]:
    """Resolution and highest frequency, Hz, of a gain; `passage` (s) from wall to wall."""
    diameters = network.length / (2 * float(network.radius.mean()))
    return {"resolution": RESOLUTION * 0.5 / passage, "highest": REACH * diameters / passage}


def cross_spectrum(
    first: Floats, second: Floats, time: Floats, distance: float
) -> tuple[Array, Array, Array]:
    """Phase and group velocity between two signals (nt,) that are `distance` (m) apart.

    Returns frequency (k,) Hz, phase velocity omega / kappa (k,) m/s, and group velocity d omega /
    d kappa (k,) m/s.
    """
    step = float(np.mean(np.diff(time)))
    n = PADDING * len(time)
    cross = np.fft.rfft(first, n) * np.fft.rfft(second, n).conj()
    frequency = np.fft.rfftfreq(n, step)
    phase = np.unwrap(np.angle(cross))
    amplitude = np.abs(cross) / max(np.abs(cross).max(), np.finfo(float).tiny)
    strong = np.flatnonzero(amplitude > 0.1)
    strong = strong[: max(2, len(strong) // 4)]  # long waves: the phase tends to zero with f
    if len(strong) > 1:
        intercept = np.polyfit(frequency[strong], phase[strong], 1)[1]
        phase -= 2 * np.pi * np.round(intercept / (2 * np.pi))
    with np.errstate(divide="ignore", invalid="ignore"):
        velocity = 2 * np.pi * frequency * distance / phase
        group = 2 * np.pi * distance / np.gradient(phase, frequency)
    return frequency, velocity, group


def wall_velocity(signals: Signals, length: float) -> tuple[Array, ...] | None:
    """`cross_spectrum` of the wall stresses over the sample length; None if not yet received.

    The record for dispersion ends about when the wave reaches the receiver; the phase is then
    meaningless, so the receiver's peak must lie well inside the record. None, too, where the source
    does not move in the record, or the receiver hears as much before a wave can have come.
    """
    received = np.abs(signals.receiver_stress)
    if received.max() < FAINTEST * np.abs(signals.source_stress).max():
        return None
    peak = int(np.argmax(received))
    if peak > 0.9 * len(received) or not np.ptp(signals.source_displacement) > 0:
        return None
    if received[: peak // 2].max(initial=0.0) > QUIET * received[peak]:
        return None
    return cross_spectrum(signals.source_stress, signals.receiver_stress, signals.time, length)
