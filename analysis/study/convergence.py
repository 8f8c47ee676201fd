"""What the settings of a compression change: means over seeds, limits, and modal against YADE.

Rows are those of studies/convergence/*.table, their packings made by workflow/convergence.smk. One
that differs from `own` in one setting is a point of that setting's sweep; where the setting is an
error to be made small (a step, a rate, the size of the cell), a straight line through the sweep,
weighted with the standard errors, gives the limit. The packings are large and stay where they were
made: `KEPT` holds the numbers of each with all digits, so that seeds made later join those made
before. Of some earlier seeds only mean and standard error are known: `MEANS`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.estimators.limit import limit
from analysis.figures.picture import Panel, Picture
from analysis.figures.render import save
from analysis.measurement import Measurement
from analysis.table import Table
from analysis.value import Value
from modal.formats.hdf5 import write_text
from modal.preparation.protocol import NOMINAL_FRACTION
from modal.tools.errors import InputError

QUANTITIES = {
    "e": "void_ratio",
    "e_bulk": "void_ratio_of_bulk",
    "Z": "coordination",
    "Z_bearing": "coordination_of_bearing",
    "rattlers": "rattlers",
    "fabric_zz": "fabric_zz",
    "force_squared": "force_squared",
    "weak_forces": "weak_forces",
    "V_P": "v_p_static",
    "f_low_pass": "low_pass",
    "residual": "residual",
    "stress_error": "stress_error",
}
"""Columns, and the quantities that `measure` has of each packing."""
HIDDEN = "e_bulk", "residual", "stress_error"
"""Not of the tables; e, Z and V_P decide about the default."""
DRAWN = {
    **{"e": "void ratio", "Z": "contacts of a sphere", "V_P": "$V_P$ (m/s)"},
    "f_low_pass": "$f_{low-pass}$ (Hz)",
}
"""Of the figures, the last where the packings are long enough for it."""
STRESS_ERROR = 0.01
"""Of a packing that has reached its stress: the relative error of V_P is then below 0.2 %."""
DIGITS = {"Z": 3, "Z_bearing": 3, "V_P": 1, "f_low_pass": 0}
KEPT, MEANS, OWN = "seeds.csv", "means.csv", "own"
KEY = ["setting", "mu_comp", "stress"]
NO_SETTING = {"setting", "seeds"}
"""Columns of the table of rows that change nothing of a packing."""
TWINS = {"twin": "twin_yade", "modal_half_step": "yade_half_step"}
TWINS |= {"modal_half_rates": "yade_half_rates"}
"""Rows of the same settings by modal's own loop and by YADE."""
NONE = pd.Series({"seeds": 0, "unsettled": 0})
"""Means of no seeds."""
LOGARITHMIC = 8.0
"""Ratio of the largest size to the smallest from which an axis is logarithmic."""


@dataclass(frozen=True)
class Row:
    """One setting at one friction and stress, Pa; `seeds` has a line for each of its packings.

    That has reached the stress; `unsettled` more have not. `before` are means of further seeds.
    """

    settings: dict[str, str]
    stress: float
    seeds: pd.DataFrame
    unsettled: int
    before: pd.Series

    @property
    def name(self) -> str:
        """The setting's."""
        return self.settings["setting"]

    @property
    def friction(self) -> float:
        """mu_comp."""
        return float(self.settings["mu_comp"])

    def mean(self, quantity: str) -> tuple[float, float, int]:
        """Mean, its standard error (NaN from one seed) and the number of seeds.

        Sums of squares about two means add up to that about the mean of all, with the distance of
        the two: so earlier seeds count as if each were known.
        """
        own = self.seeds[quantity].dropna().to_numpy(float)
        known = np.isfinite(first := float(self.before.get(quantity, np.nan)))
        before = int(self.before["seeds"]) if known else 0
        if not (count := before + own.size):
            return np.nan, np.nan, 0
        first, last = first if before else 0.0, own.mean() if own.size else 0.0
        error = float(np.nan_to_num(self.before.get(f"{quantity} error", 0.0)))
        squares = before * (before - 1) * error**2 + ((own - last) ** 2).sum()
        squares += before * own.size / count * (last - first) ** 2
        error = np.sqrt(squares / (count - 1) / count) if count > 1 else np.nan
        return float((before * first + own.size * last) / count), float(error), count


