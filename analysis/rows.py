"""The numbers of a case: what tables, targets and figures over all cases are made of; its result.

A `CaseResult` holds values with their errors, and curves, but none of the case's files: a whole
study fits into memory, and its cases are measured side by side. Its one small JSON file, the
result, is written once, when a case is measured; whatever is made of several cases is made of
these files alone, so that a clone of the project makes it in seconds, without any product.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import MISSING, asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pandas as pd

from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities import QUANTITIES, gain, records, spectrum
from analysis.quantities.records import LOW_PASS, PERCENT
from analysis.quantities.scattering import whole_ridge
from analysis.quantities.velocity import longest
from analysis.typed_json import MismatchError, fields_of, parsed, read_text
from analysis.value import Value, estimate
from modal.formats.whole_file import write_text
from modal.tools.display import plain
from modal.tools.errors import InputError

COLUMNS = {
    "coordination": ("coordination_number", 1.0),
    "coordination_of_bearing": ("coordination_number_bearing", 1.0),
    "resonances_found": ("resonances", 1.0),
    "gain_resolution": ("gain_resolution_hz", 1.0),
    "ioffe_regel_of_ridge": ("ioffe_regel_khz", 1e-3),
    "excess_largest": ("excess_peak", 1.0),
    "excess_largest_at": ("excess_peak_khz", 1e-3),
}
UNITS = {"m/s": ("_m_per_s", 1.0), "Hz": ("_khz", 1e-3), "Pa": ("_mpa", 1e-6), "1": ("", 1.0)}
"""Ends of a column's name by the unit of its quantity, and the factor of its numbers."""
OF_RECORD = {"v_p_first_peaks_m_per_s": "v_p_first_peaks_{record}_m_per_s"} | {
    f"{quantity}_{percent}_{unit}": f"{quantity}_{percent}_{{record}}_{unit}"
    for percent in PERCENT
    for quantity, unit in (("f_low_pass", "khz"), ("lambda", "over_d"))
}
"""Columns that a case has of its record, and the same with `{record}` for its producer."""
PRODUCERS = {"yade": "YADE", "linear": "linear"}
SCHEMA, VERSION = "case_result", 1
DIGITS, OF_CURVES = 12, 6
"""Significant digits that a result keeps of a number, and of those of a curve."""
MAY_LACK = "signals", "highest.modes", "modes", "density", "structure", "response"


@dataclass
class CaseResult:
    """One case: number of the study (None for another packing), name, what it is, its numbers.

    `stress` Pa and `mu_comp` of the compression; `record` is `yade`, or `linear` where no run is
    there; `values` by their column in table1.csv, with the error of the estimator and of the choice
    of the chain; `samples` their scatter over packings of other seeds, `packings` how many these
    are with its own; `flat` says of thresholds whether they stand on a plateau; `curves` are arrays
    by name; `absent` says which products are not there; `state` is one that is no case; `tables`
    are cells of text by name; `provenance` has a line for each file that was read.
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

    @classmethod
    def of(cls, m: PackingData) -> CaseResult:
        """Of a case of which nothing has been measured."""
        mu = 0.0 if m.crystal else m.mu_comp
        about = m.case.number, m.case.name, m.label, m.crystal, m.stress, mu
        return cls(*about, "linear" if m.yade is None else "yade", m.unsettled)

    def value(self, name: str) -> float:
        """A number; NaN where it is not known."""
        return self.values[name].value if name in self.values else np.nan

    def spread(self, name: str) -> float:
        """Its uncertainty, or the scatter over packings where that is larger: it has both in it.

        NaN where neither is known.
        """
        error = self.values[name].error if name in self.values else np.nan
        return float(np.fmax(error, self.samples.get(name, np.nan)))

    @property
    def group(self) -> str:
        """What the paper joins by lines: FCC, or a friction."""
        return "FCC" if self.crystal else f"random, mu_comp {self.mu_comp:g}"

    def add(self, m: PackingData, names: Iterable[str]) -> None:
        """Add quantities by name; those of S-waves and moduli where their files are there."""
        keys = {name: key for key, (name, _) in LOW_PASS.items()}
        recorded = {"", *m.shear}
        for name in names:
            without = name in records.OF_MODULI and not m.case.has("moduli")
            if without or records.SHEAR.get(name, "") not in recorded:
                continue
            value = QUANTITIES[name].measured(m)
            end, factor = UNITS[value.unit]
            column, factor = COLUMNS.get(name, (name + end, factor))
            error = factor * value.error or np.nan
            self.values[column] = estimate(factor * value.value, error, factor * value.common_error)
            if name in keys:
                self.flat[keys[name]] = value.plateau is True
            if not value.known:
                for caveat in value.caveats:
                    if caveat.code != "absent":
                        self.notes.append(f"{column}: {caveat}")


@cached_on_packing
def row_of(m: PackingData) -> CaseResult:
    """All numbers that a case's products allow, each measured once."""
    case, row = m.case, CaseResult.of(m)
    row.add(m, records.OF_CASE)
    for percent in PERCENT:
        row.flat[percent] = row.flat[f"{percent}_{row.record}"]
    row.values |= {
        name: row.values[column.format(record=row.record)] for name, column in OF_RECORD.items()
    }
    row.texts["gain_height"] = gain.height(m)
    above = records.HIGH * spectrum.f_max(m)
    row.texts["chi_z_high"] = spectrum.largest_chi(m, above, np.inf)[1]
    _curves(m, row)
    lacking = [kind for kind in MAY_LACK if not case.has(kind)]
    row.absent = [k for k in lacking if not (m.crystal and k in ("density", "structure"))]
    row.notes += case.notes
    return row


