"""LIGGGHTS' packings: dump custom as of LAMMPS, contacts by `compute pair/gran/local`.

`model hertz` with `tangential history`: N = 4/3 E* sqrt(R* overlap) overlap and 8 G* sqrt(R*
overlap), the shear displacement kept. `model hooke` takes its stiffness from masses and a velocity
that is typed in, and is refused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from modal.exchange.dump import ROUNDED, cell_of, frame_of, of_liggghts, spheres_of, units_of
from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.input_script import PROPERTIES, Script, read_log
from modal.exchange.lammps_law import material_of
from modal.exchange.law import DISPLACEMENT, MIDDLE, ProgramLaw, Units
from modal.exchange.particles_and_contacts import (
    Cell,
    Contacts,
    LawOf,
    Spheres,
    branches,
    check_spheres,
    ends_of,
    touching_pairs,
)
from modal.exchange.programs import lammps
from modal.exchange.registry import File
from modal.exchange.rows import fault
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.errors import InputError

NAME = "LIGGGHTS"
OPTIONS = {name: option for name, option in lammps.OPTIONS.items() if name != "bodies"}
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
TYPED_WALL = '--wall "type N zplane LOW HIGH"'
OFF = {"cohesion": "off", "rolling_friction": "off", "surface": "default"}
"""Models that do more than springs, and the word that turns each off."""


def sniff(file: File) -> bool:
    """A text dump whose log, or law, is of LIGGGHTS."""
    return file.head.startswith(b"ITEM:") and of_liggghts(file)


def read(
    path: Path,
    contacts: str | Path | None = None,
    log: str | Path | None = None,
    pair: str | None = None,
    wall: str | None = None,
    step: int | None = None,
    scales: Sequence[float] | None = None,
) -> ImportResult:
    """A packing of LIGGGHTS."""
    script = read_log(log) if log else Script()
    if pair:
        script.said, script.style = "--pair", tuple(pair.split())
        script.properties |= {name: _after(pair, name) for name in PROPERTIES if name in pair}
    if script.bodies:
        raise InputError(
            f"{script.said}: fix rigid: clumps of LIGGGHTS are not known; leave it out"
        )
    frame = frame_of(path, "ATOMS", step)
    units = units_of(frame, Units.typed(scales), (script.units or "si") if log else "", script.said)
    planes, of_wall = walls_of(wall, script, units)
    law_of = law_of_types(script, units, of_wall)
    typed = any(len(values) > 1 for values in script.properties.values())
    spheres, cell = spheres_of(frame, units, typed=typed), cell_of(frame, units, planes)
    check_spheres(spheres, cell, str(path))
    touching, remarks = None, script.remark_on_changes(frame.step)
    if contacts is not None:
        touching = _contacts(contacts, frame.step, spheres, cell, script.computes, units)
        if np.isfinite(planes).any():
            touching = _with_walls(touching, spheres, cell)
            remarks += ["shear forces at the walls are not told: all shear forces are left out"]
        if frame.rounding:
            remarks += [
                f"the cell's bounds have {ROUNDED[0]} digits: overlaps and normals are taken from "
                "forces; bounds that few digits hold (fix deform ... final) are exact"
            ]
    found = network_of(spheres, cell, touching, law_of, str(path))
    found.remarks += remarks
    found.told["assumed"] = ["units si"] * (scales is None and not (log or frame.units)) + [
        f"the {name} wall is of the material of the sphere that touches it (say {TYPED_WALL})"
        for code, name in ((SOURCE_WALL, "lower"), (RECEIVER_WALL, "upper"))
        if code not in of_wall and (found.network.particle_j == code).any()
    ]
    return found


def _after(line: str, name: str) -> list[float]:
    words = line.split()
    try:
        return [float(words[words.index(name) + 1])]
    except (ValueError, IndexError):
        raise InputError(f"--pair: {name} needs a number behind it") from None


def _contacts(
    path: str | Path,
    step: int,
    spheres: Spheres,
    cell: Cell,
    computes: Mapping[str, Sequence[str]],
    units: Units,
) -> Contacts:
    """What `pair/gran/local` tells of the contacts between spheres."""
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
    i, j = ends_of(rows, spheres.number, table[:, :2].T, names[:2])
    branch, _ = branches(spheres.position, cell, cell.walls, i, j)
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
    return Contacts(i, j, abs(push), shear, line=line, listed=rows)


def _with_walls(contacts: Contacts, spheres: Spheres, cell: Cell) -> Contacts:
    """Contacts with flat walls, found from positions: their forces are not told."""
    found = touching_pairs(spheres, cell)
    wall = found.j < 0
    more = {"i": found.i[wall], "j": found.j[wall], "force": np.full(wall.sum(), np.nan)}
    if contacts.line is not None:
        more["line"] = np.tile([0.0, 0.0, 1.0], (len(more["i"]), 1))
    whole: dict[str, Any] = {
        name: np.concatenate([getattr(contacts, name), data]) for name, data in more.items()
    }
    return replace(contacts, shear=None, **whole)


def law_of_types(script: Script, units: Units, of_wall: dict[int, int]) -> LawOf:
    """The law between two types, or a type and a wall; `of_wall` has the types of walls."""
    words, properties, where = script.style, script.properties, script.said
    if words[:1] != ("gran",):
        raise InputError(f"no law of contact is known; give {EXAMPLE}")
    if "hertz" not in words or "history" not in words:
        raise InputError(
            f"{where}: only model hertz with tangential history is known; the stiffness of others "
            "depends on more than the overlap"
        )
    for option, off in OFF.items():
        if option in words and words[words.index(option) + 1 :][:1] not in ((off,), ()):
            raise InputError(
                f"{where}: {option} is resisted by no spring here; only {option} {off}"
            )
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


def walls_of(
    wall: str | None, script: Script, units: Units
) -> tuple[tuple[float, float], dict[int, int]]:
    """z of both walls, m, NaN for none, and their types by their codes, where these are said.

    From --wall "type N zplane LOW HIGH", or from the log's fixes, each of one plane; a single one
    is the floor.
    """
    planes = {SOURCE_WALL: np.nan, RECEIVER_WALL: np.nan}
    types: dict[int, int] = {}
    if wall:
        words = wall.split()
        try:
            at = words.index("zplane")
            for code, word in zip(planes, words[at + 1 : at + 3], strict=True):
                planes[code] = np.nan if word.upper() == "NULL" else units.length * float(word)
            if "type" in words:
                types = dict.fromkeys(planes, int(words[words.index("type") + 1]))
        except (ValueError, IndexError):
            raise InputError(
                '--wall: for LIGGGHTS give "type N zplane LOW HIGH" (a number or NULL)'
            ) from None
        return (planes[SOURCE_WALL], planes[RECEIVER_WALL]), types
    found = sorted(_plane(name, words, units) for name, words in script.walls.items())
    if len(found) > len(planes):
        raise InputError(f"{script.said}: {len(found)} walls zplane; give two, {TYPED_WALL}")
    for code, (z, kind) in zip(planes, found, strict=False):
        planes[code], types[code] = z, kind
    return (planes[SOURCE_WALL], planes[RECEIVER_WALL]), types


def _plane(name: str, words: Sequence[str], units: Units) -> tuple[float, int]:
    """z, m, and type of one flat wall."""
    try:
        z, kind = (words[words.index(key) + 1] for key in ("zplane", "type"))
        return units.length * float(z), int(kind)
    except (ValueError, IndexError):
        raise InputError(
            f"fix {name} wall/gran: only primitive walls zplane are known; give {TYPED_WALL}"
        ) from None
