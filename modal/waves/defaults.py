"""What a wave is sent and recorded with where nothing else is asked for, in units of the packing.

Lengths are in diameters D and overlaps, times in D / V of the affine P-wave, which no other wave
outruns. A packing of spheres a thousand times smaller, or of springs a million times softer, is
thus asked the same question. In the crystal of glass spheres of 2.54 mm under 100 kPa the pulse has
2.5 nm and 100 kHz, as in Otsubo et al. (2017), and is recorded every microsecond.
"""

import numpy as np

from modal.packing.network import Network
from modal.packing.state import affine_velocity
from modal.system.linear_system import LinearSystem
from modal.waves.motions import Motion, Pulse
from modal.waves.signals import TORSION
from modal.waves.sources import Source

PULSE_FREQUENCY_IN_V_PER_D = 0.33
"""100 kHz in the study's crystal under 100 kPa. A crystal's band ends at 0.45, a random packing's
long before."""
PULSE_AMPLITUDE_IN_D = 1e-6
"""2.5 nm in the study."""
PULSE_AMPLITUDE_IN_OVERLAPS = 0.01
"""At most: so small a motion leaves contacts closed, also of a packing under little stress."""
INTERVAL_IN_D_PER_V = 0.3
"""Between records: 1 us in that crystal, ten a period of the pulse, two a period at 1.7 V / D,
above all modes."""
DURATION_IN_PASSAGES = 1.5
"""Of the affine P-wave from end to end. Slower waves, down to 0.7 of its velocity, arrive as well.
The record is longer by the time in which the source moves."""
SHEAR_OVER_P_VELOCITY = 0.5
"""Least ratio for which the record of an S-wave, which is longer by it, is long enough."""
V_PER_D_IN_HIGHEST_FREQUENCIES = 1.4
"""Of crystals and random packings; it stands in where no contact carries a P-wave along z."""


def diameter_of(network: Network) -> float:
    """Return the mean diameter, m."""
    return 2 * float(network.radius.mean())


def velocity_of(network: Network) -> float:
    """Return the affine P-wave velocity, m/s, or its like by the highest mode where it is zero."""
    velocity = affine_velocity(network)
    if velocity > 0:
        return velocity
    highest_frequency = LinearSystem.of(network).highest_frequency
    return V_PER_D_IN_HIGHEST_FREQUENCIES * highest_frequency * diameter_of(network)


def default_pulse(
    network: Network,
    source: Source,
    direction: str = "z",
    *,
    amplitude: float | None = None,
    frequency: float | None = None,
    cycles: int = 1,
) -> Pulse:
    """Return the pulse of a packing, with the amplitude or the frequency, Hz, that is given.

    The amplitude is in m; in N of a source that pushes; in rad, or N m, of one that turns.
    """
    if amplitude is None:
        amplitude = default_amplitude(network, source, direction)
    if frequency is None:
        frequency = default_frequency(network)
    return Pulse(amplitude, frequency, cycles)


def default_frequency(network: Network) -> float:
    """Return the frequency of the pulse, Hz; that of a packing without stiffness is 1 Hz."""
    frequency = PULSE_FREQUENCY_IN_V_PER_D * velocity_of(network) / diameter_of(network)
    return frequency if frequency > 0 else 1.0


def default_amplitude(network: Network, source: Source, direction: str = "z") -> float:
    """Return the amplitude of the pulse: m, N of a push, rad of a turn, N m of a torque."""
    diameter = diameter_of(network)
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
    """Return the time between two records, s, of a record of this `duration`, s.

    A whole number of time steps, s, where these are given.
    """
    velocity = velocity_of(network)
    if not velocity > 0:
        return duration
    interval = min(INTERVAL_IN_D_PER_V * diameter_of(network) / velocity, duration)
    if time_step is None or not time_step > 0:
        return interval
    return max(1, round(interval / time_step)) * time_step


def default_duration(network: Network, motion: Motion, direction: str = "z") -> float:
    """Return the length of the record, s: the source's motion, then the way through the packing."""
    velocity = velocity_of(network)
    if direction != "z":
        velocity *= SHEAR_OVER_P_VELOCITY
    moving = float(motion.corners[-1])
    if not velocity > 0:
        return moving
    return moving + DURATION_IN_PASSAGES * height_of(network) / velocity


def height_of(network: Network) -> float:
    """Return how far a wave goes along z, m: a period, or from the lowest sphere to the highest."""
    if network.cell_periodic[2]:
        return network.length
    return float(np.ptp(network.position[:, 2])) + diameter_of(network)


def _mean_stiffness(network: Network) -> float:
    """Return the mean normal stiffness of contacts, N/m; 1 N/m without any stiffness."""
    if network.n_contacts == 0:
        return 1.0
    return float(network.stiffness_normal.mean()) or 1.0
