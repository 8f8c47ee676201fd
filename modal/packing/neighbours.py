"""Which spheres touch: through the periods of a lateral cell, and the two flat walls."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from modal.packing.columns import PART, RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Array, Bools, Floats, Ints
from modal.tools.workload import refuse_above_memory

SPHERE_BYTES, PAIR_BYTES = 800.0, 150.0
"""Memory for each sphere, and for each pair that is looked at, while contacts are found and
checked, measured."""
WALLS = {SOURCE_WALL: -1, RECEIVER_WALL: 1}
"""The direction along z in which each wall lies."""
CHUNK = 1 << 16
"""Points whose neighbours are sought at a time."""
DECIDES = np.array([10000, 100, 1])
"""Times the periods along x, y, z: the sign of the first that is not 0. No sphere reaches a hundred
images."""


@dataclass
class ContactList:
    """Contacts of spheres in canonical order (i, then j, then shift); see `touching`.

    particle_i, particle_j (m,) with i <= j, or a wall's negative code in j; cell_shift (m, 3)
    periods that are added to j; normal (m, 3) from i towards j or the wall; overlap (m,), m,
    negative across a gap.
    """

    particle_i: Ints
    particle_j: Ints
    cell_shift: Ints
    normal: Floats
    overlap: Floats

    def frames(self) -> Iterator[tuple[slice, Floats, Floats]]:
        """`PART` contacts at a time, as a slice, and their two `tangents`."""
        for first in range(0, len(self.normal), PART):
            part = slice(first, first + PART)
            yield part, *tangents(self.normal[part])

    def along(self, force: Floats) -> Floats:
        """Shape (m, 2): the components of vectors (m, 3) along the two `tangents`."""
        found = np.empty((len(force), 2))
        for part, *frame in self.frames():
            found[part] = np.column_stack([(force[part] * each).sum(axis=1) for each in frame])
        return found


def canonical_order(i: Ints, j: Ints, shift: Array) -> Ints:
    """Shape (m,): the order of contacts by i, then j, then periods."""
    return np.lexsort((*shift.T[::-1], j, i))


def canonical(i: Ints, j: Ints, shift: Array) -> tuple[Ints, Ints, Ints, Array, Bools]:
    """Rows (m,) of contacts in canonical order; their ends and periods; which are turned round.

    The lower-numbered end comes first, a sphere meets its own image on one side only, and a wall is
    behind no period. In place of periods (m, 3) any components (m, k) of directions that tell
    contacts of the same ends apart.
    """
    own = (i == j) & (shift @ DECIDES[: shift.shape[1]] < 0)
    turned = (j >= 0) & ((i > j) | own)
    sign = np.where(j < 0, 0, np.where(turned, -1, 1)).astype(shift.dtype)
    shift = sign[:, None] * shift
    first, second = np.where(turned, j, i), np.where(turned, i, j)
    rows = canonical_order(first, second, shift)
    return rows, first[rows], second[rows], shift[rows], turned[rows]


def refuse_more_than_fit(spheres: int, pairs: float = 0.0) -> None:
    """InputError where finding the contacts of so many would take more than the free memory."""
    refuse_above_memory(
        SPHERE_BYTES * spheres + PAIR_BYTES * pairs,
        f"finding the contacts of {spheres} spheres",
        "take a machine with more, fewer spheres, or less unequal ones",
    )


def periodic_pairs(position: Floats, side: Floats, distance: float) -> tuple[Ints, Ints, Ints]:
    """Pairs (i, j, shift) of points at most `distance` apart, each pair of images once.

    `position` (n, 3) with x and y inside the periodic cell of `side` (2,); of `side` (3,) z too.
    i <= j, and a point meets its own image on one side only.
    """
    whole, n, low = len(side) == 3, len(position), position[:, 2].min(initial=np.inf)
    height = side[2] if whole else max(position[:, 2].max(initial=low) - low, distance)
    near = 4 / 3 * np.pi * distance**3 / (side[0] * side[1] * height)  # of all, about each
    refuse_more_than_fit(n, n**2 / 2 * near)
    place, owner, period = images_within(position, np.asarray(side), distance)
    found: list[tuple[Ints, ...]] = []
    for one, two in _near_pairs(place, distance):
        # Of a pair that is met in several images the one whose lower-numbered end is at home.
        turned = (owner[one] > owner[two]) | ((owner[one] == owner[two]) & (one > two))
        first, second = np.where(turned, two, one), np.where(turned, one, two)
        kept = (first < n) & ((owner[second] != first) | (period[second] @ DECIDES > 0))
        first, second = first[kept], second[kept]
        found.append((first, owner[second], period[second]))
    i, j, shift = (np.concatenate(column) for column in zip(*found, strict=True))
    return i, j, shift


def images_within(position: Floats, side: Floats, distance: float) -> tuple[Floats, Ints, Ints]:
    """Return the points, then their images within `distance` of the cell.

    Shapes (k, 3), and (k,), (k, 3) of whose image each is and of the periods that it was moved by.
    """
    axes = len(side)
    reach = np.ceil(distance / side).astype(int)
    points, owner, period = [position], [np.arange(len(position))], [np.zeros((len(position), 3))]
    for turns in product(*(range(-most, most + 1) for most in reach)):
        if any(turns):
            moved = position[:, :axes] + turns * side
            near = ((moved > -distance) & (moved < side + distance)).all(axis=1)
            points.append(np.column_stack([moved, position[:, axes:]])[near])
            owner.append(np.flatnonzero(near))
            period.append(np.broadcast_to((*turns, 0)[:3], (near.sum(), 3)))
    return np.concatenate(points), np.concatenate(owner), np.concatenate(period).astype(np.int8)


def _near_pairs(points: Floats, distance: float) -> Iterator[tuple[Ints, Ints]]:
    """Pairs of `points` (k, 3) at most `distance` apart, some at a time.

    They stand in rows along x, as high and deep as the distance, and in a row in the order of x.
    """
    low = points.min(axis=0, initial=0.0)
    extent = points.max(axis=0, initial=0.0) - low
    # Wider rows where they would be too many to tell them apart by one number.
    unit = max(distance * (1 + 1e-9), 1e-4 * extent.max())
    apart, most = (points - low) / unit, extent / unit
    row, deep = apart[:, 1:].astype(int), int(most[1]) + 2
    # How far along the rows a point is sought, so that round-off in `place` hides none.
    reach = 1 + 8 * float(np.spacing(most[2] * deep * (most[0] + 4)))
    wide = most[0] + 2 * reach
    place = (row[:, 1] * deep + row[:, 0]) * wide + apart[:, 0]
    order = np.argsort(place, kind="stable")
    place, (x, y, z) = place[order], points[order].T.copy()
    for start in range(0, len(points), CHUNK):
        here: Ints = np.arange(start, min(start + CHUNK, len(points)))
        # Half of the rows about each point; of its own row what comes after it.
        for ahead in (0, 1, deep - 1, deep, deep + 1):
            middle = place[here] + ahead * wide
            low = np.searchsorted(place, middle - reach) if ahead else here + 1
            count = np.searchsorted(place, middle + reach, side="right") - low
            one = np.repeat(here, count)
            two = np.arange(len(one)) + np.repeat(low - np.cumsum(count) + count, count)
            square = (x[one] - x[two]) ** 2 + (y[one] - y[two]) ** 2 + (z[one] - z[two]) ** 2
            near = square <= distance**2
            yield order[one[near]], order[two[near]]


def touching(
    position: Floats, low: Floats, periods: Floats, walls: Floats, radius: float | Floats
) -> ContactList:
    """All overlapping contacts of spheres in a cell, centres inside its periods.

    `periods` (3,), m, which begin at `low` (3,), 0 along an axis without; flat `walls` (2,) at z,
    m, NaN where there is none, and none beside a period along z. `radius` in m, of all spheres, or
    of each (n,).
    """
    each, widest = np.broadcast_to(radius, len(position)), 2 * float(np.max(radius))
    position, walls, whole = position - low, walls - low[2], periods[2] > 0
    # Along an axis without a period images lie beyond the reach of any sphere.
    side = np.where(periods > 0, periods, np.ptp(position, axis=0) + 3 * widest)[: 2 + whole]
    parts = [periodic_pairs(position, side, widest)]
    for wall, z in () if whole else zip(WALLS, walls, strict=True):
        (at,) = np.nonzero(each - WALLS[wall] * (z - position[:, 2]) > 0)
        parts.append((at, np.full(len(at), wall), np.zeros((len(at), 3), np.int8)))
    i, j, shift = (np.concatenate(column) for column in zip(*parts, strict=True))
    del parts
    order = canonical_order(i, j, shift)
    found = between((i[order], j[order], shift[order]), position, side, walls, each)
    if (deep := found.overlap > 0).all():
        return found
    return ContactList(*(data[deep] for data in vars(found).values()))


def between(
    ends: tuple[Ints, ...], position: Floats, side: Floats, walls: Floats, each: Floats
) -> ContactList:
    """Contacts whose `ends`, i, j and periods, are known; `each` (n,) is a sphere's radius, m.

    Millions of contacts: each array is worked on in place.
    """
    i, j, shift = ends
    partner = np.maximum(j, 0)  # a wall's code is no index of a single sphere
    normal = position[partner]
    for axis in range(len(side)):
        normal[:, axis] += shift[:, axis] * side[axis]
    normal -= position[i]
    distance = np.linalg.norm(normal, axis=1)
    distance[j < 0] = 1.0
    normal /= distance[:, None]
    overlap = np.subtract(each[i] + each[partner], distance, out=distance)
    for wall, z in zip(WALLS, walls, strict=True):
        with_wall, direction = j == wall, WALLS[wall]
        normal[with_wall] = 0.0, 0.0, direction
        overlap[with_wall] = each[i[with_wall]] - direction * (z - position[i[with_wall], 2])
    return ContactList(i, j, shift, normal, overlap)


def tangents(normal: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors (m, 3) that form a right-handed frame with each unit `normal` (m, 3)."""
    axis = np.eye(3)[np.argmin(abs(normal), axis=1)]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return first, np.cross(normal, first)
