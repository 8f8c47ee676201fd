"""Tables 1 and 2 of the paper for the cases at hand, and each stated number beside ours."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.lowpass import Plateau
from analysis.measures import Estimate, Measures
from analysis.paper import RANGES, stated
from modal.storage import InputError

RESONANCES = 10
"""Rows of Table 2."""


@dataclass
class Table:
    """A title, a header and rows of text."""

    title: str
    header: list[str]
    rows: list[list[str]]

    def markdown(self) -> str:
        """As Markdown."""
        lines = [self.header, ["---"] * len(self.header), *self.rows]
        return "".join(f"| {' | '.join(line)} |\n" for line in lines)

    def text(self) -> str:
        """Aligned for a terminal."""
        lines = [self.header, *self.rows]
        width = [max(len(line[k]) for line in lines) for k in range(len(self.header))]
        return "\n".join(
            "  ".join(cell.ljust(w) for cell, w in zip(line, width, strict=True)).rstrip()
            for line in lines
        )

    def write(self, stem: Path) -> list[Path]:
        """Write stem.csv and stem.md; returns their paths."""
        table, text = stem.with_name(stem.name + ".csv"), stem.with_name(stem.name + ".md")
        with open(table, "w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([self.header, *self.rows])
        text.write_text(self.markdown())
        return [table, text]


QUANTITIES: tuple[tuple[str, str, Callable[[Measures], float | Estimate | Plateau]], ...] = (
    ("stress", "stress, kPa", lambda m: m.case.stress / 1e3),
    ("void_ratio", "e", lambda m: m.void_ratio),
    ("coordination", "Z", lambda m: m.coordination[0]),
    ("", "Z of force-bearing", lambda m: m.coordination[1]),
    ("", "V_P first peaks, m/s", lambda m: m.first_peak),
    ("", "V_P long waves, signals, m/s", lambda m: m.long_wave),
    ("", "V_P modes, m/s", lambda m: m.modal),
    ("", "phase velocity, walls, lambda L/5, m/s", lambda m: m.walls[0]),
    ("", "group velocity, walls, lambda L/5, m/s", lambda m: m.walls[1]),
    ("", "V_P mean strain, contacts, m/s", lambda m: m.effective[0]),
    ("", "V_P mean strain, means, m/s", lambda m: m.effective[1]),
    ("threshold_2", "f_low-pass 2 %, kHz", lambda m: _scaled(m.low_pass[0], 1e-3)),
    ("threshold_1", "f_low-pass 1 %, kHz", lambda m: _scaled(m.low_pass[1], 1e-3)),
    ("", "f_low-pass 2 %, particles, kHz", lambda m: _scaled(m.particle_low_pass[0], 1e-3)),
    ("f_low_pass", "band edge, kHz", lambda m: m.band_edge / 1e3),
    ("lambda_over_d", "lambda/D 2 %", lambda m: _wavelength(m, 0)),
    ("lambda_over_d_1", "lambda/D 1 %", lambda m: _wavelength(m, 1)),
    ("f_max", "f_max, kHz", lambda m: m.f_max / 1e3),
    ("gain_maximum", "largest gain", lambda m: np.nan if m.gain is None else m.gain.gain.max()),
)
"""Id in `analysis.paper`, heading, and how it is measured."""


def _scaled(found: Plateau, scale: float) -> Estimate:
    return Estimate(scale * found.value, scale * found.error)


def _wavelength(m: Measures, rule: int) -> float:
    return m.wavelength_at(m.low_pass[rule].value) / m.case.diameter


def number(found: float | Estimate, digits: int = 5) -> str:
    """A value, with its uncertainty where there is one; empty where there is no value."""
    value, error = (found.value, found.error) if isinstance(found, Estimate) else (found, np.nan)
    if not np.isfinite(value):
        return ""
    text = f"{value:.{digits}g}"
    return f"{text} ± {error:.1g}" if np.isfinite(error) and error > 0 else text


def table_1(cases: list[Measures]) -> Table:
    """One row a quantity, one column a case: Table 1 in this project's form."""
    header = ["quantity", *(m.case.label for m in cases)]
    rows = [[head, *(number(measure(m)) for m in cases)] for _, head, measure in QUANTITIES]
    return Table("Specification and results of the cases", header, rows)


def table_2(cases: list[Measures]) -> Table:
    """f_r and kappa_r of the resonances r = 1 ... 10 of every case that has them."""
    found = [(m.case.label, *m.resonances) for m in cases if len(m.resonances[0]) >= RESONANCES]
    header = ["r"]
    for label, _, _ in found:
        header += [f"f_r, kHz, {label}", f"kappa_r, rad/m, {label}"]
    rows = [
        [str(r + 1), *(x for _, f, k in found for x in (number(f[r] / 1e3), number(k[r])))]
        for r in range(RESONANCES if found else 0)
    ]
    return Table("Resonant frequencies and wave numbers", header, rows)


def deviations(cases: list[Measures]) -> Table:
    """Every number or range that the paper states of a case, ours, and how far they differ."""
    rows = []
    for m in cases:
        for key, head, measure in QUANTITIES:
            value, limits = stated(key, m.case.number), RANGES.get((key, m.case.is_crystal))
            if not key or (value is None and limits is None):
                continue
            found = measure(m)
            own = found.value if isinstance(found, Estimate) else found
            if value is not None:
                off = f"{100 * (own / value - 1):+.2f} %" if np.isfinite(own) else "not measured"
                rows.append([m.case.label, head, number(found), f"{value:g}", off])
            else:
                inside = limits[0] <= own <= limits[1]
                rows.append(
                    [m.case.label, head, number(found), f"{limits[0]:g} to {limits[1]:g}",
                     "inside" if inside else "outside" if np.isfinite(own) else "not measured"]
                )  # fmt: skip
    header = ["case", "quantity", "here", "paper", "difference"]
    return Table("Numbers stated by the paper", header, rows)


def tables(cases: list[Measures]) -> dict[str, Table]:
    """All tables by file name."""
    if not cases:
        raise InputError("no case given; name at least one")
    return {"table1": table_1(cases), "table2": table_2(cases), "paper": deviations(cases)}
