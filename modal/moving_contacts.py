"""Contacts of spheres that move: the law with its history, in one loop over nearby pairs.

Each motion turns the shear forces with their contacts, lets them grow by ks times the shear
displacement and cuts them at the friction limit: the law of `modal.tangent` with finite
increments. Compiled by numba where it is installed; without it numpy does the same, about ten
times slower.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modal.geometry import periodic_pairs, tangents
from modal.hertz_mindlin import normal_force, stiffness_tangential
from modal.network import RECEIVER_WALL, SOURCE_WALL
from modal.sample import Sample

try:
    import numba
except ImportError:
    numba = None

SKIN = 0.02
"""Reach of the list of pairs beyond touch, diameters: it holds while no sphere has gone by half."""


def _numbers(i: np.ndarray, j: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """One number for each contact by its ends and periods."""
    number = i.astype(np.int64)
    # Walls are -1 and -2; periods are small, a sphere reaches few images of another.
    number = (number << 24) + j + 2
    for axis in range(2):
        number = (number << 6) + shift[:, axis].astype(np.int64) + 32
    return number


def _matching(old: np.ndarray, new: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the contacts that are in both, in `old` and in `new`."""
    _, before, after = np.intersect1d(old, new, assume_unique=True, return_indices=True)
    return before, after


def _forces_by_loop(
    position, motion, ends, period, walls, radius, hertz, mindlin, friction, normal, shear, load,
    stiffness,
):  # fmt: skip
    load[:], stiffness[:] = 0, 0
    total, touching, sliding = 0.0, 0, 0
    diameter, of_pair, of_wall = 2 * radius, np.sqrt(radius / 2), np.sqrt(radius)
    for c in range(len(ends)):
        i, j = ends[c, 0], ends[c, 1]
        if j >= 0:
            nx = position[j, 0] + period[c, 0] - position[i, 0]
            ny = position[j, 1] + period[c, 1] - position[i, 1]
            nz = position[j, 2] - position[i, 2]
            square = nx * nx + ny * ny + nz * nz
            overlap = -1.0
            if square < diameter * diameter:
                distance = np.sqrt(square)
                overlap = diameter - distance
                nx, ny, nz = nx / distance, ny / distance, nz / distance
        else:
            nx, ny, nz = 0.0, 0.0, -1.0 if j == -1 else 1.0
            overlap = radius - nz * (walls[0 if j == -1 else 1] - position[i, 2])
        if overlap <= 0:
            normal[c, 0] = normal[c, 1] = normal[c, 2] = 0.0
            shear[c, 0] = shear[c, 1] = shear[c, 2] = 0.0
            continue
        root = (of_pair if j >= 0 else of_wall) * np.sqrt(overlap)
        pressed, ks = hertz * root * overlap, mindlin * root
        lever = radius - overlap / 2
        ux, uy, uz = -motion[i, 0], -motion[i, 1], -motion[i, 2]
        tx, ty, tz = motion[i, 3], motion[i, 4], motion[i, 5]
        if j >= 0:
            ux, uy, uz = ux + motion[j, 0], uy + motion[j, 1], uz + motion[j, 2]
            tx, ty, tz = tx + motion[j, 3], ty + motion[j, 4], tz + motion[j, 5]
        ux += lever * (ny * tz - nz * ty)
        uy += lever * (nz * tx - nx * tz)
        uz += lever * (nx * ty - ny * tx)
        px, py, pz = normal[c, 0], normal[c, 1], normal[c, 2]
        twist = (tx * nx + ty * ny + tz * nz) / 2
        rx = py * nz - pz * ny + twist * nx
        ry = pz * nx - px * nz + twist * ny
        rz = px * ny - py * nx + twist * nz
        ax, ay, az = shear[c, 0], shear[c, 1], shear[c, 2]
        sx = ax + ry * az - rz * ay
        sy = ay + rz * ax - rx * az
        sz = az + rx * ay - ry * ax
        # A contact that has just closed has had no shear displacement.
        if px != 0 or py != 0 or pz != 0:
            sx, sy, sz = sx + ks * ux, sy + ks * uy, sz + ks * uz
        along = sx * nx + sy * ny + sz * nz
        sx, sy, sz = sx - along * nx, sy - along * ny, sz - along * nz
        size, limit = np.sqrt(sx * sx + sy * sy + sz * sz), friction * pressed
        if size > limit:
            cut = limit / size
            sx, sy, sz = cut * sx, cut * sy, cut * sz
            sliding += 1
        normal[c, 0], normal[c, 1], normal[c, 2] = nx, ny, nz
        shear[c, 0], shear[c, 1], shear[c, 2] = sx, sy, sz
        fx, fy, fz = sx - pressed * nx, sy - pressed * ny, sz - pressed * nz
        mx = lever * (ny * sz - nz * sy)
        my = lever * (nz * sx - nx * sz)
        mz = lever * (nx * sy - ny * sx)
        kn = 1.5 * hertz * root
        load[i, 0] += fx
        load[i, 1] += fy
        load[i, 2] += fz
        load[i, 3] += mx
        load[i, 4] += my
        load[i, 5] += mz
        stiffness[i] += kn
        if j >= 0:
            load[j, 0] -= fx
            load[j, 1] -= fy
            load[j, 2] -= fz
            load[j, 3] += mx
            load[j, 4] += my
            load[j, 5] += mz
            stiffness[j] += kn
        total, touching = total + pressed, touching + 1
    return total, touching, sliding


