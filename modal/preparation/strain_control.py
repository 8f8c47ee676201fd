"""What sets the strain rates of a packing: a constant rate, or a servo on its stresses."""

import math
from collections.abc import Sequence

import numpy as np

from modal.packing.contact_law import GLASS, RADIUS, Material
from modal.preparation.durations import REFERENCE, inertial_time

INERTIAL_NUMBER = 0.01
"""Largest strain rate of the servo times the own time."""
GROWTH, TURN = 1.1, 0.5
"""Factors of the servo's strain rate at each setting: short of the target, and on crossing it."""
FIRST = 1e-3
"""The servo's first strain rate over its limit."""


class ConstantRate:
    """Isotropic compression at a constant rate, 1/s; `stress` (3,) is what was last measured."""

    def __init__(self, rate: float) -> None:
        self.rate, self.stress, self.target = float(rate), np.zeros(3), REFERENCE

    def follow(self, stress: np.ndarray) -> np.ndarray:
        """Strain rates (3,), 1/s, at the principal stresses (3,), Pa."""
        self.stress = stress
        return np.full(3, -self.rate)

    def error(self) -> float:
        """Infinite: a constant rate leads to no stress in particular."""
        return math.inf


class Servo:
    """Drives three principal stresses to their targets, Pa, within a limited strain rate.

    `target` is that of an isotropic stress; with `shares` (3,) each axis has its share of it, and
    an axis whose share is NaN is not strained at all.

    No stiffness is assumed, because that of a packing falls by orders of magnitude when it comes
    apart: each strain rate grows until its stress crosses the target, then turns round, halved.
    """

    def __init__(
        self,
        target: float,
        inertial_number: float,
        radius: float = RADIUS,
        material: Material = GLASS,
        shares: Sequence[float] = (1.0, 1.0, 1.0),
    ) -> None:
        self.target, self.targets = target, target * np.array(shares)
        self.limit = inertial_number / inertial_time(target, radius, material)
        self.rates = np.full(3, FIRST * self.limit)
        self.stress = np.zeros(3)

    def follow(self, stress: np.ndarray) -> np.ndarray:
        """Strain rates (3,), 1/s, at the principal stresses (3,), Pa, compression positive."""
        self.stress = stress
        outward = np.where(stress > self.targets, 1.0, -1.0)
        factor = np.where(outward * self.rates < 0, TURN, GROWTH)
        self.rates = outward * np.minimum(factor * np.abs(self.rates), self.limit)
        self.rates[np.isnan(self.targets)] = 0.0
        return self.rates

    def error(self) -> float:
        """Largest relative deviation of a principal stress from its target."""
        return float(np.nanmax(abs(self.stress / self.targets - 1)))
