"""Pairs of points that are near each other, by cells: compiled by numba where it is installed."""

from __future__ import annotations

import numpy as np

from modal.tools.arrays import Floats, Ints
from modal.tools.loops import numba

EMPTY = 100
"""Cells per point above which pairs are not sought by cells."""
_BESIDE = np.array([(c % 3 - 1, c // 3 % 3 - 1, c // 9 - 1) for c in range(27)])


def suit_cells(count: int, lengths: Floats, reach: float, whole: bool = False) -> bool:
    """Whether `count` points in a cell of `lengths` (3,) are for `pairs_by_cells`.

    With fewer than three cells across, a cell would be its neighbour on both sides; a few points in
    a wide space would have more cells than memory.
    """
    crowded = lengths.prod() < EMPTY * count * reach**3
    periods = lengths[: 3 if whole else 2]
    return bool(numba is not None and periods.min() >= 3 * reach and crowded)


def _pairs_by_cells(position, lengths, reach, whole):
    """Ends (k, 2) and periods (k, 3) of pairs at most `reach` apart, sorted by the first end."""
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
    shift = np.empty((8 * n, 3), np.int8)
    found = 0
    for i in range(n):
        for c in range(27):
            x, y = cell[i, 0] + _BESIDE[c, 0], cell[i, 1] + _BESIDE[c, 1]
            z = cell[i, 2] + _BESIDE[c, 2]
            beyond = -1 if z < 0 else (1 if z >= count[2] else 0)
            if beyond != 0 and not whole:
                continue
            # Not by division, which would take half of the time.
            a = -1 if x < 0 else (1 if x >= count[0] else 0)
            b = -1 if y < 0 else (1 if y >= count[1] else 0)
            z -= beyond * count[2]
            j = first[(z * count[1] + y - b * count[1]) * count[0] + x - a * count[0]]
            # Lists hold falling numbers, so that the first end of a pair is the lower one.
            while j > i:
                dx = position[j, 0] + a * lengths[0] - position[i, 0]
                dy = position[j, 1] + b * lengths[1] - position[i, 1]
                dz = position[j, 2] + beyond * lengths[2] - position[i, 2]
                if dx * dx + dy * dy + dz * dz <= reach * reach:
                    if found == len(ends):
                        ends = np.concatenate((ends, np.empty_like(ends)))
                        shift = np.concatenate((shift, np.empty_like(shift)))
                    ends[found, 0], ends[found, 1] = i, j
                    shift[found, 0], shift[found, 1], shift[found, 2] = a, b, beyond
                    found += 1
                j = following[j]
    return ends[:found].copy(), shift[:found].copy()


def pairs_by_cells(
    position: Floats, lengths: Floats, reach: float, whole: bool = False
) -> tuple[Ints, Ints]:
    """Ends (k, 2) int32 and periods (k, 3) int8 of pairs at most `reach` apart, first ends sorted.

    `position` (n, 3) in a cell of `lengths` (3,), x and y periodic, and where `whole` z as well; z
    from 0, as `suit_cells` says.
    """
    ends, shift = _pairs_by_cells(position, lengths, reach, whole)
    return ends, shift


if numba is not None:
    _pairs_by_cells = numba.njit(cache=True)(_pairs_by_cells)
