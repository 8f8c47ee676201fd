"""A packing as two tables with named columns (CSV), as any program can write them.

The cell stands above the spheres (`modal.exchange.table_head`). Stiffnesses stand with the
contacts, so that no law is needed and each row is a contact, whatever its force and overlap; -1 for
the second sphere is the wall at low z, -2 that at high z.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modal.exchange.bodies import Cell, Contacts, Spheres
from modal.exchange.found import Found, network_of
from modal.exchange.program_law import Units
from modal.exchange.rows import Rows, fault, last_step
from modal.exchange.table_head import cell_of, table_of
from modal.packing.checks import check_force_ratio, named
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

SPHERES = ("id", "x", "y", "z", "radius", "mass")
CONTACTS = ("i", "j", "kn", "kt")
FORCES = ("fn", "ftx", "fty", "ftz")


def import_table(path: str | Path, contacts: str | Path | None, units: Units) -> Found:
    """A packing of two tables; `units` what theirs are in SI."""
    if contacts is None:
        raise InputError(
            f"{path}: a table of spheres alone has no stiffnesses; give that of the contacts "
            f"(--contacts FILE with {','.join(CONTACTS)})"
        )
    rows, said = table_of(path, SPHERES)
    cell = cell_of(path, said, units)
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


def _spheres(rows: Rows, units: Units) -> Spheres:
    """The spheres of a table, in the order of their ids."""
    if not rows.count:
        fault(rows.path, "no spheres below the names", "write those of the packing", rows.line)
    table = rows.read(*SPHERES)
    ids = rows.whole(table[:, 0], "id")
    if (ids < 0).any():
        row = int(np.argmax(ids < 0))
        do = "number spheres from 0 or 1; -1 and -2 are the walls"
        fault(rows.path, f"id {ids[row]} is negative", do, rows.line + row, "id")
    order = np.argsort(ids, kind="stable")
    number, table = ids[order], table[order]
    again = np.flatnonzero(np.diff(number) == 0)
    if len(again):
        line = rows.line + order[again[0] + 1]
        what = f"sphere {number[again[0]]} again (line {rows.line + order[again[0]]})"
        fault(rows.path, what, "write each once, without ghosts or images", line, "id")
    digits = rows.digits("x", "y", "z")
    return Spheres(
        number=number,
        position=units.length * table[:, 1:4],
        radius=units.length * table[:, 4],
        mass=units.mass * table[:, 5],
        kind=np.zeros(len(table), int),
        digits=digits,
        step=units.length * last_step(table[:, 1:4], digits),
    )


def _contacts(path: str | Path, spheres: Spheres, cell: Cell, units: Units) -> Contacts:
    rows, _ = table_of(path, CONTACTS)
    if not rows.count:
        fault(path, "no contacts below the names", "write those of the packing", rows.line)
    pushed, sheared = rows.has("fn"), rows.has(*FORCES)
    names = [*CONTACTS, *(FORCES if sheared else FORCES[:1] * pushed)]
    table = rows.read(*names)
    i, j = (_index(rows, spheres.number, table[:, k], "ij"[k]) for k in (0, 1))
    _refuse_absent_walls(rows, j, cell)
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


def _refuse_absent_walls(rows: Rows, j: Ints, cell: Cell) -> None:
    """InputError, with its line, for a contact with a wall that the cell does not have."""
    walls = (SOURCE_WALL, "lower"), (RECEIVER_WALL, "upper")
    for (code, name), plane in zip(walls, cell.walls, strict=True):
        if np.isnan(plane) and (j == code).any():
            along_z = bool(cell.periodic[2])
            why = "the packing is periodic along z" if along_z else "# walls says NULL"
            what = f"a contact with the {name} wall, but {why}"
            do = "leave the contact out, or " + ("z out of # periodic" if along_z else "give its z")
            fault(rows.path, what, do, rows.line + int(np.argmax(j == code)), "j")


def _index(rows: Rows, number: Ints, ids: Floats, column: str) -> Ints:
    whole = rows.whole(ids, column)
    place = np.clip(np.searchsorted(number, whole), 0, len(number) - 1)
    wall = (column == "j") & ((whole == SOURCE_WALL) | (whole == RECEIVER_WALL))
    lost = (number[place] != whole) & ~wall
    if lost.any():
        row = int(np.argmax(lost))
        do = "give ids of the table of spheres, or -1, -2 for the walls in j"
        fault(rows.path, f"{whole[row]} is no sphere", do, rows.line + row, column)
    return np.where(wall, whole, place).astype(np.int32)
