"""When a wave comes: first peaks and arrivals along a chain, and the velocity of their times."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from analysis.estimators.fits import straight_line, summit
from analysis.estimators.low_pass import columns_of
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.tools.arrays import Floats
from modal.waves.signals import Signals

MIDDLE = 0.25, 0.75
"""Part of the length over which times are fitted: off both walls, layers 50 to 149 of 200."""
LEAST = 5
"""Times that a fit needs."""
FAINT = 1e-3
"""Part of the chain's largest motion below which a particle has not been reached."""
SURE = 0.2
"""Largest standard error of a velocity, relative: times beyond it are of no wave that passes."""
LEVEL = 0.05
"""Of a particle's largest motion, at which it counts as reached."""


def outward(signals: Signals) -> np.ndarray:
    """Shape (nt, nc), m: displacements, turned round where the wall goes backward.

    NaN of particles that the wave has not reached.
    """
    wall = signals.source_displacement
    first = np.argmax(abs(wall) > 0.1 * abs(wall).max())
    back = wall[first] < 0 if wall.any() else signals.amplitude < 0
    u = -signals.chain_displacement if back else signals.chain_displacement
    reached = u.max(axis=0) > FAINT * u.max()
    return np.where(reached, u, np.nan)


def first_peak_times(signals: Signals) -> np.ndarray:
    """Time (nc,) s of each chain particle's first peak, by a parabola through three samples.

    A peak is one of the wall's own direction, and counts when it exceeds half the particle's
    maximum; NaN if the record ends before.
    """
    u, times = outward(signals), np.full(signals.chain_displacement.shape[1], np.nan)
    top = (u[1:-1] > u[:-2]) & (u[1:-1] >= u[2:]) & (u[1:-1] > 0.5 * u.max(axis=0))
    n = np.flatnonzero(top.any(axis=0))
    k = np.argmax(top[:, n], axis=0) + 1
    step = signals.time[1] - signals.time[0]
    times[n] = signals.time[k] + step * summit(u[k - 1, n], u[k, n], u[k + 1, n])
    return times


def arrival_times(signals: Signals) -> np.ndarray:
    """Time (nc,) s at which each particle first exceeds `LEVEL` of its maximum, interpolated.

    The maximum is that in the wall's own direction; NaN where it is not passed in the record.
    """
    u, times = outward(signals), np.full(signals.chain_displacement.shape[1], np.nan)
    level, k = LEVEL * u.max(axis=0), np.argmax(u > LEVEL * u.max(axis=0), axis=0)
    n = np.flatnonzero((k > 0) & (np.argmax(u, axis=0) < len(u) - 1))
    before, behind = u[k[n] - 1, n], u[k[n], n]
    first, last = signals.time[k[n] - 1], signals.time[k[n]]
    times[n] = first + (level[n] - before) / (behind - before) * (last - first)
    return times


def travel_velocity(distance: np.ndarray, times: np.ndarray) -> tuple[float, float]:
    """dL/dt, m/s, of `times` (nc,) s at `distance` (nc,) m, and the standard error of its fit.

    NaN where fewer than `LEAST` times are known, and where they do not rise with the distance by
    more than their scatter: then no wave goes from the source on.
    """
    if np.isfinite(times).sum() < LEAST:
        return np.nan, np.nan
    line = straight_line(distance, times)
    if not line.error < SURE * line.slope:
        return np.nan, np.nan
    return float(1 / line.slope), float(line.error / line.slope**2)


def travelled(
    record: Signals, walls: Floats, times: Callable[[Signals], np.ndarray] = first_peak_times
) -> tuple[float, float]:
    """dL/dt, m/s, of first peaks or arrivals along the chain's middle half, its standard error.

    The rule of Fig. 5. `walls` are the z, m, of the source's wall and of the receiver's.
    """
    distance = record.chain_position - walls[0]
    inside = _middle(distance, walls[1] - walls[0])
    return travel_velocity(distance[inside], times(record)[inside])


def _middle(distance: np.ndarray, length: float) -> np.ndarray:
    return (distance > MIDDLE[0] * length) & (distance < MIDDLE[1] * length)


def first_peaks_of_columns(record: Signals, network: Network) -> tuple[float, float]:
    """dL/dt, m/s, of first peaks along every column of the packing, a sphere wide: mean, scatter.

    The scatter says how much the velocity depends on which chain is taken. NaN where single
    particles are not recorded.
    """
    if record.particle_displacement is None:
        return np.nan, np.nan
    bearing = np.flatnonzero(force_bearing(network))
    distance = network.position[bearing, 2] - network.wall_position[0]
    inside = _middle(distance, network.length)
    bearing, distance = bearing[inside], distance[inside]
    moved = record.particle_displacement[:, bearing]
    times = first_peak_times(replace(record, chain_displacement=moved))
    members = [own[np.isfinite(times[own])] for own in columns_of(network, bearing)]
    speeds = [travel_velocity(distance[m], times[m])[0] for m in members if len(m) > 9]
    scatter = float(np.std(speeds, ddof=1)) if len(speeds) > 1 else np.nan
    return (float(np.mean(speeds)), scatter) if speeds else (np.nan, np.nan)
