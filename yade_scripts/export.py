"""Convert a YADE scene to a contact network, with radii, kn, ks and clumps as in YADE.

The module `export_scene` says which scenes can be exported.
"""

from dataclasses import replace

import numpy as np
from yade import O

from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.rigid_bodies import Bodies, joined
from modal.packing.state import void_ratio
from modal.packing.weight import with_gravity
from modal.tools.errors import InputError
from yade_scripts.held import held_motions
from yade_scripts.scene import wall_faces
from yade_scripts.state import canonical_contacts, wrap_into_cell

WALLS = ("Wall", "Facet", "Box")
"""Classes of bodies that become flat walls."""
CONTACTS = ("FrictPhys", "MindlinPhys", "CohFrictPhys")
"""Classes of contacts that are springs with friction, and may resist rolling and twisting."""
UNSUPPORTED = ("kr", "ktw", "adhesionForce")
"""Attributes of contacts other than CohFrictPhys that no spring of a network represents."""
FLAT = 1e-6
"""Largest x or y component of a wall's unit normal for which the wall counts as flat. Also the
largest distance, in radii, of a contact point from the wall's plane."""
SLIDING_SHARE = 1 - 1e-9
"""Share of the friction limit from which a contact slides: YADE cuts shear forces to round-off."""


def describe_springs(contacts, sign, normal, i, j, radius):
    """Return the arrays of a network that describe the springs of YADE's contacts (m,).

    `sign` (m,) and `normal` (m, 3) are those of `canonical_contacts`; `i` and `j` (m,) are the
    ends, j being negative for walls; `radius` (n,) are those of all spheres, m.
    """
    sign = sign[:, None]
    with_wall = j < 0
    overlap = np.array([c.geom.penetrationDepth for c in contacts])
    normal_force = sign * np.array([c.phys.normalForce for c in contacts]).reshape(-1, 3)
    # YADE applies -(normal + shear force) to the first body.
    shear = -sign * np.array([c.phys.shearForce for c in contacts]).reshape(-1, 3)
    force_normal = (normal_force * normal).sum(axis=1)
    limit = np.array([c.phys.tangensOfFrictionAngle for c in contacts]) * force_normal
    limit += [0.0 if is_unbound(c.phys) else c.phys.shearAdhesion for c in contacts]
    # YADE puts the contact point in the middle of the overlap, also at a wall.
    lever_j = (overlap / 2 - radius[np.where(with_wall, 0, j)])[:, None] * normal
    return {
        "normal": normal,
        "lever_i": (radius[i] - overlap / 2)[:, None] * normal,
        "lever_j": np.where(with_wall[:, None], 0.0, lever_j),
        "stiffness_normal": np.array([c.phys.kn for c in contacts]),
        "stiffness_tangential": np.array([c.phys.ks for c in contacts]),
        "force_normal": force_normal,
        "force_tangential": shear,
        "overlap": overlap,
        "sliding": np.linalg.norm(shear, axis=1) >= limit * SLIDING_SHARE,
        **describe_rotation_springs(contacts),
    }


def is_unbound(phys):
    """Return whether a contact has never had cohesion, or has lost its cohesion."""
    return getattr(phys, "cohesionBroken", True)


def describe_rotation_springs(contacts):
    """Return stiffnesses (m,) against rolling and twisting, N m/rad; empty if no contact has them.

    Cohesive-frictional contacts have these stiffnesses if `momentRotationLaw` is set: unbroken
    contacts always, broken ones only with the law's `always_use_moment_law`. The limits of their
    moments are not examined.
    """
    is_always_active = _uses_moment_law_always()
    resists = np.array([getattr(c.phys, "momentRotationLaw", False) for c in contacts], bool)
    resists &= np.array([is_always_active or not is_unbound(c.phys) for c in contacts], bool)
    if not resists.any():
        return {}
    rolling = [getattr(c.phys, "kr", 0.0) for c in contacts]
    twisting = [getattr(c.phys, "ktw", 0.0) for c in contacts]
    return {
        "stiffness_rolling": np.where(resists, rolling, 0.0),
        "stiffness_twisting": np.where(resists, twisting, 0.0),
    }


