"""Read a study from its YAML file: groups of cases by factors, each with its settings.

    name: friction_width
    groups:
      - kind: random
        factors: {friction: [0, 0.4], width: [8, 12], seed: [1, 2]}
        stress: 1e5
        wave_friction: friction + 0.1

Each combination of factors is a case. A setting is a value; a text with a factor's name in it,
which is computed; or a mapping with `by`, from which the value of a factor selects. Whole numbers
in a row may be written as `seed: 1 to 8`. `cases` names exceptions.
"""

import io
import itertools
import math
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.expressions import evaluate, short
from analysis.study.kinds import Number, as_whole_number, refuse_other
from analysis.study.settings import CASE, FILE_NAME, PARTS, STUDY
from analysis.study.yaml_file import read_small, read_yaml
from modal.tools.errors import InputError, refuse_unknown

KINDS = "fcc", "random"
OTHER_NAMES = {"friction": "mu_comp", "wave_friction": "mu_wave"}
"""Words of a study, and what the programs call them."""
NEEDED = "friction", "wave_friction", "stress"
OF_GROUP = {*CASE, "factors"}
MAX_CASES = 20_000
"""Largest number of cases of a study: with more, planning the jobs alone takes hours."""
DEFAULTS: dict[str, Any] = {
    **dict.fromkeys(("name", "title", "names", "samples"), ""),
    **{name: [] for name in ("groups", "states", "measure", "tables", "figures", "headlines")},
    **{name: {} for name in ("cases", "bands")},
    "prepare": "modal",
    "spheres": 35201,
    "layers": 200,
    "seed": 1,
    "amplitude": 2.5e-9,
    "lowest_modes": 100,
    "band": [15000, 15500],
    "make": {"fcc": [], "random": []},
    "forget": False,
}
STATED = ["quantity", "select", "value", "low", "high", "unit", "where"]
"""Columns of stated.csv. `agrees_because` and `differs_because` may follow: the table of a case
prints them below a number."""


