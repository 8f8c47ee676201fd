"""Multiply by K in loops over contacts: springs, and the terms of a normal pre-stress.

Each contact gathers the motion of its two bodies, stretches its springs and scatters the forces.
The terms beta x + gamma y of a recurrence are computed for each sphere just before its first
contact, so that every vector is read only once.

Arguments that belong together are a named tuple. Only `single`, `sums` and the arrays that may be
None are separate arguments: numba omits code for an argument that is None, but not for a field that
is None.
"""

from typing import NamedTuple

import numpy as np

from modal.tools.arrays import Floats, Ints
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


class Vectors(NamedTuple):
    """The vectors (n, 6, k) of a product: `x`, which is multiplied, and `y`, which is changed."""

    x: Floats
    y: Floats


class Factors(NamedTuple):
    """The factors of y = alpha K x + beta x + gamma y."""

    alpha: float
    beta: float
    gamma: float


class Division(NamedTuple):
    """The division of a product: True for one column, else None, and the threads of the slabs."""

    single: bool | None
    threads: int


class Springs(NamedTuple):
    """Rows and ends of contacts as in `OrderedContacts`, and factors `scale` (n, 2)."""

    rows: Floats
    ends: Ints
    scale: Floats


class Mixture(NamedTuple):
    """The factors of y = beta x + gamma y, and the spheres in the order of their first contact."""

    beta: float
    gamma: float
    fresh: Ints


@inlined
def _times(factor, a):
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def _gather(x, i, first, v):
    return x[i, first, v], x[i, first + 1, v], x[i, first + 2, v]


@inlined
def _gather_flat(x, first, count):
    return x[first], x[first + count], x[first + 2 * count]


@inlined
def _add(y, i, first, v, factor, a):
    y[i, first, v] += factor * a[0]
    y[i, first + 1, v] += factor * a[1]
    y[i, first + 2, v] += factor * a[2]


def _add_springs(first, last, vectors, single, alpha, springs, lateral, aside, rolling):
    """Add alpha S K S x to y for the contacts from `first` to before `last`.

    K are the springs, S the diagonal matrix of their `scale`.
    """
    x, y = vectors
    rows, ends, scale = springs
    width = x.shape[2] if single is None else 1
    for c in range(first, last):
        i = ends[c, 0]
        j = ends[c, 1]
        n = rows[c, 0], rows[c, 1], rows[c, 2]
        difference = alpha * rows[c, 3]
        kt = alpha * rows[c, 4]
        ti = scale[i, 0]
        ri = scale[i, 1]
        # A wall does not move: the sphere itself stands in its place, times zero.
        j, tj, rj = (j, scale[j, 0], scale[j, 1]) if j >= 0 else (i, 0.0, 0.0)
        arm_i = rows[c, 5] * ri
        arm_j = rows[c, 6] * rj
        if aside is not None:
            aside_i = aside[c, 0], aside[c, 1], aside[c, 2]
            aside_j = aside[c, 3], aside[c, 4], aside[c, 5]
        for v in range(width):
            w = plus(_times(-ti, _gather(x, i, 0, v)), tj, _gather(x, j, 0, v))
            turn_i = _gather(x, i, 3, v)
            turn_j = _gather(x, j, 3, v)
            d = plus(w, -1.0, cross(plus(_times(arm_i, turn_i), arm_j, turn_j), n))
            if aside is not None:
                d = plus(plus(d, -ri, cross(turn_i, aside_i)), rj, cross(turn_j, aside_j))
            spring = plus(_times(kt, d), difference * dot(n, d), n)
            force = spring
            torque = cross(n, spring)
            if lateral is not None:
                # The normal pre-stress pushes the centres apart sideways and has no torque.
                push = alpha * lateral[c]
                force = plus(plus(spring, push, w), -push * dot(n, w), n)
            _add(y, i, 0, v, -ti, force)
            _add(y, j, 0, v, tj, force)
            _add(y, i, 3, v, -arm_i, torque)
            _add(y, j, 3, v, -arm_j, torque)
            if aside is not None:
                _add(y, i, 3, v, -ri, cross(aside_i, spring))
                _add(y, j, 3, v, rj, cross(aside_j, spring))
            if rolling is not None:
                # Rolling and twisting each resist a part of the relative rotation.
                p = plus(_times(-ri, turn_i), rj, turn_j)
                twist = alpha * rolling[c, 1] * dot(n, p)
                moment = plus(_times(alpha * rolling[c, 0], p), twist, n)
                _add(y, i, 3, v, -ri, moment)
                _add(y, j, 3, v, rj, moment)


