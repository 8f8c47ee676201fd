"""Compute the forces of all contacts by a compiled loop: normal forces, and shear with friction.

A contact model (`modal.packing.contact_models`) gives the normal force; the loop is compiled anew
for each class of model. The law of shear forces is in `modal.dem.contact_step`. Without history
contacts have normal forces alone. The lever arms of a contact end in the middle of its overlap.
"""

from __future__ import annotations

import sys
from functools import cache
from types import FunctionType
from typing import NamedTuple

import numpy as np

from modal.dem import contact_step
from modal.dem.contact_step import (
    LEAN,
    PERIODS,
    SOURCE,
    TURN,
    Geometry,
    RelativeMotion,
    ShearStep,
    Totals,
    cut_back,
    friction_share,
    relative_turn,
    shear_increment,
    shear_work,
    split_moment,
    turn_shear,
)
from modal.dem.forces_by_arrays import forces_by_arrays
from modal.packing.contact_models import ContactLaw, acts_across_gaps, resists_turning
from modal.packing.contact_models.hertz_mindlin import HertzMindlin
from modal.packing.network import SOURCE_WALL
from modal.tools.arrays import Floats, Ints
from modal.tools.loops import (
    Loop,
    compiled,
    compiled_part,
    cross,
    dot,
    elementwise,
    fingerprint,
    inlined,
    numba,
    plus,
    prange,
)

LAW_FUNCTIONS = ("normal_force", "elastic_energy", "stiffness_normal", "stiffness_tangential")
"""The functions of a contact model that the loop calls."""
OPTIONAL_FUNCTIONS = (
    "friction_force",
    "rupture_distance",
    "stiffness_rolling",
    "stiffness_twisting",
    "rolling_limit",
    "twisting_limit",
)
"""The functions of a contact model that the loop calls if the model has them."""
TOTALS = len(Totals._fields)
NO_STEP = (None,) * len(ShearStep._fields)
"""Fields of a `ShearStep` of contacts without history."""
# The loop is compiled with those of its contact model in place of these.
Law = HertzMindlin
LAW_NUMBERS = len(HertzMindlin._fields)
normal_force = HertzMindlin.normal_force
elastic_energy = HertzMindlin.elastic_energy
stiffness_normal = HertzMindlin.stiffness_normal
stiffness_tangential = HertzMindlin.stiffness_tangential
friction_force = HertzMindlin.normal_force
rupture_distance = HertzMindlin.normal_force
stiffness_rolling = HertzMindlin.normal_force
stiffness_twisting = HertzMindlin.normal_force
rolling_limit = HertzMindlin.normal_force
twisting_limit = HertzMindlin.normal_force
# What depends on one of these is left out of the loop where it is False.
ADHESIVE = False
ACTS_ACROSS_GAPS = False
RESISTS_TURNING = False
OPEN = 0.0
"""Overlap of a pair that does not touch: below that of any contact of the model."""


def forces_by_loop(
    slabs: Ints,
    geometry: Geometry,
    laws: tuple[ContactLaw, ContactLaw],
    step: ShearStep | None,
    load: Floats,
    stiffness: Floats,
) -> Totals:
    """Compute the forces of all contacts, and advance their shear forces by a step.

    Parameters
    ----------
    slabs : ndarray (k + 1,)
        First contact of each slab, and the number of contacts (`modal.tools.slabs`).
    geometry : Geometry
        Spheres, walls, and the list of contacts.
    laws : tuple of 2
        The contact law between two spheres, and between a sphere and a wall.
    step : ShearStep or None
        Motion and history, which is updated in place; None for normal forces alone.
    load : ndarray (n, 6) or (n, 3)
        Filled with the net force and torque on each sphere, N and N m; (n, 3) without history.
    stiffness : ndarray (n,) or (0,)
        Filled with the sum of the normal stiffnesses of each sphere, N/m; (0,) if not needed.

    Returns
    -------
    Totals
        Sums over all contacts.
    """
    if numba is None:
        return forces_by_arrays(slabs, geometry, laws, step, load, stiffness)
    law_numbers = (*laws[0], *laws[1])
    step_or_none = NO_STEP if step is None else step
    loop = _compile_loop(type(laws[0]))
    return Totals(*loop(slabs, load, stiffness, geometry, law_numbers, step_or_none).tolist())


