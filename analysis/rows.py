"""Hold what has been measured of a case, and write and read its result.

A `CaseResult` holds values with their errors, and curves, but none of the case's files: a whole
study fits into memory, and its cases are measured side by side. One small JSON file per case, its
result, is written when the case is measured; whatever is made of several cases is made of these
files alone, so that a clone of the project makes it in seconds, without any product.

Values are those of `measure`, in SI units. Tables and studies see them as columns, whose names and
units are those of the paper's tables (`CaseResult.columns`).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final, NamedTuple, get_type_hints

import numpy as np
import pandas as pd

from analysis.explanation import ERROR_PARTS
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities import QUANTITIES, gain, records, spectrum
from analysis.quantities.records import LOW_PASS, PERCENT
from analysis.quantities.scattering import whole_ridge
from analysis.quantities.velocity import longest
from analysis.typed_json import MismatchError, fields_of, parsed, read_text
from analysis.value import Value, estimate, value_of_json
from modal.formats.whole_file import write_text
from modal.tools.display import plain
from modal.tools.errors import InputError

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
COLUMN_UNITS: Final[Mapping[str, str]] = {
    "_m_per_s": "m/s",
    "_khz": "kHz",
    "_hz": "Hz",
    "_mpa": "MPa",
}
"""Unit of a column by the ending of its name."""
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
PRODUCER_NAMES = {"yade": "YADE", "linear": "linear"}
SCHEMA = "case_result"
VERSION = 2
COLUMN_VERSION = 1
"""Version of result files that have values by column and without units; such files can still be
read."""
DIGITS = 12
"""Number of significant digits of a number in a result."""
CURVE_DIGITS = 6
"""Number of significant digits of a number of a curve in a result."""
COLUMN_DIGITS = 15
"""Significant digits of a number after a change of units: as many as a double holds of any decimal
number, so that a number of so many digits comes back as it was."""
FIRST_ORDERS = 5
"""Number of resonances whose heights in the gain are shown."""
MAY_LACK = "signals", "highest.modes", "modes", "density", "structure", "response"
"""Kinds of files that a case may lack."""


class Cell(NamedTuple):
    """A number of a case in a column: value, error, and the error's part common to all packings.

    All are in the unit of the column, and NaN if not known. The error of an exact number is NaN.
    """

    value: float
    error: float = np.nan
    common: float = 0.0


@dataclass
class CaseResult:
    """What has been measured of one case.

    Attributes
    ----------
    number : int or None
        Number of the case in the study; None for another packing.
    name, label : str
        Name of its files, and short name for legends.
    crystal : bool
    stress : float, Pa
    mu_comp : float
        Friction of the compression.
    record : str
        "yade", or "linear" if there is no recorded run.
    unsettled : str
        Why the packing does not count as being at rest; empty if it does.
    values : dict of str to Value
        Values in SI units by quantity. A value without unit is in that of its column, which is then
        its name.
    samples : dict of str to float
        Standard deviation over packings of other seeds, by column and in its unit.
    packings : int
        Number of these packings, this one included.
    flat : dict of str to bool
        Whether the frequency of a threshold stands on a plateau, by threshold.
    curves : dict of str to tuple of ndarray (n,)
        Arrays by name, in SI units; of a quantity over frequency: frequencies, values, errors.
    texts : dict of str to str
    absent : list of str
        Kinds of files that are not there.
    notes : list of str
    state : bool
        Whether it is a state during a compression, which is no case.
    tables : dict of str to list of lines
        Cells of text by the name of a table.
    provenance : list of lines
        A line for each file that was read.
    paper_columns : bool
        Whether columns have the names and units of the paper's tables; otherwise each has the name
        and the SI unit of its quantity.
    """

    number: int | None
    name: str
    label: str
    crystal: bool
    stress: float
    mu_comp: float
    record: str
    unsettled: str
    values: dict[str, Value] = field(default_factory=dict)
    samples: dict[str, float] = field(default_factory=dict)
    packings: int = 1
    flat: dict[str, bool] = field(default_factory=dict)
    curves: dict[str, tuple[np.ndarray, ...]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    absent: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    state: bool = False
    tables: dict[str, list[list[str]]] = field(default_factory=dict)
    provenance: list[list[str]] = field(default_factory=list)
    paper_columns: bool = True

    @classmethod
    def of(cls, packing: PackingData) -> CaseResult:
        """Return a result of a case with no values as yet."""
        friction = packing.mu_comp
        if packing.crystal:
            friction = 0.0
        record = "yade"
        if packing.yade is None:
            record = "linear"
        return cls(
            number=packing.case.number,
            name=packing.case.name,
            label=packing.label,
            crystal=packing.crystal,
            stress=packing.stress,
            mu_comp=friction,
            record=record,
            unsettled=packing.unsettled,
        )

    @property
    def columns(self) -> dict[str, Cell]:
        """Return the numbers by their column, in the column's unit."""
        cells = {}
        for name, value in self.values.items():
            column, factor = self._column(name, value.unit)
            cells[column] = _cell(value, factor, self.paper_columns)
        return cells

    def _column(self, quantity: str, unit: str) -> tuple[str, float]:
        """Return the column of a quantity, and the factor of its numbers."""
        if not unit or not self.paper_columns:
            return quantity, 1.0
        return paper_column(quantity, unit)

    def value(self, column: str) -> float:
        """Return a number by its column; NaN if it is not known."""
        cells = self.columns
        if column not in cells:
            return np.nan
        return cells[column].value

    def spread(self, column: str) -> float:
        """Return the error of a number, or its scatter over packings if that is larger.

        The scatter contains the error. NaN if neither is known.
        """
        cell = self.columns.get(column, Cell(np.nan))
        return float(np.fmax(cell.error, self.samples.get(column, np.nan)))

    @property
    def group(self) -> str:
        """Return the group whose cases figures join by lines: FCC, or a friction coefficient."""
        if self.crystal:
            return "FCC"
        return f"random, mu_comp {self.mu_comp:g}"

    def add(self, packing: PackingData, names: Iterable[str]) -> None:
        """Measure quantities by name.

        Those of S-waves and of moduli are left out if their files do not exist.
        """
        thresholds = {name: key for key, (name, _) in LOW_PASS.items()}
        recorded = {"", *packing.shear}
        for name in names:
            if name in records.OF_MODULI and not packing.case.has("moduli"):
                continue
            if records.SHEAR.get(name, "") not in recorded:
                continue
            value = QUANTITIES[name].measured(packing)
            self.values[name] = value
            if name in thresholds:
                self.flat[thresholds[name]] = value.plateau is True
            if value.known:
                continue
            column, _ = self._column(name, value.unit)
            for caveat in value.caveats:
                if caveat.code != "absent":
                    self.notes.append(f"{column}: {caveat}")


