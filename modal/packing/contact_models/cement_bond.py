"""Model contacts of cemented spheres: Hertz's contact in parallel with a beam of cement.

The beam is the parallel bond of D. O. Potyondy, P. A. Cundall, Int. J. Rock Mech. Min. Sci. 41,
1329 (2004), eqs. 11 to 17. With the radius r and the length L of the beam, Young's modulus E_c of
the cement and the ratio q of normal to shear stiffness, its springs are

    normal  E_c A / L           shear     E_c A / (q L)          A = pi r^2
    rolling E_c I / L           twisting  E_c J / (q L)          I = pi r^4 / 4,  J = 2 I

Two spheres of the radius R have L = 2 R and r = share R; a sphere and a wall L = R. For unequal
spheres R is 2 R*, the harmonic mean of both radii.

The beam forms at touch without stress. It bears tension until the tensile stress reaches the
strength s, at the gap s L / E_c, and then breaks. Shear slips at the friction coefficient times
Hertz's force and s A: Coulomb's law with cohesion. The beam yields at moments that stress its outer
fibre to s: s I / r in rolling and s J / r in twisting. Only tension breaks the beam. A new touch
makes a new beam, as between spheres coated with soft cement.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from modal.packing.contact_law import YOUNG_RANGE_PA
from modal.tools.errors import InputError

SHARE_RANGE = (1e-3, 1.0)
"""Range of the beam's radius divided by that of the spheres."""
STRENGTH_RANGE = (1.0, 1e11)
"""Range of the tensile strength of the cement, Pa."""
MAX_STRAIN = 0.2
"""Largest strain at which a beam may break: farther apart spheres are no neighbours any more."""
STIFFNESS_RATIO = 2.5
"""Default ratio of normal to shear stiffness, that of Potyondy and Cundall for granite."""
RATIO_RANGE = (1.0, 100.0)
"""Range of that ratio: a beam is not stiffer in shear than along its axis."""
NEWTON_STEPS = 8
"""Steps of Newton's method for the overlap of a force: the first error is at most a factor of two,
which six steps bring to round-off."""


def hertz_force(young: Any, overlap: Any, radius: Any) -> Any:
    """Return Hertz's force, N; 0 across a gap."""
    depth = np.maximum(overlap, 0.0)
    return 4 / 3 * young * np.sqrt(radius * depth) * depth


def beam_area(radius_share: Any, radius: Any) -> Any:
    """Return the area of the beam's cross-section, m^2."""
    beam_radius = radius_share * radius
    return np.pi * beam_radius * beam_radius


def beam_stiffness(young: Any, radius_share: Any, length_share: Any, radius: Any) -> Any:
    """Return the normal stiffness E_c A / L of the beam, N/m."""
    return young * beam_area(radius_share, radius) / (length_share * radius)


