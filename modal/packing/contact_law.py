"""Define elastic materials of spheres and walls, and the moduli of a contact between two.

The force laws that use these moduli are the classes of `modal.packing.contact_models`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from modal.tools.arrays import Floats

RADIUS = 1.27e-3
"""Particle radius of the study, m (Otsubo et al. 2017, section 2)."""
YOUNG_RANGE_PA = (1e3, 1e14)
"""Range of Young's moduli that are accepted, Pa: from gels to bodies that count as rigid. A modulus
in GPa or in dyn/mm^2 lies outside."""

HERTZ_MINDLIN = "hertz-mindlin"
"""Name of the default contact model."""


class Moduli(NamedTuple):
    """Effective moduli E* and G*, Pa, of one contact or of many (m,), as in `Elasticity`."""

    effective_young: Any
    effective_shear: Any


@dataclass(frozen=True)
class Elasticity:
    """Elastic constants of a body: Young's modulus `young`, Pa, and Poisson's ratio `poisson`."""

    young: float
    poisson: float

    @property
    def effective_young(self) -> float:
        """E* = E / (2 (1 - nu^2)), Pa, for two bodies of this material."""
        return self.young / (2 * (1 - self.poisson**2))

    @property
    def moduli(self) -> Moduli:
        """E* and G* = G / (2 (2 - nu)), Pa, for two bodies of this material."""
        shear = self.young / (4 * (1 + self.poisson) * (2 - self.poisson))
        return Moduli(self.effective_young, shear)

    def against(self, other: Elasticity) -> Moduli:
        """Return E* and G*, Pa, of a contact with a body of another material; compliances add up.

        1/E* = (1 - nu^2)/E + (1 - nu'^2)/E', 1/G* = (2 - nu)/G + (2 - nu')/G'.
        """
        if (self.young, self.poisson) == (other.young, other.poisson):
            return self.moduli  # to the last bit
        pairs = zip(self.moduli, other.moduli, strict=True)
        return Moduli(*(2 / (1 / modulus + 1 / other_modulus) for modulus, other_modulus in pairs))


@dataclass(frozen=True)
class Material(Elasticity):
    """Material of spheres: `young`, Pa, `poisson`, `density`, kg/m^3, and the contact model.

    `contact_model` is the name of a module of `modal.packing.contact_models`, followed by the
    numbers that this model takes, as in "rough 1e-6".
    """

    density: float
    contact_model: str = HERTZ_MINDLIN

    def sphere(self, radius: Any, densities: Floats | None = None) -> tuple[Any, Any]:
        """Return the mass, kg, and the moment of inertia, kg m^2, of a sphere, or of many (n,).

        `radius` is a number or (n,), m; `densities` (n,), kg/m^3, replace the density of the
        material.
        """
        density = self.density if densities is None else densities
        mass = density * 4 / 3 * np.pi * radius**3
        return mass, 0.4 * mass * radius**2


def sphere_volume(radius: Floats) -> Floats:
    """Return the volume 4/3 pi R^3, m^3, of a sphere of each radius (n,), m."""
    return 4 / 3 * np.pi * radius**3


GLASS = Material(young=60e9, poisson=0.2, density=2230.0)
"""Borosilicate glass ballotini of the study (Otsubo et al. 2017, section 2)."""
