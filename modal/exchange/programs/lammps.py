"""LAMMPS' packings: dump custom, dump local, and the log that says what the columns mean.

The law is the user's own line of input. Contacts, where dumped, come from `compute property/local`
and `compute pair/local` with `cutoff radius`. Walls are those of one or more `fix wall/gran` at low
and high z; their forces come with the spheres, in the columns f_ID[1] to f_ID[4] of `fix ID ...
contacts`. Spheres of a `fix rigid` become its bodies.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from modal.exchange.dump import (
    COMPUTED,
    Frame,
    of_liggghts,
    opened,
    packing_of,
    planes_said,
    told_contacts,
)
from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.input_script import Script, read_log
from modal.exchange.lammps_law import coefficients, law_of_pairs
from modal.exchange.law import ProgramLaw, Units
from modal.exchange.particles_and_contacts import WALLS, Contacts, Packing
from modal.exchange.registry import File, Option
from modal.exchange.rows import fault, text_lines
from modal.exchange.words import Words
from modal.packing.rigid_bodies import Bodies
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

NAME = "LAMMPS"
OPTIONS = {
    "contacts": Option("of the spheres: dump local, or *.csv"),
    "log": Option("the log: units, law, walls, columns"),
    "pair": Option("the contact law as it stands behind pair_style", "LINE"),
    "wall": Option("the walls as they stand behind fix ... wall/gran", "LINE"),
    "step": Option("which one, of a dump with several times", "N", int),
    "scales": Option("the file's units of length, mass and time in SI", ("M", "KG", "S"), float),
    "bodies": Option("masses and tensors of fix rigid, as write_restart writes them (*.rigid)"),
}
BODY, OF_A_BODY = "a rigid body (number, mass, centre, ixx iyy izz ixy ixz iyz ...)", 11
"""What a row of fix rigid tells, and how many of its numbers count."""
RECIPE = {
    4: ("patom1", "patom2", "ptype1", "ptype2"),
    9: ("dist", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
    12: ("dist", "dx", "dy", "dz", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
}
"""Columns of `write_contacts.lmp`, and of a usual recipe, where no log names them."""
QUANTITIES = {
    "ends": ("patom1", "patom2"),
    "force": ("force",),
    "shear": ("p1", "p2", "p3"),
    "line": ("fx", "fy", "fz"),
}
TYPED = "--wall"
"""The name of walls that are typed on the command line."""


class Wall(NamedTuple):
    """A wall: the ID of its fix, its law, and z, m."""

    name: str
    law: ProgramLaw
    z: float


Walls = Mapping[int, Wall]
"""The walls by their codes."""


def sniff(file: File) -> bool:
    """A text dump, unless its log or law is of LIGGGHTS."""
    return file.head.startswith(b"ITEM:") and not of_liggghts(file)


def read(path: Path, **given: Any) -> ImportResult:
    """A packing of LAMMPS."""
    contacts, log, pair, wall, told_bodies = map(
        given.get, ("contacts", "log", "pair", "wall", "bodies")
    )
    # LAMMPS' own units, where a log names none, are lj.
    script = read_log(log, "lj")
    fixes = tuple(script.walls)
    if pair:
        script.said, (style, *words) = "--pair", pair.split() or [""]
        script.style, script.pair = (style,), [("*", "*", *words)]
    if wall:
        script.walls = {TYPED: tuple(wall.split())}
    if not script.style:
        raise InputError(
            f"{path}: no law of contact is known; `import` it with the log (--log log.lammps) or "
            'the line (--pair "granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.3")'
        )
    frame, units = opened(path, given, script)
    of_pairs, walls = law_of_pairs(script, units), walls_of(script, units)

    def law_of(a: int, b: int) -> ProgramLaw:
        return of_pairs(a, b) if a >= 0 else walls[a].law

    if told_bodies and not script.bodies:
        raise InputError("--bodies: no fix rigid is known; give the log that has it (--log)")
    if frame.rows.has("mol") and not log:
        do = "give the log (--log), which says so, or leave mol out of the dump"
        raise InputError(f"{path}: spheres of one mol may be one rigid body or bonded; {do}")
    body = column_of_bodies(script, told_bodies is not None)
    planes = {code: each.z for code, each in walls.items()}
    typed = len({tuple(words) for _, _, *words in script.pair}) > 1
    packing = packing_of(frame, units, planes, typed=typed, body=body)
    of_all = any(script.groups[name] == "all" for name in script.bodies)
    if packing.body is not None and of_all and (packing.body < 1).any():
        do = "make single spheres no part of its group"
        raise InputError(f"{path}: a {body} of 0, which is one more body to fix rigid; {do}")
    for name in script.walls:
        group = script.groups.get(name, "all")
        if contacts is None and wall is None and group != "all":
            do = "give the contacts that it has (--contacts), or type the walls (--wall)"
            raise InputError(f"{log}: fix {name} pushes the group {group} alone; {do}")
    touching = None
    if contacts is not None:
        told = told_contacts(contacts, frame, packing, script, RECIPE, QUANTITIES)
        told.rows.require(("force",), COMPUTED, told.values)
        force, shear = units.force * told.values["force"][:, 0], told.values.get("shear")
        shear = None if shear is None else units.force * shear
        line = told.values.get("line")
        touching = Contacts(told.i, told.j, force, shear, line=line, listed=told.rows)
        if walls:
            touching = touching.with_walls(*at_walls(frame, packing, units, walls, fixes))
    bodies = read_bodies(told_bodies, units) if told_bodies else None
    found = network_of(packing, touching, law_of, bodies)
    found.remarks += script.remarks
    return found


def walls_of(script: Script, units: Units) -> Walls:
    """The walls of each fix; InputError for others than one at low and one at high z."""
    found: dict[int, Wall] = {}
    for name, words in script.walls.items():
        where = name if name == TYPED else f"fix {name} wall/gran"
        said = Words(words, where, f"give its law before it, or type it with {TYPED}")
        other = next((word for word in words if word in ("xplane", "yplane", "zcylinder")), None)
        if other:
            do = "turn the packing, or make the other axes periodic"
            said.refuse(f"{other} is not known, a network has walls at low and high z", do)
        planes, at = planes_said(said, units), words.index("zplane")
        if "wiggle" in words[at:]:
            what = "it wiggles, and where it was at a step is not told"
            said.refuse(what, f"type where ({TYPED})")
        law = coefficients(words[0], words[1:at], where, units, wall=True).law
        for code, z in planes.items():
            if code in found:
                end = ("low", "high")[WALLS.index(code)]
                what = f"a second wall at {end} z, beside that of fix {found[code].name}"
                said.refuse(f"{what}, where a network has one", f"type them with {TYPED}")
            found[code] = Wall(name, law, z)
    return found


def at_walls(
    frame: Frame, packing: Packing, units: Units, walls: Walls, fixes: Sequence[str]
) -> tuple[Ints, Ints, Floats, Floats]:
    """Spheres at walls, codes (k,), normal force (k,) and shear force (k, 3) on the sphere, N.

    `fixes` are the IDs of the log's walls. A dump that has none of them is older than the log's
    end, or their IDs are not known: then all columns f_ID[1] to f_ID[4] count.
    """

    def columns(name: str) -> list[str]:
        return [f"f_{name}[{k}]" for k in (1, 2, 3, 4)]

    rows, parts = frame.rows, []
    order = np.argsort(rows.read("id")[:, 0], kind="stable")
    begun = re.findall(r"f_(\w+)\[1\]", " ".join(rows.columns))
    there = [name for name in begun if rows.has(*columns(name))]
    for name in fixes if set(fixes) & set(there) else there or fixes or ["ID"]:
        each = columns(name)
        rows.require(each, f"write fix {name} ... wall/gran ... contacts and dump {' '.join(each)}")
        table = rows.read(*each)
        do = "leave columns of other fixes out, or give the log that names the walls (--log)"
        wrong = ~np.isin(table[:, 0], (0, 1))
        rows.refuse(wrong, "not 1 at a wall and 0 elsewhere", do, each[0])
        (at,) = np.nonzero(table[order, 0])
        force = units.force * table[order][at, 1:]
        # The wall that pushes; a sphere between two walls of one fix would need two rows.
        code, push = np.where(force[:, 2] > 0, *WALLS), abs(force[:, 2])
        force[:, 2] = 0
        own = {code for code, wall in walls.items() if wall.name == name} or set(walls)
        absent = np.isin(np.arange(len(order)), at[~np.isin(code, list(own))])
        what = f"is pushed in f_{name} by a wall that is NULL in its zplane LOW HIGH"
        packing.refuse(absent, what, f"mend {TYPED}, or bring the packing to rest")
        parts.append((at, code, push, force))
    at, code, push, rub = (np.concatenate(part) for part in zip(*parts, strict=True))
    return at.astype(np.int32), code.astype(np.int32), push, rub


def column_of_bodies(script: Script, told: bool) -> str:
    """The column of the dump that numbers the rigid bodies, or none.

    `told` says that their masses are in a file of their own.
    """
    if len(script.bodies) > 1:
        do = "give all bodies one fix and one column"
        raise InputError(f"{script.said}: several fix rigid; {do}")
    column = ""
    for name, words in script.bodies.items():
        which, given = (*words, "", "")[:2]
        by_number = which == "custom" and given.startswith("i_")
        column = "mol" if which == "molecule" else given
        if not (which == "molecule" or by_number):
            raise InputError(
                f"{script.said}: fix {name} rigid {which}: which spheres are one body is not in a "
                "dump; make it rigid molecule, or custom i_NAME, and dump mol or i_NAME"
            )
        if "infile" in words and not told:
            raise InputError(
                f"{script.said}: fix {name} rigid has masses of its own (infile); give those of "
                "this step, as write_restart writes them (--bodies FILE.rigid)"
            )
    return column


def read_bodies(path: str | Path, units: Units) -> Bodies:
    """Masses, centres and tensors of rigid bodies, in the format of `fix rigid ... infile`."""
    do = "give the file that write_restart wrote (*.rigid)"
    lines = ((n, line.split("#")[0].split()) for n, line in text_lines(path))
    rows = [Words(words, f"{path}, line {n}", do) for n, words in lines if len(words) > 1]
    if not rows:
        fault(path, "no rigid bodies", do)
    table = np.array([row.in_turn(BODY, OF_A_BODY) for row in rows])
    table = table[np.argsort(table[:, 0], kind="stable")]
    xx, yy, zz, xy, xz, yz = units.mass * units.length**2 * table[:, 5:].T
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    number = table[:, 0].astype(int)
    return Bodies(number, units.mass * table[:, 1], units.length * table[:, 2:5], tensor)
