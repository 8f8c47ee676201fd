"""The spheres of a dump of LAMMPS or LIGGGHTS, and rows that tell of them by their numbers."""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from modal.exchange.bodies import Cell, Spheres
from modal.exchange.dump import ROUNDED, Frame
from modal.exchange.program_law import Units
from modal.exchange.rows import fault, last_step
from modal.tools.arrays import Floats, Ints


def cell_of(frame: Frame, units: Units) -> Cell:
    """Bounds and periods of the frame's box."""
    return Cell(units.length * frame.low, units.length * frame.high, frame.periodic)


def spheres_of(frame: Frame, units: Units, *, typed: bool) -> Spheres:
    """The spheres of a dump, in the order of their numbers; `typed` if the law asks for types."""
    rows = frame.rows
    if not rows.has("id"):
        _missing(frame, "id", "dump ... custom N FILE id type x y z radius mass")
    scaled = rows.has("xs", "ys", "zs")
    options = (("x", "y", "z"), ("xu", "yu", "zu"), ("xs", "ys", "zs"))
    names = next((names for names in options if rows.has(*names)), None)
    if names is None:
        _missing(frame, "x y z", "dump ... custom N FILE id type x y z radius mass")
    size = next((name for name in ("radius", "diameter") if rows.has(name)), None)
    if size is None:
        _missing(frame, "radius", "add radius to the dump")
    heavy = next((name for name in ("mass", "rmass", "density") if rows.has(name)), None)
    if heavy is None:
        _missing(frame, "mass", "add mass to the dump")
    if typed and not rows.has("type"):
        _missing(frame, "type", "add type to the dump: the law is not the same for all types")
    wanted = ["id", *names, size, heavy] + ["type"] * rows.has("type")
    table = rows.read(*wanted)
    for column in ("id", "type"):
        if column in wanted:
            frame.rows.whole(table[:, wanted.index(column)], column)
    number = table[:, 0].astype(np.int64)
    order = np.argsort(number, kind="stable")
    again = np.flatnonzero(np.diff(number[order]) == 0)
    if len(again):
        first, second = order[again[0]], order[again[0] + 1]
        what = f"sphere {number[first]} stands in line {rows.line + first} already"
        fault(rows.path, what, "write each once, without ghosts or images", rows.line + second)
    table = table[order]
    position = table[:, 1:4]
    step = last_step(position, rows.digits(*names))
    if scaled:
        step *= float((frame.high - frame.low).max())
        position = frame.low + position * (frame.high - frame.low)
    radius = units.length * table[:, 4] * (0.5 if size == "diameter" else 1.0)
    mass = units.mass * table[:, 5]
    if heavy == "density":
        mass = units.density * table[:, 5] * 4 / 3 * np.pi * radius**3
    digits = rows.digits(*names)
    # Radii count in overlaps as positions do; those that few digits hold are exact.
    rounded = last_step(radius / units.length, rows.digits(size))
    coarse = max(frame.rounding, rounded * (rows.digits(size) in ROUNDED))
    if coarse > step:
        step, digits = coarse, min(digits, ROUNDED[0])
    return Spheres(
        number=number[order],
        position=units.length * position,
        radius=radius,
        mass=mass,
        kind=table[:, 6].astype(int) if rows.has("type") else np.ones(len(table), int),
        digits=digits,
        step=units.length * step,
    )


def _missing(frame: Frame, column: str, do: str) -> NoReturn:
    had = " ".join(frame.rows.columns)
    fault(frame.rows.path, f"no column {column} among {had}", do, frame.rows.line - 1, column)


def index_of(number: Ints, ids: Floats, frame: Frame, column: str) -> Ints:
    """Indices of spheres by their numbers; InputError, with the line, for one that is not there."""
    place = np.clip(np.searchsorted(number, ids), 0, len(number) - 1)
    lost = number[place] != ids
    if lost.any():
        row = int(np.argmax(lost))
        what = f"sphere {ids[row]:.0f} is not among the spheres"
        do = "dump both files at the same step, of the same spheres"
        fault(frame.rows.path, what, do, frame.rows.line + row, column)
    return place


def once(i: Ints, j: Ints, frame: Frame) -> None:
    """InputError, with both lines, where two rows tell of the same pair, or where there is none."""
    if len(i) == 0:
        fault(frame.rows.path, "no two spheres touch in it", "dump a packing under stress")
    key = np.minimum(i, j).astype(np.int64) * (int(max(i.max(), j.max())) + 1) + np.maximum(i, j)
    order = np.argsort(key, kind="stable")
    again = np.flatnonzero(np.diff(key[order]) == 0)
    if len(again):
        first, second = order[again[0]], order[again[0] + 1]
        what = f"the contact of line {frame.rows.line + first} again"
        fault(frame.rows.path, what, "list each contact once", frame.rows.line + second)