def paper_column(quantity: str, unit: str) -> tuple[str, float]:
    """Return the column of a quantity in the paper's tables, and the factor of its SI numbers.

    >>> paper_column("f_max", "Hz"), paper_column("coordination", "1")
    (('f_max_khz', 0.001), ('coordination_number', 1.0))
    """
    if quantity in COLUMNS:
        return COLUMNS[quantity]
    ending, factor = UNITS[unit]
    return quantity.replace("_of_record", "") + ending, factor


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
    if column in _quantities_by_column():
        units.add(_quantities_by_column()[column][1])
    # A study of one's own may have a list of frequencies where the paper's has their number.
    return units.pop() if len(units) == 1 else ""


def _cell(value: Value, factor: float, exact_is_blank: bool) -> Cell:
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


@cached_on_packing
def row_of(packing: PackingData) -> CaseResult:
    """Measure all that a case's products allow, each quantity once."""
    case = packing.case
    row = CaseResult.of(packing)
    row.add(packing, records.OF_CASE)
    for percent in PERCENT:
        row.flat[percent] = row.flat[f"{percent}_{row.record}"]
    for name, source in RECORD_COPIES.items():
        row.values[name] = row.values[source.format(record=row.record)]
    row.texts["gain_height"] = gain.height(packing)
    above = records.HIGH * spectrum.f_max(packing)
    row.texts["chi_z_high"] = spectrum.largest_chi(packing, above, np.inf)[1]
    _add_curves(packing, row)
    for kind in MAY_LACK:
        needed = not packing.crystal or kind not in ("density", "structure")
        if needed and not case.has(kind):
            row.absent.append(kind)
    row.notes += case.notes
    return row


