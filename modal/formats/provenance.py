"""What a file was made from: its command, its source files and the settings that shaped it.

This module is the one definition of the group `provenance` that every product carries, of when two
files belong together, and of when a product is stale. It imports neither scipy nor anything that
computes, so that it also runs inside YADE's Python.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import h5py

from modal.formats.attributes import read_attributes, write_attributes
from modal.formats.hdf5 import complete, open_h5
from modal.formats.whole_file import refuse_absent, sha256
from modal.tools.display import plain
from modal.tools.errors import InputError

GROUP, OF_PACKING = "provenance", "network_sha256"
"""The group, and the root attribute with the digest of the packing that a product is of."""
PACKING = "packing"
"""Role of the packing that a product is of: a network or sample, and what it was exported from."""
STATE = "state"
"""Role of the sample that another one was moved from."""
NETWORK_SCHEMA = "granular-contact-network"
DISTRIBUTIONS = ("granular-wave-modes", "numpy", "scipy", "h5py")
"""Whose versions a product names, where they are installed."""
SHOWN = 8
"""Digits of a digest in messages."""


@dataclass(frozen=True)
class Source:
    """A file that a product was made from: its role, its name without folder, its digest.

    The same file under another name is the same source.
    """

    role: str
    name: str = field(compare=False)
    sha256: str

    @staticmethod
    def of(role: str, path: str | Path) -> Source:
        """The file as it is now; InputError where there is none."""
        refuse_absent(path)
        return Source(role, Path(path).name, sha256(path))

    def __str__(self) -> str:
        return f"{self.name or 'a file without name'} ({self.sha256[:SHOWN]})"


@dataclass(frozen=True)
class Provenance:
    """How a product came about.

    `settings` are numbers, texts, booleans and lists of them by name, whatever changes the product;
    None where a file does not tell (files of earlier versions and of other programs). Of several
    sources in the role `PACKING` the first is the file that was read.
    """

    command: str = ""
    settings: Mapping[str, Any] | None = None
    sources: tuple[Source, ...] = ()
    versions: str = field(default_factory=lambda: versions())

    def __post_init__(self) -> None:
        if self.settings is None:
            return
        given = {name: value for name, value in self.settings.items() if value is not None}
        files = {name: value.name for name, value in given.items() if isinstance(value, Path)}
        kept = plain(given | files)  # numbers, texts and lists as JSON gives them back
        for name, value in kept.items():
            if value is None:
                raise InputError("input", f"{name} is {given[name]}", remedy="give a number")
        object.__setattr__(self, "settings", kept)

    @property
    def packing(self) -> tuple[Source, ...]:
        """The packing that the product is of; empty where the file does not tell."""
        return tuple(source for source in self.sources if source.role == PACKING)

    def attributes(self) -> dict[str, str]:
        """Attributes of the group `provenance`; the settings are one canonical JSON text."""
        as_json = json.JSONEncoder(sort_keys=True, separators=(",", ":"), allow_nan=False).encode
        return {
            "command": self.command,
            "versions": self.versions,
            "settings": as_json(self.settings or {}),
            "sources": as_json([vars(source) for source in self.sources]),
        }

    def write(self, file: h5py.File) -> None:
        """Write the group, and of which packing it is, into a file that is open for writing."""
        write_attributes(file.require_group(GROUP), self.attributes())
        for source in self.packing[:1]:
            file.attrs[OF_PACKING] = source.sha256


def versions(**others: str) -> str:
    """Versions of Python and of the packages that are installed; `others` such as yade="2023"."""
    import platform  # both only for a product that is written
    from importlib import metadata

    found = dict(others) | {"python": platform.python_version()}
    for name in DISTRIBUTIONS:
        # An installed scipy says nothing about a process that has not imported it, as inside YADE.
        if name != "scipy" or "scipy" in sys.modules:
            try:
                found[name] = metadata.version(name)
            except metadata.PackageNotFoundError:
                continue
    return ", ".join(f"{name} {version}" for name, version in found.items())


def command_line(program: str, arguments: Sequence[str]) -> str:
    """The command as it was typed, for a shell, files without their folders.

    Words with blanks, such as the line of a contact law, are files where their folder is there.
    """
    words = []
    for argument in arguments:
        at = argument.find("=") + 1 if argument.startswith("--") else 0
        option, value = argument[:at], argument[at:]
        if os.sep in value and (" " not in value or Path(value).parent.is_dir()):
            value = Path(value).name
        words.append(option + value)
    return f"{program} {shlex.join(words)}"


def read_provenance(path: str | Path) -> Provenance:
    """What a product says of itself; files of earlier versions at least name their packing."""
    with open_h5(path) as file:
        said = read_attributes(file[GROUP]) if GROUP in file else {}
        at_root = read_attributes(file)
    digest, schema = str(at_root.get(OF_PACKING, "")), at_root.get("schema")
    made = Provenance(str(said.get("command", "")), versions=str(said.get("versions", "")))
    if "settings" in said and "sources" in said:
        with complete(path):
            sources = tuple(_source_of(each) for each in json.loads(said["sources"]))
            settings = json.loads(said["settings"])
            if settings is not None:
                settings = dict(settings)
            made = replace(made, settings=settings, sources=sources)
        if digest and digest not in [source.sha256 for source in made.packing[:1]]:
            raise InputError(
                "input",
                f"{path}: names a network as its own that is not the packing among its sources",
                remedy="make it again",
            )
    elif digest:
        made = replace(made, sources=(Source(PACKING, "", digest),))
    elif "parent_sha256" in said:
        # A network is its parent in another form; a sample has been moved from where it was.
        role, name = PACKING if schema == NETWORK_SCHEMA else STATE, str(said.get("parent", ""))
        made = replace(made, sources=(Source(role, name, str(said["parent_sha256"])),))
    return made


def _source_of(said: Mapping[str, Any]) -> Source:
    """The source that a file names; ValueError where it is no three texts."""
    source = Source(**said)
    if not all(isinstance(text, str) for text in vars(source).values()):
        raise ValueError("a source is no three texts")
    return source


def made_by(command: str, options: Mapping[str, Any], arguments: Sequence[str]) -> Provenance:
    """The provenance of what a command of modal writes, from its parsed options.

    Names of files to write, and what only changes what is printed, are no settings. A file stands
    in the place of the setting that its role names.
    """
    settings = {
        name: x for name, x in options.items() if name not in _NOT_SETTINGS and x is not False
    }
    sources: tuple[Source, ...] = ()
    if command == "tile":  # another packing than the one that it repeats
        sources = (Source.of(STATE, options["network"]),)
    elif command not in ("relax", "import"):
        sources = packing_of(options["network"])
    for name in filter(options.get, _ROLES):
        sources = (*sources, Source.of(_ROLES[name], options[name]))
        settings.pop(_ROLES[name], None)
    return Provenance(command_line("python -m modal", arguments), settings, sources)


_ROLES = {
    "sample": STATE,
    "motion_file": "motion",
    "file": "spheres",
    "contacts": "contacts",
    "log": "log",
    "bodies": "bodies",
}
_NOT_SETTINGS = {*_ROLES, "command", "network", "output", "json", "skip_current", "at", "hours"}


def packing_of(path: str | Path) -> tuple[Source, ...]:
    """A packing's file as the source of a product, and the sample that it was exported from."""
    own = Source.of(PACKING, path)
    # A file of another program does not say what it was made from.
    return (own, *(read_provenance(path).packing if h5py.is_hdf5(path) else ()))