def note_gravity(network):
    """Return a network with the gravity of the scene's integrator noted, if it is not zero."""
    for engine in O.engines:
        gravity = np.array(getattr(engine, "gravity", (0, 0, 0)), float)
        if gravity.any():
            return with_gravity(network, gravity)
    return network


def _uses_moment_law_always():
    """Return whether a contact law of the scene applies moments to contacts that do not hold."""
    for engine in O.engines:
        dispatcher = getattr(engine, "lawDispatcher", None)
        for law in getattr(dispatcher, "functors", ()):
            if getattr(law, "always_use_moment_law", False):
                return True
    return False


def network_of_scene(walls=None):
    """Return the present scene as a network; spheres are in the order of their bodies' ids.

    Contacts are in canonical order and centres inside the cell. Stiffnesses, forces, overlaps and
    contact points are copied from YADE and not computed again. `walls` (2,) are z of source and
    receiver wall, m, if they are known; otherwise the contacts determine them. Raises InputError
    for a scene that a network cannot represent.
    """
    bodies = _find_spheres()
    ids = [body.id for body in bodies]
    position = np.array([body.state.pos for body in bodies])
    radius = np.array([body.shape.radius for body in bodies])
    contacts, i, j, _, _, normal = canonical_contacts(ids, np.zeros(position.shape, int))
    for contact in contacts:
        _refuse_unknown(contact)
    if walls is None:
        walls = _find_wall_planes(contacts, i, j, normal, position[:, 2], radius)
    low, high, periodic = _find_cell(position, radius, walls)
    vectors = _find_periods_at_angles(periodic)
    if vectors is None:
        position, periods = wrap_into_cell(position, low, high - low, periodic)
    else:
        periods = np.floor(position @ np.linalg.inv(vectors)).astype(int)
        position = position - periods @ vectors
    contacts, i, j, shift, sign, normal = canonical_contacts(ids, periods)
    network = Network(
        position=position,
        radius=radius,
        mass=np.array([body.state.mass for body in bodies]),
        inertia=np.array([body.state.inertia[0] for body in bodies]),
        particle_i=i,
        particle_j=j,
        **describe_springs(contacts, sign, normal, i, j, radius),
        cell_shift=shift,
        cell_size=high - low,
        cell_periodic=periodic,
        wall_position=np.array([low[2], high[2]]),
        fixed=held_motions(bodies),
        cell_vectors=vectors,
    )
    clump_ids = sorted({body.clumpId for body in bodies if body.isClumpMember})
    if not clump_ids:
        return network
    # Clumps are numbered from 1; 0 marks a sphere outside clumps.
    clump_numbers = np.array([body.clumpId + 1 if body.isClumpMember else 0 for body in bodies])
    return joined(network, clump_numbers, _read_clumps(clump_ids))


def contact_network(n, study, provenance):
    """Return the network of the scene of a sample with n spheres.

    Its `study` gets the void ratio and the coordination number.
    """
    network = network_of_scene(wall_faces(n))
    ends = 2 * network.n_contacts - int(network.with_wall.sum())
    properties = {"void_ratio": void_ratio(network), "coordination_number": ends / n}
    return replace(network, study=study | properties, provenance=provenance)


def _read_clumps(ids):
    """Return mass, kg, centre, m, and tensor of inertia, kg m^2, of clumps, as stored in YADE."""
    states = [O.bodies[clump_id].state for clump_id in ids]
    axes = np.array([state.ori.toRotationMatrix() for state in states]).reshape(-1, 3, 3)
    inertia = np.array([state.inertia for state in states])
    return Bodies(
        number=np.array(ids) + 1,
        mass=np.array([state.mass for state in states]),
        centre=np.array([state.pos for state in states]),
        tensor=np.einsum("nij,nj,nkj->nik", axes, inertia, axes),
    )


