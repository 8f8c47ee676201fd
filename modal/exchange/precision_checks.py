"""Contacts that cannot be, and what the digits of positions leave of the overlaps.

Where a law makes the stiffnesses of the overlaps, positions must tell these. Where a table tells
the stiffnesses, positions only turn the normals and shorten the levers: rounding is remarked on,
and refused where it turns them far.
"""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from modal.exchange.particles_and_contacts import Cell, Contacts, Spheres, touching_pairs
from modal.exchange.rows import fault
from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError

DROWNED = 1e-3
"""Error of an overlap by the digits of positions, over the median overlap, that is refused."""
BLUNT = 5e-3
"""Angle, rad, by which digits of positions turn the normals of a table, that is refused."""
EXACT = 0.1
"""Of the error by digits: if no overlap is larger, positions are those that few digits hold."""


def _blame(given: Contacts, row: int, name: str, what: str, do: str) -> NoReturn:
    """InputError about a contact, with its line where a file lists it."""
    rows = given.listed
    if rows is None or row >= rows.count:
        raise InputError(f"{name}: {what}; {do}")
    fault(rows.path, what, do, rows.line + row)


def refuse_one_place(given: Contacts, spheres: Spheres, distance: Floats, name: str) -> None:
    """InputError for a contact without a direction: of a sphere with itself, or of one place."""
    wrong = (given.i == given.j) | (distance == 0)
    if not wrong.any():
        return
    row = int(np.argmax(wrong))
    one = spheres.number[given.i[row]]
    if given.i[row] == given.j[row]:
        what = f"a contact of sphere {one} with itself"
        do = "list contacts of different spheres"
    else:
        ends = f"{one} and {spheres.number[given.j[row]]} have their centres in one place"
        what = f"spheres {ends}" if given.j[row] >= 0 else f"sphere {one} has its centre on a wall"
        do = "mend the positions"
    _blame(given, row, name, what, do)


def refuse_apart(given: Contacts, spheres: Spheres, apart: Bools, gap: Floats, name: str) -> None:
    """InputError, with its line, for a contact of bodies that lie `apart`; by a `gap` (m,), m."""
    if not apart.any():
        return
    row = int(np.argmax(apart))
    one, other = (spheres.number[end] for end in (given.i[row], max(given.j[row], 0)))
    ends = f"spheres {one} and {other}" if given.j[row] >= 0 else f"sphere {one} and the wall"
    what = f"{ends} do not touch, there are {gap[row]:.3g} m between them"
    do = "write both at one step, in one unit of length, with the cell's periods and walls"
    _blame(given, row, name, what, do)


def unlisted(given: Contacts, spheres: Spheres, cell: Cell) -> list[str]:
    """A remark on spheres that overlap, by more than rounding, and on which no row tells."""
    near = touching_pairs(spheres, cell, spheres.step)
    n = len(spheres.position) + 2  # with both walls, whose codes are -1 and -2

    def key(contacts: Contacts) -> Ints:
        ends = np.sort(np.column_stack([contacts.i, contacts.j]).astype(np.int64) % n, axis=1)
        return ends[:, 0] * n + ends[:, 1]

    lost = int((~np.isin(key(near), key(given))).sum())
    return [f"{lost} contacts that overlap are not listed: of a group alone, or lost?"] * (lost > 0)


def refuse_drowned(spheres: Spheres, error: float, overlap: Floats, name: str) -> None:
    """InputError where rounding of positions changes overlaps, and with them who touches whom."""
    median = float(np.median(overlap))
    if error <= DROWNED * median:
        return
    largest = float(abs(spheres.position).max())
    needed = int(np.ceil(np.log10(largest / (DROWNED * median)))) + 1
    raise InputError(
        f"{name}: positions have {spheres.digits} digits, or the cell's bounds, steps of "
        f"{spheres.step:.0e} m, where the median overlap is {median:.1e} m; write {needed} digits "
        "or more (17 are all), or give the contacts with their forces"
    )


def digits_of_table(
    spheres: Spheres, error: float, overlap: Floats, distance: Floats, name: str
) -> list[str]:
    """Remarks on overlaps and gaps of contacts whose stiffnesses are told.

    InputError where the digits of positions turn the normals by more than `BLUNT`. Positions may
    have few digits because these are all of them, as in a lattice: then overlaps show no rounding.
    """
    remarks = []
    gap = float(-overlap.min())
    # A distance is rounded by a few of its own last bits, and those of the positions.
    noise = 8 * float(np.spacing(max(distance.max(), abs(spheres.position).max())))
    if gap > noise:
        remarks.append(
            f"{int((overlap < -noise).sum())} of {len(overlap)} listed contacts have gaps, up to "
            f"{gap:.2g} m: kept, as each row of the table is a contact"
        )
    median = float(np.median(overlap))
    if error <= DROWNED * median or abs(overlap).max() < EXACT * error:
        return remarks
    angle = error / float(np.median(distance))
    steps = f"{name}: positions have {spheres.digits} digits, steps of {spheres.step:.0e} m"
    if angle > BLUNT:
        raise InputError(f"{steps}, which turn the normals by {angle:.0e} rad; write 17 digits")
    remarks.append(
        f"{steps.removeprefix(f'{name}: ')}: overlaps are known to {error:.0e} m (the median is "
        f"{median:.0e} m), normals to {angle:.0e} rad; write 17 digits"
    )
    return remarks
