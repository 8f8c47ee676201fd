"""A case: the files of one packing, what they are called, and what they hold, read on demand.

Each is recognised by its schema, all are joined by the packing's digest.
"""

from __future__ import annotations

import glob
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

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
    """What something is read from is not there: a file of the packing, or a wave."""

    def __init__(self, problem: str = ABSENT, reason: str = "", remedy: str = "") -> None:
        super().__init__("absent", problem, reason, remedy)


PACKINGS = "network", "sample"
WAVES = "shear_yade.signals", "signals", "shear.signals"
"""Recorded waves; S-waves by YADE are a further run, or the case's own run; and the linear one."""
OTHER_WAVES = tuple(f"{run}.signals" for run in ("100kHz", "shear_yade", *OTHER_RUNS))
"""Further YADE runs of a case: its pulse at 100 kHz where its own is another, an S-wave, and those
that split its difference to the linear wave (`analysis.agreement.OTHER_RUNS`)."""
KINDS = (
    *("network", "modes", "translations.modes", "signals"),
    *("sample", "highest.modes", "band.modes", "linear.signals"),
    *("structure", "density", "response", "shear.signals", "moduli"),
    *OTHER_WAVES,
)
"""All kinds of files of a case; their last word names their format."""


def _read_gain(path: Path) -> response.Response:
    """A response of elastic contacts and P-waves; InputError for another."""
    found = response.read_response(path)
    if found.damping or found.direction != "z":
        why = "of viscous contacts or of an S-wave, which the report's gain is not"
        raise InputError(
            "input",
            f"{path}: {why}",
            remedy="leave it out, or make it without --damping, --direction",
        )
    return found


FORMATS: dict[str, tuple[Any, Callable[[Path], Any]]] = {
    "network": (network, network.read_network),
    "sample": (sample, sample.read_sample),
    "signals": (signals, signals.read_signals),
    "modes": (mode_set, partial(mode_set.read_modes, shapes=False)),
    "highest.modes": (mode_set, mode_set.read_modes),
    "density": (density, density.read_density),
    "response": (response, _read_gain),
    "structure": (structure_factor, structure_factor.read_structure),
    "moduli": (moduli, moduli.read_moduli),
}
"""Kind, or last word of one: the module that has its SCHEMA and VERSION, and its reader."""
KIND_OF = {form.SCHEMA: kind for kind, (form, _) in FORMATS.items()}
"""Kinds of product by their schema; modes are of several kinds, and so are signals."""


@dataclass
class Case:
    """One packing's files: those of a name in a folder, or the given ones by their kind."""

    name: str
    folder: Path
    files: dict[str, Path] | None = None
    notes: list[str] = field(default_factory=list)
    """What a reader should know: products that do not say which packing they are of."""
    held: dict[str, Any] = field(default_factory=dict)
    """What has been read of the files, by their kind."""

    @property
    def number(self) -> int | None:
        """The case's number in the study, from its name; None where it has none."""
        match = re.fullmatch(r"case(\d+)", self.name)
        return int(match[1]) if match else None

    @property
    def short(self) -> str:
        """`case 2` for a case of the study, else the name."""
        return self.name if self.number is None else f"case {self.number}"

    def path(self, kind: str) -> Path:
        """File of one kind of product: where it is, or would be."""
        return (self.files or {}).get(kind, self.folder / f"{self.name}.{kind}.h5")

    def has(self, kind: str) -> bool:
        """Whether the file exists, and belongs to the case where its files were given."""
        return self.path(kind).is_file() if self.files is None else kind in self.files

    @property
    def there(self) -> list[str]:
        """Kinds of the files that are there."""
        return [kind for kind in KINDS if self.has(kind)]

    @cached_property
    def packing_path(self) -> Path:
        """The network, or the sample where there is none; without it nothing can be said."""
        for kind in PACKINGS:
            if self.has(kind):
                return self.path(kind)
        raise InputError(
            "input", f"{self.path('network')}: no such file", remedy="run the case first"
        )

    @cached_property
    def packing(self) -> tuple[Source, ...]:
        """The packing's file and the sample that it was exported from."""
        return packing_of(self.packing_path)

    def check(self) -> None:
        """InputError where any product at hand is of another packing."""
        for kind in self.there:
            if kind not in PACKINGS:
                self.product(kind)

    def product(self, kind: str) -> Path:
        """File of a product; InputError, naming both files, where it is of another packing."""
        note = require_same_packing(self.path(kind), self.packing)
        if note and note not in self.notes:
            self.notes.append(note)
        return self.path(kind)

    def read(self, kind: str) -> Any:
        """What the file of a kind holds, modes without shapes; None where there is none."""
        if kind not in self.held:
            read = FORMATS[kind if kind in FORMATS else kind.split(".")[-1]][1]
            self.held[kind] = read(self.product(kind)) if self.has(kind) else None
        return self.held[kind]

    def needed(self, kind: str) -> Any:
        """The same of a file that must be there; else `AbsentError`."""
        if not self.has(kind):
            raise AbsentError(f"{self.path(kind)}: no such file", remedy="make it before")
        return self.read(kind)