class CementBond(NamedTuple):
    """A cemented contact, or many; numbers or (m,).

    E* and G* of the grains, Pa; Young's modulus and tensile strength of the cement, Pa; normal
    stiffness divided by shear stiffness; radius and length of the beam divided by the effective
    radius R*.
    """

    effective_young: Any
    effective_shear: Any
    cement_young: Any
    strength: Any
    stiffness_ratio: Any
    radius_share: Any
    length_share: Any

    @staticmethod
    def own_numbers(numbers: Sequence[float], wall: bool) -> tuple[float, ...]:
        """Return modulus and strength, Pa, ratio of stiffnesses, radius / R* and length / R*.

        `numbers` are Young's modulus, Pa, radius of the beam divided by that of the spheres,
        tensile strength, Pa, and optionally normal stiffness divided by shear stiffness, by default
        `STIFFNESS_RATIO`.
        """
        young, share, strength, ratio = (*numbers, 0.0, 0.0, 0.0, STIFFNESS_RATIO)[:4]
        if len(numbers) == 3:
            ratio = STIFFNESS_RATIO
        limits = (
            (young, YOUNG_RANGE_PA),
            (share, SHARE_RANGE),
            (strength, STRENGTH_RANGE),
            (ratio, RATIO_RANGE),
        )
        in_range = all(low <= number <= high for number, (low, high) in limits)
        if len(numbers) not in (3, 4) or not in_range or strength > MAX_STRAIN * young:
            raise InputError(
                "cement_bond",
                "contact model cement-bond",
                "give Young's modulus of the cement, Pa, the radius of the beam over that of the "
                f"spheres ({SHARE_RANGE[0]:g} to {SHARE_RANGE[1]:g}), its tensile strength, Pa (up "
                f"to {MAX_STRAIN:g} of the modulus), and normal over shear stiffness where it is "
                f"not {STIFFNESS_RATIO:g}",
                "cement-bond 1e9 0.5 1e7 is an example",
            )
        # R* is R at a wall, and R / 2 for two equal spheres.
        radius_share = share if wall else 2 * share
        length_share = 1.0 if wall else 4.0
        return young, strength, ratio, radius_share, length_share

    def rupture_distance(self, radius: Any) -> Any:
        """Return the gap, m, at which the tensile stress of the beam reaches its strength."""
        return self.strength / self.cement_young * self.length_share * radius

    def normal_force(self, overlap: Any, radius: Any) -> Any:
        """Return Hertz's force plus that of the beam, E_c A / L times the overlap, N."""
        beam = beam_stiffness(self.cement_young, self.radius_share, self.length_share, radius)
        return hertz_force(self.effective_young, overlap, radius) + beam * overlap

    def friction_force(self, overlap: Any, radius: Any) -> Any:
        """Return Hertz's force plus the tensile strength s A of the beam, N."""
        hertz = hertz_force(self.effective_young, overlap, radius)
        return hertz + self.strength * beam_area(self.radius_share, radius)

    def elastic_energy(self, overlap: Any, radius: Any) -> Any:
        """Return the integral of the force from touch on, J."""
        hertz = hertz_force(self.effective_young, overlap, radius)
        beam = beam_stiffness(self.cement_young, self.radius_share, self.length_share, radius)
        return 0.4 * hertz * np.maximum(overlap, 0.0) + 0.5 * beam * overlap * overlap

    def stiffness_normal(self, overlap: Any, radius: Any) -> Any:
        """Return kn = 2 E* a + E_c A / L, N/m."""
        beam = beam_stiffness(self.cement_young, self.radius_share, self.length_share, radius)
        return 2 * self.effective_young * np.sqrt(radius * np.maximum(overlap, 0.0)) + beam

    def stiffness_tangential(self, overlap: Any, radius: Any) -> Any:
        """Return kt = 8 G* a + E_c A / (q L), N/m."""
        beam = beam_stiffness(self.cement_young, self.radius_share, self.length_share, radius)
        circle = np.sqrt(radius * np.maximum(overlap, 0.0))
        return 8 * self.effective_shear * circle + beam / self.stiffness_ratio

    def stiffness_rolling(self, overlap: Any, radius: Any) -> Any:
        """Return E_c I / L, N m/rad, for each overlap."""
        beam = beam_stiffness(self.cement_young, self.radius_share, self.length_share, radius)
        beam_radius = self.radius_share * radius
        return beam * beam_radius * beam_radius / 4 + 0.0 * overlap

    def stiffness_twisting(self, overlap: Any, radius: Any) -> Any:
        """Return E_c J / (q L), N m/rad, for each overlap."""
        beam = beam_stiffness(self.cement_young, self.radius_share, self.length_share, radius)
        beam_radius = self.radius_share * radius
        return beam / self.stiffness_ratio * beam_radius * beam_radius / 2 + 0.0 * overlap

    def rolling_limit(self, overlap: Any, radius: Any) -> Any:
        """Return the moment s I / r, N m, at which the beam yields in rolling."""
        beam_radius = self.radius_share * radius
        return self.strength * beam_area(self.radius_share, radius) * beam_radius / 4

    def twisting_limit(self, overlap: Any, radius: Any) -> Any:
        """Return the moment s J / r, N m, at which the beam yields in twisting."""
        beam_radius = self.radius_share * radius
        return self.strength * beam_area(self.radius_share, radius) * beam_radius / 2

    def overlap_of_force(self, force: Any, radius: Any) -> Any:
        """Return the overlap of a force, N, by Newton's method from above."""
        beam = beam_stiffness(self.cement_young, self.radius_share, self.length_share, radius)
        hertz = 4 / 3 * self.effective_young * np.sqrt(radius)
        overlap = force / beam
        pressed = np.maximum(force, 0.0)
        depth = np.minimum(pressed / beam, (pressed / hertz) ** (2 / 3))
        for _ in range(NEWTON_STEPS):
            excess = hertz * np.sqrt(depth) * depth + beam * depth - pressed
            depth = depth - excess / (1.5 * hertz * np.sqrt(depth) + beam)
        return np.where(force > 0, depth, overlap)


LAW = CementBond
