"""List all quantities: name, unit, definition and the function that measures each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

from analysis.caveats import Caveat, refusal
from analysis.packing_data import PackingData
from analysis.quantities.few_digits import with_digits
from analysis.steps import UnreadableError
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
"""Quantities that need at most one computed wave. For 35,201 spheres they take half a minute
together."""
CODES_OF_MISTAKES = "argument", "unknown_word"
"""Codes of refusals that only a mistake in the code of a quantity can cause, not a file or a
packing."""
Function = TypeVar("Function", bound=Callable[[PackingData], Value | float])


@dataclass(frozen=True)
class Quantity:
    """A quantity that can be measured of a packing.

    Attributes
    ----------
    name : str
        The name by which it is requested, as in `measure(quantities=[name])`.
    unit : str
        SI unit of its values, "1" for a number.
    definition : str
        Definition of the quantity, in one line of help.
    measure : callable
        Function that measures it: takes a packing, returns a `Value` or a number in `unit`.
    on_request : bool
        Whether it is measured only if its name is given.
    spectrum : str
        Kind of the costly spectrum from which it is measured (`analysis.spectra_cache`), if any.
    """

    name: str
    unit: str
    definition: str
    measure: Callable[[PackingData], Value | float]
    on_request: bool = False
    spectrum: str = ""

    def measured(self, packing: PackingData) -> Value:
        """Return the value in the registered unit, or an unknown value with the reason.

        Raises
        ------
        InputError
            If a file is the reason that it cannot be measured.
        RuntimeError
            If the code of the quantity is wrong, which a user cannot correct: it returns another
            unit, or calls a function with invalid arguments.
        """
        try:
            result = self.measure(packing)
        except UnreadableError as error:
            return unknown(self.unit, refusal(error), steps=error.steps)
        except UnavailableError as error:
            return unknown(self.unit, refusal(error))
        except InputError as error:
            if error.code in CODES_OF_MISTAKES:
                raise RuntimeError(f"{self.name}: {error}") from error
            raise
        value = self._in_registered_unit(result)
        caveats = value.caveats
        if not value.known and not caveats:
            caveats = (Caveat("absent"),)
        caveats += _caveats_of_density(packing.network)
        if self.spectrum in packing.not_kept:
            caveats += (packing.not_kept[self.spectrum],)
        value = replace(value, caveats=caveats)
        return with_digits(value, packing.network, self.name, self.unit)

    def _in_registered_unit(self, result: Value | float) -> Value:
        """Return a result as a `Value`; a number without unit is in the registered one."""
        if not isinstance(result, Value):
            result = estimate(result)
        if result.unit == "":
            return replace(result, unit=self.unit)
        if result.unit != self.unit:
            raise RuntimeError(
                f"{self.name}: measured in {result.unit!r}, but registered in {self.unit!r}"
            )
        return result


def _caveats_of_density(network: Network) -> tuple[Caveat, ...]:
    """Return a caveat if no solid has the density of the spheres in SI units."""
    density = median_density(network)
    if is_of_a_solid(density):
        return ()
    return (Caveat("no_solid", {"density": density}),)


def quantity(
    unit: str, *, definition: str, name: str = "", on_request: bool = False, spectrum: str = ""
) -> Callable[[Function], Function]:
    """Register a function that measures a quantity; use as a decorator.

    Parameters
    ----------
    unit : str
        SI unit of the values, "1" for a number.
    definition : str
        What the quantity is, in one line of help without a full stop.
    name : str, optional
        By default the name of the function.
    on_request : bool
        Whether the quantity is measured only if its name is given.
    spectrum : str, optional
        Kind of the costly spectrum from which it is measured.

    Raises
    ------
    RuntimeError
        If there is a quantity of this name already.
    """

    def register(function: Function) -> Function:
        key = name or function.__name__
        if key in QUANTITIES:
            raise RuntimeError(f"quantity {key!r} is registered already; choose another name")
        QUANTITIES[key] = Quantity(key, unit, definition, function, on_request, spectrum)
        return function

    return register


on_request = partial(quantity, on_request=True)
"""Decorator like `quantity`, for a quantity that is measured only if its name is given."""