def require_same_packing(product: str | Path, packing: tuple[Source, ...]) -> str:
    """InputError, naming both files, where a product was made from another packing.

    `packing` as `packing_of` gives it. A product made from a sample belongs to a network that was
    exported from that sample, and the other way round; a product of one network does not belong to
    another network, even if both were exported from one sample. Returns a note where the product
    does not tell what it was made from, and an empty text otherwise.
    """
    made = read_provenance(product).packing
    if not made:
        return (
            f"{product}: of unknown origin, nothing says that it belongs to {packing[0]}; "
            "make it again to be sure"
        )
    own = {source.sha256 for source in made}
    if made[0].sha256 in {source.sha256 for source in packing} or packing[0].sha256 in own:
        return ""
    raise InputError(
        "other_packing",
        f"{product}: made from {made[0]}, not from {packing[0]}",
        remedy=("make it again, or give the packing that it belongs to"),
    )


def changes(path: str | Path, wanted: Provenance) -> list[str]:
    """Why an existing product is stale: each setting and source that differs, old and new value.

    Empty where it was made from these very sources with these settings. Of several sources with one
    role, such as a network and its sample, the first is compared.
    """
    made = read_provenance(path)
    if made.settings is None:
        return ["it does not say with which settings it was made"]
    old, new = (
        {**(said.settings or {}), **{source.role: source for source in reversed(said.sources)}}
        for said in (made, wanted)
    )
    return [
        f"{name} was {old.get(name, 'absent')}, is {new.get(name, 'absent')}"
        for name in sorted(old.keys() | new.keys())
        if old.get(name) != new.get(name)
    ]


def is_current(
    path: str | Path,
    wanted: Provenance,
    say: Callable[[str], object] = print,
    read: Callable[[Path], object] | None = None,
) -> bool:
    """Whether a product is there and need not be made again; `say` is told why, where it is not.

    `read` is a reader that refuses a damaged file.
    """
    if not Path(path).exists():
        return False
    try:
        if read:
            read(Path(path))
        why = changes(path, wanted)
    except InputError as error:
        say(f"{error}; making it again")
        return False
    if why:
        say(f"{path}: stale, {'; '.join(why)}; making it again")
    return not why


def set_aside(path: str | Path) -> None:
    """Rename a stale product, so that nobody takes it for the new one if that cannot be made."""
    path = Path(path)
    if path.exists():
        os.replace(path, path.with_name(path.name + ".stale"))
