"""The FCC crystal at rest under isotropic stress: its geometry, contact forces and stiffnesses.

The crystal stands with [001] along z: square layers with spacing d (one contact distance), each
layer shifted by half a cell, layer distance l = d / sqrt(2). Each sphere has twelve contacts of
equal normal force. Its waves are in `modal.theory.fcc`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from modal.packing.checks import DEEPEST
from modal.packing.contact_law import (
    GLASS,
    RADIUS,
    Material,
    normal_force,
    overlap_of_force,
    stiffness_normal,
    stiffness_tangential,
)
from modal.tools.arguments import refuse_other_kinds
from modal.tools.errors import InputError


@dataclass(frozen=True)
class FccPacking:
    """FCC of equal spheres under isotropic stress (Pa): geometry and contact stiffnesses."""

    stress: float = 1e5
    radius: float = RADIUS
    material: Material = GLASS

    def __post_init__(self) -> None:
        refuse_other_kinds(FccPacking, type(self).__name__, vars(self))
        deepest = DEEPEST * self.radius
        force = float(normal_force(deepest, self.radius / 2, self.material))
        largest = 2 * sqrt(2) * force / (2 * self.radius - deepest) ** 2
        if not 0 < self.stress < largest:
            raise InputError(
                f"stress {self.stress:g} Pa: outside 0 to {largest:.3g} Pa, where spheres of this "
                f"material overlap by {DEEPEST:g} of the radius; give it in Pa"
            )

    @property
    def overlap(self) -> float:
        """Overlap of two spheres, m, that balances the stress with spacing d = 2R - overlap.

        Isotropic stress = 2 sqrt(2) F / d^2; the spacing depends on the overlap, so a fixed
        point (contraction factor 4/3 overlap / d) is iterated to machine precision.
        """
        overlap, last = 0.0, -1.0
        while abs(overlap - last) > 1e-15 * self.radius:
            last = overlap
            force = self.stress * (2 * self.radius - overlap) ** 2 / (2 * sqrt(2))
            overlap = float(overlap_of_force(force, self.radius / 2, self.material))
        return overlap

    @property
    def spacing(self) -> float:
        """Contact distance d, m."""
        return 2 * self.radius - self.overlap

    @property
    def layer_distance(self) -> float:
        """Distance of neighbouring layers along z, l = d / sqrt(2), m."""
        return self.spacing / sqrt(2)

    @property
    def contact_force(self) -> float:
        """Normal force of each contact, N."""
        return self.stress * self.spacing**2 / (2 * sqrt(2))

    @property
    def wall_overlap(self) -> float:
        """Overlap of a sphere of the outer layers with the flat wall, m (force stress d^2)."""
        force = self.stress * self.spacing**2
        return float(overlap_of_force(force, self.radius, self.material))

    @property
    def mass(self) -> float:
        """Mass of a sphere, kg."""
        return float(self.material.sphere(self.radius)[0])

    @property
    def kn(self) -> float:
        """Normal contact stiffness, N/m."""
        return float(stiffness_normal(self.overlap, self.radius / 2, self.material))

    @property
    def kt(self) -> float:
        """Tangential contact stiffness, N/m."""
        return float(stiffness_tangential(self.overlap, self.radius / 2, self.material))
