"""Find contacts of spheres: in a periodic cell, and with two flat walls."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from modal.packing.columns import PART, RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Array, Bools, Floats, Ints
from modal.tools.workload import refuse_above_memory

BYTES_PER_SPHERE = 800.0
"""Memory for each sphere while contacts are found and checked, bytes, as measured."""
BYTES_PER_PAIR = 150.0
"""Memory for each pair within reach while contacts are found and checked, bytes, as measured."""
WALL_DIRECTIONS = {SOURCE_WALL: -1, RECEIVER_WALL: 1}
"""Direction along z in which each wall lies."""
POINTS_PER_PART = 1 << 16
"""Number of points whose neighbours are sought together, which bounds the memory."""
SIGN_WEIGHTS = np.array([10000, 100, 1])
"""Weights of the periods along x, y, z. The weighted sum has the sign of the first period that is
not 0, because no contact crosses a hundred periods."""


@dataclass
class ContactList:
    """Contacts of spheres, sorted by i, then j, then shift, as `touching` returns them.

    Attributes
    ----------
    particle_i, particle_j : ndarray of int (m,)
        Ends with i <= j, or the negative code of a wall in j.
    cell_shift : ndarray of int (m, 3)
        Periods that are added to the position of j.
    normal : ndarray (m, 3)
        Unit vectors from i towards j or the wall.
    overlap : ndarray (m,)
        Overlaps, m, negative across a gap.
    """

    particle_i: Ints
    particle_j: Ints
    cell_shift: Ints
    normal: Floats
    overlap: Floats

    def some(self, selection: Bools) -> "ContactList":
        """Return the selected contacts; `selection` is (m,)."""
        return ContactList(*(data[selection] for data in vars(self).values()))

    @property
    def keys(self) -> Ints:
        """Return the `contact_keys` (m,)."""
        return contact_keys(self.particle_i, self.particle_j, self.cell_shift)

    def frames(self) -> Iterator[tuple[slice, Floats, Floats]]:
        """Yield slices of `PART` contacts, each with the two `tangents` of these contacts."""
        for first in range(0, len(self.normal), PART):
            part = slice(first, first + PART)
            yield part, *tangents(self.normal[part])

    def along(self, force: Floats) -> Floats:
        """Return the components (m, 2) of vectors (m, 3) along each contact's `tangents`."""
        components = np.empty((len(force), 2))
        for part, first, second in self.frames():
            components[part, 0] = (force[part] * first).sum(axis=1)
            components[part, 1] = (force[part] * second).sum(axis=1)
        return components


def canonical_order(i: Ints, j: Ints, shift: Array) -> Ints:
    """Return the order (m,) that sorts contacts by i, then j, then periods."""
    return np.lexsort((*shift.T[::-1], j, i))


def canonical(i: Ints, j: Ints, shift: Array) -> tuple[Ints, Ints, Ints, Array, Bools]:
    """Sort contacts into canonical order, each with its lower-numbered end first.

    A contact of a sphere with its own image is listed on one side only, and a contact with a wall
    has no period.

    Parameters
    ----------
    i, j : ndarray of int (m,)
        Ends; j < 0 is a wall.
    shift : ndarray (m, 3)
        Periods, or any components (m, k) of directions that tell contacts of the same ends apart.

    Returns
    -------
    rows, first, second, shift, turned : ndarray (m,), (m,), (m,), (m, k), and (m,) bool
        Row of each sorted contact in the input, its ends and periods, and whether its ends were
        exchanged.
    """
    on_other_side = (i == j) & (shift @ SIGN_WEIGHTS[: shift.shape[1]] < 0)
    turned = (j >= 0) & ((i > j) | on_other_side)
    sign = np.where(j < 0, 0, np.where(turned, -1, 1)).astype(shift.dtype)
    shift = sign[:, None] * shift
    first = np.where(turned, j, i)
    second = np.where(turned, i, j)
    rows = canonical_order(first, second, shift)
    return rows, first[rows], second[rows], shift[rows], turned[rows]


def refuse_more_than_fit(spheres: int, pairs: float = 0.0) -> None:
    """Raise InputError if finding the contacts needs more than the free memory."""
    refuse_above_memory(
        BYTES_PER_SPHERE * spheres + BYTES_PER_PAIR * pairs,
        f"finding the contacts of {spheres} spheres",
        "take a machine with more, fewer spheres, or less unequal ones",
    )