@dataclass(frozen=True)
class Sweep:
    """Settings (`columns`) that rows vary together, and nothing else from the row `base`.

    With `error` the limit is at size 0, and the distance from it an error in the first power.
    """

    title: str
    columns: tuple[str, ...]
    error: bool = False
    base: str = OWN

    def size(self, row: Row) -> float:
        """A number of a row: the first setting's, of a cell 1 over its width or length in D."""
        if "spheres" not in self.columns:
            return float(row.settings[self.columns[0]])
        width = float(row.settings["width"])
        if "width" in self.columns:
            return 1 / width
        return width**2 * NOMINAL_FRACTION / (float(row.settings["spheres"]) * np.pi / 6)

    def points(self, rows: Iterable[Row], friction: float, stress: float) -> list[Row]:
        """Its rows at one friction and stress, Pa, the base among them, by their size."""
        here = {row.name: row for row in rows if (row.friction, row.stress) == (friction, stress)}
        if self.base not in here:
            return []
        base, found = here[self.base].settings, []
        for row in here.values():
            varied = {n for n, cell in row.settings.items() if cell != base[n]} - NO_SETTING
            found += [row] if varied in (set(self.columns), set()) else []
        return sorted(found, key=self.size) if len(found) > 1 else []


RATES = "approach_rate", "inertial_number"
SWEEPS = (
    Sweep("time step / limit", ("fraction",), error=True),
    Sweep("agitated: rate (1/s)", RATES),
    Sweep("not agitated: rate (1/s)", RATES, True, "monotonic_not_agitated"),
    Sweep("servo: inertial number", ("inertial_number",), error=True),
    Sweep("agitated: damping", ("agitated_damping",)),
    Sweep("later damping", ("damping",)),
    Sweep("hot stress (Pa)", ("hot_stress",)),
    Sweep("settled: residual", ("residual",)),
    Sweep("diameter / width", ("spheres", "width"), error=True),
    Sweep("diameter / length", ("spheres",), error=True),
    Sweep("peak without friction (Pa)", ("peak",)),
)


def settings_of(table: Path) -> pd.DataFrame:
    """Settings by row and mu_comp, as texts; a dash is what the last `own` above says."""
    try:
        found = pd.read_csv(table, sep=r"\s+", comment="#", dtype=str)
    except (OSError, ValueError) as error:
        raise InputError(f"{table}: cannot be read ({error}); name a table of settings") from None
    if not {"setting", "mu_comp", "seeds"} <= set(found) or found.isna().any(axis=None):
        raise InputError(f"{table}: give each of its names a cell in each line, - for that of own")
    own = found.where(found["setting"] == OWN).ffill()
    return found.where(found != "-", own).set_index(KEY[:2], drop=False)


def made_with(settings: pd.Series) -> str:
    """What tells the packings of a row from those of another of its friction, in one cell."""
    return " ".join(settings.drop(["mu_comp", "stresses", *NO_SETTING], errors="ignore"))


