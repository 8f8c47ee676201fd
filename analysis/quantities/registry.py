"""The list of quantities: name, unit, definition and the function that measures it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from analysis.measuring import Measuring
from analysis.value import Value, unknown
from modal.tools.errors import InputError

QUANTITIES: dict[str, Quantity] = {}
"""All quantities by name, in the order in which they are shown."""
QUICK = (
    *("void_ratio", "coordination", "crystalline_share"),
    *("v_p", "v_s", "low_pass", "highest_frequency"),
)
"""Those that take a wave or less, of 35,201 spheres half a minute together."""


@dataclass(frozen=True)
class Quantity:
    """`of` measures it; `unit` is SI, "1" for a number; `definition` says what it is."""

    name: str
    unit: str
    definition: str
    of: Callable[[Measuring], Value]

    def measured(self, packing: Measuring) -> Value:
        """Its value; where it cannot be had, no number but the reason."""
        try:
            return self.of(packing)
        except InputError as error:
            return unknown(self.unit, str(error))


def quantity(
    name: str, unit: str, definition: str
) -> Callable[[Callable[[Measuring], Value]], Callable[[Measuring], Value]]:
    """Register a function as the one that measures a quantity."""

    def register(of: Callable[[Measuring], Value]) -> Callable[[Measuring], Value]:
        QUANTITIES[name] = Quantity(name, unit, definition, of)
        return of

    return register
