"""Any YADE scene as a contact network: own radii, kn and ks as YADE holds them, clumps.

`export_scene.py` says which scenes are known.
"""

from dataclasses import replace

import numpy as np
from yade import O

from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.rigid_bodies import Bodies, joined
from modal.packing.state import void_ratio
from modal.tools.errors import InputError
from yade_scripts.held import refuse_held
from yade_scripts.scene import wall_faces
from yade_scripts.state import canonical_contacts, inside

WALLS = ("Wall", "Facet", "Box")
CONTACTS = ("FrictPhys", "MindlinPhys", "CohFrictPhys")
"""Classes of contacts that are springs with friction, and may resist rolling and twisting."""
FLAT = 1e-6
"""Largest x or y of a wall's normal, and distance, in radii, of contacts from the wall's plane."""


def springs(contacts, sign, normal, i, j, radius):
    """What a network holds of YADE's contacts (m,) besides their ends and shifts, as YADE has it.

    `sign` and `normal` as of `canonical_contacts`; `j` is negative for walls; `radius` (n,), m, of
    all spheres.
    """
    sign, wall = sign[:, None], j < 0
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


def network_of_scene(walls=None):
    """The present scene as a network; spheres in the order of their bodies' ids.

    Contacts are in canonical order and centres inside the cell. Stiffnesses, forces, overlaps and
    contact points are those that YADE holds, not computed again. `walls` (2,): z of source and
    receiver wall, m, where they are known; else what the contacts tell.
    """
    bodies = _spheres()
    ids, position = [body.id for body in bodies], np.array([body.state.pos for body in bodies])
    radius = np.array([body.shape.radius for body in bodies])
    contacts, i, j, _, _, normal = canonical_contacts(ids, np.zeros(position.shape, int))
    for contact in contacts:
        _refuse_unknown(contact)
    if walls is None:
        walls = _planes(contacts, i, j, normal, position[:, 2], radius)
    low, high, periodic = _cell(position, radius, walls)
    position, periods = inside(position, low, high - low, periodic)
    contacts, i, j, shift, sign, normal = canonical_contacts(ids, periods)
    network = Network(
        position=position,
        radius=radius,
        mass=np.array([body.state.mass for body in bodies]),
        inertia=np.array([body.state.inertia[0] for body in bodies]),
        particle_i=i,
        particle_j=j,
        **springs(contacts, sign, normal, i, j, radius),
        cell_shift=shift,
        cell_size=high - low,
        cell_periodic=periodic,
        wall_position=np.array([low[2], high[2]]),
    )
    clumps = sorted({body.clumpId for body in bodies if body.isClumpMember})
    if not clumps:
        return network
    # Ids from 1, as no member of a clump has 0.
    own = np.array([body.clumpId + 1 if body.isClumpMember else 0 for body in bodies])
    return joined(network, own, _clumps(clumps))


def contact_network(n, study, provenance):
    """The network of a sample's scene; `study` gets its void ratio and coordination number."""
    network = network_of_scene(wall_faces(n))
    ends = 2 * network.n_contacts - int(network.with_wall.sum())
    found = {"void_ratio": void_ratio(network), "coordination_number": ends / n}
    return replace(network, study=study | found, provenance=provenance)


def _clumps(ids):
    """Mass, centre and tensor of inertia of clumps, as YADE has them."""
    states = [O.bodies[one].state for one in ids]
    axes = np.array([state.ori.toRotationMatrix() for state in states]).reshape(-1, 3, 3)
    inertia = np.array([state.inertia for state in states])
    return Bodies(
        number=np.array(ids) + 1,
        mass=np.array([state.mass for state in states]),
        centre=np.array([state.pos for state in states]),
        tensor=np.einsum("nij,nj,nkj->nik", axes, inertia, axes),
    )


def _spheres():
    """Return the scene's spheres, which move freely; other bodies may be walls, nothing else."""
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
                remedy=f"known are Sphere, {', '.join(WALLS)}",
            )
    if not bodies:
        raise InputError("no_spheres", "the scene has no spheres")
    refuse_held(bodies)
    return bodies


def _name(contact):
    """What a contact is called in messages: by the ids of its bodies."""
    return f"contact {contact.id1}-{contact.id2}"


def _refuse_unknown(contact):
    """InputError for a contact that is more than springs with friction."""
    kind, where = type(contact.phys).__name__, _name(contact)
    if kind not in CONTACTS:
        raise InputError(
            "input", f"{where} is a {kind}", f"known are {', '.join(CONTACTS)}, no other cohesion"
        )
    for name in ("kr", "ktw", "adhesionForce") if kind != "CohFrictPhys" else ():
        if getattr(contact.phys, name, 0.0):
            raise InputError(
                "input", f"{where} has {name}", "no spring of a network does that", "set it to 0"
            )
    if not hasattr(contact.geom, "penetrationDepth"):
        raise InputError(
            "input", f"{where} is a {type(contact.geom).__name__}", remedy="use ScGeom or ScGeom6D"
        )


def _planes(contacts, i, j, normal, height, radius):
    """z of the source and of the receiver wall, m, from the contacts; NaN for none."""
    planes, overlap = [np.nan, np.nan], np.array([c.geom.penetrationDepth for c in contacts])
    reach = height[i] + np.sign(normal[:, 2]) * (radius[i] - overlap)
    for side, code in enumerate((SOURCE_WALL, RECEIVER_WALL)):
        at = np.flatnonzero(j == code)
        tilted = at[abs(normal[at, :2]).max(axis=1, initial=0.0) > FLAT]
        if len(tilted):
            raise InputError(
                "input",
                f"{_name(contacts[tilted[0]])} is along x or y",
                "a network has flat walls at low and high z alone",
                "turn the scene, or make x and y periodic",
            )
        if len(at):
            planes[side] = float(np.median(reach[at]))
            off = at[abs(reach[at] - planes[side]) > FLAT * radius[i[at]]]
            if len(off):
                raise InputError(
                    "input",
                    f"{_name(contacts[off[0]])} is at z = {reach[off[0]]:.6g} m, others with walls "
                    f"at {planes[side]:.6g} m",
                    "a network has one flat wall at each end",
                )
    return planes


def _cell(position, radius, walls):
    """Low and high corner (3,), m, and periods (3,) bool; between the walls, if there are any."""
    low, high = (position - radius[:, None]).min(axis=0), (position + radius[:, None]).max(axis=0)
    periodic = np.zeros(3, bool)
    if O.periodic:
        size = np.array(O.cell.hSize)
        if abs(size - np.diag(np.diag(size))).max() > FLAT * size.max():
            raise InputError("input", "the cell is at angles", "only rectangular periods are known")
        periodic[:] = (True, True, all(np.isnan(wall) for wall in walls))
        low, high = np.where(periodic, 0.0, low), np.where(periodic, np.diag(size), high)
    if not periodic[2]:
        low[2], high[2] = (
            end if np.isnan(wall) else wall
            for wall, end in zip(walls, (low[2], high[2]), strict=True)
        )
    return low, high, periodic
