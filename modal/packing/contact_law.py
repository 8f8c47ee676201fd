"""Simplified Hertz-Mindlin contacts between equal spheres, and between a sphere and a flat wall.

Sphere and wall are of the same material, so both contacts share the effective moduli and differ
only in the effective radius: R/2 for two equal spheres, R for a flat wall. The functions take
arrays or single numbers, and give single numbers where both arguments are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.formats.arrays import Floats

RADIUS = 1.27e-3
"""Particle radius of the study, m (Otsubo et al. 2017, section 2)."""


@dataclass(frozen=True)
class Material:
    """Elastic material: `young` in Pa, `poisson`, `density` in kg/m^3."""

    young: float
    poisson: float
    density: float

    @property
    def effective_young(self) -> float:
        """E* = E / (2 (1 - nu^2)), Pa, of two bodies of this material."""
        return self.young / (2 * (1 - self.poisson**2))

    @property
    def effective_shear(self) -> float:
        """G* = G / (2 (2 - nu)), Pa, of two bodies of this material."""
        return self.young / (4 * (1 + self.poisson) * (2 - self.poisson))


GLASS = Material(young=60e9, poisson=0.2, density=2230.0)
"""Borosilicate glass ballotini of the study (Otsubo et al. 2017, section 2)."""


def normal_force(
    overlap: Floats | float, effective_radius: Floats | float, material: Material
) -> Floats:
    """Hertz: N = 4/3 E* sqrt(R*) overlap^(3/2); overlap in m, N in newton."""
    force: Floats = 4 / 3 * material.effective_young * np.sqrt(effective_radius) * overlap**1.5
    return force


def overlap_of_force(
    force: Floats | float, effective_radius: Floats | float, material: Material
) -> Floats:
    """The inverse of `normal_force`: overlap in m from a compressive force in newton."""
    overlap: Floats = (0.75 * force / (material.effective_young * np.sqrt(effective_radius))) ** (
        2 / 3
    )
    return overlap


def stiffness_normal(
    overlap: Floats | float, effective_radius: Floats | float, material: Material
) -> Floats:
    """Tangent normal stiffness kn = dN/d(overlap) = 2 E* sqrt(R* overlap), N/m."""
    return 2 * material.effective_young * np.sqrt(effective_radius * overlap)


def stiffness_tangential(
    overlap: Floats | float, effective_radius: Floats | float, material: Material
) -> Floats:
    """Tangential stiffness without slip kt = 8 G* sqrt(R* overlap), N/m."""
    return 8 * material.effective_shear * np.sqrt(effective_radius * overlap)
