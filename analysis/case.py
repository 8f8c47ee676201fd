"""A case: the files of one packing, what they are called, and what they hold, read on demand."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from analysis.agreement import OTHER_RUNS
from analysis.estimators import structure_factor
from modal.elasticity import moduli
from modal.formats.provenance import Source, packing_of, require_same_packing
from modal.modes import density, mode_set
from modal.packing import network, sample
from modal.tools.errors import InputError
from modal.waves import response, signals

ABSENT = "what it is read from is not among the packing's files"


class AbsentError(InputError):
    """What something is read from is not there: a file of the packing, or a wave."""

    def __init__(self, told: str = ABSENT) -> None:
        super().__init__(told)


PACKINGS = "network", "sample"
SHEAR = "shear_yade.signals", "signals", "shear.signals"
"""Where S-waves are: by YADE as a further run, or as the case's own run; and the linear one."""
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
        raise InputError(f"{path}: {why}; leave it out, or make it without --damping, --direction")
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


def case_name(text: str) -> str:
    """`2`, `02` or `case02` as `case02`, a case of the study; any other name as it is."""
    match = re.fullmatch(r"(?:case)?0*(\d+)", text.strip().lower())
    return f"case{int(match[1]):02d}" if match else text


def find(text: str, folder: str | Path) -> Case:
    """The products of a case in a folder."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; run the cases first, or give --products DIR")
    return Case(case_name(text), folder)


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
    _belonging: set[str] = field(default_factory=set, init=False, repr=False)
    """Kinds of product that are known to be of this packing: each file is opened for it once."""

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
        told = "no such file; run the case first, give --products DIR, or name the files"
        raise InputError(f"{self.path('network')}: {told}")

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
        if kind not in self._belonging:
            note = require_same_packing(self.path(kind), self.packing)
            if note and note not in self.notes:
                self.notes.append(note)
            self._belonging.add(kind)
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
            raise AbsentError
        return self.read(kind)
