"""Simplified Hertz-Mindlin contacts between equal spheres, and between a sphere and a flat wall.

Sphere and wall are of the same material, so both contacts share the effective moduli and differ
only in the effective radius: R/2 for two equal spheres, R for a flat wall.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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


def normal_force(overlap: np.ndarray, effective_radius: float, material: Material) -> np.ndarray:
    """Hertz: N = 4/3 E* sqrt(R*) overlap^(3/2); overlap in m, N in newton."""
    return 4 / 3 * material.effective_young * np.sqrt(effective_radius) * overlap**1.5


def overlap_of_force(force: np.ndarray, effective_radius: float, material: Material) -> np.ndarray:
    """The inverse of `normal_force`: overlap in m from a compressive force in newton."""
    return (0.75 * force / (material.effective_young * np.sqrt(effective_radius))) ** (2 / 3)


def stiffness_normal(
    overlap: np.ndarray, effective_radius: float, material: Material
) -> np.ndarray:
    """Tangent normal stiffness kn = dN/d(overlap) = 2 E* sqrt(R* overlap), N/m."""
    return 2 * material.effective_young * np.sqrt(effective_radius * overlap)


def stiffness_tangential(
    overlap: np.ndarray, effective_radius: float, material: Material
) -> np.ndarray:
    """Tangential stiffness without slip kt = 8 G* sqrt(R* overlap), N/m."""
    return 8 * material.effective_shear * np.sqrt(effective_radius * overlap)
