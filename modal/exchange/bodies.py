"""A packing as another program tells it: spheres, cell and contacts in SI, and who touches whom."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modal.exchange.program_law import ProgramLaw
from modal.exchange.rows import Rows
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError

NARROW = 2.0
"""A period must exceed this many of the largest diameters, or images are not told apart."""
FAR = 1e9
"""Radii from the origin, beyond which no digit is left for an overlap."""


@dataclass(frozen=True)
class Spheres:
    """n spheres: numbers (n,) of the program, position (n, 3), radius, mass (n,), kind (n,).

    `kind` is the type that chooses the law; `digits` of the positions as they were written, and
    `step` the unit of the last of them, m.
    """

    number: Ints
    position: Floats
    radius: Floats
    mass: Floats
    kind: Ints
    digits: int
    step: float


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

    `force` (m,), compression positive, and `shear` (m, 3) on i, N, or None where not told;
    `digits` of the forces as they were written; `stiffness` the normal and tangential ones (m,),
    N/m, of a table that has them, so that no law is asked; `line` (m, 3) vectors along the normals,
    either way, where they are told better than by rounded positions. `listed` are the rows of the
    file that tells of the first of them, for messages.
    """

    i: Ints
    j: Ints
    force: Floats | None = None
    shear: Floats | None = None
    digits: int = 17
    stiffness: tuple[Floats, Floats] | None = None
    line: Floats | None = None
    listed: Rows | None = None


LawOf = Callable[[int, int], ProgramLaw]
"""The law between two kinds of spheres; between a kind and a wall, whose code is negative."""


def check_spheres(spheres: Spheres, cell: Cell, name: str) -> None:
    """InputError for spheres that no cell can have."""
    n = len(spheres.position)
    far = ~(abs(spheres.position) < FAR * spheres.radius.max(initial=0.0)).all(axis=1)
    if far.any():
        which = spheres.number[int(np.argmax(far))]
        raise InputError(f"{name}: sphere {which} lies {FAR:g} radii away; mend the export")
    if n == 0:
        raise InputError(f"{name}: no spheres; dump those of the packing")
    for what in ("radius", "mass"):
        bad = getattr(spheres, what) <= 0
        if bad.any():
            which = spheres.number[int(np.argmax(bad))]
            raise InputError(f"{name}: sphere {which} has {what} <= 0; dump spheres alone")
    reach = NARROW * 2 * float(spheres.radius.max())
    for axis in range(3):
        size = cell.high[axis] - cell.low[axis]
        if cell.periodic[axis] and not size > reach:
            raise InputError(
                f"{name}: the period along {'xyz'[axis]}, {size:.4g} m, is less than two of the "
                f"largest diameters, {reach:.4g} m: images cannot be told apart; take a wider cell"
            )
        if not cell.periodic[axis]:
            slack = 1e-3 * float(spheres.radius.max())
            x = spheres.position[:, axis]
            out = (x < cell.low[axis] - slack) | (x > cell.high[axis] + slack)
            if out.any():
                which = spheres.number[int(np.argmax(out))]
                raise InputError(
                    f"{name}: sphere {which} lies outside the cell along {'xyz'[axis]}; leave lost "
                    "spheres out, or mend the bounds"
                )


def nearest(branch: Floats, cell: Cell) -> tuple[Floats, Ints]:
    """A branch (m, 3) through the nearest images, and the periods (m, 3) that are added to j."""
    size = np.where(cell.periodic, cell.high - cell.low, np.inf)
    shift = -np.round(branch / size).astype(np.int32)
    period = np.where(cell.periodic, cell.high - cell.low, 0.0)
    return branch + shift * period, shift


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
    near = (branch**2).sum(axis=1) < reach**2
    ends = [(i[near], j[near])]
    z = spheres.position[:, 2]
    for code, wall, side in ((SOURCE_WALL, cell.walls[0], 1), (RECEIVER_WALL, cell.walls[1], -1)):
        (at,) = np.nonzero(side * (z - wall) < spheres.radius - least)  # NaN: no wall, none
        ends.append((at, np.full(len(at), code)))
    i, j = (np.concatenate(column) for column in zip(*ends, strict=True))
    order = np.lexsort((j, i))
    return Contacts(i[order], j[order])
