"""Find when a wave reaches each particle of a chain, and the velocity from these times."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from analysis.estimators.fits import straight_line, summit
from analysis.estimators.low_pass import columns_of
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.tools.arrays import Floats
from modal.waves.signals import Signals

FITTED_STRETCH = (0.25, 0.75)
"""Part of the length over which times are fitted, away from both walls: layers 50 to 149 of 200, as
in Fig. 5."""
MIN_TIMES = 5
"""Fewest times to which a line is fitted."""
MIN_PARTICLES_OF_COLUMN = 10
"""Fewest particles with a known time for which a column is used."""
MIN_MOTION_RATIO = 1e-3
"""Largest displacement of a particle, relative to the largest of the chain, up to which the wave
has not reached the particle."""
MAX_RELATIVE_ERROR = 0.2
"""Largest standard error of a velocity, divided by the velocity. Times that scatter more do not
come from a wave that travels from the source."""
MIN_DISTANCE_IN_DIAMETERS = 3.0
"""Least distance of a layer from a source inside of the packing, whose near field ends there."""
ARRIVAL_LEVEL = 0.05
"""Displacement, relative to a particle's largest, at which the wave arrives at the particle."""
WALL_MOVES_LEVEL = 0.1
"""Displacement of the wall, relative to its largest, at which its first direction is read."""


def _orient_forward(signals: Signals) -> np.ndarray:
    """Return the displacements (nt, nc), m, with a positive sign along the wall's first motion.

    Particles that the wave has not reached have NaN.
    """
    wall = signals.source_displacement
    backward = signals.amplitude < 0
    if wall.any():
        first = np.argmax(abs(wall) > WALL_MOVES_LEVEL * abs(wall).max())
        backward = wall[first] < 0
    displacement = signals.chain_displacement
    if backward:
        displacement = -displacement
    reached = displacement.max(axis=0) > MIN_MOTION_RATIO * displacement.max()
    return np.where(reached, displacement, np.nan)


def first_peak_times(signals: Signals) -> np.ndarray:
    """Return the time (nc,), s, of each chain particle's first peak.

    A peak has the direction of the wall's first motion and more than half of the particle's largest
    displacement. The time is the vertex of a parabola through three samples; NaN without a peak.
    """
    u = _orient_forward(signals)
    high = u[1:-1] > 0.5 * u.max(axis=0)
    is_peak = (u[1:-1] > u[:-2]) & (u[1:-1] >= u[2:]) & high
    particle = np.flatnonzero(is_peak.any(axis=0))
    sample = np.argmax(is_peak[:, particle], axis=0) + 1
    shift = summit(u[sample - 1, particle], u[sample, particle], u[sample + 1, particle])
    step = signals.time[1] - signals.time[0]
    times = np.full(u.shape[1], np.nan)
    times[particle] = signals.time[sample] + step * shift
    return times


def arrival_times(signals: Signals) -> np.ndarray:
    """Return the time (nc,), s, at which each particle first exceeds `ARRIVAL_LEVEL`.

    The level is relative to the particle's largest displacement along the wall's first motion;
    times are interpolated. NaN if the record begins above the level, or if its last sample is the
    largest.
    """
    u = _orient_forward(signals)
    level = ARRIVAL_LEVEL * u.max(axis=0)
    first_above = np.argmax(u > level, axis=0)
    ends_below_maximum = np.argmax(u, axis=0) < len(u) - 1
    particle = np.flatnonzero((first_above > 0) & ends_below_maximum)
    after = first_above[particle]
    before = after - 1
    rise = u[after, particle] - u[before, particle]
    share = (level[particle] - u[before, particle]) / rise
    interval = signals.time[after] - signals.time[before]
    times = np.full(u.shape[1], np.nan)
    times[particle] = signals.time[before] + share * interval
    return times


def travel_velocity(distance: np.ndarray, times: np.ndarray) -> tuple[float, float]:
    """Fit a line to `times` (nc,), s, at `distance` (nc,), m; return velocity and error, m/s.

    Both are NaN if fewer than `MIN_TIMES` times are known, or if times do not rise with distance by
    more than their scatter, for example without a wave from the source.
    """
    if np.isfinite(times).sum() < MIN_TIMES:
        return np.nan, np.nan
    line = straight_line(distance, times)
    if not line.error < MAX_RELATIVE_ERROR * line.slope:
        return np.nan, np.nan
    return float(1 / line.slope), float(line.error / line.slope**2)


def travelled(
    record: Signals, walls: Floats, times: Callable[[Signals], np.ndarray] = first_peak_times
) -> tuple[float, float]:
    """Return the velocity along the middle half of the chain and its standard error, m/s.

    This is the rule of Fig. 5. `walls` are the z, m, of the source wall and the receiver wall;
    `times` returns the time of each particle: `first_peak_times` or `arrival_times`.
    """
    distance = record.chain_position - walls[0]
    inside = _in_fitted_stretch(distance, walls[1] - walls[0])
    return travel_velocity(distance[inside], times(record)[inside])


def _in_fitted_stretch(distance: np.ndarray, length: float) -> np.ndarray:
    """Return which distances (n,), m, from the source wall lie in the part `FITTED_STRETCH`."""
    low, high = FITTED_STRETCH
    return (distance > low * length) & (distance < high * length)


def layers_above(record: Signals, network: Network) -> tuple[float, float]:
    """Return the velocity of first peaks in layers above a source of any kind, and its error, m/s.

    The layers from `MIN_DISTANCE_IN_DIAMETERS` to three quarters of the distance to the end of the
    packing are used; with a period along z, to three quarters of half the period. Both numbers are
    NaN if the record has no layers.
    """
    if record.layer_displacement is None or record.layer_position is None:
        return np.nan, np.nan
    bottom, top = network.wall_position
    source = bottom
    if record.source_height is not None:
        source = float(record.source_height[0])
    distance = record.layer_position - source
    way = top - source
    if network.cell_periodic[2]:
        distance = distance % network.length
        way = network.length / 2
    nearest = MIN_DISTANCE_IN_DIAMETERS * 2 * float(network.radius.mean())
    counts = (distance > nearest) & (distance < FITTED_STRETCH[1] * way)
    if not counts.any():
        return np.nan, np.nan
    layers = replace(record, chain_displacement=record.layer_displacement[:, counts])
    return travel_velocity(distance[counts], first_peak_times(layers))


def first_peaks_of_columns(record: Signals, network: Network) -> tuple[float, float]:
    """Return the mean velocity of first peaks over columns a sphere wide, and its scatter, m/s.

    The scatter shows how much the velocity depends on the choice of the chain. Both are NaN if the
    record has no single particles, the scatter also if only one column counts.
    """
    if record.particle_displacement is None:
        return np.nan, np.nan
    particles = np.flatnonzero(force_bearing(network))
    distance = network.position[particles, 2] - network.wall_position[0]
    inside = _in_fitted_stretch(distance, network.length)
    particles = particles[inside]
    distance = distance[inside]
    displacement = record.particle_displacement[:, particles]
    times = first_peak_times(replace(record, chain_displacement=displacement))
    velocities = []
    for column in columns_of(network, particles):
        members = column[np.isfinite(times[column])]
        if len(members) >= MIN_PARTICLES_OF_COLUMN:
            velocities.append(travel_velocity(distance[members], times[members])[0])
    if not velocities:
        return np.nan, np.nan
    scatter = np.nan
    if len(velocities) > 1:
        scatter = float(np.std(velocities, ddof=1))
    return float(np.mean(velocities)), scatter
