"""Hold the files of one packing: their kinds, their names, and their contents, read on demand.

The kind of a file follows from its schema; files belong together if they contain the digest of the
same packing.
"""

from __future__ import annotations

import glob
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from analysis.agreement import OTHER_RUNS
from analysis.estimators import structure_factor
from modal.elasticity import moduli
from modal.formats.attributes import read_attributes
from modal.formats.hdf5 import complete, open_h5
from modal.formats.provenance import Source, packing_of, read_provenance, require_same_packing
from modal.modes import density, mode_set
from modal.packing import network, sample
from modal.tools.errors import InputError, UnavailableError
from modal.waves import response, signals

ABSENT = "what it is read from is not among the packing's files"


class AbsentError(UnavailableError):
    """Raised if a file of the packing, or a recorded wave, does not exist."""

    def __init__(self, problem: str = ABSENT, reason: str = "", remedy: str = "") -> None:
        super().__init__("absent", problem, reason, remedy)


PACKINGS = "network", "sample"
"""Kinds of files that hold a packing."""
WAVES = "shear_yade.signals", "signals", "shear.signals"
"""Kinds of recorded waves: an S-wave by YADE, the YADE run of the case with its P-wave, and the
linear S-wave."""
OTHER_WAVES = tuple(f"{run}.signals" for run in ("100kHz", "shear_yade", *OTHER_RUNS))
"""Kinds of further YADE runs of a case: with a pulse of 100 kHz, of an S-wave, and those that split
the difference to the linear wave (`analysis.agreement.OTHER_RUNS`)."""
KINDS = (
    "network",
    "modes",
    "translations.modes",
    "signals",
    "sample",
    "highest.modes",
    "band.modes",
    "linear.signals",
    "structure",
    "density",
    "response",
    "shear.signals",
    "moduli",
    "other.signals",
    *OTHER_WAVES,
)
"""All kinds of files of a case; the word behind the last dot names its format."""


def _read_gain(path: Path) -> response.Response:
    """Read a response of elastic contacts to P-waves; InputError for any other response."""
    contents = response.read_response(path)
    if contents.damping or contents.direction != "z":
        raise InputError(
            "other_response",
            f"{path}: of viscous contacts or of an S-wave, which the report's gain is not",
            remedy="leave it out, or make it without --damping, --direction",
        )
    return contents


class Format(NamedTuple):
    """A format of files: the module that has its SCHEMA, and the function that reads it."""

    module: ModuleType
    read: Callable[[Path], Any]


FORMATS: dict[str, Format] = {
    "network": Format(network, network.read_network),
    "sample": Format(sample, sample.read_sample),
    "signals": Format(signals, signals.read_signals),
    "other.signals": Format(signals, partial(signals.read_signals, of_any_source=True)),
    "modes": Format(mode_set, partial(mode_set.read_modes, shapes=False)),
    "highest.modes": Format(mode_set, mode_set.read_modes),
    "density": Format(density, density.read_density),
    "response": Format(response, _read_gain),
    "structure": Format(structure_factor, structure_factor.read_structure),
    "moduli": Format(moduli, moduli.read_moduli),
}
"""Format of each kind of files, or of the last word of a kind."""
KIND_BY_SCHEMA = {each.module.SCHEMA: kind for kind, each in FORMATS.items()}
"""Kind of files by schema; modes and signals are of several kinds."""
COLUMNS_FROM_WALL_TO_WALL = ("chain/particle", "receiver/stress", "source/stress")
"""Datasets of every record of a wave from wall to wall."""


