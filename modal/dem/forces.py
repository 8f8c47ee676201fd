"""Forces of all contacts: a contact model normal to them, and with friction along them.

A contact with history has a shear force. A step turns it with its contact and with the spin of its
two spheres, lets it grow by ks times the shear displacement, a contact's first step included, and
cuts it at the friction limit. With Hertz and Mindlin it is the law of YADE term by term (there
`ScGeom` without its variant against ratcheting, and `Law2_ScGeom_MindlinPhys_Mindlin`), and that of
`modal.system.contacts` with finite increments. Without friction there is no history.

`radius` (n,) is that of each sphere, m; `laws` are that of two spheres and that of a sphere and a
wall (`modal.packing.contact_models`), by whose class a loop is compiled. `side` (5,), m, are the
periods, and how far the one along z leans along x and y; `change` (4, 3) is what these have gained
in the step, m, in its second row what the source wall has moved by, m, and in its last the wall's
spin, rad/s, and the x and y, m, of the line along z that it turns about. The lever arms of a
contact end in the middle of its overlap; of equal spheres they are equal, and what makes them
differ adds zeros.

`work` (m, 2), J, is what each contact's shear force has stored and what slip has dissipated, by the
trapezoidal rule; (0, 2) where nobody asks. The law keeps the force as the overlap changes, and with
it the stiffness: what is stored is the sum of the work, no function of the force.

The law of a contact is written once, for numbers and for arrays: the loop over contacts, compiled
by numba, and numpy, which is about ten times slower and the loop's oracle, both call it.
"""

from __future__ import annotations

import sys
from functools import cache
from types import FunctionType

import numpy as np

from modal.packing.contact_models import law_of_each
from modal.packing.contact_models.hertz_mindlin import HertzMindlin
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.loops import (
    compiled,
    compiled_part,
    cross,
    dot,
    elementwise,
    fingerprint,
    numba,
    plus,
    prange,
)

TOTALS = (
    *("normal force", "contact force", "touching", "sliding", "virial x", "virial y", "virial z"),
    *("energy", "stiffness"),
    *("source x", "source y", "source z", "receiver x", "receiver y", "receiver z"),
    *("source turn", "receiver turn"),
)
"""What the loops return: sums over contacts in N, numbers, stress times volume in N m, J, N/m, the
forces on both walls, N, and their torques about the line of `change`, N m; of a cell without walls
the first force is that across its period along z."""
UPRIGHT = np.zeros(2)
"""Lean of a period along z that stands upright, m."""
LAW = "normal_force", "elastic_energy", "stiffness_normal", "stiffness_tangential"
"""What the loop takes of a contact model."""
normal_force, elastic_energy, stiffness_normal, stiffness_tangential = (
    getattr(HertzMindlin, name) for name in LAW
)
Law, NUMBERS = HertzMindlin, len(HertzMindlin._fields)
"""The contact model that a loop is compiled for, its count of numbers and its functions, in whose
places those of Hertz and Mindlin stand here."""


@elementwise
def increment(normal, lever, longer, apart, turning, second, dt, gained):
    """How far the contact points part along the contact in a step, m.

    lever, m, of the first sphere, and by how much that of the second is `longer`; apart, m/s:
    velocity of the second less that of the first; turning, rad/s: the sum of their spins, and that
    of the `second`; gained, m: what the periods between them have gained.
    """
    moved = plus(apart, lever, cross(normal, turning))
    moved = plus(moved, longer, cross(normal, second))
    moved = plus(gained, dt, moved)
    return plus(moved, -dot(moved, normal), normal)


@elementwise
def turned(shear, before, normal, turning, dt):
    """The shear force, N, of a contact that turns from the normal `before` to `normal` and spins.

    s + (before x normal) x s, then + (spin before) x s: zero for one that has just closed.
    """
    shear = plus(plus(shear, dot(shear, before), normal), -dot(shear, normal), before)
    return plus(shear, 0.5 * dt * dot(before, turning), cross(before, shear))


@elementwise
def share_held(shear, limit):
    """What friction holds of a shear force: 1, or less where the contact slides."""
    size = np.sqrt(dot(shear, shear))
    return np.minimum(1.0, limit / np.maximum(size, 1e-300))


@elementwise
def shear_work(before, trial, after, stiffness):
    """What a step stores in a contact's shear force and what its slip dissipates, J.

    `before` and `after` are the forces, N, `trial` what the force would be without slip.
    """
    mean = plus((0.5 * before[0], 0.5 * before[1], 0.5 * before[2]), 0.5, after)
    stored = dot(mean, plus(after, -1.0, before)) / stiffness
    return stored, dot(mean, plus(trial, -1.0, after)) / stiffness