class Study:
    """A study: its `settings`, and its cases as `rows` by name, each with its own settings.

    Raises InputError, in one line with the allowed values, if its file does not describe a study.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.folder = self.path.parent
        given = read_yaml(self.path)
        self._known(given, DEFAULTS.keys(), "setting")
        for name, value in given.items():
            refuse_other(str(path), name, value, STUDY[name])
        if not given.get("groups"):
            raise InputError(
                "groups", f"{path}: no groups", remedy="give at least one, with kind and factors"
            )
        given = {name: as_whole_number(value, STUDY[name]) for name, value in given.items()}
        self.settings = DEFAULTS | {"name": self.path.stem} | given
        if self.settings["measure"]:
            from analysis.quantities import QUANTITIES

            for quantity in self.settings["measure"]:
                refuse_unknown(f"{path}: measure: quantity", quantity, QUANTITIES)
        rows = self._named_rows()
        for name, changes in self.settings["cases"].items():
            self._refuse_no_case("cases", name, rows)
            self._known(changes, OF_GROUP - {"factors"}, f"{name}: setting")
            rows[name] |= changes
        for name in (*self.settings["bands"], *self.settings["headlines"]):
            self._refuse_no_case("bands, headlines", name, rows)
        for low, high in (self.settings["band"], *self.settings["bands"].values()):
            if low >= high:
                raise InputError(
                    "band", f"{path}: band {low:g} to {high:g}", remedy="give the lower one first"
                )
        self.rows = {name: self._checked(name, row) for name, row in rows.items()}
        settings = set().union(*self.rows.values())
        for quantity in self.settings["measure"]:
            if quantity in settings:
                raise InputError(
                    "same_name",
                    f"{path}: measure",
                    f"{quantity} is a setting of the cases, too, so that tables "
                    "could not tell which one is meant",
                    "leave one out",
                )

    def _known(self, given: Any, known: Collection[str], what: str) -> None:
        """Raise InputError unless these are lines NAME: VALUE with known names."""
        if not isinstance(given, Mapping):
            raise InputError(
                "no_names", f"{self.path}: {what}s have names", remedy="write NAME: VALUE"
            )
        if unknown := ", ".join(sorted(short(name) for name in given if name not in known)):
            names = ", ".join(sorted(known))
            raise InputError(
                "unknown_setting",
                f"{self.path}: {what} {short(unknown)} is unknown",
                remedy=f"known are {names}",
            )

    def _refuse_no_case(self, where: str, name: str, rows: Mapping[str, Any]) -> None:
        """Raise InputError if a name is not that of a case."""
        if name not in rows:
            first, *_, last = *rows, *rows
            raise InputError(
                "unknown_case",
                f"{self.path}: {where}",
                f"{short(name)} is none of {first} ... {last}",
            )

    def _named_rows(self) -> dict[str, dict[str, Any]]:
        """Return the settings of the cases of all groups, by the name of the case."""
        groups = self.settings["groups"]
        factors = [self._factors(group) for group in groups]
        self._refuse_absent_choices(groups, factors)
        count = sum(math.prod(map(len, values.values())) for values in factors)
        if count > MAX_CASES:
            raise InputError(
                "too_many_cases",
                f"{self.path}: {count:.3g} cases",
                remedy=(
                    f"a study has {MAX_CASES} at most: leave factors out, or make several studies"
                ),
            )
        pattern = self.settings["names"]
        rows: dict[str, dict[str, Any]] = {}
        for group, values in zip(groups, factors, strict=True):
            for combination, row in self._group(group, values):
                name = "_".join(itertools.starmap(part_of_name, combination.items())) or "case"
                if pattern:
                    name = pattern.format(len(rows) + 1)
                refuse_other(str(self.path), "a case is called", name, FILE_NAME)
                if name in rows:
                    raise InputError(
                        "same_name",
                        f"{self.path}: two cases of one name, {name}",
                        remedy="give each its own factors",
                    )
                rows[name] = row
        if not rows:
            raise InputError("no_cases", f"{self.path}: no cases", remedy="give factors values")
        return rows

    def _factors(self, group: Any) -> dict[str, list[Any]]:
        """Return the values of each factor of a group."""
        self._known(group, OF_GROUP, "group's setting")
        kind = group.get("kind")
        if kind not in KINDS:
            raise InputError(
                "kind", f"{self.path}: kind {short(kind)} is none of {', '.join(KINDS)}"
            )
        factors = group.get("factors", {})
        self._known(factors, OF_GROUP - {"factors"}, "factor")
        values = {name: self._listed(name, given) for name, given in factors.items()}
        for name, several in values.items():
            for value in several:
                refuse_other(str(self.path), f"factor {name}", value, CASE[name])
        return values

    def _refuse_absent_choices(
        self, groups: list[Any], factors: list[dict[str, list[Any]]]
    ) -> None:
        """Raise InputError for a choice `by` a value of a factor that no case of any group has.

        Groups may share their choices: a value may belong to any group.
        """
        for group in groups:
            for name, choices in group.items():
                if name == "factors" or not isinstance(choices, Mapping):
                    continue
                factor = choices.get("by")
                if not isinstance(factor, str):
                    continue
                values: list[Any] = []
                for other_group, other_factors in zip(groups, factors, strict=True):
                    if factor in other_factors:
                        values += other_factors[factor]
                    elif factor in other_group:
                        values.append(other_group[factor])
                for choice in choices:
                    if values and choice not in ("by", "else", *values):
                        raise InputError(
                            "absent_choice",
                            f"{self.path}: {name}",
                            f"no case has {factor} {short(choice)}",
                            "mend the number, or leave it out",
                        )

    def _listed(self, name: str, given: Any) -> list[Any]:
        """Return the values of a factor from a list, a single value, or a text like `1 to 8`."""
        if isinstance(given, str) and (ends := re.fullmatch(r"(\d{1,9}) to (\d{1,9})", given)):
            first = int(ends[1])
            last = int(ends[2])
            if last - first >= MAX_CASES:
                raise InputError(
                    "too_many_cases",
                    f"{self.path}: {name} {given}",
                    f"a study has {MAX_CASES} cases at most",
                )
            given = list(range(first, last + 1))
        values = given if isinstance(given, list) else [given]
        if not values:
            raise InputError(
                "no_cases", f"{self.path}: factor {name} has no value", remedy="add one"
            )
        return values

    def _group(
        self, group: Mapping[str, Any], factors: Mapping[str, list[Any]]
    ) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
        """Yield each combination of a group's factors, the last one fastest, and its settings."""
        others = group.keys() - {"factors"} - factors.keys()
        for values in itertools.product(*factors.values()):
            combination = dict(zip(factors, values, strict=True))
            line = {name: value for name, value in group.items() if name != "factors"} | combination
            numbers = {name: value for name, value in line.items() if _is_number(value)}
            yield combination, line | {n: self._value(n, group[n], line, numbers) for n in others}

    def _value(
        self, name: str, value: Any, line: Mapping[str, Any], numbers: Mapping[str, float]
    ) -> Any:
        """Return a setting of one case; None if a choice `by` a factor has no line for it."""
        if isinstance(value, Mapping):
            by = value.get("by")
            if not isinstance(by, str) or by not in line:
                raise InputError(
                    "no_factor", f"{self.path}: {name}", f"by {short(by)} is no factor", "name one"
                )
            return value.get(line[by], value.get("else"))
        if value is None:
            raise InputError(
                "setting", f"{self.path}: {name} has no value", remedy="give one, or leave it out"
            )
        if isinstance(value, str) and isinstance(CASE[name], Number):
            return self._computed(name, value, numbers)
        return value

    def _computed(self, name: str, text: str, numbers: Mapping[str, float]) -> float:
        """Return a setting that is computed from other settings."""
        try:
            value = evaluate(text, numbers)
        except InputError as error:
            raise InputError(error.code, f"{self.path}: {name}", f"{error}") from None
        if not _is_number(value):
            raise InputError(
                "setting",
                f"{self.path}: {name}",
                f"{short(text)} is no number",
                "write a sum of other settings",
            )
        return round(float(value), 12)

    def _checked(self, name: str, line: Mapping[str, Any]) -> dict[str, Any]:
        """Return the settings of a case by the names in programs; InputError if one is missing."""
        for key in NEEDED:
            if line.get(key) is None:
                raise InputError("no_setting", f"{self.path}: {name} has no {key}", remedy="add it")
        changes = self.settings["cases"].get(name, {})
        for key, value in line.items():
            if value is not None or key in changes:
                refuse_other(f"{self.path}: {name}", key, value, CASE[key])
        settings = {}
        for key, value in line.items():
            settings[OTHER_NAMES.get(key, key)] = as_whole_number(value, CASE[key])
        return settings

    @property
    def cases(self) -> pd.DataFrame:
        """Return a line for each case: its number `case`, from 1 on, and its settings."""
        frame = pd.DataFrame.from_dict(self.rows, orient="index")
        frame.insert(0, "case", range(1, len(frame) + 1))
        frame["name"] = frame.index
        return frame

    def part(self, part: str) -> list[dict[str, Any]]:
        """Return a part of many lines, from the study or the YAML file beside it; else none."""
        path = self.folder / f"{part}.yaml"
        entries = self.settings.get(part)
        where = f"{self.path}: {part}"
        if not entries:
            entries = (read_yaml(path) or []) if path.exists() else []
            where = str(path)
        if not isinstance(entries, list):
            raise InputError(
                "setting", f"{where}", remedy="give a list, a line - NAME: VALUE ... each"
            )
        names: set[Any] = set()
        for number, entry in enumerate(entries, 1):
            name = entry.get("name", entry.get("id")) if isinstance(entry, dict) else None
            fault = PARTS[part].find_fault(entry)
            if fault:
                entry_name = short(name or f"entry {number}")
                raise InputError("setting", f"{where}: {entry_name}", f"{fault}")
            if name in names:
                raise InputError(
                    "same_name", f"{where}: {short(name)} stands twice", remedy="rename one"
                )
            names.add(name)
        return entries

    def stated(self) -> pd.DataFrame:
        """Return stated numbers: `quantity`, `select` (cases), `value`, ends `low` and `high`."""
        path = self.folder / "stated.csv"
        found = pd.DataFrame(columns=STATED)
        if path.exists():
            found = self._read_stated(path)
        ends = {name: found[name].fillna(found["value"]) for name in ("low", "high")}
        return found.assign(select=found["select"].fillna(""), **ends)

    def _read_stated(self, path: Path) -> pd.DataFrame:
        """Return the table of stated numbers from its file; InputError for another file."""
        text = read_small(path)
        texts = dict.fromkeys(("quantity", "select"), object)
        try:
            found = pd.read_csv(io.StringIO(text), dtype=texts)
            numbers = {name: pd.to_numeric(found[name]) for name in ("value", "low", "high")}
            quantities, _ = (found[name].fillna("") for name in texts)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                "stated",
                f"{path}: no table of {', '.join(STATED)} ({short(str(error))})",
                remedy="mend it",
            ) from None
        _refuse_reversed_ends(path, numbers)
        infinite = any(np.isinf(column).any() for column in numbers.values())
        if infinite or not quantities.map(str.isidentifier).all():
            raise InputError(
                "stated",
                f"{path}",
                remedy="give each line a quantity, one word, and finite numbers",
            )
        return found.assign(**numbers)


