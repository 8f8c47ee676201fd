"""Contacts that touch or may soon touch: pairs of spheres in reach, and those near a wall.

Pairs are sought by cells, compiled by numba where it is installed, else by a tree.
"""

from __future__ import annotations

import numpy as np

from modal.packing.neighbours import periodic_pairs
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Floats, Ints
from modal.tools.loops import compiled, compiled_part, fingerprint, numba, prange
from modal.tools.slabs import SLABS

EMPTY = 100
"""Cells per point above which pairs are not sought by cells."""
_AHEAD = np.array([(c % 3 - 1, c // 3 % 3 - 1, c // 9 - 1) for c in range(13, 27)])
"""Half of the cells around one, itself first: the others have it among theirs."""


def contacts_in_reach(
    position: Floats, lengths: Floats, radius: Floats, skin: float, whole: bool = False
) -> tuple[Ints, Ints]:
    """Ends (k, 2) and periods (k, 3) of the contacts in reach, sorted by the first, lower end.

    Pairs no further apart than their radii (n,) and twice the `skin`, m, and spheres near a wall,
    whose code is the second end, within the largest radius and the skin. `position` (n, 3) in a
    cell of `lengths` (3,), x and y periodic, walls at both ends of z, the lower one at 0; where
    `whole` z is periodic as well, without walls.
    """
    reach = 2 * (float(radius.max()) + skin)
    # With fewer than three cells across, a cell would be its neighbour on both sides; a few points
    # in a wide space would have more cells than memory.
    crowded = lengths.prod() < EMPTY * len(position) * reach**3
    wide = lengths[: 3 if whole else 2].min() >= 3 * reach
    if numba is not None and crowded and wide:
        ends, shift = _pairs_by_cells(position, lengths, reach, whole)
    else:
        i, j, shift = periodic_pairs(position, lengths if whole else lengths[:2], reach)
        order = np.argsort(j, kind="stable")
        ends, shift = np.column_stack([i, j])[order].astype(np.int32), shift[order].astype(np.int8)
    if radius.min() < radius.max():
        i, j = ends.T
        branch = position[j] - position[i] + shift * lengths
        near = (branch**2).sum(axis=1) <= (radius[i] + radius[j] + 2 * skin) ** 2
        ends, shift = ends[near], shift[near]
    if not whole:
        low = np.flatnonzero(position[:, 2] < reach / 2)
        high = np.flatnonzero(lengths[2] - position[:, 2] < reach / 2)
        code = np.repeat((SOURCE_WALL, RECEIVER_WALL), (len(low), len(high)))
        walls = np.column_stack([np.concatenate([low, high]), code]).astype(ends.dtype)
        ends = np.concatenate([walls, ends])
        shift = np.concatenate([np.zeros((len(walls), 3), shift.dtype), shift])
    order, _ = _sorted_by(ends[:, 0], len(position))
    return ends.take(order, axis=0), shift.take(order, axis=0)


def _sorted_by(key, count):
    """Rows in the order of their keys (n,), 0 to count - 1; the first of each, the end as well."""
    first = np.zeros(count + 2, np.int64)
    for k in key:
        first[k + 2] += 1
    first = first.cumsum()
    order = np.empty(len(key), np.int32)
    for row in range(len(key)):
        order[first[key[row] + 1]] = row
        first[key[row] + 1] += 1
    return order, first[:-1]


def _pairs_by_cells(position, lengths, reach, whole):
    """Pairs at most `reach`, m, apart, as in `contacts_in_reach`, by cells at least as wide."""
    n = len(position)
    count = np.maximum(1, (lengths / reach).astype(np.int64))
    cell = np.zeros(n, np.int64)
    for i in range(n):
        for axis in range(2, -1, -1):
            at = int(position[i, axis] / lengths[axis] * count[axis])
            cell[i] = cell[i] * count[axis] + min(max(at, 0), count[axis] - 1)
    order, first = _sorted_by(cell, count.prod())
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
                    i, j = order[k], order[m]
                    way = 1 - 2 * (i > j)
                    ends[found, 0], ends[found, 1] = min(i, j), max(i, j)
                    shift[found, 0], shift[found, 1], shift[found, 2] = way * a, way * b, way * up
                    found += dx * dx + dy * dy + dz * dz <= reach * reach
    return ends[:found], shift[:found]


def _way_of_some(first, last, position, start, stretch):
    longest = 0.0
    for i in range(first, last):
        way = 0.0
        for axis in range(3):
            way += (position[i, axis] - stretch[axis] * start[i, axis]) ** 2
        # What is no number stays in sight.
        if longest == longest and not way <= longest:
            longest = way
    return longest


def _longest_ways(position, start, stretch):
    n = len(position)
    longest = np.zeros(SLABS)
    for part in prange(SLABS):
        first, last = part * n // SLABS, (part + 1) * n // SLABS
        longest[part] = _way_of_some(first, last, position, start, stretch)
    return np.sqrt(longest)


def longest_ways_by_arrays(position: Floats, start: Floats, stretch: Floats) -> Floats:
    """How far the spheres have gone from `start` (n, 3), stretched (3,): each, m.

    The compiled loop gives the longest way of each part. The largest of them is for numpy, which
    unlike threads' loops does not pass over what is no number.
    """
    ways: Floats = np.sqrt(((position - stretch * start) ** 2).sum(axis=1))
    return ways


if numba is None:
    longest_ways = longest_ways_by_arrays
else:
    _sorted_by = numba.njit(cache=True)(_sorted_by)
    _pairs_by_cells = numba.njit(cache=True)(_pairs_by_cells)
    _way_of_some = compiled_part(_way_of_some, fingerprint())
    longest_ways = compiled(_longest_ways, 0, fingerprint())
