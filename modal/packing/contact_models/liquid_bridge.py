"""Model contacts of wet spheres: Hertz's contact, and a liquid bridge across contact and gap.

C. D. Willett, M. J. Adams, S. A. Johnson, J. P. K. Seville, Langmuir 16, 9396 (2000), their closed
form for small bridges: two spheres of the radius R a distance S apart attract each other by

    F = 2 pi R gamma cos(theta) / (1 + 1.05 s + 2.5 s^2),    s = S sqrt(R / V)

with the surface tension gamma, the contact angle theta and the volume V of the bridge. For unequal
spheres R is Derjaguin's mean 2 R1 R2 / (R1 + R2) = 2 R*; a wall counts as a sphere without
curvature. In contact S = 0. The formula holds for bridges that are small compared with the spheres,
and for angles below 50 degrees.

A bridge forms at touch and breaks at S = (1 + theta / 2) V^(1/3) (G. Lian, C. Thornton, M. J.
Adams, J. Colloid Interface Sci. 161, 138, 1993). Each contact has a bridge of the same volume.
Across a gap there is no tangential stiffness, kn is negative, and viscous forces are left out. The
friction limit is proportional to Hertz's force.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from modal.tools.errors import InputError

TENSION_RANGE = (1e-6, 10.0)
"""Range of the surface tension that is accepted, N/m. Water has 0.073, mercury 0.49."""
MAX_VOLUME = 1e-6
"""Largest volume of a bridge that is accepted, m^3."""
MAX_ANGLE = 90.0
"""Contact angle from which on liquid pulls no longer, degrees."""
LINEAR = 1.05
"""Coefficient of s in Willett's closed form."""
QUADRATIC = 2.5
"""Coefficient of s^2 there."""
ROOT = (4 * QUADRATIC - LINEAR**2) ** 0.5
"""Square root of the negative discriminant of the polynomial in s."""


def hertz_force(young: Any, overlap: Any, radius: Any) -> Any:
    """Return Hertz's force, N; 0 across a gap."""
    depth = np.maximum(overlap, 0.0)
    return 4 / 3 * young * np.sqrt(radius * depth) * depth


def pull_in_contact(tension: Any, radius: Any) -> Any:
    """Return the attraction without a gap, N; `tension` is gamma cos(theta), N/m."""
    return 4 * np.pi * radius * tension


def reduced_gap(overlap: Any, radius: Any, volume: Any) -> Any:
    """Return the reduced gap s = S sqrt(R / V); 0 in contact."""
    return np.maximum(-overlap, 0.0) * np.sqrt(2 * radius / volume)


class LiquidBridge(NamedTuple):
    """A wet contact, or many; numbers or (m,).

    E* and G*, Pa; gamma cos(theta), N/m; the volume of the bridge, m^3; and the gap at which it
    breaks, m.
    """

    effective_young: Any
    effective_shear: Any
    tension: Any
    volume: Any
    rupture_gap: Any

    @staticmethod
    def own_numbers(numbers: Sequence[float], wall: bool) -> tuple[float, float, float]:
        """Return gamma cos(theta), N/m, the volume, m^3, and the gap of rupture, m.

        `numbers` are surface tension, N/m, volume of a bridge, m^3, and optionally the contact
        angle, degrees, by default 0.
        """
        tension, volume, angle = (*numbers, 0.0, 0.0, 0.0)[:3]
        low, high = TENSION_RANGE
        in_range = low <= tension <= high and 0 < volume <= MAX_VOLUME and 0 <= angle < MAX_ANGLE
        if len(numbers) not in (2, 3) or not in_range:
            raise InputError(
                "liquid_bridge",
                "contact model liquid-bridge",
                "give the surface tension, N/m, the volume of a bridge, m^3, and the contact "
                "angle, degrees, where it is not 0, as liquid-bridge 0.073 1e-12",
                f"{low:g} to {high:g}, up to {MAX_VOLUME:g}, below {MAX_ANGLE:g}",
            )
        theta = np.radians(angle)
        rupture_gap = (1 + theta / 2) * np.cbrt(volume)
        return float(tension * np.cos(theta)), float(volume), float(rupture_gap)

    def rupture_distance(self, radius: Any) -> Any:
        """Return the gap, m, at which the bridge breaks, for each radius."""
        return self.rupture_gap + 0 * radius

    def normal_force(self, overlap: Any, radius: Any) -> Any:
        """Return Hertz's force minus the attraction of the bridge, N."""
        s = reduced_gap(overlap, radius, self.volume)
        pull = pull_in_contact(self.tension, radius) / (1 + LINEAR * s + QUADRATIC * s * s)
        return hertz_force(self.effective_young, overlap, radius) - pull

    def friction_force(self, overlap: Any, radius: Any) -> Any:
        """Return Hertz's force, N, which presses the two surfaces together."""
        return hertz_force(self.effective_young, overlap, radius)

    def elastic_energy(self, overlap: Any, radius: Any) -> Any:
        """Return the integral of the force from touch on, J."""
        depth = np.maximum(overlap, 0.0)
        hertz = 0.4 * hertz_force(self.effective_young, overlap, radius) * depth
        pull = pull_in_contact(self.tension, radius)
        s = reduced_gap(overlap, radius, self.volume)
        path = np.arctan((2 * QUADRATIC * s + LINEAR) / ROOT) - np.arctan(LINEAR / ROOT)
        stretched = pull * 2 / ROOT * path * np.sqrt(self.volume / (2 * radius))
        return hertz - pull * depth + stretched

    def stiffness_normal(self, overlap: Any, radius: Any) -> Any:
        """Return the derivative of the force, N/m: 2 E* a in contact, negative across a gap."""
        depth = np.maximum(overlap, 0.0)
        s = reduced_gap(overlap, radius, self.volume)
        polynomial = 1 + LINEAR * s + QUADRATIC * s * s
        # The force across a gap falls with s; in contact it does not depend on it.
        across = 1.0 * (overlap < 0)
        per_gap = np.sqrt(2 * radius / self.volume) * (LINEAR + 2 * QUADRATIC * s)
        bridge = pull_in_contact(self.tension, radius) * per_gap / (polynomial * polynomial)
        return 2 * self.effective_young * np.sqrt(radius * depth) - across * bridge

    def stiffness_tangential(self, overlap: Any, radius: Any) -> Any:
        """Return kt = 8 G* a, N/m; 0 across a gap."""
        return 8 * self.effective_shear * np.sqrt(radius * np.maximum(overlap, 0.0))

    def overlap_of_force(self, force: Any, radius: Any) -> Any:
        """Return the overlap in contact, m, of a force, N, not below the force at touch."""
        pressed = force + pull_in_contact(self.tension, radius)
        return (0.75 * pressed / (self.effective_young * np.sqrt(radius))) ** (2 / 3)


LAW = LiquidBridge
