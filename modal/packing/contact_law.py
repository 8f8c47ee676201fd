"""Elastic materials of spheres and walls, and the moduli of a contact between two of them.

The laws that make forces of these moduli are the classes of `modal.packing.contact_models`.
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

HERTZ_MINDLIN = "hertz-mindlin"
"""The contact model where none is named."""


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
    def moduli(self) -> Moduli:
        """E* and G* = G / (2 (2 - nu)), Pa: all that the law of contact needs."""
        shear = self.young / (4 * (1 + self.poisson) * (2 - self.poisson))
        return Moduli(self.effective_young, shear)

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
    """What a sphere is made of: `young` in Pa, `poisson`, `density` in kg/m^3.

    `contact_model` is the name of the law of its contacts, and that law's own numbers.
    """

    density: float
    contact_model: str = HERTZ_MINDLIN

    def sphere(self, radius: Any, densities: Floats | None = None) -> tuple[Any, Any]:
        """Mass, kg, and moment of inertia, kg m^2, of a sphere, or of each, of `radius`, m.

        `densities` (n,), kg/m^3, in place of the material's own.
        """
        mass = (self.density if densities is None else densities) * 4 / 3 * np.pi * radius**3
        return mass, 0.4 * mass * radius**2


def sphere_volume(radius: Floats) -> Floats:
    """4/3 pi R^3, m^3, of each radius, m."""
    return 4 / 3 * np.pi * radius**3


GLASS = Material(young=60e9, poisson=0.2, density=2230.0)
"""Borosilicate glass ballotini of the study (Otsubo et al. 2017, section 2)."""
