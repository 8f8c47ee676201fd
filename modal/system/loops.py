"""The loops over contacts that multiply by K: springs, and what a normal pre-stress adds to them.

Each contact gathers the motion of its two bodies, stretches its springs and scatters the forces.
What a recurrence adds to them, multiples of both vectors, is made for each sphere just before its
first contact: every vector goes through memory once.
"""

import numpy as np

from modal.tools.loops import (
    compiled,
    compiled_part,
    cross,
    dot,
    fingerprint,
    inlined,
    numba,
    plus,
    prange,
)


@inlined
def _times(factor, a):
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def _three(x, i, first, v):
    return x[i, first, v], x[i, first + 1, v], x[i, first + 2, v]


@inlined
def _column(of, first, count):
    return of[first], of[first + count], of[first + 2 * count]


@inlined
def _add(y, i, first, v, factor, a):
    y[i, first, v] += factor * a[0]
    y[i, first + 1, v] += factor * a[1]
    y[i, first + 2, v] += factor * a[2]


def _springs(first, last, x, y, single, factor, rows, ends, lateral, aside, rolling, scale):
    width = x.shape[2] if single is None else 1
    for c in range(first, last):
        i, j = ends[c, 0], ends[c, 1]
        n = rows[c, 0], rows[c, 1], rows[c, 2]
        difference, kt = factor * rows[c, 3], factor * rows[c, 4]
        ti, ri = scale[i, 0], scale[i, 1]
        # In the place of a wall, which does not move, stands the sphere itself, times zero.
        j, tj, rj = (j, scale[j, 0], scale[j, 1]) if j >= 0 else (i, 0.0, 0.0)
        arm_i, arm_j = rows[c, 5] * ri, rows[c, 6] * rj
        if aside is not None:
            off_i = aside[c, 0], aside[c, 1], aside[c, 2]
            off_j = aside[c, 3], aside[c, 4], aside[c, 5]
        for v in range(width):
            w = plus(_times(-ti, _three(x, i, 0, v)), tj, _three(x, j, 0, v))
            turn_i, turn_j = _three(x, i, 3, v), _three(x, j, 3, v)
            d = plus(w, -1.0, cross(plus(_times(arm_i, turn_i), arm_j, turn_j), n))
            if aside is not None:
                d = plus(plus(d, -ri, cross(turn_i, off_i)), rj, cross(turn_j, off_j))
            spring = plus(_times(kt, d), difference * dot(n, d), n)
            force, torque = spring, cross(n, spring)
            if lateral is not None:
                # The normal pre-stress pushes the centres apart sideways and has no torque.
                push = factor * lateral[c]
                force = plus(plus(spring, push, w), -push * dot(n, w), n)
            _add(y, i, 0, v, -ti, force)
            _add(y, j, 0, v, tj, force)
            _add(y, i, 3, v, -arm_i, torque)
            _add(y, j, 3, v, -arm_j, torque)
            if aside is not None:
                _add(y, i, 3, v, -ri, cross(off_i, spring))
                _add(y, j, 3, v, rj, cross(off_j, spring))
            if rolling is not None:
                # Turning against each other, of which rolling and twisting each resist a part.
                p = plus(_times(-ri, turn_i), rj, turn_j)
                twists = factor * rolling[c, 1] * dot(n, p)
                moment = plus(_times(factor * rolling[c, 0], p), twists, n)
                _add(y, i, 3, v, -ri, moment)
                _add(y, j, 3, v, rj, moment)


def _springs_of_block(first, last, x, y, columns, factor, rows, ends, scale):
    """Springs as `_springs`, of several columns, in loops of which the compiler makes vectors.

    So no array is both read and written in one loop, and all distances in an array are known.
    """
    count = len(columns)
    part, size = 3 * count, 6 * count
    motion, load, force = x.reshape(-1), y.reshape(-1), np.empty(size)
    for c in range(first, last):
        i, j = ends[c, 0], ends[c, 1]
        n = rows[c, 0], rows[c, 1], rows[c, 2]
        difference, kt = factor * rows[c, 3], factor * rows[c, 4]
        ti, ri = scale[i, 0], scale[i, 1]
        # In the place of a wall, which does not move, stands the sphere itself, times zero.
        other, tj, rj = (j, scale[j, 0], scale[j, 1]) if j >= 0 else (i, 0.0, 0.0)
        arm_i, arm_j = rows[c, 5] * ri, rows[c, 6] * rj
        of_i, of_j = motion[i * size : (i + 1) * size], motion[other * size : (other + 1) * size]
        on_i, on_j = load[i * size : (i + 1) * size], load[other * size : (other + 1) * size]
        for v in range(x.shape[2]):
            w = plus(_times(-ti, _column(of_i, v, count)), tj, _column(of_j, v, count))
            turn = _times(arm_i, _column(of_i, part + v, count))
            turn = plus(turn, arm_j, _column(of_j, part + v, count))
            d = plus(w, -1.0, cross(turn, n))
            spring = plus(_times(kt, d), difference * dot(n, d), n)
            torque = cross(n, spring)
            force[v], force[count + v], force[2 * count + v] = spring
            force[part + v], force[part + count + v], force[part + 2 * count + v] = torque
        for k in range(part):
            on_i[k] -= ti * force[k]
            on_i[part + k] -= arm_i * force[part + k]
        if j >= 0:
            for k in range(part):
                on_j[k] += tj * force[k]
                on_j[part + k] -= arm_j * force[part + k]


def _mix(first, last, x, y, single, own, kept, fresh, sums, slab):
    width = x.shape[2] if single is None else 1
    for at in range(first, last):
        i = fresh[at]
        for d in range(x.shape[1]):
            for v in range(width):
                if sums is not None:
                    sums[slab, 0, d, v] += y[i, d, v] * y[i, d, v]
                    sums[slab, 1, d, v] += y[i, d, v] * x[i, d, v]
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
    x, y, single, columns, factor, own, kept, rows, ends, slabs, pieces, fresh, lateral, aside,
    rolling, scale, sums, threads,
):  # fmt: skip
    """y = factor S K S x + own x + kept y for x and y of shape (n, 6, k).

    `single` is not None where k is 1, and `columns` a tuple of k numbers where contacts are springs
    alone and k is to be known when this is compiled. S is diagonal: `scale` (n, 2) holds its value
    for the translations of a particle and that for its rotations. The contacts as in
    `OrderedContacts`. `sums` (s + 1, 2, 6, k), where it is not None: to each slab's row are added,
    by component and column, the sums of y y and of y x over its fresh spheres, y as it came.
    `threads` share the slabs.
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
                    if columns is not None:
                        _springs_of_block(first, last, x, y, columns, factor, rows, ends, scale)
                        continue
                    more = rows, ends, lateral, aside, rolling, scale
                    _springs(first, last, x, y, single, factor, *more)
    if mixing:
        _mix(pieces[-1, 1], len(fresh), x, y, single, own, kept, fresh, sums, count)


if numba is not None:
    _OF = fingerprint()
    _springs = compiled_part(_springs, _OF, fastmath=True)
    _springs_of_block = compiled_part(_springs_of_block, _OF, fastmath=True)
    # Without fastmath, which would lose the NaN that a `kept` of 0 clears, or take one for rest.
    _mix = compiled_part(_mix, _OF)
    _at_rest = compiled_part(_at_rest, _OF)
    combine_by_slabs = compiled(_combine_by_slabs, 0, _OF, fastmath=True)