def rows_of(table: Path, folder: Path, kept: Path) -> tuple[list[Row], pd.DataFrame]:
    """A row for each setting and stress of which packings are known, and the numbers of each.

    In the order of the table; packings are those of a folder of workflow/convergence.smk,
    ROW_muMU/SEED/STRESSPa.json, and of `KEPT` and `MEANS` of `kept`.
    """
    settings, made = settings_of(table), []
    for (name, friction), own in settings.iterrows():
        for path in sorted(folder.glob(f"{name}_mu{friction}/*/*Pa.json")):
            found = Measurement.read(path)
            if lacking := set(QUANTITIES.values()) - set(found):
                raise InputError(
                    f"{path}: has no {', '.join(lacking)}; remove it and make it again"
                )
            stress, seed = float(path.name.removesuffix("Pa.json")), int(path.parent.name)
            line = dict(zip(KEY, (name, friction, stress), strict=True))
            line |= {"seed": seed, "made with": made_with(own)}
            made.append(line | {column: _told(found[q]) for column, q in QUANTITIES.items()})
    parts = [_kept(kept / KEPT, table, settings, ("seed", *QUANTITIES)), pd.DataFrame(made)]
    if not any(map(len, parts)):
        raise InputError(f"{folder}: no packing of {table} is there; run workflow/convergence.smk")
    seeds = pd.concat([part for part in parts if len(part)])
    seeds = seeds.drop_duplicates([*KEY, "seed"], keep="last")
    before = _kept(kept / MEANS, table, settings, ("seeds", "unsettled")).set_index(KEY)
    order, rows = list(settings.index), []
    seeds = seeds.sort_values("seed")
    groups = {key: one for key, one in seeds.groupby(KEY)}
    for key in sorted({*groups, *before.index}, key=lambda key: (order.index(key[:2]), key[2])):
        own = groups.get(key, seeds[:0])
        there = own[own["stress_error"] < STRESS_ERROR]
        earlier = (
            before.loc[key] if key in before.index else pd.Series({"seeds": 0, "unsettled": 0})
        )
        unsettled = len(own) - len(there) + int(earlier["unsettled"])
        rows.append(Row(settings.loc[key[:2]].to_dict(), key[2], there, unsettled, earlier))
    keys = [(row.name, row.settings["mu_comp"], row.stress) for row in rows]
    return rows, pd.concat([groups[key] for key in keys if key in groups])


def _told(value: Value) -> float:
    """Its number, which a packing that is too short for it has not."""
    short = any(caveat.startswith("too short") for caveat in value.caveats)
    return np.nan if short else float(value.value)


def _kept(path: Path, table: Path, settings: pd.DataFrame, columns: Iterable[str]) -> pd.DataFrame:
    """Lines of a file; InputError where the table means other packings by their names."""
    if not path.exists():
        return pd.DataFrame(columns=[*KEY, *columns])
    found = pd.read_csv(path, dtype=str)
    if lacking := {*KEY, "made with", *columns} - set(found):
        raise InputError(f"{path}: has no column {', '.join(sorted(lacking))}; remove the file")
    for _, line in found.iterrows():
        name, friction = key = line["setting"], line["mu_comp"]
        if key not in settings.index:
            raise InputError(
                f"{path}: {table} has no row {name} of friction {friction}; remove its lines from "
                f"{path.name}, or name the table that they are of"
            )
        if line["made with"] != (now := made_with(settings.loc[key])):
            raise InputError(
                f"{path}: {name} of friction {friction} was made with {line['made with']}, "
                f"{table} says {now}; remove its lines from {path.name}"
            )
    numbers = found.columns.difference([*KEY[:2], "made with"])
    return found.astype(dict.fromkeys(numbers, float))  # of texts: to the last digit


def _text(quantity: str, value: float, error: float = np.nan) -> str:
    form = f".{DIGITS.get(quantity, 4)}f"
    if not np.isfinite(value):
        return ""
    return f"{value:{form}}" + (f" ± {error:{form}}" if np.isfinite(error) else "")


def _apart(distance: float, error: float, form: str = "{:+.1f}") -> str:
    """A distance in standard errors, where there is one."""
    return form.format(distance / error) if error > 0 else ""


def _shown(rows: list[Row]) -> list[str]:
    """Quantities of the tables that some row has."""
    names = [name for name in QUANTITIES if name not in HIDDEN]
    return [name for name in names if any(row.mean(name)[2] for row in rows)]


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
    states = sorted({(row.friction, row.stress) for row in rows})
    for sweep, state in ((sweep, state) for sweep in SWEEPS if sweep.error for state in states):
        points = sweep.points(rows, *state)
        size = np.array([sweep.size(row) for row in points])
        for quantity in shown if points else ():
            own = next(row for row in points if row.name == sweep.base)
            found = limit(size, *np.array([row.mean(quantity)[:2] for row in points]).T)
            here, its, _ = own.mean(quantity)
            off = found.distance(sweep.size(own), here, its)
            cells = [sweep.title, f"{state[0]:g}", f"{state[1] / 1e3:g}", quantity]
            cells += [_text(quantity, here, its), _text(quantity, found.value, found.error)]
            cells += [f"{off:+.1f}" if np.isfinite(off) else ""]
            lines.append([*cells, f"{found.chi:.1f}" if np.isfinite(found.chi) else ""])
    header = ["ladder", "mu_comp", "stress, kPa", "quantity", "as it is", "limit"]
    header += ["distance in errors of the difference", "chi^2 a point to spare"]
    return Table("Limits of the ladders, by a straight line", header, lines)


