"""LIGGGHTS' packings: dump custom as of LAMMPS, contacts by `compute pair/gran/local`.

`model hertz` with `tangential history`: N = 4/3 E* sqrt(R* overlap) overlap and 8 G* sqrt(R*
overlap), the shear displacement kept. `model hooke` takes its stiffness from masses and a velocity
that is typed in, and is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modal.exchange.dump import ROUNDED, Frame, frame_of, of_liggghts, spheres_of, units_of
from modal.exchange.dump_contacts import CODES, planes_said, require, told_contacts
from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.input_script import PROPERTIES, Script, read_log
from modal.exchange.lammps_law import material_of
from modal.exchange.law import DISPLACEMENT, ProgramLaw, Units
from modal.exchange.particles_and_contacts import (
    Cell,
    Contacts,
    LawOf,
    Spheres,
    pushes,
    touching_pairs,
)
from modal.exchange.programs import lammps
from modal.exchange.registry import File
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


def read(path: Path, **given: Any) -> ImportResult:
    """A packing of LIGGGHTS."""
    contacts, log, pair, wall = map(given.get, ("contacts", "log", "pair", "wall"))
    script = read_log(log, "si")
    if pair:
        script.said, script.style = "--pair", tuple(pair.split())
        script.properties |= {name: _after(pair, name) for name in PROPERTIES if name in pair}
    if script.bodies:
        raise InputError(
            f"{script.said}: fix rigid: clumps of LIGGGHTS are not known; leave it out"
        )
    frame = frame_of(path, "ATOMS", given.get("step"))
    units, assumed = units_of(frame, given.get("scales"), script)
    planes, of_wall = walls_of(wall, script, units)
    law_of = law_of_types(script, units, of_wall)
    typed = any(len(values) > 1 for values in script.properties.values())
    spheres, cell = spheres_of(frame, units, planes, typed=typed)
    touching, remarks = None, script.remark_on_changes(frame.step)
    if contacts is not None:
        touching, meant = _contacts(contacts, frame, spheres, cell, script.computes, units)
        assumed += meant
        if planes:  # found from positions: the forces there are not told
            found = touching_pairs(spheres, cell)
            at = found.i[found.j < 0]
            touching = touching.with_walls(at, found.j[found.j < 0], np.full(len(at), np.nan), None)
            remarks += ["shear forces at the walls are not told: all shear forces are left out"]
        if frame.rounding:
            remarks += [
                f"the cell's bounds have {ROUNDED[0]} digits: overlaps and normals are taken from "
                "forces; bounds that few digits hold (fix deform ... final) are exact"
            ]
    imported = network_of(spheres, cell, touching, law_of, str(path))
    imported.remarks += remarks
    imported.told["assumed"] = assumed + [
        f"the {name} wall is of the material of the sphere that touches it (say {TYPED_WALL})"
        for code, name in ((SOURCE_WALL, "lower"), (RECEIVER_WALL, "upper"))
        if code not in of_wall and (imported.network.particle_j == code).any()
    ]
    return imported


def _after(line: str, name: str) -> list[float]:
    words = line.split()
    try:
        return [float(words[words.index(name) + 1])]
    except (ValueError, IndexError):
        raise InputError(f"--pair: {name} needs a number behind it") from None


def _contacts(
    path: str | Path,
    frame: Frame,
    spheres: Spheres,
    cell: Cell,
    computes: Mapping[str, Sequence[str]],
    units: Units,
) -> tuple[Contacts, list[str]]:
    """What `pair/gran/local` tells of the contacts between spheres, and what is assumed."""
    meant = {name: _columns(words or UNASKED) for name, words in computes.items()}
    told = told_contacts(path, frame, spheres, meant, RECIPES, QUANTITIES)
    parted = told.values.keys() >= {"force_normal", "force_tangential"}
    if not parted:
        require(told.rows, told.values, ("force",))
    along = units.force * told.values["force_normal" if parted else "force"]
    push, shear = pushes(spheres, cell, told.i, told.j, along)
    if parted:
        shear = units.force * told.values["force_tangential"]
    # Versions differ in which of the two bears the forces that are written; a contact pushes.
    shear = np.where(push < 0, -1.0, 1.0)[:, None] * shear
    # A normal of its own tells more than rounded bounds; that of the whole force is not one.
    line = along if parted else None
    contacts = Contacts(told.i, told.j, abs(push), shear, line=line, listed=told.rows)
    return contacts, told.assumed


def _columns(asked: Sequence[str]) -> list[str]:
    """What the columns of `pair/gran/local` mean whose values are `asked` for, in any order."""
    return [
        f"{name}{k + 1}" for name, width in COLUMNS.items() if name in asked for k in range(width)
    ]


RECIPES = {len(_columns(asked)): _columns(asked) for asked in (UNASKED, tuple(COLUMNS))}
"""Columns where no log says which they are."""
QUANTITIES = {
    "ends": ("id1", "id2"),
    **{kind: (f"{kind}1", f"{kind}2", f"{kind}3") for kind in COLUMNS if "force" in kind},
}


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
        limit = friction[place] if len(friction) > place else friction[0]
        return ProgramLaw(4 / 3 * young, True, 8 * shear, True, limit, DISPLACEMENT)

    return law_of


def walls_of(
    wall: str | None, script: Script, units: Units
) -> tuple[dict[int, float], dict[int, int]]:
    """z, m, of the walls by their codes, and their types, where these are said.

    From --wall "type N zplane LOW HIGH", or from the log's fixes, each of one plane; a single one
    is the floor.
    """
    if wall:
        words = wall.split()
        planes = planes_said(words, units, "--wall", f"for LIGGGHTS give {TYPED_WALL}")
        if "type" not in words:
            return planes, {}
        try:
            kind = int(words[words.index("type") + 1])
        except (ValueError, IndexError):
            raise InputError(f"--wall: type is no number; give {TYPED_WALL}") from None
        return planes, dict.fromkeys(CODES, kind)
    found = sorted(_plane(name, words, units) for name, words in script.walls.items())
    if len(found) > len(CODES):
        raise InputError(f"{script.said}: {len(found)} walls zplane; give two, {TYPED_WALL}")
    each = list(zip(CODES, found, strict=False))
    return {code: z for code, (z, _) in each}, {code: kind for code, (_, kind) in each}


def _plane(name: str, words: Sequence[str], units: Units) -> tuple[float, int]:
    """z, m, and type of one flat wall."""
    try:
        z, kind = (words[words.index(key) + 1] for key in ("zplane", "type"))
        return units.length * float(z), int(kind)
    except (ValueError, IndexError):
        raise InputError(
            f"fix {name} wall/gran: only primitive walls zplane are known; give {TYPED_WALL}"
        ) from None