def _rows_in_touch(first, last, position, ends, shift, side, radius, normal, rows):
    """Contacts of a slab at walls, and those that touch or have done so before, into `rows` (m,).

    Which pairs of a list touch looks like chance: found without a branch, nothing waits for a wrong
    guess, where the forces of all others would make it wait twice.
    """
    found = np.uint64(first)
    # Numbers without sign: for others numba looks at each access whether it counts from the end.
    for c in range(np.uint64(first), np.uint64(last)):
        i, j = np.uint64(ends[c, 0]), np.uint64(max(ends[c, 1], 0))
        up, reach = shift[c, 2], radius[i] + radius[j]
        bx = position[j, 0] - position[i, 0] + shift[c, 0] * side[0] + up * side[3]
        by = position[j, 1] - position[i, 1] + shift[c, 1] * side[1] + up * side[4]
        bz = position[j, 2] - position[i, 2] + up * side[2]
        rows[found] = c
        keep = (bx * bx + by * by + bz * bz < reach * reach) | (ends[c, 1] < 0)
        if normal is not None:
            keep |= (normal[c, 0] != 0) | (normal[c, 1] != 0) | (normal[c, 2] != 0)
        found += np.uint64(keep)
    return found


def _forces_of_slab(
    first, last, position, ends, shift, side, walls, radius, laws, motion, dt, change, friction,
    normal, shear, work, load, stiffness, totals, rows,
):  # fmt: skip
    of_pairs, of_walls = Law(*laws[:NUMBERS]), Law(*laws[NUMBERS:])
    summed = len(stiffness) > 0
    all_normal = all_contact = energy = all_stiffness = 0.0
    along_x = along_y = along_z = 0.0
    touching = sliding = 0
    at_source = at_receiver = (0.0, 0.0, 0.0)
    turn_source = turn_receiver = 0.0
    end = _rows_in_touch(first, last, position, ends, shift, side, radius, normal, rows)
    for row in range(np.uint64(first), end):
        c = np.uint64(rows[row])
        i, code = np.uint64(ends[c, 0]), ends[c, 1]
        j = np.uint64(max(code, 0))
        overlap, effective, longer, law = 0.0, 0.0, 0.0, of_pairs
        size = radius[i]
        if code >= 0:
            a, b, up = shift[c, 0], shift[c, 1], shift[c, 2]
            bx = position[j, 0] - position[i, 0] + a * side[0] + up * side[3]
            by = position[j, 1] - position[i, 1] + b * side[1] + up * side[4]
            bz = position[j, 2] - position[i, 2] + up * side[2]
            square = bx * bx + by * by + bz * bz
            reach = size + radius[j]
            if 0.0 < square < reach * reach:
                distance = np.sqrt(square)
                overlap, longer = reach - distance, radius[j] - size
                # In this order the half of a radius comes out to the last bit.
                effective = size * (radius[j] / reach)
                inverse = 1 / distance
                nx, ny, nz = bx * inverse, by * inverse, bz * inverse
        else:
            a = b = up = 0
            nx, ny, nz = 0.0, 0.0, -1.0 if code == SOURCE_WALL else 1.0
            bx, by, bz = 0.0, 0.0, walls[0 if code == SOURCE_WALL else 1] - position[i, 2]
            overlap = size - nz * bz
            effective, law = size, of_walls
        if overlap <= 0:
            if shear is not None and (normal[c, 0] != 0 or normal[c, 1] != 0 or normal[c, 2] != 0):
                normal[c, 0] = normal[c, 1] = normal[c, 2] = 0.0
                shear[c, 0] = shear[c, 1] = shear[c, 2] = 0.0
                if len(work):
                    # What an opening contact had stored in shear has slipped away.
                    work[c, 1] += work[c, 0]
                    work[c, 0] = 0.0
            continue
        pressed = normal_force(law, overlap, effective)
        fx, fy, fz = -pressed * nx, -pressed * ny, -pressed * nz
        if shear is not None:
            n, lever = (nx, ny, nz), size - overlap / 2
            apart = -motion[i, 0], -motion[i, 1], -motion[i, 2]
            turning, second = (motion[i, 3], motion[i, 4], motion[i, 5]), (0.0, 0.0, 0.0)
            if code >= 0:
                apart = plus(apart, 1.0, (motion[j, 0], motion[j, 1], motion[j, 2]))
                second = motion[j, 3], motion[j, 4], motion[j, 5]
                turning = plus(turning, 1.0, second)
            gained = a * change[0, 0] + up * change[2, 0], b * change[0, 1] + up * change[2, 1]
            gained = gained[0], gained[1], up * change[0, 2]
            from_axis = 0.0, 0.0
            if code < 0:
                from_axis = position[i, 0] - change[3, 1], position[i, 1] - change[3, 2]
            if code == SOURCE_WALL:
                spin = dt * change[3, 0]
                gained = change[1, 0] - spin * from_axis[1], change[1, 1] + spin * from_axis[0]
                gained = gained[0], gained[1], change[1, 2]
                turning = plus(turning, 1.0, (0.0, 0.0, change[3, 0]))
            slip = increment(n, lever, longer, apart, turning, second, dt, gained)
            before = normal[c, 0], normal[c, 1], normal[c, 2]
            old = turned((shear[c, 0], shear[c, 1], shear[c, 2]), before, n, turning, dt)
            kt = stiffness_tangential(law, overlap, effective)
            s = trial = plus(old, kt, slip)
            limit = friction * pressed
            if dot(s, s) > limit * limit:
                held = share_held(s, limit)
                s = held * s[0], held * s[1], held * s[2]
                sliding += 1
            if len(work):
                stored, lost = shear_work(old, trial, s, kt)
                work[c, 0] += stored
                work[c, 1] += lost
            normal[c, 0], normal[c, 1], normal[c, 2] = n
            shear[c, 0], shear[c, 1], shear[c, 2] = s
            fx, fy, fz = fx + s[0], fy + s[1], fz + s[2]
            mx, my, mz = cross(n, s)
            load[i, 3] += lever * mx
            load[i, 4] += lever * my
            load[i, 5] += lever * mz
            if code >= 0:
                lever += longer
                load[j, 3] += lever * mx
                load[j, 4] += lever * my
                load[j, 5] += lever * mz
            elif code == SOURCE_WALL:
                turn_source -= from_axis[0] * fy - from_axis[1] * fx
            else:
                turn_receiver -= from_axis[0] * fy - from_axis[1] * fx
            all_contact += np.sqrt(fx * fx + fy * fy + fz * fz)
        load[i, 0] += fx
        load[i, 1] += fy
        load[i, 2] += fz
        if code >= 0:
            load[j, 0] -= fx
            load[j, 1] -= fy
            load[j, 2] -= fz
            if up != 0:
                at_source = plus(at_source, 1.0 * up, (fx, fy, fz))
        elif code == SOURCE_WALL:
            at_source = plus(at_source, -1.0, (fx, fy, fz))
        else:
            at_receiver = plus(at_receiver, -1.0, (fx, fy, fz))
        kn = stiffness_normal(law, overlap, effective)
        if summed:
            stiffness[i] += kn
            if code >= 0:
                stiffness[j] += kn
        all_normal += pressed
        all_stiffness += kn
        energy += elastic_energy(law, overlap, effective)
        along_x -= fx * bx
        along_y -= fy * by
        along_z -= fz * bz
        touching += 1
    totals[0], totals[1], totals[2], totals[3] = all_normal, all_contact, touching, sliding
    totals[4], totals[5], totals[6] = along_x, along_y, along_z
    totals[7], totals[8] = energy, all_stiffness
    totals[9], totals[10], totals[11] = at_source
    totals[12], totals[13], totals[14] = at_receiver
    totals[15], totals[16] = turn_source, turn_receiver


