"""YADE's own contacts as a contact network (format of modal/packing/network.py)."""

import numpy as np
from yade import O

from modal.packing.network import Network
from modal.packing.sample import void_ratio
from yade_scripts.scene import cell_side, sizes, wall_faces
from yade_scripts.state import canonical_contacts, present_positions


def spheres(bodies):
    """What a network holds of YADE's spheres besides their places: radius, mass, inertia, (n,)."""
    return {
        "radius": np.array([body.shape.radius for body in bodies]),
        "mass": np.array([body.state.mass for body in bodies]),
        "inertia": np.array([body.state.inertia[0] for body in bodies]),
    }


def springs(contacts, sign, i, j, radius):
    """What a network holds of YADE's contacts (m,) besides their ends and shifts, as YADE has it.

    `sign` (m,) is -1 where YADE's first body is not sphere `i`; `j` is negative for walls; `radius`
    (n,), m, of all spheres.
    """
    sign, wall = sign[:, None], j < 0
    normal = sign * np.array([c.geom.normal for c in contacts]).reshape(-1, 3)
    overlap = np.array([c.geom.penetrationDepth for c in contacts])
    pressed = sign * np.array([c.phys.normalForce for c in contacts]).reshape(-1, 3)
    # YADE applies -(normal + shear force) to the first body.
    shear = -sign * np.array([c.phys.shearForce for c in contacts]).reshape(-1, 3)
    pushed = (pressed * normal).sum(axis=1)
    limit = np.array([c.phys.tangensOfFrictionAngle for c in contacts]) * pushed
    limit += [0.0 if unbound(c.phys) else c.phys.shearAdhesion for c in contacts]
    # YADE puts the contact point in the middle of the overlap, also at a wall.
    lever_j = (overlap / 2 - radius[np.where(wall, 0, j)])[:, None] * normal
    return {
        "normal": normal,
        "lever_i": (radius[i] - overlap / 2)[:, None] * normal,
        "lever_j": np.where(wall[:, None], 0.0, lever_j),
        "stiffness_normal": np.array([c.phys.kn for c in contacts]),
        "stiffness_tangential": np.array([c.phys.ks for c in contacts]),
        "force_normal": pushed,
        "force_tangential": shear,
        "overlap": overlap,
        "sliding": np.linalg.norm(shear, axis=1) >= limit * (1 - 1e-9),
        **turning(contacts),
    }


def unbound(phys):
    """Whether a contact has no cohesion, or none any more."""
    return getattr(phys, "cohesionBroken", True)


def turning(contacts):
    """Stiffnesses (m,) against rolling and twisting, N m/rad, of contacts whose law has them.

    Cohesive-frictional contacts have them while they hold, if `momentRotationLaw` is set, and all
    of them with the law's `always_use_moment_law`. Their limits are not looked at.
    """
    always = any(
        getattr(law, "always_use_moment_law", False)
        for engine in O.engines
        for law in getattr(getattr(engine, "lawDispatcher", None), "functors", ())
    )
    resists = np.array([getattr(c.phys, "momentRotationLaw", False) for c in contacts], bool)
    resists &= np.array([always or not unbound(c.phys) for c in contacts], bool)
    if not resists.any():
        return {}
    names = {"stiffness_rolling": "kr", "stiffness_twisting": "ktw"}
    return {
        name: np.where(resists, [getattr(c.phys, own, 0.0) for c in contacts], 0.0)
        for name, own in names.items()
    }


def contact_network(n, study, provenance):
    """Read particles and contacts of the present scene; sphere ids are the indices.

    Contacts are in canonical order and centres inside the cell. Stiffnesses, forces, overlaps and
    contact points are those that YADE holds, not computed again.
    """
    position, _ = present_positions(n)
    side, walls = cell_side(), np.array(wall_faces(n))
    contacts, i, j, shift, sign = canonical_contacts(n)
    of_spheres = spheres([O.bodies[k] for k in range(n)])
    pair = j >= 0
    return Network(
        position=position,
        **of_spheres,
        particle_i=i,
        particle_j=j,
        **springs(contacts, sign, i, j, of_spheres["radius"]),
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
