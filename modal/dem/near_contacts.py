"""Contacts that touch or may soon touch: pairs of spheres in reach, and those near a wall."""

from __future__ import annotations

import numpy as np

from modal.dem.pairs import pairs_by_cells, suit_cells
from modal.packing.neighbours import periodic_pairs
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL


def still_complete(skin: float, stretch: np.ndarray, moved: float, radius: float) -> bool:
    """Whether a list with a reach of 1 + skin diameters has all contacts that can touch.

    Of spheres of several sizes `radius` is the largest, and the list goes that skin beyond each
    pair's own touch, which holds longer than of two of the largest.
    stretch (3,) of the cell since it was made; moved, m, the largest displacement of a sphere
    beside that stretch. Two spheres beyond the reach then are (D + skin D) s - 2 u apart or more,
    and a sphere and a wall half as far.
    """
    return bool((1 + skin) * min(1.0, stretch.min()) - moved / radius >= 1)


def contacts_in_reach(
    position: np.ndarray, lengths: np.ndarray, reach: float, whole: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Ends (k, 2) and periods (k, 3) of the contacts in reach, sorted by the first end.

    Pairs at most `reach`, m, apart, and spheres at most half of it from a wall, whose code is the
    second end. `position` (n, 3) in a cell of `lengths` (3,), x and y periodic, walls at both ends
    of z, the lower one at 0; where `whole` z is periodic as well, without walls.
    """
    ends, shift = pairs_in_reach(position, lengths, reach, whole)
    if whole:
        return ends, shift
    low = np.flatnonzero(position[:, 2] < reach / 2)
    high = np.flatnonzero(lengths[2] - position[:, 2] < reach / 2)
    at = np.concatenate([low, high])
    code = np.repeat((SOURCE_WALL, RECEIVER_WALL), (len(low), len(high)))
    place = np.searchsorted(ends[:, 0], at.astype(ends.dtype))
    ends = np.insert(ends, place, np.column_stack([at, code]), axis=0)
    return ends, np.insert(shift, place, 0, axis=0)


def near_enough(
    contacts: tuple[np.ndarray, np.ndarray],
    position: np.ndarray,
    lengths: np.ndarray,
    radius: np.ndarray,
    skin: float,
) -> tuple[np.ndarray, np.ndarray]:
    """The `contacts` in reach of the largest spheres without what only these could reach across.

    Kept are pairs within the sum of their radii (n,) and twice the `skin`, m; walls are few.
    """
    ends, shift = contacts
    i, j = ends.T
    branch = position[j] - position[i]
    branch += shift * lengths
    reach = radius[i] + radius[j] + 2 * skin
    near = (j < 0) | ((branch**2).sum(axis=1) <= reach**2)
    return ends[near].copy(), shift[near].copy()


def pairs_in_reach(
    position: np.ndarray, lengths: np.ndarray, reach: float, whole: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Ends (k, 2) and periods (k, 3) of pairs at most `reach`, m, apart, first ends sorted.

    `position` (n, 3) in a cell of `lengths` (3,), x and y periodic, z if `whole`; z from 0.
    """
    if suit_cells(len(position), lengths, reach, whole):
        return pairs_by_cells(position, lengths, reach, whole)
    i, j, shift = periodic_pairs(position, lengths if whole else lengths[:2], reach)
    order = np.lexsort((j, i))
    return np.column_stack([i, j])[order].astype(np.int32), shift[order].astype(np.int8)
