"""Record the origin of a file: its command, its source files and the settings that shaped it.

Only this module defines the group `provenance` of a product. It decides whether two files belong
together, and whether a product is stale. It imports neither scipy nor anything that computes, so
that it also runs inside YADE's Python.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import h5py

from modal.formats.attributes import read_attributes, write_attributes
from modal.formats.hdf5 import complete, open_h5
from modal.formats.whole_file import refuse_absent, sha256
from modal.tools.display import plain
from modal.tools.errors import InputError

GROUP = "provenance"
"""Group of a file that has its provenance."""
PACKING_DIGEST = "network_sha256"
"""Attribute of the file with the digest of the packing that a product is of."""
PACKING = "packing"
"""Role of the packing that a product is of: a network or sample, and what it was exported from."""
STATE = "state"
"""Role of the sample that another one was moved from."""
NETWORK_SCHEMA = "granular-contact-network"
"""Schema of a network."""
DISTRIBUTIONS = ("granular-wave-modes", "numpy", "scipy", "h5py")
"""Packages whose versions a product names, if they are installed."""
DIGEST_DIGITS_SHOWN = 8
"""Number of digits of a digest that messages show."""


@dataclass(frozen=True)
class Source:
    """A file that a product was made from: its role, its name without folder, its digest.

    Two sources with equal digests are equal, whatever their names.
    """

    role: str
    name: str = field(compare=False)
    sha256: str

    @staticmethod
    def of(role: str, path: str | Path) -> Source:
        """Return the present file as a source; raise InputError if there is none."""
        refuse_absent(path)
        return Source(role, Path(path).name, sha256(path))

    def __str__(self) -> str:
        return f"{self.name or 'a file without name'} ({self.sha256[:DIGEST_DIGITS_SHOWN]})"


@dataclass(frozen=True)
class Provenance:
    """The origin of a product: command, settings, sources and versions.

    Attributes
    ----------
    command : str
        The command as it was typed.
    settings : mapping or None
        Numbers, texts, booleans and lists of them by name: everything that changes the product.
        None if a file does not contain them (files of earlier versions and of other programs).
    sources : tuple of Source
        The files that the product was made from. The first of several sources in the role `PACKING`
        is the file that was read.
    versions : str
        Versions of Python and of the packages.
    """

    command: str = ""
    settings: Mapping[str, Any] | None = None
    sources: tuple[Source, ...] = ()
    versions: str = field(default_factory=lambda: versions())

    def __post_init__(self) -> None:
        if self.settings is None:
            return
        settings = {name: value for name, value in self.settings.items() if value is not None}
        for name, value in settings.items():
            if isinstance(value, Path):
                settings[name] = value.name
        plain_settings = plain(settings)  # numbers, texts and lists as JSON returns them
        for name, value in plain_settings.items():
            if value is None:
                problem = f"{name} is {settings[name]}"
                raise InputError("not_finite", problem, remedy="give a number")
        object.__setattr__(self, "settings", plain_settings)

    @property
    def packing(self) -> tuple[Source, ...]:
        """Return the packing of the product; empty if the file does not name it."""
        return tuple(source for source in self.sources if source.role == PACKING)

    def attributes(self) -> dict[str, str]:
        """Return the attributes of the group `provenance`; settings are one canonical JSON text."""
        encoder = json.JSONEncoder(sort_keys=True, separators=(",", ":"), allow_nan=False)
        return {
            "command": self.command,
            "versions": self.versions,
            "settings": encoder.encode(self.settings or {}),
            "sources": encoder.encode([vars(source) for source in self.sources]),
        }

    def write(self, file: h5py.File) -> None:
        """Write the group, and the packing's digest, into a file that is open for writing."""
        write_attributes(file.require_group(GROUP), self.attributes())
        for source in self.packing[:1]:
            file.attrs[PACKING_DIGEST] = source.sha256


