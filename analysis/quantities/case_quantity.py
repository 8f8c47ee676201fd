"""Register the quantities that are listed in the result of a study's case."""

from collections.abc import Callable
from typing import Literal, TypeVar

from analysis.packing_data import PackingData
from analysis.quantities.registry import on_request
from analysis.spectra_cache import SpectrumKind
from analysis.value import Value

Measure = Callable[[PackingData], float | Value]
Function = TypeVar("Function", bound=Measure)
CASE_QUANTITIES: list[str] = []
"""Names of the registered quantities, in the order in which results list them."""


def case_quantity(
    unit: str, definition: str, name: str = "", spectrum: SpectrumKind | Literal[""] = ""
) -> Callable[[Function], Function]:
    """Register a function as a quantity on request that is listed in a case's result."""

    def register(function: Function) -> Function:
        key = name or getattr(function, "__name__", "")
        CASE_QUANTITIES.append(key)
        return on_request(unit, name=key, definition=definition, spectrum=spectrum)(function)

    return register
