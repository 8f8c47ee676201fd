"""The text dumps of LAMMPS and LIGGGHTS: `ITEM:` headers, a box, rows of named columns, spheres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from modal.exchange.input_script import Script
from modal.exchange.law import SI, Units
from modal.exchange.particles_and_contacts import Cell, Spheres, check_spheres, in_order
from modal.exchange.registry import File
from modal.exchange.rows import Rows, fault, last_step, open_bytes, significant_digits
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError

UNITS = {"si": SI, "cgs": Units(1e-2, 1e-3, 1.0), "micro": Units(1e-6, 1e-15, 1e-6)}
"""What their systems of units are in SI; `lj` has none."""
SEVERAL = 5
"""Steps that a message lists."""
ROUNDED = (6, 7)
"""Significant digits of bounds that a program has rounded: by %g, or in single precision. Fewer
stand there when somebody chose them, more when all were written."""


SHAPED = ("shapex", "quatw", "quat1", "blockiness1", "length", "corner1x")
"""Columns of LAMMPS and LIGGGHTS for ellipsoids, superquadrics, rods and polygons."""


@dataclass(frozen=True)
class Frame:
    """One time of a dump: its step, box low and high (3,), periodic (3,), and its rows.

    `rounding` is the unit of the last digit of bounds that a program seems to have rounded, as
    LIGGGHTS does; contacts through the periods are known no better. `units` are those that the dump
    names (`dump_modify ... units yes`), if it does.
    """

    step: int
    low: Floats
    high: Floats
    periodic: Bools
    rows: Rows
    rounding: float
    units: str = ""


def of_liggghts(file: File) -> bool:
    """Whether a dump is of LIGGGHTS, whose dumps look as LAMMPS': by its log, or the typed law."""
    typed = str(file.options.get("pair", "")).split()[:1] == ["gran"]
    return typed or b"LIGGGHTS" in file.other("log")


def frame_of(path: str | Path, kind: str, step: int | None) -> Frame:
    """The frame of this step, or the only one; `kind` is ATOMS or ENTRIES.

    InputError where a dump has several times and `step` chooses none of them.
    """
    frames = _frames(Path(path), kind)
    steps = [frame.step for frame in frames]
    if step is None and len(frames) > 1:
        some = ", ".join(map(str, steps[:SEVERAL])) + ", ..." * (len(steps) > SEVERAL)
        do = f"choose one with --step, such as --step {steps[-1]}"
        fault(path, f"it has {len(frames)} times ({some})", do)
    for frame in reversed(frames):
        if step is None or frame.step == step:
            return frame
    some = ", ".join(map(str, steps[:SEVERAL]))
    fault(path, f"it has no step {step}, but {some}", "dump both files at one step, or --step")


def _frames(path: Path, kind: str) -> list[Frame]:
    frames = []
    with open_bytes(path) as file:
        number, values = 0, dict[str, list[str]]()
        while True:
            line = file.readline().decode("utf-8", "replace")
            number += 1
            if not line.strip():
                if not line:
                    break
                continue
            if not line.startswith("ITEM: "):
                what = f"{line.strip()[:40]!r} where ITEM: should stand"
                fault(path, what, "give a text dump, style custom or local", number)
            title = line.removeprefix("ITEM: ").split()
            if not title:
                fault(path, "ITEM: without a name", "write the dump anew", number)
            if title[0] in ("ATOMS", "ENTRIES"):
                if title[0] != kind:
                    wanted = {"ATOMS": "spheres (dump custom)", "ENTRIES": "contacts (dump local)"}
                    what = f"ITEM: {title[0]} where {wanted[kind]} belong"
                    fault(path, what, "give the files in the other order", number)
                frame = _frame(path, values, title[1:], file.tell(), number)
                frames.append(frame)
                for _ in range(frame.rows.count):
                    if not file.readline():
                        break
                number += frame.rows.count
                continue
            size = 3 if title[0] == "BOX" else 1
            name = " ".join(title[:3]) if title[0] == "NUMBER" else title[0]
            values[name] = [file.readline().decode("utf-8", "replace") for _ in range(size)]
            values[f"{name} title"] = title
            number += size
    if not frames:
        fault(path, f"no ITEM: {kind}", "give a text dump of LAMMPS or LIGGGHTS")
    return frames


