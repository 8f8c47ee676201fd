"""What of several cases can be held side by side: numbers of one producer, and of end frictions."""

from __future__ import annotations

from collections.abc import Iterable

from analysis.quantities.records import PERCENT
from analysis.rows import Row

UNITS = {
    "v_p_first_peaks": "m_per_s",
    **{f"f_low_pass_{percent}": "khz" for percent in PERCENT.values()},
    **{f"lambda_{percent}": "over_d" for percent in PERCENT.values()},
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