def _forces_by_slabs(
    slabs, position, ends, shift, side, walls, radius, laws, motion, dt, change, friction,
    normal, shear, work, load, stiffness,
):  # fmt: skip
    load[:], stiffness[:] = 0, 0
    count = len(slabs) - 1
    totals, rows = np.zeros((count, len(TOTALS))), np.empty(len(ends), np.uint32)
    for odd in range(2):
        for half in prange((count + 1 - odd) // 2):
            k = 2 * half + odd
            _forces_of_slab(
                slabs[k], slabs[k + 1], position, ends, shift, side, walls, radius, laws, motion,
                dt, change, friction, normal, shear, work, load, stiffness, totals[k], rows,
            )  # fmt: skip
    return totals.sum(axis=0)


def forces_by_arrays(
    slabs, position, ends, shift, side, walls, radius, laws, motion, dt, change, friction,
    normal, shear, work, load, stiffness,
):  # fmt: skip
    """The same as the compiled loop; the fallback, and its oracle."""
    count = len(position)
    i, j = ends.T
    pair = j >= 0
    partner = np.where(pair, j, 0)  # a wall has no place among the spheres
    branch = position[partner] - position[i] + shift * side[:3]
    branch[:, :2] += shift[:, 2:] * side[3:]
    face = walls[np.where(j == SOURCE_WALL, 0, 1)] - position[i, 2]
    branch[~pair] = np.column_stack([0 * face, 0 * face, face])[~pair]
    # A sphere beyond a wall is pushed back: its distance is negative.
    outward = np.where(j == SOURCE_WALL, -1.0, 1.0)
    distance = np.where(pair, np.sqrt((branch**2).sum(axis=1)), outward * face)
    reach = radius[i] + np.where(pair, radius[partner], 0.0)
    overlap = reach - distance
    (near,) = np.nonzero((overlap > 0) & ((distance > 0) | ~pair))
    columns = (i, j, partner, pair, overlap, distance)
    i, j, partner, pair, overlap, distance = (column[near] for column in columns)
    n = np.where(pair, branch[near].T / np.where(pair, distance, 1.0), 0.0)
    n[2, ~pair] = outward[near][~pair]
    radius_j = radius[partner]
    effective = np.where(pair, radius[i] * (radius_j / (radius[i] + radius_j)), radius[i])
    law = law_of_each(laws, ~pair)
    pressed, kn = law.normal_force(overlap, effective), law.stiffness_normal(overlap, effective)
    force, slid, contact, turns = -pressed * n, 0, 0.0, np.zeros(2)
    load[:] = 0
    if shear is not None:
        lever, second = radius[i] - overlap / 2, np.where(pair, motion[partner].T, 0.0)
        longer = np.where(pair, radius_j - radius[i], 0.0)
        apart, turning = second[:3] - motion[i, :3].T, second[3:] + motion[i, 3:].T
        gained = np.where(pair, (shift[near] * change[0] + shift[near, 2:] * change[2]).T, 0.0)
        x, y = (position[i, :2] - change[3, 1:]).T
        turned_by = dt * change[3, 0] * np.array([-y, x, 0 * x])
        gained = np.where(j == SOURCE_WALL, change[1][:, None] + turned_by, gained)
        turning[2] += np.where(j == SOURCE_WALL, change[3, 0], 0.0)
        slip = increment(n, lever, longer, apart, turning, second[3:], dt, gained)
        old = turned(shear[near].T, normal[near].T, n, turning, dt)
        kt = law.stiffness_tangential(overlap, effective)
        trial = np.array(plus(old, kt, slip))
        limit = friction * pressed
        slid = int((dot(trial, trial) > limit**2).sum())
        s = trial * share_held(trial, limit)
        if len(work):
            apart = np.setdiff1d(np.arange(len(ends)), near)
            work[apart, 1] += work[apart, 0]
            work[apart, 0] = 0
            work[near] += np.transpose(shear_work(old, trial, s, kt))
        normal[:], shear[:] = 0, 0
        normal[near], shear[near] = n.T, s.T
        force, contact = force + s, np.sqrt(dot(force + s, force + s)).sum()
        about = y * force[0] - x * force[1]
        turns = np.array([about[j == code].sum() for code in (SOURCE_WALL, RECEIVER_WALL)])
        moment = np.array(cross(n, s))
        torque, other = lever * moment, ((lever + longer) * moment)[:, pair]
        for axis in range(3):
            load[:, 3 + axis] = np.bincount(i, torque[axis], count)
            load[:, 3 + axis] += np.bincount(j[pair], other[axis], count)
    for axis in range(3):
        load[:, axis] = np.bincount(i, force[axis], count)
        load[:, axis] -= np.bincount(j[pair], force[axis, pair], count)
    if len(stiffness):
        stiffness[:] = np.bincount(i, kn, count) + np.bincount(j[pair], kn[pair], count)
    virial = -(distance * force * n).sum(axis=1)
    energy = law.elastic_energy(overlap, effective).sum()
    walls_hold = [-force[:, j == code].sum(axis=1) for code in (SOURCE_WALL, RECEIVER_WALL)]
    walls_hold[0] = walls_hold[0] + (force * np.where(pair, shift[near, 2], 0)).sum(axis=1)
    sums = pressed.sum(), contact, len(near), slid, *virial, energy, kn.sum()
    return np.array([*sums, *np.concatenate(walls_hold), *turns])


@cache
def _loop_of(law):
    """The loop of a contact model, whose functions take the places of those of this module."""
    module = sys.modules[law.__module__]
    for helper in vars(module).values():
        if isinstance(helper, FunctionType) and helper.__module__ == module.__name__:
            elementwise(helper)
    own = {"Law": law, "NUMBERS": len(law._fields)}
    own |= {name: elementwise(getattr(law, name)) for name in LAW}
    of = fingerprint(module)
    own["_rows_in_touch"] = compiled_part(_rows_in_touch, of, own, fastmath={"contract"})
    own["_forces_of_slab"] = compiled_part(_forces_of_slab, of, own, fastmath={"contract"})
    return compiled(_forces_by_slabs, 1, of, own)


def forces_by_loop(slabs, position, ends, shift, side, walls, radius, laws, *others):
    """Fill `load` (n, 6), N and N m, and what else moves; the sums of `TOTALS`."""
    if numba is None:
        return forces_by_arrays(slabs, position, ends, shift, side, walls, radius, laws, *others)
    # Loops by threads take no tuples with names, nor of tuples.
    loop, numbers = _loop_of(type(laws[0])), (*laws[0], *laws[1])
    return loop(slabs, position, ends, shift, side, walls, radius, numbers, *others)
