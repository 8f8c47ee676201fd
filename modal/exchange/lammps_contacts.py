"""LAMMPS' contacts: columns of dump local by their meaning, and those with walls.

The columns c_ID[k] of a dump mean what the compute lines in the log say; forces on walls come with
the spheres (`modal/exchange/lammps_walls.py`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from modal.exchange.bodies import Contacts, Spheres
from modal.exchange.dump import Frame, frame_of
from modal.exchange.dump_spheres import index_of, once
from modal.exchange.lammps_walls import Walls, contacts_with_walls, planes_of
from modal.exchange.program_law import Units
from modal.exchange.rows import fault

Computes = Mapping[str, Sequence[str]]
RECIPE = {
    4: ("patom1", "patom2", "ptype1", "ptype2"),
    9: ("dist", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
    12: ("dist", "dx", "dy", "dz", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
}
"""Columns of `write_contacts.lmp`, and of a usual recipe, where no log names them."""


def contacts_of(
    frame: Frame,
    spheres: Spheres,
    path: str | Path | None,
    computes: Computes,
    units: Units,
    walls: Sequence[Walls],
    fixes: Sequence[str],
) -> tuple[Contacts | None, list[str]]:
    """The contacts that are told, those with walls too, and what had to be assumed.

    `computes` and `fixes` are the log's: the words of each compute, and the IDs of walls.
    """
    if path is None:
        return None, []
    listed = frame_of(path, "ENTRIES", frame.step)
    columns, assumed = _meanings(listed, computes)
    rows = listed.rows
    for name in ("patom1", "patom2", "force"):
        if name not in columns:
            known = " ".join(columns) or " ".join(rows.columns)
            do = "write compute property/local patom1 patom2 and pair/local force p1 p2 p3"
            fault(rows.path, f"no column of {name} among {known}", do, rows.line - 1, name)
    sheared = all(name in columns for name in ("p1", "p2", "p3"))
    lined = all(name in columns for name in ("fx", "fy", "fz"))
    names = (
        ["patom1", "patom2", "force"] + ["p1", "p2", "p3"] * sheared + ["fx", "fy", "fz"] * lined
    )
    table = rows.read(*(columns[name] for name in names))
    i, j = (
        index_of(spheres.number, table[:, k], listed, columns[names[k]]).astype(np.int32)
        for k in (0, 1)
    )
    once(i, j, listed)
    force = units.force * table[:, 2]
    shear = units.force * table[:, 3:6] if sheared else None
    line = table[:, -3:] if lined else None
    if np.isfinite(planes_of(walls)).any():
        at, code, push, rub = contacts_with_walls(frame, spheres, units, walls, fixes)
        i, j = np.concatenate([i, at]), np.concatenate([j, code])
        force = np.concatenate([force, push])
        shear = None if shear is None else np.concatenate([shear, rub])
        upright = np.tile([0.0, 0.0, 1.0], (len(at), 1))
        line = None if line is None else np.concatenate([line, upright])
    digits = rows.digits(columns["force"])
    return Contacts(i, j, force, shear, digits, line=line, listed=rows), assumed


def _meanings(listed: Frame, computes: Computes) -> tuple[dict[str, str], list[str]]:
    """Name of a quantity: column that holds it; and what was assumed about that."""
    columns: dict[str, str] = {}
    groups: dict[str, list[str]] = {}
    for column in listed.rows.columns:
        indexed = re.fullmatch(r"c_(\w+)(?:\[(\d+)\])?", column)
        if indexed:
            groups.setdefault(indexed[1], []).append(column)
        else:
            columns[column] = column
    assumed = []
    for name, members in groups.items():
        words = computes.get(name)
        if words is None:
            words = RECIPE.get(len(members))
            if words is None:
                what = f"what {members[0]} means stands in a compute line"
                do = "give the log that has it (--log), or write as write_contacts.lmp does"
                fault(listed.rows.path, what, do, listed.rows.line - 1, members[0])
            assumed.append(f"columns of c_{name}: {' '.join(words)}")
        for member in members:
            at = re.search(r"\[(\d+)\]", member)
            place = int(at[1]) - 1 if at else 0
            if place < len(words):
                columns[words[place]] = member
    return columns, assumed