def _curves(m: PackingData, row: CaseResult) -> None:
    """What figures over several cases draw."""
    row.curves["gain"] = (gain.gain_of(m).frequency, gain.gain_of(m).gain)
    orders = enumerate(gain.orders(m)[:5], 1)
    row.values |= {f"gain_order_{k}": estimate(one) for k, one in orders}
    row.curves["first"] = (np.array([gain.first_resonance(m)]),)
    row.curves["resonances"] = spectrum.standing_waves(m)
    if m.case.has("structure"):
        frequency, width, path = whole_ridge(m).of_waves()
        passed = m.diameter / longest(m, "linear").value
        row.curves["ridge"] = (frequency * passed, width / frequency, path)


def of_one_producer(records: Iterable[str], *columns: str) -> tuple[str, ...]:
    """Columns with `{record}` in them as those of one producer, whose name comes first.

    YADE's where all `records` are its, else the linear wave's: never some of one and some of the
    other, which differ where contacts slide.

    >>> of_one_producer(["yade", "linear"], "f_low_pass_2_{record}_khz")
    ('linear', 'f_low_pass_2_linear_khz')
    """
    records = set(records)
    producer = "yade" if records == {"yade"} else "linear"
    return PRODUCERS[producer], *(text.replace("{record}", producer) for text in columns)


def write_result(path: Path, row: CaseResult) -> None:
    """Write the result of a case, what is empty left out; numbers that are not known are null."""
    found = {"schema": SCHEMA, "version": VERSION} | asdict(replace(row, values={}))
    found["values"] = {name: _cell(value) for name, value in row.values.items()}
    found["curves"] = plain(found["curves"], OF_CURVES)
    lines = [
        f"{json.dumps(name)}: {json.dumps(plain(value, DIGITS))}"
        for name, value in found.items()
        if value not in ({}, [])
    ]
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")


def _cell(value: Value) -> dict[str, Any]:
    """A number and its error, in a result; the part that packings share only where there is one."""
    cell = {"value": value.value, "error": value.error}
    if value.common_error:
        cell["common"] = value.common_error
    return cell


def read_result(path: str | Path) -> CaseResult:
    """A result; InputError where the file is none."""
    text = read_text(path)
    try:
        return _row(parsed(text))
    except MismatchError as error:
        problem = f"{path}: no result of a case"
        raise InputError("result", problem, str(error), "measure the case again") from None


CURVES = {"gain": 2, "first": 1, "resonances": 2, "ridge": 3}
"""Arrays of the curves that figures take apart; others may have any number, of one length."""
OF_GAIN = ("first", "resonances")
"""Curves that a figure of the gain needs."""
OF_VALUES = {"value": float, "error": float, "common": float}


def _row(found: Any) -> CaseResult:
    """The row that a file's JSON has; `MismatchError` where it is none."""
    kinds = get_type_hints(CaseResult) | {"schema": str, "version": int, "values": dict[str, Any]}
    needed = {
        one.name for one in fields(CaseResult) if one.default is one.default_factory is MISSING
    }
    said = fields_of(found, kinds, needed | {"schema", "version"}, "")
    if (said.pop("schema"), said.pop("version")) != (SCHEMA, VERSION):
        raise MismatchError(f"it is not of schema {SCHEMA}, version {VERSION}")
    for name, cell in said.get("values", {}).items():
        numbers = fields_of(cell, OF_VALUES, {"value", "error"}, f"values.{name}")
        said["values"][name] = estimate(**numbers)
    row = CaseResult(**said)
    for fault, wrong in _faults(row).items():
        if wrong:
            raise MismatchError(fault)
    return row


def _faults(row: CaseResult) -> dict[str, bool]:
    """What a row may contradict itself in, and whether it does."""
    odd = [
        name
        for name, curve in row.curves.items()
        if len(curve) != CURVES.get(name, max(1, len(curve)))
        or len({len(each) for each in curve}) != 1
    ]
    uneven = [name for name, lines in row.tables.items() if len({*map(len, lines)}) != 1]
    gain = "gain" in row.curves and not all(name in row.curves for name in OF_GAIN)
    return {
        f"name {row.name!r} names no case": not row.name,
        f"record is {row.record!r}": row.record not in PRODUCERS and not row.state,
        "packings is below 1": row.packings < 1,
        f"curves.{odd[:1]} is no curve": bool(odd),
        "curves.first is empty": len(row.curves.get("first", [[0.0]])[0]) == 0,
        "curves.gain is there without first and resonances": gain,
        f"tables.{uneven[:1]} has lines of several lengths": bool(uneven),
        f"tables.{[*row.tables][:1]} is empty": any(not lines[0] for lines in row.tables.values()),
        "provenance is no table of 4 columns": any(len(line) != 4 for line in row.provenance),
    }


def read_results(folder: Path) -> list[CaseResult]:
    """All results in a folder, with the scatter of each case over those of other seeds.

    Other seeds have folders `seed_*` of their own in it. A result that states its scatter keeps it
    where no other seed is at hand.
    """
    rows = [read_result(path) for path in sorted(folder.glob("*.json"))]
    names = [row.name for row in rows]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                "two_results", f"{folder}: two results are of {name}", remedy="keep one"
            )
    others = [read_result(path) for path in sorted(folder.glob("seed_*/*.json"))]
    for row in rows:
        if twins := [other for other in others if other.name == row.name]:
            row.samples, row.packings = scatter_of_samples([row, *twins]), 1 + len(twins)
    return rows


def scatter_of_samples(several: Sequence[CaseResult]) -> dict[str, float]:
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
