"""Choose the default pulse, recording interval and duration of a wave, scaled to the packing.

Lengths are in mean diameters D and overlaps; times are in D / V of the affine P-wave, the fastest
of all waves. A packing of spheres a thousand times smaller, or of springs a million times softer,
thus gets a wave that is smaller or slower by the same factor. In the crystal of glass spheres of
2.54 mm under 100 kPa the pulse has an amplitude of 2.5 nm and a frequency of 100 kHz, as in Otsubo
et al. (2017), and is recorded every microsecond.
"""

import numpy as np

from modal.packing.network import Network
from modal.packing.state import affine_velocity
from modal.system.linear_system import LinearSystem
from modal.waves.motions import Motion, Pulse
from modal.waves.signals import TORSION, Direction
from modal.waves.sources import Source

PULSE_FREQUENCY_IN_V_PER_D = 0.33
"""Frequency of the pulse, in V / D: 100 kHz in the study's crystal under 100 kPa. A crystal's band
ends at 0.45, a random packing's much lower."""
PULSE_AMPLITUDE_IN_D = 1e-6
"""Amplitude of the pulse, in mean diameters: 2.5 nm in the study."""
PULSE_AMPLITUDE_IN_OVERLAPS = 0.01
"""Largest amplitude of the pulse in mean overlaps: so small a motion leaves contacts closed, also
in packings under low stress."""
INTERVAL_IN_D_PER_V = 0.3
"""Time between records, in D / V: 1 us in the study's crystal, ten records per period of the pulse,
and two per period at 1.7 V / D, above all modes."""
DURATION_IN_PASSAGES = 1.5
"""Length of the record, in passages of the affine P-wave from end to end, besides the time in which
the source moves. Slower waves, down to 0.7 of its velocity, arrive as well."""
SHEAR_OVER_P_VELOCITY = 0.5
"""Lowest ratio of velocities for which the record of an S-wave is long enough."""
V_PER_D_IN_HIGHEST_FREQUENCIES = 1.4
"""V / D divided by the highest mode's frequency, in crystals and random packings. It replaces V if
no contact carries a P-wave along z."""


def mean_diameter(network: Network) -> float:
    """Return the mean diameter, m."""
    return 2 * float(network.radius.mean())


def p_velocity(network: Network) -> float:
    """Return the affine P-wave velocity, m/s.

    If it is zero, estimate a velocity from the frequency of the highest mode.
    """
    velocity = affine_velocity(network)
    if velocity > 0:
        return velocity
    highest_frequency = LinearSystem.of(network).highest_frequency
    return V_PER_D_IN_HIGHEST_FREQUENCIES * highest_frequency * mean_diameter(network)


def default_pulse(
    network: Network,
    source: Source,
    direction: Direction = "z",
    *,
    amplitude: float | None = None,
    frequency: float | None = None,
    cycles: int = 1,
) -> Pulse:
    """Return the default pulse of a packing; `amplitude` and `frequency`, Hz, override defaults.

    The amplitude is in m, for a source of force in N; in torsion it is in rad or N m.
    """
    if amplitude is None:
        amplitude = default_amplitude(network, source, direction)
    if frequency is None:
        frequency = default_frequency(network)
    return Pulse(amplitude, frequency, cycles)


def default_frequency(network: Network) -> float:
    """Return the frequency of the default pulse, Hz; 1 Hz for a packing without stiffness."""
    frequency = PULSE_FREQUENCY_IN_V_PER_D * p_velocity(network) / mean_diameter(network)
    if not frequency > 0:
        return 1.0
    return frequency


def default_amplitude(network: Network, source: Source, direction: Direction = "z") -> float:
    """Return the amplitude of the default pulse, m; in N for a force, in rad or N m in torsion."""
    diameter = mean_diameter(network)
    amplitude = PULSE_AMPLITUDE_IN_D * diameter
    if network.overlap is not None and (network.overlap > 0).any():
        mean_overlap = float(network.overlap[network.overlap > 0].mean())
        amplitude = min(amplitude, PULSE_AMPLITUDE_IN_OVERLAPS * mean_overlap)
    if source.pushes:
        amplitude *= _mean_stiffness(network)
    if direction == TORSION and source.pushes:
        return amplitude * diameter / 2
    if direction == TORSION:
        width = float(np.ptp(network.position[:, :2], axis=0).max()) + diameter
        return amplitude / (width / 2)
    return amplitude


def default_interval(network: Network, duration: float, time_step: float | None = None) -> float:
    """Return the default time between two records, s, at most the `duration`, s.

    It is a whole number of time steps if `time_step`, s, is given.
    """
    velocity = p_velocity(network)
    if not velocity > 0:
        return duration
    interval = min(INTERVAL_IN_D_PER_V * mean_diameter(network) / velocity, duration)
    if time_step is None or not time_step > 0:
        return interval
    return max(1, round(interval / time_step)) * time_step


def default_duration(network: Network, motion: Motion, direction: Direction = "z") -> float:
    """Return the default length of the record, s.

    This is the duration of the source's motion plus the travel time of the wave through the
    packing.
    """
    velocity = p_velocity(network)
    if direction != "z":
        velocity *= SHEAR_OVER_P_VELOCITY
    moving = float(motion.corners[-1])
    if not velocity > 0:
        return moving
    return moving + DURATION_IN_PASSAGES * travel_height(network) / velocity


def travel_height(network: Network) -> float:
    """Return the length of a wave's path along z, m: a period, or the height of the spheres."""
    if network.cell_periodic[2]:
        return network.length
    return float(np.ptp(network.position[:, 2])) + mean_diameter(network)


def _mean_stiffness(network: Network) -> float:
    """Return the mean normal stiffness of contacts, N/m; 1 N/m if there is no stiffness."""
    if network.n_contacts == 0:
        return 1.0
    return float(network.stiffness_normal.mean()) or 1.0