@dataclass
class Case:
    """The files of one packing.

    Attributes
    ----------
    name : str
        First part of the files' names.
    folder : Path
    files : dict of str to Path, or None
        Files by kind; None for all files in the folder that begin with the name.
    notes : list of str
        Remarks for the user on files that have been read.
    contents : dict
        Contents of the files that have been read, by kind.
    """

    name: str
    folder: Path
    files: dict[str, Path] | None = None
    notes: list[str] = field(default_factory=list)
    contents: dict[str, Any] = field(default_factory=dict, repr=False)

    @property
    def number(self) -> int | None:
        """Return the number of the case in a study, read from its name; None if it has none."""
        match = re.fullmatch(r"case(\d+)", self.name)
        if match is None:
            return None
        return int(match[1])

    @property
    def short(self) -> str:
        """Return `case 2` for a case of the study, otherwise the name."""
        if self.number is None:
            return self.name
        return f"case {self.number}"

    def path(self, kind: str) -> Path:
        """Return the path of the file of a kind, whether it exists or not."""
        path = self.folder / f"{self.name}.{kind}.h5"
        if self.files is None:
            return path
        return self.files.get(kind, path)

    def has(self, kind: str) -> bool:
        """Tell whether the file of a kind exists, or is among the given files."""
        if self.files is None:
            return self.path(kind).is_file()
        return kind in self.files

    @property
    def there(self) -> list[str]:
        """Return the kinds of files that exist for this case."""
        return [kind for kind in KINDS if self.has(kind)]

    @cached_property
    def packing_path(self) -> Path:
        """Return the path of the network, or of the sample without a network.

        Raises InputError if there is neither.
        """
        for kind in PACKINGS:
            if self.has(kind):
                return self.path(kind)
        raise InputError(
            "no_packing", f"{self.path('network')}: no such file", remedy="run the case first"
        )

    @cached_property
    def packing(self) -> tuple[Source, ...]:
        """Return the packing's file and the sample from which it was exported."""
        return packing_of(self.packing_path)

    def check(self) -> None:
        """Raise InputError if any file of the case was made from another packing."""
        for kind in self.there:
            if kind not in PACKINGS:
                self.product(kind)

    def product(self, kind: str) -> Path:
        """Return the path of a product; InputError if it was made from another packing.

        A product that does not say from which packing it was made adds a note.
        """
        note = require_same_packing(self.path(kind), self.packing)
        if note and note not in self.notes:
            self.notes.append(note)
        return self.path(kind)

    def read(self, kind: str) -> Any:
        """Return the contents of the file of a kind, modes without shapes; None without it."""
        if kind in self.contents:
            return self.contents[kind]
        if not self.has(kind):
            return None
        name = kind
        if kind not in FORMATS:
            name = kind.split(".")[-1]
        self.contents[kind] = FORMATS[name].read(self.product(kind))
        return self.contents[kind]

    def needed(self, kind: str) -> Any:
        """Return the contents of a file; AbsentError if the file does not exist."""
        if not self.has(kind):
            raise AbsentError(f"{self.path(kind)}: no such file", remedy="make it before")
        return self.read(kind)


def cases_of_files(paths: Sequence[str | Path]) -> list[Case]:
    """Return a case for each packing among the files, with the products made from it.

    A product in the packing's folder with the packing's name is added if no other file of its kind
    is given. Raises InputError for files of an unknown schema, if there is no packing, for products
    of another packing than the given ones, and for two files of the same kind.
    """
    kinds = {Path(path): kind_of(path) for path in paths}
    cases: list[Case] = []
    # Networks come first: a sample may be the one from which a network was exported.
    for wanted in PACKINGS:
        for path, kind in kinds.items():
            if kind == wanted:
                _add_packing(cases, wanted, path)
    if not cases:
        names = ", ".join(map(str, kinds)) or "waves alone"
        raise InputError(
            "no_packing", f"{names}: no packing", remedy="name its *.network.h5 as well"
        )
    for path, kind in kinds.items():
        if kind not in PACKINGS:
            _add_file(owner_of(path, cases), kind, path)
    for case in cases:
        _add_products_beside(case, set(kinds))
    return cases


def _add_packing(cases: list[Case], kind: str, path: Path) -> None:
    """Add a packing to the cases: as a new case, or as the sample of an existing network."""
    digest = packing_of(path)[0].sha256
    exported = []
    for case in cases:
        if digest in {source.sha256 for source in case.packing}:
            exported.append(case)
    if kind == "sample" and exported:
        for case in exported:
            _add_file(case, kind, path)
        return
    cases.append(Case(_case_name(path, cases), path.parent, {kind: path}))


