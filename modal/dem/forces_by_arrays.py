"""Forces of all contacts by numpy: the fallback without numba, and the reference for the loop.

This takes about ten times as long as the compiled loop of `modal.dem.forces`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

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
from modal.packing.contact_models import (
    ContactLaw,
    acts_across_gaps,
    friction_force,
    law_of_each,
    rupture_distance,
    turning_limits,
    turning_stiffnesses,
)
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Array, Bools, Floats, Ints
from modal.tools.loops import cross, dot, plus


class _Contacts(NamedTuple):
    """The contacts that touch.

    rows (k,): rows of these contacts in the list of pairs. i, j (k,): sphere, and sphere or wall.
    pair (k,): whether j is a sphere. partner (k,): j, or 0 for a wall. overlap, distance (k,), m.
    normal (3, k): unit vectors from i to j. radius_i, radius_j (k,), m: radii; ignore radius_j of a
    wall.
    """

    rows: Ints
    i: Ints
    j: Ints
    pair: Bools
    partner: Ints
    overlap: Floats
    distance: Floats
    normal: Floats
    radius_i: Floats
    radius_j: Floats


class _Shear(NamedTuple):
    """The shear forces (3, k), N, of touching contacts, their levers (k,), m, at i and at j."""

    force: Floats
    lever_i: Floats
    lever_j: Floats
    sliding: int


class _TurningSprings(NamedTuple):
    """Springs of k contacts against turns.

    rolling, twisting (k,): stiffnesses, N m/rad. rolling_bound, twisting_bound (k,): largest
    moments, N m.
    """

    rolling: Floats
    twisting: Floats
    rolling_bound: Floats
    twisting_bound: Floats


def forces_by_arrays(
    slabs: Ints | None,
    geometry: Geometry,
    laws: tuple[ContactLaw, ContactLaw],
    step: ShearStep | None,
    load: Floats,
    stiffness: Floats,
) -> Totals:
    """Compute the forces of all contacts as `modal.dem.forces.forces_by_loop` does.

    `slabs` is ignored. The arguments and the result are described there.
    """
    count = len(geometry.position)
    contacts = _touching_contacts(geometry, laws, step)
    i = contacts.i
    pair = contacts.pair
    j_of_pairs = contacts.j[pair]
    effective = _effective_radius(pair, contacts.radius_i, contacts.radius_j)
    law = law_of_each(laws, ~pair)
    normal_force = law.normal_force(contacts.overlap, effective)
    normal_stiffness = law.stiffness_normal(contacts.overlap, effective)
    force = -normal_force * contacts.normal
    contact_force = 0.0
    sliding = 0
    torques = np.zeros(2)
    load[:] = 0
    if step is not None:
        tangential = law.stiffness_tangential(contacts.overlap, effective)
        bearing = friction_force(law, contacts.overlap, effective)
        broken = _energy_of_broken(geometry, laws, step, contacts)
        normal_before = step.normal[contacts.rows].T
        shear = _advance_shear(geometry, step, contacts, bearing, tangential)
        couple = None
        if step.moment is not None:
            springs = _TurningSprings(
                *turning_stiffnesses(law, contacts.overlap, effective, step.rolling, step.twisting),
                *_turning_bounds(step, law, contacts.overlap, effective, bearing),
            )
            couple = _advance_moment(geometry, step, contacts, springs, normal_before)
        if len(step.work):
            step.work[:, 1] += broken
        sliding = shear.sliding
        force = force + shear.force
        contact_force = np.sqrt(dot(force, force)).sum()
        x, y = _from_axis(geometry, step, i)
        torque_on_sphere = y * force[0] - x * force[1]
        for wall, code in enumerate((SOURCE_WALL, RECEIVER_WALL)):
            at_wall = contacts.j == code
            torques[wall] = torque_on_sphere[at_wall].sum()
            if couple is not None:
                torques[wall] -= couple[2, at_wall].sum()
        moment = np.array(cross(contacts.normal, shear.force))
        torque_i = shear.lever_i * moment
        torque_j = (shear.lever_j * moment)[:, pair]
        for axis in range(3):
            load[:, 3 + axis] = np.bincount(i, torque_i[axis], count)
            load[:, 3 + axis] += np.bincount(j_of_pairs, torque_j[axis], count)
            if couple is not None:
                load[:, 3 + axis] += np.bincount(i, couple[axis], count)
                load[:, 3 + axis] -= np.bincount(j_of_pairs, couple[axis, pair], count)
    for axis in range(3):
        load[:, axis] = np.bincount(i, force[axis], count)
        load[:, axis] -= np.bincount(j_of_pairs, force[axis, pair], count)
    if len(stiffness):
        stiffness[:] = np.bincount(i, normal_stiffness, count)
        stiffness += np.bincount(j_of_pairs, normal_stiffness[pair], count)
    virial = -(contacts.distance * force * contacts.normal).sum(axis=1)
    on_source = -force[:, contacts.j == SOURCE_WALL].sum(axis=1)
    on_receiver = -force[:, contacts.j == RECEIVER_WALL].sum(axis=1)
    periods_along_z = np.where(pair, geometry.shift[contacts.rows, 2], 0)
    on_source = on_source + (force * periods_along_z).sum(axis=1)
    elastic_energy = law.elastic_energy(contacts.overlap, effective).sum()
    sums = (abs(normal_force).sum(), contact_force, len(contacts.rows), sliding, *virial)
    sums += (elastic_energy, normal_stiffness.sum(), *on_source, *on_receiver, *torques)
    return Totals(*sums)


def _effective_radius(pair: Bools, radius_i: Floats, radius_j: Floats) -> Floats:
    """Return the effective radius (k,), m; `pair` (k,) marks contacts of two spheres."""
    # In this order the half of a radius comes out to the last bit.
    return np.where(pair, radius_i * (radius_j / (radius_i + radius_j)), radius_i)


def _least_overlap(
    geometry: Geometry, laws: tuple[ContactLaw, ContactLaw], step: ShearStep | None
) -> Floats:
    """Return the overlap (m,), m, above which each listed pair has a force.

    The overlap is 0. It is negative if the pair has touched before and its contact model attracts
    across gaps.
    """
    i, j = geometry.ends.T
    if step is None or not acts_across_gaps(laws[0]):
        return np.zeros(len(i))
    pair = j >= 0
    radius = geometry.radius
    effective = _effective_radius(pair, radius[i], radius[np.where(pair, j, 0)])
    has_touched = step.normal.any(axis=1)
    return np.where(has_touched, -rupture_distance(law_of_each(laws, ~pair), effective), 0.0)


def _energy_of_broken(
    geometry: Geometry,
    laws: tuple[ContactLaw, ContactLaw],
    step: ShearStep,
    contacts: _Contacts,
) -> Floats:
    """Return the energies (m,), J, that contacts which break across a gap in this step release."""
    energy = np.zeros(len(geometry.ends))
    if not acts_across_gaps(laws[0]):
        return energy
    is_broken: Bools = np.any(step.normal, axis=1)
    is_broken[contacts.rows] = False
    i, j = geometry.ends[is_broken].T
    pair = j >= 0
    radius = geometry.radius
    effective = _effective_radius(pair, radius[i], radius[np.where(pair, j, 0)])
    law = law_of_each(laws, ~pair)
    energy[is_broken] = law.elastic_energy(-rupture_distance(law, effective), effective)
    return energy


def _touching_contacts(
    geometry: Geometry, laws: tuple[ContactLaw, ContactLaw], step: ShearStep | None
) -> _Contacts:
    """Return the listed contacts that have a force."""
    position, ends, shift, cell, walls, radius = geometry
    i, j = ends.T
    pair = j >= 0
    partner = np.where(pair, j, 0)  # a wall has no place among the spheres
    branch = position[partner] - position[i] + shift * cell[:3]
    branch[:, :2] += shift[:, 2:] * cell[3:]
    to_wall = walls[np.where(j == SOURCE_WALL, 0, 1)] - position[i, 2]
    # A sphere beyond a wall is pushed back: its distance is negative.
    outward = np.where(j == SOURCE_WALL, -1.0, 1.0)
    distance = np.where(pair, np.sqrt((branch**2).sum(axis=1)), outward * to_wall)
    reach = radius[i] + np.where(pair, radius[partner], 0.0)
    overlap = reach - distance
    acts = overlap > _least_overlap(geometry, laws, step)
    rows = np.flatnonzero(acts & ((distance > 0) | ~pair))
    pair = pair[rows]
    normal = np.where(pair, branch[rows].T / np.where(pair, distance[rows], 1.0), 0.0)
    normal[2, ~pair] = outward[rows][~pair]
    return _Contacts(
        rows=rows,
        i=i[rows],
        j=j[rows],
        pair=pair,
        partner=partner[rows],
        overlap=overlap[rows],
        distance=distance[rows],
        normal=normal,
        radius_i=radius[i[rows]],
        radius_j=radius[partner[rows]],
    )


def _from_axis(geometry: Geometry, step: ShearStep, spheres: Ints) -> Array:
    """Return the lateral positions (2, k), m, of spheres relative to the turning wall's axis."""
    away: Array = (geometry.position[spheres, :2] - step.change[TURN, 1:]).T
    return away


