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
    friction_share,
    shear_increment,
    shear_work,
    turn_shear,
)
from modal.packing.contact_models import ContactLaw, law_of_each
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Array, Bools, Floats, Ints
from modal.tools.loops import cross, dot, plus


class _Contacts(NamedTuple):
    """The contacts that touch.

    rows (k,): rows of these contacts in the list of pairs. i, j (k,): sphere, and sphere or wall.
    pair (k,): whether j is a sphere. partner (k,): j, or 0 for a wall. overlap, distance (k,), m.
    normal (3, k): unit vectors from i to j. radius_i, radius_j (k,), m: radii; the radius of a wall
    has no meaning.
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


def forces_by_arrays(
    slabs: Ints | None,
    geometry: Geometry,
    laws: tuple[ContactLaw, ContactLaw],
    step: ShearStep | None,
    load: Floats,
    stiffness: Floats,
) -> Totals:
    """Compute the forces of all contacts as `modal.dem.forces.forces_by_loop` does.

    `slabs` are not used.
    """
    count = len(geometry.position)
    contacts = _touching_contacts(geometry)
    i = contacts.i
    pair = contacts.pair
    j_of_pairs = contacts.j[pair]
    radius_j = contacts.radius_j
    # In this order the half of a radius comes out to the last bit.
    effective = contacts.radius_i * (radius_j / (contacts.radius_i + radius_j))
    effective = np.where(pair, effective, contacts.radius_i)
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
        shear = _advance_shear(geometry, step, contacts, normal_force, tangential)
        sliding = shear.sliding
        force = force + shear.force
        contact_force = np.sqrt(dot(force, force)).sum()
        x, y = _from_axis(geometry, step, i)
        torque_on_sphere = y * force[0] - x * force[1]
        for wall, code in enumerate((SOURCE_WALL, RECEIVER_WALL)):
            torques[wall] = torque_on_sphere[contacts.j == code].sum()
        moment = np.array(cross(contacts.normal, shear.force))
        torque_i = shear.lever_i * moment
        torque_j = (shear.lever_j * moment)[:, pair]
        for axis in range(3):
            load[:, 3 + axis] = np.bincount(i, torque_i[axis], count)
            load[:, 3 + axis] += np.bincount(j_of_pairs, torque_j[axis], count)
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
    sums = (normal_force.sum(), contact_force, len(contacts.rows), sliding, *virial)
    sums += (elastic_energy, normal_stiffness.sum(), *on_source, *on_receiver, *torques)
    return Totals(*sums)


def _touching_contacts(geometry: Geometry) -> _Contacts:
    """Return the contacts of the list that touch."""
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
    rows = np.flatnonzero((overlap > 0) & ((distance > 0) | ~pair))
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
    """Return how the ends of touching contacts move; vectors (3, k)."""
    change = step.change
    at_source = contacts.j == SOURCE_WALL
    motion_i = step.velocity[contacts.i].T
    motion_j = np.where(contacts.pair, step.velocity[contacts.partner].T, 0.0)
    spin_sum = motion_j[3:] + motion_i[3:]
    spin_sum[2] += np.where(at_source, change[TURN, 0], 0.0)
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
    normal_force: Floats,
    stiffness: Any,
) -> _Shear:
    """Return the shear forces after a step, and store them and the normals in `step`.

    `normal_force` (k,), N; `stiffness` (k,), N/m, is tangential.
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
    limit = step.friction * normal_force
    sliding = int((dot(trial, trial) > limit**2).sum())
    shear = trial * friction_share(trial, limit)
    if len(step.work):
        # What an opening contact had stored in shear is dissipated.
        opened = np.setdiff1d(np.arange(len(geometry.ends)), rows)
        step.work[opened, 1] += step.work[opened, 0]
        step.work[opened, 0] = 0
        step.work[rows] += np.transpose(shear_work(before, trial, shear, stiffness))
    step.normal[:] = 0
    step.shear[:] = 0
    step.normal[rows] = normal.T
    step.shear[rows] = shear.T
    return _Shear(shear, lever, lever + longer, sliding)
