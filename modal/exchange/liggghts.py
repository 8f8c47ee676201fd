"""LIGGGHTS' packings: dump custom as of LAMMPS, contacts by `compute pair/gran/local`, its own law.

`model hertz` with `tangential history`: N = 4/3 E* sqrt(R* overlap) overlap and 8 G* sqrt(R*
overlap), the shear displacement kept. `model hooke` takes its stiffness from masses and a velocity
that is typed in, and is refused.
"""

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
from modal.exchange.lammps_law import material_of
from modal.exchange.program_law import DISPLACEMENT, MIDDLE, ProgramLaw, Units
from modal.exchange.rows import fault, read_lines
from modal.formats.hdf5 import InputError
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL

PROPERTIES = ("youngsModulus", "poissonsRatio", "coefficientFriction")
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
EXAMPLE = (
    '--pair "gran model hertz tangential history youngsModulus 6e10 poissonsRatio 0.2 '
    'coefficientFriction 0.3"'
)


def import_liggghts(
    atoms: str | Path,
    contacts: str | Path | None,
    log: str | Path | None,
    pair: str | None,
    wall: str | None,
    units: Units,
    step: int | None,
) -> Found:
    """A packing of LIGGGHTS; arguments as on the command line."""
    words = pair.split() if pair else []
    properties = {name: _after(words, name, "--pair") for name in PROPERTIES if name in words}
    computes, fixes = dict[str, list[str]](), list[list[str]]()
    for line in read_lines(log) if log else ():
        said = line.split("#")[0].split()
        if not pair and said[:2] == ["pair_style", "gran"]:
            words = said[1:]
        if said[:1] == ["fix"] and said[3:4] == ["property/global"] and len(said) > 6:
            first = 7 if said[5] == "peratomtypepair" else 6
            properties.setdefault(said[4], [float(word) for word in said[first:]])
        if said[:1] == ["compute"] and said[3:4] == ["pair/gran/local"]:
            computes[said[1]] = said[4:]
        if said[:1] == ["fix"] and said[3:4] == ["wall/gran"]:
            fixes.append(said[4:])
    where = "--pair" if pair else f"{log}"
    planes, of_wall = _walls(wall.split() if wall else [], fixes, units)
    law_of = _law_of(words, properties, units, where, of_wall)
    frame = frame_of(atoms, "ATOMS", step)
    spheres, cell = spheres_of(frame, units), replace(cell_of(frame, units), walls=planes)
    check_spheres(spheres, cell, str(atoms))
    touching, remarks = None, []
    if contacts is not None:
        touching = _contacts(contacts, frame.step, spheres, cell, computes, units)
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
    found.told["assumed"] = [
        f"the {name} wall is of the material of the sphere that touches it (say --wall "
        '"type N zplane LOW HIGH")'
        for code, name in ((SOURCE_WALL, "lower"), (RECEIVER_WALL, "upper"))
        if code not in of_wall and (found.network.particle_j == code).any()
    ]
    return found


def _after(words: list[str], name: str, where: str) -> list[float]:
    try:
        return [float(words[words.index(name) + 1])]
    except (ValueError, IndexError):
        raise InputError(f"{where}: {name} needs a number behind it") from None


def _law_of(
    words: list[str],
    properties: dict[str, list[float]],
    units: Units,
    where: str,
    of_wall: dict[int, int],
) -> LawOf:
    """The law between two types, or a type and a wall; `of_wall` has the types of walls."""
    if words[:2] != ["gran", "model"] and words[:1] != ["gran"]:
        raise InputError(f"no law of contact is known; give {EXAMPLE}")
    if "hertz" not in words or "history" not in words:
        raise InputError(
            f"{where}: only model hertz with tangential history is known; the stiffness of others "
            "depends on more than the overlap"
        )
    for option in ("cohesion", "rolling_friction"):
        if option in words and words[words.index(option) + 1 :][:1] not in (["off"], []):
            raise InputError(f"{where}: {option} is resisted by no spring here; only {option} off")
    lost = [name for name in PROPERTIES if name not in properties]
    if lost:
        raise InputError(f"{where}: no {', '.join(lost)}; give {EXAMPLE}, or the log that has them")
    materials = [
        material_of(units.pressure * young, poisson, where)
        for young, poisson in zip(
            properties["youngsModulus"], properties["poissonsRatio"], strict=False
        )
    ]
    friction = properties["coefficientFriction"]

    def law_of(a: int, b: int) -> ProgramLaw:
        if a < 0:
            a, b = sorted((b, of_wall.get(a, b)))
        if a < 1 or (b > len(materials) and len(materials) > 1):
            raise InputError(
                f"{where}: no properties for type {a if a < 1 else b}; give them for all types"
            )
        one, two = (materials[min(k, len(materials)) - 1] for k in (a, b))
        young, shear = one.against(two)
        place = (a - 1) * len(materials) + b - 1
        return ProgramLaw(
            normal=4 / 3 * young,
            hertz=True,
            tangential=8 * shear,
            grows=True,
            friction=friction[place] if len(friction) > place else friction[0],
            keeps=DISPLACEMENT,
            moves=MIDDLE,
            turns=MIDDLE,
        )

    return law_of


def _walls(
    words: list[str], fixes: list[list[str]], units: Units
) -> tuple[tuple[float, float], dict[int, int]]:
    """z of both walls, m, NaN for none, and their types by their codes, where these are said.

    From --wall "type N zplane LOW HIGH", or from the log's fixes, each of one plane.
    """
    planes = {SOURCE_WALL: np.nan, RECEIVER_WALL: np.nan}
    types: dict[int, int] = {}
    try:
        if words:
            at = words.index("zplane")
            for code, word in zip(planes, words[at + 1 : at + 3], strict=True):
                planes[code] = np.nan if word.upper() == "NULL" else units.length * float(word)
            if "type" in words:
                types = dict.fromkeys(planes, int(words[words.index("type") + 1]))
            return (planes[SOURCE_WALL], planes[RECEIVER_WALL]), types
    except (ValueError, IndexError):
        raise InputError(
            '--wall: for LIGGGHTS give "type N zplane LOW HIGH" (a number or NULL)'
        ) from None
    found = []
    for said in fixes:
        if "zplane" not in said or "type" not in said:
            raise InputError(
                f"fix wall/gran {' '.join(said)[:60]}: only primitive walls zplane are known; "
                'give the flat walls by --wall "type N zplane LOW HIGH"'
            )
        place, number = (said[said.index(name) + 1 :][:1] for name in ("zplane", "type"))
        found.append((units.length * float(place[0]), int(number[0])))
    if len(found) > 2:
        raise InputError(f"{len(found)} walls zplane; give the two by --wall")
    for code, (z, kind) in zip(planes, sorted(found), strict=False):
        planes[code], types[code] = z, kind
    return (planes[SOURCE_WALL], planes[RECEIVER_WALL]), types


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
    return Contacts(i, j, abs(push), shear, rows.digits(*names[2:5]), line=line)


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
    assert contacts.force is not None
    return Contacts(
        np.concatenate([contacts.i, i]),
        np.concatenate([contacts.j, j]),
        np.concatenate([contacts.force, force]),
        None,
        contacts.digits,
    )
