"""The text dumps of LAMMPS and LIGGGHTS: `ITEM:` headers, a box, rows of spheres or contacts.

The columns c_ID[k] of a dump of contacts mean what the compute lines in the log say, or, where no
log names them, what a program's recipe of so many columns has.
"""

import itertools
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from modal.exchange.input_script import WIDTHS, Script, columns_of_liggghts
from modal.exchange.law import SI, ProgramLaw, Units
from modal.exchange.particles_and_contacts import WALLS, Cell, Packing, ends_of
from modal.exchange.text import (
    Rows,
    Words,
    fault,
    kept_lines,
    last_step,
    shown,
    text_lines,
    written_digits,
)
from modal.tools.arrays import Array, Bools, Floats, Ints

UNITS = {"si": SI, "cgs": Units(1e-2, 1e-3, 1.0), "micro": Units(1e-6, 1e-15, 1e-6)}
"""What their systems of units are in SI; `lj` has none."""
ITEMS = {"ATOMS": "spheres (dump custom)", "ENTRIES": "contacts (dump local)"}
"""What the rows behind these are."""
SEVERAL = 5
"""Steps that a message lists."""
DIGITS_OF_G = 6
"""Significant digits that the format %g leaves, in which LIGGGHTS writes the bounds. Fewer stand
there when somebody chose them, more when all were written."""
ROUNDED = (DIGITS_OF_G, 7)
"""Significant digits of radii that a program has rounded: by %g, or in single precision."""
SHAPED = ("shapex", "quatw", "quat1", "blockiness1", "length", "corner1x")
"""Columns of LAMMPS and LIGGGHTS for ellipsoids, superquadrics, rods and polygons."""
COLUMNS = (
    [(axis, f"{axis}u", f"{axis}s") for axis in "xyz"],
    [("radius", "diameter"), ("mass", "rmass", "density")],
)
"""Of spheres, in one of these words each: places, then size and what tells their mass."""
ONLY_TYPE = 1
"""The type of spheres of a dump without types."""
TYPED = "--wall"
"""The name of walls that are typed on the command line."""
OTHER_WALLS = ("xplane", "yplane", "zcylinder")
"""Walls that no network has."""

