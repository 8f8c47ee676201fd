"""Convert samples to YADE scenes and back, with velocities, strain rate and shear forces."""

from dataclasses import replace

import numpy as np
from yade import Matrix3, O, Vector3

from modal.packing.contact_law import HERTZ_MINDLIN
from modal.packing.neighbours import canonical, tangents
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.errors import InputError
from yade_scripts.scene import (
    TINY_TIME_STEP,
    call_before_motion,
    cell_side,
    find_contacts,
    place,
    set_engines,
    wall_faces,
)


def wrap_into_cell(position, low, size, periodic):
    """Return centres (n, 3), m, inside the cell, and the periods (n, 3) that were subtracted.

    The cell is given by its low corner, its size, m, and which axes are periodic, (3,) each.
    """
    periods = np.floor((position - low) / size) * periodic
    position = position - periods * size
    # Round-off may leave a centre exactly on the far side.
    on_edge = periodic & (position - low >= size)
    return np.where(on_edge, low, position), (periods + on_edge).astype(int)


def present_positions(n):
    """Return centres (n, 3), m, inside the lateral cell, and the periods (n, 3) subtracted."""
    position = np.array([O.bodies[k].state.pos for k in range(n)])
    size = np.array([*cell_side(), 1.0])
    return wrap_into_cell(position, 0.0, size, np.array([True, True, False]))


def canonical_contacts(ids, periods):
    """Return YADE's contacts in canonical order (i, j, shift), with their ends and normals.

    `ids` (n,) are the bodies of the spheres; all other bodies are walls, low or high according to
    the normal of the contact. `periods` (n, 3) were subtracted from the places of the spheres.

    Returns
    -------
    list (m,)
        YADE's interactions.
    particle_i, particle_j : ndarray (m,)
        Ends of the contacts.
    cell_shift : ndarray (m, 3)
        Periods between the ends.
    sign : ndarray (m,)
        -1 where YADE's first body is not particle i, else 1.
    normal : ndarray (m, 3)
        Unit vectors from particle i.
    """
    index = {body: k for k, body in enumerate(ids)}
    contacts = [contact for contact in O.interactions if contact.isReal]
    ends = [(index.get(contact.id1, -1), index.get(contact.id2, -1)) for contact in contacts]
    first, second = np.array(ends, dtype=int).reshape(-1, 2).T
    normal = np.array([contact.geom.normal for contact in contacts]).reshape(-1, 3)
    # YADE adds cellDist periods to the second body, in the order of its own ids.
    shift = np.array([contact.cellDist for contact in contacts], dtype=int).reshape(-1, 3)
    shift = shift + periods[second] - periods[first]
    swap = first < 0
    upwards = normal[:, 2] * np.where(swap, -1, 1) > 0
    i = np.where(swap, second, first)
    j = np.where(swap, first, second)
    j = np.where(j >= 0, j, np.where(upwards, RECEIVER_WALL, SOURCE_WALL))
    rows, i, j, shift, turned = canonical(i, j, shift)
    sign = np.where(swap[rows] ^ turned, -1, 1)
    return [contacts[k] for k in rows], i, j, shift, sign, sign[:, None] * normal[rows]


def read_scene(sample, *, moving):
    """Return the present state of the scene that was built from `sample`, as a sample.

    With `moving` the sample has velocities and the strain rate. Positions are wrapped into the
    cell, and velocities, which contain the affine motion of the cell, are changed accordingly. Only
    the tangential part of shear forces is stored, because under the law a normal part of second
    order builds up. YADE's contacts do not include the motion of the last step yet: a step without
    motion opens and closes them at the present positions. Their shear forces lack the increment of
    the last step, which the first step after `resume_cell` adds.
    """
    n = len(sample.position)
    call_before_motion()  # no control in the step without motion
    _strain_cell(1.0)
    O.dt = TINY_TIME_STEP
    O.step()
    position, periods = present_positions(n)
    states = [O.bodies[k].state for k in range(n)]
    contacts, *_, sign, normal = canonical_contacts(range(n), periods)
    # YADE applies minus the contact force to the first body.
    force = -sign[:, None] * np.array([c.phys.shearForce for c in contacts]).reshape(-1, 3)
    first, second = tangents(normal)
    sample = replace(
        sample,
        position=position,
        side=np.array(cell_side()),
        walls=np.array(wall_faces(n)),
        shear=np.column_stack([(force * first).sum(axis=1), (force * second).sum(axis=1)]),
        velocity=None,
        angular_velocity=None,
        strain_rate=None,
    )
    if moving:
        rate = np.array([O.cell.velGrad[axis, axis] for axis in range(3)])
        sample.velocity = np.array([state.vel for state in states])
        sample.velocity[:, :2] -= rate[:2] * periods[:, :2] * sample.side
        sample.angular_velocity = np.array([state.angVel for state in states])
        sample.strain_rate = rate
    return sample


