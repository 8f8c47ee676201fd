"""Springs of constant stiffness: those of a Hertz contact as wide as its effective radius.

Moduli of a packing of such contacts do not grow with the stress. kn = 2 E* R* says how stiff:
Young's modulus is the free number of the model; the ratio of both stiffnesses is Mindlin's.
"""

from typing import Any, NamedTuple


class Linear(NamedTuple):
    """E* and G*, Pa, of a contact, or of each (m,): kn = 2 E* R*, kt = 8 G* R*."""

    effective_young: Any
    effective_shear: Any

    def normal_force(self, overlap: Any, radius: Any) -> Any:
        """N = kn overlap."""
        return 2 * self.effective_young * radius * overlap

    def elastic_energy(self, overlap: Any, radius: Any) -> Any:
        """Half of N overlap."""
        return self.effective_young * radius * overlap**2

    def stiffness_normal(self, overlap: Any, radius: Any) -> Any:
        """Whatever the overlap."""
        return 2 * self.effective_young * radius + 0 * overlap

    def stiffness_tangential(self, overlap: Any, radius: Any) -> Any:
        """Whatever the overlap."""
        return 8 * self.effective_shear * radius + 0 * overlap

    def overlap_of_force(self, force: Any, radius: Any) -> Any:
        """N / kn."""
        return force / (2 * self.effective_young * radius)


LAW = Linear
