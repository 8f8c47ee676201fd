"""Contacts that touch or may soon touch: pairs of spheres in reach, and those near a wall."""

from __future__ import annotations

import numpy as np

from modal.packing.neighbours import periodic_pairs
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.preparation.loops import numba

EMPTY = 100
"""Cells per sphere above which pairs are not sought by cells."""
_BESIDE = np.array([(c % 3 - 1, c // 3 % 3 - 1, c // 9 - 1) for c in range(27)])


def still_complete(skin: float, stretch: np.ndarray, moved: float, radius: float) -> bool:
    """Whether a list with a reach of 1 + skin diameters has all contacts that can touch.

    stretch (3,) of the cell since it was made; moved, m, the largest displacement of a sphere
    beside that stretch. Two spheres beyond the reach then are (D + skin D) s - 2 u apart or more,
    and a sphere and a wall half as far.
    """
    return bool((1 + skin) * min(1.0, stretch.min()) - moved / radius >= 1)


def contacts_in_reach(
    position: np.ndarray, lengths: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Ends (k, 2) and lateral periods (k, 2) of the contacts in reach, sorted by the first end.

    Pairs at most `reach`, m, apart, and spheres at most half of it from a wall, whose code is the
    second end. `position` (n, 3) in a cell of `lengths` (3,), x and y periodic, walls at both ends
    of z, the lower one at 0.
    """
    ends, shift = pairs_in_reach(position, lengths, reach)
    low = np.flatnonzero(position[:, 2] < reach / 2)
    high = np.flatnonzero(lengths[2] - position[:, 2] < reach / 2)
    at = np.concatenate([low, high])
    code = np.repeat((SOURCE_WALL, RECEIVER_WALL), (len(low), len(high)))
    place = np.searchsorted(ends[:, 0], at.astype(ends.dtype))
    ends = np.insert(ends, place, np.column_stack([at, code]), axis=0)
    return ends, np.insert(shift, place, 0, axis=0)


def pairs_in_reach(
    position: np.ndarray, lengths: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Ends (k, 2) and lateral periods (k, 2) of pairs at most `reach`, m, apart, first ends sorted.

    `position` (n, 3) in a cell of `lengths` (3,), x and y periodic, z from 0.
    """
    # With fewer than three cells across, a cell would be its neighbour on both sides; a few spheres
    # in a wide space would have more cells than memory.
    crowded = lengths.prod() < EMPTY * len(position) * reach**3
    if numba is not None and lengths[:2].min() >= 3 * reach and crowded:
        return _pairs_by_cells(position, lengths, reach)
    i, j, shift = periodic_pairs(position, lengths[:2], reach)
    order = np.lexsort((j, i))
    return np.column_stack([i, j])[order].astype(np.int32), shift[order, :2].astype(np.int8)


def _pairs_by_cells(position, lengths, reach):
    """Ends (k, 2) and periods (k, 2) of pairs at most `reach` apart, sorted by the first end."""
    n = len(position)
    count = np.maximum(1, (lengths / reach).astype(np.int64))
    cell = np.empty((n, 3), np.int64)
    first = np.full(count.prod(), -1)
    following = np.empty(n, np.int64)
    for i in range(n):
        for axis in range(3):
            at = int(position[i, axis] / lengths[axis] * count[axis])
            cell[i, axis] = min(max(at, 0), count[axis] - 1)
        index = (cell[i, 2] * count[1] + cell[i, 1]) * count[0] + cell[i, 0]
        following[i], first[index] = first[index], i
    ends = np.empty((8 * n, 2), np.int32)
    shift = np.empty((8 * n, 2), np.int8)
    found = 0
    for i in range(n):
        for c in range(27):
            x, y = cell[i, 0] + _BESIDE[c, 0], cell[i, 1] + _BESIDE[c, 1]
            z = cell[i, 2] + _BESIDE[c, 2]
            if z < 0 or z >= count[2]:
                continue
            # Not by division, which would take half of the time.
            a = -1 if x < 0 else (1 if x >= count[0] else 0)
            b = -1 if y < 0 else (1 if y >= count[1] else 0)
            j = first[(z * count[1] + y - b * count[1]) * count[0] + x - a * count[0]]
            # Lists hold falling numbers, so that the first end of a pair is the lower one.
            while j > i:
                dx = position[j, 0] + a * lengths[0] - position[i, 0]
                dy = position[j, 1] + b * lengths[1] - position[i, 1]
                dz = position[j, 2] - position[i, 2]
                if dx * dx + dy * dy + dz * dz <= reach * reach:
                    if found == len(ends):
                        ends = np.concatenate((ends, np.empty_like(ends)))
                        shift = np.concatenate((shift, np.empty_like(shift)))
                    ends[found, 0], ends[found, 1] = i, j
                    shift[found, 0], shift[found, 1] = a, b
                    found += 1
                j = following[j]
    return ends[:found].copy(), shift[:found].copy()


if numba is not None:
    _pairs_by_cells = numba.njit(cache=True)(_pairs_by_cells)
