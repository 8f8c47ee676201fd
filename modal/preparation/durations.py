"""Units of time of a packing under pressure: its own time, its fastest vibration, its time step.

The packing's own time, D sqrt(density / pressure), is that of spheres that move freely. Vibration,
whose shortest period is own time times (pressure / E*)^(1/3), settles a packing: durations of it
are given in own times at `REFERENCE`, and the power follows.
"""

import math

from modal.packing.contact_law import GLASS, RADIUS, Material
from modal.packing.contact_models import laws_of
from modal.packing.contact_models.hertz_mindlin import HertzMindlin

HIGHEST = 0.6037
"""Highest natural frequency of a random packing, over E*^(1/3) p^(1/6) / (R sqrt(density)): Hertz
contacts in similar packings; 216 kHz for the study's glass at 100 kPa."""
STABILITY = 0.7
"""Time step over its limit 1 / (pi f_max): overlaps may exceed the mean eightfold."""
REFERENCE = 1e5
"""Pressure, Pa, of the own time in which durations of vibration are given."""


def inertial_time(stress: float, radius: float = RADIUS, material: Material = GLASS) -> float:
    """D sqrt(density / stress), s."""
    return 2 * radius * math.sqrt(material.density / stress)


def highest_frequency(stress: float, radius: float = RADIUS, material: Material = GLASS) -> float:
    """Highest natural frequency of a random packing at `stress` (Pa), Hz.

    Of another contact model than Hertz's by the root of the stiffness under the mean force.
    """
    softness = (stress / material.effective_young) ** (1 / 6)
    smooth = HIGHEST * math.sqrt(material.effective_young / material.density) * softness / radius
    stiffness = []
    for law in (laws_of(material)[0], HertzMindlin(*material.moduli)):
        overlap = law.overlap_of_force(stress * (2 * radius) ** 2, radius / 2)
        stiffness.append(law.stiffness_normal(overlap, radius / 2))
    return smooth * math.sqrt(stiffness[0] / stiffness[1])


def time_step(
    stress: float, fraction: float = STABILITY, radius: float = RADIUS, material: Material = GLASS
) -> float:
    """Stable time step of statics at `stress` (Pa), s."""
    return fraction / (math.pi * highest_frequency(stress, radius, material))


def duration(
    number: float, stress: float, radius: float = RADIUS, material: Material = GLASS
) -> float:
    """Seconds of a vibration's duration, given in own times at `REFERENCE`, at `stress` (Pa).

    Of harder spheres than those of glass the reference is as much higher.
    """
    reference = REFERENCE * (material.effective_young / GLASS.effective_young)
    stiffer = (stress / reference) ** (1 / 3)
    return number * stiffer * inertial_time(stress, radius, material)


def steps_of(seconds: float, dt: float) -> int:
    """The number of steps nearest to a time, at least one."""
    return max(1, round(seconds / dt))