def _add_springs_of_block(first, last, vectors, columns, alpha, springs):
    """Add forces as `_add_springs` does, for springs alone and several columns, in vector loops.

    The compiler vectorises a loop if no array is both read and written in it, and if all distances
    in an array are known.
    """
    x, y = vectors
    rows, ends, scale = springs
    count = len(columns)
    part = 3 * count
    size = 6 * count
    motion = x.reshape(-1)
    load = y.reshape(-1)
    force = np.empty(size)
    for c in range(first, last):
        i = ends[c, 0]
        j = ends[c, 1]
        n = rows[c, 0], rows[c, 1], rows[c, 2]
        difference = alpha * rows[c, 3]
        kt = alpha * rows[c, 4]
        ti = scale[i, 0]
        ri = scale[i, 1]
        # A wall does not move: the sphere itself stands in its place, times zero.
        partner, tj, rj = (j, scale[j, 0], scale[j, 1]) if j >= 0 else (i, 0.0, 0.0)
        arm_i = rows[c, 5] * ri
        arm_j = rows[c, 6] * rj
        motion_i = motion[i * size : (i + 1) * size]
        motion_j = motion[partner * size : (partner + 1) * size]
        load_i = load[i * size : (i + 1) * size]
        load_j = load[partner * size : (partner + 1) * size]
        for v in range(x.shape[2]):
            w = plus(
                _times(-ti, _gather_flat(motion_i, v, count)), tj, _gather_flat(motion_j, v, count)
            )
            turn = _times(arm_i, _gather_flat(motion_i, part + v, count))
            turn = plus(turn, arm_j, _gather_flat(motion_j, part + v, count))
            d = plus(w, -1.0, cross(turn, n))
            spring = plus(_times(kt, d), difference * dot(n, d), n)
            torque = cross(n, spring)
            force[v], force[count + v], force[2 * count + v] = spring
            force[part + v], force[part + count + v], force[part + 2 * count + v] = torque
        for k in range(part):
            load_i[k] -= ti * force[k]
            load_i[part + k] -= arm_i * force[part + k]
        if j >= 0:
            for k in range(part):
                load_j[k] += tj * force[k]
                load_j[part + k] -= arm_j * force[part + k]


def _mix(first, last, vectors, single, mixture, sums, slab):
    """Set y = beta x + gamma y for some of the `fresh` spheres, and add to the sums of a slab."""
    x, y = vectors
    beta, gamma, fresh = mixture
    width = x.shape[2] if single is None else 1
    for index in range(first, last):
        i = fresh[index]
        for d in range(x.shape[1]):
            for v in range(width):
                if sums is not None:
                    sums[slab, 0, d, v] += y[i, d, v] * y[i, d, v]
                    sums[slab, 1, d, v] += y[i, d, v] * x[i, d, v]
                # A `gamma` of 0 also clears a NaN.
                y[i, d, v] = beta * x[i, d, v] + (gamma * y[i, d, v] if gamma != 0 else 0.0)


def _at_rest(first, last, x, fresh):
    """Tell whether x is zero for some of the `fresh` spheres."""
    for index in range(first, last):
        i = fresh[index]
        moves = False
        for d in range(x.shape[1]):
            for v in range(x.shape[2]):
                moves |= x[i, d, v] != 0
        if moves:
            return False
    return True


def _combine_by_slabs(contacts, scale, vectors, factors, columns, sums, division):
    """Set y = alpha S K S x + beta x + gamma y for x and y of shape (n, 6, k).

    The named tuples are `OrderedContacts`, `Vectors`, `Factors` and `Division`. S is diagonal:
    `scale` (n, 2) holds its value for the translations of a particle and that for its rotations.
    `columns` is a tuple of k numbers if contacts are springs alone: the compiler then knows k.
    Otherwise it is None. If `sums` (s + 1, 2, 6, k) is not None, the row of each slab receives, by
    component and column, the sums of y y and of y x over its fresh spheres, with y before the call.
    """
    # A loop over threads takes no named tuples: they are unpacked outside, and made again inside.
    x, y = vectors
    alpha, beta, gamma = factors
    single, threads = division
    rows, ends, slabs, pieces, fresh, lateral, aside, rolling = contacts
    mixing = beta != 0 or gamma != 1 or sums is not None
    count = len(slabs) - 1
    for odd in range(2):
        for thread in prange(threads):
            # Slabs that follow each other go to different threads: a wave sets them moving in turn.
            for slab in range(2 * int(thread) + odd, count, 2 * threads):
                # Contacts of a slab touch only spheres that are fresh in it or in its neighbours.
                # Before a wave arrives, none of these moves, and the springs would add zero.
                near = slabs[max(slab - 1, 0)]
                far = slabs[min(slab + 2, count)]
                still = _at_rest(pieces[near, 1], pieces[far, 1], x, fresh)
                pair = Vectors(x, y)
                springs = Springs(rows, ends, scale)
                mixture = Mixture(beta, gamma, fresh)
                for piece in range(slabs[slab], slabs[slab + 1]):
                    first = pieces[piece, 0]
                    last = pieces[piece + 1, 0]
                    if mixing:
                        first_fresh = pieces[piece, 1]
                        last_fresh = pieces[piece + 1, 1]
                        _mix(first_fresh, last_fresh, pair, single, mixture, sums, slab)
                    if still:
                        continue
                    if columns is not None:
                        _add_springs_of_block(first, last, pair, columns, alpha, springs)
                        continue
                    _add_springs(first, last, pair, single, alpha, springs, lateral, aside, rolling)
    if mixing:
        mixture_of_all = Mixture(beta, gamma, fresh)
        _mix(pieces[-1, 1], len(fresh), Vectors(x, y), single, mixture_of_all, sums, count)


if numba is not None:
    _FINGERPRINT = fingerprint()
    _add_springs = compiled_part(_add_springs, _FINGERPRINT, fastmath=True)
    _add_springs_of_block = compiled_part(_add_springs_of_block, _FINGERPRINT, fastmath=True)
    # Without fastmath, which would not clear the NaN for a `gamma` of 0, or take a NaN for rest.
    _mix = compiled_part(_mix, _FINGERPRINT)
    _at_rest = compiled_part(_at_rest, _FINGERPRINT)
    combine_by_slabs = compiled(_combine_by_slabs, 1, _FINGERPRINT, fastmath=True)
