"""A packing as two tables with named columns (CSV), as any program can write them.

Lines before the names say, each behind a #, what the cell is: `# cell XLO XHI YLO YHI ZLO ZHI`,
`# periodic x y`, `# walls ZLOW ZHIGH`. Stiffnesses stand with the contacts, so that no law is
needed; -1 for the second sphere is the wall at low z, -2 that at high z.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modal.exchange.bodies import Cell, Contacts, Spheres, check_spheres
from modal.exchange.found import Found, network_of
from modal.exchange.program_law import Units
from modal.exchange.rows import Rows, fault, last_step, open_bytes
from modal.formats.arrays import Floats, Ints
from modal.formats.hdf5 import InputError

SPHERES = ("id", "x", "y", "z", "radius", "mass")
CONTACTS = ("i", "j", "kn", "kt")
FORCES = ("fn", "ftx", "fty", "ftz")
REFUSED = ("clump", "parent", "bond", "cohesion", "rolling", "twist")
"""Columns that tell of what a network does not know."""


def table_of(path: str | Path, needed: tuple[str, ...]) -> tuple[Rows, dict[str, list[str]]]:
    """The rows of a table, and what its lines behind # say by their first word."""
    said: dict[str, list[str]] = {}
    with open_bytes(path) as file:
        number = 0
        for line in file:
            number += 1
            text = line.decode("utf-8", "replace").strip()
            if text.startswith("#"):
                words = text.lstrip("# ").split()
                if words:
                    said[words[0]] = words[1:]
            elif text:
                break
        else:
            fault(path, "no line with the names of columns", f"begin with {','.join(needed)}")
        offset = file.tell()
        count = sum(bool(line.strip()) for line in file)
    columns = tuple(name.strip() for name in text.split(","))
    for name in needed:
        if name not in columns:
            do = f"name the columns {','.join(needed)} in its first line"
            fault(path, f"no column {name} among {','.join(columns)}", do, number, name)
    for name in columns:
        if any(word in name.lower() for word in REFUSED):
            do = "only single spheres that touch are known; leave the column out if it is idle"
            fault(path, f"{name} is more than a network knows", do, number, name)
    return Rows(Path(path), columns, offset, number + 1, count, ","), said


def import_table(path: str | Path, contacts: str | Path | None, units: Units) -> Found:
    """A packing of two tables; `units` what theirs are in SI."""
    if contacts is None:
        raise InputError(
            f"{path}: a table of spheres alone has no stiffnesses; give that of the contacts "
            f"(--contacts FILE with {','.join(CONTACTS)})"
        )
    rows, said = table_of(path, SPHERES)
    table = rows.read(*SPHERES)
    order = np.argsort(table[:, 0], kind="stable")
    number = table[order, 0].astype(np.int64)
    again = np.flatnonzero(np.diff(number) == 0)
    if len(again):
        line = rows.line + order[again[0] + 1]
        what = f"sphere {number[again[0]]} again (line {rows.line + order[again[0]]})"
        fault(path, what, "write each once, without ghosts or images", line, "id")
    table = table[order]
    digits = rows.digits("x", "y", "z")
    spheres = Spheres(
        number=number,
        position=units.length * table[:, 1:4],
        radius=units.length * table[:, 4],
        mass=units.mass * table[:, 5],
        kind=np.zeros(len(table), int),
        digits=digits,
        step=units.length * last_step(table[:, 1:4], digits),
    )
    cell = _cell(path, said, units)
    check_spheres(spheres, cell, str(path))
    touching = _contacts(contacts, spheres, units)
    found = network_of(spheres, cell, touching, None, str(path))
    return found


def _cell(path: str | Path, said: dict[str, list[str]], units: Units) -> Cell:
    try:
        bounds = units.length * np.array(said["cell"], float).reshape(3, 2)
    except (KeyError, ValueError):
        do = "write # cell XLO XHI YLO YHI ZLO ZHI before the names"
        fault(path, "no bounds of the cell", do)
    axes = "".join(said.get("periodic", []))
    walls = [np.nan, np.nan]
    try:
        for side, word in enumerate(said.get("walls", [])[:2]):
            walls[side] = np.nan if word.upper() == "NULL" else units.length * float(word)
    except ValueError:
        fault(path, "walls that are no numbers", "write # walls ZLOW ZHIGH, or NULL for none")
    return Cell(
        bounds[:, 0],
        bounds[:, 1],
        np.array([axis in axes for axis in "xyz"]),
        (walls[0], walls[1]),
    )


def _contacts(path: str | Path, spheres: Spheres, units: Units) -> Contacts:
    rows, _ = table_of(path, CONTACTS)
    pushed, sheared = rows.has("fn"), rows.has(*FORCES)
    names = [*CONTACTS, *(FORCES if sheared else FORCES[:1] * pushed)]
    table = rows.read(*names)
    i, j = (_index(rows, spheres.number, table[:, k], "ij"[k]) for k in (0, 1))
    pair = np.sort(np.column_stack([i, j]), axis=1)
    order = np.lexsort(pair.T)
    again = np.flatnonzero((np.diff(pair[order], axis=0) == 0).all(axis=1))
    if len(again):
        first, second = order[again[0]], order[again[0] + 1]
        what = f"the contact of line {rows.line + first} again"
        fault(path, what, "list each contact once", rows.line + second)
    if pushed and (table[:, 4] < 0).any():
        row = int(np.argmax(table[:, 4] < 0))
        what, do = f"{table[row, 4]:g} pulls", "write compression positive; cohesion is not known"
        fault(path, what, do, rows.line + row, "fn")
    return Contacts(
        i,
        j,
        units.force * table[:, 4] if pushed else None,
        units.force * table[:, 5:8] if sheared else None,
        rows.digits("fn") if pushed else 17,
        (units.stiffness * table[:, 2], units.stiffness * table[:, 3]),
        listed=rows,
    )


def _index(rows: Rows, number: Ints, ids: Floats, column: str) -> Ints:
    place = np.clip(np.searchsorted(number, ids), 0, len(number) - 1)
    wall = (column == "j") & ((ids == -1) | (ids == -2))
    lost = (number[place] != ids) & ~wall
    if lost.any():
        row = int(np.argmax(lost))
        do = "give ids of the table of spheres, or -1, -2 for the walls in j"
        fault(rows.path, f"{ids[row]:g} is no sphere", do, rows.line + row, column)
    return np.where(wall, ids, place).astype(np.int32)
