"""What the settings of a compression change: means over seeds, limits, and modal against YADE.

Rows are those of studies/convergence/*.table, their packings made by workflow/convergence.smk. One
that differs from `own` in one setting is a rung of that setting's ladder; where the setting is an
error to be made small (a step, a rate, the size of the cell), a straight line through the ladder,
weighted with the standard errors, gives the limit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from analysis.packings.limit import limit
from analysis.packings.seeds import NO_SETTING, NONE, OWN, QUANTITIES, Means, Seeds
from analysis.table import Table
from modal.preparation.protocol import NOMINAL_FRACTION

NOT_AGITATED = "monotonic_not_agitated"
RATES = frozenset({"approach_rate", "inertial_number"})
SHOWN = (
    *("e", "Z", "Z_bearing", "rattlers", "fabric_zz", "force_squared", "weak_forces"),
    *("V_P", "f_low_pass"),
)
"""Quantities of the tables; e, Z and V_P decide about the default."""
STRESS_ERROR = 0.01
"""Of a packing that has reached its stress: the relative error of V_P is then below 0.2 %."""
DIGITS = {"e": 4, "e_bulk": 4, "Z": 3, "Z_bearing": 3, "V_P": 1, "f_low_pass": 0}
TWINS = {"twin": "twin_yade", "modal_half_step": "yade_half_step"}
TWINS |= {"modal_half_rates": "yade_half_rates"}
"""Rows of the same settings by modal's own loop and by YADE."""


@dataclass(frozen=True)
class Row:
    """One setting at one friction and stress, Pa; `values` hold a number a seed, by quantity.

    `means` are those of further seeds. `unsettled` packings more are there, which have not reached
    the stress: none of the values.
    """

    name: str
    settings: dict[str, str]
    stress: float
    values: dict[str, np.ndarray]
    unsettled: int
    means: Means = NONE

    @property
    def friction(self) -> float:
        """mu_comp."""
        return float(self.settings["mu_comp"])

    def mean(self, quantity: str) -> tuple[float, float, int]:
        """Mean, its standard error (NaN from one seed) and the number of seeds."""
        return self.means.joined(
            quantity, self.values[quantity][np.isfinite(self.values[quantity])]
        )


@dataclass(frozen=True)
class Ladder:
    """A setting that rows vary alone; `columns` change together, `size` makes a number of a row.

    With `error` the limit is at size 0, and the distance from it an error in the first power. The
    rows differ in nothing else from the one that is named `base`.
    """

    title: str
    columns: frozenset[str]
    size: Callable[[Row], float]
    error: bool
    base: str = OWN


def _number(column: str) -> Callable[[Row], float]:
    return lambda row: float(row.settings[column])


def _length(row: Row) -> float:
    """Length of the cell in diameters at the nominal solid fraction."""
    spheres, width = float(row.settings["spheres"]), float(row.settings["width"])
    return spheres * np.pi / 6 / NOMINAL_FRACTION / width**2


LADDERS = (
    Ladder("time step / limit", frozenset({"fraction"}), _number("fraction"), True),
    Ladder("agitated: rate (1/s)", RATES, _number("approach_rate"), False),
    Ladder("not agitated: rate (1/s)", RATES, _number("approach_rate"), True, NOT_AGITATED),
    Ladder(
        "servo: inertial number", frozenset({"inertial_number"}), _number("inertial_number"), True
    ),
    Ladder(
        "agitated: damping", frozenset({"agitated_damping"}), _number("agitated_damping"), False
    ),
    Ladder("later damping", frozenset({"damping"}), _number("damping"), False),
    Ladder("hot stress (Pa)", frozenset({"hot_stress"}), _number("hot_stress"), False),
    Ladder("settled: residual", frozenset({"residual"}), _number("residual"), False),
    Ladder(
        "diameter / width",
        frozenset({"spheres", "width"}),
        lambda row: 1 / float(row.settings["width"]),
        True,
    ),
    Ladder("diameter / length", frozenset({"spheres"}), lambda row: 1 / _length(row), True),
    Ladder("peak without friction (Pa)", frozenset({"peak"}), _number("peak"), False),
)
"""Of `RATES` the approach's is shown; the servo's goes with it."""


def rows_of(seeds: Seeds) -> list[Row]:
    """A row for each setting and stress of which packings are known, in the order of the table."""
    rows = []
    for key in seeds.ordered():
        states = seeds.numbers.get(key, {}).values()
        there = [state for state in states if state["stress_error"] < STRESS_ERROR]
        values = {q: np.array([state[q] for state in there], float) for q in QUANTITIES}
        means = seeds.means.get(key, NONE)
        unsettled = len(states) - len(there) + means.unsettled
        rows.append(Row(key[0], seeds.settings[key[:2]], key[2], values, unsettled, means))
    return rows


