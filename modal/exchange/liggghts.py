"""LIGGGHTS' packings: dump custom as of LAMMPS, contacts by `compute pair/gran/local`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from modal.exchange.bodies import (
    Cell,
    Contacts,
    LawOf,
    Spheres,
    check_spheres,
    nearest,
    touching_pairs,
)
from modal.exchange.dump import ROUNDED, frame_of
from modal.exchange.dump_spheres import cell_of, index_of, once, spheres_of
from modal.exchange.found import Found, network_of
from modal.exchange.lammps import units_of
from modal.exchange.liggghts_script import TYPED_WALL, law_of_types, read_script, walls_of
from modal.exchange.program_law import Units
from modal.exchange.rows import fault
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL

COLUMNS = {
    "pos": 6,
    "vel": 6,
    "id": 3,
    "force": 3,
    "force_normal": 3,
    "force_tangential": 3,
    "torque": 3,
    "history": 3,
    "contactArea": 1,
    "delta": 1,
}
"""What `pair/gran/local` writes, in this order, and how many columns each takes."""
UNASKED = ("pos", "vel", "id", "force", "torque", "history", "contactArea")
"""Of these, what it writes when none is named."""


def import_liggghts(
    atoms: str | Path,
    contacts: str | Path | None,
    log: str | Path | None,
    pair: str | None,
    wall: str | None,
    units: Units | None,
    step: int | None,
) -> Found:
    """A packing of LIGGGHTS; arguments as on the command line."""
    script, unsaid = read_script(log, pair), units is None
    frame = frame_of(atoms, "ATOMS", step)
    units = units_of(frame, units, script.units if log else "", script.where)
    planes, of_wall = walls_of(wall, script, units)
    law_of = law_of_types(script, units, of_wall)
    typed = any(len(values) > 1 for values in script.properties.values())
    spheres, cell = (
        spheres_of(frame, units, typed=typed),
        replace(cell_of(frame, units), walls=planes),
    )
    check_spheres(spheres, cell, str(atoms))
    touching, remarks = None, []
    if contacts is not None:
        touching = _contacts(contacts, frame.step, spheres, cell, script.computes, units)
        if np.isfinite(planes).any():
            touching = _with_walls(touching, spheres, cell, law_of)
            remarks = ["shear forces at the walls are not told: all shear forces are left out"]
        if frame.rounding:
            remarks += [
                f"the cell's bounds have {ROUNDED[0]} digits: overlaps and normals are taken from "
                "forces; bounds that few digits hold (fix deform ... final) are exact"
            ]
    found = network_of(spheres, cell, touching, law_of, str(atoms))
    found.remarks += remarks
    found.told["assumed"] = ["units si"] * (unsaid and not (log or frame.units)) + [
        f"the {name} wall is of the material of the sphere that touches it (say {TYPED_WALL})"
        for code, name in ((SOURCE_WALL, "lower"), (RECEIVER_WALL, "upper"))
        if code not in of_wall and (found.network.particle_j == code).any()
    ]
    return found


def _contacts(
    path: str | Path,
    step: int,
    spheres: Spheres,
    cell: Cell,
    computes: dict[str, list[str]],
    units: Units,
) -> Contacts:
    listed = frame_of(path, "ENTRIES", step)
    rows = listed.rows
    columns = [name for name in rows.columns if re.fullmatch(r"c_\w+\[\d+\]", name)]
    name = columns[0][2:].split("[")[0] if columns else ""
    kinds: Sequence[str] = computes.get(name) or UNASKED
    if name not in computes and len(columns) == sum(COLUMNS.values()):
        kinds = tuple(COLUMNS)
    place, at = {}, 0
    for kind, width in COLUMNS.items():
        if kind in kinds:
            place[kind] = at
            at += width
    if not columns or (name not in computes and at != len(columns)):
        what = f"{len(columns)} columns of pair/gran/local, where its values take {at}"
        fault(rows.path, what, "give the log with the compute line (--log)", rows.line - 1)
    parts = ("force_normal", "force_tangential")
    forces = parts if place.keys() >= set(parts) else ("force",)
    for kind in ("id", *forces):
        if kind not in place or place[kind] + 3 > len(columns):
            fault(rows.path, f"no {kind}", f"add {kind} to pair/gran/local", rows.line - 1, kind)
    names = [columns[place["id"] + k] for k in (0, 1)]
    names += [columns[place[kind] + k] for kind in forces for k in range(3)]
    table = rows.read(*names)
    i, j = (
        index_of(spheres.number, table[:, k], listed, names[k]).astype(np.int32) for k in (0, 1)
    )
    once(i, j, listed)
    branch, _ = nearest(spheres.position[j] - spheres.position[i], cell)
    normal = branch / np.linalg.norm(branch, axis=1)[:, None]
    told = units.force * table[:, 2:5]
    along, shear = told, units.force * table[:, 5:]
    if len(forces) == 1:
        along = (told * normal).sum(axis=1)[:, None] * normal
        shear = told - along
    # Versions differ in which of the two bears the forces that are written; a contact pushes.
    push = -(along * normal).sum(axis=1)
    shear = np.where(push < 0, -1.0, 1.0)[:, None] * shear
    # A normal of its own tells more than rounded bounds; that of the whole force is not one.
    line = told if len(forces) > 1 else None
    digits = rows.digits(*names[2:5])
    return Contacts(i, j, abs(push), shear, digits, line=line, listed=rows)


def _with_walls(contacts: Contacts, spheres: Spheres, cell: Cell, law_of: LawOf) -> Contacts:
    """Contacts with flat walls, found from positions: their forces follow from the law."""
    found = touching_pairs(spheres, cell)
    wall = found.j < 0
    i, j = found.i[wall], found.j[wall]
    plane = np.array(cell.walls)[np.where(j == -1, 0, 1)]
    overlap = spheres.radius[i] - abs(plane - spheres.position[i, 2])
    force = np.array(
        [
            float(law_of(int(code), int(spheres.kind[k])).force(np.array(d), spheres.radius[k]))
            for k, code, d in zip(i, j, overlap, strict=True)
        ]
    )
    upright = np.tile([0.0, 0.0, 1.0], (len(i), 1))
    assert contacts.force is not None
    return Contacts(
        np.concatenate([contacts.i, i]),
        np.concatenate([contacts.j, j]),
        np.concatenate([contacts.force, force]),
        None,
        contacts.digits,
        line=None if contacts.line is None else np.concatenate([contacts.line, upright]),
        listed=contacts.listed,
    )
