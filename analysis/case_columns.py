"""Name the columns of a case in tables and studies, and hold their numbers.

Columns are quantities of `measure` under the names and in the units of the paper's tables: `f_max`,
Hz, is the column `f_max_khz`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

import numpy as np

from analysis.quantities import QUANTITIES
from analysis.quantities.case_quantity import CASE_QUANTITIES
from analysis.quantities.records import PERCENT
from analysis.value import Value

OF_MODULI = "bulk_modulus", "shear_modulus", "poisson", "v_p_moduli", "v_s_moduli"
"""Quantities of a case's result that need a file with moduli."""
OF_PACKING = "void_ratio", "coordination", "coordination_of_bearing", "v_p_static"
"""Quantities of a case's result that need the packing alone."""
OF_CASE = *OF_PACKING, *CASE_QUANTITIES, *OF_MODULI
"""Quantities of a case's result, as far as the files that they need exist."""
COLUMNS: Final[Mapping[str, tuple[str, float]]] = {
    "coordination": ("coordination_number", 1.0),
    "coordination_of_bearing": ("coordination_number_bearing", 1.0),
    "resonances_found": ("resonances", 1.0),
    "gain_resolution": ("gain_resolution_hz", 1.0),
    "ioffe_regel_of_ridge": ("ioffe_regel_khz", 1e-3),
    "excess_largest": ("excess_peak", 1.0),
    "excess_largest_at": ("excess_peak_khz", 1e-3),
}
"""Column and factor of the quantities whose column's name is not their name with an ending of
`UNITS`."""
UNITS: Final[Mapping[str, tuple[str, float]]] = {
    "m/s": ("_m_per_s", 1.0),
    "Hz": ("_khz", 1e-3),
    "Pa": ("_mpa", 1e-6),
    "1": ("", 1.0),
}
"""Ending of a column's name by the unit of its quantity, and the factor of its numbers."""
RECORD_COPIES: Final[Mapping[str, str]] = {
    "v_p_first_peaks_of_record": "v_p_first_peaks_{record}",
    **{f"f_low_pass_{p}_of_record": f"f_low_pass_{p}_{{record}}" for p in PERCENT},
    **{f"lambda_{p}_of_record_over_d": f"lambda_{p}_{{record}}_over_d" for p in PERCENT},
}
"""Quantities of the record that a case has, and the quantity of which each is a copy; `{record}`
stands for the program that computed the record."""
OF_RECORD: Final[Mapping[str, str]] = {
    "v_p_first_peaks_m_per_s": "v_p_first_peaks_{record}_m_per_s",
    **{f"f_low_pass_{p}_khz": f"f_low_pass_{p}_{{record}}_khz" for p in PERCENT},
    **{f"lambda_{p}_over_d": f"lambda_{p}_{{record}}_over_d" for p in PERCENT},
}
"""Columns of `RECORD_COPIES`, and the column of which each is a copy."""
COLUMN_UNITS: Final[Mapping[str, str]] = {
    "_m_per_s": "m/s",
    "_khz": "kHz",
    "_hz": "Hz",
    "_mpa": "MPa",
}
"""Unit of a column by the ending of its name."""
SHOWN_GAIN_ORDERS = 5
"""Number of resonances whose heights in the gain are shown."""
PRODUCER_NAMES = {"yade": "YADE", "linear": "linear"}
"""Names of the programs that compute records, as tables show them."""
COLUMN_DIGITS = 15
"""Significant digits of a number after a change of units: as many as a double holds of any decimal
number, so that a number of so many digits comes back as it was."""


class Cell(NamedTuple):
    """A number of a case in a column: value, error, and part of the error common to all packings.

    All are in the unit of the column, and NaN if not known. The error of an exact number is NaN.
    """

    value: float
    error: float = np.nan
    common: float = 0.0


def paper_column(quantity: str, unit: str) -> tuple[str, float]:
    """Return the column of a quantity in the paper's tables, and the factor of its SI numbers.

    >>> paper_column("f_max", "Hz"), paper_column("coordination", "1")
    (('f_max_khz', 0.001), ('coordination_number', 1.0))
    """
    if quantity in COLUMNS:
        return COLUMNS[quantity]
    ending, factor = UNITS[unit]
    return quantity.replace("_of_record", "") + ending, factor


def quantities_by_column() -> dict[str, tuple[str, str, float]]:
    """Return name, unit and factor of the quantities of a case by their column."""
    names = {name: name for name in OF_CASE}
    names |= {name: source.format(record="linear") for name, source in RECORD_COPIES.items()}
    quantities = {}
    for name, registered in names.items():
        unit = QUANTITIES[registered].unit
        column, factor = paper_column(name, unit)
        quantities[column] = (name, unit, factor)
    for order in range(1, SHOWN_GAIN_ORDERS + 1):
        quantities[f"gain_order_{order}"] = (f"gain_order_{order}", "1", 1.0)
    return quantities


def unit_of_column(column: str) -> str:
    """Return the unit of a column's numbers; empty if it is not known.

    >>> unit_of_column("f_max_khz"), unit_of_column("v_p"), unit_of_column("mine")
    ('kHz', 'm/s', '')
    """
    for ending, unit in COLUMN_UNITS.items():
        if column.endswith(ending):
            return unit
    units = set()
    if column in QUANTITIES:
        units.add(QUANTITIES[column].unit)
    quantities = quantities_by_column()
    if column in quantities:
        units.add(quantities[column][1])
    # A study of one's own may have a list of frequencies where the paper's has their number.
    return units.pop() if len(units) == 1 else ""


def cell_of_value(value: Value, factor: float, exact_is_blank: bool) -> Cell:
    """Return a value in the unit of its column.

    With `exact_is_blank`, a value that is exact has NaN as its error.
    """
    error = value.error
    if exact_is_blank and not value.parts:
        error = np.nan
    return Cell(
        _times(value.value, factor), _times(error, factor), _times(value.common_error, factor)
    )


def _times(number: float, factor: float) -> float:
    """Return a number times the factor of its unit, to `COLUMN_DIGITS` digits."""
    if factor == 1:
        return float(number)
    return float(f"{number * factor:.{COLUMN_DIGITS}g}")


def of_one_producer(records: Iterable[str], *columns: str) -> tuple[str, ...]:
    """Return the program whose records are used, and the columns of this program.

    `{record}` in the names of `columns` stands for the program.

    The program is YADE if YADE made all `records`, otherwise that of the linear wave. Numbers of
    both are never mixed, because they differ where contacts slide.

    >>> of_one_producer(["yade", "linear"], "f_low_pass_2_{record}_khz")
    ('linear', 'f_low_pass_2_linear_khz')
    """
    producer = "linear"
    if set(records) == {"yade"}:
        producer = "yade"
    return PRODUCER_NAMES[producer], *(column.replace("{record}", producer) for column in columns)