def periodic_pairs(position: Floats, side: Floats, distance: float) -> tuple[Ints, Ints, Ints]:
    """Return pairs (i, j, shift) of points at most `distance` apart, one for each image.

    `position` is (n, 3); x and y lie inside the periodic cell of `side` (2,), and z as well if
    `side` is (3,). For a sheared cell `side` has its edges as rows (3, 3). All lengths have the
    same unit. The results are (p,), (p,) and (p, 3) with i <= j. A pair of a point and its own
    image is listed once. Raises InputError if the pairs would not fit into the free memory.
    """
    n = len(position)
    if side.ndim == 2:
        volume = float(np.linalg.det(side))
    elif len(side) == 3:
        volume = float(side.prod())
    else:
        low = position[:, 2].min(initial=np.inf)
        height = max(position[:, 2].max(initial=low) - low, distance)
        volume = float(side.prod()) * height
    share_in_reach = 4 / 3 * np.pi * distance**3 / volume
    refuse_more_than_fit(n, n**2 / 2 * share_in_reach)
    image, original, period = images_within(position, np.asarray(side), distance)
    i_parts: list[Ints] = []
    j_parts: list[Ints] = []
    shift_parts: list[Ints] = []
    for one, two in _near_pairs(image, distance):
        # A pair occurs in several images: take the one whose lower-numbered end is in the cell.
        is_same = original[one] == original[two]
        turned = (original[one] > original[two]) | (is_same & (one > two))
        first = np.where(turned, two, one)
        second = np.where(turned, one, two)
        is_on_one_side = (original[second] != first) | (period[second] @ SIGN_WEIGHTS > 0)
        selected = (first < n) & is_on_one_side
        i_parts.append(first[selected])
        j_parts.append(original[second[selected]])
        shift_parts.append(period[second[selected]])
    return np.concatenate(i_parts), np.concatenate(j_parts), np.concatenate(shift_parts)


def images_within(position: Floats, side: Floats, distance: float) -> tuple[Floats, Ints, Ints]:
    """Return the points and their images within `distance` of the cell.

    The results are the positions (k, 3), those of the points first, the point (k,) of each image,
    and the periods (k, 3) by which it is moved.
    """
    if side.ndim == 2:
        return _images_at_angles(position, side, distance)
    axes = len(side)
    reach = np.ceil(distance / side).astype(int)
    points = [position]
    original = [np.arange(len(position))]
    period = [np.zeros((len(position), 3))]
    for turns in product(*(range(-count, count + 1) for count in reach)):
        if not any(turns):
            continue
        moved = position[:, :axes] + turns * side
        near = ((moved > -distance) & (moved < side + distance)).all(axis=1)
        points.append(np.column_stack([moved, position[:, axes:]])[near])
        original.append(np.flatnonzero(near))
        period.append(np.broadcast_to((*turns, 0)[:3], (near.sum(), 3)))
    periods = np.concatenate(period).astype(np.int8)
    return np.concatenate(points), np.concatenate(original), periods


def _images_at_angles(
    position: Floats, edges: Floats, distance: float
) -> tuple[Floats, Ints, Ints]:
    """Return the images as `images_within` does, for a cell with these `edges` (3, 3), m, as rows.

    An image within `distance` of the cell is within this distance of each of its faces.
    """
    inverse = np.linalg.inv(edges)
    margin = distance * np.linalg.norm(inverse, axis=0)
    place = position @ inverse
    reach = np.ceil(margin).astype(int)
    points = [position]
    original = [np.arange(len(position))]
    period = [np.zeros((len(position), 3), np.int8)]
    for turns in product(*(range(-count, count + 1) for count in reach)):
        if not any(turns):
            continue
        moved = place + turns
        near = np.flatnonzero(((moved > -margin) & (moved < 1 + margin)).all(axis=1))
        points.append(position[near] + turns @ edges)
        original.append(near)
        period.append(np.broadcast_to(np.array(turns, np.int8), (len(near), 3)))
    return np.concatenate(points), np.concatenate(original), np.concatenate(period)


def _near_pairs(points: Floats, distance: float) -> Iterator[tuple[Ints, Ints]]:
    """Yield pairs of `points` (k, 3) at most `distance` apart, as two arrays of indices.

    Points are sorted into rows along x, which are `distance` wide along y and z, and by x within a
    row.
    """
    low = points.min(axis=0, initial=0.0)
    extent = points.max(axis=0, initial=0.0) - low
    # Rows are wider if they would be too many to tell apart by one number.
    unit = max(distance * (1 + 1e-9), 1e-4 * extent.max())
    scaled = (points - low) / unit
    scaled_extent = extent / unit
    row = scaled[:, 1:].astype(int)
    rows_per_layer = int(scaled_extent[1]) + 2
    # Slightly more than one unit, so that round-off in `place` hides no pair.
    reach = 1 + 8 * float(np.spacing(scaled_extent[2] * rows_per_layer * (scaled_extent[0] + 4)))
    row_length = scaled_extent[0] + 2 * reach
    place = (row[:, 1] * rows_per_layer + row[:, 0]) * row_length + scaled[:, 0]
    order = np.argsort(place, kind="stable")
    place = place[order]
    x, y, z = points[order].T.copy()
    # Half of the nine rows around a point; the others have this row among theirs.
    rows_ahead = (0, 1, rows_per_layer - 1, rows_per_layer, rows_per_layer + 1)
    for start in range(0, len(points), POINTS_PER_PART):
        point: Ints = np.arange(start, min(start + POINTS_PER_PART, len(points)))
        for n_rows in rows_ahead:
            middle = place[point] + n_rows * row_length
            # In its own row, a point is paired with those that come after it.
            begin = point + 1
            if n_rows:
                begin = np.searchsorted(place, middle - reach)
            count = np.searchsorted(place, middle + reach, side="right") - begin
            first = np.repeat(point, count)
            # The candidates of a point follow each other from `begin` on.
            earlier_candidates = np.cumsum(count) - count
            second = np.arange(len(first)) + np.repeat(begin - earlier_candidates, count)
            dx = x[first] - x[second]
            dy = y[first] - y[second]
            dz = z[first] - z[second]
            near = dx**2 + dy**2 + dz**2 <= distance**2
            yield order[first[near]], order[second[near]]


