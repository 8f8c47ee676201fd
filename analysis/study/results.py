"""The result of a case, one small JSON file: all that tables, targets and figures read of it.

A result is written once, when a case is measured; whatever is made of several cases is made of
these files alone, so that a clone of the project makes it in seconds, without any product.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.frame import of_one_producer
from analysis.rows import OF_RECORD, Row
from analysis.value import estimate, plain
from modal.formats.hdf5 import write_text
from modal.tools.errors import InputError

SCHEMA, VERSION = "case_result", 1
DIGITS, OF_CURVES = 12, 6
"""Significant digits that a result keeps of a number, and of those of a curve."""


def write_result(path: Path, row: Row) -> None:
    """Write the result of a case, what is empty left out; numbers that are not known are null."""
    found = {"schema": SCHEMA, "version": VERSION} | asdict(replace(row, values={}))
    found["values"] = {n: {"value": v.value, "error": v.error} for n, v in row.values.items()}
    found["curves"] = plain(found["curves"], OF_CURVES)
    lines = [
        f"{json.dumps(name)}: {json.dumps(plain(value, DIGITS))}"
        for name, value in found.items()
        if value not in ({}, [])
    ]
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")


def read_result(path: str | Path) -> Row:
    """A result; InputError where the file is none."""
    try:
        found = _numbers(json.loads(Path(path).read_text()))
        if (found["schema"], found["version"]) != (SCHEMA, VERSION):
            raise ValueError(f"schema {found['schema']}, version {found['version']}")
        row = Row(**{name: own for name, own in found.items() if name not in ("schema", "version")})
        row.values = {name: estimate(**cell) for name, cell in found["values"].items()}
        row.curves = {n: tuple(np.array(v, float) for v in c) for n, c in row.curves.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: no result of a case ({error}); measure the case again") from None
    return row


def read_results(folder: Path) -> list[Row]:
    """All results in a folder, with the scatter of each case over those of other seeds.

    Other seeds have folders `seed_*` of their own in it. A result that states its scatter keeps it
    where no other seed is at hand.
    """
    rows = [read_result(path) for path in sorted(folder.glob("*.json"))]
    others = [read_result(path) for path in sorted(folder.glob("seed_*/*.json"))]
    for row in rows:
        if twins := [other for other in others if other.name == row.name]:
            row.samples, row.packings = scatter_of_samples([row, *twins]), 1 + len(twins)
    return rows


def _numbers(value: Any) -> Any:
    """What `plain` has made None is NaN again."""
    if isinstance(value, dict):
        return {name: _numbers(cell) for name, cell in value.items()}
    if isinstance(value, list):
        return [_numbers(cell) for cell in value]
    return np.nan if value is None else value


def scatter_of_samples(several: Sequence[Row]) -> dict[str, float]:
    """Standard deviation of each number of the first over several packings of a case.

    The numbers of its record are compared by one producer. Empty without another packing.
    """
    found = {}
    for name in several[0].values:
        records = (one.record for one in several)
        _, column = of_one_producer(records, OF_RECORD.get(name, name))
        deviation = pd.Series([one.value(column) for one in several]).std()
        if np.isfinite(deviation):
            found[name] = float(deviation)
    return found
