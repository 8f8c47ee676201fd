"""Forces of contacts with history: Hertz normal to them, Mindlin with friction along them.

A step turns the shear force with its contact and with the spin of its two spheres, lets it grow by
ks times the shear displacement, a contact's first step included, and cuts it at the friction limit.
It is the law of YADE's Mindlin contacts term by term (there `ScGeom` without its variant against
ratcheting, and `Law2_ScGeom_MindlinPhys_Mindlin`), and that of `modal.stiffness.pre_stress` with
finite increments. Compiled by numba where it is installed; without it numpy does the same, about
ten times slower.

Contacts are sorted by their first sphere, and spheres are numbered along z: slabs of contacts, cut
by `slabs_of`, reach their next neighbour at most. The even ones can therefore be worked on at once,
then the odd ones: no two threads add to one sphere, and sums are the same for any number of them.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from types import FunctionType

import numpy as np

from modal.packing.network import SOURCE_WALL

try:
    import numba
except ImportError:
    numba = None
prange = numba.prange if numba else range

ENOUGH = 5000
"""Spheres from which on threads are used."""
SLABS = 16
"""At most so many: more share the work more evenly, fewer leave more to do at once."""
TOTALS = "normal force", "contact force", "touching", "sliding", "virial x", "virial y", "virial z"
"""What the loops return: sums over contacts in N, numbers, and stress times volume in N m."""


def slabs_of(ends: np.ndarray, n: int) -> np.ndarray:
    """First contact of each slab, and the number of contacts; `ends` (m, 2) sorted by the first."""
    starts = np.searchsorted(ends[:, 0], np.arange(n + 1))
    reach = np.arange(n)
    np.maximum.at(reach, ends[:, 0], ends[:, 1])
    reach = np.maximum.accumulate(reach)
    least = -(-n // SLABS)
    bounds = [0, min(least, n)]
    while bounds[-1] < n:
        # What the slab before the last reaches must end where the next one begins.
        bounds.append(min(max(bounds[-1] + least, int(reach[bounds[-1] - 1]) + 1), n))
    return starts[bounds]


def _forces_of_slab(
    first, last, position, motion, dt, ends, shift, side, change, walls, radius, hertz, mindlin,
    friction, normal, shear, load, stiffness, totals,
):  # fmt: skip
    diameter, of_pair, of_wall = 2 * radius, np.sqrt(radius / 2), np.sqrt(radius)
    summed = len(stiffness) > 0
    all_normal = all_contact = 0.0
    along_x = along_y = along_z = 0.0
    touching = sliding = 0
    for c in range(first, last):
        i, j = ends[c, 0], ends[c, 1]
        if j >= 0:
            nx = position[j, 0] - position[i, 0]
            ny = position[j, 1] - position[i, 1]
            nz = position[j, 2] - position[i, 2]
            a, b = shift[c, 0], shift[c, 1]
            if a != 0:
                nx += a * side[0]
            if b != 0:
                ny += b * side[1]
            square = nx * nx + ny * ny + nz * nz
            overlap = distance = 0.0
            if square < diameter * diameter:
                distance = np.sqrt(square)
                overlap = diameter - distance
                inverse = 1 / distance
                nx, ny, nz = nx * inverse, ny * inverse, nz * inverse
        else:
            a = b = 0
            nx, ny, nz = 0.0, 0.0, -1.0 if j == SOURCE_WALL else 1.0
            distance = nz * (walls[0 if j == SOURCE_WALL else 1] - position[i, 2])
            overlap = radius - distance
        px, py, pz = normal[c, 0], normal[c, 1], normal[c, 2]
        before = px != 0 or py != 0 or pz != 0
        if overlap <= 0:
            if before:
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
        ux = (ux + lever * (ny * tz - nz * ty)) * dt
        uy = (uy + lever * (nz * tx - nx * tz)) * dt
        uz = (uz + lever * (nx * ty - ny * tx)) * dt
        if a != 0:
            ux += a * change[0]
        if b != 0:
            uy += b * change[1]
        sx = sy = sz = 0.0
        if before:
            ax, ay, az = shear[c, 0], shear[c, 1], shear[c, 2]
            # s + (p x n) x s, then + (turn p) x s: the new normal n, the one before p.
            ahead, behind = ax * nx + ay * ny + az * nz, ax * px + ay * py + az * pz
            sx = ax + nx * behind - px * ahead
            sy = ay + ny * behind - py * ahead
            sz = az + nz * behind - pz * ahead
            turn = 0.5 * dt * (px * tx + py * ty + pz * tz)
            ax, ay, az = sx, sy, sz
            sx += turn * (py * az - pz * ay)
            sy += turn * (pz * ax - px * az)
            sz += turn * (px * ay - py * ax)
        along = ux * nx + uy * ny + uz * nz
        sx += ks * (ux - along * nx)
        sy += ks * (uy - along * ny)
        sz += ks * (uz - along * nz)
        square, limit = sx * sx + sy * sy + sz * sz, friction * pressed
        if square > limit * limit:
            cut = limit / np.sqrt(square)
            sx, sy, sz = cut * sx, cut * sy, cut * sz
            sliding += 1
        normal[c, 0], normal[c, 1], normal[c, 2] = nx, ny, nz
        shear[c, 0], shear[c, 1], shear[c, 2] = sx, sy, sz
        fx, fy, fz = sx - pressed * nx, sy - pressed * ny, sz - pressed * nz
        mx = lever * (ny * sz - nz * sy)
        my = lever * (nz * sx - nx * sz)
        mz = lever * (nx * sy - ny * sx)
        load[i, 0] += fx
        load[i, 1] += fy
        load[i, 2] += fz
        load[i, 3] += mx
        load[i, 4] += my
        load[i, 5] += mz
        if j >= 0:
            load[j, 0] -= fx
            load[j, 1] -= fy
            load[j, 2] -= fz
            load[j, 3] += mx
            load[j, 4] += my
            load[j, 5] += mz
        if summed:
            kn = 1.5 * hertz * root
            stiffness[i] += kn
            if j >= 0:
                stiffness[j] += kn
        all_normal += pressed
        all_contact += np.sqrt(fx * fx + fy * fy + fz * fz)
        along_x -= distance * fx * nx
        along_y -= distance * fy * ny
        along_z -= distance * fz * nz
        touching += 1
    totals[0], totals[1], totals[2], totals[3] = all_normal, all_contact, touching, sliding
    totals[4], totals[5], totals[6] = along_x, along_y, along_z


def _forces_by_slabs(
    slabs, position, motion, dt, ends, shift, side, change, walls, radius, hertz, mindlin,
    friction, normal, shear, load, stiffness,
):  # fmt: skip
    load[:], stiffness[:] = 0, 0
    count = len(slabs) - 1
    totals = np.zeros((count, 7))
    for odd in range(2):
        for half in prange((count + 1 - odd) // 2):
            k = 2 * half + odd
            _forces_of_slab(
                slabs[k], slabs[k + 1], position, motion, dt, ends, shift, side, change, walls,
                radius, hertz, mindlin, friction, normal, shear, load, stiffness, totals[k],
            )  # fmt: skip
    return totals.sum(axis=0)


def forces_by_arrays(
    slabs, position, motion, dt, ends, shift, side, change, walls, radius, hertz, mindlin,
    friction, normal, shear, load, stiffness,
):  # fmt: skip
    """The same as the compiled loop; the fallback, and its oracle."""
    i, j = ends.T
    pair = j >= 0
    direction = np.where(j == SOURCE_WALL, -1.0, 1.0)
    branch = np.zeros(normal.shape)
    branch[pair] = position[j[pair]] - position[i[pair]]
    branch[pair, :2] += shift[pair] * side
    distance = np.sqrt((branch**2).sum(axis=1))
    gap = direction * (walls[np.where(j == SOURCE_WALL, 0, 1)] - position[i, 2])
    distance[~pair], branch[~pair, 2] = gap[~pair], (direction * gap)[~pair]
    overlap = np.where(pair, 2 * radius, radius) - distance
    (near,) = np.nonzero(overlap > 0)
    i, j, pair = i[near], j[near], pair[near]
    overlap, distance, moved = overlap[near], distance[near], shift[near] * change
    n = branch[near] / distance[:, None]
    root = np.sqrt(np.where(pair, radius / 2, radius) * overlap)
    pressed, lever = hertz * root * overlap, radius - overlap / 2
    of_j = np.where(pair[:, None], motion[j], 0.0)
    turning = motion[i, 3:] + of_j[:, 3:]
    slip = dt * (of_j[:, :3] - motion[i, :3] + lever[:, None] * np.cross(n, turning))
    slip[:, :2] += np.where(pair[:, None], moved, 0.0)
    slip -= (slip * n).sum(axis=1)[:, None] * n
    was, force = normal[near], shear[near]
    # A contact that has just closed has neither a normal before nor a shear force.
    force = force + np.cross(np.cross(was, n), force)
    turn = 0.5 * dt * (turning * was).sum(axis=1)
    force = force + turn[:, None] * np.cross(was, force) + (mindlin * root)[:, None] * slip
    size, limit = np.sqrt((force**2).sum(axis=1)), friction * pressed
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
    if len(stiffness):
        kn = 1.5 * hertz * root
        stiffness[:] = np.bincount(i, kn, count) + np.bincount(j[pair], kn[pair], count)
    contact = np.sqrt((on_i[:, :3] ** 2).sum(axis=1)).sum()
    virial = -(distance[:, None] * on_i[:, :3] * n).sum(axis=0)
    return np.array([pressed.sum(), contact, len(near), sliding.sum(), *virial])


def by_threads(spheres: int) -> bool:
    """Whether threads are worth their start, and allowed; results are the same to the bit.

    On cores that other programs use a thread waits for its turn in every step, so that
    OMP_NUM_THREADS=1, which the README asks for there, holds here as well.
    """
    many = spheres >= ENOUGH and os.environ.get("OMP_NUM_THREADS") != "1"
    return many and numba.get_num_threads() > 1


def compiled(function: Callable, place: int) -> Callable:
    """A loop over slabs, compiled for one thread and for more; argument `place` has the spheres."""
    one = numba.njit(cache=True)(function)
    # Under a name of its own: the cache of compiled functions tells them apart by nothing else.
    threaded = FunctionType(function.__code__, function.__globals__)
    threaded.__name__ = threaded.__qualname__ = f"{function.__name__}_by_threads"
    more = numba.njit(cache=True, parallel=True)(threaded)

    def loop(*given):
        return (more if by_threads(len(given[place])) else one)(*given)

    return loop


if numba is None:
    forces_by_loop = forces_by_arrays
else:
    _forces_of_slab = numba.njit(cache=True)(_forces_of_slab)
    forces_by_loop = compiled(_forces_by_slabs, 1)
