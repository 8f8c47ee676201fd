"""The numbers of a case: what the tables and figures over all cases are made of.

A `Row` holds values with their errors, and curves, but none of the case's files: a whole study fits
into memory, and its cases are measured side by side.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from analysis.case import Case
from analysis.columns import HIGH, VALUES
from analysis.estimators.low_pass import THRESHOLDS
from analysis.estimators.power_law import PowerLaw, power_law
from analysis.measures import Measures
from analysis.measures.estimate import NOTHING, Estimate
from modal.tools.errors import InputError

PERCENT = {0.02: "2", 0.01: "1", 0.03: "3"}
"""Thresholds of the tables, and how their columns call them."""
MAPS = {"": ("chain", "map"), "own_": ("chain", "own"), "layers_": ("layers", "map")}
"""Rules of f_low-pass by their part of a column's name: whose motion, relative to which maximum."""


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
    values: dict[str, Estimate] = field(default_factory=dict)
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
    for name, measure in VALUES.items():
        try:
            found = measure(m)
        except InputError as error:
            row.notes.append(f"{name}: {error}")
            continue
        row.values[name] = Estimate.of(found)
    row.values["record_passages"] = Estimate(m.passband.common)
    add_low_pass(row, m, MAPS)
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


def add_low_pass(row: Row, m: Measures, rules: Mapping[str, tuple[str, str]]) -> None:
    """f_low-pass and lambda / D of both producers by some of the rules of `MAPS`, to the row."""
    band = m.passband
    for producer, record, plain in (
        ("yade", m.case.signals, band.of_yade),
        ("linear", m.case.wave, band.low_pass),
    ):
        for rule, (whose, reference) in rules.items():
            edges = band.edges(record, whose, reference, band.common) if rule else plain
            of_threshold = dict(zip(THRESHOLDS, edges, strict=True))
            for threshold, percent in PERCENT.items():
                edge, name = of_threshold[threshold], f"{percent}_{rule}{producer}"
                column = f"f_low_pass_{name}_khz"
                row.values[column] = Estimate(edge.value / 1e3, edge.error / 1e3)
                row.flat[name] = edge.flat
                row.values[f"lambda_{name}_over_d"] = _wavelength(m, record, edge.value, edge.error)
                if edge.why:
                    row.notes.append(f"{column}: {edge.why}")


def _wavelength(m: Measures, record, frequency: float, error: float) -> Estimate:
    """lambda / D at a frequency, with what the frequency's error makes of it."""
    if record is None or not np.isfinite(frequency):
        return NOTHING
    at = [m.wavelength_at(frequency + sign * error, record) for sign in (0, -1, 1)]
    here, low, high = (value / m.case.diameter for value in at)
    return Estimate(here, 0.5 * abs(low - high))


def _curves(m: Measures, row: Row) -> None:
    """What figures over several cases draw."""
    gain = m.gain
    row.curves["gain"] = (gain.frequency, gain.gain)
    row.curves["gain_orders"] = m.gain_orders
    for k, order in enumerate(m.gain_orders[0][:5]):
        row.values[f"gain_order_{k + 1}"] = Estimate(float(order))
    row.curves["free_held"] = (m.free_held,)
    row.curves["first"] = (np.array([m.first_resonance]),)
    row.curves["resonances"] = m.resonances
    if m.scattering is not None:
        frequency, width, path = m.scattering.of_waves()
        passed = m.case.diameter / m.long_wave.value
        row.curves["ridge"] = (frequency * passed, width / frequency, path)
    if m.case.density is not None:
        row.curves["excess"] = (m.excess.frequency, m.excess.reduced)
