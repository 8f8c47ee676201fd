"""The loops over contacts that multiply by K: springs, and what pre-stress adds to them.

Each contact gathers the motion of its two bodies, stretches its springs and scatters the forces.
What a recurrence adds to them, multiples of both vectors, is made for each sphere just before its
first contact: every vector goes through memory once.
"""

from __future__ import annotations

from modal.tools.loops import (
    compiled,
    compiled_part,
    cross,
    dot,
    fingerprint,
    numba,
    plus,
    prange,
)


def _springs(first, last, x, y, single, factor, rows, ends, lateral, aside, rolling, scale):
    rotating = x.shape[1] == 6
    width = x.shape[2] if single is None else 1
    for c in range(first, last):
        i, j = ends[c, 0], ends[c, 1]
        n = rows[c, 0], rows[c, 1], rows[c, 2]
        difference, kt = factor * rows[c, 3], factor * rows[c, 4]
        ti, ri = scale[i, 0], scale[i, 1]
        # A wall does not move; its index is negative.
        tj, rj = (scale[j, 0], scale[j, 1]) if j >= 0 else (0.0, 0.0)
        arm_i, arm_j = rows[c, 5] * ri, rows[c, 6] * rj
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
            spring = kt * d[0], kt * d[1], kt * d[2]
            spring = plus(spring, difference * dot(n, d), n)
            force = spring
            if lateral is not None:
                # The normal pre-stress pushes the centres apart sideways and has no torque.
                push = factor * lateral[c]
                force = plus(plus(spring, push, w), -push * dot(n, w), n)
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
            if rolling is not None and rotating:
                # Turning against each other, of which rolling and twisting each resist a part.
                p = -ri * x[i, 3, v], -ri * x[i, 4, v], -ri * x[i, 5, v]
                if j >= 0:
                    p = plus(p, rj, (x[j, 3, v], x[j, 4, v], x[j, 5, v]))
                rolls, twists = factor * rolling[c, 0], factor * rolling[c, 1] * dot(n, p)
                moment = plus((rolls * p[0], rolls * p[1], rolls * p[2]), twists, n)
                y[i, 3, v] -= ri * moment[0]
                y[i, 4, v] -= ri * moment[1]
                y[i, 5, v] -= ri * moment[2]
                if j >= 0:
                    y[j, 3, v] += rj * moment[0]
                    y[j, 4, v] += rj * moment[1]
                    y[j, 5, v] += rj * moment[2]


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
                    (rows[c, 5] * turn[0], rows[c, 5] * turn[1], rows[c, 5] * turn[2]),
                    -along / 2,
                    m,
                )
                y[i, 3, v] -= qi * torque[0]
                y[i, 4, v] -= qi * torque[1]
                y[i, 5, v] -= qi * torque[2]
                if j >= 0:
                    torque = plus(torque, rows[c, 6] - rows[c, 5], turn)
                    y[j, 3, v] -= qj * torque[0]
                    y[j, 4, v] -= qj * torque[1]
                    y[j, 5, v] -= qj * torque[2]


def _mix(first, last, x, y, single, own, kept, fresh, sums, slab):
    width = x.shape[2] if single is None else 1
    for at in range(first, last):
        i = fresh[at]
        for d in range(x.shape[1]):
            for v in range(width):
                if sums is not None:
                    sums[slab, 0, d] += y[i, d, v] * y[i, d, v]
                    sums[slab, 1, d] += y[i, d, v] * x[i, d, v]
                # A `kept` of 0 also clears a NaN.
                y[i, d, v] = own * x[i, d, v] + (kept * y[i, d, v] if kept != 0 else 0.0)


def _at_rest(first, last, x, fresh):
    for at in range(first, last):
        i = fresh[at]
        moves = False
        for d in range(x.shape[1]):
            for v in range(x.shape[2]):
                moves |= x[i, d, v] != 0
        if moves:
            return False
    return True


def _combine_by_slabs(
    x,
    y,
    single,
    factor,
    own,
    kept,
    rows,
    ends,
    slabs,
    pieces,
    fresh,
    lateral,
    aside,
    rolling,
    shear,
    scale,
    sums,
    threads,
):
    """y = factor S K S x + own x + kept y for x and y of shape (n, dof, k).

    `single` is not None where k is 1. S is diagonal: `scale` (n, 2) holds its value for the
    translations of a particle and that for its rotations. The contacts as in `PackedContacts`.
    `sums` (s + 1, 2, dof), where it is not None: to each slab's row are added, by component, the
    sums of y y and of y x over its fresh spheres, y as it came. `threads` share the slabs.
    """
    mixing = own != 0 or kept != 1 or sums is not None
    count = len(slabs) - 1
    for odd in range(2):
        for thread in prange(threads):
            # Slabs that follow each other go to different threads: a wave sets them moving in turn.
            for slab in range(2 * int(thread) + odd, count, 2 * threads):
                # Its contacts touch what is met first in this slab and in those beside it. Before
                # the wave comes nothing moves there, and zero is what the springs would add.
                near, far = slabs[max(slab - 1, 0)], slabs[min(slab + 2, count)]
                still = _at_rest(pieces[near, 1], pieces[far, 1], x, fresh)
                for piece in range(slabs[slab], slabs[slab + 1]):
                    first, last = pieces[piece, 0], pieces[piece + 1, 0]
                    if mixing:
                        here, there = pieces[piece, 1], pieces[piece + 1, 1]
                        _mix(here, there, x, y, single, own, kept, fresh, sums, slab)
                    if still:
                        continue
                    _springs(
                        first,
                        last,
                        x,
                        y,
                        single,
                        factor,
                        rows,
                        ends,
                        lateral,
                        aside,
                        rolling,
                        scale,
                    )
                    if shear is not None:
                        _turning_shear(first, last, x, y, single, factor, rows, ends, shear, scale)
    if mixing:
        _mix(pieces[-1, 1], len(fresh), x, y, single, own, kept, fresh, sums, count)


if numba is not None:
    _OF = fingerprint()
    _springs = compiled_part(_springs, _OF, fastmath=True)
    _turning_shear = compiled_part(_turning_shear, _OF, fastmath=True)
    # Without fastmath, which would lose the NaN that a `kept` of 0 clears, or take one for rest.
    _mix = compiled_part(_mix, _OF)
    _at_rest = compiled_part(_at_rest, _OF)
    combine_by_slabs = compiled(_combine_by_slabs, 0, _OF, fastmath=True)
