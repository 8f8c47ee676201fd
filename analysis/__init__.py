"""Measure, compare, draw: reads network, signal and mode files and says whether they agree."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from analysis.measurement import measure

__all__ = ["measure"]

if not TYPE_CHECKING:  # what a command does not use is not loaded

    def __getattr__(name: str) -> Any:
        if name != "measure":
            raise AttributeError(f"module 'analysis' has no attribute {name!r}")
        from analysis.measurement import measure

        return measure
