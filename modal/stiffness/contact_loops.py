"""The loops over contacts that multiply by K: springs, and what pre-stress adds to them.

Each contact gathers the motion of its two bodies, stretches its springs and scatters the forces.
Contacts are sorted along z by their lower sphere, whatever the numbers of the spheres: both bodies
are then still in the cache from the contacts before. Slabs of them share the cores (`modal.loops`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.formats.arrays import Floats, Ints
from modal.loops import (
    SLABS,
    compiled,
    compiled_part,
    cross,
    dot,
    elementwise,
    fingerprint,
    numba,
    plus,
    prange,
    slabs_of,
)
from modal.packing.network import Network
from modal.stiffness.pre_stress import centre_distance, forces_of

ACROSS = 16
"""Diameters: a wider packing is worked through in columns so wide, whose layers a cache holds."""
CENTRAL = 16 * np.finfo(float).eps
"""Part of a lever across its normal that is round-off, relative to the longest lever."""


@dataclass(frozen=True)
class PackedContacts:
    """Contacts in the order of the loops, m of them; lengths in m, stiffnesses in N/m.

    rows (m, 8): normal, kn - kt, kt, -N / l, and how far the two levers reach along the normal, the
    second one backwards; ends (m, 2) int32, walls negative; slabs (s + 1,): where each begins, and
    m. aside (m, 6): the parts of both levers across the normal, None where all levers lie along it.
    shear (m, 4): the tangential force on j, N, and 1 / l, for the full tangent, else None.
    """

    rows: Floats
    ends: Ints
    slabs: Ints
    aside: Floats | None
    shear: Floats | None

    @classmethod
    def of(cls, network: Network, pre_stress: str) -> PackedContacts:
        """The contacts of a network; `pre_stress` as in `modal.stiffness.pre_stress`."""
        order, slabs = _order_along_z(network)
        ends = np.column_stack([network.particle_i, network.particle_j])
        rows = np.zeros((len(order), 8))
        normal = network.normal
        rows[:, 0:3] = normal[order]
        rows[:, 3] = (network.stiffness_normal - network.stiffness_tangential)[order]
        rows[:, 4] = network.stiffness_tangential[order]
        pressed, sheared = forces_of(network, pre_stress)
        if pressed is not None:
            per_distance = 1 / centre_distance(network)[order]
            rows[:, 5] = -pressed[order] * per_distance
        aside = None
        for k, (lever, sign) in enumerate(((network.lever_i, 1.0), (network.lever_j, -1.0))):
            along = np.einsum("ci,ci->c", lever, normal)
            rows[:, 6 + k] = sign * along[order]
            off = lever - along[:, None] * normal
            if abs(off).max(initial=0.0) > CENTRAL * abs(along).max(initial=0.0):
                aside = np.zeros((len(order), 6)) if aside is None else aside
                aside[:, 3 * k : 3 * k + 3] = off[order]
        shear = None
        if sheared is not None:
            shear = np.column_stack([-sheared[order], per_distance])
        return cls(rows, ends[order].astype(np.int32), slabs, aside, shear)


def _order_along_z(network: Network) -> tuple[Ints, Ints]:
    """Contacts (m,) slab by slab along z, and where the slabs begin, (s + 1,)."""
    n, z = network.n_particles, network.position[:, 2]
    rank = np.empty(n, np.int32)
    rank[np.argsort(z, kind="stable")] = np.arange(n, dtype=np.int32)
    first = rank[network.particle_i]
    second = np.where(network.with_wall, first, rank[network.partner])
    lower = np.minimum(first, second)
    order = np.argsort(lower, kind="stable")
    slabs = slabs_of(np.column_stack([lower, np.maximum(first, second)])[order], n)
    # In a wide packing a layer fills more than a cache: it is cut into columns.
    width = ACROSS * 2 * network.radius.mean()
    at = network.position[:, :2] - network.position[:, :2].min(axis=0)
    columns = np.maximum(np.rint(at.max(axis=0) / width), 1)
    if columns.prod() > 1:
        place = np.minimum(at * (columns / at.max(axis=0)), columns - 1).astype(np.int32)
        column = (place[:, 0] * int(columns[1]) + place[:, 1])[network.particle_i[order]]
        slab = np.repeat(np.arange(len(slabs) - 1), np.diff(slabs))
        order = order[np.lexsort((column, slab))]
    return order, slabs


@elementwise
def spring_forces(w, d, n, difference, kt, lateral):
    """Forces of the springs for the motion `d` of the contact point, and of pre-stress as well.

    `w`: relative motion of the centres; `n`: the normal. The normal pre-stress pushes the centres
    apart sideways and has no torque.
    """
    spring = kt * d[0], kt * d[1], kt * d[2]
    spring = plus(spring, difference * dot(n, d), n)
    return spring, plus(plus(spring, lateral, w), -lateral * dot(n, w), n)


def _springs(first, last, x, y, single, factor, rows, ends, aside, scale):
    rotating = x.shape[1] == 6
    width = x.shape[2] if single is None else 1
    for c in range(first, last):
        i, j = ends[c, 0], ends[c, 1]
        n = rows[c, 0], rows[c, 1], rows[c, 2]
        difference, kt, lateral = factor * rows[c, 3], factor * rows[c, 4], factor * rows[c, 5]
        ti, ri = scale[i, 0], scale[i, 1]
        # A wall does not move; its index is negative.
        tj, rj = (scale[j, 0], scale[j, 1]) if j >= 0 else (0.0, 0.0)
        arm_i, arm_j = rows[c, 6] * ri, rows[c, 7] * rj
        for v in range(width):
            w = -ti * x[i, 0, v], -ti * x[i, 1, v], -ti * x[i, 2, v]
            if j >= 0:
                w = plus(w, tj, (x[j, 0, v], x[j, 1, v], x[j, 2, v]))
            d = w
            if rotating:
                turn = arm_i * x[i, 3, v], arm_i * x[i, 4, v], arm_i * x[i, 5, v]
                if j >= 0:
                    turn = plus(turn, arm_j, (x[j, 3, v], x[j, 4, v], x[j, 5, v]))
                d = plus(w, -1.0, cross(turn, n))
                if aside is not None:
                    off_i = aside[c, 0], aside[c, 1], aside[c, 2]
                    d = plus(d, -ri, cross((x[i, 3, v], x[i, 4, v], x[i, 5, v]), off_i))
                    if j >= 0:
                        off_j = aside[c, 3], aside[c, 4], aside[c, 5]
                        d = plus(d, rj, cross((x[j, 3, v], x[j, 4, v], x[j, 5, v]), off_j))
            spring, force = spring_forces(w, d, n, difference, kt, lateral)
            y[i, 0, v] -= ti * force[0]
            y[i, 1, v] -= ti * force[1]
            y[i, 2, v] -= ti * force[2]
            if rotating:
                torque = cross(n, spring)
                y[i, 3, v] -= arm_i * torque[0]
                y[i, 4, v] -= arm_i * torque[1]
                y[i, 5, v] -= arm_i * torque[2]
                if aside is not None:
                    more = cross(off_i, spring)
                    y[i, 3, v] -= ri * more[0]
                    y[i, 4, v] -= ri * more[1]
                    y[i, 5, v] -= ri * more[2]
            if j >= 0:
                y[j, 0, v] += tj * force[0]
                y[j, 1, v] += tj * force[1]
                y[j, 2, v] += tj * force[2]
                if rotating:
                    y[j, 3, v] -= arm_j * torque[0]
                    y[j, 4, v] -= arm_j * torque[1]
                    y[j, 5, v] -= arm_j * torque[2]
                    if aside is not None:
                        more = cross(off_j, spring)
                        y[j, 3, v] += rj * more[0]
                        y[j, 4, v] += rj * more[1]
                        y[j, 5, v] += rj * more[2]


def _turning_shear(first, last, x, y, single, factor, rows, ends, shear, scale):
    rotating = x.shape[1] == 6
    width = x.shape[2] if single is None else 1
    for c in range(first, last):
        i, j = ends[c, 0], ends[c, 1]
        n = rows[c, 0], rows[c, 1], rows[c, 2]
        s, per_distance = (shear[c, 0], shear[c, 1], shear[c, 2]), shear[c, 3]
        m = cross(n, s)
        ui, uj = scale[i, 0], scale[j, 0] if j >= 0 else 0.0
        qi, qj = scale[i, 1], scale[j, 1] if j >= 0 else 0.0
        ti, tj = factor * ui, factor * uj
        for v in range(width):
            w = -ti * x[i, 0, v], -ti * x[i, 1, v], -ti * x[i, 2, v]
            twist = 0.0
            if rotating:
                twist = factor * qi * dot(n, (x[i, 3, v], x[i, 4, v], x[i, 5, v])) / 2
            if j >= 0:
                w = plus(w, tj, (x[j, 0, v], x[j, 1, v], x[j, 2, v]))
                if rotating:
                    twist += factor * qj * dot(n, (x[j, 3, v], x[j, 4, v], x[j, 5, v])) / 2
            along = dot(n, w)
            d = plus(w, -along, n)
            d = per_distance * d[0], per_distance * d[1], per_distance * d[2]
            turned = dot(s, d)
            # The factor is in the motion already; what follows only distributes the forces.
            f = turned * n[0], turned * n[1], turned * n[2]
            f = plus(f, -twist, m)
            y[i, 0, v] -= ui * f[0]
            y[i, 1, v] -= ui * f[1]
            y[i, 2, v] -= ui * f[2]
            if j >= 0:
                y[j, 0, v] += uj * f[0]
                y[j, 1, v] += uj * f[1]
                y[j, 2, v] += uj * f[2]
            if rotating:
                turn = plus(cross(s, d), twist, s)
                torque = plus(
                    (rows[c, 6] * turn[0], rows[c, 6] * turn[1], rows[c, 6] * turn[2]),
                    -along / 2,
                    m,
                )
                y[i, 3, v] -= qi * torque[0]
                y[i, 4, v] -= qi * torque[1]
                y[i, 5, v] -= qi * torque[2]
                if j >= 0:
                    torque = plus(torque, rows[c, 7] - rows[c, 6], turn)
                    y[j, 3, v] -= qj * torque[0]
                    y[j, 4, v] -= qj * torque[1]
                    y[j, 5, v] -= qj * torque[2]


def _add_by_slabs(x, y, single, factor, rows, ends, slabs, aside, shear, scale):
    """y += factor S K S x for x and y of shape (n, dof, k); `single` is not None where k is 1.

    S is diagonal: `scale` (n, 2) holds its value for the translations of a particle and that for
    its rotations. The contacts as in `PackedContacts`.
    """
    count = len(slabs) - 1
    for odd in range(2):
        for half in prange((count + 1 - odd) // 2):
            first, last = slabs[2 * half + odd], slabs[2 * half + odd + 1]
            _springs(first, last, x, y, single, factor, rows, ends, aside, scale)
            if shear is not None:
                _turning_shear(first, last, x, y, single, factor, rows, ends, shear, scale)


def _mix(x, y, own, kept):
    """y = own x + kept y for x and y of shape (size,); a `kept` of 0 also clears a NaN."""
    for block in prange(SLABS):
        part = range(block * len(x) // SLABS, (block + 1) * len(x) // SLABS)
        if kept == 0:
            for k in part:
                y[k] = own * x[k]
        else:
            for k in part:
                y[k] = own * x[k] + kept * y[k]


def _component_sums(a, b):
    sums = np.zeros((SLABS, 2, 6))
    for block in prange(SLABS):
        for k in range(block * len(a) // SLABS, (block + 1) * len(a) // SLABS):
            for c in range(6):
                sums[block, 0, c] += a[k, c] * a[k, c]
                sums[block, 1, c] += a[k, c] * b[k, c]
    return sums.sum(axis=0)


def component_sums(a: Floats, b: Floats) -> Floats:
    """Shape (2, 6): sums over n of a a, and of a b, for each component of a and b (n, 6)."""
    return np.stack([np.einsum("nc,nc->c", a, of) for of in (a, b)])


if numba is not None:
    _OF = fingerprint()
    _springs = compiled_part(_springs, _OF, fastmath=True)
    _turning_shear = compiled_part(_turning_shear, _OF, fastmath=True)
    add_by_slabs = compiled(_add_by_slabs, 0, _OF, fastmath=True)
    mix = compiled(_mix, 0, _OF)
    component_sums = compiled(_component_sums, 0, _OF)
