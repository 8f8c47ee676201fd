"""Numbers that Otsubo et al. (Granular Matter 19:50, 2017) state in their text."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Stated:
    """One stated number: id, cases that it holds for, value, unit, where it stands."""

    id: str
    cases: tuple[int, ...]
    value: float
    unit: str
    where: str


_ALL = (1, 2, 3, 4)
STATED = (
    Stated("f_min", (2,), 0.7534, "kHz", "section 3"),
    Stated("f_max", (2,), 211.2, "kHz", "section 3"),
    Stated("f_max", (6,), 216.1, "kHz", "section 3"),
    Stated("f_max", (30,), 214.1, "kHz", "section 3"),
    Stated("threshold_2", (6,), 21.9, "kHz", "section 5.1, DEM"),
    Stated("f_1", (2,), 1.06, "kHz", "Fig. 10"),
    Stated("f_200", (2,), 137.6, "kHz", "Fig. 10"),
    Stated("resonances", _ALL, 200, "1", "section 3"),
    Stated("f_low_pass", (2,), 137.7, "kHz", "section 5.1, Eq. 10"),
    Stated("threshold_2", (2,), 138.1, "kHz", "section 5.1, DEM"),
    Stated("void_ratio", (2,), 0.353, "1", "Fig. 12"),
    Stated("void_ratio", (6,), 0.544, "1", "Fig. 12"),
    Stated("void_ratio", (7,), 0.539, "1", "Fig. 13"),
    Stated("void_ratio", (8,), 0.516, "1", "Fig. 13"),
    Stated("void_ratio", (22,), 0.646, "1", "Fig. 12"),
    Stated("void_ratio", (30,), 0.687, "1", "Fig. 12"),
    Stated("lambda_over_d", _ALL, 2**0.5, "1", "section 5.1, Fig. 18"),
    Stated("translations_only", _ALL, 1.0, "1", "section 5.1, Fig. 8"),
    Stated("exponent", _ALL, 1 / 6, "1", "section 2, Fig. 6"),
)

RANGES = {
    ("lambda_over_d", False): (7.0, 18.0),
    ("lambda_over_d_1", False): (5.0, 12.0),
    ("gain_maximum", False): (1.0, float("inf")),
    ("gain_maximum", True): (1.0, float("inf")),
}
"""Ranges by quantity and whether they are of crystals (sections 5.1, Fig. 18; 5.2, Fig. 19)."""

COORDINATION_AT_1_KPA = {0.0: 5.91, 0.4: 3.84}
"""Mean coordination number of the random samples at 1 kPa, by mu_comp (section 3)."""


def stated(quantity: str, case: int | None) -> float | None:
    """The paper's value of a quantity for a case, in the unit of `STATED`; None if not stated."""
    for entry in STATED:
        if entry.id == quantity and case in entry.cases:
            return entry.value
    return None
