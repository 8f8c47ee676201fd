"""The text dumps of LAMMPS and LIGGGHTS: `ITEM:` headers, a box, rows of spheres or contacts.

The columns c_ID[k] of a dump of contacts mean what the compute lines in the log say. If no log
names them, they mean what a usual recipe with as many columns has.
"""

import itertools
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, NoReturn

import numpy as np

from modal.exchange.digits import count_written_digits, last_digit_unit
from modal.exchange.input_script import LIGGGHTS_WIDTHS, Script, list_liggghts_columns
from modal.exchange.law import SI, ProgramLaw, Units
from modal.exchange.lines import Lines
from modal.exchange.particles_and_contacts import (
    WALLS,
    Cell,
    Packing,
    SphereColumns,
    edges_of_cell,
    find_ends,
)
from modal.exchange.refusals import quote, refuse
from modal.exchange.rows import Rows
from modal.exchange.words import Words
from modal.tools.arrays import Bools, Floats, Ints

Item = Literal["ATOMS", "ENTRIES"]
"""What the rows of a dump describe, according to its header: spheres or entries of contacts."""

UNITS = {"si": SI, "cgs": Units(1e-2, 1e-3, 1.0), "micro": Units(1e-6, 1e-15, 1e-6)}
"""SI values of the programs' systems of units; `lj` has none."""
UNITS_RELATIVE_TOLERANCE = 1e-9
"""Relative difference of two units below which they count as equal."""
ITEMS = {"ATOMS": "spheres (dump custom)", "ENTRIES": "contacts (dump local)"}
"""Descriptions of the rows below these headers, for messages."""
MAX_LISTED_STEPS = 5
"""Largest number of steps that a message lists."""
FORMAT_G_DIGITS = 6
"""Significant digits of the format %g, with which LIGGGHTS writes bounds. Bounds with fewer digits
were chosen by somebody, bounds with more were written in full."""
ROUNDED_DIGITS = (FORMAT_G_DIGITS, 7)
"""Significant digits of radii that a program has rounded: by %g, or in single precision."""
SHAPE_COLUMNS = ("shapex", "quatw", "quat1", "blockiness1", "length", "corner1x", "id_multisphere")
"""Columns of LAMMPS and LIGGGHTS for ellipsoids, superquadrics, rods, polygons and clumps."""
PLACE_COLUMNS = [("x", "xu", "xs"), ("y", "yu", "ys"), ("z", "zu", "zs")]
"""Names of the columns of centres, each in one of these forms."""
SIZE_COLUMNS = ("radius", "diameter")
"""Names of the column of sizes."""
MASS_COLUMNS = ("mass", "rmass", "density")
"""Names of the column from which masses follow."""
ONLY_TYPE = 1
"""The type of spheres of a dump without types."""
TYPED_WALL = "--wall"
"""Option on the command line that gives a wall; used as the wall's name."""
OTHER_WALLS = ("xplane", "yplane", "zcylinder")
"""Styles of walls that a network cannot represent."""

