"""Measure, compare and draw packings and waves from files of networks, signals and modes."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from analysis.bench import transducers as transducers
    from analysis.estimators.arrival_rules import travel_time as travel_time
    from analysis.measurement import measure as measure

_MODULES = {
    "measure": "analysis.measurement",
    "transducers": "analysis.bench",
    "travel_time": "analysis.estimators.arrival_rules",
}
"""Module of each public name, as in the imports above."""
__all__ = [*_MODULES]

if not TYPE_CHECKING:  # what a command does not use is not loaded

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"module 'analysis' has no attribute {name!r}")
        return getattr(importlib.import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