def forces_by_arrays(
    position, motion, ends, period, walls, radius, hertz, mindlin, friction, normal, shear, load,
    stiffness,
):  # fmt: skip
    """The same as the compiled loop; the fallback, and its oracle."""
    i, j = ends.T
    pair = j >= 0
    branch = np.zeros(normal.shape)
    branch[pair] = position[j[pair]] - position[i[pair]]
    branch[pair, :2] += period[pair]
    distance = np.linalg.norm(branch, axis=1)
    overlap = 2 * radius - distance
    direction = np.where(j == SOURCE_WALL, -1.0, 1.0)
    gap = direction * (walls[np.where(j == SOURCE_WALL, 0, 1)] - position[i, 2])
    overlap[~pair] = (radius - gap)[~pair]
    branch[~pair, 2], distance[~pair] = direction[~pair], 1.0
    (near,) = np.nonzero(overlap > 0)
    i, j, pair, overlap = i[near], j[near], pair[near], overlap[near]
    n = branch[near] / distance[near, None]
    root = np.sqrt(np.where(pair, radius / 2, radius) * overlap)
    pressed, lever = hertz * root * overlap, radius - overlap / 2
    of_j = np.where(pair[:, None], motion[j], 0.0)
    turning = motion[i, 3:] + of_j[:, 3:]
    slip = of_j[:, :3] - motion[i, :3] + lever[:, None] * np.cross(n, turning)
    was, force = normal[near], shear[near]
    rotation = np.cross(was, n) + ((turning * n).sum(axis=1) / 2)[:, None] * n
    force = force + np.cross(rotation, force)
    force[was.any(axis=1)] += ((mindlin * root)[:, None] * slip)[was.any(axis=1)]
    force -= (force * n).sum(axis=1)[:, None] * n
    size, limit = np.linalg.norm(force, axis=1), friction * pressed
    sliding = size > limit
    force[sliding] *= (limit[sliding] / size[sliding])[:, None]
    normal[:], shear[:] = 0, 0
    normal[near], shear[near] = n, force
    torque = lever[:, None] * np.cross(n, force)
    on_i = np.column_stack([force - pressed[:, None] * n, torque])
    on_j = np.column_stack([-on_i[:, :3], torque])[pair]
    count = len(position)
    for axis in range(6):
        load[:, axis] = np.bincount(i, on_i[:, axis], count)
        load[:, axis] += np.bincount(j[pair], on_j[:, axis], count)
    kn = 1.5 * hertz * root
    stiffness[:] = np.bincount(i, kn, count) + np.bincount(j[pair], kn[pair], count)
    return pressed.sum(), len(near), int(sliding.sum())


forces_by_loop = numba.njit(cache=True)(_forces_by_loop) if numba else forces_by_arrays


