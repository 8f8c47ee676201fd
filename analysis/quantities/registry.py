"""The list of quantities: name, unit, definition and the function that measures it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

from analysis.caveats import Caveat, refusal
from analysis.measuring import Measuring
from analysis.quantities.few_digits import with_digits
from analysis.value import Value, estimate, unknown
from modal.packing.network import Network
from modal.packing.plausibility import is_of_a_solid, median_density
from modal.tools.errors import InputError, UnavailableError

QUANTITIES: dict[str, Quantity] = {}
"""All quantities by name, in the order in which they are shown."""
QUICK = (
    *("void_ratio", "coordination", "crystalline_share"),
    *("v_p", "v_s", "low_pass", "highest_frequency"),
)
"""Those that take a wave or less, of 35,201 spheres half a minute together."""
MISTAKES = "argument", "unknown_word"
"""Codes of refusals that no file and no packing cause: only the call of a quantity can."""
Of = TypeVar("Of", bound=Callable[[Measuring], Value | float])


@dataclass(frozen=True)
class Quantity:
    """`of` measures it; `unit` is SI, "1" for a number; `definition` says what it is.

    `asked` is measured on request alone.
    """

    name: str
    unit: str
    definition: str
    of: Callable[[Measuring], Value | float]
    asked: bool = False

    def measured(self, packing: Measuring) -> Value:
        """Return its value; where the packing does not have it, no number but the reason.

        Raises
        ------
        InputError
            Where the reason is a file that was given.
        RuntimeError
            For a mistake of the quantity itself, which no user can mend.
        """
        kept = len(packing.not_kept)
        try:
            found = self.of(packing)
        except UnavailableError as error:
            return unknown(self.unit, refusal(error))
        except InputError as error:
            if error.code in MISTAKES:
                raise RuntimeError(f"{self.name}: {error}") from error
            raise
        found = found if isinstance(found, Value) else estimate(found)
        caveats = found.caveats
        if not found.known and not caveats:
            caveats = (Caveat("absent"),)
        caveats = (*caveats, *_of_units(packing.network), *packing.not_kept[kept:])
        value = replace(found, unit=self.unit, caveats=caveats)
        return with_digits(value, packing.network, self.name, self.unit)


def _of_units(network: Network) -> tuple[Caveat, ...]:
    """Return what to know of every number where no solid has the spheres' density in SI."""
    density = median_density(network)
    if is_of_a_solid(density):
        return ()
    return (Caveat("no_solid", {"density": density}),)


def quantity(
    unit: str, name: str = "", definition: str = "", asked: bool = False
) -> Callable[[Of], Of]:
    """Register a function as the one that measures a quantity: a `Value`, or its number alone.

    The quantity has the function's name, and the first line of its docstring says what it is, where
    no others are given.
    """

    def register(of: Of) -> Of:
        called, said = name or of.__name__, (of.__doc__ or "").split("\n")[0].rstrip(".")
        told = definition or said[:1].lower() + said[1:]
        QUANTITIES[called] = Quantity(called, unit, told, of, asked)
        return of

    return register


on_request = partial(quantity, asked=True)
