"""A packing as two tables with named columns (CSV), as any program can write them.

Three lines behind # above the spheres tell of the cell: `# cell XLO XHI YLO YHI ZLO ZHI`, `#
periodic x y` and `# walls ZLOW ZHIGH`, in any case, with or without a colon; others are comments.
Stiffnesses stand with the contacts, so that no law is needed and each row is a contact, whatever
its force and overlap; -1 for the second sphere is the wall at low z, -2 that at high z. A column
that is not known is refused, as it may change the answer.
"""

import re
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.law import SI, Units
from modal.exchange.particles_and_contacts import WALLS, Cell, Contacts, Packing, ends_of
from modal.exchange.programs import lammps
from modal.exchange.text import Rows, Words, fault, kept_lines, shown, text_lines
from modal.formats.hdf5 import named
from modal.packing.checks import check_force_ratio

NAME = "tables (*.csv)"
OPTIONS = {name: lammps.OPTIONS[name] for name in ("contacts", "scales")}
SPHERES = ("id", "x", "y", "z", "radius", "mass")
CONTACTS = ("i", "j", "kn", "kt")
FORCE, SHEAR, TURNING = ("fn",), ("ftx", "fty", "ftz"), ("kr", "kw")
"""What contacts may have beside: forces, N, and stiffnesses against turning, N m/rad."""
TOLD = ("force", "shear")
KEYS = {
    "cell": "# cell XLO XHI YLO YHI ZLO ZHI",
    "periodic": "# periodic x y, with the axes that are, or leave the line out for none",
    "walls": "# walls ZLOW ZHIGH, or NULL for none",
}
"""Words with which a line behind # tells of the cell, and how it is written."""
Said = dict[str, Words]
"""Key of a line behind #, and the words after it."""


def sniff(path: Path, head: bytes) -> bool:
    """By its name."""
    return ".csv" in path.name


def read(
    path: Path, contacts: str | Path | None = None, scales: Sequence[float] | None = None
) -> ImportResult:
    """A packing of two tables."""
    if contacts is None:
        do = f"of the contacts (--contacts FILE with {','.join(CONTACTS)})"
        fault(path, "a table of spheres alone has no stiffnesses", f"`import` it with that {do}")
    units = Units.typed(scales) or SI
    rows, said = _table(path, SPHERES)
    table = rows.read(*SPHERES)
    do = "number spheres from 0 or 1; -1 and -2 are the walls"
    rows.refuse(table[:, 0] < 0, lambda row: f"id {table[row, 0]:g} is negative", do, "id")
    columns = {"number": table[:, 0], "position": table[:, 1:4]}
    columns |= {"radius": table[:, 4], "mass": table[:, 5]}
    packing = Packing.of(rows, _cell(path, said, units), units, columns, rows.digits(*SPHERES[1:4]))
    found = network_of(packing, _contacts(contacts, packing, units), None)
    if found.told["overlap_over_error_of_digits"] > 1:
        with named(contacts):
            check_force_ratio(found.network)
    return found


def _table(
    path: str | Path, needed: tuple[str, ...], further: tuple[str, ...] = ()
) -> tuple[Rows, Said]:
    """The rows of a table with these columns, and what its lines behind # say of the cell."""
    said, lines = dict[str, Words](), text_lines(path)
    for number, text in lines:
        if text.startswith("#"):
            _hear(path, number, text.rstrip(", \n"), said)
        elif text.strip():
            break
    else:
        fault(path, "no line with the names of columns", f"begin with {','.join(needed)}")
    texts = kept_lines(path, lines, sys.maxsize)
    while texts and not texts[-1].strip():
        texts.pop()
    columns = tuple(name.strip() for name in text.split(","))
    rows = Rows(Path(path), columns, texts, number + 1, ",")
    do = f"name the columns in a line of text in UTF-8, with commas: {','.join(needed)}"
    rows.require(needed, do)
    known = (*needed, *further, "")
    for name in columns:
        if name not in known:
            do = f"leave it out; known are {','.join(known[:-1])}"
            what = "it is not known, and may change the answer"
            fault(path, what, do, number, shown(name)[1:-1])
    wide = np.array([text.rstrip(", \n").count(",") >= len(columns) for text in texts])
    do = "write numbers with a point, commas between them alone"
    rows.refuse(wide, f"more than the {len(columns)} columns that the header names", do)
    if not texts:
        what = f"no rows below the names {','.join(needed)}"
        fault(path, what, "write those of the packing", number + 1)
    return rows, said


def _hear(path: str | Path, number: int, text: str, said: Said) -> None:
    """Keep a line behind # if it is a key's."""
    words = re.findall(r"[^\s:=#]+", text)
    if not words or (key := words.pop(0).lower()) not in KEYS:
        return
    line = Words(words, f"{path}, line {number}", f"write {KEYS[key]}")
    if key in said:
        at = said[key].where.removeprefix(f"{path}, ")
        line.refuse(f"# {key} again ({at})", f"{line.do}, once")
    said[key] = line


def _cell(path: str | Path, said: Said, units: Units) -> Cell:
    """The cell that a table's lines behind # tell of; walls are its bounds where none are told."""
    if "cell" not in said:
        fault(path, "no bounds of the cell", f"write {KEYS['cell']} before the names")
    low, high = units.length * np.array(said["cell"].alone("# cell", 6)).reshape(3, 2).T
    axes = [word.lower() for word in said["periodic"].left] if "periodic" in said else []
    for word in axes:
        if word not in ("x", "y", "z"):
            said["periodic"].refuse(f"{shown(word)} is no axis")
    periodic = np.isin(["x", "y", "z"], axes)
    walls = [np.nan, np.nan] if periodic[2] else [low[2], high[2]]
    if "walls" in said:
        walls = [units.length * z for z in said["walls"].alone("# walls", 2, null=True)]
        if periodic[2] and not np.isnan(walls).all():
            said["walls"].refuse("walls beside a period along z", "leave one of the two out")
    return Cell(low, high, periodic, (float(walls[0]), float(walls[1])))


def _contacts(path: str | Path, packing: Packing, units: Units) -> Contacts:
    rows, _ = _table(path, CONTACTS, FORCE + SHEAR + TURNING)
    told = rows.parts({"ends": CONTACTS, "force": FORCE, "shear": SHEAR, "turning": TURNING})
    i, j = ends_of(rows, packing.number, told["ends"][:, :2].T, ("i", "j"), WALLS)
    along_z = bool(packing.cell.periodic[2])
    why = "the packing is periodic along z" if along_z else "# walls says NULL"
    do = f"leave the contact out, or {'z out of # periodic' if along_z else 'give its z'}"
    for code, name, plane in zip(WALLS, ("lower", "upper"), packing.cell.walls, strict=True):
        what = f"a contact with the {name} wall, but {why}"
        rows.refuse((j == code) & np.isnan(plane), what, do, "j")
    springs = {"normal": units.stiffness * told["ends"][:, 2]}
    springs["tangential"] = units.stiffness * told["ends"][:, 3]
    if "turning" in told:
        springs |= zip(("rolling", "twisting"), units.moment * told["turning"].T, strict=True)
    columns = {f"stiffness_{name}": row.copy() for name, row in springs.items()}
    force, shear = (units.force * told[what] if what in told else None for what in TOLD)
    if force is not None:
        force = force[:, 0]
        do = "write compression positive; cohesion is not known"
        rows.refuse(force < 0, lambda row: f"{force[row] / units.force:g} pulls", do, "fn")
    return Contacts(i, j, force, shear, columns=columns, listed=rows)
