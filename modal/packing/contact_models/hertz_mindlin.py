"""Model contacts by Hertz normally and by Mindlin, without slip, tangentially, as DEM codes do.

If spheres and walls are of one material, their contacts differ in the effective radius alone: R/2
for two equal spheres, R for a sphere and a flat wall. K. L. Johnson, Contact Mechanics (1985),
sections 4.2 and 7.3.
"""

from typing import Any, NamedTuple

import numpy as np


class HertzMindlin(NamedTuple):
    """A Hertz-Mindlin contact, or many: E* and G*, Pa, numbers or (m,).

    See `modal.packing.contact_law`. The circle of contact has the radius a = sqrt(R* overlap).
    """

    effective_young: Any
    effective_shear: Any

    def normal_force(self, overlap: Any, radius: Any) -> Any:
        """Return the normal force N = 4/3 E* a overlap, in N."""
        return 4 / 3 * self.effective_young * np.sqrt(radius * overlap) * overlap

    def elastic_energy(self, overlap: Any, radius: Any) -> Any:
        """Return the elastic energy 2/5 N overlap, J."""
        force = 4 / 3 * self.effective_young * np.sqrt(radius * overlap) * overlap
        return 0.4 * force * overlap

    def stiffness_normal(self, overlap: Any, radius: Any) -> Any:
        """Return kn = 2 E* a, N/m, with the radius a of the circle of contact."""
        return 2 * self.effective_young * np.sqrt(radius * overlap)

    def stiffness_tangential(self, overlap: Any, radius: Any) -> Any:
        """Return kt = 8 G* a, N/m, with the radius a of the circle of contact."""
        return 8 * self.effective_shear * np.sqrt(radius * overlap)

    def overlap_of_force(self, force: Any, radius: Any) -> Any:
        """Return the overlap (3 N / (4 E* sqrt(R*)))^(2/3), m, of a force N."""
        return (0.75 * force / (self.effective_young * np.sqrt(radius))) ** (2 / 3)


LAW = HertzMindlin