class MovingContacts:
    """The contacts of a sample, kept through its motions.

    After each `move`: load (n, 6), N and N m, the net force and torque on each sphere; stiffness
    (n,), N/m, the sum of its kn; mean_force, N; the numbers touching and sliding. position (n, 3),
    m, is inside the lateral cell whenever pairs were sought. `friction` limits the shear forces,
    the sample's own by default.
    """

    def __init__(self, sample: Sample, friction: float | None = None) -> None:
        network = sample.network()
        n = network.n_particles
        self._sample, self.friction = sample, sample.friction if friction is None else friction
        material = sample.material
        self._moduli = (
            float(normal_force(1.0, 1.0, material)),
            float(stiffness_tangential(1.0, 1.0, material)),
        )
        self.position = sample.position.copy()
        self._seek(
            network.particle_i,
            network.particle_j,
            network.cell_shift,
            network.normal,
            network.force_tangential,
        )
        self.load, self.stiffness = np.zeros((n, 6)), np.zeros(n)
        self.move(np.zeros((n, 6)))

    def _seek(self, i, j, shift, normal, shear) -> None:
        """List the pairs in reach, with the history of those that touch."""
        sample, radius = self._sample, self._sample.radius
        # Spheres that leave the cell come back on the other side; their contacts' periods follow.
        turns = np.floor(self.position[:, :2] / sample.side).astype(int)
        self.position[:, :2] -= turns * sample.side
        shift, pair = shift[:, :2].astype(int), j >= 0
        shift[pair] += turns[j[pair]] - turns[i[pair]]
        old = _numbers(i, j, shift)
        near_i, near_j, period = periodic_pairs(self.position, sample.side, 2 * radius * (1 + SKIN))
        parts = [(near_i, near_j, period[:, :2])]
        away = self.position[:, 2] - sample.walls[0], sample.walls[1] - self.position[:, 2]
        for code, distance in zip((SOURCE_WALL, RECEIVER_WALL), away, strict=True):
            (at,) = np.nonzero(distance < radius * (1 + 2 * SKIN))
            parts.append((at, np.full(len(at), code), np.zeros((len(at), 2), int)))
        i, j, shift = (np.concatenate(column) for column in zip(*parts, strict=True))
        order = np.lexsort((j, i))
        i, j, self._shift = i[order], j[order], shift[order]
        self._ends = np.column_stack([i, j]).astype(np.int32)
        self._period = self._shift * sample.side
        before, after = _matching(old, _numbers(i, j, self._shift))
        self._normal, self._shear = np.zeros((len(i), 3)), np.zeros((len(i), 3))
        self._normal[after], self._shear[after] = normal[before], shear[before]
        self._sought_at = self.position.copy()

    def move(self, motion: np.ndarray) -> None:
        """Move the spheres by `motion` (n, 6), m and rad, by less than `SKIN` diameters at once."""
        self.position += motion[:, :3]
        if abs(self.position - self._sought_at).max() > 0.5 * SKIN * self._sample.radius:
            i, j = self._ends.T.astype(int)
            self._seek(i, j, self._shift, self._normal, self._shear)
        total, self.touching, self.sliding = forces_by_loop(
            self.position,
            motion,
            self._ends,
            self._period,
            self._sample.walls,
            self._sample.radius,
            *self._moduli,
            self.friction,
            self._normal,
            self._shear,
            self.load,
            self.stiffness,
        )
        self.mean_force = total / max(self.touching, 1)

    def sample(self) -> Sample:
        """The sample as it is now, at rest."""
        position = self.position.copy()
        turns = np.floor(position[:, :2] / self._sample.side).astype(int)
        position[:, :2] -= turns * self._sample.side
        bare = replace(
            self._sample,
            position=position,
            shear=None,
            velocity=None,
            angular_velocity=None,
            strain_rate=None,
        )
        contact = bare.contacts()
        i, j = self._ends.T.astype(int)
        shift, pair = self._shift.copy(), j >= 0
        shift[pair] += turns[j[pair]] - turns[i[pair]]
        here = _numbers(contact.particle_i, contact.particle_j, contact.cell_shift)
        before, after = _matching(_numbers(i, j, shift), here)
        force = np.zeros((len(here), 3))
        force[after] = self._shear[before]
        first, second = tangents(contact.normal)
        shear = np.column_stack([(force * first).sum(axis=1), (force * second).sum(axis=1)])
        return replace(bare, shear=shear)
