"""Describe contact laws of other programs: force and stiffness of an overlap, memory of shear.

The normal force is N = k overlap, or k sqrt(R*) overlap^(3/2) (Hertz), with R* = R_i R_j / (R_i +
R_j), and R* = R at a flat wall. The tangential stiffness is a constant, or grows with the radius a
= sqrt(R* overlap) of the circle of contact. Programs differ in the history of shear that a contact
stores. If it stores the force, as in this project's YADE runs, the force stays constant when the
overlap changes. If it stores the displacement, the force changes with the circle of contact even
without shear. Programs also differ in the lever arms of motion and torque. Some laws resist
rolling, by a spring on arcs of the radius R*, and twisting, by a spring on the angle, on arcs of
R*, or (Marshall) by half the tangential coefficient times a^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from modal.packing.contact_models import jkr
from modal.tools.arrays import Array, Bools, Floats, Ints
from modal.tools.errors import InputError

ShearMemory = Literal["force", "displacement", "displacement, shrunk on unloading"]
"""The quantity by which a contact remembers its shear."""
LeverArm = Literal["radius less half the overlap", "radius"]
"""Distance from the centre of a sphere to the point where a contact moves or turns it."""

FORCE: ShearMemory = "force"
DISPLACEMENT: ShearMemory = "displacement"
SHRINKING_DISPLACEMENT: ShearMemory = "displacement, shrunk on unloading"
MIDDLE_ARM: LeverArm = "radius less half the overlap"
RADIUS_ARM: LeverArm = "radius"
RELATIVE_LIMIT_TOLERANCE = 1e-6
"""Relative distance from the friction limit below which a shear force counts as sliding."""


class Units(NamedTuple):
    """The SI values of a file's units of length, mass and time."""

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    @classmethod
    def from_scales(cls, scales: Sequence[float] | None) -> Units | None:
        """Return the units of three typed numbers, in m, kg, s; None if none were typed.

        Raises InputError unless there are three positive finite numbers.
        """
        if scales is None:
            return None
        if np.shape(scales) != (3,) or not all(0 < scale < np.inf for scale in scales):
            raise InputError("scales", "--scales", remedy="give three positive values, in m, kg, s")
        return cls(*scales)

    @property
    def force(self) -> float:
        """Return the unit of force in N."""
        return self.mass * self.length / self.time**2

    @property
    def stiffness(self) -> float:
        """Return the unit of stiffness in N/m."""
        return self.force / self.length

    @property
    def moment(self) -> float:
        """Return the unit of torque in N m."""
        return self.force * self.length

    @property
    def pressure(self) -> float:
        """Return the unit of pressure in Pa."""
        return self.force / self.length**2


SI = Units()


@dataclass(frozen=True)
class ProgramLaw:
    """The law of one kind of contact.

    Attributes
    ----------
    normal : float
        Normal stiffness, N/m, or 4/3 of the effective modulus, Pa, if `hertz`.
    hertz : bool
        Whether the normal force follows Hertz.
    tangential : float
        Tangential stiffness, N/m, or Pa if `grows`. It is set to 0 if `friction` is 0: the limit of
        a shear force is 0 then, and no spring is left.
    grows : bool
        Whether the tangential stiffness is `tangential` times the radius a of the circle of
        contact.
    friction : float
        Coefficient of friction.
    shear_memory : ShearMemory
        Whether a contact stores its shear force or its shear displacement.
    motion_arm, torque_arm : LeverArm
        Lever arm by which a rotation moves the contact point, and lever arm of the torque of a
        force.
    rolling, twisting_arc : float
        Stiffnesses against rolling and twisting, N/m, on arcs of the radius R*.
    rolling_share, twisting_share : float
        Stiffnesses against rolling and twisting divided by the tangential stiffness.
    cohesion : float
        Half the work of adhesion of DMT or JKR contacts, N/m. The friction limit is proportional to
        the normal force plus twice the largest pull.
    acts_across_gaps : bool
        Whether the adhesion is that of JKR, whose contacts act across gaps; otherwise that of DMT.
    twisting : float
        Stiffness against twisting, N m/rad.
    marshall : float
        Factor of Marshall's law of twisting: times `tangential` and a^2 it is a stiffness, N m/rad,
        which adds to `twisting`. It has no unit, or the unit m if the tangential stiffness is a
        constant.
    """

    normal: float
    hertz: bool
    tangential: float
    grows: bool
    friction: float
    shear_memory: ShearMemory = FORCE
    motion_arm: LeverArm = MIDDLE_ARM
    torque_arm: LeverArm = MIDDLE_ARM
    rolling: float = 0.0
    twisting: float = 0.0
    marshall: float = 0.0
    twisting_arc: float = 0.0
    rolling_share: float = 0.0
    twisting_share: float = 0.0
    cohesion: float = 0.0
    acts_across_gaps: bool = False

    def __post_init__(self) -> None:
        if self.friction == 0:
            object.__setattr__(self, "tangential", 0.0)

    def __str__(self) -> str:
        normal_unit = "Pa (Hertz)" if self.hertz else "N/m"
        tangential_unit = "Pa times the circle's radius" if self.grows else "N/m"
        text = (
            f"normal {self.normal:.6g} {normal_unit}; "
            f"tangential {self.tangential:.6g} {tangential_unit}; "
            f"friction {self.friction:g}; keeps the shear {self.shear_memory}; "
            f"arms: {self.motion_arm} (motion), {self.torque_arm} (torque)"
        )
        on_arcs = "N/m on arcs of R*"
        share = "of the tangential stiffness on arcs of R*"
        springs = (
            ("rolling", self.rolling, on_arcs),
            ("rolling", self.rolling_share, share),
            ("twisting", self.twisting, "N m/rad"),
            ("twisting", self.twisting_arc, on_arcs),
            ("twisting", self.twisting_share, share),
            ("twisting", self.marshall, "of the tangential one times the circle's area / pi"),
        )
        if self.cohesion:
            model = "JKR" if self.acts_across_gaps else "DMT"
            text += f"; {model} adhesion, cohesion {self.cohesion:.6g} N/m"
        for motion, stiffness, unit in springs:
            if stiffness:
                text += f"; {motion} {stiffness:.6g} {unit}"
        return text


