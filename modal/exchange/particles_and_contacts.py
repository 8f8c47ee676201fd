"""A packing as another program tells it: spheres, cell and contacts in SI, and who touches whom."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from modal.exchange.law import ProgramLaw, Units
from modal.exchange.text import Rows, fault, last_step
from modal.packing.neighbours import ContactList, between, touching
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Array, Bools, Floats, Ints

NARROW = 2.0
"""A period must exceed this many of the largest diameters, or images are not told apart."""
WALLS = (SOURCE_WALL, RECEIVER_WALL)


@dataclass(frozen=True)
class Cell:
    """low, high (3,), m, periodic (3,); walls: z of the source and the receiver wall, or NaN.

    `rounding` (3,), m, is the unit of the last digit of bounds that the program has rounded, 0
    where it wrote them as they are.
    """

    low: Floats
    high: Floats
    periodic: Bools
    walls: tuple[float, float] = (np.nan, np.nan)
    rounding: Floats = field(default_factory=lambda: np.zeros(3))

    @property
    def periods(self) -> Floats:
        """Shape (3,), m; 0 along an axis without a period."""
        return np.where(self.periodic, self.high - self.low, 0.0)

    @property
    def planes(self) -> tuple[float, float]:
        """z of the walls; where there is none, of the end of the cell."""
        low, high = np.where(np.isnan(self.walls), (self.low[2], self.high[2]), self.walls)
        return float(low), float(high)


@dataclass(frozen=True)
class Packing:
    """n spheres in a cell: numbers (n,) of the program, position (n, 3), radius, mass (n,).

    `name` of their file, for messages; `digits` of the positions and radii as they were written,
    and `step` the unit of the last of them, m; `kind` (n,) is the type that chooses the law.
    Spheres of the same number in `body` (n,) are one rigid body; below 1 a sphere is its own.
    """

    name: str
    cell: Cell
    digits: int
    step: float
    number: Ints
    position: Floats
    radius: Floats
    mass: Floats
    kind: Ints
    body: Ints

    @classmethod
    def of(
        cls,
        rows: Rows,
        cell: Cell,
        units: Units,
        columns: Mapping[str, Array],
        digits: int,
        step: float | None = None,
    ) -> Packing:
        """The spheres of these rows in the order of their numbers.

        `columns` number, position, radius, mass, and kind and body if they are told, and `step`
        that of the last digit, are in the file's units. InputError for spheres that no cell can
        have, and for a number that stands twice.
        """
        number = rows.whole(columns["number"], "id")
        order = rows.rising(
            number,
            lambda row: f"sphere {number[row]} again (line {rows.line + row})",
            "write each once, without ghosts or images",
            "id",
        )
        step = last_step(columns["position"], digits) if step is None else step
        unit = {"position": units.length, "radius": units.length, "mass": units.mass}
        none = np.zeros(len(order), int)
        whole = {"kind": none, "body": none} | dict(columns) | {"number": number}
        own: dict[str, Any] = {k: unit.get(k, 1) * data[order] for k, data in whole.items()}
        found = cls(str(rows.path), cell, digits, units.length * step, **own)
        found._check()
        return replace(found, position=found._inside())

    def _inside(self) -> Floats:
        """Positions, those outside of a period moved into it."""
        low, high = self.cell.low, self.cell.high
        inside = low + (self.position - low) % np.where(high > low, high - low, 1.0)
        outside = (self.position < low) | (self.position > high)
        return np.where(self.cell.periodic & outside, inside, self.position)

    def _check(self) -> None:
        """InputError for spheres that no cell can have."""
        if len(self.position) == 0:
            fault(self.name, "no spheres", "dump those of the packing")
        for what in ("radius", "mass"):
            self.refuse(getattr(self, what) <= 0, f"has {what} <= 0", "dump spheres alone")
        largest, cell = float(self.radius.max()), self.cell
        reach, slack = NARROW * 2 * largest, 1e-3 * largest
        for axis, low, high, at in zip("xyz", cell.low, cell.high, self.position.T, strict=True):
            if not cell.periodic["xyz".index(axis)]:
                do = "leave lost spheres out, or mend the bounds"
                out = (at < low - slack) | (at > high + slack)
                self.refuse(out, f"lies outside the cell along {axis}", do)
            elif not high - low > reach:
                what = f"two of the largest diameters, {reach:.4g} m: images cannot be told apart"
                what = f"the period along {axis}, {high - low:.4g} m, is less than {what}"
                fault(self.name, what, "take a wider cell")

    def refuse(self, wrong: Bools, what: str, do: str) -> None:
        """InputError for the first sphere that is `wrong` (n,)."""
        if wrong.any():
            fault(self.name, f"sphere {self.number[np.argmax(wrong)]} {what}", do)

    def between(self, i: Ints, j: Ints) -> ContactList:
        """Contacts of i with the nearest image of j, or with a wall: normals, overlaps, periods."""
        cell, pair = self.cell, (j >= 0)[:, None]
        branch = self.position[np.maximum(j, 0)] - self.position[i]
        shift = -np.round(branch / np.where(cell.periodic, cell.periods, np.inf))
        ends = i, j, np.where(pair, shift, 0).astype(np.int32)
        with np.errstate(invalid="ignore"):  # two in one place are refused later
            return between(ends, self.position, cell.periods, np.array(cell.planes), self.radius)

    def distance_error(self, shift: Ints) -> Floats:
        """Return the error (m,), m, of the distances of contacts over these periods (m, 3).

        Root mean square, by the digits of both positions and, through a period, of its two bounds.
        """
        by_bounds = np.where(shift == 0, 0.0, self.cell.rounding).max(axis=1, initial=0.0)
        return np.hypot(self.step, by_bounds) / np.sqrt(6)

    def pushes(self, i: Ints, j: Ints, force: Floats) -> tuple[Floats, Floats]:
        """Of forces (m, 3), N, on i: the part along the normal, compression positive, the rest."""
        normal = self.between(i, j).normal
        push = -(force * normal).sum(axis=1)
        return push, force + push[:, None] * normal

    def reach(self, i: Ints, j: Ints) -> tuple[Floats, Floats]:
        """Sum of radii and effective radius (m,), m; at a wall both are the sphere's own."""
        a, b = self.radius[i], self.radius[np.maximum(j, 0)]
        return np.where(j < 0, a, a + b), np.where(j < 0, a, a * b / (a + b))

    def touching(self) -> Contacts:
        """Contacts by overlap alone, through all periods, and at walls."""
        cell = self.cell
        low = np.where(cell.periodic, cell.low, self.position.min(axis=0))
        with np.errstate(invalid="ignore", divide="ignore"):  # two in one place are refused later
            found = touching(self.position, low, cell.periods, np.array(cell.walls), self.radius)
        return Contacts(found.particle_i, found.particle_j)