def twins_table(rows: list[Row]) -> Table:
    """The same settings by modal and by YADE: means, and their difference in standard errors."""
    by_name = {(row.name, row.friction, row.stress): row for row in rows}
    shown, lines = _shown(rows), []
    for (name, friction, stress), row in by_name.items():
        other = by_name.get((TWINS.get(name, ""), friction, stress))
        for quantity in shown if other else ():
            (a, s, n), (b, t, m) = row.mean(quantity), other.mean(quantity)
            line = [name, f"{friction:g}", f"{stress / 1e3:g}", quantity, f"{n}, {m}"]
            line += [_text(quantity, a, s), _text(quantity, b, t)]
            lines.append([*line, _apart(a - b, np.hypot(s, t))])
    header = ("setting", "mu_comp", "stress, kPa", "quantity", "seeds", "modal", "YADE")
    return Table("The twins", (*header, "difference in standard errors"), lines)


def picture_of(sweep: Sweep, rows: list[Row], stress: float = 1e5) -> Picture | None:
    """A row of panels for each friction, one a quantity; None without such rows.

    Bars are standard errors, the cross is the base, the line the limit with its error.
    """
    frictions = sorted({row.friction for row in rows}, reverse=True)
    sweeps = [found for mu in frictions if (found := sweep.points(rows, mu, stress))]
    shown = [name for name in DRAWN if any(row.mean(name)[2] for one in sweeps for row in one)]
    panels = [_panel(sweep, found, name) for found in sweeps for name in shown]
    return Picture(panels, columns=len(shown)) if panels else None


def _panel(sweep: Sweep, found: list[Row], quantity: str) -> Panel:
    panel = Panel(sweep.title, DRAWN[quantity], f"friction {found[0].friction:g}")
    size = np.array([sweep.size(row) for row in found])
    value, error = np.array([row.mean(quantity)[:2] for row in found]).T
    if size.min() > 0 and size.max() > LOGARITHMIC * size.min():
        panel.xscale = "log"
    if sweep.error:
        there = limit(size, value, error)
        level = np.full(len(size), there.value)
        panel.add("band", size, level - there.error, level + there.error, color="0.85")
        panel.line(size, level, color="0.3", lw=0.8)
    for x, y, s in zip(size, value, np.nan_to_num(error), strict=True):
        panel.line([x, x], [y - s, y + s], color="k", lw=1.0)
    panel.line(size, value, ls=":", marker="o", color="k")
    base = next(row for row in found if row.name == sweep.base)
    panel.line([sweep.size(base)], base.mean(quantity)[:1], marker="x", ls="none", color="#c05000")
    return panel


def write_convergence(table: Path, folder: Path, output: Path) -> list[Path]:
    """Tables, figures and `KEPT`; the packings that `output` has already count as well."""
    rows, seeds = rows_of(table, folder, output)
    output.mkdir(parents=True, exist_ok=True)
    tables = {"settings": settings_table, "limits": limits_table, "twins": twins_table}
    found = {output / name: of(rows) for name, of in tables.items()}
    paths = [path for stem, one in found.items() if one.rows for path in one.write(stem)]
    stress = seeds["stress"].map("{:g}".format)
    columns = [*KEY, "seed", "made with", *QUANTITIES]
    write_text(
        output / KEPT,
        seeds.assign(stress=stress, seed=seeds["seed"].astype(int))[columns].to_csv(index=False),
    )
    for sweep in SWEEPS:
        if picture := picture_of(sweep, rows):
            paths += save(picture, output / "_".join([sweep.base, *sorted(sweep.columns)]))
    return [*paths, output / KEPT]
