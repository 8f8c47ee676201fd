"""Springs of constant stiffness: those of a Hertz contact as wide as its effective radius.

Moduli of a packing of such contacts do not grow with the stress. kn = 2 E* R* says how stiff:
Young's modulus is the free number of the model; the ratio of both stiffnesses is Mindlin's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from modal.packing.contact_law import Moduli
from modal.packing.contact_models import refuse_numbers
from modal.tools.arrays import Floats


class Linear(NamedTuple):
    """E* and G*, Pa, of a contact, or of each (m,): kn = 2 E* R*, kt = 8 G* R*."""

    effective_young: Any
    effective_shear: Any

    @classmethod
    def of(cls, moduli: Moduli, numbers: Sequence[float], wall: bool) -> Linear:
        """Of the moduli alone."""
        refuse_numbers(numbers, "linear")
        return cls(*moduli)

    def normal_force(self, overlap: Any, radius: Any) -> Floats:
        """N = kn overlap."""
        force: Floats = 2 * self.effective_young * radius * overlap
        return force

    def elastic_energy(self, overlap: Any, radius: Any) -> Floats:
        """Half of N overlap."""
        energy: Floats = self.effective_young * radius * overlap**2
        return energy

    def stiffness_normal(self, overlap: Any, radius: Any) -> Floats:
        """Whatever the overlap."""
        stiffness: Floats = 2 * self.effective_young * radius + 0 * overlap
        return stiffness

    def stiffness_tangential(self, overlap: Any, radius: Any) -> Floats:
        """Whatever the overlap."""
        stiffness: Floats = 8 * self.effective_shear * radius + 0 * overlap
        return stiffness

    def overlap_of_force(self, force: Any, radius: Any) -> Floats:
        """N / kn."""
        overlap: Floats = force / (2 * self.effective_young * radius)
        return overlap


LAW = Linear
