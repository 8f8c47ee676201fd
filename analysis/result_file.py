"""Write the result of a case as one small JSON file, and read it again, with those of other seeds.

Values are in SI units. Files of the first version, which have values by column, can still be read.
"""

from __future__ import annotations

import json
from dataclasses import MISSING, asdict, fields, replace
from pathlib import Path
from typing import Any, get_type_hints

from analysis.case_columns import PRODUCER_NAMES, UNITS
from analysis.case_result import CaseResult, scatter_of_samples
from analysis.column_results import add_columns
from analysis.explanation import ERROR_PARTS
from analysis.typed_json import MismatchError, fields_of, parsed, read_text
from analysis.value import Value, value_of_json
from modal.formats.whole_file import write_text
from modal.tools.display import plain
from modal.tools.errors import InputError

SCHEMA = "case_result"
VERSION = 2
COLUMN_VERSION = 1
"""Version of result files that have values by column and without units; such files can still be
read."""
DIGITS = 12
"""Number of significant digits of a number in a result."""
CURVE_DIGITS = 6
"""Number of significant digits of a number of a curve in a result."""
CURVES = {"gain": 2, "first": 1, "resonances": 2, "ridge": 3}
"""Number of arrays of each curve that figures take apart; other curves may have any number."""
CURVES_OF_GAIN = ("first", "resonances")
"""Curves that are needed to draw a figure of the gain."""
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


def write_result(path: Path, result: CaseResult) -> None:
    """Write the result of a case; empty fields are left out, unknown numbers are null."""
    contents = {"schema": SCHEMA, "version": VERSION, **asdict(replace(result, values={}))}
    contents["values"] = {name: value.as_json() for name, value in result.values.items()}
    contents["curves"] = plain(contents["curves"], CURVE_DIGITS)
    lines = []
    for name, value in contents.items():
        if value not in ({}, []):
            lines.append(f"{json.dumps(name)}: {json.dumps(plain(value, DIGITS))}")
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")


def read_result(path: str | Path) -> CaseResult:
    """Read a result, of this or of the first version; InputError if it is not a result."""
    text = read_text(path)
    try:
        return _parse(parsed(text))
    except MismatchError as error:
        problem = f"{path}: no result of a case"
        raise InputError("result", problem, str(error), "measure the case again") from None


def _parse(contents: Any) -> CaseResult:
    """Return the result that a file's JSON has; raise `MismatchError` if it has none."""
    kinds = get_type_hints(CaseResult) | {"schema": str, "version": int, "values": dict[str, Any]}
    required = {"schema", "version"}
    for entry in fields(CaseResult):
        if entry.default is MISSING and entry.default_factory is MISSING:
            required.add(entry.name)
    entries = fields_of(contents, kinds, required, "")
    schema = entries.pop("schema")
    version = entries.pop("version")
    if schema != SCHEMA or version not in (COLUMN_VERSION, VERSION):
        raise MismatchError(f"it is not of schema {SCHEMA}, version {VERSION} or {COLUMN_VERSION}")
    values = entries.pop("values", {})
    result = CaseResult(**entries)
    if version == COLUMN_VERSION:
        add_columns(result, values)
    else:
        for name, cell in values.items():
            result.values[name] = _parse_value(cell, f"values.{name}")
    _check(result)
    return result


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


def _check(result: CaseResult) -> None:
    """Raise `MismatchError` if a result contradicts itself."""
    if not result.name:
        raise MismatchError(f"name {result.name!r} names no case")
    if result.record not in PRODUCER_NAMES and not result.state:
        raise MismatchError(f"record is {result.record!r}")
    if result.packings < 1:
        raise MismatchError("packings is below 1")
    for name, curve in result.curves.items():
        count = CURVES.get(name, max(1, len(curve)))
        lengths = {len(array) for array in curve}
        if len(curve) != count or len(lengths) != 1:
            raise MismatchError(f"curves.{name} is no curve")
    if "first" in result.curves and len(result.curves["first"][0]) != 1:
        raise MismatchError("curves.first is not one frequency")
    if "gain" in result.curves and not all(name in result.curves for name in CURVES_OF_GAIN):
        raise MismatchError("curves.gain is there without first and resonances")
    for name, lines in result.tables.items():
        if len({len(line) for line in lines}) != 1:
            raise MismatchError(f"tables.{name} has lines of several lengths")
        if not lines[0]:
            raise MismatchError(f"tables.{name} is empty")
    if any(len(line) != 4 for line in result.provenance):
        raise MismatchError("provenance is no table of 4 columns")


def read_results(folder: Path) -> list[CaseResult]:
    """Read all results in a folder, with the scatter of each case over those of other seeds.

    The results of other seeds lie in subfolders `seed_*`. A result that states its scatter keeps it
    if there is no other seed. Raises InputError for a file that is not a result, and for two
    results of the same case.
    """
    results = [read_result(path) for path in sorted(folder.glob("*.json"))]
    names = [result.name for result in results]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                "two_results", f"{folder}: two results are of {name}", remedy="keep one"
            )
    results_of_other_seeds = [read_result(path) for path in sorted(folder.glob("seed_*/*.json"))]
    for result in results:
        others = [other for other in results_of_other_seeds if other.name == result.name]
        if others:
            result.samples = scatter_of_samples([result, *others])
            result.packings = 1 + len(others)
    return results
