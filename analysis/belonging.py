"""Which files make a case: each recognised by its schema, all joined by the packing's digest."""

from __future__ import annotations

import glob
from collections.abc import Sequence
from pathlib import Path

from analysis.case import FORMATS, PACKINGS, Case, find
from modal.formats.hdf5 import complete, open_h5
from modal.formats.provenance import packing_of, read_provenance, require_same_packing
from modal.modes.mode_set import SCHEMA as MODES
from modal.modes.mode_set import Choice
from modal.tools.errors import InputError
from modal.waves.signals import SCHEMA as SIGNALS

KIND_OF = {form.SCHEMA: kind for kind, (form, _) in FORMATS.items()}
"""Kinds of product by their schema; modes are of several kinds, and so are signals."""
WAVES = "signals", "shear.signals", "shear_yade.signals"


def cases_of(arguments: Sequence[str], folder: str | Path) -> list[Case]:
    """Cases by name in a folder, as `2`, or by their files: one case for each packing given."""
    files = [text for text in arguments if text.endswith(".h5")]
    names = [text for text in arguments if not text.endswith(".h5")]
    return [find(name, folder) for name in names] + (cases_of_files(files) if files else [])


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
            parent = [case for case in cases if packing_of(path)[0].sha256 in _digests(case)]
            if wanted == "sample" and parent:
                for case in parent:
                    _give(case, wanted, path)
            else:
                cases.append(Case(_name(path, cases), path.parent, {wanted: path}))
    if not cases:
        raise InputError(f"{', '.join(map(str, kinds))}: no packing; name its *.network.h5 as well")
    for path, kind in kinds.items():
        if kind in PACKINGS:
            continue
        _give(owner_of(path, cases), kind, path)
    for case in cases:
        _give_what_lies_beside(case, set(kinds))
    return cases


def kind_of(path: str | Path) -> str:
    """The kind of product that a file is, by its schema.

    Of modes also by which were asked for, of signals by the direction of the wall and by who made
    them.
    """
    with open_h5(path) as file:
        noted = {name: _text(value) for name, value in file.attrs.items()}
        schema = noted.get("schema", "")
        with complete(path):
            choice = Choice.of_attributes(dict(file.attrs)) if schema == MODES else Choice("all")
    if schema == MODES:
        settings = read_provenance(path).settings or {}
        if settings.get("translations_only", str(path).endswith(".translations.modes.h5")):
            return "translations.modes"
        if choice.kind == "highest":
            return "highest.modes"
        return "band.modes" if choice.low > 0 else "modes"
    if schema == SIGNALS and noted.get("schema_version") == "2":
        raise InputError(f"{path}: not a wave from wall to wall; a report reads no other")
    if schema == SIGNALS and noted.get("direction", "z") != "z":
        return "shear_yade.signals" if noted.get("producer") == "yade" else "shear.signals"
    if schema not in KIND_OF:
        raise InputError(f"{path}: schema is {schema!r}, of no product that a report reads")
    return KIND_OF[schema]


def _text(value: object) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def _digests(case: Case) -> set[str]:
    return {source.sha256 for source in case.packing}


def owner_of(path: Path, cases: list[Case]) -> Case:
    """The case whose packing a product was made from; of unknown origin, the only case."""
    if len(cases) == 1:
        require_same_packing(path, cases[0].packing)
        return cases[0]
    if not read_provenance(path).packing:
        raise InputError(
            f"{path}: does not say of which packing it is; give it with that packing alone"
        )
    for case in cases:
        try:
            require_same_packing(path, case.packing)
            return case
        except InputError:
            continue
    raise InputError(f"{path}: made from none of the packings given; name its packing as well")


def _give_what_lies_beside(case: Case, given: set[Path]) -> None:
    path = case.packing_path
    for product in sorted(path.parent.glob(f"{glob.escape(_stem(path))}.*.h5")):
        try:
            kind = kind_of(product)
            known = kind in PACKINGS or kind in (case.files or ())
            if product in given or known or require_same_packing(product, case.packing):
                continue
        except InputError:
            continue  # of another packing, or damaged: nobody has asked for it
        _give(case, kind, product)


def _give(case: Case, kind: str, path: Path) -> None:
    assert case.files is not None
    if kind in case.files:
        raise InputError(f"{case.files[kind]} and {path} are both {kind} of one packing; give one")
    case.files[kind] = path


def _name(path: Path, cases: list[Case]) -> str:
    """File name without its ending; with its folder before it where another has the same."""
    name = _stem(path)
    taken = {case.name for case in cases}
    return f"{path.resolve().parent.name}-{name}" if name in taken else name


def _stem(packing: Path) -> str:
    name = packing.name
    for end in (".h5", *(f".{kind}" for kind in PACKINGS)):
        name = name.removesuffix(end)
    return name
