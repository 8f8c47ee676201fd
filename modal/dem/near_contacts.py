"""Contacts that touch or may soon touch: pairs of spheres in reach, and those near a wall.

Pairs are sought by cells, compiled by numba where it is installed, else by a tree.
"""

from __future__ import annotations

import numpy as np

from modal.packing.neighbours import periodic_pairs
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Floats, Ints
from modal.tools.loops import by_parts, compiled, compiled_part, fingerprint, numba, prange
from modal.tools.slabs import SLABS

EMPTY = 100
"""Cells per point above which pairs are not sought by cells."""
_ROWS = np.array([(0, 0), (1, 0), (-1, 1), (0, 1), (1, 1)])
"""Rows of cells along x around one, its own first, by their steps along y and z."""


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


def _runs_near(here, count, first, whole, runs):
    """Fill `runs` with those of points near a cell, its own first; how many they are.

    First and end of each, and the periods (x, y, z) that its cells lie off; half of the cells
    around, as the others have this one among theirs. Cells in a row along x hold one run.
    """
    x, y, z = here % count[0], here // count[0] % count[1], here // (count[0] * count[1])
    found = 0
    for row in range(5):
        v, w = y + _ROWS[row, 0], z + _ROWS[row, 1]
        b, up = (v >= count[1]) - (v < 0), 1 * (w == count[2])
        if up and not whole:
            continue
        begin = ((w - up * count[2]) * count[1] + v - b * count[1]) * count[0]
        back = 1 * (row > 0)
        for a in range(-1 * (x < back), 1 + (x + 1 == count[0])):
            low = max(x - back - a * count[0], 0)
            high = min(x + 1 - a * count[0], count[0] - 1)
            runs[found, 0], runs[found, 1] = first[begin + low], first[begin + high + 1]
            runs[found, 2], runs[found, 3], runs[found, 4] = a, b, up
            found += 1
    return found


def _pairs_of_some(
    begin, end, points, cell, order, first, count, lengths, reach, whole, ends, shift
):  # fmt: skip
    """Pairs of the points from `begin` to `end` into `ends`; without room for any, the most."""
    runs, near, here = np.empty((15, 5), np.int64), 0, -1
    square, found = reach * reach, np.uint64(0)
    for k in range(begin, end):
        if cell[k] != here:
            here = cell[k]
            near = _runs_near(here, count, first, whole, runs)
        for run in range(near):
            start, stop = runs[run, 0] if run else k + 1, runs[run, 1]
            if len(ends) == 0:
                found += np.uint64(max(stop - start, 0))
                continue
            a, b, up, before = runs[run, 2], runs[run, 3], runs[run, 4], found
            px = points[k, 0] - a * lengths[0]
            py = points[k, 1] - b * lengths[1]
            pz = points[k, 2] - up * lengths[2]
            # Numbers without sign: for others numba looks whether they count from the end.
            for m in range(np.uint64(start), np.uint64(stop)):
                dx, dy, dz = points[m, 0] - px, points[m, 1] - py, points[m, 2] - pz
                # Written and kept or written over: without a branch nothing waits for a guess.
                ends[found, 1] = m
                found += np.uint64(dx * dx + dy * dy + dz * dz <= square)
            for pair in range(before, found):
                i, j = order[k], order[ends[pair, 1]]
                way = 1 - 2 * (i > j)
                ends[pair, 0], ends[pair, 1] = min(i, j), max(i, j)
                shift[pair, 0], shift[pair, 1], shift[pair, 2] = way * a, way * b, way * up
    return found


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
    near = position[order], cell[order], order, first, count, lengths, reach, whole
    bounds = np.arange(SLABS + 1) * n // SLABS
    most, found = np.zeros(SLABS + 1, np.int64), np.zeros(SLABS, np.int64)
    none, still = np.empty((0, 2), np.int32), np.empty((0, 3), np.int8)
    for part in prange(SLABS):
        most[part + 1] = _pairs_of_some(bounds[part], bounds[part + 1], *near, none, still)
    room = most.cumsum()
    ends, shift = np.empty((room[-1], 2), np.int32), np.empty((room[-1], 3), np.int8)
    for part in prange(SLABS):
        rows = slice(room[part], room[part + 1])
        found[part] = _pairs_of_some(bounds[part], bounds[part + 1], *near, ends[rows], shift[rows])
    kept = 0
    for part in range(SLABS):
        rows = slice(room[part], room[part] + found[part])
        ends[kept : kept + found[part]] = ends[rows]
        shift[kept : kept + found[part]] = shift[rows]
        kept += found[part]
    return ends[:kept], shift[:kept]


def _way_of_some(first, last, part, position, start, stretch, longest):
    most = 0.0
    for i in range(first, last):
        way = 0.0
        for axis in range(3):
            way += (position[i, axis] - stretch[axis] * start[i, axis]) ** 2
        # What is no number stays in sight.
        if most == most and not way <= most:
            most = way
    longest[part] = np.sqrt(most)


def longest_ways_by_arrays(
    position: Floats, start: Floats, stretch: Floats, longest: Floats
) -> None:
    """How far the spheres have gone from `start` (n, 3), stretched (3,), m: into `longest` (k,).

    The compiled loop gives the longest way of each part. The largest of them is for numpy, which
    unlike threads' loops does not pass over what is no number.
    """
    longest[:] = np.sqrt(((position - stretch * start) ** 2).sum(axis=1)).max(initial=0.0)


longest_ways = by_parts(_way_of_some, longest_ways_by_arrays)
if numba is not None:
    from modal.tools.loop_cache import compile_cached

    _sorted_by = compile_cached(_sorted_by)
    _runs_near = compiled_part(_runs_near, fingerprint())
    _pairs_of_some = compiled_part(_pairs_of_some, fingerprint())
    _pairs_by_cells = compiled(_pairs_by_cells, 0, fingerprint())
