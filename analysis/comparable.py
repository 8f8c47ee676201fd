"""What of several cases can be held side by side: numbers of one producer, and of twin packings."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from analysis.rows import PERCENT, Row

UNITS = {
    "v_p_first_peaks": "m_per_s",
    **{f"f_low_pass_{percent}": "khz" for percent in PERCENT.values()},
    **{f"lambda_{percent}": "over_d" for percent in PERCENT.values()},
}
"""Quantities that a case has of its record, be it YADE's or the linear wave, and their units."""


def of_one_producer(members: Iterable[Row], quantity: str, unit: str = "") -> tuple[str, str]:
    """Column of a quantity and its producer: YADE's where all have it, else the linear wave's.

    Never some of one and some of the other, which differ where contacts slide. `unit` is that of
    `UNITS`.

    >>> of_one_producer([], "f_low_pass_2")
    ('f_low_pass_2_linear_khz', 'linear')
    """
    members, unit = list(members), unit or UNITS[quantity]
    column = f"{quantity}_yade_{unit}"
    if members and all(np.isfinite(row.value(column)) for row in members):
        return column, "YADE"
    return f"{quantity}_linear_{unit}", "linear"


def scatter_of_samples(row: Row, seeds: Iterable[Row]) -> dict[str, float]:
    """Standard deviation of each number over the packings of a case, its own and those of `seeds`.

    The numbers of its record are compared by one producer. Empty without another packing.
    """
    twins = [row, *(other for other in seeds if other.number == row.number)]
    columns = {name: name for name in row.values}
    columns |= {f"{q}_{unit}": of_one_producer(twins, q)[0] for q, unit in UNITS.items()}
    found = {}
    for name, column in columns.items():
        values = np.array([twin.value(column) for twin in twins])
        known = values[np.isfinite(values)]
        if len(known) > 1:
            found[name] = float(np.std(known, ddof=1))
    return found
