"""The programs whose packings can be read: each is one module in `modal.exchange.programs`.

A module needs to be named nowhere else. It has NAME, the usual name of the program; OPTIONS, the
further files and numbers that its packings need, by name; `sniff(path, head)`, which tells whether
a file with these first bytes is of this program; and `read(path, **options)`, which returns its
packing. `modal.read`, the command `import` and all commands that take a packing use this registry.

Another package adds a program by an entry point of the group `granular_modes.programs`, whose value
is such a module:

    [project.entry-points."granular_modes.programs"]
    mine = "my_package.reader"
"""

import importlib
import pkgutil
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import cast

from numpy.typing import ArrayLike

from modal.exchange import programs
from modal.exchange.foreign import foreign_file
from modal.exchange.import_result import ImportResult
from modal.exchange.lines import open_bytes
from modal.exchange.refusals import quote, refuse
from modal.formats.whole_file import refuse_absent
from modal.packing.network import Network
from modal.packing.plausibility import plausibility
from modal.packing.weight import with_gravity
from modal.tools.arguments import checked
from modal.tools.errors import InputError

ENTRY_POINTS = "granular_modes.programs"
"""Group of the entry points by which other packages add programs."""
PROGRAM_NAMES = ("NAME", "OPTIONS", "sniff", "read")
"""Names that the module of a program has."""
BEGINNING_BYTES = 2000
"""Number of bytes at the beginning of a file that show of which program it is."""


@dataclass(frozen=True)
class Option:
    """A file, a line or a number that a packing needs beside its file.

    Attributes
    ----------
    text : str
        Description of the option, for the help.
    metavar : str or tuple of str
        Placeholder of the option's value in the help.
    kind : type
        Type of its value.
    """

    text: str
    metavar: str | tuple[str, ...] = "FILE"
    kind: type = str


COMMON_OPTIONS = {
    "gravity": Option(
        "acceleration by gravity, m/s^2, as 0 0 -9.81, if the file does not tell it",
        ("GX", "GY", "GZ"),
        float,
    )
}
"""Options that files of all programs have."""


def all_programs() -> Iterator[ModuleType]:
    """Yield the modules of all programs; a file belongs to at most one of them.

    This project's own module comes first, so that its files load no other module. Modules of other
    packages come last.
    """
    names = [name for _, name, _ in pkgutil.iter_modules(programs.__path__)]
    for name in sorted(names, key=lambda name: name != "own"):
        yield importlib.import_module(f"{programs.__name__}.{name}")
    for entry in entry_points(group=ENTRY_POINTS):
        yield _load_entry(entry)


def _load_entry(entry: EntryPoint) -> ModuleType:
    """Return the module of an entry point; raise InputError if it is not a reader."""
    try:
        program: ModuleType = entry.load()
    except ImportError as error:
        problem = f"the reader {entry.name} ({entry.value}) cannot be loaded"
        remedy = "mend or remove the package that adds it"
        raise InputError("broken_reader", problem, str(error), remedy) from error
    for name in PROGRAM_NAMES:
        if not hasattr(program, name):
            problem = f"the reader {entry.name} ({entry.value}) has no {name}"
            remedy = "mend or remove the package that adds it"
            raise InputError("broken_reader", problem, remedy=remedy)
    return program


def read_beginning(path: str | Path) -> bytes:
    """Return the first bytes of a file; raise InputError if it cannot be read."""
    with open_bytes(path) as file:
        return file.read(BEGINNING_BYTES)


def find_program(path: Path) -> ModuleType:
    """Return the program of a file; raise InputError, which names the file's kind, if none fits."""
    head = read_beginning(path)
    for program in all_programs():
        if program.sniff(path, head):
            return program
    kind = foreign_file(path, head)
    if kind:
        refuse(path, kind.code, kind.description, remedy=kind.remedy)
    first_line = head.decode("utf-8", "replace").split("\n", 1)[0]
    if re.fullmatch(r"[-+.,;\deE\s]*\d[-+.,;\deE\s]*", first_line):
        refuse(
            path,
            "unnamed_columns",
            f"begins with {quote(first_line)}, numbers without names",
            "which of them are centres and radii is not said",
            "write a first line with the names of the columns, as `x y z radius`",
            line=1,
        )
    refuse(
        path,
        "unknown_file",
        f"begins with {quote(first_line)}, which no program known here writes",
        remedy="give a network, a sample, a text dump of LAMMPS or LIGGGHTS, a restart file of "
        "MercuryDPM, *.csv, VTK, extended XYZ or *.mdpa of Kratos",
        line=1,
    )


def all_options() -> dict[str, Option]:
    """Return the options of all programs by name.

    If several programs have an option of the same name, the first one is returned.
    """
    options: dict[str, Option] = {}
    for program in all_programs():
        options = dict(program.OPTIONS) | options
    return options | COMMON_OPTIONS


def import_packing(path: str | Path, **options: object) -> ImportResult:
    """Return the packing of a file, with the findings and assumptions of the import.

    `options` are those of the command `import`; None stands for an option that is not given. Raises
    InputError for an option that the program of the file does not have, and for the same reasons as
    `read`.
    """
    refuse_absent(path)
    typed = {name: value for name, value in options.items() if value is not None}
    gravity = typed.pop("gravity", None)
    path = Path(path)
    program = find_program(path)
    for name in typed:
        if name not in program.OPTIONS:
            known = ", ".join([*program.OPTIONS, *COMMON_OPTIONS])
            refuse(
                path,
                "unknown_option",
                f"no option {name} for files of {program.NAME}",
                remedy=f"leave it out; options here: {known}",
            )
    result: ImportResult = program.read(path, **typed)
    if gravity is not None:
        result.network = with_gravity(result.network, cast(ArrayLike, gravity))
    return result


@checked
def read(path: str | Path, **options: object) -> Network:
    """Read a packing from a file: a contact network, a sample, or a file of another program.

    Contact networks (`*.network.h5`) and samples (`*.sample.h5`), whose contacts and stiffnesses
    follow from the positions, are described in `docs/formats.md`, other programs' files in
    `docs/other_programs.md`.

    Parameters
    ----------
    path : str or Path
        The file.
    **options : object
        Further files and lines that a file of another program needs, by the option names of
        `python -m modal import`: `modal.read("x.atoms", contacts="x.contacts", log="log.lammps")`.

    Returns
    -------
    Network
        The packing at rest, SI units.

    Raises
    ------
    InputError
        If a file is missing or damaged, or is not a packing; the message is one line.

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
    """Return the packing of a file as `read` does; call `say` with each remark on the packing.

    `waves` adds the remarks that matter only for waves.
    """
    result = import_packing(path)
    plausible = plausibility(result.network, sought=result.sought, waves=waves)
    for remark in (*result.remarks, *plausible["remarks"]):
        say(f"{path}: {remark}")
    return result.network
