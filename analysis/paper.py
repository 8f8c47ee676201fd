"""Numbers that Otsubo et al. (Granular Matter 19:50, 2017) state in their text."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.network import Network


@dataclass(frozen=True)
class Stated:
    """One stated number: id, cases that it holds for, value, unit, where it stands."""

    id: str
    cases: tuple[int, ...]
    value: float
    unit: str
    where: str


_ALL = (1, 2, 3, 4)
_RANDOM = tuple(range(5, 33))
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
    Stated("f_low_pass_modal", (2,), 137.6, "kHz", "section 5.1"),
    Stated("threshold_2", (2,), 138.1, "kHz", "section 5.1, DEM"),
    Stated("particles", _RANDOM, 35201, "1", "section 2"),
    Stated("chi_high", (6,), 0.33, "1", "section 3, Fig. 9"),
    Stated("void_ratio", (2,), 0.353, "1", "Fig. 12"),
    Stated("void_ratio", (6,), 0.544, "1", "Fig. 12"),
    Stated("void_ratio", (7,), 0.539, "1", "Fig. 13"),
    Stated("void_ratio", (8,), 0.516, "1", "Fig. 13"),
    Stated("void_ratio", (22,), 0.646, "1", "Fig. 12"),
    Stated("void_ratio", (30,), 0.687, "1", "Fig. 12"),
    Stated("lambda_edge", _ALL, 2**0.5, "1", "section 5.1, Fig. 18"),
    Stated("translations_only", _ALL, 1.0, "1", "section 5.1, Fig. 8"),
    Stated("exponent", _ALL, 1 / 6, "1", "section 2, Fig. 6"),
)

INFINITE = float("inf")


@dataclass(frozen=True)
class Range:
    """A stated range, or a bound: id, cases, lower and upper end, where it stands."""

    id: str
    cases: tuple[int, ...]
    low: float
    high: float
    where: str

    @property
    def text(self) -> str:
        """As one writes it."""
        if self.high == INFINITE:
            return f"> {self.low:.4g}"
        return f"< {self.high:g}" if self.low == -INFINITE else f"{self.low:g} to {self.high:g}"


RANGES = (
    Range("length_over_d", _RANDOM, 141, 146, "section 2"),
    Range("lambda_over_d", _RANDOM, 7, 18, "section 5.1, Fig. 18"),
    Range("lambda_over_d_1", _RANDOM, 5, 12, "section 5.1, Fig. 18"),
    Range("chi_low", (6,), 0.9, 1, "section 3, Fig. 9"),
    Range("gain_maximum", (2, 3, 4, 6, 7, 8), 1, INFINITE, "section 5.2, Fig. 19"),
    Range("exponent", _RANDOM, 1 / 6, INFINITE, "section 2, Fig. 6"),
    Range("slope", _RANDOM, 1.2, 1.4, "section 5.1, Fig. 17"),
    Range("f_max_spread", _ALL + _RANDOM, -INFINITE, 3, "section 3, Fig. 8"),
)

COORDINATION_AT_1_KPA = {0.0: 5.91, 0.4: 3.84}
"""Mean coordination number of the random samples at 1 kPa, by mu_comp (section 3)."""


STRESSES = 1e4, 1e5, 1e6, 1e7
"""Pa, of four cases in a row: the crystal, then each friction."""
FRICTIONS = 0.0, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4
"""mu_comp of cases 5-8, 9-12, ...; the paper names the first and the last, the rest is ours."""
SAME_STRESS, SAME_FRICTION = 0.01, 1e-3
"""Relative and absolute difference up to which two are one."""
SAME_SPHERES = 1e-3
"""Relative difference of radius and mass up to which spheres are those of the paper."""


SPHERES, CRYSTAL_LENGTH, SAME_LENGTH = 35201, (199 * 2**0.5 + 2) * RADIUS, 0.01
"""Of its random packings, how many spheres; of its crystals of 200 layers the length, m, which the
overlaps shorten by less than a per cent."""


def has_its_spheres(network: Network) -> bool:
    """Whether all spheres of a packing have the radius and the mass of those of the paper."""
    mass, _ = GLASS.sphere(RADIUS)
    given = np.concatenate([network.radius / RADIUS, network.mass / mass])
    return bool((abs(given - 1) < SAME_SPHERES).all())


def is_its_specimen(network: Network, crystal: bool) -> bool:
    """Whether a packing is as large as those of the paper."""
    if crystal:
        return abs(network.length / CRYSTAL_LENGTH - 1) < SAME_LENGTH
    return network.n_particles == SPHERES


def matching_case(crystal: bool, stress: float, mu_comp: float) -> int | None:
    """Number of the paper's case by what it is; None where there is no such case."""
    at = [k for k, s in enumerate(STRESSES) if abs(stress / s - 1) < SAME_STRESS]
    rows = (
        [0]
        if crystal
        else [1 + k for k, mu in enumerate(FRICTIONS) if abs(mu_comp - mu) < SAME_FRICTION]
    )
    return 4 * rows[0] + at[0] + 1 if at and rows else None


def stated_range(quantity: str, case: int | None) -> Range | None:
    """The paper's range of a quantity for a case; None if not stated."""
    return next((r for r in RANGES if r.id == quantity and case in r.cases), None)


def stated(quantity: str, case: int | None) -> float | None:
    """The paper's value of a quantity for a case, in the unit of `STATED`; None if not stated."""
    for entry in STATED:
        if entry.id == quantity and case in entry.cases:
            return entry.value
    return None
