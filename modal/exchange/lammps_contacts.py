"""LAMMPS' contacts: columns of dump local by their meaning, and its flat walls at low and high z.

Walls are those of one or more `fix wall/gran`; their forces come with the spheres, in the columns
f_ID[1] to f_ID[4] of `fix ID ... contacts`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from modal.exchange.dump import Frame
from modal.exchange.dump_contacts import DO, Meanings, planes_said, told_contacts
from modal.exchange.input_script import Script
from modal.exchange.lammps_law import coefficients
from modal.exchange.law import ProgramLaw, Units
from modal.exchange.particles_and_contacts import WALLS, Contacts, Packing
from modal.exchange.words import Words
from modal.tools.arrays import Floats, Ints

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
    packing: Packing,
    path: str | Path | None,
    computes: Meanings,
    units: Units,
    walls: Walls,
    fixes: Sequence[str],
) -> tuple[Contacts | None, list[str]]:
    """The contacts that are told, those with walls too, and what had to be assumed.

    `computes` and `fixes` are the log's: the words of each compute, and the IDs of walls.
    """
    if path is None:
        return None, []
    told = told_contacts(path, frame, packing, computes, RECIPE, QUANTITIES)
    told.rows.require(("force",), DO, told.values)
    force, shear = units.force * told.values["force"][:, 0], told.values.get("shear")
    shear = None if shear is None else units.force * shear
    contacts = Contacts(
        told.i, told.j, force, shear, line=told.values.get("line"), listed=told.rows
    )
    if walls:
        contacts = contacts.with_walls(*at_walls(frame, packing, units, walls, fixes))
    return contacts, told.assumed


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
            said.refuse(
                "it wiggles, and where it was at a step is not told", f"type where ({TYPED})"
            )
        law = coefficients(words[0], words[1:at], where, units, wall=True).law
        for code, z in planes.items():
            if code in found:
                said.refuse(
                    f"a second wall at {('low', 'high')[WALLS.index(code)]} z, beside that of fix "
                    f"{found[code].name}, where a network has one",
                    f"type them with {TYPED}",
                )
            found[code] = Wall(name, law, z)
    return found


def at_walls(
    frame: Frame, packing: Packing, units: Units, walls: Walls, fixes: Sequence[str]
) -> tuple[Ints, Ints, Floats, Floats]:
    """Spheres at walls, codes (k,), normal force (k,) and shear force (k, 3) on the sphere, N.

    `fixes` are the IDs of the log's walls. A dump that has none of them is older than the log's
    end, or their IDs are not known: then all columns f_ID[1] to f_ID[4] count.
    """
    rows = frame.rows
    names = list(fixes)
    if not any(rows.has(*_columns(name)) for name in fixes):
        first = [column[2:-3] for column in rows.columns if re.fullmatch(r"f_\w+\[1\]", column)]
        names = [name for name in first if rows.has(*_columns(name))] or ["ID"]
    for name in names:
        do = f"write fix {name} ... wall/gran ... contacts and dump {' '.join(_columns(name))}"
        rows.require(_columns(name), do)
    parts = []
    for name in names:
        own = {code: wall for code, wall in walls.items() if wall.name == name}
        parts.append(_of_fix(frame, packing, units, name, own or walls))
    at, code, push, rub = (np.concatenate(part) for part in zip(*parts, strict=True))
    return at.astype(np.int32), code.astype(np.int32), push, rub


def _columns(name: str) -> list[str]:
    return [f"f_{name}[{k}]" for k in (1, 2, 3, 4)]


def _of_fix(
    frame: Frame, packing: Packing, units: Units, name: str, walls: Walls
) -> tuple[Ints, Ints, Floats, Floats]:
    """What `at_walls` gives, of one fix with these walls."""
    rows = frame.rows
    order = np.argsort(rows.read("id")[:, 0], kind="stable")
    table = rows.read(*_columns(name))
    do = "leave columns of other fixes out, or give the log that names the walls (--log)"
    wrong = ~np.isin(table[:, 0], (0, 1))
    rows.refuse(wrong, "not 1 at a wall and 0 elsewhere", do, f"f_{name}[1]")
    table = table[order]
    (at,) = np.nonzero(table[:, 0])
    force = units.force * table[at, 1:4]
    # The wall that pushes; a sphere between two walls of one fix would need two rows.
    code = np.where(force[:, 2] > 0, *WALLS)
    what = f"is pushed in f_{name} by a wall that is NULL in its zplane LOW HIGH"
    absent = np.isin(np.arange(len(order)), at[~np.isin(code, list(walls))])
    packing.refuse(absent, what, f"mend {TYPED}, or bring the packing to rest")
    push = abs(force[:, 2])
    force[:, 2] = 0
    return at, code, push, force