def _relative_motion(geometry: Geometry, step: ShearStep, contacts: _Contacts) -> RelativeMotion:
    """Return the velocities and spins at the ends of touching contacts; vectors (3, k)."""
    change = step.change
    at_source = contacts.j == SOURCE_WALL
    motion_i = step.velocity[contacts.i].T
    motion_j = np.where(contacts.pair, step.velocity[contacts.partner].T, 0.0)
    motion_j[5] += np.where(at_source, change[TURN, 0], 0.0)
    spin_sum = motion_j[3:] + motion_i[3:]
    shift = geometry.shift[contacts.rows]
    gained = np.where(contacts.pair, (shift * change[PERIODS] + shift[:, 2:] * change[LEAN]).T, 0.0)
    x, y = _from_axis(geometry, step, contacts.i)
    moved_by_turn = step.time_step * change[TURN, 0] * np.array([-y, x, 0 * x])
    gained = np.where(at_source, change[SOURCE][:, None] + moved_by_turn, gained)
    return RelativeMotion(motion_j[:3] - motion_i[:3], spin_sum, motion_j[3:], gained)


def _advance_shear(
    geometry: Geometry,
    step: ShearStep,
    contacts: _Contacts,
    bearing: Floats,
    stiffness: Any,
) -> _Shear:
    """Return the shear forces after a step, and store them and the normals in `step`.

    `bearing` (k,), N, is the force that friction is proportional to; `stiffness` (k,), N/m, is the
    tangential stiffness.
    """
    rows = contacts.rows
    normal = contacts.normal
    lever = contacts.radius_i - contacts.overlap / 2
    longer = np.where(contacts.pair, contacts.radius_j - contacts.radius_i, 0.0)
    motion = _relative_motion(geometry, step, contacts)
    slip = shear_increment(normal, lever, longer, motion, step.time_step)
    before = turn_shear(
        step.shear[rows].T, step.normal[rows].T, normal, motion.spin_sum, step.time_step
    )
    trial = np.array(plus(before, stiffness, slip))
    limit = step.friction * bearing
    sliding = int((dot(trial, trial) > limit**2).sum())
    shear = trial * friction_share(trial, limit)
    if len(step.work):
        # What an opening contact had stored in shear is dissipated.
        opened = np.setdiff1d(np.arange(len(geometry.ends)), rows)
        step.work[opened, 1] += step.work[opened, 0]
        step.work[opened, 0] = 0
        has_stiffness = stiffness > 0
        sprung = np.where(has_stiffness, stiffness, 1.0)
        stored, dissipated = shear_work(before, trial, shear, sprung)
        # A contact that loses its stiffness gives off what it had stored.
        earlier = step.work[rows, 0]
        step.work[rows, 0] += np.where(has_stiffness, stored, -earlier)
        step.work[rows, 1] += np.where(has_stiffness, dissipated, earlier)
    step.normal[:] = 0
    step.shear[:] = 0
    step.normal[rows] = normal.T
    step.shear[rows] = shear.T
    return _Shear(shear, lever, lever + longer, sliding)