def cases_of_files(paths: Sequence[str | Path]) -> list[Case]:
    """One case for each packing among the files, with what was made from it.

    What was made from it and lies beside it under its name is read too, if no other file of its
    kind is given. InputError for files of no known schema, without any packing, of another packing
    than those given, and where two files are of one kind.
    """
    kinds = {Path(path): kind_of(path) for path in paths}
    cases: list[Case] = []
    for wanted in PACKINGS:  # networks first: a sample may be what one was exported from
        for path in (path for path, kind in kinds.items() if kind == wanted):
            own = packing_of(path)[0].sha256
            parent = [case for case in cases if own in {each.sha256 for each in case.packing}]
            if wanted == "sample" and parent:
                for case in parent:
                    _give(case, wanted, path)
            else:
                cases.append(Case(_name(path, cases), path.parent, {wanted: path}))
    if not cases:
        told = ", ".join(map(str, kinds)) or "waves alone"
        raise InputError("input", f"{told}: no packing", remedy="name its *.network.h5 as well")
    for path in (path for path, kind in kinds.items() if kind not in PACKINGS):
        _give(owner_of(path, cases), kinds[path], path)
    for case in cases:
        _give_what_lies_beside(case, set(kinds))
    return cases


def kind_of(path: str | Path) -> str:
    """The kind of product that a file is, by its schema.

    Of modes also by which were asked for, of signals by the direction of the wall and by who made
    them.
    """
    with open_h5(path) as file, complete(path):
        noted = {name: str(note) for name, note in read_attributes(file).items()}
        schema = noted.get("schema", "")
        choice = mode_set.Choice.of_attributes(noted if schema == mode_set.SCHEMA else {})
    if schema == mode_set.SCHEMA:
        settings = read_provenance(path).settings or {}
        if settings.get("translations_only", str(path).endswith(".translations.modes.h5")):
            return "translations.modes"
        if choice.kind == "highest":
            return "highest.modes"
        return "band.modes" if choice.low > 0 else "modes"
    if schema == signals.SCHEMA and noted.get("schema_version") == "2":
        raise InputError(
            "input", f"{path}: not a wave from wall to wall", remedy="a report reads no other"
        )
    if schema == signals.SCHEMA and noted.get("direction", "z") != "z":
        return "shear_yade.signals" if noted.get("producer") == "yade" else "shear.signals"
    if schema not in KIND_OF:
        raise InputError(
            "input", f"{path}: schema is {schema!r}, of no product that a report reads"
        )
    return KIND_OF[schema]


def owner_of(path: Path, cases: list[Case]) -> Case:
    """The case whose packing a product was made from; of unknown origin, the only case."""
    if len(cases) == 1:
        require_same_packing(path, cases[0].packing)
        return cases[0]
    if not read_provenance(path).packing:
        raise InputError(
            "input",
            f"{path}: does not say of which packing it is",
            remedy="give it with that packing alone",
        )
    for case in cases:
        with suppress(InputError):
            require_same_packing(path, case.packing)
            return case
    raise InputError(
        "input", f"{path}: made from none of the packings given", remedy="name its packing as well"
    )


def _give_what_lies_beside(case: Case, given: set[Path]) -> None:
    path = case.packing_path
    for product in sorted(path.parent.glob(f"{glob.escape(_stem(path))}.*.h5")):
        try:
            kind, named = kind_of(product), product.name[len(_stem(path)) + 1 : -3]
            if named in KINDS and named.endswith(f".{kind}"):  # one of several waves of a case
                kind = named
            known = kind in PACKINGS or kind in (case.files or ())
            if product in given or known or require_same_packing(product, case.packing):
                continue
        except InputError:
            continue  # of another packing, or damaged: nobody has asked for it
        _give(case, kind, product)


def _give(case: Case, kind: str, path: Path) -> None:
    assert case.files is not None
    if kind in case.files:
        raise InputError(
            "input",
            f"{case.files[kind]} and {path} are both {kind} of one packing",
            remedy="give one",
        )
    case.files[kind] = path


def _name(path: Path, cases: list[Case]) -> str:
    """File name without its ending; with its folder before it where another has the same."""
    name = _stem(path)
    taken = {case.name for case in cases}
    return f"{path.resolve().parent.name}-{name}" if name in taken else name


def _stem(packing: Path) -> str:
    return re.sub(rf"(\.({'|'.join(PACKINGS)}))?\.h5$", "", packing.name)
