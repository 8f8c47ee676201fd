"""A packing as another program writes it: spheres, cell and contacts, in SI units."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from modal.exchange.digits import last_digit_unit
from modal.exchange.law import ProgramLaw, Units
from modal.exchange.refusals import refuse
from modal.exchange.rows import Rows
from modal.packing.neighbours import ContactList, between, touching
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Bools, Floats, Ints

MIN_PERIOD_IN_DIAMETERS = 2.0
"""Least period, in diameters of the largest sphere: in a shorter one a sphere could touch another
sphere and also its image."""
MAX_DISTANCE_OUTSIDE_IN_RADII = 1e-3
"""Distance, in largest radii, by which a centre may lie outside the cell, as rounding may do."""
MAX_STEPS_AT_ANGLES = 2
"""Largest number of periods along each axis among which the shortest sum is sought."""
WALLS = (SOURCE_WALL, RECEIVER_WALL)


@dataclass(frozen=True)
class Cell:
    """The cell of a packing.

    Attributes
    ----------
    low, high : ndarray (3,), m
        Bounds.
    periodic : ndarray (3,) of bool
        Axes with a period.
    walls : tuple of two floats, m
        z of the source wall and of the receiver wall; NaN for a wall that is absent.
    rounding : ndarray (3,), m
        Unit of the last digit of the bounds, if the program has rounded them; otherwise 0.
    tilt : ndarray (3,), m
        Lean of the period along y in x, of the period along z in x, and of the period along z in y.
    """

    low: Floats
    high: Floats
    periodic: Bools
    walls: tuple[float, float] = (np.nan, np.nan)
    rounding: Floats = field(default_factory=lambda: np.zeros(3))
    tilt: Floats = field(default_factory=lambda: np.zeros(3))

    @property
    def edges(self) -> Floats:
        """Return the edges of the cell as rows (3, 3), m."""
        return edges_of_cell(self.high - self.low, self.tilt)

    @property
    def periods(self) -> Floats:
        """Return the periods, m: (3,), or (3, 3) for a tilted cell; 0 along an axis without one."""
        if not self.tilt.any():
            return np.where(self.periodic, self.high - self.low, 0.0)
        return np.where(self.periodic[:, None], self.edges, 0.0)

    @property
    def shortest_periods(self) -> Floats:
        """Return the lengths (3,), m, of the shortest lattice vectors with each period once."""
        if not self.tilt.any():
            return self.high - self.low
        shortest = np.linalg.norm(self.edges, axis=1)
        for turns in product(range(-MAX_STEPS_AT_ANGLES, MAX_STEPS_AT_ANGLES + 1), repeat=3):
            stepped = (np.array(turns) == 1) & self.periodic
            length = float(np.linalg.norm(turns @ self.periods))
            shortest[stepped] = np.minimum(shortest[stepped], length)
        return shortest

    def in_edges(self, vector: Floats) -> Floats:
        """Return vectors (k, 3), m, in units of the cell's edges."""
        return vector @ np.linalg.inv(self.edges)

    def nearest_shift(self, branch: Floats) -> Ints:
        """Return the periods (m, 3) that make branch vectors (m, 3), m, shortest when added."""
        if not self.tilt.any():
            period = np.where(self.periodic, self.high - self.low, np.inf)
            return (-np.round(branch / period)).astype(np.int32)
        shift = -np.round(self.in_edges(branch)) * self.periodic
        # In a cell at angles the image in the nearest cell need not be the nearest image.
        best = np.linalg.norm(branch + shift @ self.edges, axis=1)
        rounded = shift.copy()
        for turns in product((-1, 0, 1), repeat=3):
            other = rounded + np.array(turns) * self.periodic
            distance = np.linalg.norm(branch + other @ self.edges, axis=1)
            is_nearer = distance < best
            shift[is_nearer] = other[is_nearer]
            best = np.minimum(best, distance)
        return shift.astype(np.int32)

    @property
    def planes(self) -> tuple[float, float]:
        """Return z of the two walls, m; the end of the cell takes the place of an absent wall."""
        bounds = (self.low[2], self.high[2])
        low, high = np.where(np.isnan(self.walls), bounds, self.walls)
        return float(low), float(high)


