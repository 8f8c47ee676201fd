"""A study as its YAML file describes it: groups of cases by factors, each with its settings.

    name: friction_width
    groups:
      - kind: random
        factors: {friction: [0, 0.4], width: [8, 12], seed: [1, 2]}
        stress: 1e5
        wave_friction: friction + 0.1

Each combination of factors is a case. A setting is a value; a text with a factor's name in it,
which is computed; or a mapping with `by`, which a factor's value picks from. Whole numbers in a row
may be written as `seed: 1 to 8`. `cases` names exceptions.
"""

import itertools
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from modal.tools.errors import InputError

KINDS = "fcc", "random"
OTHER_NAMES = {"friction": "mu_comp", "wave_friction": "mu_wave"}
"""Words of a study, and what the programs call them."""
NEEDED = "friction", "wave_friction", "stress"
WORDS = {"kind", "direction", "sizes", "densities", "contact_model"}
"""Settings of a case that are no numbers."""
OF_CASE = {
    *(*NEEDED, *WORDS, "factors", "width", "seed", "spheres", "layers", "amplitude"),
    *("input_frequency", "fraction", "passage", "duration", "interval", "particles"),
    *("approach_rate", "agitated_damping", "inertial_number", "hot_stress", "damping"),
    *("residual", "periodic", "stress_ratio", "oedometric", "dilate", "time_step_fraction"),
}
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

FORMS = {str: "a text", list: "a list", dict: "lines NAME: VALUE", bool: "true or false"}
LISTS = {
    **{"make": (str, "kinds of product"), "measure": (str, "quantities")},
    **{"headlines": (str, "cases"), "states": (int | float, "stresses, Pa")},
    **dict.fromkeys(("band", "bands"), (int | float, "two frequencies, Hz")),
}
"""Settings that are lists, or whose lines are, and of what."""
ENTRIES = {
    "tables": ("name", "title"),
    "figures": ("name", "caption"),
    "targets": ("id", "stated", "rule"),
}
"""Parts that are lists, and what each of their entries has."""


# YAML takes 1e5 for a text; here it is a number.
_Loader: Any = type("_Loader", (yaml.SafeLoader,), {})
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[+-]?[\d.]+e[+-]?\d+$"), list("+-.0123456789")
)


