"""YADE's own contacts as a contact network (format of modal/packing/network_file.py)."""

import numpy as np
from yade import O

from modal.packing.network import Network
from modal.packing.sample import void_ratio
from yade_scripts.scene import cell_side, sizes, wall_faces
from yade_scripts.state import canonical_contacts, present_positions


def contact_network(n, study, provenance):
    """Read particles and contacts of the present scene; sphere ids are the indices.

    Contacts are in canonical order and centres inside the cell. Stiffnesses, forces, overlaps and
    contact points are those that YADE holds, not computed again.
    """
    bodies = [O.bodies[k] for k in range(n)]
    position, _ = present_positions(n)
    side, walls = cell_side(), np.array(wall_faces(n))
    contacts, i, j, shift, sign = canonical_contacts(n)
    geom, phys = [c.geom for c in contacts], [c.phys for c in contacts]
    overlap = np.array([g.penetrationDepth for g in geom])
    normal = sign[:, None] * np.array([g.normal for g in geom])
    radius = np.array([body.shape.radius for body in bodies])
    # YADE puts the contact point in the middle of the overlap, also at a wall.
    lever = (radius[i] - overlap / 2)[:, None] * normal
    backwards = (overlap / 2 - radius[np.where(j < 0, 0, j)])[:, None] * normal
    normal_force = np.array([p.normalForce for p in phys])
    shear = np.array([p.shearForce for p in phys])
    pressure = np.linalg.norm(normal_force, axis=1)
    limit = np.array([p.tangensOfFrictionAngle for p in phys]) * pressure
    pair = j >= 0
    return Network(
        position=position,
        radius=radius,
        mass=np.array([body.state.mass for body in bodies]),
        inertia=np.array([body.state.inertia[0] for body in bodies]),
        particle_i=i,
        particle_j=j,
        normal=normal,
        lever_i=lever,
        lever_j=np.where(pair[:, None], backwards, 0.0),
        stiffness_normal=np.array([p.kn for p in phys]),
        stiffness_tangential=np.array([p.ks for p in phys]),
        force_normal=pressure,
        # YADE applies -(normal + shear force) to the first body.
        force_tangential=-sign[:, None] * shear,
        overlap=overlap,
        sliding=np.linalg.norm(shear, axis=1) >= limit * (1 - 1e-9),
        cell_shift=shift,
        cell_size=np.array([*side, walls[1] - walls[0]]),
        cell_periodic=np.array([True, True, False]),
        wall_position=walls,
        study=study
        | {
            "void_ratio": void_ratio(n, sizes(n), side, walls[1] - walls[0]),
            "coordination_number": float((2 * pair.sum() + (~pair).sum()) / n),
        },
        provenance=provenance,
    )
