"""Numbers of each packing of studies/convergence/*.table, by row, stress and seed; their one file.

The packings are large and stay where they were made. `KEPT` holds the settings and numbers of each
with all digits, so that seeds made later join those made before. Of some earlier seeds only mean
and standard error are known, rounded to what a table printed: `MEANS`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.batch_table import lines_of
from analysis.measurement import Measurement
from analysis.table import Table, read_csv
from analysis.value import Value
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
KEPT, MEANS = "seeds.csv", "means.csv"
OWN = "own"
NO_SETTING = {"setting", "seeds"}
"""Columns of the table of rows that change nothing of a packing."""

Key = tuple[str, str, float]
"""Name of a row, its mu_comp as the table has it, and the stress, Pa."""


@dataclass(frozen=True)
class Means:
    """Mean and standard error by quantity of `count` seeds; `unsettled` ones more have none."""

    count: int
    unsettled: int
    values: dict[str, tuple[float, float]]

    def joined(self, quantity: str, seeds: np.ndarray) -> tuple[float, float, int]:
        """Mean, standard error and number of these and the (n,) numbers of further seeds.

        Exact but for the rounding: sums of squares about two means add up to that about the mean of
        all, with the distance of the two.
        """
        if quantity not in self.values or not self.count:
            return _mean(seeds)
        before, error = self.values[quantity]
        squares = self.count * (self.count - 1) * np.nan_to_num(error) ** 2
        if not seeds.size:
            return before, error, self.count
        count, after = self.count + seeds.size, float(seeds.mean())
        squares += float(((seeds - after) ** 2).sum())
        squares += self.count * seeds.size / count * (after - before) ** 2
        mean = (self.count * before + seeds.size * after) / count
        return mean, float(np.sqrt(squares / (count - 1) / count)), count


NONE = Means(0, 0, {})


def _told(value: Value) -> float:
    """Its number, which a packing that is too short for it has not."""
    short = any(caveat.startswith("too short") for caveat in value.caveats)
    return np.nan if short else float(value.value)


def _mean(seeds: np.ndarray) -> tuple[float, float, int]:
    """Mean, its standard error (NaN from one seed) and the number of seeds."""
    if not seeds.size:
        return np.nan, np.nan, 0
    error = seeds.std(ddof=1) / np.sqrt(seeds.size) if seeds.size > 1 else np.nan
    return float(seeds.mean()), float(error), seeds.size


class Seeds:
    """Packings of the rows of one table: `settings` of each row, `numbers` by key and seed."""

    def __init__(self, table: str | Path) -> None:
        self.table = Path(table)
        self.settings: dict[tuple[str, str], dict[str, str]] = {}
        self.numbers: dict[Key, dict[int, dict[str, float]]] = {}
        self.means: dict[Key, Means] = {}
        own: dict[str, str] = {}
        for row in lines_of(self.table):
            own = row if row["setting"] == OWN else own
            row = {name: own[name] if cell == "-" else cell for name, cell in row.items()}
            self.settings[row["setting"], row["mu_comp"]] = row

    def ordered(self) -> list[Key]:
        """Of all packings that are known, in the order of the table, stresses rising."""
        known = self.numbers.keys() | self.means.keys()
        return [key for row in self.settings for key in sorted(known) if key[:2] == row]

    def add_folder(self, folder: str | Path) -> None:
        """Packings ROW_muMU/SEED/STRESSPa.json of workflow/convergence.smk."""
        for name, friction in self.settings:
            for path in sorted(Path(folder, f"{name}_mu{friction}").glob("*/*Pa.json")):
                found = Measurement.read(path)
                if lacking := set(QUANTITIES.values()) - set(found):
                    raise InputError(
                        f"{path}: has no {', '.join(lacking)}, an older version made it; remove it "
                        "and run workflow/convergence.smk"
                    )
                state = {column: _told(found[name]) for column, name in QUANTITIES.items()}
                key = name, friction, float(path.name.removesuffix("Pa.json"))
                self.numbers.setdefault(key, {})[int(path.parent.name)] = state

    def add_kept(self, folder: Path) -> None:
        """Of the `KEPT` and `MEANS` of a folder, where they are there."""
        for key, row in self._lines(folder / KEPT, ("seed", *QUANTITIES)):
            numbers = {name: float(row[name] or "nan") for name in QUANTITIES}
            self.numbers.setdefault(key, {})[int(row["seed"])] = numbers
        for key, row in self._lines(folder / MEANS, ("seeds", "unsettled")):
            known = [name for name in QUANTITIES if row.get(name)]
            pairs = {
                name: (float(row[name]), float(row[f"{name} error"] or "nan")) for name in known
            }
            self.means[key] = Means(int(row["seeds"]), int(row["unsettled"]), pairs)

    def _lines(self, path: Path, columns: Sequence[str]) -> Iterator[tuple[Key, dict[str, str]]]:
        """Lines of a file; InputError where the table means other packings by their names."""
        if not path.exists():
            return
        found = read_csv(path, path.name)
        if lacking := {"setting", "mu_comp", "stress", "made with", *columns} - set(found.header):
            raise InputError(f"{path}: has no column {', '.join(sorted(lacking))}; remove the file")
        for row in (dict(zip(found.header, cells, strict=True)) for cells in found.rows):
            name, friction = row["setting"], row["mu_comp"]
            now = self.settings.get((name, friction))
            if now is None:
                raise InputError(
                    f"{path}: {self.table} has no row {name} of friction {friction}; remove its "
                    f"lines from {path.name}, or name the table that they are of"
                )
            if row["made with"] != self.made_with(now):
                raise InputError(
                    f"{path}: {name} of friction {friction} was made with {row['made with']}, "
                    f"{self.table} says {self.made_with(now)}; remove its lines from {path.name}"
                )
            yield (name, friction, float(row["stress"])), row

    @staticmethod
    def made_with(settings: dict[str, str]) -> str:
        """What tells the packings of a row from those of another of its friction, in one cell."""
        left_out = {"mu_comp", "stresses"} | NO_SETTING
        return " ".join(cell for name, cell in settings.items() if name not in left_out)

    def kept(self) -> Table:
        """The table of `KEPT`: a line for each row, stress and seed."""
        lines = []
        for key in self.ordered():
            made_with = self.made_with(self.settings[key[:2]])
            for seed, state in sorted(self.numbers.get(key, {}).items()):
                numbers = [repr(v) if np.isfinite(v := state[n]) else "" for n in QUANTITIES]
                lines.append([*key[:2], f"{key[2]:g}", f"{seed}", made_with, *numbers])
        header = ["setting", "mu_comp", "stress", "seed", "made with", *QUANTITIES]
        return Table("Numbers of each packing", header, lines)
