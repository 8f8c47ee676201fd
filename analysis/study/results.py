"""The result of a case, one small JSON file: all that tables, targets and figures read of it.

A result is written once, when a case is measured; whatever is made of several cases is made of
these files alone, so that a clone of the project makes it in seconds, without any product.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.rows import Row
from analysis.value import estimate, plain
from modal.formats.hdf5 import write_text
from modal.tools.errors import InputError

SCHEMA, VERSION = "case_result", 1
DIGITS, OF_CURVES = 12, 6
"""Significant digits that a result keeps of a number, and of those of a curve."""


def write_result(path: Path, row: Row) -> None:
    """Write the result of a case; numbers that are not known are null."""
    found = {"schema": SCHEMA, "version": VERSION} | asdict(replace(row, values={}))
    found["values"] = {n: {"value": v.value, "error": v.error} for n, v in row.values.items()}
    del found["stated"]
    found["curves"] = plain(found["curves"], OF_CURVES)
    lines = (
        f"{json.dumps(name)}: {json.dumps(plain(value, DIGITS))}" for name, value in found.items()
    )
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")


def read_result(path: str | Path) -> Row:
    """A result; InputError where the file is none."""
    try:
        found = json.loads(Path(path).read_text())
        if (found.pop("schema"), found.pop("version")) != (SCHEMA, VERSION):
            raise KeyError("schema, version")
        known = {field.name for field in fields(Row)}
        row = Row(**{name: _numbers(value) for name, value in found.items() if name in known})
        cells: dict[str, Any] = dict(row.values)
        row.values = {name: estimate(**cell) for name, cell in cells.items()}
        row.curves = {
            name: tuple(np.array(values, float) for values in arrays)
            for name, arrays in row.curves.items()
        }
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
            row.samples, row.packings = scatter_of_samples(row, twins), 1 + len(twins)
    return rows


def _numbers(value: Any) -> Any:
    """What `plain` has made None is NaN again."""
    if isinstance(value, dict):
        return {name: _numbers(cell) for name, cell in value.items()}
    if isinstance(value, list):
        return [_numbers(cell) for cell in value]
    return np.nan if value is None else value


def scatter_of_samples(row: Row, twins: Iterable[Row]) -> dict[str, float]:
    """Standard deviation of each number over the packings of a case, its own and its twins.

    The numbers of its record are compared by one producer. Empty without another packing.
    """
    several = [row, *twins]
    producer = "yade" if all(one.record == "yade" for one in several) else "linear"
    found = {}
    for name in row.values:
        column = row.of_record.get(name, name).format(producer)
        values = np.array([one.value(column) for one in several])
        known = values[np.isfinite(values)]
        if len(known) > 1:
            found[name] = float(np.std(known, ddof=1))
    return found


def frame_of(rows: Iterable[Row], cases: pd.DataFrame) -> pd.DataFrame:
    """The study's cases, one line each, with all numbers; NaN where a case has no result.

    Columns besides those of `cases` (what the study says of each): `there`; the words of its result
    (`record`, `group`, `unsettled`, ...); each quantity, `QUANTITY_error`, `QUANTITY_spread`, which
    is the scatter of samples where that is larger, and `QUANTITY_sample_error`; `plateau_NAME`. The
    numbers of states that are no cases stand beside all cases of their compression, their stress in
    the name: `void_ratio_at_1_kpa`; of the lowest also as `void_ratio_of_state`, `state_kpa`, ...
    """
    rows = list(rows)
    lines = {row.name: _line(row) for row in rows if not row.state}
    found = pd.DataFrame.from_dict(lines, orient="index")
    frame = cases.join(found.reindex(cases.index)) if len(found) else cases.assign(there=False)
    frame["there"] = frame["there"].fillna(False).astype(bool)
    frame = frame.copy()
    for state in sorted((row for row in rows if row.state), key=lambda row: -row.stress):
        same = (frame["mu_comp"] == state.mu_comp) & (frame["kind"] == "random")
        kpa = state.stress / 1e3
        found = {name: one.value for name, one in state.values.items()}
        for name, value in (found | {"unsettled": state.unsettled}).items():
            frame.loc[same, [f"{name}_at_{kpa:g}_kpa", f"{name}_of_state"]] = value
        frame.loc[same, "state_kpa"] = kpa
    return frame


def _line(row: Row) -> dict[str, Any]:
    """A result as one line of the frame."""
    line: dict[str, Any] = {
        "there": True,
        **{name: getattr(row, name) for name in ("label", "record", "unsettled", "group")},
        "packings": row.packings,
        "absent": " ".join(row.absent),
        **{f"{name}_text": text for name, text in row.texts.items()},
    }
    for name, found in row.values.items():
        line |= {
            name: found.value,
            f"{name}_error": found.error,
            f"{name}_spread": row.spread(name),
        }
    line |= {f"{name}_sample_error": value for name, value in row.samples.items()}
    return line | {f"plateau_{name}": flat for name, flat in row.flat.items()}
