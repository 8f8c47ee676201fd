"""LAMMPS' contacts: columns of dump local by their meaning, and the forces of walls on spheres.

The columns c_ID[k] of a dump mean what the compute lines in the log say; forces on walls come with
the spheres (`fix wall/gran ... contacts`).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from modal.exchange.bodies import Contacts, Spheres
from modal.exchange.dump import Frame, frame_of
from modal.exchange.dump_spheres import index_of, once
from modal.exchange.lammps_script import Script
from modal.exchange.program_law import Units
from modal.exchange.rows import fault
from modal.formats.arrays import Floats, Ints
from modal.formats.hdf5 import InputError
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL

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
    script: Script,
    units: Units,
    planes: tuple[float, float],
) -> tuple[Contacts | None, list[str]]:
    """The contacts that are told, those with walls too, and what had to be assumed."""
    if path is None:
        return None, []
    listed = frame_of(path, "ENTRIES", frame.step)
    columns, assumed = _meanings(listed, script)
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
    if np.isfinite(planes).any():
        at, code, push, rub = _on_walls(frame, spheres, units, planes)
        i, j = np.concatenate([i, at]), np.concatenate([j, code])
        force = np.concatenate([force, push])
        shear = None if shear is None else np.concatenate([shear, rub])
        upright = np.tile([0.0, 0.0, 1.0], (len(at), 1))
        line = None if line is None else np.concatenate([line, upright])
    digits = rows.digits(columns["force"])
    return Contacts(i, j, force, shear, digits, line=line, listed=rows), assumed


def _meanings(listed: Frame, script: Script) -> tuple[dict[str, str], list[str]]:
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
        words = script.computes.get(name)
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


def _on_walls(
    frame: Frame, spheres: Spheres, units: Units, planes: tuple[float, float]
) -> tuple[Ints, Ints, Floats, Floats]:
    """Spheres at a wall, its code, normal force (k,) and shear force (k, 3) on the sphere, N."""
    rows = frame.rows
    fixes = sorted({column.split("[")[0] for column in rows.columns if column.startswith("f_")})
    names = next(
        (found for fix in fixes if rows.has(*(found := [f"{fix}[{k}]" for k in (1, 2, 3, 4)]))),
        None,
    )
    if names is None:
        do = "write fix ... wall/gran ... contacts and dump f_ID[1] f_ID[2] f_ID[3] f_ID[4]"
        fault(rows.path, "no forces of the walls", do, rows.line - 1, "f_ID[1..4]")
    order = np.argsort(rows.read("id")[:, 0], kind="stable")
    table = rows.read(*names)[order]
    (at,) = np.nonzero(table[:, 0] > 0)
    force = units.force * table[at, 1:4]
    # The wall that pushes; a sphere between two walls that touch it would need two rows.
    code = np.where(force[:, 2] > 0, SOURCE_WALL, RECEIVER_WALL)
    absent = np.isnan(planes)[np.where(code == SOURCE_WALL, 0, 1)]
    if absent.any():
        which = spheres.number[at[int(np.argmax(absent))]]
        raise InputError(f"{rows.path}: sphere {which} is pushed by a wall that --wall leaves NULL")
    push = abs(force[:, 2])
    force[:, 2] = 0
    return at.astype(np.int32), code.astype(np.int32), push, force
