"""Model contacts of soft adhesive spheres, which attract each other across a gap, too.

K. L. Johnson, K. Kendall, A. D. Roberts, Proc. R. Soc. Lond. A 324, 301 (1971). With the work of
adhesion w the contact has a circle of radius a also without load:

    overlap  a^2 / R* - sqrt(2 pi w a / E*)
    force    4/3 E* a^3 / R* - sqrt(8 pi w E* a^3)

The contact forms at touch (overlap 0) and bears tension up to 3/2 pi w R*. It breaks at a negative
overlap, where the two solutions for a become one. Beyond the largest tension kn is negative. In
units of the radius L at touch, L^3 = 2 pi w R*^2 / E*, y = sqrt(a / L) is the larger root of y^4 -
y = overlap R* / L^2, which has a closed form.

Without slip kt = 8 G* a. The friction limit is proportional to the force plus twice the largest
tension (C. Thornton, J. Phys. D 24, 1942, 1991).

LAMMPS's `granular jkr`, whose cohesion is w / 2, has the same force and limit of friction, but its
contacts break at the overlap of the largest tension, as under a given force. Here contacts act up
to the longest gap, as under a given displacement.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from modal.packing.adhesion import read_work_of_adhesion

DEEPEST_GAP = 0.75 * 0.25 ** (1 / 3)
"""Gap at which the contact breaks, in units of L^2 / R*: y^4 - y is least at y^3 = 1/4."""
ENERGY_AT_TOUCH = 8 / 15 - 4 / 3 + 1 / 2
"""Integral of the force at y = 1, in units of 2 pi w L^2."""


def radius_at_touch(young: Any, work: Any, radius: Any) -> Any:
    """Return the radius L of the circle of contact at touch, m."""
    return np.cbrt(2 * np.pi * work * radius * radius / young)


def reduced_radius(depth: Any) -> Any:
    """Return the larger root y of y^4 - y = depth, by Ferrari's method.

    The quartic is the product (y^2 + p y + s)(y^2 - p y + t), where u = p^2 is the real root of
    u^3 + 4 depth u - 1. Cardano's two cube roots are added without cancellation.
    """
    discriminant = np.maximum(0.25 + 64 / 27 * depth * depth * depth, 0.0)
    larger = np.cbrt(0.5 + np.sqrt(discriminant))
    product = -4 / 3 * depth
    smaller = product / larger
    u = 1 / (larger * larger - product + smaller * smaller)
    p = np.sqrt(u)
    return 0.5 * (p + np.sqrt(np.maximum(2 / p - u, 0.0)))


def solve_contact(young: Any, work: Any, overlap: Any, radius: Any) -> Any:
    """Return the reduced radius y = sqrt(a / L), and the radius at touch L, m."""
    at_touch = radius_at_touch(young, work, radius)
    return reduced_radius(overlap * radius / (at_touch * at_touch)), at_touch


def contact_radius(young: Any, work: Any, overlap: Any, radius: Any) -> Any:
    """Return the radius a = L y^2 of the circle of contact, m."""
    y, at_touch = solve_contact(young, work, overlap, radius)
    return at_touch * y * y


def relative_growth(young: Any, work: Any, overlap: Any, radius: Any) -> Any:
    """Return the derivative of a by the overlap, divided by a, 1/m."""
    y, at_touch = solve_contact(young, work, overlap, radius)
    return 2 * radius / (at_touch * at_touch * y * (4 * y * y * y - 1))


def adhesive_force(young: Any, work: Any, overlap: Any, radius: Any) -> Any:
    """Return the force 2 pi w R* (4/3 y^6 - 2 y^3), N."""
    y, _ = solve_contact(young, work, overlap, radius)
    cube = y * y * y
    return 2 * np.pi * work * radius * (4 / 3 * cube * cube - 2 * cube)


class Jkr(NamedTuple):
    """A JKR contact, or many: E* and G*, Pa, and the work of adhesion w, J/m^2; numbers or (m,)."""

    effective_young: Any
    effective_shear: Any
    work_of_adhesion: Any

    @staticmethod
    def own_numbers(numbers: Sequence[float], wall: bool) -> tuple[float]:
        """Return the work of adhesion, J/m^2, as `read_work_of_adhesion` does."""
        return (read_work_of_adhesion("jkr", numbers, wall),)

    def rupture_distance(self, radius: Any) -> Any:
        """Return the gap, m, at which a contact breaks."""
        at_touch = radius_at_touch(self.effective_young, self.work_of_adhesion, radius)
        return DEEPEST_GAP * at_touch * at_touch / radius

    def normal_force(self, overlap: Any, radius: Any) -> Any:
        """Return the force, N, on the branch that is stable at a given overlap."""
        return adhesive_force(self.effective_young, self.work_of_adhesion, overlap, radius)

    def friction_force(self, overlap: Any, radius: Any) -> Any:
        """Return the force plus twice the largest tension, 3 pi w R*, in N."""
        force = adhesive_force(self.effective_young, self.work_of_adhesion, overlap, radius)
        return force + 3 * np.pi * self.work_of_adhesion * radius

    def elastic_energy(self, overlap: Any, radius: Any) -> Any:
        """Return the integral of the force from touch on, J."""
        y, at_touch = solve_contact(self.effective_young, self.work_of_adhesion, overlap, radius)
        y4 = y * y * y * y
        y7 = y4 * y * y * y
        integral = 8 / 15 * y7 * y * y * y - 4 / 3 * y7 + 0.5 * y4 - ENERGY_AT_TOUCH
        return 2 * np.pi * self.work_of_adhesion * at_touch * at_touch * integral

    def stiffness_normal(self, overlap: Any, radius: Any) -> Any:
        """Return kn = 2 E* a (4 y^3 - 3) / (4 y^3 - 1), N/m; the module explains a and y."""
        y, at_touch = solve_contact(self.effective_young, self.work_of_adhesion, overlap, radius)
        cube = 4 * y * y * y
        return 2 * self.effective_young * at_touch * y * y * (cube - 3) / (cube - 1)

    def stiffness_tangential(self, overlap: Any, radius: Any) -> Any:
        """Return kt = 8 G* a, N/m, with the radius a of the circle of contact."""
        y, at_touch = solve_contact(self.effective_young, self.work_of_adhesion, overlap, radius)
        return 8 * self.effective_shear * at_touch * y * y

    def overlap_of_force(self, force: Any, radius: Any) -> Any:
        """Return the overlap, m, of a force >= -3/2 pi w R*, N; y^3 solves a quadratic equation."""
        at_touch = radius_at_touch(self.effective_young, self.work_of_adhesion, radius)
        load = force / (2 * np.pi * self.work_of_adhesion * radius)
        y = np.cbrt(0.75 * (1 + np.sqrt(1 + 4 / 3 * load)))
        return at_touch * at_touch / radius * (y * y * y * y - y)


LAW = Jkr
