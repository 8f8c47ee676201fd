"""LIGGGHTS' packings: dump custom as of LAMMPS, contacts by `compute pair/gran/local`.

`model hertz` with `tangential history`: N = 4/3 E* sqrt(R* overlap) overlap and 8 G* sqrt(R*
overlap), the shear displacement kept. `model hooke` takes its stiffness from masses and a velocity
that is typed in, and is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modal.exchange.dump import (
    COMPUTED,
    Told,
    of_liggghts,
    opened,
    packing_of,
    planes_said,
    told_contacts,
)
from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.input_script import PROPERTIES, Script, read_log
from modal.exchange.lammps_law import material_of
from modal.exchange.law import DISPLACEMENT, ProgramLaw, Units
from modal.exchange.particles_and_contacts import WALLS, Contacts, LawOf, Packing
from modal.exchange.programs import lammps
from modal.exchange.registry import File
from modal.exchange.words import Words
from modal.tools.errors import InputError

NAME = "LIGGGHTS"
OPTIONS = {name: option for name, option in lammps.OPTIONS.items() if name != "bodies"}
COLUMNS = {"pos": 6, "vel": 6, "id": 3, "force": 3, "force_normal": 3, "force_tangential": 3}
COLUMNS |= {"torque": 3, "history": 3, "contactArea": 1, "delta": 1}
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
    contacts, pair = map(given.get, ("contacts", "pair"))
    script = read_log(given.get("log"), "si")
    if pair:
        said = Words(pair.split(), "--pair", f"give {EXAMPLE}")
        script.said, script.style = said.where, tuple(said.left)
        script.properties |= {name: said.numbers(name, 1) for name in PROPERTIES if name in said}
    if script.bodies:
        what = f"{script.said}: fix rigid: clumps of LIGGGHTS are not known"
        raise InputError(f"{what}; leave it out")
    frame, units = opened(path, given, script)
    planes, of_wall = walls_of(given.get("wall"), script, units)
    law_of = law_of_types(script, units, of_wall)
    typed = any(len(values) > 1 for values in script.properties.values())
    packing = packing_of(frame, units, planes, typed=typed)
    touching = None
    if contacts is not None:
        script.computes = {
            name: _columns(said or UNASKED) for name, said in script.computes.items()
        }
        told = told_contacts(contacts, frame, packing, script, RECIPES, QUANTITIES)
        touching = _contacts(told, packing, units)
        if planes:  # found from positions: the forces there are not told
            found = packing.touching()
            found = found.some(found.j < 0)
            unknown = np.full(len(found.i), np.nan)
            touching = touching.with_walls(found.i, found.j, unknown, None)
    imported = network_of(packing, touching, law_of)
    at_walls = set(imported.network.particle_j.tolist()) & set(planes)
    if at_walls - set(of_wall):
        what = f"walls are taken to be of the material of each sphere (else say {TYPED_WALL})"
        script.remarks.append(what)
    imported.remarks += script.remarks
    return imported


def _contacts(told: Told, packing: Packing, units: Units) -> Contacts:
    """What `pair/gran/local` tells of the contacts between spheres."""
    parted = told.values.keys() >= {"force_normal", "force_tangential"}
    if not parted:
        told.rows.require(("force",), COMPUTED, told.values)
    along = units.force * told.values["force_normal" if parted else "force"]
    push, shear = packing.pushes(told.i, told.j, along)
    if parted:
        shear = units.force * told.values["force_tangential"]
    # Versions differ in which of the two bears the forces that are written; a contact pushes.
    shear = np.where(push < 0, -1.0, 1.0)[:, None] * shear
    # A normal of its own tells more than rounded bounds; that of the whole force is not one.
    line = along if parted else None
    return Contacts(told.i, told.j, abs(push), shear, line=line, listed=told.rows)


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
    said, properties = Words(script.style, script.said, f"give {EXAMPLE}"), script.properties
    if said.left[:1] != ["gran"]:
        raise InputError(f"no law of contact is known; {said.do}")
    if "hertz" not in said or "history" not in said:
        why = "the stiffness of others depends on more than the overlap"
        said.refuse("only model hertz with tangential history is known", why)
    for option, off in OFF.items():
        if option in said and said.left[said.left.index(option) + 1 :][:1] not in ([off], []):
            said.refuse(f"{option} is resisted by no spring here", f"only {option} {off}")
    lost = [name for name in PROPERTIES if name not in properties]
    if lost:
        said.refuse(f"no {', '.join(lost)}", f"{said.do}, or the log that has them")
    pairs = zip(properties["youngsModulus"], properties["poissonsRatio"], strict=False)
    materials = [material_of(units.pressure * young, nu, said.where) for young, nu in pairs]
    friction = properties["coefficientFriction"]

    def law_of(a: int, b: int) -> ProgramLaw:
        if a < 0:
            a, b = sorted((b, of_wall.get(a, b)))
        if a < 1 or (b > len(materials) and len(materials) > 1):
            lost = f"no properties for type {a if a < 1 else b}"
            said.refuse(lost, "give them for all types")
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
        said = Words(wall.split(), "--wall", f"for LIGGGHTS give {TYPED_WALL}")
        kinds = dict.fromkeys(WALLS, int(said.number("type"))) if "type" in said else {}
        return planes_said(said, units), kinds
    found = []
    for name, words in script.walls.items():
        do = f"only primitive walls zplane are known; give {TYPED_WALL}"
        said = Words(words, f"fix {name} wall/gran", do)
        found.append((units.length * said.number("zplane"), int(said.number("type"))))
    if len(found) > len(WALLS):
        raise InputError(f"{script.said}: {len(found)} walls zplane; give two, {TYPED_WALL}")
    each = list(zip(WALLS, sorted(found), strict=False))
    return {code: z for code, (z, _) in each}, {code: kind for code, (_, kind) in each}
