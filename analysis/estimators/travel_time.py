"""Velocities of the P-wave: from travel times, from phases of two signals, and from modes."""

from __future__ import annotations

import numpy as np

from modal.waves.signals import Signals

FAINTEST = 2e-3
"""Least receiver stress over source stress of a received wave; a loose packing passes 0.7 %."""


def first_peak_times(signals: Signals) -> np.ndarray:
    """Time (nc,) s of each chain particle's first peak, by a parabola through three samples.

    A peak counts when it exceeds half the particle's maximum; NaN if the record ends before.
    """
    times = np.full(signals.chain_displacement.shape[1], np.nan)
    step = signals.time[1] - signals.time[0]
    for n, u in enumerate(signals.chain_displacement.T):
        top = (u[1:-1] > u[:-2]) & (u[1:-1] >= u[2:]) & (u[1:-1] > 0.5 * u.max())
        if top.any():
            k = int(np.argmax(top)) + 1
            curvature = u[k - 1] - 2 * u[k] + u[k + 1]
            times[n] = signals.time[k] + step * (u[k - 1] - u[k + 1]) / (2 * curvature)
    return times


def arrival_times(signals: Signals, level: float = 0.05) -> np.ndarray:
    """Time (nc,) s at which each particle first exceeds `level` of its maximum, interpolated."""
    times = np.full(signals.chain_displacement.shape[1], np.nan)
    for n, u in enumerate(signals.chain_displacement.T):
        above = u > level * u.max()
        k = int(np.argmax(above))
        if above.any() and k > 0:
            part = (level * u.max() - u[k - 1]) / (u[k] - u[k - 1])
            times[n] = signals.time[k - 1] + part * (signals.time[k] - signals.time[k - 1])
    return times


def travel_velocity(
    signals: Signals, times: np.ndarray, layers: tuple[int, int] = (50, 150)
) -> float:
    """dL/dt, m/s: slope of position against `times` (nc,) over the given layers; NaN if none."""
    part = slice(layers[0], layers[1] + 1)
    z, t = signals.chain_position[part], times[part]
    known = np.isfinite(t)
    if known.sum() < 2:
        return np.nan
    return float(1 / np.polyfit(z[known] - z[0], t[known], 1)[0])


def cross_spectrum(
    first: np.ndarray, second: np.ndarray, time: np.ndarray, distance: float, padding: int = 8
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Phase and group velocity between two signals (nt,) that are `distance` (m) apart.

    Returns frequency (k,) Hz, phase velocity omega / kappa (k,) m/s, group velocity d omega /
    d kappa (k,) m/s, and the relative amplitude of the cross spectrum (k,).
    """
    step = float(np.mean(np.diff(time)))
    n = padding * len(time)
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
    return frequency, velocity, group, amplitude


def at_frequency(frequency: np.ndarray, velocity: np.ndarray, wanted: float) -> float:
    """Velocity at one frequency, by linear interpolation; NaN outside."""
    known = np.isfinite(velocity)
    if known.sum() < 2:
        return np.nan
    f, v = frequency[known], velocity[known]
    return float(np.interp(wanted, f, v, left=np.nan, right=np.nan))


def wall_velocity(signals: Signals, length: float) -> tuple[np.ndarray, ...] | None:
    """`cross_spectrum` of the wall stresses over the sample length; None if not yet received.

    The record for dispersion ends about when the wave reaches the receiver; the phase is then
    meaningless, so the receiver's peak must lie well inside the record.
    """
    received = np.abs(signals.receiver_stress)
    if received.max() < FAINTEST * np.abs(signals.source_stress).max():
        return None
    if np.argmax(received) > 0.9 * len(received):
        return None
    return cross_spectrum(signals.source_stress, signals.receiver_stress, signals.time, length)


def mode_velocities(frequency: np.ndarray, wavenumber: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Phase and group velocity (k,) m/s of resonances: frequency (k,) Hz, kappa (k,) rad/m."""
    omega = 2 * np.pi * np.asarray(frequency)
    return omega / wavenumber, np.gradient(omega, wavenumber)
