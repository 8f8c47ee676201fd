"""Simplified Hertz-Mindlin contacts between spheres, and between a sphere and a flat wall.

Where sphere and wall are of the same material both contacts share the effective moduli and differ
only in the effective radius: R/2 for two equal spheres, R for a flat wall. The functions take
arrays or single numbers, and give single numbers where both arguments are. The loops over moving
contacts are compiled from these very functions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from modal.tools.arrays import Floats

RADIUS = 1.27e-3
"""Particle radius of the study, m (Otsubo et al. 2017, section 2)."""
YOUNG = (1e3, 1e14)
"""Young's moduli that are taken, Pa: from gels to what counts as rigid. Those in GPa or in dyn/mm^2
lie outside."""


class Moduli(NamedTuple):
    """Effective moduli of two bodies, Pa, or of many pairs (m,); see `Elasticity`."""

    effective_young: Any
    effective_shear: Any


@dataclass(frozen=True)
class Elasticity:
    """What a body resists a contact with: `young` in Pa, `poisson`."""

    young: float
    poisson: float

    @property
    def effective_young(self) -> float:
        """E* = E / (2 (1 - nu^2)), Pa, of two bodies of this material."""
        return self.young / (2 * (1 - self.poisson**2))

    @property
    def effective_shear(self) -> float:
        """G* = G / (2 (2 - nu)), Pa, of two bodies of this material."""
        return self.young / (4 * (1 + self.poisson) * (2 - self.poisson))

    @property
    def moduli(self) -> Moduli:
        """E* and G*: all that the law of contact needs."""
        return Moduli(self.effective_young, self.effective_shear)

    def against(self, other: Elasticity) -> Moduli:
        """E* and G*, Pa, of a contact with a body of another material: compliances add.

        1/E* = (1 - nu^2)/E + (1 - nu'^2)/E', 1/G* = (2 - nu)/G + (2 - nu')/G'.
        """
        if (self.young, self.poisson) == (other.young, other.poisson):
            return self.moduli  # to the last bit
        pairs = zip(self.moduli, other.moduli, strict=True)
        return Moduli(*(2 / (1 / own + 1 / its) for own, its in pairs))


@dataclass(frozen=True)
class Material(Elasticity):
    """What a sphere is made of: `young` in Pa, `poisson`, `density` in kg/m^3."""

    density: float

    def sphere(self, radius: Any, densities: Floats | None = None) -> tuple[Any, Any]:
        """Mass, kg, and moment of inertia, kg m^2, of a sphere, or of each, of `radius`, m.

        `densities` (n,), kg/m^3, in place of the material's own.
        """
        mass = (self.density if densities is None else densities) * 4 / 3 * np.pi * radius**3
        return mass, 0.4 * mass * radius**2


def sphere_volume(radius: Floats) -> Floats:
    """4/3 pi R^3, m^3, of each radius, m."""
    return 4 / 3 * np.pi * radius**3


Elastic = Elasticity | Moduli

GLASS = Material(young=60e9, poisson=0.2, density=2230.0)
"""Borosilicate glass ballotini of the study (Otsubo et al. 2017, section 2)."""


def contact_radius(overlap: Floats | float, effective_radius: Floats | float) -> Floats:
    """Hertz: a = sqrt(R* overlap), m, of the circle of contact; overlap in m."""
    radius: Floats = np.sqrt(effective_radius * overlap)
    return radius


def normal_force(
    overlap: Floats | float, effective_radius: Floats | float, material: Elastic
) -> Floats:
    """Hertz: N = 4/3 E* a overlap; overlap in m, N in newton."""
    hertz = 4 / 3 * material.effective_young
    return hertz * contact_radius(overlap, effective_radius) * overlap


def elastic_energy(
    overlap: Floats | float, effective_radius: Floats | float, material: Elastic
) -> Floats:
    """Work of the normal force from touch to `overlap`, m: 2/5 N overlap, J."""
    return 0.4 * normal_force(overlap, effective_radius, material) * overlap


def overlap_of_force(
    force: Floats | float, effective_radius: Floats | float, material: Elastic
) -> Floats:
    """The inverse of `normal_force`: overlap in m from a compressive force in newton."""
    overlap: Floats = (0.75 * force / (material.effective_young * np.sqrt(effective_radius))) ** (
        2 / 3
    )
    return overlap


def stiffness_normal(
    overlap: Floats | float, effective_radius: Floats | float, material: Elastic
) -> Floats:
    """Tangent normal stiffness kn = dN/d(overlap) = 2 E* a, N/m."""
    return 2 * material.effective_young * contact_radius(overlap, effective_radius)


def stiffness_tangential(
    overlap: Floats | float, effective_radius: Floats | float, material: Elastic
) -> Floats:
    """Tangential stiffness without slip kt = 8 G* a, N/m."""
    return 8 * material.effective_shear * contact_radius(overlap, effective_radius)
