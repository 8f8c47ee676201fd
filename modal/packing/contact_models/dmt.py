"""Model contacts of stiff adhesive spheres: Hertz's contact, pressed by a constant attraction.

B. V. Derjaguin, V. M. Muller, Yu. P. Toporov, J. Colloid Interface Sci. 53, 314 (1975). Forces
around the circle of contact add the compression 2 pi w R* to the load, where w is the work of
adhesion. The circle of contact, and with it both stiffnesses, is that of Hertz under the sum of
load and attraction. The contact bears tension up to 2 pi w R* and opens when the spheres no longer
overlap.

The friction limit is proportional to Hertz's force, which contains the attraction. The model suits
stiff, small spheres with forces of long range: Tabor's parameter (R* w^2 / (E*^2 z0^3))^(1/3) below
0.1, with the distance z0 of atoms, 0.2 to 0.4 nm. Above 5 `modal.packing.contact_models.jkr` holds
(K. L. Johnson, J. A. Greenwood, J. Colloid Interface Sci. 192, 326, 1997).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from modal.packing.adhesion import read_work_of_adhesion


def hertz_force(young: Any, overlap: Any, radius: Any) -> Any:
    """Return Hertz's force, N."""
    return 4 / 3 * young * np.sqrt(radius * overlap) * overlap


def attraction(work: Any, radius: Any) -> Any:
    """Return the attraction 2 pi w R*, N."""
    return 2 * np.pi * work * radius


class Dmt(NamedTuple):
    """A DMT contact, or many: E* and G*, Pa, and the work of adhesion w, J/m^2; numbers or (m,)."""

    effective_young: Any
    effective_shear: Any
    work_of_adhesion: Any

    @staticmethod
    def own_numbers(numbers: Sequence[float], wall: bool) -> tuple[float]:
        """Return the work of adhesion, J/m^2, as `read_work_of_adhesion` does."""
        return (read_work_of_adhesion("dmt", numbers, wall),)

    def normal_force(self, overlap: Any, radius: Any) -> Any:
        """Return Hertz's force minus the attraction, N."""
        hertz = hertz_force(self.effective_young, overlap, radius)
        return hertz - attraction(self.work_of_adhesion, radius)

    def friction_force(self, overlap: Any, radius: Any) -> Any:
        """Return Hertz's force, N, which presses the two surfaces together."""
        return hertz_force(self.effective_young, overlap, radius)

    def elastic_energy(self, overlap: Any, radius: Any) -> Any:
        """Return Hertz's energy minus the work of the attraction, J."""
        hertz = hertz_force(self.effective_young, overlap, radius)
        return (0.4 * hertz - attraction(self.work_of_adhesion, radius)) * overlap

    def stiffness_normal(self, overlap: Any, radius: Any) -> Any:
        """Return kn = 2 E* a, N/m, with the radius a of the circle of contact."""
        return 2 * self.effective_young * np.sqrt(radius * overlap)

    def stiffness_tangential(self, overlap: Any, radius: Any) -> Any:
        """Return kt = 8 G* a, N/m, with the radius a of the circle of contact."""
        return 8 * self.effective_shear * np.sqrt(radius * overlap)

    def overlap_of_force(self, force: Any, radius: Any) -> Any:
        """Return the overlap, m: Hertz's overlap under the sum of force, N, and attraction."""
        pressed = force + attraction(self.work_of_adhesion, radius)
        return (0.75 * pressed / (self.effective_young * np.sqrt(radius))) ** (2 / 3)


LAW = Dmt