def _refuse_reversed_ends(path: Path, numbers: Mapping[str, pd.Series]) -> None:
    """Raise InputError for a stated interval that is empty or does not contain its value."""
    low = numbers["low"].fillna(-np.inf)
    high = numbers["high"].fillna(np.inf)
    value = numbers["value"]
    is_wrong = (low > high) | (value < low) | (value > high)
    if is_wrong.any():
        row = int(is_wrong.argmax())
        raise InputError(
            "bounds",
            f"{path}, line {row + 2}: {value[row]:g} with the ends {low[row]:g} and {high[row]:g}",
            remedy="give the lower end first, and the value between them",
        )


@contextmanager
def following(entry: Mapping[str, Any]) -> Iterator[None]:
    """Name the entry of a study in an InputError if its settings cannot be carried out."""
    try:
        yield
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        name = entry.get("name", entry.get("id"))
        why = f"{type(error).__name__}: {error}"
        raise InputError(
            "entry",
            f"{name}: cannot be made ({short(why, 200)})",
            remedy="mend its entry in the study",
        ) from error


def part_of_name(factor: str, value: Any) -> str:
    """Return the part of file names that stands for a factor's value.

    >>> part_of_name("width", 10.0), part_of_name("contact_model", "rough 1e-6")
    ('width10', 'contact_model-rough-1e-6')
    """
    if isinstance(value, str):
        return "-".join([factor, *value.split()])
    return f"{factor}{value:g}"


def _is_number(value: Any) -> bool:
    """Tell whether a value is a number, which true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)
