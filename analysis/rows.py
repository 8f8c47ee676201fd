"""The numbers of a case: what the tables and figures over all cases are made of.

A `Row` holds values with their errors, and curves, but none of the case's files: a whole study fits
into memory, and its cases are measured side by side.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from analysis.case import Case
from analysis.estimators.power_law import PowerLaw, power_law
from analysis.measures import Measures
from analysis.measuring import Measuring
from analysis.quantities import QUANTITIES
from analysis.quantities.records import (
    HIGH,
    LOW_PASS,
    OF_CASE,
    OF_MODULI,
    PERCENT,
    SHEAR,
    column_of,
)
from analysis.value import NOTHING, Value, estimate


@dataclass
class Row:
    """One case: number of the study (None for another packing), name, what it is, its numbers.

    `stress` Pa and `mu_comp` of the compression; `record` is `yade`, or `linear` where no run is
    there; `values` by their column in table1.csv, with the error of the estimator and of the choice
    of the chain; `samples` their scatter over packings of other seeds, `packings` how many these
    are with its own; `flat` says of thresholds whether they stand on a plateau; `curves` are arrays
    by name; `absent` says which products are not there; `state` is one that is no case; `tables`
    are cells of text by name; `of_record` maps a column of its record to that of one producer, `{}`
    in its place; `provenance` has a line for each file that was read; `stated` are lower and upper
    end of what a study states of the case, and no part of its result.
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
    of_record: dict[str, str] = field(default_factory=dict)
    provenance: list[list[str]] = field(default_factory=list)
    stated: dict[str, tuple[float, float]] = field(default_factory=dict, compare=False)

    def value(self, name: str) -> float:
        """A number; NaN where it is not known."""
        return self.values.get(name, NOTHING).value

    def error(self, name: str) -> float:
        """Its uncertainty; NaN where that is not known."""
        return self.values.get(name, NOTHING).error

    def spread(self, name: str) -> float:
        """Its uncertainty, or the scatter over packings where that is larger: it has both in it."""
        known = [e for e in (self.error(name), self.samples.get(name, np.nan)) if np.isfinite(e)]
        return max(known, default=np.nan)

    @property
    def group(self) -> str:
        """What the paper joins by lines: FCC, or a friction."""
        return "FCC" if self.crystal else f"random, mu_comp {self.mu_comp:g}"


def number_of(name: str) -> int | None:
    """The case's number in the study, from its name."""
    match = re.fullmatch(r"case(\d+)", name)
    return int(match[1]) if match else None


def groups_of(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows by kind and friction, in order of stress."""
    found: dict[str, list[Row]] = {}
    for row in sorted(rows, key=lambda r: (not r.crystal, r.mu_comp, r.stress)):
        found.setdefault(row.group, []).append(row)
    return found


def law_of(members: list[Row], x: str, y: str) -> PowerLaw:
    """y as a power of x over the cases of a group; x may be `stress_pa`."""
    at = [row.stress if x == "stress_pa" else row.value(x) for row in members]
    return power_law(np.array(at), np.array([row.value(y) for row in members]))


def row_of(m: Measures) -> Row:
    """All numbers that a case's products allow, each measured once."""
    if m.row is None:
        m.row = _measured(m)
    return m.row


def bare_row(case: Case) -> Row:
    """The row of a case that nothing has been measured of."""
    return Row(
        number_of(case.name),
        case.name,
        case.label,
        case.is_crystal,
        case.stress,
        0.0 if case.is_crystal else case.mu_comp,
        "linear" if case.signals is None else "yade",
        case.unsettled,
    )


def _measured(m: Measures) -> Row:
    case, row = m.case, bare_row(m.case)
    add_values(row, m, OF_CASE)
    own = "yade" if row.record == "yade" else "linear"
    row.of_record["v_p_first_peaks_m_per_s"] = "v_p_first_peaks_{}_m_per_s"
    for percent in PERCENT.values():
        for quantity, unit in (("f_low_pass", "khz"), ("lambda", "over_d")):
            name = f"{quantity}_{percent}"
            row.of_record[f"{name}_{unit}"] = f"{name}_{{}}_{unit}"
        row.flat[percent] = row.flat[f"{percent}_{own}"]
    row.values |= {name: row.values[column.format(own)] for name, column in row.of_record.items()}
    row.texts["gain_height"] = m.gain_height
    row.texts["chi_z_high"] = m.largest_chi(HIGH * m.f_max, np.inf, chain=True)[1]
    _curves(m, row)
    row.absent = [
        kind
        for kind in ("signals", "highest.modes", "modes", "density", "structure", "response")
        if not case.has(kind) and not (case.is_crystal and kind in ("density", "structure"))
    ]
    row.notes += case.notes
    return row


def add_values(row: Row, m: Measures, names: Iterable[str]) -> None:
    """Quantities by name, to the row; those of S-waves and moduli where their files are there."""
    packing = Measuring.of_case(m)
    keys = {name: key for key, (name, _) in LOW_PASS.items()}
    recorded = {"", *(wave.record.producer for wave in m.shear)}
    for name in names:
        if name in OF_MODULI and not m.case.has("moduli") or SHEAR.get(name, "") not in recorded:
            continue
        value = QUANTITIES[name].measured(packing)
        column, shown = column_of(name, value)
        row.values[column] = shown
        if name in keys:
            row.flat[keys[name]] = value.known and not value.caveats
        if not value.known:
            row.notes += [
                f"{column}: {caveat}" for caveat in value.caveats if caveat != "no plateau"
            ]


def _curves(m: Measures, row: Row) -> None:
    """What figures over several cases draw."""
    gain = m.gain
    row.curves["gain"] = (gain.frequency, gain.gain)
    row.curves["gain_orders"] = m.gain_orders
    for k, order in enumerate(m.gain_orders[0][:5]):
        row.values[f"gain_order_{k + 1}"] = estimate(float(order))
    row.curves["free_held"] = (m.free_held,)
    row.curves["first"] = (np.array([m.first_resonance]),)
    row.curves["resonances"] = m.resonances
    if m.scattering is not None:
        frequency, width, path = m.scattering.of_waves()
        passed = m.case.diameter / m.long_wave.value
        row.curves["ridge"] = (frequency * passed, width / frequency, path)
    if m.case.density is not None:
        row.curves["excess"] = (m.excess.frequency, m.excess.reduced)
