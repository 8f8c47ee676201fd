"""LAMMPS' contacts: columns of dump local by their meaning, and its flat walls at low and high z.

Walls are those of one or more `fix wall/gran`; their forces come with the spheres, in the columns
f_ID[1] to f_ID[4] of `fix ID ... contacts`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from modal.exchange.dump import Frame
from modal.exchange.dump_contacts import CODES, Words, planes_said, require, told_contacts
from modal.exchange.input_script import Script
from modal.exchange.lammps_law import coefficients
from modal.exchange.law import ProgramLaw, Units
from modal.exchange.particles_and_contacts import Contacts, Spheres
from modal.exchange.rows import fault
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

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


def contacts_of(
    frame: Frame,
    spheres: Spheres,
    path: str | Path | None,
    computes: Words,
    units: Units,
    walls: Walls,
    fixes: Sequence[str],
) -> tuple[Contacts | None, list[str]]:
    """The contacts that are told, those with walls too, and what had to be assumed.

    `computes` and `fixes` are the log's: the words of each compute, and the IDs of walls.
    """
    if path is None:
        return None, []
    told = told_contacts(path, frame, spheres, computes, RECIPE, QUANTITIES)
    require(told.rows, told.values, ("force",))
    force, shear = units.force * told.values["force"][:, 0], told.values.get("shear")
    shear = None if shear is None else units.force * shear
    line = told.values.get("line")
    contacts = Contacts(told.i, told.j, force, shear, line=line, listed=told.rows)
    if walls:
        at_walls = contacts_with_walls(frame, spheres, units, walls, fixes)
        contacts = contacts.with_walls(*at_walls)
    return contacts, told.assumed


def walls_of(script: Script, units: Units) -> Walls:
    """The walls of each fix; InputError for others than one at low and one at high z."""
    found: dict[int, Wall] = {}
    for name, words in script.walls.items():
        for code, wall in _walls(name, words, units).items():
            if code in found:
                raise InputError(
                    f"fix {name} wall/gran: a second wall at {('low', 'high')[CODES.index(code)]} "
                    f"z, beside that of fix {found[code].name}; a network has one there: type "
                    f"them with {TYPED}"
                )
            found[code] = wall
    return found


def _walls(name: str, words: Sequence[str], units: Units) -> dict[int, Wall]:
    where = name if name == TYPED else f"fix {name} wall/gran"
    kinds = [k for k, word in enumerate(words) if word in ("xplane", "yplane", "zcylinder")]
    if kinds:
        raise InputError(
            f"{where}: {words[kinds[0]]} is not known; a network has walls at low and high z: "
            "turn the packing, or make the other axes periodic"
        )
    planes = planes_said(words, units, where, f"give its law before it, or type it with {TYPED}")
    at = words.index("zplane")
    if "wiggle" in words[at:]:
        raise InputError(
            f"{where}: it wiggles, and where it was at a step is not told; type where ({TYPED})"
        )
    law = coefficients(words[0], words[1:at], where, units, wall=True).law
    return {code: Wall(name, law, z) for code, z in planes.items()}


def contacts_with_walls(
    frame: Frame, spheres: Spheres, units: Units, walls: Walls, fixes: Sequence[str]
) -> tuple[Ints, Ints, Floats, Floats]:
    """Spheres at walls, codes (k,), normal force (k,) and shear force (k, 3) on the sphere, N.

    `fixes` are the IDs of the log's walls. A dump that has none of them is older than the log's
    end, or their IDs are not known: then all columns f_ID[1] to f_ID[4] count.
    """
    rows = frame.rows
    names = [name for name in fixes if rows.has(*_columns(name))]
    absent = [name for name in fixes if name not in names]
    if names and absent:
        _no_forces(frame, f"fix {absent[0]}", absent[0])
    if not names:
        first = [column[2:-3] for column in rows.columns if re.fullmatch(r"f_\w+\[1\]", column)]
        names = [name for name in first if rows.has(*_columns(name))]
    if not names:
        _no_forces(frame, "the walls", "ID")
    parts = []
    for name in names:
        own = {code: wall for code, wall in walls.items() if wall.name == name}
        parts.append(_of_fix(frame, spheres, units, name, own or walls))
    at, code, push, rub = (np.concatenate(part) for part in zip(*parts, strict=True))
    return at.astype(np.int32), code.astype(np.int32), push, rub


def _columns(name: str) -> list[str]:
    return [f"f_{name}[{k}]" for k in (1, 2, 3, 4)]


def _no_forces(frame: Frame, whose: str, name: str) -> NoReturn:
    do = f"write fix {name} ... wall/gran ... contacts and dump {' '.join(_columns(name))}"
    fault(frame.rows.path, f"no forces of {whose}", do, frame.rows.line - 1, f"f_{name}[1..4]")


def _of_fix(
    frame: Frame, spheres: Spheres, units: Units, name: str, walls: Walls
) -> tuple[Ints, Ints, Floats, Floats]:
    """What `contacts_with_walls` gives, of one fix with these walls."""
    rows = frame.rows
    order = np.argsort(rows.read("id")[:, 0], kind="stable")
    table = rows.read(*_columns(name))[order]
    flag = table[:, 0]
    if ((flag != 0) & (flag != 1)).any():
        do = "leave columns of other fixes out, or give the log that names the walls (--log)"
        fault(rows.path, "not 1 at a wall and 0 elsewhere", do, rows.line - 1, f"f_{name}[1]")
    (at,) = np.nonzero(flag)
    force = units.force * table[at, 1:4]
    # The wall that pushes; a sphere between two walls of one fix would need two rows.
    code = np.where(force[:, 2] > 0, *CODES)
    absent = ~np.isin(code, list(walls))
    if absent.any():
        which = spheres.number[at[int(np.argmax(absent))]]
        raise InputError(
            f"{rows.path}: sphere {which} is pushed in f_{name} by a wall that is NULL in its "
            f"zplane LOW HIGH; mend {TYPED}, or bring the packing to rest"
        )
    push = abs(force[:, 2])
    force[:, 2] = 0
    return at, code, push, force
