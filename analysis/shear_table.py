"""Table of the S-waves of some cases: each number named for its wave, P-wave and moduli beside."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from analysis.measures import Measures
from analysis.measures.estimate import Estimate
from analysis.measures.shear_wave import ShearWave, velocities_of
from analysis.table import Table

Measure = Callable[[Measures, ShearWave], float | Estimate | str]


def _edge(m: Measures, s: ShearWave) -> Estimate:
    return Estimate(s.low_pass.value / 1e3, s.low_pass.error / 1e3)


def _ratio(m: Measures, s: ShearWave) -> float:
    p, shear = velocities_of(m.case.moduli)
    return p / shear


QUANTITIES: tuple[tuple[str, Measure], ...] = (
    ("wall slides along", lambda m, s: s.record.direction),
    ("record by", lambda m, s: s.producer),
    ("V_S first peaks, m/s", lambda m, s: s.first_peak),
    ("V_S first arrivals, 5 % of the maximum, m/s", lambda m, s: s.arrival),
    ("V_S long waves, m/s", lambda m, s: s.long_wave),
    ("V_S of the moduli, m/s", lambda m, s: velocities_of(m.case.moduli)[1]),
    ("V_P / V_S, long waves, V_P of the linear wave", lambda m, s: _over(m.long_wave, s.long_wave)),
    ("V_P / V_S of the moduli", _ratio),
    ("S-wave's f_low-pass 2 %, kHz", _edge),
    ("S-wave's band edge, kHz", lambda m, s: s.band_edge / 1e3),
    ("S-wave's gain, first maximum, kHz", lambda m, s: s.gain.first_maximum()[0] / 1e3),
)
"""Heading, and how it is measured."""


def _over(p: Estimate, s: Estimate) -> Estimate:
    relative = np.hypot(np.nan_to_num(p.error / p.value), np.nan_to_num(s.error / s.value))
    return Estimate(p.value / s.value, p.value / s.value * float(relative))


def table_of_shear(cases: list[Measures], number: Callable[[float | Estimate | str], str]) -> Table:
    """One row a quantity, one column a record of an S-wave; `number` writes a value."""
    found = [(m, wave) for m in cases for wave in m.shear]
    header = ["quantity", *(m.case.label for m, _ in found)]
    rows = [[head, *(number(measure(m, s)) for m, s in found)] for head, measure in QUANTITIES]
    rows = [row for row in rows if any(row[1:])]
    return Table("S-waves: the source wall slides", header, rows if found else [])
