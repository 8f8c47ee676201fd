"""The files of a case: what they are called, which are there, and which belong to its packing."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from modal.formats.provenance import Source, packing_of, require_same_packing
from modal.tools.errors import InputError

KINDS = ("network", "modes", "translations.modes", "signals")
"""What `status` lists: made by ./run_cases.sh."""
OTHER_WAVES = tuple(
    f"{run}.signals"
    for run in (
        *("100kHz", "shear_yade"),
        *("reverse", "tenth", "small", "small_reverse", "no_slip", "half_step"),
    )
)
"""Further YADE runs of a case: its pulse at 100 kHz where its own is another, an S-wave, and those
that split its difference to the linear wave (`analysis.agreement.OTHER_RUNS`)."""
SHEAR = "shear_yade.signals", "signals", "shear.signals"
"""Where S-waves are: by YADE as a further run, or as the case's own run; and the linear one."""
EXTRA_KINDS = (
    *("sample", "highest.modes", "band.modes"),
    *("linear.signals", "structure", "density", "response", "shear.signals", "moduli"),
    *OTHER_WAVES,
)
"""Read where they are there: compact sample, highest modes, those of a band, what names say."""


def case_name(text: str) -> str:
    """`2`, `02` or `case02` as `case02`, a case of the study; any other name as it is."""
    match = re.fullmatch(r"(?:case)?0*(\d+)", text.strip().lower())
    return f"case{int(match[1]):02d}" if match else text


@dataclass
class CaseFiles:
    """One packing's files: those of a name in a folder, or the given ones by their kind."""

    name: str
    folder: Path
    files: dict[str, Path] | None = None
    notes: list[str] = field(default_factory=list)
    """What a reader should know: products that do not say which packing they are of."""
    stated: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Lower and upper end of what a study states of it, by quantity: figures show it."""
    _belonging: set[str] = field(default_factory=set, init=False, repr=False)
    """Kinds of product that are known to be of this packing: each file is opened for it once."""

    def path(self, kind: str) -> Path:
        """File of one kind of product: where it is, or would be."""
        return (self.files or {}).get(kind, self.folder / f"{self.name}.{kind}.h5")

    @property
    def short(self) -> str:
        """`case 2` for a case of the study, else the name."""
        match = re.fullmatch(r"case0*(\d+)", self.name)
        return f"case {match[1]}" if match else self.name

    def has(self, kind: str) -> bool:
        """Whether the file exists, and belongs to the case where its files were given."""
        return self.path(kind).is_file() if self.files is None else kind in self.files

    @cached_property
    def packing_path(self) -> Path:
        """The network, or the sample where there is none; without it nothing can be said."""
        for kind in ("network", "sample"):
            if self.has(kind):
                return self.path(kind)
        raise InputError(
            f"{self.path('network')}: no such file; run the case first, give --products DIR, "
            "or name the files"
        )

    @cached_property
    def packing(self) -> tuple[Source, ...]:
        """The packing's file and the sample that it was exported from."""
        return packing_of(self.packing_path)

    def check(self) -> None:
        """InputError where any product at hand is of another packing."""
        for kind in (*KINDS, *EXTRA_KINDS):
            if kind not in ("network", "sample") and self.has(kind):
                self.product(kind)

    def product(self, kind: str) -> Path:
        """File of a product; InputError, naming both files, where it is of another packing."""
        if kind not in self._belonging:
            note = require_same_packing(self.path(kind), self.packing)
            if note and note not in self.notes:
                self.notes.append(note)
            self._belonging.add(kind)
        return self.path(kind)
