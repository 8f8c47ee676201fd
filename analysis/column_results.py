"""Read results of the first version, which store values by column."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from analysis.case_columns import COLUMN_DIGITS, UNITS, quantities_by_column
from analysis.case_result import CaseResult
from analysis.quantities import QUANTITIES
from analysis.typed_json import fields_of
from analysis.value import estimate

COLUMN_FIELDS = {"value": float, "error": float, "common": float}
"""Fields of a value in a file of the first version."""


def add_columns(result: CaseResult, values: Mapping[str, Any]) -> None:
    """Add the values of a file that stores them by column, converted to SI units.

    If all columns are names of quantities, they are in SI units already. Columns of quantities that
    are no longer measured have their unit in the name, or keep their name without a unit.
    """
    result.paper_columns = not all(name in QUANTITIES for name in values)
    quantities = quantities_by_column()
    for column, cell in values.items():
        numbers = fields_of(cell, COLUMN_FIELDS, {"value", "error"}, f"values.{column}")
        if not result.paper_columns:
            name = column
            unit = QUANTITIES[column].unit
            factor = 1.0
        elif column in quantities:
            name, unit, factor = quantities[column]
        else:
            name, unit, factor = _split_column(column)
        in_si = {key: _divided(number, factor) for key, number in numbers.items()}
        result.values[name] = replace(
            estimate(in_si["value"], in_si["error"], in_si.get("common", 0.0)), unit=unit
        )


def _split_column(column: str) -> tuple[str, str, float]:
    """Return quantity, unit and factor of a column by its ending; an unknown ending has no unit."""
    for unit, (ending, factor) in UNITS.items():
        if ending and column.endswith(ending):
            return column.removesuffix(ending), unit, factor
    return column, "", 1.0


def _divided(number: float, factor: float) -> float:
    """Return a number divided by the factor of its unit, to `COLUMN_DIGITS` digits."""
    if factor == 1:
        return number
    return float(f"{number / factor:.{COLUMN_DIGITS}g}")
