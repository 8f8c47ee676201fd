"""Units of time of a packing under pressure: inertial time, fastest vibration, time step.

The inertial time, D sqrt(density / pressure), is the time scale of spheres that move freely. A
packing settles by vibrations, whose shortest period is the inertial time multiplied by (pressure /
E*)^(1/3). Durations of settling are therefore stated in inertial times at `REFERENCE_PRESSURE`, and
converted to other pressures by this factor.
"""

import math

from modal.packing.contact_law import GLASS, RADIUS, Material
from modal.packing.contact_models import laws_of
from modal.packing.contact_models.hertz_mindlin import HertzMindlin

FREQUENCY_FACTOR = 0.6037
"""Highest natural frequency of a random packing divided by E*^(1/3) p^(1/6) / (R sqrt(density)),
for Hertz contacts in similar packings: 216 kHz for the study's glass at 100 kPa."""
STABLE_FRACTION = 0.7
"""Time step divided by its limit 1 / (pi f_max); overlaps may then exceed the mean eightfold."""
REFERENCE_PRESSURE = 1e5
"""Pressure, Pa, of the inertial time in which durations of vibration are stated."""


def inertial_time(stress: float, radius: float = RADIUS, material: Material = GLASS) -> float:
    """Return D sqrt(density / stress), s, at a stress in Pa."""
    return 2 * radius * math.sqrt(material.density / stress)


def highest_frequency(stress: float, radius: float = RADIUS, material: Material = GLASS) -> float:
    """Return the highest natural frequency, Hz, of a random packing at `stress`, Pa.

    For a contact model other than Hertz's, the frequency is scaled by the square root of the ratio
    of both models' stiffnesses under the mean contact force.
    """
    softness = (stress / material.effective_young) ** (1 / 6)
    sound = math.sqrt(material.effective_young / material.density)
    smooth = FREQUENCY_FACTOR * sound * softness / radius
    stiffness = []
    for law in (laws_of(material)[0], HertzMindlin(*material.moduli)):
        overlap = law.overlap_of_force(stress * (2 * radius) ** 2, radius / 2)
        stiffness.append(law.stiffness_normal(overlap, radius / 2))
    return smooth * math.sqrt(stiffness[0] / stiffness[1])


def time_step(
    stress: float,
    fraction: float = STABLE_FRACTION,
    radius: float = RADIUS,
    material: Material = GLASS,
) -> float:
    """Return the time step, s, that is `fraction` of the stability limit at `stress`, Pa."""
    return fraction / (math.pi * highest_frequency(stress, radius, material))


def vibration_duration(
    number: float, stress: float, radius: float = RADIUS, material: Material = GLASS
) -> float:
    """Return the seconds, at `stress` (Pa), of a duration stated at the reference pressure.

    `number` counts inertial times at `REFERENCE_PRESSURE`; this pressure grows with the modulus of
    the spheres relative to that of glass.
    """
    reference = REFERENCE_PRESSURE * (material.effective_young / GLASS.effective_young)
    stiffening = (stress / reference) ** (1 / 3)
    return number * stiffening * inertial_time(stress, radius, material)


def count_steps(seconds: float, dt: float) -> int:
    """Return the number of steps of `dt`, s, nearest to a time, s; at least one."""
    return max(1, round(seconds / dt))
