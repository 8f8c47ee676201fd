"""Pairs of points that are near each other, by cells: compiled by numba where it is installed."""

from __future__ import annotations

import numpy as np

from modal.tools.arrays import Floats, Ints
from modal.tools.loops import numba

EMPTY = 100
"""Cells per point above which pairs are not sought by cells."""
_AHEAD = np.array([(c % 3 - 1, c // 3 % 3 - 1, c // 9 - 1) for c in range(13, 27)])
"""Half of the cells around one, itself first: the others have it among theirs."""


def suit_cells(count: int, lengths: Floats, reach: float, whole: bool = False) -> bool:
    """Whether `count` points in a cell of `lengths` (3,) are for `pairs_by_cells`.

    With fewer than three cells across, a cell would be its neighbour on both sides; a few points in
    a wide space would have more cells than memory.
    """
    crowded = lengths.prod() < EMPTY * count * reach**3
    periods = lengths[: 3 if whole else 2]
    return bool(numba is not None and periods.min() >= 3 * reach and crowded)


def _points_by_cells(position, lengths, count):
    """Points (n,) in the order of their cells, and the first of each cell, the end as well."""
    n = len(position)
    cell = np.empty(n, np.int64)
    first = np.zeros(count.prod() + 2, np.int64)
    for i in range(n):
        index = 0
        for axis in range(2, -1, -1):
            at = int(position[i, axis] / lengths[axis] * count[axis])
            index = index * count[axis] + min(max(at, 0), count[axis] - 1)
        cell[i] = index
        first[index + 2] += 1
    first = first.cumsum()
    order = np.empty(n, np.int32)
    for i in range(n):
        order[first[cell[i] + 1]] = i
        first[cell[i] + 1] += 1
    return order, first[:-1]


def _by_first_end(ends, shift, n):
    """The pairs in the order of their first ends; of one first end as they come."""
    place = np.zeros(n + 1, np.int64)
    for i in ends[:, 0]:
        place[i + 1] += 1
    place = place.cumsum()
    sorted_ends, sorted_shift = np.empty_like(ends), np.empty_like(shift)
    for k in range(len(ends)):
        at = place[ends[k, 0]]
        place[ends[k, 0]] = at + 1
        for axis in range(2):
            sorted_ends[at, axis] = ends[k, axis]
        for axis in range(3):
            sorted_shift[at, axis] = shift[k, axis]
    return sorted_ends, sorted_shift


def _pairs_by_cells(position, lengths, reach, whole):
    """Ends (k, 2) and periods (k, 3) of pairs at most `reach` apart, sorted by the first end."""
    n = len(position)
    count = np.maximum(1, (lengths / reach).astype(np.int64))
    order, first = _points_by_cells(position, lengths, count)
    points = position[order]
    ends, shift = np.empty((8 * n, 2), np.int32), np.empty((8 * n, 3), np.int8)
    found = 0
    for here in range(count.prod()):
        x, y, z = here % count[0], here // count[0] % count[1], here // (count[0] * count[1])
        for c in range(14):
            u, v, w = x + _AHEAD[c, 0], y + _AHEAD[c, 1], z + _AHEAD[c, 2]
            up = 1 if w == count[2] else 0
            if up and not whole:
                continue
            # Not by division, which would take half of the time.
            a = -1 if u < 0 else (1 if u == count[0] else 0)
            b = -1 if v < 0 else (1 if v == count[1] else 0)
            w -= up * count[2]
            there = (w * count[1] + v - b * count[1]) * count[0] + u - a * count[0]
            begin, end = first[there], first[there + 1]
            most = found + (first[here + 1] - first[here]) * (end - begin)
            if most > len(ends):
                ends = np.concatenate((ends, np.empty((most, 2), np.int32)))
                shift = np.concatenate((shift, np.empty((most, 3), np.int8)))
            for k in range(first[here], first[here + 1]):
                px = points[k, 0] - a * lengths[0]
                py = points[k, 1] - b * lengths[1]
                pz = points[k, 2] - up * lengths[2]
                for m in range(max(begin, k + 1) if c == 0 else begin, end):
                    dx, dy, dz = points[m, 0] - px, points[m, 1] - py, points[m, 2] - pz
                    # Written and kept or written over: without a branch nothing waits for a guess.
                    ends[found, 0], ends[found, 1] = order[k], order[m]
                    shift[found, 0], shift[found, 1], shift[found, 2] = a, b, up
                    found += dx * dx + dy * dy + dz * dz <= reach * reach
    ends, shift = ends[:found], shift[:found]
    for k in range(found):
        if ends[k, 0] > ends[k, 1]:
            ends[k, 0], ends[k, 1] = ends[k, 1], ends[k, 0]
            for axis in range(3):
                shift[k, axis] = -shift[k, axis]
    return _by_first_end(ends, shift, n)


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
    _points_by_cells = numba.njit(cache=True)(_points_by_cells)
    _by_first_end = numba.njit(cache=True)(_by_first_end)
    _pairs_by_cells = numba.njit(cache=True)(_pairs_by_cells)