def _strain_cell(power):
    """Strain the cell by one step at its present rate (power 1), or undo such a step (power -1)."""
    size = O.cell.hSize
    for axis in range(3):
        size[axis, axis] *= (1 + O.dt * O.cell.velGrad[axis, axis]) ** power
    O.cell.hSize = size


def resume_cell():
    """Undo one step of the cell's strain, before the first step of a sample in motion.

    `O.dt` must be set. YADE strains the cell at the beginning of a step, after the spheres have
    moved at the end of the step before; in a stored sample cell and spheres have both moved.
    """
    _strain_cell(-1.0)


def _refuse_other_scenes(sample):
    """Raise InputError for a sample whose walls, contacts or bodies YADE's scenes do not have."""
    model = sample.material.contact_model
    if model != HERTZ_MINDLIN or sample.resists_turning:
        kind = "moments of contacts" if model == HERTZ_MINDLIN else f"contacts of {model}"
        raise InputError(
            "other_law",
            f"the sample has {kind}",
            "scenes have YADE's contacts of Hertz and Mindlin, without moments",
            "take the waves of `granular-modes`, which have them",
        )
    if sample.clumps is not None:
        raise InputError(
            "clumps",
            "the sample has clumps",
            "scenes of samples have single spheres",
            "take the waves of `granular-modes`, which move clumps",
        )
    if sample.periodic_z:
        raise InputError(
            "no_walls",
            "the sample is periodic along z",
            "scenes have walls",
            "take a sample with walls",
        )
    if sample.fixed is not None:
        raise InputError(
            "held_bodies",
            "the sample has held spheres",
            "scenes of samples move all spheres",
            "take the waves of `granular-modes`, which hold them",
        )


def build_scene(sample, *, margin, damping):
    """Build the scene of a sample, with its contacts, shear forces and velocities.

    `margin` is the reach of the collider in radii, `damping` the local damping. Raises InputError
    for a sample that YADE's scenes do not support, or if YADE finds other contacts than the sample
    has.
    """
    n = len(sample.position)
    _refuse_other_scenes(sample)
    O.reset()
    place(
        sample.position,
        sample.side,
        sample.walls,
        sample.friction,
        sample.sizes,
        glass=sample.material,
        densities=sample.densities,
        wall=sample.wall_material,
    )
    set_engines(margin=margin, damping=damping)
    rate = np.zeros(3) if sample.strain_rate is None else sample.strain_rate
    O.cell.velGrad = Matrix3(rate[0], 0, 0, 0, rate[1], 0, 0, 0, rate[2])
    find_contacts()
    if sample.shear is not None:
        _, periods = present_positions(n)
        contacts, *_, sign, normal = canonical_contacts(range(n), periods)
        if len(contacts) != len(sample.shear):
            raise InputError(
                "other_contacts",
                f"the sample has {len(sample.shear)} shear forces, YADE finds {len(contacts)} "
                "contacts",
                "the file is damaged or of another version",
                "make it again",
            )
        first, second = tangents(normal)
        shear = -sign[:, None] * (sample.shear[:, :1] * first + sample.shear[:, 1:] * second)
        for contact, force in zip(contacts, shear.tolist(), strict=True):
            # The law goes on from the elastic part and copies it to the other.
            contact.phys.shearElastic = contact.phys.shearForce = Vector3(*force)
        O.step()  # without motion: forces on the spheres now hold the shear forces
    velocity = sample.velocity
    if velocity is None:
        velocity = np.zeros((n, 3))
    angular_velocity = sample.angular_velocity
    if angular_velocity is None:
        angular_velocity = np.zeros((n, 3))
    for k in range(n):
        state = O.bodies[k].state
        state.vel = Vector3(*velocity[k])
        state.angVel = Vector3(*angular_velocity[k])
    for wall in (n, n + 1):
        state = O.bodies[wall].state
        state.vel = (0, 0, rate[2] * state.pos[2])