def _add_curves(packing: PackingData, row: CaseResult) -> None:
    """Add the curves that figures over several cases draw."""
    spectrum_of_gain = gain.gain_of(packing)
    row.curves["gain"] = (spectrum_of_gain.frequency, spectrum_of_gain.gain)
    for order, height in enumerate(gain.orders(packing)[:FIRST_ORDERS], 1):
        row.values[f"gain_order_{order}"] = Value(float(height), "1", {"fit": np.nan})
    row.curves["first"] = (np.array([gain.first_resonance(packing)]),)
    row.curves["resonances"] = spectrum.standing_waves(packing)
    if packing.case.has("structure"):
        frequency, width, path = whole_ridge(packing).of_waves()
        diameter_time = packing.diameter / longest(packing, "linear").value
        row.curves["ridge"] = (frequency * diameter_time, width / frequency, path)


def of_one_producer(records: Iterable[str], *columns: str) -> tuple[str, ...]:
    """Return the program whose records are compared, and the columns of this program.

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


def write_result(path: Path, row: CaseResult) -> None:
    """Write the result of a case; empty fields are left out, unknown numbers are null."""
    contents = {"schema": SCHEMA, "version": VERSION, **asdict(replace(row, values={}))}
    contents["values"] = {name: value.as_json() for name, value in row.values.items()}
    contents["curves"] = plain(contents["curves"], CURVE_DIGITS)
    lines = []
    for name, value in contents.items():
        if value not in ({}, []):
            lines.append(f"{json.dumps(name)}: {json.dumps(plain(value, DIGITS))}")
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")


def read_result(path: str | Path) -> CaseResult:
    """Read a result, of this or of the first version; InputError if the file is no result."""
    text = read_text(path)
    try:
        return _parse(parsed(text))
    except MismatchError as error:
        problem = f"{path}: no result of a case"
        raise InputError("result", problem, str(error), "measure the case again") from None


CURVES = {"gain": 2, "first": 1, "resonances": 2, "ridge": 3}
"""Number of arrays of each curve that figures take apart; other curves may have any number."""
CURVES_OF_GAIN = ("first", "resonances")
"""Curves that are needed to draw a figure of the gain."""
COLUMN_FIELDS = {"value": float, "error": float, "common": float}
"""Fields of a value in files of version `COLUMN_VERSION`."""
VALUE_FIELDS = {
    "value": float,
    "error": float,
    "unit": str,
    "parts": dict[str, float],
    "caveats": list[str],
    "codes": list[str],
    "scatter": float,
    "plateau": bool,
}
"""Fields of a value, as `Value.as_json` has them; the error follows from its parts."""


def _parse(contents: Any) -> CaseResult:
    """Return the result that a file's JSON has; raise `MismatchError` if it has none."""
    kinds = get_type_hints(CaseResult) | {"schema": str, "version": int, "values": dict[str, Any]}
    required = {"schema", "version"}
    for each in fields(CaseResult):
        if each.default is MISSING and each.default_factory is MISSING:
            required.add(each.name)
    entries = fields_of(contents, kinds, required, "")
    schema = entries.pop("schema")
    version = entries.pop("version")
    if schema != SCHEMA or version not in (COLUMN_VERSION, VERSION):
        raise MismatchError(f"it is not of schema {SCHEMA}, version {VERSION} or {COLUMN_VERSION}")
    values = entries.pop("values", {})
    row = CaseResult(**entries)
    if version == COLUMN_VERSION:
        _add_columns(row, values)
    else:
        for name, cell in values.items():
            row.values[name] = _parse_value(cell, f"values.{name}")
    _check(row)
    return row


def _parse_value(cell: Any, place: str) -> Value:
    """Return a value in SI units from the JSON of a result; `place` names it in errors."""
    numbers = fields_of(cell, VALUE_FIELDS, {"value", "unit", "parts"}, place)
    if numbers["unit"] not in ("", *UNITS):
        raise MismatchError(f"{place}.unit is {numbers['unit']!r}")
    for name in numbers["parts"].keys() - ERROR_PARTS.keys():
        raise MismatchError(f"{place}.parts.{name} is unknown")
    if len(numbers.get("codes", [])) != len(numbers.get("caveats", [])):
        raise MismatchError(f"{place}.codes are not as many as its caveats")
    return value_of_json(numbers)


