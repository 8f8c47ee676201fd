"""Which cases have which products, and which of these are stale and why."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from analysis.case import KINDS, LISTED, OTHER_WAVES, Case, format_of
from modal.formats.hdf5 import open_h5
from modal.formats.provenance import (
    PACKING,
    Provenance,
    Source,
    differences,
    packing_of,
    read_provenance,
)
from modal.tools.errors import InputError

OTHER_NAMES = {"friction": "mu_wave"}
"""Settings that the tables call by another name."""


def names_in(folder: Path) -> list[str]:
    """Names of the cases that have any product in a folder, in order."""
    kinds = sorted(KINDS, key=len, reverse=True)  # x.translations.modes is no case
    names = set()
    for path in folder.glob("*.h5"):
        kind = next((kind for kind in kinds if path.name.endswith(f".{kind}.h5")), None)
        if kind:
            names.add(path.name.removesuffix(f".{kind}.h5"))
    return sorted(names)


Settings = Mapping[str, Mapping[str, Any]]
"""What a study says of each case, by name."""


def stale_files(folder: Path, settings: Settings, names: Sequence[str]) -> list[Path]:
    """The products of these cases that are stale: made from what has changed since."""
    named = [Case(name, folder) for name in names]
    return [case.path(kind) for case in named for kind in _stale(case, settings)]


def status_table(folder: Path, settings: Settings) -> str:
    """One line per case that has any product: `yes`, `stale` or `-` for each kind.

    Below it, of each stale product what has changed: a file that it was made from, or a setting
    of the study.
    """
    names = names_in(folder)
    width = max(map(len, ("case02", *names)))
    lines, reasons = ["  ".join(("case".ljust(width), *LISTED))], []
    for name in names:
        case = Case(name, folder)
        stale = _stale(case, settings)
        if any(case.has(kind) for kind in LISTED):
            marks = ("stale" if k in stale else "yes" if case.has(k) else "-" for k in LISTED)
            cells = (mark.ljust(len(kind)) for mark, kind in zip(marks, LISTED, strict=True))
            lines.append((case.name.ljust(width) + "  " + "  ".join(cells)).rstrip())
        reasons += [f"{case.path(k).name}: stale, {'; '.join(why)}" for k, why in stale.items()]
    if len(lines) == 1:
        lines.append("no case has a product yet")
    return "\n".join([*lines, *reasons])


def _stale(case: Case, settings: Settings) -> dict[str, list[str]]:
    """Kinds of a case's products that are stale, and what of each has changed."""
    row = settings.get(case.name, {})
    return {kind: why for kind in case.there if (why := _changes(case, kind, row))}


def _changes(case: Case, kind: str, row: Mapping[str, Any]) -> list[str]:
    """What has changed since the product was made, as far as its file and those beside it tell."""
    form, _ = format_of(kind)
    try:
        with open_h5(case.path(kind), form.SCHEMA, form.VERSION):
            made = read_provenance(case.path(kind))
        known = {name: OTHER_NAMES.get(name, name) for name in made.settings or {}}
        if kind in OTHER_WAVES:  # what sets them apart stands in the workflow, not in a table
            known = {}
        known = {name: column for name, column in known.items() if row.get(column) is not None}
        shared = {name: _given(column, row[column]) for name, column in known.items()}
        old = {name: made.settings[name] for name in shared} if made.settings else {}
        now = tuple(source for old in made.sources for source in _as_it_is(case, kind, old))
        roles = {source.role for source in now}
        before = tuple(source for source in made.sources if source.role in roles)
        return differences(Provenance("", old, before), Provenance("", shared, now))
    except InputError as error:
        return [str(error)]


def _as_it_is(case: Case, kind: str, old: Source) -> tuple[Source, ...]:
    """The file that a source has become: of its name beside the product, or the case's packing."""
    path = case.folder / old.name
    if old.name and path.is_file():
        return (Source.of(old.role, path),)
    if old.role == PACKING and kind != "network" and not old.name:
        return packing_of(case.packing_path)[:1]
    return ()


def _given(column: str, value: Any) -> Any:
    """A setting of a study, or what YADE's scripts read in its place."""
    text = os.environ.get(f"WAVE_{column.upper()}", value)
    try:
        return float(text)
    except ValueError:
        return text