RECIPES: dict[int, Sequence[str]] = {
    4: ("patom1", "patom2", "ptype1", "ptype2"),
    9: ("dist", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
    12: ("dist", "dx", "dy", "dz", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
    25: columns_of_liggghts(),
    32: columns_of_liggghts(tuple(WIDTHS)),
}
"""Columns of `write_contacts.lmp`, of a usual recipe, and of LIGGGHTS, where no log names them."""
QUANTITIES: dict[str, Sequence[str]] = {
    "force": ("force",),
    "shear": ("p1", "p2", "p3"),
    "line": ("fx", "fy", "fz"),
    "whole": columns_of_liggghts(["force"]),
    "parts": columns_of_liggghts(["force_normal", "force_tangential"]),
}
"""Forces of contacts, and the columns in which they stand; the last two are of LIGGGHTS."""


OfKind = Callable[[int], ProgramLaw]
"""The law between a wall and a kind of sphere."""


class Wall(NamedTuple):
    """A wall: z, m, the law between it and a kind of sphere, and the ID of its fix."""

    z: float
    law: OfKind
    name: str


Walls = Mapping[int, Wall]
"""The walls by their codes."""


@dataclass(frozen=True)
class Frame:
    """One time of a dump: its step, box low and high (3,), periodic (3,), and its rows.

    `rounding` (3,) is the unit of the last digit of bounds that the program has rounded, as
    LIGGGHTS does, else 0; contacts through the periods are known no better. `units` are those that
    the dump names (`dump_modify ... units yes`), if it does.
    """

    step: int
    low: Floats
    high: Floats
    periodic: Bools
    rounding: Floats
    units: str
    rows: Rows


def frame_of(path: str | Path, kind: str, step: int | None) -> Frame:
    """Return the frame of this step, or the only one; `kind` is ATOMS or ENTRIES.

    InputError where a dump has several times and `step` chooses none of them. Rows of other times
    are passed over.
    """
    steps: list[int] = []
    said: dict[str, list[list[str]]] = {}
    chosen: Frame | None = None
    lines = text_lines(path)
    for number, line in lines:
        item, *title = line.split() or [""]
        if item and (item != "ITEM:" or not title):
            what = f"{shown(line.strip())} where ITEM: and its name should stand"
            fault(path, what, "give a text dump, style custom or local", number)
        elif item and title[0] not in ITEMS:
            values = itertools.islice(lines, 3 if title[0] == "BOX" else 1)
            said[title[0]] = [title, *(value.split() for _, value in values)]
        elif item:
            if title[0] != kind:
                what = f"ITEM: {title[0]} where {ITEMS[kind]} belong"
                fault(path, what, "give the files in the other order", number)
            count, head = _head(path, said, number)
            texts = kept_lines(path, lines, count)
            steps.append(head["step"])
            if step in (None, steps[-1]):
                there = len(texts)
                if there < count:
                    what = f"{there} rows of {count}: the file ends in the middle"
                    do = "let the program finish writing it"
                    fault(path, what, do, number + 1 + there, code="cut_off")
                rows = Rows(Path(path), tuple(title[1:]), texts, number + 1)
                chosen = Frame(rows=rows, **head)
    if chosen is None or (step is None and len(steps) > 1):
        _refuse_times(path, kind, step, steps)
    return chosen


def _refuse_times(path: str | Path, kind: str, step: int | None, steps: Sequence[int]) -> NoReturn:
    """Raise InputError for a file whose times are not the one that is wanted."""
    if not steps:
        fault(path, f"no ITEM: {kind}", "give a text dump of LAMMPS or LIGGGHTS")
    listed = ", ".join(map(str, steps[:SEVERAL]))
    if len(steps) > SEVERAL:
        listed += ", ..."
    what = f"it has {len(steps)} times ({listed})"
    if step is not None:
        what += f", but no step {step}"
    if kind == "ATOMS":
        command = f"granular-modes import {shlex.quote(str(path))} --step {steps[-1]}"
        do = f"choose one with --step: {command} --log LOG -o NEW.network.h5"
    else:
        do = "dump spheres and contacts at one step"
    fault(path, what, do, code="several_times" if step is None else "no_such_time")


def _head(
    path: str | Path, said: dict[str, list[list[str]]], line: int
) -> tuple[int, dict[str, Any]]:
    """The number of rows, and what a frame has beside them, by name.

    Of what was `said` behind each ITEM before them: the title, then the lines.
    """
    try:
        title, *bounds = said["BOX"]
        box = np.array([row[:2] for row in bounds], float)
        tilted = any(float(row[2]) for row in bounds if "xy" in title) or "abc" in title
        step, count = (int(said[name][1][0]) for name in ("TIMESTEP", "NUMBER"))
        known = tilted or np.isfinite(box).all() and box.shape == (3, 2) and len(title) > 4
    except (KeyError, ValueError, IndexError):
        known = False
    if not known or count < 0:
        what = "no TIMESTEP, NUMBER OF and BOX BOUNDS before it, or these are none"
        fault(path, what, "write the dump anew, with pp or ff for each axis of the box", line)
    if tilted:
        what = "the cell is triclinic (its periods are at angles)"
        fault(path, what, "only rectangular cells are known; compress without shear", line)
    periodic = np.array([word.startswith("p") for word in title[-3:]])
    rounding = np.zeros(3)
    if written_digits(word for row in bounds for word in row[:2]) == DIGITS_OF_G:
        rounding = np.array([last_step(axis, DIGITS_OF_G) for axis in box])
    units = " ".join(*said.get("UNITS", [[], []])[1:])
    own = {"periodic": periodic, "rounding": rounding, "units": units}
    return count, {"step": step, "low": box[:, 0], "high": box[:, 1], **own}


def units_of(path: Path, frame: Frame, given: Mapping[str, Any], script: Script) -> Units:
    """The units that are typed, or of the name that log and dump give them, or si.

    InputError where two differ, and for lj, which has no SI.
    """
    typed, dumped, logged = Units.typed(given.get("scales")), frame.units, script.units
    if dumped and logged and dumped != logged:
        what = f"ITEM: UNITS {dumped}, and {script.said} has units {logged}"
        fault(path, what, "give the log of this dump")
    name = dumped or logged or "si"
    if typed is None and name not in UNITS:
        do = "give those of length, mass and time with import --scales M KG S"
        fault(path if dumped else script.said, f"units {name} have no SI values here", do)
    if typed and not np.allclose(typed, UNITS.get(dumped, typed), rtol=1e-9, atol=0):
        what = f"ITEM: UNITS {dumped}, and --scales {' '.join(f'{one:g}' for one in typed)}"
        fault(path, what, "leave --scales out, which other units are for")
    if frame.step < script.changed and "pair" not in given:
        what = f"{script.said} changes the law or the walls after step {script.changed}"
        script.remarks.append(f"{what}: those of its end are taken")
    if not (typed or logged or dumped):
        script.remarks.append("no units are told: si are taken")
    return typed or UNITS[name]


def lost_columns(rows: Rows) -> list[str]:
    """Columns that the spheres of a dump need, and that are not there in any of their words."""
    return [names[0] for kinds in COLUMNS for names in kinds if not any(map(rows.has, names))]


def walls_of(script: Script, units: Units, law_of: Callable[[Words], OfKind], planes: int) -> Walls:
    """The walls of the log's fixes, each of so many `planes`, or the typed one of two.

    Of planes that are told alone the lowest one is the floor. InputError for others than one at low
    and one at high z.
    """
    found, told = dict[int, Wall](), list[tuple[list[float], OfKind, str, Words]]()
    for name, words in script.walls.items():
        where = name if name == TYPED else f"fix {name} wall/gran"
        said = Words(words, where, f"only walls zplane are known; type them with {TYPED}")
        for other in filter(said.__contains__, OTHER_WALLS):
            do = "turn the packing, or make the other axes periodic"
            said.refuse(f"{other} is not known, a network has walls at low and high z", do)
        if "wiggle" in said:
            what = "it wiggles, and where it was at a step is not told"
            said.refuse(what, f"type where ({TYPED})")
        heights = said.numbers("zplane", 2 if name == TYPED else planes, null=True)
        told.append((heights, law_of(said), name, said))
    if planes == 1:
        told.sort(key=lambda wall: wall[0])
    for heights, law, name, said in told:
        if len(heights) == 1:
            heights.insert(int(WALLS[0] not in found), np.nan)
        for code, end, z in zip(WALLS, ("low", "high"), heights, strict=True):
            if np.isnan(z):
                continue
            if code in found:
                what = f"a second wall at {end} z, beside that of fix {found[code].name}"
                said.refuse(f"{what}, where a network has one", f"type them with {TYPED}")
            found[code] = Wall(units.length * z, law, name)
    return found


def packing_of(
    frame: Frame, units: Units, walls: Mapping[int, float], *, typed: bool, body: str = ""
) -> Packing:
    """The spheres of a dump, in the order of their numbers, in the cell of its box.

    `walls` have their z, m, by their codes; `typed` if the law asks for types, else spheres without
    a type are of one; `body` is the column with the numbers of rigid bodies, if there are any.
    """
    rows = frame.rows
    for name in filter(rows.has, SHAPED):
        what = f"the column {name} tells of bodies that are no spheres, which are not known"
        fault(rows.path, what, "dump spheres, without it", rows.line - 1, name)

    places, (size, heavy) = (
        [next(filter(rows.has, names), names[0]) for names in kinds] for kinds in COLUMNS
    )
    further = {"kind": "type"} if typed or rows.has("type") else {}
    further |= {"body": body} if body else {}
    names = ("id", *places, size, heavy, *further.values())
    rows.require(names, f"add it to the dump: dump ... custom N FILE {' '.join(names)}")
    table = rows.read(*names)
    position, digits = table[:, 1:4], rows.digits(*places)
    radius, mass = table[:, 4] * (0.5 if size == "diameter" else 1.0), table[:, 5]
    if heavy == "density":
        mass = mass * 4 / 3 * np.pi * radius**3
    step = last_step(position, digits)
    if "xs" in places:
        extent = frame.high - frame.low
        # Rounded bounds stretch all distances, of which one diameter counts in an overlap.
        stretch = float((frame.rounding / extent).max()) * 2 * float(radius.max(initial=0.0))
        step = max(step * float(extent.max()), stretch)
        position = frame.low + position * extent
    # Radii count in overlaps as positions do; those that few digits hold are exact.
    radius_digits = rows.digits(size)
    if radius_digits in ROUNDED and last_step(radius, radius_digits) > step:
        step = last_step(radius, radius_digits)
        digits = min(digits, radius_digits)
    columns: dict[str, Array] = {"position": position, "radius": radius, "mass": mass}
    columns["number"] = table[:, 0]
    if "kind" not in further:
        columns["kind"] = np.full(len(table), ONLY_TYPE)
    for k, (name, column) in enumerate(further.items(), 6):
        columns[name] = rows.whole(table[:, k], column)
    source, receiver = (walls.get(code, np.nan) for code in WALLS)
    low, high = units.length * frame.low, units.length * frame.high
    rounding = units.length * frame.rounding
    cell = Cell(low, high, frame.periodic, (source, receiver), rounding)
    return Packing.of(rows, cell, units, columns, digits, step)


class Told(NamedTuple):
    """Contacts of a dump: their rows, ends (m,), and columns (m, k) by what they are."""

    rows: Rows
    i: Ints
    j: Ints
    values: dict[str, Floats]


def told_contacts(
    path: str | Path, frame: Frame, packing: Packing, script: Script, ends: tuple[str, str]
) -> Told:
    """What a dump tells of contacts of spheres: those `QUANTITIES` whose columns are all there.

    The columns of the `ends` must be there. `frame` is that of the spheres; the computes of the log
    say what their columns mean, by their IDs, or the recipe of so many columns.
    """
    rows = frame_of(path, "ENTRIES", frame.step).rows
    columns: dict[str, str] = {}
    groups: dict[str, dict[int, str]] = {}
    for column in rows.columns:
        indexed = re.fullmatch(r"c_(\w+)(?:\[(\d+)\])?", column)
        if indexed:
            groups.setdefault(indexed[1], {})[int(indexed[2] or 1)] = column
        else:
            columns[column] = column
    for name, members in groups.items():
        words = script.computes.get(name) or RECIPES.get(len(members))
        if words is None:
            what = f"what the {len(members)} columns of c_{name} mean stands in a compute line"
            do = "give the log that has it (--log)"
            fault(path, what, do, rows.line - 1, next(iter(members.values())))
        if name not in script.computes:
            script.remarks.append(f"columns of c_{name} are taken for {' '.join(words)}")
        columns |= {words[k - 1]: column for k, column in members.items() if k <= len(words)}
    rows.require(ends, "let its compute line write it", columns)
    sought = QUANTITIES | {"ends": ends}
    named = {what: [columns.get(n, n) for n in names] for what, names in sought.items()}
    values = rows.parts(named)
    if not values.keys() & {"force", "whole", "parts"}:
        fault(path, "no column tells the forces", "let a compute line write them", rows.line - 1)
    return Told(rows, *ends_of(rows, packing.number, values["ends"].T, named["ends"]), values)
