"""A packing as two tables with named columns (CSV), as any program can write them.

Three lines behind # above the spheres tell of the cell: `# cell XLO XHI YLO YHI ZLO ZHI`, `#
periodic x y` and `# walls ZLOW ZHIGH`, in any case, with or without a colon; others are comments.
Stiffnesses stand with the contacts, so that no law is needed and each row is a contact, whatever
its force and overlap; -1 for the second sphere is the wall at low z, -2 that at high z. A column
that is not known is refused, as it may change the answer.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.law import SI, Units
from modal.exchange.particles_and_contacts import Cell, Contacts, Spheres, ends_of, in_order
from modal.exchange.programs import lammps
from modal.exchange.registry import File, Option
from modal.exchange.rows import Rows, fault, last_step, open_bytes, shown
from modal.packing.checks import check_force_ratio, named
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

NAME = "tables (*.csv)"
OPTIONS = {"contacts": Option("*.csv of contacts"), "scales": lammps.OPTIONS["scales"]}
SPHERES = ("id", "x", "y", "z", "radius", "mass")
CONTACTS = ("i", "j", "kn", "kt")
FORCES = ("fn", "ftx", "fty", "ftz")
TURNING = ("kr", "kw")
"""Stiffnesses against rolling and twisting, N m/rad."""
WALLS = (SOURCE_WALL, RECEIVER_WALL)
KEYS = {
    "cell": "# cell XLO XHI YLO YHI ZLO ZHI",
    "periodic": "# periodic x y, with the axes that are, or leave the line out for none",
    "walls": "# walls ZLOW ZHIGH, or NULL for none",
}
"""Words with which a line behind # tells of the cell, and how it is written."""
Said = dict[str, tuple[int, list[str]]]
"""Key of a line behind #: its number, and the words after the key."""


def sniff(file: File) -> bool:
    """By its name."""
    return ".csv" in file.path.name


def read(
    path: Path, contacts: str | Path | None = None, scales: Sequence[float] | None = None
) -> ImportResult:
    """A packing of two tables."""
    if contacts is None:
        raise InputError(
            f"{path}: a table of spheres alone has no stiffnesses; `import` it with that of the "
            f"contacts (--contacts FILE with {','.join(CONTACTS)})"
        )
    units = Units.typed(scales) or SI
    rows, said = _table(path, SPHERES)
    cell = _cell(path, said, units)
    spheres = _spheres(rows, units)
    touching = _contacts(contacts, spheres, cell, units)
    found = network_of(spheres, cell, touching, None, str(path))
    if found.told["overlap_over_error_of_digits"] > 1:
        with named(contacts):
            check_force_ratio(found.network)
    if touching.force is not None and not touching.force.all():
        idle, listed = int((touching.force == 0).sum()), len(touching.force)
        of = "all" if idle == listed else f"{idle} of {listed}"
        found.remarks.append(f"fn is 0 in {of} listed contacts: kept, as springs without a force")
    return found


def _table(
    path: str | Path, needed: tuple[str, ...], further: tuple[str, ...] = ()
) -> tuple[Rows, Said]:
    """The rows of a table with these columns, and what its lines behind # say of the cell."""
    said: Said = {}
    with open_bytes(path) as file:
        number = 0
        for line in file:
            number += 1
            # A spreadsheet puts a byte order mark before all and empty columns behind a line.
            text = line.decode("utf-8-sig" if number == 1 else "utf-8", "replace").strip()
            if text.startswith("#"):
                _hear(path, number, text.rstrip(", "), said)
            elif text:
                break
        else:
            fault(path, "no line with the names of columns", f"begin with {','.join(needed)}")
        offset = file.tell()
        count = sum(bool(line.strip()) for line in file)
    columns = tuple(name.strip() for name in text.split(","))
    for name in needed:
        if name not in columns:
            do = f"name the columns in a line of text in UTF-8, with commas: {','.join(needed)}"
            fault(path, f"no column {name} among {shown(text)}", do, number, name)
    for name in columns:
        if name and name not in (*needed, *further):
            do = f"leave it out; known are {','.join((*needed, *further))}"
            what = "it is not known, and may change the answer"
            fault(path, what, do, number, shown(name)[1:-1])
    if not count:
        what = f"no rows below the names {','.join(needed)}"
        fault(path, what, "write those of the packing", number + 1)
    return Rows(Path(path), columns, offset, number + 1, count, ","), said