def edges_of_cell(sides: Floats, tilt: Floats) -> Floats:
    """Return the edges of a cell as rows (3, 3), from its sides (3,) and its tilt (3,)."""
    xy, xz, yz = tilt.tolist()
    return np.diag(sides) + np.array([[0, 0, 0], [xy, 0, 0], [xz, yz, 0]])


class SphereColumns(NamedTuple):
    """Columns of n spheres in the order and units of a file.

    number: numbers (n,) of the program. position: (n, 3). radius, mass: (n,). kind: types (n,) that
    choose the law, or None if all spheres are of type 0. body: numbers (n,) of rigid bodies, or
    None if there are none. fixed: held motions (n, 6), or None if all spheres move freely.
    """

    number: Floats
    position: Floats
    radius: Floats
    mass: Floats
    kind: Ints | None = None
    body: Ints | None = None
    fixed: Bools | None = None


@dataclass(frozen=True)
class Packing:
    """The n spheres of a file, in the order of their numbers, in a cell.

    Attributes
    ----------
    name : str
        The file, for messages.
    cell : Cell
        The cell.
    digits : int
        Significant digits of positions and radii as written.
    step : float, m
        Unit of the last of these digits.
    number : ndarray (n,)
        Numbers of the program.
    position : ndarray (n, 3), m
        Centres.
    radius, mass : ndarray (n,), m, kg
        Radii and masses.
    kind : ndarray (n,)
        Types that choose the law.
    body : ndarray (n,)
        Number of the rigid body that a sphere belongs to; below 1 for a single sphere.
    fixed : ndarray of bool (n, 6) or None
        Motions that a sphere cannot make, as in a network.
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
    fixed: Bools | None = None

    @classmethod
    def from_columns(
        cls,
        rows: Rows,
        cell: Cell,
        units: Units,
        columns: SphereColumns,
        digits: int,
        step: float | None = None,
    ) -> Packing:
        """Return the spheres of these rows, in the order of their numbers.

        `step` is the unit of the last digit, in the file's unit of length; by default that of
        `digits` of the positions. Raises InputError for invalid spheres, such as a radius that is
        not positive, and for a sphere number that occurs twice.
        """
        number = rows.to_integers(columns.number, "id")
        order = rows.sort_unique(
            number,
            lambda row: f"sphere {number[row]} again (line {rows.line + row})",
            "write each once, without ghosts or images",
            "id",
        )
        if step is None:
            step = last_digit_unit(columns.position, digits)
        zeros = np.zeros(len(order), int)
        kind = zeros if columns.kind is None else columns.kind
        body = zeros if columns.body is None else columns.body
        packing = cls(
            name=str(rows.path),
            cell=cell,
            digits=digits,
            step=units.length * step,
            number=number[order],
            position=units.length * columns.position[order],
            radius=units.length * columns.radius[order],
            mass=units.mass * columns.mass[order],
            kind=kind[order],
            body=body[order],
            fixed=None if columns.fixed is None else columns.fixed[order],
        )
        packing._check()
        return replace(packing, position=packing._wrap_positions())

    def _wrap_positions(self) -> Floats:
        """Return the positions (n, 3), m, moved into the cell along its periods."""
        low = self.cell.low
        high = self.cell.high
        if self.cell.tilt.any():
            turns = np.floor(self.cell.in_edges(self.position - low)) * self.cell.periodic
            return self.position - turns @ self.cell.edges
        wrapped = low + (self.position - low) % np.where(high > low, high - low, 1.0)
        outside = (self.position < low) | (self.position > high)
        return np.where(self.cell.periodic & outside, wrapped, self.position)

    def _check(self) -> None:
        """Raise InputError for invalid spheres, such as a radius that is not positive."""
        if len(self.position) == 0:
            refuse(self.name, "no_spheres", "no spheres", remedy="dump those of the packing")
        for name, column in (("radius", self.radius), ("mass", self.mass)):
            problem = f"has {name} <= 0"
            self.refuse(column <= 0, "not_positive", problem, "dump spheres alone")
        largest_radius = float(self.radius.max())
        slack = MAX_DISTANCE_OUTSIDE_IN_RADII * largest_radius
        min_period = MIN_PERIOD_IN_DIAMETERS * 2 * largest_radius
        shortest = self.cell.shortest_periods
        for k, axis in enumerate("xyz"):
            low = self.cell.low[k]
            high = self.cell.high[k]
            if not self.cell.periodic[k]:
                place = self.position[:, k]
                outside = (place < low - slack) | (place > high + slack)
                problem = f"lies outside the cell along {axis}"
                remedy = "leave lost spheres out, or mend the bounds"
                self.refuse(outside, "outside_cell", problem, remedy)
            elif not shortest[k] > min_period:
                refuse(
                    self.name,
                    "narrow_cell",
                    f"the period along {axis}, {shortest[k]:.4g} m, is less than two of the "
                    f"largest diameters, {min_period:.4g} m",
                    "images cannot be told apart",
                    "take a wider cell",
                )

    def refuse(self, wrong: Bools, code: str, problem: str, remedy: str) -> None:
        """Raise InputError for the first sphere with `wrong` (n,) True; name its number."""
        if wrong.any():
            sphere = self.number[np.argmax(wrong)]
            refuse(self.name, code, f"sphere {sphere} {problem}", remedy=remedy)

    def between(self, i: Ints, j: Ints) -> ContactList:
        """Return the contacts of i (m,) with the nearest image of j (m,), or with a wall."""
        is_pair = (j >= 0)[:, None]
        branch = self.position[np.maximum(j, 0)] - self.position[i]
        shift = self.cell.nearest_shift(branch)
        ends = (i, j, np.where(is_pair, shift, 0).astype(np.int32))
        planes = np.array(self.cell.planes)
        with np.errstate(invalid="ignore"):  # two in one place are refused later
            return between(ends, self.position, self.cell.periods, planes, self.radius)

    def distance_error(self, shift: Ints) -> Floats:
        """Return the errors (m,), m, of contact distances that the digits of positions cause.

        `shift` (m, 3) are the periods that the contacts cross.

        The errors are root mean squares; for a contact through a period they include the digits of
        the two bounds.
        """
        from_bounds = np.where(shift == 0, 0.0, self.cell.rounding).max(axis=1, initial=0.0)
        return np.hypot(self.step, from_bounds) / np.sqrt(6)

    def split_forces(self, i: Ints, j: Ints, force: Floats) -> tuple[Floats, Floats]:
        """Split forces (m, 3), N, on spheres i into normal forces (m,) and shear forces (m, 3).

        Compression is positive.
        """
        normal = self.between(i, j).normal
        normal_force = -(force * normal).sum(axis=1)
        return normal_force, force + normal_force[:, None] * normal

    def reach(self, i: Ints, j: Ints) -> tuple[Floats, Floats]:
        """Return the sums of radii (m,) and the effective radii (m,), m, of pairs.

        At a wall both are the sphere's radius.
        """
        radius_i = self.radius[i]
        radius_j = self.radius[np.maximum(j, 0)]
        at_wall = j < 0
        total = np.where(at_wall, radius_i, radius_i + radius_j)
        effective = np.where(at_wall, radius_i, radius_i * radius_j / (radius_i + radius_j))
        return total, effective

    def touching(self) -> Contacts:
        """Return all contacts: spheres that overlap, also through periods, or overlap walls."""
        low = np.where(self.cell.periodic, self.cell.low, self.position.min(axis=0))
        walls = np.array(self.cell.walls)
        with np.errstate(invalid="ignore", divide="ignore"):  # two in one place are refused later
            contacts = touching(self.position, low, self.cell.periods, walls, self.radius)
        return Contacts(contacts.particle_i, contacts.particle_j)


@dataclass(frozen=True)
class Contacts:
    """The m contacts of a packing.

    Attributes
    ----------
    i, j : ndarray (m,)
        Indices of the spheres; j may be the code of a wall. The contact is with the nearest image
        of j.
    force : ndarray (m,), N, or None
        Normal forces, compression positive; NaN for a force that follows from the law. None if no
        force is known.
    shear : ndarray (m, 3), N, or None
        Shear forces on i.
    line : ndarray (m, 3) or None
        Vectors along the normals, of either sign and any length, where they are known better than
        from rounded positions.
    columns : mapping
        Columns (m,) of a network by name, for a table that has the stiffnesses, so that no law is
        needed.
    listed : Rows or None
        Rows of the file that lists the first of these contacts, for messages.
    """

    i: Ints
    j: Ints
    force: Floats | None = None
    shear: Floats | None = None
    line: Floats | None = None
    columns: Mapping[str, Floats] = field(default_factory=dict)
    listed: Rows | None = None

    def select(self, selected: Bools) -> Contacts:
        """Return the `selected` (m,) contacts, in their order, without rows of the file."""
        return Contacts(
            i=self.i[selected],
            j=self.j[selected],
            force=None if self.force is None else self.force[selected],
            shear=None if self.shear is None else self.shear[selected],
            line=None if self.line is None else self.line[selected],
            columns={name: column[selected] for name, column in self.columns.items()},
        )

    def with_walls(self, i: Ints, j: Ints, force: Floats, shear: Floats | None) -> Contacts:
        """Return these contacts, followed by k contacts with walls.

        The arguments are as in `Contacts`. Without shear forces at the walls the result has no
        shear forces at all.
        """
        along_z = np.tile([0.0, 0.0, 1.0], (len(i), 1))
        return replace(
            self,
            i=np.concatenate([self.i, i]),
            j=np.concatenate([self.j, j]),
            force=_join(self.force, force),
            shear=_join(self.shear, shear),
            line=_join(self.line, along_z),
        )

    def refuse(
        self, wrong: Bools, code: str, problem: Callable[[int], str], remedy: str, name: str
    ) -> None:
        """Raise InputError for the first contact where `wrong` (m,) is True.

        `problem` is a function of the contact's index. The message begins with the line of the file
        that lists the contact, or else with `name`.
        """
        if self.listed is not None:
            self.listed.refuse(wrong[: len(self.listed.texts)], code, problem, remedy=remedy)
        if wrong.any():
            refuse(name, code, problem(int(np.argmax(wrong))), remedy=remedy)


def _join(first: Floats | None, second: Floats | None) -> Floats | None:
    """Return both arrays as one; None if one of them is absent."""
    if first is None or second is None:
        return None
    return np.concatenate([first, second])


PairLaw = Callable[[int, int], ProgramLaw]
"""Function that returns the law between two types; a negative type is the code of a wall."""


def find_ends(
    rows: Rows, number: Ints, ids: Floats, columns: Sequence[str], codes: Sequence[int] = ()
) -> tuple[Ints, Ints]:
    """Return the indices (m,) of the two ends of each row.

    Parameters
    ----------
    rows : Rows
        The rows of the contacts, for messages.
    number : ndarray (n,)
        Numbers of the spheres, in rising order.
    ids : ndarray (2, m)
        Numbers of the two ends.
    columns : sequence of two str
        Names of the columns of the ends.
    codes : sequence of int
        Codes of walls that may stand for the second end.

    Raises
    ------
    InputError
        For a number that no sphere has, and for a pair that is listed twice; the message has the
        line.
    """
    i = _find_end(rows, number, ids[0], columns[0], ())
    j = _find_end(rows, number, ids[1], columns[1], codes)
    if len(i) == 0:
        problem = "no two spheres touch in it"
        remedy = "dump a packing under stress"
        refuse(rows.path, "no_contacts", problem, remedy=remedy, line=rows.line)
    low = np.minimum(i, j).astype(np.int64)
    high = np.maximum(i, j)
    keys = low * (len(number) - min(WALLS)) + high
    rows.sort_unique(
        keys, lambda row: f"the contact of line {rows.line + row} again", "list each contact once"
    )
    return i, j


def _find_end(rows: Rows, number: Ints, ids: Floats, column: str, codes: Sequence[int]) -> Ints:
    """Return the index (m,) of the sphere with each number, or the code of a wall."""
    whole = rows.to_integers(ids, column)
    index = np.clip(np.searchsorted(number, whole), 0, len(number) - 1)
    is_wall = np.isin(whole, codes)
    rows.refuse(
        (number[index] != whole) & ~is_wall,
        "unknown_sphere",
        lambda row: f"sphere {whole[row]} is not among the spheres",
        remedy="write both files at the same step, of the same spheres",
        column=column,
    )
    return np.where(is_wall, whole, index).astype(np.int32)