def kind_of(path: str | Path) -> str:
    """Return the kind of product that a file is, by its schema.

    There are several kinds of modes, by the choice of modes, and several kinds of signals, by the
    direction of the wall and the recording program. Raises InputError for an unknown schema.
    """
    with open_h5(path) as file, complete(path):
        attributes = {name: str(text) for name, text in read_attributes(file).items()}
        schema = attributes.get("schema", "")
        has_both_walls = all(name in file for name in COLUMNS_FROM_WALL_TO_WALL)
        choice = mode_set.Choice("all")
        if schema == mode_set.SCHEMA:
            choice = mode_set.Choice.of_attributes(attributes)
    if schema == mode_set.SCHEMA:
        return _kind_of_modes(path, choice)
    if schema == signals.SCHEMA:
        return _kind_of_signals(attributes, has_both_walls)
    if schema not in KIND_BY_SCHEMA:
        raise InputError(
            "unknown_schema", f"{path}: schema is {schema!r}, of no product that a report reads"
        )
    return KIND_BY_SCHEMA[schema]


def _kind_of_modes(path: str | Path, choice: mode_set.Choice) -> str:
    """Return the kind of a file with modes."""
    settings = read_provenance(path).settings or {}
    if settings.get("translations_only", str(path).endswith(".translations.modes.h5")):
        return "translations.modes"
    if choice.kind == "highest":
        return "highest.modes"
    if choice.low > 0:
        return "band.modes"
    return "modes"


def _kind_of_signals(attributes: dict[str, str], has_both_walls: bool) -> str:
    """Return the kind of a file with signals: from wall to wall, or of another wave."""
    direction = attributes.get("direction", "z")
    is_from_wall = attributes.get("source", "wall") in signals.WALL_SOURCES
    if not is_from_wall or direction == signals.TORSION or not has_both_walls:
        return "other.signals"
    if direction == "z":
        return "signals"
    if attributes.get("producer") == "yade":
        return "shear_yade.signals"
    return "shear.signals"


def owner_of(path: Path, cases: list[Case]) -> Case:
    """Return the case from whose packing a product was made; if unknown, the only case.

    Raises InputError if it was made from none of the packings.
    """
    if len(cases) == 1:
        require_same_packing(path, cases[0].packing)
        return cases[0]
    if not read_provenance(path).packing:
        raise InputError(
            "unknown_packing",
            f"{path}: does not say of which packing it is",
            remedy="give it with that packing alone",
        )
    for case in cases:
        with suppress(InputError):
            require_same_packing(path, case.packing)
            return case
    raise InputError(
        "other_packing",
        f"{path}: made from none of the packings given",
        remedy="name its packing as well",
    )


def _add_products_beside(case: Case, given: set[Path]) -> None:
    """Add the products in a packing's folder that have the packing's name.

    Products of another packing and damaged ones are left out without an error, because the user did
    not name them.
    """
    path = case.packing_path
    stem = _stem(path)
    for product in sorted(path.parent.glob(f"{glob.escape(stem)}.*.h5")):
        if product in given:
            continue
        with suppress(InputError):
            kind = kind_of(product)
            name = product.name[len(stem) + 1 : -len(".h5")]
            # One of several waves of a case.
            if name in KINDS and name.endswith(f".{kind}"):
                kind = name
            if kind in PACKINGS or kind in (case.files or ()):
                continue
            # A product that does not say from which packing it was made is noted there.
            if not require_same_packing(product, case.packing):
                _add_file(case, kind, product)


def _add_file(case: Case, kind: str, path: Path) -> None:
    """Add a file to a case; InputError if it already has this kind."""
    assert case.files is not None
    if kind in case.files:
        raise InputError(
            "two_of_a_kind",
            f"{case.files[kind]} and {path} are both {kind} of one packing",
            remedy="give one",
        )
    case.files[kind] = path


def _case_name(path: Path, cases: list[Case]) -> str:
    """Return the file's name without its ending; with its folder if another case has the name."""
    name = _stem(path)
    if name in {case.name for case in cases}:
        return f"{path.resolve().parent.name}-{name}"
    return name


def _stem(packing: Path) -> str:
    """Return the name of a packing's file without its kind and its ending."""
    return re.sub(rf"(\.({'|'.join(PACKINGS)}))?\.h5$", "", packing.name)
