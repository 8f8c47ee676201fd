"""Which equal spheres touch: through the periods of a lateral cell, and the two flat walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.formats.arrays import Array, Floats, Ints
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL


@dataclass
class Touching:
    """Contacts of equal spheres in canonical order (i, then j, then shift); see `touching`.

    particle_i, particle_j (m,) with i <= j, or a wall's negative code in j; cell_shift (m, 3)
    periods that are added to j; normal (m, 3) from i towards j or the wall; overlap (m,), m.
    """

    particle_i: Ints
    particle_j: Ints
    cell_shift: Ints
    normal: Floats
    overlap: Floats


def canonical_order(i: Ints, j: Ints, shift: Ints) -> Ints:
    """Shape (m,): the order of contacts by i, then j, then periods."""
    return np.lexsort((shift[:, 2], shift[:, 1], shift[:, 0], j, i))


def periodic_pairs(position: Floats, side: Floats, distance: float) -> tuple[Ints, Ints, Ints]:
    """Pairs (i, j, shift) of points at most `distance` apart, each pair of images once.

    `position` (n, 3) with x and y inside the periodic cell of `side` (2,); z is not periodic.
    Found with a k-d tree over the points and those images that lie within `distance` of the cell;
    i <= j, and a point meets its own image on one side only.
    """
    from scipy.spatial import cKDTree  # the DEM program's own Python may lack scipy

    reach = np.ceil(distance / np.asarray(side)).astype(int)
    points, owner, period = [position], [np.arange(len(position))], [np.zeros((len(position), 2))]
    for a in range(-reach[0], reach[0] + 1):
        for b in range(-reach[1], reach[1] + 1):
            if (a, b) == (0, 0):
                continue
            moved = position[:, :2] + (a * side[0], b * side[1])
            near = ((moved > -distance) & (moved < np.asarray(side) + distance)).all(axis=1)
            points.append(np.column_stack([moved[near], position[near, 2]]))
            owner.append(np.flatnonzero(near))
            period.append(np.broadcast_to((a, b), (near.sum(), 2)))
    images, owners = np.concatenate(points), np.concatenate(owner)
    periods = np.concatenate(period).astype(int)
    pairs = cKDTree(images).query_pairs(distance, output_type="ndarray")
    # The tree sees each pair of nearby images several times; keep the copy whose lower-numbered
    # particle is the original.
    first, second = pairs.T
    swap = (owners[first] > owners[second]) | ((owners[first] == owners[second]) & (first > second))
    first, second = np.where(swap, second, first), np.where(swap, first, second)
    original = first < len(position)
    first, second = first[original], second[original]
    shift = np.column_stack([periods[second], np.zeros(len(second), int)])
    own = owners[second] == first
    upward = (shift[:, 0] > 0) | ((shift[:, 0] == 0) & (shift[:, 1] > 0))
    keep = ~own | upward
    return first[keep], owners[second][keep], shift[keep]


def touching(position: Floats, side: Floats, walls: Floats, radius: float) -> Touching:
    """All overlapping contacts of equal spheres between flat walls at z = `walls` (2,), m."""
    i, j, shift = periodic_pairs(position, side, 2 * radius)
    period = np.array([side[0], side[1], 0.0])
    branch = position[j] + shift * period - position[i]
    distance = np.linalg.norm(branch, axis=1)
    parts: list[tuple[Array, ...]]
    parts = [(i, j, shift, branch / distance[:, None], 2 * radius - distance)]
    for wall, z, direction in ((SOURCE_WALL, walls[0], -1), (RECEIVER_WALL, walls[1], 1)):
        overlap = radius - direction * (z - position[:, 2])
        (at,) = np.nonzero(overlap > 0)
        normal = np.broadcast_to((0.0, 0.0, float(direction)), (len(at), 3))
        code = np.full(len(at), wall)
        parts.append((at, code, np.zeros((len(at), 3), int), normal, overlap[at]))
    i, j, shift, normal, overlap = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = canonical_order(i, j, shift)
    order = order[overlap[order] > 0]
    return Touching(i[order], j[order], shift[order], normal[order], overlap[order])


def tangents(normal: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors (m, 3) that form a right-handed frame with each unit `normal` (m, 3)."""
    axis = np.eye(3)[np.argmin(abs(normal), axis=1)]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return first, np.cross(normal, first)