def versions(**others: str) -> str:
    """Return the versions of Python and of the packages that are installed.

    `others` are those of further programs, as yade="2023".
    """
    import platform  # both only for a product that is written
    from importlib import metadata

    by_name = {**others, "python": platform.python_version()}
    for name in DISTRIBUTIONS:
        # An installed scipy says nothing about a process that has not imported it, as inside YADE.
        if name == "scipy" and "scipy" not in sys.modules:
            continue
        try:
            by_name[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return ", ".join(f"{name} {version}" for name, version in by_name.items())


def command_line(program: str, arguments: Sequence[str]) -> str:
    """Return the command as it was typed, for a shell, with files without their folders.

    A word with a blank, such as the line of a contact law, counts as a file only if its folder
    exists.
    """
    words = []
    for argument in arguments:
        option = ""
        value = argument
        if argument.startswith("--") and "=" in argument:
            name, value = argument.split("=", 1)
            option = f"{name}="
        if os.sep in value and (" " not in value or Path(value).parent.is_dir()):
            value = Path(value).name
        words.append(option + value)
    return f"{program} {shlex.join(words)}"


def read_provenance(path: str | Path) -> Provenance:
    """Return the origin of a product.

    Files of earlier versions name at least their packing. Raises InputError for a file whose digest
    differs from that of the packing among its sources.
    """
    with open_h5(path) as file:
        group = read_attributes(file[GROUP]) if GROUP in file else {}
        root = read_attributes(file)
    digest = str(root.get(PACKING_DIGEST, ""))
    provenance = Provenance(str(group.get("command", "")), versions=str(group.get("versions", "")))
    if "settings" in group and "sources" in group:
        with complete(path):
            sources = tuple(_parse_source(source) for source in json.loads(group["sources"]))
            settings = json.loads(group["settings"])
            if settings is not None:
                settings = dict(settings)
            provenance = replace(provenance, settings=settings, sources=sources)
        if digest and digest not in [source.sha256 for source in provenance.packing[:1]]:
            problem = f"{path}: names a network that is not the packing among its sources"
            raise InputError("other_packing", problem, remedy="make it again")
        return provenance
    if digest:
        return replace(provenance, sources=(Source(PACKING, "", digest),))
    if "parent_sha256" in group:
        # A network is its parent in another form; a sample has been moved from its parent.
        role = PACKING if root.get("schema") == NETWORK_SCHEMA else STATE
        parent = Source(role, str(group.get("parent", "")), str(group["parent_sha256"]))
        return replace(provenance, sources=(parent,))
    return provenance


def _parse_source(attributes: Mapping[str, Any]) -> Source:
    """Return the source that a file names; raise ValueError unless it has three texts."""
    source = Source(**attributes)
    if not all(isinstance(text, str) for text in vars(source).values()):
        raise ValueError("a source is no three texts")
    return source


def made_by(command: str, options: Mapping[str, Any], arguments: Sequence[str]) -> Provenance:
    """Return the provenance of a product of a command of modal, from its parsed options.

    Names of files to write, and options that only change what is printed, are not settings. A file
    that an option names is recorded as a source, not as a setting.
    """
    settings = {}
    for name, value in options.items():
        if name not in _NOT_SETTINGS and value is not False:
            settings[name] = value
    sources: list[Source] = []
    if command == "tile":  # the product is another packing than the one that it repeats
        sources.append(Source.of(STATE, options["network"]))
    elif command not in ("relax", "import"):
        sources += packing_of(options["network"])
    for name, role in _ROLES.items():
        if options.get(name):
            sources.append(Source.of(role, options[name]))
            settings.pop(role, None)
    return Provenance(command_line("python -m modal", arguments), settings, tuple(sources))


_ROLES = {
    "sample": STATE,
    "motion_file": "motion",
    "file": "spheres",
    "contacts": "contacts",
    "log": "log",
    "bodies": "bodies",
}
"""Roles of the files that options name, by the names of the options."""
_NOT_SETTINGS = {*_ROLES, "command", "network", "output", "json", "skip_current", "at", "hours"}
"""Options that do not change a product."""


def packing_of(path: str | Path) -> tuple[Source, ...]:
    """Return the file of a packing as a source, and the source that it was exported from."""
    source = Source.of(PACKING, path)
    if not h5py.is_hdf5(path):  # a file of another program does not say what it was made from
        return (source,)
    return (source, *read_provenance(path).packing)


def require_same_packing(product: str | Path, packing: tuple[Source, ...]) -> str:
    """Raise InputError, which names both files, if a product was made from another packing.

    `packing` is the result of `packing_of`. A product made from a sample belongs to a network that
    was exported from that sample, and the other way round. A product of one network does not belong
    to another network, even if both were exported from one sample. Returns a note if the product
    does not say what it was made from, and an empty text otherwise.
    """
    recorded = read_provenance(product).packing
    if not recorded:
        return (
            f"{product}: of unknown origin, nothing says that it belongs to {packing[0]}; "
            "make it again to be sure"
        )
    recorded_digests = {source.sha256 for source in recorded}
    given_digests = {source.sha256 for source in packing}
    if recorded[0].sha256 in given_digests or packing[0].sha256 in recorded_digests:
        return ""
    raise InputError(
        "other_packing",
        f"{product}: made from {recorded[0]}, not from {packing[0]}",
        remedy=("make it again, or give the packing that it belongs to"),
    )


@dataclass(frozen=True)
class Change:
    """A difference between the sources and settings of a product and those it should have.

    kind: "no_settings" if the product does not contain its settings; "setting" and "source" for a
    setting or a source that differs. name: name of the setting, or role of the source. old, new:
    values before and now; "absent" if there is none.
    """

    kind: Literal["no_settings", "setting", "source"]
    name: str = ""
    old: Any = None
    new: Any = None

    def __str__(self) -> str:
        if self.kind == "no_settings":
            return "it does not say with which settings it was made"
        return f"{self.name} was {self.old}, is {self.new}"


def changes(path: str | Path, wanted: Provenance) -> list[Change]:
    """Return all settings and sources of an existing product that differ: why it is stale.

    The list is empty if the product was made from equal sources with equal settings. Of several
    sources with one role, such as a network and its sample, the first is compared.
    """
    recorded = read_provenance(path)
    if recorded.settings is None:
        return [Change("no_settings")]
    old = _settings_and_sources(recorded)
    new = _settings_and_sources(wanted)
    different = []
    for name in sorted(old.keys() | new.keys()):
        if old.get(name) != new.get(name):
            values = (old.get(name, "absent"), new.get(name, "absent"))
            is_source = any(isinstance(value, Source) for value in values)
            different.append(Change("source" if is_source else "setting", name, *values))
    return different


def _settings_and_sources(provenance: Provenance) -> dict[str, Any]:
    """Return the settings by name, and the first source of each role."""
    by_name = dict(provenance.settings or {})
    for source in reversed(provenance.sources):
        by_name[source.role] = source
    return by_name


def is_current(
    path: str | Path,
    wanted: Provenance,
    say: Callable[[str], object] = print,
    read: Callable[[Path], object] | None = None,
) -> bool:
    """Tell whether a product exists and is current, so that it need not be made again.

    `say` is called with the reason why an existing product is made again; `read` is a reader that
    refuses a damaged file.
    """
    if not Path(path).exists():
        return False
    try:
        if read:
            read(Path(path))
        different = changes(path, wanted)
    except InputError as error:
        say(f"{error}; making it again")
        return False
    if different:
        say(f"{path}: stale, {'; '.join(map(str, different))}; making it again")
    return not different


def set_aside(path: str | Path) -> None:
    """Rename a stale product, so that it is not mistaken for the new one if making that fails."""
    path = Path(path)
    if path.exists():
        os.replace(path, path.with_name(path.name + ".stale"))