@dataclass(frozen=True)
class Contacts:
    """m contacts: i and j (m,), indices or a wall's code; j's image is the nearest one.

    `force` (m,), compression positive, and `shear` (m, 3) on i, N, or None where not told, and a
    force NaN that follows from the law; `line` (m, 3) vectors along the normals, either way, where
    they are told better than by rounded positions. `columns` (m,) are what a network has of the
    contacts of a table, with their stiffnesses, so that no law is asked. `listed` are the rows of
    the file that tells of the first of them, for messages.
    """

    i: Ints
    j: Ints
    force: Floats | None = None
    shear: Floats | None = None
    line: Floats | None = None
    columns: Mapping[str, Floats] = field(default_factory=dict)
    listed: Rows | None = None

    def some(self, kept: Bools) -> Contacts:
        """Those that are `kept` (m,), in their order."""
        own: dict[str, Any] = {
            name: data[kept] for name, data in vars(self).items() if isinstance(data, np.ndarray)
        }
        return Contacts(columns={name: x[kept] for name, x in self.columns.items()}, **own)

    def with_walls(self, i: Ints, j: Ints, force: Floats, shear: Floats | None) -> Contacts:
        """These, then contacts with walls; no shear forces where those at the walls are absent."""
        more = {"i": i, "j": j, "force": force, "shear": shear}
        more["line"] = np.tile([0.0, 0.0, 1.0], (len(i), 1))
        whole: dict[str, Any] = {}
        for name, data in more.items():
            own = getattr(self, name)
            whole[name] = None if own is None or data is None else np.concatenate([own, data])
        return replace(self, **whole)

    def refuse(self, wrong: Bools, what: Callable[[int], str], do: str, name: str) -> None:
        """InputError for the first contact that is `wrong` (m,), with its line if it is listed.

        Else with the `name` of the file of the spheres.
        """
        if self.listed is not None:
            self.listed.refuse(wrong[: len(self.listed.texts)], what, do)
        if wrong.any():
            fault(name, what(int(np.argmax(wrong))), do)


LawOf = Callable[[int, int], ProgramLaw]
"""The law between two kinds of spheres; between a kind and a wall, whose code is negative."""


def ends_of(
    rows: Rows, number: Ints, ids: Floats, columns: Sequence[str], codes: Sequence[int] = ()
) -> tuple[Ints, Ints]:
    """Indices (m,) of the two spheres of each row by their numbers; j may be one of `codes`.

    InputError, with its line, for a number that no sphere has, and for a pair that stands twice.
    """
    do = "write both files at the same step, of the same spheres"

    def end(column: str, given: Floats, codes: Sequence[int]) -> Ints:
        whole = rows.whole(given, column)
        place = np.clip(np.searchsorted(number, whole), 0, len(number) - 1)
        wall = np.isin(whole, codes)
        lost = (number[place] != whole) & ~wall
        rows.refuse(lost, lambda k: f"sphere {whole[k]} is not among the spheres", do, column)
        return np.where(wall, whole, place).astype(np.int32)

    i, j = map(end, columns, ids, ((), codes))
    if len(i) == 0:
        fault(rows.path, "no two spheres touch in it", "dump a packing under stress", rows.line)
    low, high = np.minimum(i, j).astype(np.int64), np.maximum(i, j)
    keys = low * (len(number) - min(WALLS)) + high
    again = "list each contact once"
    rows.rising(keys, lambda row: f"the contact of line {rows.line + row} again", again)
    return i, j