def _find_spheres():
    """Return the scene's spheres; raise InputError for unknown bodies."""
    bodies = []
    for body in O.bodies:
        if body is None or body.shape is None:
            continue
        kind = type(body.shape).__name__
        if kind == "Sphere":
            bodies.append(body)
        elif kind not in ("Clump", *WALLS):
            raise InputError(
                "unknown_body",
                f"body {body.id} is a {kind}",
                f"known are Sphere, {', '.join(WALLS)}",
            )
    if not bodies:
        raise InputError("no_spheres", "the scene has no spheres")
    return bodies


def _name(contact):
    """Return the name of a contact in messages, by the ids of its bodies."""
    return f"contact {contact.id1}-{contact.id2}"


def _refuse_unknown(contact):
    """Raise InputError for a contact that cannot be represented by springs with friction."""
    kind = type(contact.phys).__name__
    if kind not in CONTACTS:
        raise InputError(
            "unknown_contact",
            f"{_name(contact)} is a {kind}",
            f"known are {', '.join(CONTACTS)}, no other cohesion",
        )
    if kind != "CohFrictPhys":
        for attribute in UNSUPPORTED:
            if getattr(contact.phys, attribute, 0.0):
                raise InputError(
                    "unknown_contact",
                    f"{_name(contact)} has {attribute}",
                    "no spring of a network represents it",
                    "set it to 0",
                )
    if not hasattr(contact.geom, "penetrationDepth"):
        raise InputError(
            "unknown_contact",
            f"{_name(contact)} is a {type(contact.geom).__name__}",
            remedy="use ScGeom or ScGeom6D",
        )


def _find_wall_planes(contacts, i, j, normal, height, radius):
    """Return z of the source and of the receiver wall, m, from the contacts; NaN for none."""
    planes = [np.nan, np.nan]
    overlap = np.array([c.geom.penetrationDepth for c in contacts])
    contact_height = height[i] + np.sign(normal[:, 2]) * (radius[i] - overlap)
    for side, code in enumerate((SOURCE_WALL, RECEIVER_WALL)):
        rows = np.flatnonzero(j == code)
        tilted = rows[abs(normal[rows, :2]).max(axis=1, initial=0.0) > FLAT]
        if len(tilted):
            raise InputError(
                "lateral_wall",
                f"{_name(contacts[tilted[0]])} is along x or y",
                "a network has flat walls at low and high z alone",
                "turn the scene, or make x and y periodic",
            )
        if not len(rows):
            continue
        planes[side] = float(np.median(contact_height[rows]))
        deviation = abs(contact_height[rows] - planes[side])
        uneven = rows[deviation > FLAT * radius[i[rows]]]
        if len(uneven):
            raise InputError(
                "uneven_wall",
                f"{_name(contacts[uneven[0]])} is at z = {contact_height[uneven[0]]:.6g} m, others "
                f"with walls at {planes[side]:.6g} m",
                "a network has one flat wall at each end",
            )
    return planes


def _find_cell(position, radius, walls):
    """Return low and high corner (3,), m, and which axes are periodic (3,).

    The corners are at the walls, at the periods, or else at the outermost surfaces of spheres.
    """
    low = (position - radius[:, None]).min(axis=0)
    high = (position + radius[:, None]).max(axis=0)
    periodic = np.zeros(3, bool)
    if O.periodic:
        size = np.array(O.cell.hSize)
        periodic[:] = (True, True, np.isnan(walls).all())
        low = np.where(periodic, 0.0, low)
        high = np.where(periodic, np.diag(size), high)
    if not periodic[2]:
        source, receiver = walls
        if not np.isnan(source):
            low[2] = source
        if not np.isnan(receiver):
            high[2] = receiver
    return low, high, periodic


def _find_periods_at_angles(periodic):
    """Return the periods as rows (3, 3), m, if the cell is sheared; otherwise None.

    `periodic` (3,) are the axes with a period. Raises InputError for such a cell between walls.
    """
    if not O.periodic:
        return None
    vectors = np.array(O.cell.hSize).T
    if abs(vectors - np.diag(np.diag(vectors))).max() <= FLAT * vectors.max():
        return None
    if not periodic.all():
        raise InputError(
            "sheared_cell", "the cell is at angles", "between walls only right angles are known"
        )
    return vectors