def _add_columns(row: CaseResult, values: Mapping[str, Any]) -> None:
    """Add the values of a file that has them by column, in SI units.

    If all columns are names of quantities, they are in SI units already. Columns of quantities that
    are no longer measured have their unit in the name, or keep their name without a unit.
    """
    row.paper_columns = not all(name in QUANTITIES for name in values)
    quantities = _quantities_by_column()
    for column, cell in values.items():
        numbers = fields_of(cell, COLUMN_FIELDS, {"value", "error"}, f"values.{column}")
        if not row.paper_columns:
            name, unit, factor = column, QUANTITIES[column].unit, 1.0
        elif column in quantities:
            name, unit, factor = quantities[column]
        else:
            name, unit, factor = _split_column(column)
        in_si = {key: _divided(number, factor) for key, number in numbers.items()}
        row.values[name] = replace(estimate(**in_si), unit=unit)


def _quantities_by_column() -> dict[str, tuple[str, str, float]]:
    """Return name, unit and factor of the quantities of a case by their column."""
    names = {name: name for name in records.OF_CASE}
    names |= {name: source.format(record="linear") for name, source in RECORD_COPIES.items()}
    quantities = {}
    for name, registered in names.items():
        unit = QUANTITIES[registered].unit
        column, factor = paper_column(name, unit)
        quantities[column] = (name, unit, factor)
    for order in range(1, FIRST_ORDERS + 1):
        quantities[f"gain_order_{order}"] = (f"gain_order_{order}", "1", 1.0)
    return quantities


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


def _check(row: CaseResult) -> None:
    """Raise `MismatchError` if a result contradicts itself."""
    if not row.name:
        raise MismatchError(f"name {row.name!r} names no case")
    if row.record not in PRODUCER_NAMES and not row.state:
        raise MismatchError(f"record is {row.record!r}")
    if row.packings < 1:
        raise MismatchError("packings is below 1")
    for name, curve in row.curves.items():
        count = CURVES.get(name, max(1, len(curve)))
        lengths = {len(array) for array in curve}
        if len(curve) != count or len(lengths) != 1:
            raise MismatchError(f"curves.{name} is no curve")
    if "first" in row.curves and len(row.curves["first"][0]) == 0:
        raise MismatchError("curves.first is empty")
    if "gain" in row.curves and not all(name in row.curves for name in CURVES_OF_GAIN):
        raise MismatchError("curves.gain is there without first and resonances")
    for name, lines in row.tables.items():
        if len({len(line) for line in lines}) != 1:
            raise MismatchError(f"tables.{name} has lines of several lengths")
        if not lines[0]:
            raise MismatchError(f"tables.{name} is empty")
    if any(len(line) != 4 for line in row.provenance):
        raise MismatchError("provenance is no table of 4 columns")


def read_results(folder: Path) -> list[CaseResult]:
    """Read all results in a folder, with the scatter of each case over those of other seeds.

    The results of other seeds lie in subfolders `seed_*`. A result that states its scatter keeps it
    if there is no other seed. Raises InputError for a file that is no result, and for two results
    of one case.
    """
    rows = [read_result(path) for path in sorted(folder.glob("*.json"))]
    names = [row.name for row in rows]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                "two_results", f"{folder}: two results are of {name}", remedy="keep one"
            )
    of_other_seeds = [read_result(path) for path in sorted(folder.glob("seed_*/*.json"))]
    for row in rows:
        others = [other for other in of_other_seeds if other.name == row.name]
        if others:
            row.samples = scatter_of_samples([row, *others])
            row.packings = 1 + len(others)
    return rows


def scatter_of_samples(packings: Sequence[CaseResult]) -> dict[str, float]:
    """Compute the standard deviation of each column of the first packing over all packings.

    The packings are those of one case, of different seeds. Quantities of records are compared by
    one program. Empty for a single packing.

    The numbers of its record are compared by one producer. Empty without another packing.
    """
    producers = [packing.record for packing in packings]
    columns = [packing.columns for packing in packings]
    scatter = {}
    for name in columns[0]:
        _, column = of_one_producer(producers, OF_RECORD.get(name, name))
        numbers = [cells[column].value if column in cells else np.nan for cells in columns]
        deviation = pd.Series(numbers).std()
        if np.isfinite(deviation):
            scatter[name] = float(deviation)
    return scatter
