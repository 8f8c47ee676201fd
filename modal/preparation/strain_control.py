"""Control the strain rates of a packing: constant, or by a servo on its principal stresses."""

import math
from collections.abc import Sequence

import numpy as np

from modal.packing.contact_law import GLASS, RADIUS, Material
from modal.preparation.durations import REFERENCE_PRESSURE, inertial_time
from modal.tools.arrays import Floats

INERTIAL_NUMBER = 0.01
"""Largest strain rate of the servo multiplied by the inertial time."""
RATE_GROWTH = 1.1
"""Factor of the servo's strain rate at each setting before the target stress is reached."""
RATE_REVERSAL = 0.5
"""Factor of the servo's strain rate when its stress crosses the target."""
FIRST_RATE_RATIO = 1e-3
"""First strain rate of the servo divided by its limit."""


class ConstantRate:
    """Isotropic compression at a constant rate, 1/s.

    Attributes
    ----------
    stress : ndarray (3,)
        Principal stresses of the last measurement, Pa.
    target : float
        Stress, Pa, for which time steps and intervals are computed.
    """

    def __init__(self, rate: float, target: float = REFERENCE_PRESSURE) -> None:
        self.rate = float(rate)
        self.target = target
        self.stress: Floats = np.zeros(3)

    def follow(self, stress: Floats) -> Floats:
        """Store the principal stresses (3,), Pa, and return the strain rates (3,), 1/s."""
        self.stress = stress
        return np.full(3, -self.rate)

    def error(self) -> float:
        """Return infinity as the error of the stress: a constant rate has no target."""
        return math.inf


class Servo:
    """Control that drives three principal stresses to their targets at limited strain rates.

    No stiffness is assumed, because the stiffness of a packing falls by orders of magnitude when
    its contacts open. Each strain rate grows until its stress crosses the target; then it changes
    sign and is halved.

    Parameters
    ----------
    target : float
        Isotropic stress, Pa.
    inertial_number : float
        Largest strain rate multiplied by the inertial time at `target`.
    radius : float
        Radius of the spheres, m.
    material : Material
        Material of the spheres.
    shares : sequence of 3 float
        Stress of each axis divided by `target`; an axis whose share is NaN is not strained.
    """

    def __init__(
        self,
        target: float,
        inertial_number: float,
        radius: float = RADIUS,
        material: Material = GLASS,
        shares: Sequence[float] = (1.0, 1.0, 1.0),
    ) -> None:
        self.target = target
        self.targets = target * np.array(shares)
        self.limit = inertial_number / inertial_time(target, radius, material)
        self.rates = np.full(3, FIRST_RATE_RATIO * self.limit)
        self.stress: Floats = np.zeros(3)

    def follow(self, stress: Floats) -> Floats:
        """Return strain rates (3,), 1/s, at principal stresses (3,), Pa, compression positive."""
        self.stress = stress
        outward = np.where(stress > self.targets, 1.0, -1.0)
        factor = np.where(outward * self.rates < 0, RATE_REVERSAL, RATE_GROWTH)
        self.rates = outward * np.minimum(factor * np.abs(self.rates), self.limit)
        self.rates[np.isnan(self.targets)] = 0.0
        return self.rates

    def error(self) -> float:
        """Return the largest relative deviation of a principal stress from its target."""
        return float(np.nanmax(abs(self.stress / self.targets - 1)))