@cache
def _compile_loop(law: type[ContactLaw]) -> Loop:
    """Return the loop, compiled for the class of a contact model."""
    module = sys.modules[law.__module__]
    for helper in vars(module).values():
        if isinstance(helper, FunctionType) and helper.__module__ == module.__name__:
            elementwise(helper)
    replaced = {"Law": law, "LAW_NUMBERS": len(law._fields)}
    for name in LAW_FUNCTIONS:
        replaced[name] = elementwise(getattr(law, name))
    for name in OPTIONAL_FUNCTIONS:
        if hasattr(law, name):
            replaced[name] = elementwise(getattr(law, name))
    replaced["ADHESIVE"] = hasattr(law, "friction_force")
    replaced["RESISTS_TURNING"] = resists_turning(law)
    if acts_across_gaps(law):
        replaced |= {"ACTS_ACROSS_GAPS": True, "OPEN": -np.inf}
    sources = fingerprint(module, contact_step)
    for part in (_list_candidates, _add_forces_of_slab):
        replaced[part.__name__] = compiled_part(part, sources, replaced, fastmath={"contract"})
    return compiled(_add_forces_by_slabs, 1, sources, replaced)


def _add_forces_by_slabs(slabs, load, stiffness, geometry, laws, step):
    """Fill `load` and `stiffness`, slab after slab, and return the sums of `Totals` as an array.

    The arguments are described at `forces_by_loop`; `laws` holds the parameters of both contact
    laws. No two even slabs share a sphere, nor do two odd ones.
    """
    # A loop over threads takes no named tuples: they are unpacked outside, and made again inside.
    position, ends, shift, cell, walls, radius = geometry
    (
        velocity,
        time_step,
        change,
        friction,
        normal,
        shear,
        work,
        moment,
        rolling,
        twisting,
    ) = step
    load[:] = 0
    stiffness[:] = 0
    count = len(slabs) - 1
    totals = np.zeros((count, TOTALS))
    rows = np.empty(len(ends), np.uint32)
    for odd in range(2):
        for half in prange((count + 1 - odd) // 2):
            k = 2 * half + odd
            places = Geometry(position, ends, shift, cell, walls, radius)
            motion = _Motion(velocity, time_step, change, friction, rolling, twisting)
            sums = _Sums(load, stiffness, totals[k])
            _add_forces_of_slab(
                slabs[k],
                slabs[k + 1],
                rows,
                places,
                laws,
                motion,
                sums,
                normal,
                shear,
                work,
                moment,
            )
    return totals.sum(axis=0)


class _Motion(NamedTuple):
    """The fields of `ShearStep` that do not belong to the history."""

    velocity: Floats | None
    time_step: float | None
    change: Floats | None
    friction: float | None
    rolling: float | None
    twisting: float | None


class _Sums(NamedTuple):
    """The arrays to which a loop adds: load and stiffness of each sphere, and totals of a slab."""

    load: Floats
    stiffness: Floats
    totals: Floats


@inlined
def _vector(values, row, first):
    """Return the vector (x, y, z) in three columns of a row of `values`, from column `first` on."""
    return values[row, first], values[row, first + 1], values[row, first + 2]


@inlined
def _add_torque(load, sphere, lever, moment):
    """Add the torque of a shear force on a sphere, `lever` times `moment`, to its load."""
    load[sphere, 3] += lever * moment[0]
    load[sphere, 4] += lever * moment[1]
    load[sphere, 5] += lever * moment[2]


@inlined
def _set(values, row, vector):
    """Write a vector (x, y, z) into a row of an array."""
    values[row, 0] = vector[0]
    values[row, 1] = vector[1]
    values[row, 2] = vector[2]


@inlined
def _branch_vector(position, shift, cell, c, i, j):
    """Return the vector, m, from sphere i to the image of sphere j at which contact c lies."""
    up = shift[c, 2]
    x = position[j, 0] - position[i, 0] + shift[c, 0] * cell[0] + up * cell[3]
    y = position[j, 1] - position[i, 1] + shift[c, 1] * cell[1] + up * cell[4]
    z = position[j, 2] - position[i, 2] + up * cell[2]
    return x, y, z


@inlined
def _gain_of_periods(shift, change, c):
    """Return the change in the step of the periods between the two ends of contact c, m."""
    up = shift[c, 2]
    x = shift[c, 0] * change[PERIODS, 0] + up * change[LEAN, 0]
    y = shift[c, 1] * change[PERIODS, 1] + up * change[LEAN, 1]
    return x, y, up * change[PERIODS, 2]


def _list_candidates(first, last, geometry, normal, rows):
    """Write the numbers of a slab's contacts that must be computed into `rows` (m,).

    These are the contacts with walls, and the pairs that touch or have touched.

    The numbers are written from `first` on, and the end of the written part is returned. Whether a
    pair touches is unpredictable for a processor: this loop has no branch, so that wrong
    predictions cost no time.
    """
    position, ends, shift, cell, _, radius = geometry
    end = np.uint64(first)
    # Numbers without sign: for others numba looks at each access whether it counts from the end.
    for c in range(np.uint64(first), np.uint64(last)):
        i = np.uint64(ends[c, 0])
        j = np.uint64(max(ends[c, 1], 0))
        reach = radius[i] + radius[j]
        x, y, z = _branch_vector(position, shift, cell, c, i, j)
        rows[end] = c
        keep = (x * x + y * y + z * z < reach * reach) | (ends[c, 1] < 0)
        if normal is not None:
            keep |= (normal[c, 0] != 0) | (normal[c, 1] != 0) | (normal[c, 2] != 0)
        end += np.uint64(keep)
    return end


def _add_forces_of_slab(
    first, last, rows, geometry, laws, motion, sums, normal, shear, work, moment
):  # fmt: skip
    """Add the forces of contacts `first` to `last` - 1 to a load, and write their totals.

    `laws` holds the parameters of both contact laws; `rows` (m,) is work space for the contacts of
    the slab. The arrays of the history are single arguments, because numba leaves out the code that
    depends on an argument that is None, but not that which depends on a field.
    """
    # Arrays are taken from the tuples once: in the loop each access would count references.
    position, ends, shift, cell, walls, radius = geometry
    velocity, time_step, change, friction, rolling, twisting = motion
    load, stiffness, totals = sums
    pair_law = Law(*laws[:LAW_NUMBERS])
    wall_law = Law(*laws[LAW_NUMBERS:])
    with_stiffness = len(stiffness) > 0
    sum_normal = 0.0
    sum_contact = 0.0
    touching = 0
    sliding = 0
    virial_x = 0.0
    virial_y = 0.0
    virial_z = 0.0
    energy = 0.0
    sum_stiffness = 0.0
    on_source = (0.0, 0.0, 0.0)
    on_receiver = (0.0, 0.0, 0.0)
    source_torque = 0.0
    receiver_torque = 0.0
    end_of_rows = _list_candidates(first, last, geometry, normal, rows)
    for row in range(np.uint64(first), end_of_rows):
        c = np.uint64(rows[row])
        i = np.uint64(ends[c, 0])
        end = ends[c, 1]
        j = np.uint64(max(end, 0))
        radius_i = radius[i]
        overlap = OPEN
        least_overlap = 0.0
        effective_radius = 0.0
        longer = 0.0
        law = pair_law
        has_touched = False
        if ACTS_ACROSS_GAPS and shear is not None:
            has_touched = normal[c, 0] != 0 or normal[c, 1] != 0 or normal[c, 2] != 0
        if end >= 0:
            bx, by, bz = _branch_vector(position, shift, cell, c, i, j)
            square = bx * bx + by * by + bz * bz
            reach = radius_i + radius[j]
            farthest = reach
            if ACTS_ACROSS_GAPS:
                effective_radius = radius_i * (radius[j] / reach)
                if has_touched:
                    least_overlap = -rupture_distance(law, effective_radius)
                    farthest = reach - least_overlap
            if 0.0 < square < farthest * farthest:
                distance = np.sqrt(square)
                overlap = reach - distance
                longer = radius[j] - radius_i
                # In this order the half of a radius comes out to the last bit.
                effective_radius = radius_i * (radius[j] / reach)
                inverse = 1 / distance
                n = (bx * inverse, by * inverse, bz * inverse)
        else:
            wall = 0 if end == SOURCE_WALL else 1
            outward = -1.0 if end == SOURCE_WALL else 1.0
            n = (0.0, 0.0, outward)
            bx = 0.0
            by = 0.0
            bz = walls[wall] - position[i, 2]
            overlap = radius_i - outward * bz
            effective_radius = radius_i
            law = wall_law
            if ACTS_ACROSS_GAPS and has_touched:
                least_overlap = -rupture_distance(law, effective_radius)
        if overlap <= least_overlap:
            if shear is not None and (normal[c, 0] != 0 or normal[c, 1] != 0 or normal[c, 2] != 0):
                _set(normal, c, (0.0, 0.0, 0.0))
                _set(shear, c, (0.0, 0.0, 0.0))
                if moment is not None:
                    _set(moment, c, (0.0, 0.0, 0.0))
                if len(work):
                    # What an opening contact had stored in shear is dissipated.
                    work[c, 1] += work[c, 0]
                    work[c, 0] = 0.0
                    if ACTS_ACROSS_GAPS:
                        # What a contact gives off that breaks under tension is dissipated, too.
                        work[c, 1] += elastic_energy(law, least_overlap, effective_radius)
            continue
        pressed = normal_force(law, overlap, effective_radius)
        fx = -pressed * n[0]
        fy = -pressed * n[1]
        fz = -pressed * n[2]
        if shear is not None:
            lever = radius_i - overlap / 2
            approach = (-velocity[i, 0], -velocity[i, 1], -velocity[i, 2])
            spin_sum = _vector(velocity, i, 3)
            spin_j = (0.0, 0.0, 0.0)
            gained = _gain_of_periods(shift, change, c)
            if end >= 0:
                approach = plus(approach, 1.0, _vector(velocity, j, 0))
                spin_j = _vector(velocity, j, 3)
                spin_sum = plus(spin_sum, 1.0, spin_j)
            else:
                # From the line about which the source wall turns.
                x = position[i, 0] - change[TURN, 1]
                y = position[i, 1] - change[TURN, 2]
            if end == SOURCE_WALL:
                angle = time_step * change[TURN, 0]
                gained_x = change[SOURCE, 0] - angle * y
                gained_y = change[SOURCE, 1] + angle * x
                gained = (gained_x, gained_y, change[SOURCE, 2])
                spin_j = (0.0, 0.0, change[TURN, 0])
                spin_sum = plus(spin_sum, 1.0, spin_j)
            relative_motion = RelativeMotion(approach, spin_sum, spin_j, gained)
            slip = shear_increment(n, lever, longer, relative_motion, time_step)
            normal_before = _vector(normal, c, 0)
            before = turn_shear(_vector(shear, c, 0), normal_before, n, spin_sum, time_step)
            kt = stiffness_tangential(law, overlap, effective_radius)
            trial = plus(before, kt, slip)
            after = trial
            bearing = pressed
            if ADHESIVE:
                bearing = friction_force(law, overlap, effective_radius)
            limit = friction * bearing
            if dot(after, after) > limit * limit:
                share = friction_share(after, limit)
                after = (share * after[0], share * after[1], share * after[2])
                sliding += 1
            if len(work):
                if ACTS_ACROSS_GAPS and kt == 0.0:
                    stored = -work[c, 0]
                    dissipated = work[c, 0]
                else:
                    stored, dissipated = shear_work(before, trial, after, kt)
                work[c, 0] += stored
                work[c, 1] += dissipated
            _set(normal, c, n)
            _set(shear, c, after)
            fx = fx + after[0]
            fy = fy + after[1]
            fz = fz + after[2]
            torque = cross(n, after)
            _add_torque(load, i, lever, torque)
            if end >= 0:
                _add_torque(load, j, lever + longer, torque)
            elif end == SOURCE_WALL:
                source_torque -= x * fy - y * fx
            else:
                receiver_torque -= x * fy - y * fx
            if moment is not None:
                carried = turn_shear(_vector(moment, c, 0), normal_before, n, spin_sum, time_step)
                rolled, twisted = split_moment(carried, n)
                turn_across, turn_along = split_moment(relative_turn(relative_motion, time_step), n)
                kr = kt * effective_radius * effective_radius * (rolling > 0.0)
                kw = kt * effective_radius * effective_radius * (twisting > 0.0)
                arm = bearing * effective_radius
                rolling_bound = rolling * arm
                twisting_bound = twisting * arm
                if RESISTS_TURNING:
                    kr = stiffness_rolling(law, overlap, effective_radius)
                    kw = stiffness_twisting(law, overlap, effective_radius)
                    rolling_bound += rolling_limit(law, overlap, effective_radius)
                    twisting_bound += twisting_limit(law, overlap, effective_radius)
                rolled_freely = plus(rolled, kr, turn_across)
                twisted_freely = plus(twisted, kw, turn_along)
                rolling_after = cut_back(
                    rolled_freely, friction_share(rolled_freely, rolling_bound)
                )
                twisting_after = cut_back(
                    twisted_freely, friction_share(twisted_freely, twisting_bound)
                )
                if len(work) and kr > 0.0:
                    stored, dissipated = shear_work(rolled, rolled_freely, rolling_after, kr)
                    work[c, 0] += stored
                    work[c, 1] += dissipated
                if len(work) and kw > 0.0:
                    stored, dissipated = shear_work(twisted, twisted_freely, twisting_after, kw)
                    work[c, 0] += stored
                    work[c, 1] += dissipated
                couple = plus(rolling_after, 1.0, twisting_after)
                _set(moment, c, couple)
                _add_torque(load, i, 1.0, couple)
                if end >= 0:
                    _add_torque(load, j, -1.0, couple)
                elif end == SOURCE_WALL:
                    source_torque -= couple[2]
                else:
                    receiver_torque -= couple[2]
            sum_contact += np.sqrt(fx * fx + fy * fy + fz * fz)
        load[i, 0] += fx
        load[i, 1] += fy
        load[i, 2] += fz
        force = (fx, fy, fz)
        if end >= 0:
            load[j, 0] -= fx
            load[j, 1] -= fy
            load[j, 2] -= fz
            up = shift[c, 2]
            if up != 0:
                on_source = plus(on_source, 1.0 * up, force)
        elif end == SOURCE_WALL:
            on_source = plus(on_source, -1.0, force)
        else:
            on_receiver = plus(on_receiver, -1.0, force)
        kn = stiffness_normal(law, overlap, effective_radius)
        if with_stiffness:
            stiffness[i] += kn
            if end >= 0:
                stiffness[j] += kn
        if ADHESIVE:
            sum_normal += abs(pressed)
        else:
            sum_normal += pressed
        sum_stiffness += kn
        energy += elastic_energy(law, overlap, effective_radius)
        virial_x -= fx * bx
        virial_y -= fy * by
        virial_z -= fz * bz
        touching += 1
    # In the order of `Totals`.
    totals[0] = sum_normal
    totals[1] = sum_contact
    totals[2] = touching
    totals[3] = sliding
    totals[4] = virial_x
    totals[5] = virial_y
    totals[6] = virial_z
    totals[7] = energy
    totals[8] = sum_stiffness
    for axis in range(3):
        totals[9 + axis] = on_source[axis]
        totals[12 + axis] = on_receiver[axis]
    totals[15] = source_torque
    totals[16] = receiver_torque
