"""A measured value and its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Estimate:
    """A value and its uncertainty, in SI units; NaN where it is unknown."""

    value: float
    error: float = np.nan

    @classmethod
    def of(cls, found: float | Estimate) -> Estimate:
        """What was measured, of a bare number without an uncertainty."""
        return found if isinstance(found, Estimate) else cls(float(found))


NOTHING = Estimate(np.nan)
"""What is not known."""
