"""Laws of contact of other programs: force and stiffness of an overlap, and what shear remembers.

N = k overlap, or k sqrt(R*) overlap^(3/2) (Hertz), with R* = R_i R_j / (R_i + R_j), at a flat wall
R. The tangential stiffness is a constant, or grows with the radius a = sqrt(R* overlap) of the
circle of contact. Programs differ further in what a contact keeps of its history: the shear force
(as this project's YADE runs do), or the shear displacement, by which the force changes when the
circle grows although nothing shears; and in the lever arms of motion and torque. Some resist
rolling, by a spring on arcs of the radius R*, and twisting, by one on the angle, on arcs of R*, or,
as Marshall's, by half the tangential coefficient times a^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError

FORCE, DISPLACEMENT, ONE_SIDED = "force", "displacement", "displacement, shrunk on unloading"
"""What a contact keeps of its shear."""
MIDDLE, RADIUS = "radius less half the overlap", "radius"
"""Lever arms."""
AT_LIMIT = 1e-6
"""Relative: a shear force so near to friction times normal force slides."""


class Units(NamedTuple):
    """What a file's unit of length, mass and time is in SI."""

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    @classmethod
    def typed(cls, scales: Sequence[float] | None) -> Units | None:
        """Those that somebody gives as numbers; InputError where no unit can have them."""
        if scales is None:
            return None
        if np.shape(scales) != (3,) or not all(0 < scale < np.inf for scale in scales):
            raise InputError("input", "--scales", remedy="give three positive values, in m, kg, s")
        return cls(*scales)

    @property
    def force(self) -> float:
        """In newton."""
        return self.mass * self.length / self.time**2

    @property
    def stiffness(self) -> float:
        """In N/m."""
        return self.force / self.length

    @property
    def moment(self) -> float:
        """In N m."""
        return self.force * self.length

    @property
    def pressure(self) -> float:
        """In Pa."""
        return self.force / self.length**2


SI = Units()


@dataclass(frozen=True)
class ProgramLaw:
    """One kind of contact; or, as `of_contacts` makes it, that of each contact, fields (m,).

    `normal` in N/m, or in Pa with `hertz`; `tangential` in N/m, or in Pa where it grows
    (`grows`); 0 where `friction`, the coefficient, is: the limit of a shear force is 0 then, and
    no spring is left. `keeps` what of the shear is kept; `moves` and `turns` the lever arms of
    motion and of torque. `rolling` and `twisting_arc` in N/m, of arcs of R*; `rolling_share` and
    `twisting_share` of the tangential stiffness, of such arcs, too; `twisting` in N m/rad;
    `marshall`, 1 or m, times `tangential` and a^2 is added to it.
    """

    normal: float
    hertz: bool
    tangential: float
    grows: bool
    friction: float
    keeps: str = FORCE
    moves: str = MIDDLE
    turns: str = MIDDLE
    rolling: float = 0.0
    twisting: float = 0.0
    marshall: float = 0.0
    twisting_arc: float = 0.0
    rolling_share: float = 0.0
    twisting_share: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "tangential", self.tangential * (self.friction != 0))

    def __str__(self) -> str:
        along = "Pa (Hertz)" if self.hertz else "N/m"
        across = "Pa times the circle's radius" if self.grows else "N/m"
        text = (
            f"normal {self.normal:.6g} {along}; tangential {self.tangential:.6g} {across}; "
            f"friction {self.friction:g}; keeps the shear {self.keeps}; arms: {self.moves} "
            f"(motion), {self.turns} (torque)"
        )
        arcs = "N/m on arcs of R*"
        share = "of the tangential stiffness on arcs of R*"
        turning = (
            ("rolling", self.rolling, arcs),
            ("rolling", self.rolling_share, share),
            ("twisting", self.twisting, "N m/rad"),
            ("twisting", self.twisting_arc, arcs),
            ("twisting", self.twisting_share, share),
            ("twisting", self.marshall, "of the tangential one times the circle's area / pi"),
        )
        for name, stiffness, unit in turning:
            if stiffness:
                text += f"; {name} {stiffness:.6g} {unit}"
        return text

    @classmethod
    def of_contacts(cls, kinds: Sequence[ProgramLaw], which: Ints) -> ProgramLaw:
        """The law of each contact, of these `kinds` the one with the number in `which` (m,)."""
        columns: dict[str, Any] = {
            each.name: np.array([getattr(law, each.name) for law in kinds])[which]
            for each in fields(cls)
        }
        return cls(**columns)

    def force(self, overlap: Floats, effective_radius: Floats) -> Floats:
        """Shape (m,), N: the elastic normal force; 0 where nothing touches."""
        deep = np.maximum(overlap, 0)
        root = np.where(self.hertz, np.sqrt(effective_radius * deep), 1.0)
        return self.normal * root * deep

    def overlap(self, force: Floats, effective_radius: Floats) -> Floats:
        """Shape (m,), m: the inverse of `force`."""
        push = np.maximum(force, 0) / self.normal
        return np.where(self.hertz, (push / np.sqrt(effective_radius)) ** (2 / 3), push)

    def columns(self, overlap: Floats, effective_radius: Floats) -> dict[str, Floats]:
        """What a network has of each contact (m,): its stiffnesses, and what no spring does.

        Rolling and twisting are left out where no contact resists them.
        """
        area = effective_radius * np.maximum(overlap, 0)
        circle = np.sqrt(area)
        grows = self.grows & (np.asarray(self.keeps) != FORCE)
        springs = {
            "stiffness_normal": np.where(self.hertz, 1.5 * self.normal * circle, self.normal),
            "stiffness_tangential": self.tangential * np.where(self.grows, circle, 1.0),
            "shear_growth": np.where(grows, 0.5 / overlap, 0.0),
            "motion_shortening": 0.5 * (np.asarray(self.moves) == MIDDLE),
            "torque_shortening": 0.5 * (np.asarray(self.turns) == MIDDLE),
        }
        across = springs["stiffness_tangential"]
        rolling_arc = self.rolling + self.rolling_share * across
        twisting_arc = self.twisting_arc + self.twisting_share * across
        twisting = self.twisting + self.marshall * self.tangential * area
        turning: dict[str, Floats] = {
            "stiffness_rolling": rolling_arc * effective_radius**2,
            "stiffness_twisting": twisting + twisting_arc * effective_radius**2,
        }
        resists = any(stiffness.any() for stiffness in turning.values())
        return springs | turning if resists else springs

    def slides(self, force: Floats, shear: Floats) -> Bools:
        """Shape (m,): contacts at their limit; without friction there is no spring to slip."""
        limit = self.friction * force
        return (np.linalg.norm(shear, axis=1) >= limit * (1 - AT_LIMIT)) & (limit > 0)