def contact_keys(i: Ints, j: Ints, shift: Ints) -> Ints:
    """Return a number for each contact (m,), unique by its ends and periods."""
    key = i.astype(np.int64)
    # Walls are -1 and -2; periods are small, a sphere reaches few images of another.
    key = (key << 22) + j + 2
    for axis in range(3):
        key = (key << 6) + shift[:, axis].astype(np.int64) + 32
    return key


def touching(
    position: Floats,
    low: Floats,
    periods: Floats,
    walls: Floats,
    radius: float | Floats,
    gap: float = 0.0,
) -> ContactList:
    """Find all pairs of spheres that overlap or are less than a gap apart, and those with walls.

    The centres of the spheres lie inside the periods.

    Parameters
    ----------
    position : ndarray (n, 3)
        Centres, m.
    low, periods : ndarray (3,)
        Start and length of the periods, m; length 0 for an axis without a period. For a sheared
        cell `periods` has them as rows (3, 3), with zeros for an axis without a period.
    walls : ndarray (2,)
        Heights z of the flat walls, m; NaN for an absent wall. They are ignored if z is periodic.
    radius : float or ndarray (n,)
        Radius of all spheres, or of each, m.
    gap : float, default 0
        Distance of surfaces below which pairs are listed, m.
    """
    radii = np.broadcast_to(radius, len(position))
    widest = 2 * float(np.max(radius))
    position = position - low
    walls = walls - low[2]
    lengths = np.diag(periods) if periods.ndim == 2 else periods
    whole = lengths[2] > 0
    # Along an axis without a period images lie beyond the reach of any sphere.
    beyond = np.ptp(position, axis=0) + 3 * widest
    side = np.where(lengths > 0, lengths, beyond)[: 2 + whole]
    if periods.ndim == 2:
        side = periods + np.diag(np.where(lengths > 0, 0.0, beyond))
    parts = [periodic_pairs(position, side, widest + gap)]
    if not whole:
        for (wall, direction), z in zip(WALL_DIRECTIONS.items(), walls, strict=True):
            (spheres,) = np.nonzero(radii - direction * (z - position[:, 2]) > -gap)
            no_shift = np.zeros((len(spheres), 3), np.int8)
            parts.append((spheres, np.full(len(spheres), wall), no_shift))
    i, j, shift = (np.concatenate(column) for column in zip(*parts, strict=True))
    del parts  # to save memory
    order = canonical_order(i, j, shift)
    contacts = between((i[order], j[order], shift[order]), position, side, walls, radii)
    is_near = contacts.overlap > -gap
    if is_near.all():
        return contacts
    return contacts.some(is_near)


def between(
    ends: tuple[Ints, ...], position: Floats, side: Floats, walls: Floats, radii: Floats
) -> ContactList:
    """Compute normals and overlaps of contacts whose `ends`, i, j and periods, are known.

    `radii` (n,) are those of the spheres, m. Arrays are changed in place to save memory.
    """
    i, j, shift = ends
    partner = np.maximum(j, 0)  # a wall's code is no index of a single sphere
    normal = position[partner]
    if side.ndim == 2:
        normal += shift @ side
    else:
        for axis in range(len(side)):
            normal[:, axis] += shift[:, axis] * side[axis]
    normal -= position[i]
    distance = np.linalg.norm(normal, axis=1)
    distance[j < 0] = 1.0
    normal /= distance[:, None]
    overlap = np.subtract(radii[i] + radii[partner], distance, out=distance)
    for (wall, direction), z in zip(WALL_DIRECTIONS.items(), walls, strict=True):
        with_wall = j == wall
        normal[with_wall] = 0.0, 0.0, direction
        overlap[with_wall] = radii[i[with_wall]] - direction * (z - position[i[with_wall], 2])
    return ContactList(i, j, shift, normal, overlap)


def tangents(normal: Floats) -> tuple[Floats, Floats]:
    """Return two unit vectors (m, 3) that form a right-handed frame with each `normal` (m, 3)."""
    axis = np.eye(3)[np.argmin(abs(normal), axis=1)]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return first, np.cross(normal, first)
