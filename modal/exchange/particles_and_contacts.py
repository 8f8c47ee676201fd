"""A packing as another program tells it: spheres, cell and contacts in SI, and who touches whom."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modal.exchange.law import ProgramLaw
from modal.exchange.rows import Rows, fault
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError

NARROW = 2.0
"""A period must exceed this many of the largest diameters, or images are not told apart."""
COLUMNS = ("i", "j", "force", "shear", "stiffness", "turning", "line")
"""What is told of each contact."""
FAR = 1e9
"""Radii from the origin, beyond which no digit is left for an overlap."""


@dataclass(frozen=True)
class Spheres:
    """n spheres: numbers (n,) of the program, position (n, 3), radius, mass (n,), kind (n,).

    `kind` is the type that chooses the law; `digits` of the positions as they were written, and
    `step` the unit of the last of them, m. Spheres of the same number in `body` (n,) are one rigid
    body; below 1 a sphere is its own.
    """

    number: Ints
    position: Floats
    radius: Floats
    mass: Floats
    kind: Ints
    digits: int
    step: float
    body: Ints | None = None

    def inside(self, i: Ints, j: Ints) -> Bools:
        """Shape (m,): contacts between two spheres of one body, which are none."""
        if self.body is None:
            return np.zeros(len(i), bool)
        one, other = self.body[i], self.body[np.maximum(j, 0)]
        same: Bools = (j >= 0) & (one > 0) & (one == other)
        return same


@dataclass(frozen=True)
class Cell:
    """low, high (3,), m, periodic (3,); walls: z of the source and the receiver wall, or NaN."""

    low: Floats
    high: Floats
    periodic: Bools
    walls: tuple[float, float] = (np.nan, np.nan)


@dataclass(frozen=True)
class Contacts:
    """m contacts: i and j (m,), indices or a wall's code; j's image is the nearest one.

    `force` (m,), compression positive, and `shear` (m, 3) on i, N, or None where not told, and a
    force NaN that follows from the law;
    `stiffness` the normal and tangential ones (m,), N/m, of a table that has them, so that no law
    is asked, and `turning` the rolling and twisting ones (m,), N m/rad; `line` (m, 3) vectors along
    the normals, either way, where they are told better than by rounded positions. `listed` are the
    rows of the file that tells of the first of them, for messages.
    """

    i: Ints
    j: Ints
    force: Floats | None = None
    shear: Floats | None = None
    stiffness: tuple[Floats, Floats] | None = None
    turning: tuple[Floats, Floats] | None = None
    line: Floats | None = None
    listed: Rows | None = None

    def some(self, kept: Bools) -> Contacts:
        """Those that are `kept` (m,), in their order."""

        def cut(data: Any) -> Any:
            return data[kept] if isinstance(data, np.ndarray) else data and tuple(map(cut, data))

        return Contacts(**{name: cut(getattr(self, name)) for name in COLUMNS})

    def with_walls(self, i: Ints, j: Ints, force: Floats, shear: Floats | None) -> Contacts:
        """These, then contacts with walls; no shear forces where those at the walls are absent."""
        more = {"i": i, "j": j, "force": force, "shear": shear}
        more["line"] = np.tile([0.0, 0.0, 1.0], (len(i), 1))
        whole: dict[str, Any] = {}
        for name, data in more.items():
            own = getattr(self, name)
            whole[name] = None if own is None or data is None else np.concatenate([own, data])
        return replace(self, **whole)


LawOf = Callable[[int, int], ProgramLaw]
"""The law between two kinds of spheres; between a kind and a wall, whose code is negative."""


def in_order(rows: Rows, ids: Floats, column: str = "id") -> tuple[Ints, Ints]:
    """Numbers of spheres in rising order, and the rows (n,) in which they stand.

    InputError, with both lines, where a number stands twice, or is none.
    """
    number = rows.whole(ids, column)
    order = np.argsort(number, kind="stable")
    again = np.flatnonzero(np.diff(number[order]) == 0)
    if len(again):
        first, second = order[again[0]], order[again[0] + 1]
        what = f"sphere {number[first]} again (line {rows.line + first})"
        do = "write each once, without ghosts or images"
        fault(rows.path, what, do, rows.line + second, column)
    return number[order], order


def ends_of(
    rows: Rows,
    number: Ints,
    ids: Sequence[Floats] | Floats,
    columns: Sequence[str],
    walls: Sequence[int] = (),
) -> tuple[Ints, Ints]:
    """Indices (m,) of the two spheres of each row by their numbers; the second may be a wall's.

    InputError, with its line, for a number that no sphere has, and for a pair that stands twice.
    """
    ends = []
    for end, (given, column) in enumerate(zip(ids, columns, strict=True)):
        whole = rows.whole(given, column)
        place = np.clip(np.searchsorted(number, whole), 0, len(number) - 1)
        wall = np.isin(whole, walls) & (end == 1)
        lost = (number[place] != whole) & ~wall
        if lost.any():
            row = int(np.argmax(lost))
            do = "write both files at the same step, of the same spheres"
            what = f"sphere {whole[row]} is not among the spheres"
            fault(rows.path, what, do, rows.line + row, column)
        ends.append(np.where(wall, whole, place).astype(np.int32))
    i, j = ends
    if len(i) == 0:
        do = "dump a packing under stress"
        fault(rows.path, "no two spheres touch in it", do, rows.line)
    # Codes of walls are negative, below all indices.
    key = (np.minimum(i, j) + 2).astype(np.int64) * (len(number) + 2) + np.maximum(i, j)
    order = np.argsort(key, kind="stable")
    again = np.flatnonzero(np.diff(key[order]) == 0)
    if len(again):
        first, second = order[again[0]], order[again[0] + 1]
        what = f"the contact of line {rows.line + first} again"
        fault(rows.path, what, "list each contact once", rows.line + second)
    return i, j


def check_spheres(spheres: Spheres, cell: Cell, name: str) -> None:
    """InputError for spheres that no cell can have."""

    def refuse(wrong: Bools, what: str, do: str) -> None:
        if wrong.any():
            which = spheres.number[int(np.argmax(wrong))]
            raise InputError(f"{name}: sphere {which} {what}; {do}")

    position, radius = spheres.position, spheres.radius
    far = ~(abs(position) < FAR * radius.max(initial=0.0)).all(axis=1)
    refuse(far, f"lies {FAR:g} radii away", "mend the export")
    if len(position) == 0:
        raise InputError(f"{name}: no spheres; dump those of the packing")
    for what in ("radius", "mass"):
        refuse(getattr(spheres, what) <= 0, f"has {what} <= 0", "dump spheres alone")
    reach, slack = NARROW * 2 * float(radius.max()), 1e-3 * float(radius.max())
    for axis in range(3):
        low, high = cell.low[axis], cell.high[axis]
        if cell.periodic[axis] and not high - low > reach:
            raise InputError(
                f"{name}: the period along {'xyz'[axis]}, {high - low:.4g} m, is less than two of "
                f"the largest diameters, {reach:.4g} m: images cannot be told apart; take a wider "
                "cell"
            )
        if not cell.periodic[axis]:
            out = (position[:, axis] < low - slack) | (position[:, axis] > high + slack)
            do = "leave lost spheres out, or mend the bounds"
            refuse(out, f"lies outside the cell along {'xyz'[axis]}", do)


def nearest(branch: Floats, cell: Cell) -> tuple[Floats, Ints]:
    """A branch (m, 3) through the nearest images, and the periods (m, 3) that are added to j."""
    size = np.where(cell.periodic, cell.high - cell.low, np.inf)
    shift = -np.round(branch / size).astype(np.int32)
    period = np.where(cell.periodic, cell.high - cell.low, 0.0)
    return branch + shift * period, shift


def branches(
    position: Floats, cell: Cell, walls: Sequence[float], i: Ints, j: Ints
) -> tuple[Floats, Ints]:
    """From the centre of i to that of j, or straight to the wall, (m, 3), m, and the periods."""
    wall = j < 0
    branch, shift = nearest(position[np.where(wall, 0, j)] - position[i], cell)
    branch[wall], shift[wall] = 0, 0
    plane = np.asarray(walls)[np.where(j == SOURCE_WALL, 0, 1)]
    branch[wall, 2] = (plane - position[i, 2])[wall]
    return branch, shift


def pushes(spheres: Spheres, cell: Cell, i: Ints, j: Ints, force: Floats) -> tuple[Floats, Floats]:
    """Of forces (m, 3), N, on i: the part along the normal, compression positive, and the rest."""
    branch, _ = branches(spheres.position, cell, cell.walls, i, j)
    normal = branch / np.linalg.norm(branch, axis=1)[:, None]
    push = -(force * normal).sum(axis=1)
    return push, force + push[:, None] * normal


def touching_pairs(spheres: Spheres, cell: Cell, least: float = 0.0) -> Contacts:
    """Contacts by overlap of more than `least`, m, alone, through all periods, and with walls."""
    from scipy.spatial import cKDTree  # half a second, and not needed where contacts are listed

    size = cell.high - cell.low
    inside = np.where(cell.periodic, (spheres.position - cell.low) % size, spheres.position)
    # A position just below a period comes out as the period itself.
    inside = np.where(cell.periodic & (inside >= size), 0.0, inside)
    tree = cKDTree(inside, boxsize=np.where(cell.periodic, size, 0.0))
    pairs = tree.query_pairs(2 * float(spheres.radius.max()), output_type="ndarray")
    i, j = pairs.T
    branch, _ = nearest(spheres.position[j] - spheres.position[i], cell)
    reach = spheres.radius[i] + spheres.radius[j] - least
    near = ((branch**2).sum(axis=1) < reach**2) & ~spheres.inside(i, j)
    ends = [(i[near], j[near])]
    z = spheres.position[:, 2]
    for code, wall, side in ((SOURCE_WALL, cell.walls[0], 1), (RECEIVER_WALL, cell.walls[1], -1)):
        (at,) = np.nonzero(side * (z - wall) < spheres.radius - least)  # NaN: no wall, none
        ends.append((at, np.full(len(at), code)))
    i, j = (np.concatenate(column) for column in zip(*ends, strict=True))
    order = np.lexsort((j, i))
    return Contacts(i[order], j[order])