def _turning_bounds(
    step: ShearStep, law: ContactLaw, overlap: Floats, radius: Floats, bearing: Floats
) -> tuple[Floats, Floats]:
    """Return the largest moments (k,), N m, of contacts in rolling and in twisting."""
    rolling_limit, twisting_limit = turning_limits(law, overlap, radius)
    arm = bearing * radius
    return step.rolling * arm + rolling_limit, step.twisting * arm + twisting_limit


def _advance_moment(
    geometry: Geometry,
    step: ShearStep,
    contacts: _Contacts,
    springs: _TurningSprings,
    normal_before: Floats,
) -> Floats:
    """Return the moments (3, k), N m, after a step, and store them in `step`.

    `normal_before` (3, k) are the normals before the step.
    """
    moment = step.moment
    assert moment is not None
    rows = contacts.rows
    motion = _relative_motion(geometry, step, contacts)
    carried = turn_shear(
        moment[rows].T, normal_before, contacts.normal, motion.spin_sum, step.time_step
    )
    before = split_moment(carried, contacts.normal)
    turn = split_moment(relative_turn(motion, step.time_step), contacts.normal)
    couple = np.zeros((3, len(rows)))
    stiffnesses = (springs.rolling, springs.twisting)
    bounds = (springs.rolling_bound, springs.twisting_bound)
    for kind in range(2):
        trial = plus(before[kind], stiffnesses[kind], turn[kind])
        after = cut_back(trial, friction_share(trial, bounds[kind]))
        couple += np.array(after)
        if len(step.work):
            # Where a contact has lost its stiffness the work of the shear force counts it all.
            has_stiffness = stiffnesses[kind] > 0
            sprung = np.where(has_stiffness, stiffnesses[kind], 1.0)
            stored, dissipated = shear_work(before[kind], trial, after, sprung)
            step.work[rows, 0] += np.where(has_stiffness, stored, 0.0)
            step.work[rows, 1] += np.where(has_stiffness, dissipated, 0.0)
    moment[:] = 0
    moment[rows] = couple.T
    return couple
