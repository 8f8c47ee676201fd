"""LAMMPS' contacts: columns of dump local by their meaning, and its flat walls at low and high z.

The columns c_ID[k] of a dump mean what the compute lines in the log say. Walls are those of one or
more `fix wall/gran`; their forces come with the spheres, in the columns f_ID[1] to f_ID[4] of `fix
ID ... contacts`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from modal.exchange.dump import Frame, frame_of
from modal.exchange.input_script import Script
from modal.exchange.lammps_law import coefficients
from modal.exchange.law import ProgramLaw, Units
from modal.exchange.particles_and_contacts import Contacts, Spheres, ends_of
from modal.exchange.rows import fault
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

Computes = Mapping[str, Sequence[str]]
RECIPE = {
    4: ("patom1", "patom2", "ptype1", "ptype2"),
    9: ("dist", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
    12: ("dist", "dx", "dy", "dz", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
}
"""Columns of `write_contacts.lmp`, and of a usual recipe, where no log names them."""
CODES = (SOURCE_WALL, RECEIVER_WALL)
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
    computes: Computes,
    units: Units,
    walls: Walls,
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
    i, j = ends_of(rows, spheres.number, table[:, :2].T, [columns[name] for name in names[:2]])
    force = units.force * table[:, 2]
    shear = units.force * table[:, 3:6] if sheared else None
    line = table[:, -3:] if lined else None
    if walls:
        at, code, push, rub = contacts_with_walls(frame, spheres, units, walls, fixes)
        i, j = np.concatenate([i, at]), np.concatenate([j, code])
        force = np.concatenate([force, push])
        shear = None if shear is None else np.concatenate([shear, rub])
        upright = np.tile([0.0, 0.0, 1.0], (len(at), 1))
        line = None if line is None else np.concatenate([line, upright])
    return Contacts(i, j, force, shear, line=line, listed=rows), assumed


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


def planes_of(walls: Walls) -> tuple[float, float]:
    """z of the lower and the upper wall, m, or NaN."""
    low, high = (walls[code].z if code in walls else np.nan for code in CODES)
    return low, high


def _walls(name: str, words: Sequence[str], units: Units) -> dict[int, Wall]:
    where = name if name == TYPED else f"fix {name} wall/gran"
    kinds = [k for k, word in enumerate(words) if word in ("xplane", "yplane", "zcylinder")]
    if kinds:
        raise InputError(
            f"{where}: {words[kinds[0]]} is not known; a network has walls at low and high z: "
            "turn the packing, or make the other axes periodic"
        )
    if "zplane" not in words or len(words) < words.index("zplane") + 3:
        raise InputError(f"{where}: give its law and then zplane LOW HIGH (or NULL)")
    at = words.index("zplane")
    if "wiggle" in words[at:]:
        raise InputError(
            f"{where}: it wiggles, and where it was at a step is not told; type where ({TYPED})"
        )
    law = coefficients(words[0], words[1:at], where, units, wall=True).law
    found = {}
    for code, word in zip(CODES, words[at + 1 : at + 3], strict=True):
        if word.upper() == "NULL":
            continue
        try:
            found[code] = Wall(name, law, units.length * float(word))
        except ValueError:
            raise InputError(
                f"{where}: zplane {word} is no number; type the wall with {TYPED}"
            ) from None
    return found


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
