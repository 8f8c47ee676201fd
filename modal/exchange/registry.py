"""The programs whose packings can be read: each is one module in `modal.exchange.programs`.

A module, which needs to be named nowhere else, has NAME, what people call the program; OPTIONS,
what its files need beside the one that is given, by name; `sniff(path, head)`, whether a file with
these first bytes is of this program; and `read(path, **options)`, what is in it. `modal.read`, the
command `import` and all commands that take a packing ask here.
"""

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from modal.exchange import programs
from modal.exchange.foreign import foreign_file
from modal.exchange.import_result import ImportResult
from modal.exchange.text import fault, open_bytes, shown
from modal.formats.whole_file import refuse_absent
from modal.packing.network import Network
from modal.packing.plausibility import plausibility
from modal.tools.arguments import checked

LOOKED_AT = 2000
"""Bytes of a file by which a program is known."""


@dataclass(frozen=True)
class Option:
    """A file, a line or a number that a program's packing needs: what it is, how it is typed."""

    text: str
    metavar: str | tuple[str, ...] = "FILE"
    kind: type = str


def all_programs() -> Iterator[ModuleType]:
    """The modules of all programs; a file is of one of them alone.

    This project's own come first: for its files nothing else is loaded.
    """
    names = [name for _, name, _ in pkgutil.iter_modules(programs.__path__)]
    for name in sorted(names, key=lambda name: name != "own"):
        yield importlib.import_module(f"{programs.__name__}.{name}")


def beginning(path: str | Path) -> bytes:
    """The first bytes of a file; InputError where there is none."""
    with open_bytes(path) as file:
        return file.read(LOOKED_AT)


def program_of(path: Path) -> ModuleType:
    """Return the program whose file it is; InputError names the kind where none knows it."""
    head = beginning(path)
    for asked in all_programs():
        if asked.sniff(path, head):
            return asked
    kind = foreign_file(path, head)
    if kind:
        fault(path, kind.description, kind.remedy, code=kind.code)
    first = head.decode("utf-8", "replace").split("\n", 1)[0]
    what = f"begins with {shown(first)}, which no program known here writes"
    do = "give a network, a sample, a text dump of LAMMPS or LIGGGHTS, a restart file of "
    fault(path, what, f"{do}MercuryDPM, or *.csv", 1, code="unknown_file")


def all_options() -> dict[str, Option]:
    """The options of all programs by name; where several have one, it is that of the first."""
    options: dict[str, Option] = {}
    for asked in all_programs():
        options = dict(asked.OPTIONS) | options
    return options


def import_packing(path: str | Path, **options: Any) -> ImportResult:
    """The packing of a file and what was found and assumed; `options` as those of `import`."""
    refuse_absent(path)
    given = {name: value for name, value in options.items() if value is not None}
    path = Path(path)
    asked = program_of(path)
    for name in given:
        if name not in asked.OPTIONS:
            do = f"leave it out (options: {', '.join(asked.OPTIONS) or 'none'})"
            fault(path, f"a file of {asked.NAME}, which does not go with {name}", do)
    return asked.read(path, **given)


@checked
def read(path: str | Path, **options: object) -> Network:
    """A packing from a file: a contact network, a sample, or what another program has written.

    Contact networks (`*.network.h5`) and samples (`*.sample.h5`), whose contacts and stiffnesses
    follow from the positions, are described in `docs/formats.md`, other programs' files in
    `docs/other_programs.md`.

    Parameters
    ----------
    path : str or Path
        The file.
    **options : object
        What the file of another program needs beside it, by the names of `python -m modal import`:
        `modal.read("x.atoms", contacts="x.contacts", log="log.lammps")`.

    Returns
    -------
    Network
        The packing at rest, SI units.

    Raises
    ------
    InputError
        One line, for what is missing, damaged, or cannot be a packing.

    Examples
    --------
    >>> import modal
    >>> modal.read("nowhere.network.h5")
    Traceback (most recent call last):
        ...
    modal.tools.errors.InputError: nowhere.network.h5: no such file; check the name
    """
    return import_packing(path, **options).network


def read_remarked(path: str | Path, say: Callable[[str], None], *, waves: bool = False) -> Network:
    """The packing of a file, as `read`; `say` is told each remark on it."""
    found = import_packing(path)
    plausible = plausibility(found.network, sought=found.sought, waves=waves)
    for remark in (*found.remarks, *plausible["remarks"]):
        say(f"{path}: {remark}")
    return found.network
