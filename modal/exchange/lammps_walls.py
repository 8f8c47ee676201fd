"""LAMMPS' flat walls at low and high z: `fix wall/gran` of one or both, and their forces.

The forces come with the spheres, in the columns f_ID[1] to f_ID[4] of `fix ID ... contacts`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from modal.exchange.bodies import Spheres
from modal.exchange.dump import Frame
from modal.exchange.lammps_law import coefficients
from modal.exchange.lammps_script import Script
from modal.exchange.program_law import ProgramLaw, Units
from modal.exchange.rows import fault
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

CODES = (SOURCE_WALL, RECEIVER_WALL)
TYPED = "--wall"
"""The name of walls that are typed on the command line."""


@dataclass(frozen=True)
class Walls:
    """The walls of one fix: its ID, its law, and z of the lower and the upper one, m, or NaN."""

    name: str
    law: ProgramLaw
    planes: tuple[float, float]


def walls_of(script: Script, units: Units) -> list[Walls]:
    """The walls of each fix; InputError for others than one at low and one at high z."""
    found: list[Walls] = []
    for name, words in script.walls.items():
        one = _walls(name, words, units)
        for other in found:
            for side, end in enumerate(("low", "high")):
                if not np.isnan([one.planes[side], other.planes[side]]).any():
                    raise InputError(
                        f"fix {name} wall/gran: a second wall at {end} z, beside that of fix "
                        f"{other.name}; a network has one there: type them with {TYPED}"
                    )
        found.append(one)
    return found


def planes_of(walls: Sequence[Walls]) -> tuple[float, float]:
    """z of the lower and the upper wall, m, or NaN."""
    low, high = (
        next((each.planes[side] for each in walls if not np.isnan(each.planes[side])), np.nan)
        for side in (0, 1)
    )
    return low, high


def law_of_wall(walls: Sequence[Walls], code: int, said: str) -> ProgramLaw:
    """The law of the wall of this code."""
    for each in walls:
        if not np.isnan(each.planes[CODES.index(code)]):
            return each.law
    raise InputError(f"{said}: a wall without a law; give {TYPED}")


def _walls(name: str, words: Sequence[str], units: Units) -> Walls:
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
    planes = [np.nan, np.nan]
    for side, word in enumerate(words[at + 1 : at + 3]):
        if word.upper() == "NULL":
            continue
        try:
            planes[side] = units.length * float(word)
        except ValueError:
            raise InputError(
                f"{where}: zplane {word} is no number; type the wall with {TYPED}"
            ) from None
    return Walls(name, law, (planes[0], planes[1]))


def contacts_with_walls(
    frame: Frame, spheres: Spheres, units: Units, walls: Sequence[Walls], fixes: Sequence[str]
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
        own = [each for each in walls if each.name == name] or walls
        parts.append(_of_fix(frame, spheres, units, name, planes_of(own)))
    at, code, push, rub = (np.concatenate(part) for part in zip(*parts, strict=True))
    return at.astype(np.int32), code.astype(np.int32), push, rub


def _columns(name: str) -> list[str]:
    return [f"f_{name}[{k}]" for k in (1, 2, 3, 4)]


def _no_forces(frame: Frame, whose: str, name: str) -> NoReturn:
    do = f"write fix {name} ... wall/gran ... contacts and dump {' '.join(_columns(name))}"
    fault(frame.rows.path, f"no forces of {whose}", do, frame.rows.line - 1, f"f_{name}[1..4]")


def _of_fix(
    frame: Frame, spheres: Spheres, units: Units, name: str, planes: tuple[float, float]
) -> tuple[Ints, Ints, Floats, Floats]:
    """What `contacts_with_walls` gives, of one fix with walls at these z."""
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
    absent = np.isnan(planes)[np.where(code == SOURCE_WALL, 0, 1)]
    if absent.any():
        which = spheres.number[at[int(np.argmax(absent))]]
        raise InputError(
            f"{rows.path}: sphere {which} is pushed in f_{name} by a wall that is NULL in its "
            f"zplane LOW HIGH; mend {TYPED}, or bring the packing to rest"
        )
    push = abs(force[:, 2])
    force[:, 2] = 0
    return at, code, push, force
