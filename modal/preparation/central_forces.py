"""Hertz forces of frictionless equal spheres between two flat walls: one loop over nearby pairs.

Compiled by numba where it is installed; without it numpy does the same, several times slower.
Both return what a minimiser needs: forces, the virial (stress times volume), energy, contacts.
"""

from __future__ import annotations

import numpy as np

from modal.packing.neighbours import periodic_pairs
from modal.packing.sample import Sample

try:
    import numba
except ImportError:
    numba = None

SKIN = 0.1
"""Reach of the list of pairs beyond touch, diameters; a compromise of its length and its life."""
EMPTY = 100
"""Cells per sphere above which pairs are not sought by cells."""
_BESIDE = np.array([(c % 3 - 1, c // 3 % 3 - 1, c // 9 - 1) for c in range(27)])


class NearPairs:
    """Pairs that touch or may soon touch: good until spheres have come closer by the skin.

    The list holds while (D + skin) * s - 2 u >= D, with s the smallest stretch of the cell since
    it was made and u the largest displacement beside that stretch.
    """

    def __init__(self, position: np.ndarray, lengths: np.ndarray, diameter: float) -> None:
        self.diameter = diameter
        self.made_at, self.made_lengths = position.copy(), lengths.copy()
        self.ends, self.shift = pairs_in_reach(position, lengths, (1 + SKIN) * diameter)

    def holds(self, position: np.ndarray, lengths: np.ndarray) -> bool:
        """Whether no pair outside the list can touch at these positions, (n, 3) m."""
        stretch = lengths / self.made_lengths
        moved = position - self.made_at * stretch
        largest = np.sqrt(np.einsum("ij,ij->i", moved, moved).max(initial=0.0))
        return (1 + SKIN) * min(1.0, stretch.min()) - 2 * largest / self.diameter >= 1


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
    return np.column_stack([i, j])[order].astype(np.int32), shift[order, :2].astype(float)


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
    shift = np.empty((8 * n, 2))
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


def _forces_by_loop(position, force, ends, shift, lengths, radius, modulus):
    force[:] = 0
    virial = np.zeros(3)
    energy, total, stiffness, count = 0.0, 0.0, 0.0, 0
    diameter, root = 2 * radius, np.sqrt(radius / 2)
    for c in range(len(ends)):
        i, j = ends[c, 0], ends[c, 1]
        dx = position[j, 0] + shift[c, 0] * lengths[0] - position[i, 0]
        dy = position[j, 1] + shift[c, 1] * lengths[1] - position[i, 1]
        dz = position[j, 2] - position[i, 2]
        square = dx * dx + dy * dy + dz * dz
        if square >= diameter * diameter or square == 0.0:
            continue
        distance = np.sqrt(square)
        overlap = diameter - distance
        half = modulus * root * np.sqrt(overlap)
        normal = half * overlap
        energy += 0.4 * normal * overlap
        total += normal
        stiffness += 1.5 * half
        count += 1
        along = normal / distance
        virial[0] += along * dx * dx
        virial[1] += along * dy * dy
        virial[2] += along * dz * dz
        force[i, 0] -= along * dx
        force[i, 1] -= along * dy
        force[i, 2] -= along * dz
        force[j, 0] += along * dx
        force[j, 1] += along * dy
        force[j, 2] += along * dz
    root = np.sqrt(radius)
    for i in range(len(position)):
        for wall in range(2):
            distance = lengths[2] - position[i, 2] if wall else position[i, 2]
            overlap = radius - distance
            if overlap > 0:
                half = modulus * root * np.sqrt(overlap)
                normal = half * overlap
                energy += 0.4 * normal * overlap
                total += normal
                stiffness += 1.5 * half
                count += 1
                virial[2] += normal * distance
                force[i, 2] += -normal if wall else normal
    return virial, energy, total, stiffness, count


def forces_by_arrays(position, force, ends, shift, lengths, radius, modulus):
    """The same as the compiled loop; the fallback, and its oracle."""
    i, j = ends.T
    branch = position[j] - position[i]
    branch[:, :2] += shift * lengths[:2]
    distance = np.sqrt((branch**2).sum(axis=1))
    near = (distance < 2 * radius) & (distance > 0)
    i, j, branch, distance = i[near], j[near], branch[near], distance[near]
    overlap = 2 * radius - distance
    half = modulus * np.sqrt(radius / 2 * overlap)
    normal = half * overlap
    pull = (normal / distance)[:, None] * branch
    n = len(position)
    for axis in range(3):
        force[:, axis] = np.bincount(j, pull[:, axis], n) - np.bincount(i, pull[:, axis], n)
    virial = (pull * branch).sum(axis=0)
    energy, total, stiffness = 0.4 * normal @ overlap, normal.sum(), 1.5 * half.sum()
    count = len(normal)
    for distance, sign in ((position[:, 2], 1), (lengths[2] - position[:, 2], -1)):
        overlap = np.maximum(radius - distance, 0)
        half = modulus * np.sqrt(radius * overlap)
        normal = half * overlap
        force[:, 2] += sign * normal
        virial[2] += normal @ distance
        energy, total = energy + 0.4 * normal @ overlap, total + normal.sum()
        stiffness, count = stiffness + 1.5 * half.sum(), count + int((overlap > 0).sum())
    return virial, energy, total, stiffness, count


forces_by_loop = numba.njit(cache=True)(_forces_by_loop) if numba else forces_by_arrays


class CentralForces:
    """Forces of a sample whose spheres and lengths move; `of` updates every attribute.

    force (n, 3), N; virial (3,), N m, the stresses times the volume; energy, J; mean_force, N, and
    mean_stiffness, N/m, of the `contacts` present.
    """

    def __init__(self, sample: Sample) -> None:
        self.radius = sample.radius
        self.modulus = 4 / 3 * sample.material.effective_young
        self.force = np.zeros(sample.position.shape)
        self.rebuilt = 0
        self._pairs: NearPairs | None = None

    def of(self, position: np.ndarray, lengths: np.ndarray) -> CentralForces:
        """At `position` (n, 3), m; x and y are brought back into the cell when pairs are sought.

        lengths (3,), m: lateral periods and the distance of the walls, the lower one at z = 0.
        """
        if self._pairs is None or not self._pairs.holds(position, lengths):
            position[:, :2] %= lengths[:2]
            self._pairs = NearPairs(position, lengths, 2 * self.radius)
            self.rebuilt += 1
        self.virial, self.energy, total, stiffness, self.contacts = forces_by_loop(
            position,
            self.force,
            self._pairs.ends,
            self._pairs.shift,
            lengths,
            self.radius,
            self.modulus,
        )
        self.mean_force = total / max(self.contacts, 1)
        self.mean_stiffness = stiffness / max(self.contacts, 1)
        return self

    @property
    def residual(self) -> float:
        """Mean net force on a sphere over the mean contact force; infinite without contacts."""
        if self.contacts == 0:
            return np.inf
        return float(np.sqrt((self.force**2).sum(axis=1)).mean() / self.mean_force)