class Study:
    """A study: its `settings`, and its cases as `rows` by name, each with its own settings.

    InputError, in one line that says what may stand there, where its file means no study.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.folder = self.path.parent
        found = self._yaml(self.path)
        self._known(found, DEFAULTS.keys(), "setting")
        for name, value in found.items():
            form = type(DEFAULTS[name])
            if not isinstance(value, form if form in FORMS else int | float):
                raise InputError(f"{path}: {name} {value}: give {FORMS.get(form, 'a number')}")
        if not found.get("groups"):
            raise InputError(f"{path}: no groups; give at least one, with kind and factors")
        self.settings = DEFAULTS | {"name": self.path.stem} | found
        self._known(self.settings["make"], KINDS, "make: kind")
        for part, (kind, told) in LISTS.items():
            value = self.settings[part]
            for name, own in (value if isinstance(value, dict) else {part: value}).items():
                if not (isinstance(own, list) and all(isinstance(one, kind) for one in own)):
                    raise InputError(f"{path}: {part}: {name} {own}: give a list of {told}")
        lines = [line for group in found["groups"] for line in self._group(group)]
        pattern = self.settings["names"]
        self.rows: dict[str, dict[str, Any]] = {}
        for number, line in enumerate(lines, 1):
            parts = itertools.starmap(part_of_name, line.pop("factors").items())
            name = pattern.format(number) if pattern else "_".join(parts) or "case"
            if name in self.rows:
                raise InputError(f"{path}: two cases of one name; give each its own factors")
            self.rows[name] = line
        for name, own in self.settings["cases"].items():
            if name not in self.rows:
                known = [*self.rows]
                raise InputError(f"{path}: cases: {name} is none of {known[0]} ... {known[-1]}")
            self._known(own, OF_CASE, f"{name}: setting")
            self.rows[name] |= own
        self.rows = {name: self._checked(name, line) for name, line in self.rows.items()}

    def _yaml(self, path: Path) -> Any:
        try:
            return yaml.load(path.read_text(), _Loader)
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"{path}: cannot be read ({error}); name a study's YAML") from None
        except yaml.YAMLError as error:
            text = " ".join(str(error).split())
            raise InputError(f"{path}: not YAML ({text}); mend the line that it names") from None

    def _known(self, found: Any, known: Collection[str], what: str) -> None:
        if not isinstance(found, Mapping):
            raise InputError(f"{self.path}: {what}s have names; write NAME: VALUE")
        if unknown := ", ".join(sorted(map(str, found.keys() - known))):
            told = ", ".join(sorted(known))
            raise InputError(f"{self.path}: {what} {unknown} is unknown; known are {told}")

    def _group(self, group: Any) -> Iterator[dict[str, Any]]:
        """The cases of a group: each combination of its factors, the last one fastest."""
        self._known(group, OF_CASE, "group's setting")
        if group.get("kind") not in KINDS:
            raise InputError(f"{self.path}: kind {group.get('kind')} is none of {', '.join(KINDS)}")
        self._known(group.get("factors", {}), OF_CASE, "factor")
        factors = {name: _listed(values) for name, values in group.get("factors", {}).items()}
        for values in itertools.product(*factors.values()):
            own = dict(zip(factors, values, strict=True))
            line = group | own
            for name in group.keys() - {"factors"} - factors.keys():
                line[name] = self._value(name, group[name], line)
            yield line | {"factors": own}

    def _value(self, name: str, value: Any, line: Mapping[str, Any]) -> Any:
        """A setting of one case."""
        if isinstance(value, Mapping):
            by = value.get("by")
            if by not in line:
                raise InputError(f"{self.path}: {name}: by {by} is no factor; name one")
            return value.get(line[by], value.get("else"))
        known = {n: v for n, v in line.items() if isinstance(v, int | float)}
        if isinstance(value, str) and set(re.findall(r"[a-z_]+", value)) & known.keys():
            try:
                return round(float(pd.eval(value, local_dict=known)), 12)
            except (SyntaxError, NameError, TypeError, ValueError) as error:
                raise InputError(f"{self.path}: {name}: {value} ({error}) is no sum") from None
        return value

    def _checked(self, name: str, line: Mapping[str, Any]) -> dict[str, Any]:
        """A case as the programs call its settings; InputError where one is missing."""
        for key in NEEDED:
            if line.get(key) is None:
                raise InputError(f"{self.path}: {name} has no {key}; add it")
        for key, value in line.items():
            if key not in WORDS and value is not None and not isinstance(value, int | float):
                raise InputError(f"{self.path}: {name}: {key} {value} is no number")
        if line["stress"] <= 0:
            raise InputError(f"{self.path}: {name}: stress {line['stress']} Pa; above 0")
        return {OTHER_NAMES.get(key, key): value for key, value in line.items()}

    @property
    def cases(self) -> pd.DataFrame:
        """A line a case, by name: `case`, its number from 1 on, and its settings."""
        frame = pd.DataFrame.from_dict(self.rows, orient="index")
        frame.insert(0, "case", range(1, len(frame) + 1))
        frame["name"] = frame.index
        return frame

    def part(self, name: str) -> Any:
        """A setting of many lines, or the YAML file of this name beside; empty without either."""
        path, own = self.folder / f"{name}.yaml", self.settings.get(name)
        entries = own or (self._yaml(path) if path.is_file() else [])
        for entry in entries:
            texts = isinstance(entry, Mapping) and [entry.get(key) for key in ENTRIES[name]]
            if not texts or not all(isinstance(text, str) for text in texts):
                lacks = f"{path if not own else self.path}: {name}: {entry}"
                raise InputError(f"{lacks}: give it, as texts, {', '.join(ENTRIES[name])}")
        return entries

    def stated(self) -> pd.DataFrame:
        """Stated numbers: `quantity`, `select` (cases), `value`, its ends `low` and `high`."""
        path = self.folder / "stated.csv"
        columns = ["quantity", "select", "value", "low", "high", "unit", "where"]
        found = pd.DataFrame(columns=columns)
        if path.is_file():
            found = pd.read_csv(path, dtype={"select": object})
        ends = {name: found[name].fillna(found["value"]) for name in ("low", "high")}
        return found.assign(select=found["select"].fillna(""), **ends)


@contextmanager
def following(entry: Mapping[str, Any]) -> Iterator[None]:
    """An entry of a study's part is followed: InputError that names it where that cannot be."""
    try:
        yield
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        name, why = entry.get("name", entry.get("id")), f"{type(error).__name__}: {error}"
        raise InputError(f"{name}: cannot be made ({why}); mend its entry in the study") from error


def part_of_name(factor: str, value: Any) -> str:
    """What a factor's value adds to the name of its files.

    >>> part_of_name("width", 10.0), part_of_name("contact_model", "rough 1e-6")
    ('width10', 'contact_model-rough-1e-6')
    """
    if isinstance(value, str):
        return "-".join([factor, *value.split()])
    return f"{factor}{value:g}"


def _listed(values: Any) -> list[Any]:
    """The values of a factor: a list, or the numbers of a text as `1 to 8`."""
    if ends := re.fullmatch(r"(\d+) to (\d+)", str(values)):
        return list(range(int(ends[1]), int(ends[2]) + 1))
    return values if isinstance(values, list) else [values]
