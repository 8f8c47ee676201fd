"""Recognise files that people take for a packing and that cannot be read, and say what to do.

`FOREIGN` has one row for each kind of file: the code of the error, a description of the file, what
file to write instead, and a test on its path and first bytes. The rows are used only for files that
no program of `modal.exchange.programs` recognises, and the first row whose test is passed is taken.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple


class ForeignFile(NamedTuple):
    """A kind of file that cannot be read: error code, description, remedy, and its test."""

    code: str
    description: str
    remedy: str
    matches: Callable[[Path, bytes], bool]


def begins(*beginnings: bytes) -> Callable[[Path, bytes], bool]:
    """Return a test of whether a file begins with one of these bytes, after blanks."""
    return lambda path, head: head.lstrip().startswith(beginnings)


def contains(*patterns: bytes) -> Callable[[Path, bytes], bool]:
    """Return a test of whether all these regular expressions match in the first bytes."""
    return lambda path, head: all(re.search(pattern, head, re.MULTILINE) for pattern in patterns)


DUMP = (
    "`dump a all custom 1 x.atoms id type x y z radius mass`, "
    "`dump_modify a format float %.17g`, `run 0`"
)
"""Lines of a LAMMPS script that write spheres in a form that can be read here."""
IMPORT_DUMP = "import x.atoms with --log log.lammps"
DUMP_OF_LIGGGHTS = (
    "dump as examples/packings/liggghts/pack.in does and import x.atoms with --log log.liggghts"
)
DUMP_IN_TEXT = f"write a text dump, {DUMP}, and {IMPORT_DUMP}"

EXPORT_SCENE = "type `yade -n -x -j1 yade_scripts/export_scene.py"


def named_as_scene(path: Path) -> bool:
    """Return whether a file has the name of a scene of YADE."""
    return re.search(r"\.yade(\.(gz|bz2))?$|\.xml\.(gz|bz2)$", path.name) is not None


FOREIGN: list[ForeignFile] = [
    ForeignFile(
        "yade_scene",
        "a scene that YADE has saved",
        f"{EXPORT_SCENE} SCENE mine.network.h5` with the YADE that saved it",
        lambda path, head: named_as_scene(path) or b"serialization" in head[:400],
    ),
    ForeignFile(
        "mercury_data",
        "a .data or .fstat file of MercuryDPM, without stiffnesses",
        "give the restart file (*.restart) of the same run",
        lambda path, head: re.search(r"\.(data|fstat)(\.\d+)?$", path.name) is not None,
    ),
    ForeignFile(
        "numpy_arrays",
        "arrays of numpy",
        "make two tables (*.csv) of them, or a modal.Network",
        lambda path, head: head.startswith(b"\x93NUMPY") or path.suffix == ".npz",
    ),
    ForeignFile(
        "json",
        "a JSON file, which is a result or a setting and no packing",
        "give the packing that it is of",
        begins(b"{"),
    ),
    ForeignFile(
        "lammps_restart",
        "a binary restart file of LAMMPS",
        "read_restart it in the LAMMPS that wrote it, give pair_style and walls again, "
        f"{DUMP}, then {IMPORT_DUMP}",
        begins(b"LammpS RestartT"),
    ),
    ForeignFile(
        "liggghts_restart",
        "a binary restart file of LIGGGHTS",
        f"read_restart it in LIGGGHTS, {DUMP_OF_LIGGGHTS}",
        contains(rb"\A[^\n]*\0[^\n]*LIGGGHTS"),
    ),
    ForeignFile(
        "lammps_binary_dump",
        "a binary dump of LAMMPS",
        f"turn it into text with LAMMPS' tool binary2txt, or {DUMP_IN_TEXT}",
        contains(rb"\A.{,16}DUMP(ATOM|CUSTOM)"),
    ),
    ForeignFile(
        "lammps_log",
        "a log of LAMMPS or LIGGGHTS, which holds no spheres",
        "give the dump of the spheres first, and the log with --log",
        begins(b"LAMMPS (", b"LIGGGHTS ("),
    ),
    ForeignFile(
        "lammps_yaml",
        "a dump of LAMMPS in YAML",
        DUMP_IN_TEXT,
        begins(b"---\ncreator: LAMMPS"),
    ),
    ForeignFile(
        "xyz",
        "an XYZ file, which holds no radii, masses or law",
        f"of LAMMPS {DUMP_IN_TEXT}; of other programs give two tables (*.csv)",
        contains(rb"\A\s*\d+\s*\n[^\n]*\n\s*\w+(\s+[-+0-9.eE]+){3}"),
    ),
    ForeignFile(
        "compressed",
        "compressed",
        "unpack it, or, if gzip packed it, let its name end in .gz",
        begins(b"\x1f\x8b", b"\x28\xb5\x2f\xfd", b"PK\x03\x04", b"BZh", b"\xfd7zXZ"),
    ),
    ForeignFile(
        "lammps_script",
        "a script of LAMMPS or LIGGGHTS, which holds no spheres",
        f"run it, {DUMP}, then {IMPORT_DUMP}",
        contains(rb"^\s*(units|atom_style|pair_style|read_data|read_restart)\s+[\w/$]+"),
    ),
]


def foreign_file(path: Path, head: bytes) -> ForeignFile | None:
    """Return the kind of a file by path and first bytes; None if no row of `FOREIGN` fits."""
    for kind in FOREIGN:
        if kind.matches(path, head):
            return kind
    return None