RECIPES: dict[int, Sequence[str]] = {
    4: ("patom1", "patom2", "ptype1", "ptype2"),
    9: ("dist", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
    12: ("dist", "dx", "dy", "dz", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
    25: list_liggghts_columns(),
    32: list_liggghts_columns(tuple(LIGGGHTS_WIDTHS)),
}
"""Columns that a dump of contacts has in usual recipes, by their number: those of
`write_contacts.lmp`, of a usual recipe of LAMMPS, and of LIGGGHTS."""
QUANTITIES: dict[str, Sequence[str]] = {
    "force": ("force",),
    "shear": ("p1", "p2", "p3"),
    "line": ("fx", "fy", "fz"),
    "whole": list_liggghts_columns(["force"]),
    "parts": list_liggghts_columns(["force_normal", "force_tangential"]),
}
"""Columns that hold each quantity of contacts; the quantities `whole` and `parts` are of
LIGGGHTS."""
FORCES = {"force", "whole", "parts"}
"""Quantities that hold normal forces: a dump of contacts must have one of them."""

WallLaw = Callable[[int], ProgramLaw]
"""Function that returns the law between a wall and a type of sphere."""


class Wall(NamedTuple):
    """A wall: z, m, the law between the wall and a type of sphere, and the ID of its fix."""

    z: float
    law: WallLaw
    name: str


Walls = Mapping[int, Wall]
"""The walls by their codes."""


@dataclass(frozen=True)
class FrameHead:
    """The header of one time of a dump.

    Attributes
    ----------
    step : int
        The step.
    count : int
        Number of rows.
    low, high : ndarray (3,)
        Bounds of the box, in the file's units.
    periodic : ndarray (3,) of bool
        Axes with a period.
    rounding : ndarray (3,)
        Unit of the last digit of bounds that the program has rounded, as LIGGGHTS does, else 0. The
        distance of a contact through a period has an error of this size.
    units : str
        Name of the units, if the dump has it (`dump_modify ... units yes`).
    tilt : ndarray (3,)
        How far the edges of a triclinic box lean: xy, xz, yz.
    """

    step: int
    count: int
    low: Floats
    high: Floats
    periodic: Bools
    rounding: Floats
    units: str
    tilt: Floats


@dataclass(frozen=True)
class Frame:
    """One time step of a dump: its header and its rows."""

    head: FrameHead
    rows: Rows


def read_frame(path: str | Path, item: Item, step: int | None) -> Frame:
    """Return the frame of this step, or the only frame of a dump.

    Raises InputError if the dump has several times and `step` chooses none of them, if the rows are
    not of the kind `item`, or if the file ends early. Rows of other times are skipped.
    """
    steps: list[int] = []
    header: dict[str, list[list[str]]] = {}
    frame: Frame | None = None
    lines = Lines(path)
    for number, line in lines:
        if not line.strip():
            continue
        first, *title = line.split()
        if first != "ITEM:" or not title:
            problem = f"{quote(line.strip())} where ITEM: and its name should stand"
            remedy = "give a text dump, style custom or local"
            refuse(path, "no_item", problem, remedy=remedy, line=number)
        if title[0] not in ITEMS:
            values = itertools.islice(lines, 3 if title[0] == "BOX" else 1)
            header[title[0]] = [title, *(value.split() for _, value in values)]
            continue
        if title[0] != item:
            problem = f"ITEM: {title[0]} where {ITEMS[item]} belong"
            remedy = "give the files in the other order"
            refuse(path, "other_item", problem, remedy=remedy, line=number)
        head = _parse_head(path, header, number)
        texts = lines.take_rows(head.count)
        steps.append(head.step)
        if step is None or step == head.step:
            if len(texts) < head.count:
                problem = f"{len(texts)} rows of {head.count}"
                reason = "the file ends in the middle"
                remedy = "let the program finish writing it"
                end = number + 1 + len(texts)
                refuse(path, "cut_off", problem, reason, remedy, line=end)
            rows = Rows(Path(path), tuple(title[1:]), texts, number + 1)
            if frame and frame.head.step == head.step and not _are_alike(frame.rows.texts, texts):
                problem = f"step {head.step} again, with other rows than before"
                reason = "the runs of two jobs in one file"
                remedy = "take one of them out"
                refuse(path, "repeated_step", problem, reason, remedy, line=number)
            frame = Frame(head, rows)
    if frame is None or (step is None and len(steps) > 1):
        _refuse_times(path, item, step, steps)
    return frame


def _are_alike(first: Sequence[str], second: Sequence[str]) -> bool:
    """Tell whether two frames have the same rows, in whatever order the processors wrote them."""
    return sorted(first) == sorted(second)


def _refuse_times(path: str | Path, item: Item, step: int | None, steps: Sequence[int]) -> NoReturn:
    """Raise InputError for a file without any frame, or without the requested frame."""
    if not steps:
        remedy = "give a text dump of LAMMPS or LIGGGHTS"
        refuse(path, "no_item", f"no ITEM: {item}", remedy=remedy)
    listed = ", ".join(map(str, steps[:MAX_LISTED_STEPS]))
    if len(steps) > MAX_LISTED_STEPS:
        listed += ", ..."
    problem = f"it has {len(steps)} times ({listed})"
    code = "several_times"
    if step is not None:
        problem += f", but no step {step}"
        code = "no_such_time"
    if item == "ATOMS":
        command = f"granular-modes import {shlex.quote(str(path))} --step {steps[-1]}"
        remedy = f"choose one with --step: {command} --log LOG -o NEW.network.h5"
    else:
        remedy = "dump spheres and contacts at one step"
    refuse(path, code, problem, remedy=remedy)


def _parse_head(path: str | Path, header: dict[str, list[list[str]]], line: int) -> FrameHead:
    """Return the header of a frame; `header` has, for each ITEM, its title and its lines as words.

    Raises InputError if the header is incomplete, or if the box is triclinic and turned ("abc").
    """
    try:
        title, *bounds = header["BOX"]
        box = np.array([words[:2] for words in bounds], float)
        is_turned = "abc" in title
        tilt = np.zeros(3)
        if "xy" in title:
            tilt = np.array([float(words[2]) for words in bounds])
        step = int(header["TIMESTEP"][1][0])
        count = int(header["NUMBER"][1][0])
        has_flags = len(title) > 4
        is_finite = np.isfinite(box).all() and np.isfinite(tilt).all()
        is_known = is_turned or (is_finite and box.shape == (3, 2) and has_flags)
    except (KeyError, ValueError, IndexError):
        is_known = False
    if not is_known or count < 0:
        problem = "no TIMESTEP, NUMBER OF and BOX BOUNDS before it, or these are none"
        remedy = "write the dump anew, with pp or ff for each axis of the box"
        refuse(path, "no_header", problem, remedy=remedy, line=line)
    if is_turned:
        problem = "the box is triclinic and turned (BOX BOUNDS abc)"
        remedy = "dump it with its first edge along x (dump_modify ... triclinic/general no)"
        refuse(path, "triclinic_cell", problem, remedy=remedy, line=line)
    rounding = np.zeros(3)
    bound_digits = count_written_digits(word for words in bounds for word in words[:2])
    if bound_digits == FORMAT_G_DIGITS:
        rounding = np.array([last_digit_unit(axis, FORMAT_G_DIGITS) for axis in box])
    # The bounds of a triclinic box are those of a rectangular one around it.
    xy, xz, yz = tilt.tolist()
    box[0] -= min(0.0, xy, xz, xy + xz), max(0.0, xy, xz, xy + xz)
    box[1] -= min(0.0, yz), max(0.0, yz)
    units = ""
    if "UNITS" in header:
        units = " ".join(*header["UNITS"][1:])
    return FrameHead(
        step=step,
        count=count,
        low=box[:, 0],
        high=box[:, 1],
        periodic=np.array([word.startswith("p") for word in title[-3:]]),
        rounding=rounding,
        units=units,
        tilt=tilt,
    )


def choose_units(path: Path, frame: Frame, typed: Units | None, script: Script) -> Units:
    """Return the units that were typed, else those named by log and dump, else SI.

    Raises InputError if two of these differ, and for lj, which has no SI values.
    """
    dumped = frame.head.units
    logged = script.units
    if dumped and logged and dumped != logged:
        problem = f"ITEM: UNITS {dumped}, and {script.place} has units {logged}"
        refuse(path, "other_units", problem, remedy="give the log of this dump")
    name = dumped or logged or "si"
    if typed is None and name not in UNITS:
        refuse(
            path if dumped else script.place,
            "unknown_units",
            f"units {name} have no SI values here",
            remedy="give those of length, mass and time with import --scales M KG S",
        )
    if typed and dumped in UNITS:
        units_agree = np.allclose(typed, UNITS[dumped], rtol=UNITS_RELATIVE_TOLERANCE, atol=0)
        if not units_agree:
            scales = " ".join(f"{scale:g}" for scale in typed)
            problem = f"ITEM: UNITS {dumped}, and --scales {scales}"
            remedy = "leave --scales out, which other units are for"
            refuse(path, "other_units", problem, remedy=remedy)
    if typed and logged in UNITS and typed != UNITS[logged]:
        script.remarks.append(f"{script.place} has units {logged}: --scales are taken")
    if typed:
        return typed
    if not (logged or dumped):
        script.remarks.append("no units are told: si are taken")
    return UNITS[name]


def list_missing_columns(rows: Rows) -> list[str]:
    """Return the columns that spheres need and that a dump lacks in each of their forms."""
    forms = (*PLACE_COLUMNS, SIZE_COLUMNS, MASS_COLUMNS)
    return [names[0] for names in forms if not any(map(rows.has, names))]


class _ReadWall(NamedTuple):
    """The planes of one fix: z in the file's units, their law, and the line that defines them."""

    heights: list[float]
    law: WallLaw
    name: str
    line: Words


def read_walls(
    script: Script, units: Units, read_law: Callable[[Words], WallLaw], planes: int
) -> Walls:
    """Return the walls of the log's fixes, or the typed ones.

    A fix defines `planes` planes, a typed wall defines two. If fixes have one plane each, the
    lowest plane is the floor. Raises InputError unless there is at most one wall at low z and one
    at high z.
    """
    read = [_read_wall(name, words, read_law, planes) for name, words in script.walls.items()]
    if planes == 1:
        read.sort(key=lambda wall: wall.heights[0])
    walls: dict[int, Wall] = {}
    for heights, law, name, line in read:
        if len(heights) == 2:
            low, high = heights
        elif WALLS[0] in walls:
            low, high = np.nan, heights[0]
        else:
            low, high = heights[0], np.nan
        for code, end, z in zip(WALLS, ("low", "high"), (low, high), strict=True):
            if np.isnan(z):
                continue
            if code in walls:
                line.refuse(
                    "second_wall",
                    f"a second wall at {end} z, beside that of fix {walls[code].name}, where a "
                    "network has one",
                    remedy=f"type them with {TYPED_WALL}",
                )
            walls[code] = Wall(units.length * z, law, name)
    return walls


def _read_wall(
    name: str, words: Sequence[str], read_law: Callable[[Words], WallLaw], planes: int
) -> _ReadWall:
    """Return the planes and the law of one fix; raise InputError for a wall of another kind."""
    is_typed = name == TYPED_WALL
    place = name if is_typed else f"fix {name} wall/gran"
    line = Words(words, place, f"only walls zplane are known; type them with {TYPED_WALL}")
    for other in OTHER_WALLS:
        if other in line:
            problem = f"{other} is not known, a network has walls at low and high z"
            remedy = "turn the packing, or make the other axes periodic"
            line.refuse("other_wall", problem, remedy=remedy)
    if "wiggle" in line:
        problem = "it wiggles, and where it was at a step is not told"
        line.refuse("moving_wall", problem, remedy=f"type where ({TYPED_WALL})")
    if "zplane" not in line:
        line.refuse("other_wall", "no zplane in it")
    heights = line.numbers_after("zplane", 2 if is_typed else planes, null=True)
    return _ReadWall(heights, read_law(line), name, line)


def read_packing(
    frame: Frame,
    units: Units,
    walls: Mapping[int, float],
    *,
    needs_type: bool,
    body: str = "",
    fixed: Bools | None = None,
) -> Packing:
    """Return the spheres of a dump, in the order of their numbers, in the cell of its box.

    Parameters
    ----------
    frame : Frame
        The dump.
    units : Units
        Units of the dump.
    walls : mapping
        z of the walls, m, by their codes.
    needs_type : bool
        Whether the law depends on types. Otherwise spheres without types are of type 1.
    body : str
        Column with the numbers of rigid bodies; empty if there are none.
    fixed : ndarray of bool (n, 6), optional
        Held motions of the spheres, in the order of the rows.
    """
    rows = frame.rows
    _refuse_shapes(rows)
    places = [_choose_column(rows, names) for names in PLACE_COLUMNS]
    size = _choose_column(rows, SIZE_COLUMNS)
    mass_column = _choose_column(rows, MASS_COLUMNS)
    names = ["id", *places, size, mass_column]
    if needs_type or rows.has("type"):
        names.append("type")
    if body:
        names.append(body)
    rows.require(names, f"add it to the dump: dump ... custom N FILE {' '.join(names)}")
    table = rows.read(*names)
    position = table[:, 1:4]
    digits = rows.count_digits(*places)
    radius = table[:, 4] * (0.5 if size == "diameter" else 1.0)
    mass = table[:, 5]
    if mass_column == "density":
        mass = mass * 4 / 3 * np.pi * radius**3
    step = last_digit_unit(position, digits)
    if "xs" in places:
        extent = frame.head.high - frame.head.low
        # Rounded bounds stretch all distances, of which one diameter counts in an overlap.
        largest_diameter = 2 * float(radius.max(initial=0.0))
        stretch = float((frame.head.rounding / extent).max()) * largest_diameter
        step = max(step * float(extent.max()), stretch)
        position = frame.head.low + position @ edges_of_cell(extent, frame.head.tilt)
    # Radii count in overlaps as positions do; those that few digits hold are exact.
    radius_digits = rows.count_digits(size)
    if radius_digits in ROUNDED_DIGITS and last_digit_unit(radius, radius_digits) > step:
        step = last_digit_unit(radius, radius_digits)
        digits = min(digits, radius_digits)
    kind = np.full(len(table), ONLY_TYPE)
    if "type" in names:
        kind = rows.to_integers(table[:, names.index("type")], "type")
    bodies = None
    if body:
        bodies = rows.to_integers(table[:, names.index(body)], body)
    columns = SphereColumns(table[:, 0], position, radius, mass, kind, bodies, fixed)
    cell = Cell(
        units.length * frame.head.low,
        units.length * frame.head.high,
        frame.head.periodic,
        (walls.get(WALLS[0], np.nan), walls.get(WALLS[1], np.nan)),
        units.length * frame.head.rounding,
        units.length * frame.head.tilt,
    )
    return Packing.from_columns(rows, cell, units, columns, digits, step)


def _refuse_shapes(rows: Rows) -> None:
    """Raise InputError for columns of bodies that are not spheres."""
    for name in SHAPE_COLUMNS:
        if rows.has(name):
            refuse(
                rows.path,
                "no_spheres",
                f"the column {name} tells of bodies that are no spheres",
                "these are not known",
                "dump spheres, without it",
                line=rows.line - 1,
                column=name,
            )


def _choose_column(rows: Rows, names: Sequence[str]) -> str:
    """Return the first of the columns `names` that a dump has; the first name if it has none."""
    for name in names:
        if rows.has(name):
            return name
    return names[0]


class DumpedContacts(NamedTuple):
    """Contacts of a dump: their rows, ends (m,), and columns (m, k) by the name of the quantity."""

    rows: Rows
    i: Ints
    j: Ints
    values: dict[str, Floats]


def read_contacts(
    path: str | Path, frame: Frame, packing: Packing, script: Script, ends: tuple[str, str]
) -> DumpedContacts:
    """Return the contacts of spheres in a dump, with all `QUANTITIES` that it has.

    `frame` is that of the spheres, `ends` are the names of the columns of the two ends. The
    computes of the log, or the recipe with as many columns, say what the columns mean. Raises
    InputError if the ends or all forces are missing.
    """
    rows = read_frame(path, "ENTRIES", frame.head.step).rows
    columns = _name_columns(rows, script)
    rows.require(ends, "let its compute line write it", columns)
    wanted = {**QUANTITIES, "ends": ends}
    groups = {}
    for quantity, names in wanted.items():
        groups[quantity] = [columns.get(name, name) for name in names]
    values = rows.read_groups(groups)
    if not values.keys() & FORCES:
        problem = "no column tells the forces"
        remedy = "let a compute line write them"
        refuse(path, "no_forces", problem, remedy=remedy, line=rows.line - 1)
    i, j = find_ends(rows, packing.number, values["ends"].T, groups["ends"])
    return DumpedContacts(rows, i, j, values)


def _name_columns(rows: Rows, script: Script) -> dict[str, str]:
    """Return the column of a dump that has each named value.

    Raises InputError for columns c_ID[k] whose meaning is not known.
    """
    columns: dict[str, str] = {}
    computed: dict[str, dict[int, str]] = {}
    for column in rows.columns:
        indexed = re.fullmatch(r"c_(\w+)(?:\[(\d+)\])?", column)
        if indexed:
            computed.setdefault(indexed[1], {})[int(indexed[2] or 1)] = column
        else:
            columns[column] = column
    for name, members in computed.items():
        words = script.computes.get(name) or RECIPES.get(len(members))
        if words is None:
            refuse(
                rows.path,
                "unknown_column",
                f"what the {len(members)} columns of c_{name} mean stands in a compute line",
                remedy="give the log that has it (--log)",
                line=rows.line - 1,
                column=next(iter(members.values())),
            )
        if name not in script.computes:
            script.remarks.append(f"columns of c_{name} are taken for {' '.join(words)}")
        for k, column in members.items():
            if k <= len(words):
                columns[words[k - 1]] = column
    return columns