def rungs(ladder: Ladder, rows: Iterable[Row], friction: float, stress: float) -> list[Row]:
    """The rows of a ladder at one friction and stress, Pa, its base among them, by their size."""
    here = [row for row in rows if (row.friction, row.stress) == (friction, stress)]
    base = next((row for row in here if row.name == ladder.base), None)
    if base is None:
        return []
    found = [
        row
        for row in here
        if {n for n, cell in row.settings.items() if cell != base.settings[n]} - NO_SETTING
        in (ladder.columns, set())
    ]
    return sorted(found, key=ladder.size) if len(found) > 1 else []


def _text(quantity: str, value: float, error: float = np.nan) -> str:
    form = f".{DIGITS.get(quantity, 4)}f"
    if not np.isfinite(value):
        return ""
    return f"{value:{form}}" + (f" ± {error:{form}}" if np.isfinite(error) else "")


def _apart(distance: float, error: float, form: str = "{:+.1f}") -> str:
    """A distance in standard errors, where there is one."""
    return form.format(distance / error) if error > 0 else ""


def _shown(rows: list[Row]) -> list[str]:
    """Those of `SHOWN` that some row has."""
    return [name for name in SHOWN if any(row.mean(name)[2] for row in rows)]


def settings_table(rows: list[Row]) -> Table:
    """Mean and standard error of each row; in brackets its distance from `own` in such errors."""
    own = {(row.friction, row.stress): row for row in rows if row.name == OWN}
    shown, lines = _shown(rows), []
    for row in rows:
        count = row.mean("e")[2]
        seeds = f"{count}, {row.unsettled} not settled" if row.unsettled else f"{count}"
        cells = [row.name, row.settings["mu_comp"], f"{row.stress / 1e3:g}", seeds]
        base = own.get((row.friction, row.stress))
        for quantity in shown:
            value, error, _ = row.mean(quantity)
            text = _text(quantity, value, error)
            if base is not None and base is not row:
                before, its, _ = base.mean(quantity)
                text += _apart(value - before, np.hypot(error, its), " ({:+.1f})")
            cells.append(text)
        lines.append(cells)
    header = ("setting", "mu_comp", "stress, kPa", "seeds", *shown)
    return Table("Settings: mean ± standard error (distance from `own` in errors)", header, lines)


def limits_table(rows: list[Row]) -> Table:
    """Where a step, a rate and the size of the cell lead, and how far from it `own` is."""
    shown, lines = _shown(rows), []
    for ladder in LADDERS:
        for friction, stress in sorted({(row.friction, row.stress) for row in rows}):
            steps = rungs(ladder, rows, friction, stress)
            if not ladder.error or not steps:
                continue
            own = next(row for row in steps if row.name == ladder.base)
            size = np.array([ladder.size(row) for row in steps])
            for quantity in shown:
                means = np.array([row.mean(quantity)[:2] for row in steps])
                found = limit(size, *means.T)
                here, its, _ = own.mean(quantity)
                lines.append(
                    [
                        ladder.title,
                        f"{friction:g}",
                        f"{stress / 1e3:g}",
                        quantity,
                        _text(quantity, here, its),
                        _text(quantity, found.value, found.error),
                        *(
                            form.format(number) if np.isfinite(number) else ""
                            for form, number in (
                                ("{:+.1f}", found.distance(ladder.size(own), here, its)),
                                ("{:.1f}", found.chi),
                            )
                        ),
                    ]
                )
    header = ["ladder", "mu_comp", "stress, kPa", "quantity", "as it is", "limit"]
    header += ["distance in errors of the difference", "chi^2 a point to spare"]
    return Table("Limits of the ladders, by a straight line", header, lines)


def twins_table(rows: list[Row]) -> Table:
    """The same settings by modal and by YADE: means, and their difference in standard errors."""
    by_name = {(row.name, row.friction, row.stress): row for row in rows}
    shown, lines = _shown(rows), []
    for (name, friction, stress), row in by_name.items():
        other = by_name.get((TWINS.get(name, ""), friction, stress))
        if other is None:
            continue
        for quantity in shown:
            (a, s, n), (b, t, m) = row.mean(quantity), other.mean(quantity)
            line = [name, f"{friction:g}", f"{stress / 1e3:g}", quantity, f"{n}, {m}"]
            line += [_text(quantity, a, s), _text(quantity, b, t)]
            lines.append([*line, _apart(a - b, np.hypot(s, t))])
    header = ("setting", "mu_comp", "stress, kPa", "quantity", "seeds", "modal", "YADE")
    return Table("The twins", (*header, "difference in standard errors"), lines)