def _hear(path: str | Path, number: int, text: str, said: Said) -> None:
    """Keep a line behind # if it is a key's."""
    found = re.fullmatch(r"#[#\s]*([^\s:=]+)\s*[:=]?\s*(.*)", text)
    if found is None or (key := found[1].lower()) not in KEYS:
        return
    if key in said:
        what = f"# {key} again (line {said[key][0]})"
        fault(path, what, f"write {KEYS[key]}, once", number)
    said[key] = number, found[2].split()


def _cell(path: str | Path, said: Said, units: Units) -> Cell:
    """The cell that a table's lines behind # tell of; walls are its bounds where none are told."""
    line, words = said.get("cell", (0, []))
    try:
        bounds = units.length * np.array(words, float).reshape(3, 2)
    except ValueError:
        bounds = np.full((3, 2), np.nan)
    if not np.isfinite(bounds).all():
        fault(path, "no bounds of the cell", f"write {KEYS['cell']} before the names", line)
    line, words = said.get("periodic", (0, []))
    axes = [word.lower() for word in words]
    for word, axis in zip(words, axes, strict=True):
        if axis not in ("x", "y", "z"):
            fault(path, f"{shown(word)} is no axis", f"write {KEYS['periodic']}", line)
    line, words = said.get("walls", (0, []))
    walls: list[float] = [np.nan, np.nan] if "z" in axes else bounds[2].tolist()
    if line:
        try:
            walls = [np.nan if w.upper() == "NULL" else units.length * float(w) for w in words]
        except ValueError:
            walls = [math.inf]
        if len(walls) != 2 or np.isinf(walls).any():
            what = f"walls {shown(' '.join(words))} are not two numbers"
            fault(path, what, f"write {KEYS['walls']}", line)
        if "z" in axes and not np.isnan(walls).all():
            fault(path, "walls beside a period along z", "leave one of the two out", line)
    periodic = np.array([axis in axes for axis in "xyz"])
    return Cell(bounds[:, 0], bounds[:, 1], periodic, (walls[0], walls[1]))


def _spheres(rows: Rows, units: Units) -> Spheres:
    """The spheres of a table, in the order of their ids."""
    table = rows.read(*SPHERES)
    number, order = in_order(rows, table[:, 0])
    if number[0] < 0:
        do = "number spheres from 0 or 1; -1 and -2 are the walls"
        fault(rows.path, f"id {number[0]} is negative", do, rows.line + order[0], "id")
    table, digits = table[order], rows.digits("x", "y", "z")
    position, radius = units.length * table[:, 1:4], units.length * table[:, 4]
    step, kind = units.length * last_step(table[:, 1:4], digits), np.zeros(len(table), int)
    return Spheres(number, position, radius, units.mass * table[:, 5], kind, digits, step)


def _contacts(path: str | Path, spheres: Spheres, cell: Cell, units: Units) -> Contacts:
    rows, _ = _table(path, CONTACTS, FORCES + TURNING)
    read: dict[str, Floats] = {}
    for names in (CONTACTS, FORCES[:1], FORCES[1:], TURNING):
        if rows.has(*names):
            read |= dict(zip(names, rows.read(*names).T, strict=True))
    i, j = ends_of(rows, spheres.number, (read["i"], read["j"]), ("i", "j"), WALLS)
    _refuse_absent_walls(rows, j, cell)
    force = read.get("fn")
    if force is not None and (force < 0).any():
        row = int(np.argmax(force < 0))
        what, do = f"{force[row]:g} pulls", "write compression positive; cohesion is not known"
        fault(rows.path, what, do, rows.line + row, "fn")
    sheared, turning = rows.has(*FORCES), rows.has(*TURNING)
    return Contacts(
        i,
        j,
        None if force is None else units.force * force,
        units.force * np.column_stack([read[name] for name in FORCES[1:]]) if sheared else None,
        (units.stiffness * read["kn"], units.stiffness * read["kt"]),
        (units.moment * read["kr"], units.moment * read["kw"]) if turning else None,
        listed=rows,
    )


def _refuse_absent_walls(rows: Rows, j: Ints, cell: Cell) -> None:
    """InputError, with its line, for a contact with a wall that the cell does not have."""
    for code, name, plane in zip(WALLS, ("lower", "upper"), cell.walls, strict=True):
        if np.isnan(plane) and (j == code).any():
            along_z = bool(cell.periodic[2])
            why = "the packing is periodic along z" if along_z else "# walls says NULL"
            what = f"a contact with the {name} wall, but {why}"
            do = "leave the contact out, or " + ("z out of # periodic" if along_z else "give its z")
            fault(rows.path, what, do, rows.line + int(np.argmax(j == code)), "j")