def _frame(
    path: Path, values: dict[str, list[str]], columns: list[str], offset: int, line: int
) -> Frame:
    count = next((values[name] for name in values if name.startswith("NUMBER OF")), None)
    if count is None or "TIMESTEP" not in values or "BOX" not in values:
        fault(path, "no TIMESTEP, NUMBER OF or BOX BOUNDS before it", "write the dump anew", line)
    title = values["BOX title"]
    try:
        box = np.array([row.split()[:2] for row in values["BOX"]], float)
        tilted = any(float(row.split()[2]) for row in values["BOX"] if "xy" in title)
        step, rows = int(values["TIMESTEP"][0]), int(count[0])
    except (ValueError, IndexError) as error:
        what = f"a header that is no number: {str(error)[:80]}"
        fault(path, what, "write the dump anew", line)
    if tilted or "abc" in title:
        what = "the cell is triclinic (its periods are at angles)"
        fault(path, what, "only rectangular cells are known; compress without shear", line)
    if box.shape != (3, 2) or not np.isfinite(box).all() or rows < 0:
        fault(path, "BOX BOUNDS or NUMBER OF that are none", "write the dump anew", line)
    periodic = np.array([word.startswith("p") for word in title[-3:]])
    if len(title) < 5:
        what = "BOX BOUNDS does not say which axes are periodic"
        fault(path, what, "add pp or ff for each axis behind BOX BOUNDS", line)
    bounds = [word for row in values["BOX"] for word in row.split()[:2]]
    rounded = periodic.any() and significant_digits(bounds) in ROUNDED
    return Frame(
        step,
        box[:, 0],
        box[:, 1],
        periodic,
        Rows(path, tuple(columns), offset, line + 1, rows),
        last_step(box, significant_digits(bounds)) if rounded else 0.0,
        values.get("UNITS", [""])[0].strip(),
    )


def units_of(
    frame: Frame, scales: Sequence[float] | None, script: Script
) -> tuple[Units, list[str]]:
    """The units in SI: those that are typed, or of the name that log and dump give them (or si).

    And what is assumed of them. InputError where two differ, and for lj, which has no SI.
    """
    typed, dumped, logged, said = Units.typed(scales), frame.units, script.units, script.said
    if dumped and logged and dumped != logged:
        do = "give the log of this dump" if typed is None else "leave --log out, or mend one"
        fault(frame.rows.path, f"ITEM: UNITS {dumped}, and {said} has units {logged}", do)
    name = dumped or logged or "si"
    if typed is None and name not in UNITS:
        where = frame.rows.path if dumped else said
        raise InputError(
            f"{where}: units {name} have no SI values here; give those of length, mass and time "
            "with --scales M KG S"
        )
    if typed and dumped and not np.allclose(typed, UNITS.get(dumped, typed), rtol=1e-9, atol=0):
        what = f"ITEM: UNITS {dumped}, and --scales {' '.join(f'{one:g}' for one in typed)}"
        fault(frame.rows.path, what, "leave --scales out, which other units are for")
    return typed or UNITS[name], ["units si"] * (not (typed or logged or dumped))


def spheres_of(
    frame: Frame, units: Units, walls: Mapping[int, float], *, typed: bool, body: str = ""
) -> tuple[Spheres, Cell]:
    """The spheres of a dump, in the order of their numbers, and the cell of its box.

    `walls` have their z, m, by their codes; `typed` if the law asks for types; `body` is the column
    with the numbers of rigid bodies, if there are any.
    """
    rows = frame.rows

    def first(*options: tuple[str, ...]) -> tuple[str, ...]:
        found = next((names for names in options if rows.has(*names)), None)
        if found is None:
            _missing(frame, " ".join(options[0]))
        return found

    for name in SHAPED:
        if rows.has(name):
            what = f"the column {name} tells of bodies that are no spheres, which are not known"
            fault(rows.path, what, "dump spheres, without it", rows.line - 1, name)
    first(("id",))
    places = first(*(tuple(f"{axis}{kind}" for axis in "xyz") for kind in ("", "u", "s")))
    (size,) = first(("radius",), ("diameter",))
    (heavy,) = first(("mass",), ("rmass",), ("density",))
    further = [name for name in ("type" * (typed or rows.has("type")), body) if name]
    for name in further:
        first((name,))
    table = rows.read("id", *places, size, heavy, *further)
    number, order = in_order(rows, table[:, 0])
    whole = {name: rows.whole(table[:, 6 + k], name)[order] for k, name in enumerate(further)}
    table = table[order]
    position, digits = table[:, 1:4], rows.digits(*places)
    step = last_step(position, digits)
    if places[0] == "xs":
        step *= float((frame.high - frame.low).max())
        position = frame.low + position * (frame.high - frame.low)
    radius = units.length * table[:, 4] * (0.5 if size == "diameter" else 1.0)
    mass = units.mass * table[:, 5]
    if heavy == "density":
        mass = units.density * table[:, 5] * 4 / 3 * np.pi * radius**3
    # Radii count in overlaps as positions do; those that few digits hold are exact.
    rounded = last_step(radius / units.length, rows.digits(size))
    coarse = max(frame.rounding, rounded * (rows.digits(size) in ROUNDED))
    if coarse > step:
        step, digits = coarse, min(digits, ROUNDED[0])
    kind = whole.get("type", np.ones(len(table), int))
    position, step = units.length * position, units.length * step
    spheres = Spheres(number, position, radius, mass, kind, digits, step, whole.get(body))
    planes = walls.get(SOURCE_WALL, np.nan), walls.get(RECEIVER_WALL, np.nan)
    cell = Cell(units.length * frame.low, units.length * frame.high, frame.periodic, planes)
    check_spheres(spheres, cell, str(rows.path))
    return spheres, cell


def _missing(frame: Frame, column: str) -> NoReturn:
    had = " ".join(frame.rows.columns)
    do = f"add {column} to the dump: dump ... custom N FILE id type x y z radius mass"
    fault(frame.rows.path, f"no column {column} among {had}", do, frame.rows.line - 1, column)
