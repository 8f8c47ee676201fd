"""What of several cases can be held side by side: numbers of one producer, and of twin packings."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from analysis.paper import FRICTIONS
from analysis.rows import PERCENT, Row

UNITS = {
    "v_p_first_peaks": "m_per_s",
    **{f"f_low_pass_{percent}": "khz" for percent in PERCENT.values()},
    **{f"lambda_{percent}": "over_d" for percent in PERCENT.values()},
    "f_low_pass_2_own": "khz",
    "f_low_pass_2_layers": "khz",
    "lambda_2_own": "over_d",
}
"""Quantities that a case has of its record, be it YADE's or the linear wave, and their units."""


def of_one_producer(members: Iterable[Row], quantity: str, unit: str = "") -> tuple[str, str]:
    """Column of a quantity and its producer: YADE's where all have a run, else the linear wave's.

    Never some of one and some of the other, which differ where contacts slide. `unit` is that of
    `UNITS`.

    >>> of_one_producer([], "f_low_pass_2")
    ('f_low_pass_2_linear_khz', 'linear')
    """
    members, unit = list(members), unit or UNITS[quantity]
    if members and all(row.record == "yade" for row in members):
        return f"{quantity}_yade_{unit}", "YADE"
    return f"{quantity}_linear_{unit}", "linear"


def scatter_of_samples(row: Row, seeds: Iterable[Row]) -> dict[str, float]:
    """Standard deviation of each number over the packings of a case, its own and those of `seeds`.

    The numbers of its record are compared by one producer. Empty without another packing.
    """
    twins = [row, *(other for other in seeds if other.name == row.name)]
    columns = {name: name for name in row.values}
    columns |= {f"{q}_{unit}": of_one_producer(twins, q)[0] for q, unit in UNITS.items()}
    found = {}
    for name, column in columns.items():
        values = np.array([twin.value(column) for twin in twins])
        known = values[np.isfinite(values)]
        if len(known) > 1:
            found[name] = float(np.std(known, ddof=1))
    return found


def of_three_packings(rows: Iterable[Row]) -> list[Row]:
    """The crystals and packings of the lowest and the highest friction, where all have f_max.

    They are what the paper compares in Fig. 8.
    """
    found = []
    for group in _by_stress(rows).values():
        known = [row for row in group if np.isfinite(row.value("f_max_khz"))]
        three = [
            row for row in known if row.crystal or row.mu_comp in (FRICTIONS[0], FRICTIONS[-1])
        ]
        found += three if len(three) == 3 else []
    return found


def spread_of_highest(rows: Iterable[Row]) -> dict[float, float]:
    """Largest over smallest f_max at each stress, Pa, less 1, in %; of two packings or more."""
    found = {}
    for stress, group in _by_stress(rows).items():
        top = [row.value("f_max_khz") for row in group if np.isfinite(row.value("f_max_khz"))]
        if len(top) > 1:
            found[stress] = 100 * (max(top) / min(top) - 1)
    return found


def _by_stress(rows: Iterable[Row]) -> dict[float, list[Row]]:
    found: dict[float, list[Row]] = {}
    for row in sorted(rows, key=lambda row: row.stress):
        found.setdefault(float(f"{row.stress:.3g}"), []).append(row)
    return found