@dataclass(frozen=True)
class ContactLaws:
    """The laws of m contacts: `laws`, and the index (m,) of each contact's law among them."""

    laws: Sequence[ProgramLaw]
    index: Ints

    def values(self, name: str) -> Array:
        """Return an attribute of each contact's law, shape (m,)."""
        return np.array([getattr(law, name) for law in self.laws])[self.index]

    def force(self, overlap: Floats, effective_radius: Floats) -> Floats:
        """Return the normal forces (m,), N, of elasticity and attraction.

        Only JKR contacts have a force across a gap.
        """
        depth = np.maximum(overlap, 0)
        root = np.where(self.values("hertz"), np.sqrt(effective_radius * depth), 1.0)
        attraction = np.where(overlap > 0, self.largest_pull(effective_radius), 0.0)
        force: Floats = self.values("normal") * root * depth - attraction
        rows, law = self._jkr
        force[rows] = law.normal_force(overlap[rows], effective_radius[rows])
        return force

    def largest_pull(self, effective_radius: Floats) -> Floats:
        """Return the largest pulls (m,), N: 2 pi w R* of DMT, 3/2 pi w R* of JKR, or 0."""
        factor = np.where(self.values("acts_across_gaps"), 1.5, 2.0)
        return factor * np.pi * 2 * self.values("cohesion") * effective_radius

    def overlap(self, force: Floats, effective_radius: Floats) -> Floats:
        """Return the overlaps (m,), m, that have these normal forces (m,), N.

        JKR contacts have two, of which this is the stable one under a given force.
        """
        largest_pull = self.largest_pull(effective_radius)
        elastic = np.maximum(force + largest_pull, 0)
        linear = elastic / self.values("normal")
        hertzian = (linear / np.sqrt(effective_radius)) ** (2 / 3)
        overlap: Floats = np.where(self.values("hertz"), hertzian, linear)
        rows, law = self._jkr
        reached = (elastic - largest_pull)[rows]
        overlap[rows] = law.overlap_of_force(reached, effective_radius[rows])
        return overlap

    @property
    def _jkr(self) -> tuple[Ints, jkr.Jkr]:
        """Return the indices of the JKR contacts, and their law."""
        (rows,) = np.nonzero(self.values("acts_across_gaps"))
        young = 0.75 * self.values("normal")[rows]
        shear = self.values("tangential")[rows] / 8
        return rows, jkr.Jkr(young, shear, 2 * self.values("cohesion")[rows])

    def network_columns(self, overlap: Floats, effective_radius: Floats) -> dict[str, Floats]:
        """Return the columns (m,) of a network that follow from the laws, by their names.

        These are the stiffnesses, and the terms of the law beyond springs. Stiffnesses against
        rolling and twisting are left out if no contact resists them.
        """
        area = effective_radius * np.maximum(overlap, 0)
        circle = np.sqrt(area)
        normal = self.values("normal")
        stiffness_normal = np.where(self.values("hertz"), 1.5 * normal * circle, normal)
        growth = np.divide(0.5, overlap, out=np.zeros_like(overlap), where=overlap != 0)
        rows, law = self._jkr
        geometry = law.effective_young, law.work_of_adhesion, overlap[rows], effective_radius[rows]
        stiffness_normal[rows] = law.stiffness_normal(overlap[rows], effective_radius[rows])
        circle[rows] = jkr.contact_radius(*geometry)
        growth[rows] = jkr.relative_growth(*geometry)
        area[rows] = circle[rows] ** 2
        tangential = self.values("tangential")
        grows = self.values("grows")
        growth_counts = grows & (self.values("shear_memory") != FORCE)
        tangential_stiffness = tangential * np.where(grows, circle, 1.0)
        springs = {
            "stiffness_normal": stiffness_normal,
            "stiffness_tangential": tangential_stiffness,
            "shear_growth": np.where(growth_counts, growth, 0.0),
            "motion_shortening": 0.5 * (self.values("motion_arm") == MIDDLE_ARM),
            "torque_shortening": 0.5 * (self.values("torque_arm") == MIDDLE_ARM),
        }
        rolling_arc = self.values("rolling") + self.values("rolling_share") * tangential_stiffness
        twisting_arc = (
            self.values("twisting_arc") + self.values("twisting_share") * tangential_stiffness
        )
        twisting = self.values("twisting") + self.values("marshall") * tangential * area
        turning: dict[str, Floats] = {
            "stiffness_rolling": rolling_arc * effective_radius**2,
            "stiffness_twisting": twisting + twisting_arc * effective_radius**2,
        }
        if any(stiffness.any() for stiffness in turning.values()):
            return springs | turning
        return springs

    def are_sliding(self, force: Floats, shear: Floats, effective_radius: Floats) -> Bools:
        """Tell which contacts (m,) are at their limit of friction.

        A contact without friction is not counted: it has no tangential spring. `force` (m,) and
        `shear` (m, 3) are in N.
        """
        pressed = force + 2 * self.largest_pull(effective_radius)
        limit = self.values("friction") * pressed
        size = np.linalg.norm(shear, axis=1)
        return (size >= limit * (1 - RELATIVE_LIMIT_TOLERANCE)) & (limit > 0)
