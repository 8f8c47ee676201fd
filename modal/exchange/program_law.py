"""Laws of contact of other programs: force and stiffness of an overlap, and what shear remembers.

N = k overlap, or k sqrt(R*) overlap^(3/2) (Hertz), with R* = R_i R_j / (R_i + R_j), at a flat wall
R. The tangential stiffness is a constant, or grows with the radius a = sqrt(R* overlap) of the
circle of contact. Programs differ further in what a contact keeps of its history: the shear force
(as this project's YADE runs do), or the shear displacement, by which the force changes when the
circle grows although nothing shears; and in the lever arms of motion and torque.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modal.tools.arrays import Floats

FORCE, DISPLACEMENT, ONE_SIDED = "force", "displacement", "displacement, shrunk on unloading"
"""What a contact keeps of its shear."""
MIDDLE, RADIUS = "radius less half the overlap", "radius"
"""Lever arms."""


class Units(NamedTuple):
    """What a file's unit of length, mass and time is in SI."""

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    @property
    def force(self) -> float:
        """In newton."""
        return self.mass * self.length / self.time**2

    @property
    def stiffness(self) -> float:
        """In N/m."""
        return self.force / self.length

    @property
    def pressure(self) -> float:
        """In Pa."""
        return self.force / self.length**2

    @property
    def density(self) -> float:
        """In kg/m^3."""
        return self.mass / self.length**3


SI = Units()


@dataclass(frozen=True)
class ProgramLaw:
    """One kind of contact.

    `normal` in N/m, or in Pa with `hertz`; `tangential` in N/m, or in Pa where it grows
    (`grows`); 0 where `friction`, the coefficient, is: the limit of a shear force is 0 then, and
    no spring is left. `keeps` what of the shear is kept; `moves` and `turns` the lever arms of
    motion and of torque.
    """

    normal: float
    hertz: bool
    tangential: float
    grows: bool
    friction: float
    keeps: str = FORCE
    moves: str = MIDDLE
    turns: str = MIDDLE

    def __post_init__(self) -> None:
        if self.friction == 0:
            object.__setattr__(self, "tangential", 0.0)

    def force(self, overlap: Floats, effective_radius: Floats) -> Floats:
        """Shape (m,), N: the elastic normal force; 0 where nothing touches."""
        deep = np.maximum(overlap, 0)
        root = np.sqrt(effective_radius * deep) if self.hertz else 1.0
        force: Floats = self.normal * root * deep
        return force

    def overlap(self, force: Floats, effective_radius: Floats) -> Floats:
        """Shape (m,), m: the inverse of `force`."""
        push = np.maximum(force, 0) / self.normal
        overlap: Floats = (push / np.sqrt(effective_radius)) ** (2 / 3) if self.hertz else push
        return overlap

    def stiffnesses(self, overlap: Floats, effective_radius: Floats) -> tuple[Floats, Floats]:
        """Normal and tangential tangent stiffnesses (m,), N/m."""
        radius = np.sqrt(effective_radius * np.maximum(overlap, 0))
        along = 1.5 * self.normal * radius if self.hertz else np.full(len(radius), self.normal)
        across = self.tangential * (radius if self.grows else np.ones(len(radius)))
        return along, across
