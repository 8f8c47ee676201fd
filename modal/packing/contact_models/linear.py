"""Model contacts by springs of constant stiffness.

The stiffness is that of a Hertz contact whose circle has the effective radius, kn = 2 E* R*, so
that Young's modulus sets the stiffness; kt / kn is Mindlin's ratio. Moduli of a packing of such
contacts do not grow with the stress.
"""

from typing import Any, NamedTuple


class Linear(NamedTuple):
    """A linear contact, or many: E* and G*, Pa, numbers or (m,)."""

    effective_young: Any
    effective_shear: Any

    def normal_force(self, overlap: Any, radius: Any) -> Any:
        """Return the normal force N = kn overlap, in N."""
        return 2 * self.effective_young * radius * overlap

    def elastic_energy(self, overlap: Any, radius: Any) -> Any:
        """Return the elastic energy N overlap / 2, J."""
        return self.effective_young * radius * overlap**2

    def stiffness_normal(self, overlap: Any, radius: Any) -> Any:
        """Return kn = 2 E* R*, N/m, for each overlap."""
        return 2 * self.effective_young * radius + 0 * overlap

    def stiffness_tangential(self, overlap: Any, radius: Any) -> Any:
        """Return kt = 8 G* R*, N/m, for each overlap."""
        return 8 * self.effective_shear * radius + 0 * overlap

    def overlap_of_force(self, force: Any, radius: Any) -> Any:
        """Return the overlap N / kn, m, of a force N."""
        return force / (2 * self.effective_young * radius)


LAW = Linear
