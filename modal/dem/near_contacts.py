"""List contacts that touch or may soon touch: pairs of spheres in reach, and spheres near a wall.

Pairs are found by a grid of cells, compiled by numba where it is installed, else by a tree.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modal.packing.neighbours import periodic_pairs
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Floats, Ints
from modal.tools.loops import by_parts, compiled, compiled_part, fingerprint, numba, prange
from modal.tools.slabs import SLABS

MAX_CELLS_PER_SPHERE = 100
"""Largest number of grid cells for each sphere. If there are more, a tree is used, because the
cells would take more memory than the spheres."""
_NEIGHBOUR_ROWS = np.array([(0, 0), (1, 0), (-1, 1), (0, 1), (1, 1)])
"""Steps along y and z from a row of cells along x to itself and to half of the rows around it. The
pairs with the other half are found from those rows."""
MAX_RUNS = 15
"""Largest number of runs of cells near a cell: five rows, and in each at most three periods."""


def contacts_in_reach(
    position: Floats, lengths: Floats, radius: Floats, skin: float, periodic_z: bool = False
) -> tuple[Ints, Ints]:
    """Return the ends (k, 2) and periods (k, 3) of contacts in reach, sorted by the first end.

    The first end is the lower sphere, the second one a sphere or the code of a wall. Contacts
    across a period along z come last.

    Parameters
    ----------
    position : ndarray (n, 3)
        Centres, m, inside a cell with periods along x and y, and walls at z = 0 and at its upper
        end.
    lengths : ndarray (3,)
        Lengths of the cell, m.
    radius : ndarray (n,)
        m.
    skin : float
        Skin, m: pairs are in reach up to the sum of their radii and twice the skin, spheres and
        walls up to the largest radius and the skin.
    periodic_z : bool, default False
        Whether z is periodic as well, without walls.
    """
    reach = 2 * (float(radius.max()) + skin)
    # With fewer than three cells across, a cell would be its neighbour on both sides.
    periodic_axes = 3 if periodic_z else 2
    wide = lengths[:periodic_axes].min() >= 3 * reach
    crowded = lengths.prod() < MAX_CELLS_PER_SPHERE * len(position) * reach**3
    if numba is not None and crowded and wide:
        ends, shift = _pairs_by_cells(position, lengths, reach, periodic_z)
    else:
        i, j, shift = periodic_pairs(position, lengths[:periodic_axes], reach)
        order = np.argsort(j, kind="stable")
        ends = np.column_stack([i, j])[order].astype(np.int32)
        shift = shift[order].astype(np.int8)
    if radius.min() < radius.max():
        i, j = ends.T
        branch = position[j] - position[i] + shift * lengths
        near = (branch**2).sum(axis=1) <= (radius[i] + radius[j] + 2 * skin) ** 2
        ends = ends[near]
        shift = shift[near]
    if not periodic_z:
        low = np.flatnonzero(position[:, 2] < reach / 2)
        high = np.flatnonzero(lengths[2] - position[:, 2] < reach / 2)
        code = np.repeat((SOURCE_WALL, RECEIVER_WALL), (len(low), len(high)))
        at_walls = np.column_stack([np.concatenate([low, high]), code]).astype(ends.dtype)
        ends = np.concatenate([at_walls, ends])
        shift = np.concatenate([np.zeros((len(at_walls), 3), shift.dtype), shift])
    crosses = shift[:, 2] != 0
    order, _ = _sort_by_key(np.where(crosses, len(position), ends[:, 0]), len(position) + 1)
    return ends.take(order, axis=0), shift.take(order, axis=0)


def _sort_by_key(key, count):
    """Return the rows (n,) sorted by their keys (n,), and the position where each key begins.

    Keys are 0 to `count` - 1; the second array ends with n.
    """
    first = np.zeros(count + 2, np.int64)
    for k in key:
        first[k + 2] += 1
    first = first.cumsum()
    order = np.empty(len(key), np.int32)
    for row in range(len(key)):
        order[first[key[row] + 1]] = row
        first[key[row] + 1] += 1
    return order, first[:-1]


def _list_runs(cell, count, first, periodic_z, runs):
    """Fill `runs` (15, 5) with the runs of points near a cell; return their number.

    The first run contains the cell itself.

    A run is the set of points of a cell and its neighbours in one row along x, which are adjacent
    in memory. Its five numbers are the first point, the end, and the periods (x, y, z) by which its
    cells are displaced. `count` (3,) are the cells along each axis, `first` the first point of each
    cell. Only half of the cells around are listed; the pairs with the other half are found from
    those cells.
    """
    x = cell % count[0]
    y = cell // count[0] % count[1]
    z = cell // (count[0] * count[1])
    n_runs = 0
    for row in range(5):
        row_y = y + _NEIGHBOUR_ROWS[row, 0]
        row_z = z + _NEIGHBOUR_ROWS[row, 1]
        period_y = (row_y >= count[1]) - (row_y < 0)
        period_z = 1 * (row_z == count[2])
        if period_z and not periodic_z:
            continue
        row_index = (row_z - period_z * count[2]) * count[1] + row_y - period_y * count[1]
        first_cell = row_index * count[0]
        # In the row of the cell itself only the cell to the right counts.
        back = 1 * (row > 0)
        for period_x in range(-1 * (x < back), 1 + (x + 1 == count[0])):
            low = max(x - back - period_x * count[0], 0)
            high = min(x + 1 - period_x * count[0], count[0] - 1)
            runs[n_runs, 0] = first[first_cell + low]
            runs[n_runs, 1] = first[first_cell + high + 1]
            runs[n_runs, 2] = period_x
            runs[n_runs, 3] = period_y
            runs[n_runs, 4] = period_z
            n_runs += 1
    return n_runs


class Grid(NamedTuple):
    """Points (n, 3), m, sorted by their cells (n,), with the sphere of each in `order` (n,).

    first: the first point of each cell. cells: their numbers along each axis. lengths: the size of
    the box, m. reach: the largest distance of a pair, m. periodic_z: whether the box has a period
    along z.
    """

    points: Floats
    cell: Ints
    order: Ints
    first: Ints
    cells: Ints
    lengths: Floats
    reach: float
    periodic_z: bool


def _list_pairs_of_part(begin, end, grid, ends, shift):
    """Write pairs of points `begin` to `end` - 1 into `ends` and `shift`; return their number.

    If `ends` has no rows, return an upper bound of the number instead.
    """
    points, cell, order, first, count, lengths, reach, periodic_z = grid
    runs = np.empty((MAX_RUNS, 5), np.int64)
    n_runs = 0
    runs_of_cell = -1
    square = reach * reach
    n_pairs = np.uint64(0)
    for k in range(begin, end):
        if cell[k] != runs_of_cell:
            runs_of_cell = cell[k]
            n_runs = _list_runs(runs_of_cell, count, first, periodic_z, runs)
        for run in range(n_runs):
            start = runs[run, 0] if run else k + 1
            stop = runs[run, 1]
            if len(ends) == 0:
                n_pairs += np.uint64(max(stop - start, 0))
                continue
            period_x = runs[run, 2]
            period_y = runs[run, 3]
            period_z = runs[run, 4]
            pairs_before = n_pairs
            px = points[k, 0] - period_x * lengths[0]
            py = points[k, 1] - period_y * lengths[1]
            pz = points[k, 2] - period_z * lengths[2]
            # Numbers without sign: for others numba looks whether they count from the end.
            for m in range(np.uint64(start), np.uint64(stop)):
                dx = points[m, 0] - px
                dy = points[m, 1] - py
                dz = points[m, 2] - pz
                # Written and kept or written over: no branch that a processor guesses wrongly.
                ends[n_pairs, 1] = m
                n_pairs += np.uint64(dx * dx + dy * dy + dz * dz <= square)
            for pair in range(pairs_before, n_pairs):
                i = order[k]
                j = order[ends[pair, 1]]
                sign = 1 - 2 * (i > j)
                ends[pair, 0] = min(i, j)
                ends[pair, 1] = max(i, j)
                shift[pair, 0] = sign * period_x
                shift[pair, 1] = sign * period_y
                shift[pair, 2] = sign * period_z
    return n_pairs


def _pairs_by_cells(position, lengths, reach, periodic_z):
    """Return ends and periods of pairs at most `reach`, m, apart, by cells at least as wide."""
    n = len(position)
    count = np.maximum(1, (lengths / reach).astype(np.int64))
    cell = np.zeros(n, np.int64)
    for i in range(n):
        for axis in range(2, -1, -1):
            along = int(position[i, axis] / lengths[axis] * count[axis])
            cell[i] = cell[i] * count[axis] + min(max(along, 0), count[axis] - 1)
    order, first = _sort_by_key(cell, count.prod())
    points = position[order]
    cell_of_point = cell[order]
    bounds = np.arange(SLABS + 1) * n // SLABS
    max_pairs = np.zeros(SLABS + 1, np.int64)
    n_pairs = np.zeros(SLABS, np.int64)
    no_ends = np.empty((0, 2), np.int32)
    no_shift = np.empty((0, 3), np.int8)
    for part in prange(SLABS):
        # A loop over threads takes no named tuple: it makes its own.
        grid = Grid(points, cell_of_point, order, first, count, lengths, reach, periodic_z)
        max_pairs[part + 1] = _list_pairs_of_part(
            bounds[part], bounds[part + 1], grid, no_ends, no_shift
        )
    room = max_pairs.cumsum()
    ends = np.empty((room[-1], 2), np.int32)
    shift = np.empty((room[-1], 3), np.int8)
    for part in prange(SLABS):
        rows = slice(room[part], room[part + 1])
        grid = Grid(points, cell_of_point, order, first, count, lengths, reach, periodic_z)
        n_pairs[part] = _list_pairs_of_part(
            bounds[part], bounds[part + 1], grid, ends[rows], shift[rows]
        )
    total = 0
    for part in range(SLABS):
        # Number by number: slices would take numba five more seconds to compile.
        for pair in range(room[part], room[part] + n_pairs[part]):
            for end in range(2):
                ends[total, end] = ends[pair, end]
            for axis in range(3):
                shift[total, axis] = shift[pair, axis]
            total += 1
    return ends[:total], shift[:total]


def _longest_path_of_part(first, last, part, position, start, stretch, longest):
    """Write the longest path of spheres `first` to `last` - 1 into `longest[part]`."""
    longest_square = 0.0
    for i in range(first, last):
        square = 0.0
        for axis in range(3):
            square += (position[i, axis] - stretch[axis] * start[i, axis]) ** 2
        # NaN stays in sight.
        if longest_square == longest_square and not square <= longest_square:
            longest_square = square
    longest[part] = np.sqrt(longest_square)


def longest_paths_by_arrays(
    position: Floats, start: Floats, stretch: Floats, longest: Floats
) -> None:
    """Fill `longest` (k,), m, with how far spheres have moved from `start` (n, 3), m.

    `stretch` (3,) multiplies the start. The compiled loop writes the longest path of each of k
    parts. The caller takes their maximum with numpy, because the compiled loop would ignore NaN.
    """
    longest[:] = np.sqrt(((position - stretch * start) ** 2).sum(axis=1)).max(initial=0.0)


longest_paths = by_parts(_longest_path_of_part, longest_paths_by_arrays)
if numba is not None:
    from modal.tools.loop_cache import compile_cached

    _sort_by_key = compile_cached(_sort_by_key)
    _list_runs = compiled_part(_list_runs, fingerprint())
    _list_pairs_of_part = compiled_part(_list_pairs_of_part, fingerprint())
    _pairs_by_cells = compiled(_pairs_by_cells, 0, fingerprint())
