"""Contacts that cannot be, and what the digits of positions leave of the overlaps.

Where a law makes the stiffnesses of the overlaps, positions must tell these. Where a table tells
the stiffnesses, positions only turn the normals and shorten the levers: rounding is remarked on,
and refused where it turns them far.
"""

from __future__ import annotations

import numpy as np

from modal.exchange.particles_and_contacts import Contacts, Packing, pair_keys
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError

DROWNED = 1e-3
"""Error of an overlap by the digits of positions, over the median overlap, that is refused."""
BLUNT = 5e-3
"""Angle, rad, by which digits of positions turn the normals of a table, that is refused."""
EXACT = 0.1
"""Of the error by digits: if no overlap is larger, positions are those that few digits hold."""


def refuse_impossible(
    given: Contacts, packing: Packing, apart: Bools, distance: Floats, gap: Floats
) -> None:
    """InputError, with its line, for a contact of one place, or of bodies that lie `apart`.

    By a `gap` (m,), m.
    """

    def ends(row: int) -> str:
        one, other = (packing.number[end] for end in (given.i[row], max(given.j[row], 0)))
        return f"spheres {one} and {other}" if given.j[row] >= 0 else f"sphere {one} and the wall"

    do = "mend the positions, or the numbers of the two"
    given.refuse(distance == 0, lambda row: f"{ends(row)} lie in one place", do, packing.name)
    do = "write both at one step, in one unit of length, with the cell's periods and walls"
    given.refuse(
        apart,
        lambda row: f"{ends(row)} do not touch, there are {gap[row]:.3g} m between them",
        do,
        packing.name,
    )


def unlisted(given: Contacts, packing: Packing) -> list[str]:
    """A remark on spheres that overlap, by more than rounding, and on which no row tells."""
    near, n = packing.touching(packing.step), len(packing.position)
    there = np.isin(pair_keys(near.i, near.j, n), pair_keys(given.i, given.j, n))
    lost = int((~there).sum())
    return [f"{lost} contacts that overlap are not listed: of a group alone, or lost?"] * (lost > 0)


def refuse_drowned(packing: Packing, error: float, overlap: Floats) -> None:
    """InputError where rounding of positions changes overlaps, and with them who touches whom."""
    median = float(np.median(overlap))
    if error <= DROWNED * median:
        return
    largest = float(abs(packing.position).max())
    needed = int(np.ceil(np.log10(largest / (DROWNED * median)))) + 1
    raise InputError(
        f"{packing.name}: positions have {packing.digits} digits, or the cell's bounds, steps of "
        f"{packing.step:.0e} m, where the median overlap is {median:.1e} m; write {needed} digits "
        "or more (17 are all), or give the contacts with their forces"
    )


def digits_of_table(packing: Packing, error: float, overlap: Floats, distance: Floats) -> list[str]:
    """Remarks on overlaps and gaps of contacts whose stiffnesses are told.

    InputError where the digits of positions turn the normals by more than `BLUNT`. Positions may
    have few digits because these are all of them, as in a lattice: then overlaps show no rounding.
    """
    remarks = []
    gap = float(-overlap.min())
    # A distance is rounded by a few of its own last bits, and those of the positions.
    noise = 8 * float(np.spacing(max(distance.max(), abs(packing.position).max())))
    if gap > noise:
        remarks.append(
            f"{int((overlap < -noise).sum())} of {len(overlap)} listed contacts have gaps, up to "
            f"{gap:.2g} m: kept, as each row of the table is a contact"
        )
    median = float(np.median(overlap))
    if error <= DROWNED * median or abs(overlap).max() < EXACT * error:
        return remarks
    angle = error / float(np.median(distance))
    steps = f"positions have {packing.digits} digits, steps of {packing.step:.0e} m"
    if angle > BLUNT:
        raise InputError(
            f"{packing.name}: {steps}, which turn the normals by {angle:.0e} rad; write 17 digits"
        )
    remarks.append(
        f"{steps}: overlaps are known to {error:.0e} m (the median is "
        f"{median:.0e} m), normals to {angle:.0e} rad; write 17 digits"
    )
    return remarks
