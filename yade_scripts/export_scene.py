"""Any YADE scene as a contact network: spheres of own radii, kn and ks as YADE holds them.

In a script of your own, when the packing is at rest:

    import sys; sys.path.insert(0, "path/to/this/repository")
    from yade_scripts.export_scene import export_scene
    export_scene("mine.network.h5")

or of a saved scene, with the same version of YADE that saved it:

    yade -n -x -j1 yade_scripts/export_scene.py SCENE.yade.bz2 mine.network.h5

Clumps are one body, with YADE's mass, centre and tensor of inertia and the contacts of their
spheres. Cohesive-frictional contacts keep `kr` and `ktw` where their moment law is active.

Wall, Facet and Box bodies become the two flat walls at low and high z. A network's levers end in
the middle of the overlap, as YADE's torques do; for the motion of a sphere on a Wall it takes the
Wall's plane, and by default a "ratcheting" variant, which differ by overlap / radius. Other
cohesion and rolling resistance, walls that stand in the way along x or y, and cells at angles are
refused, in one line.
"""

import sys
from pathlib import Path

if __name__ == "__main__":
    # Inside YADE __file__ is YADE itself; the script is its first argument.
    sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O, config

from modal.formats.hdf5 import named
from modal.formats.provenance import Provenance, versions
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network, write_network
from modal.packing.rigid_bodies import Bodies, joined
from modal.tools.errors import InputError
from yade_scripts.export import spheres, springs

WALLS = ("Wall", "Facet", "Box")
CONTACTS = ("FrictPhys", "MindlinPhys", "CohFrictPhys")
"""Classes of contacts that are springs with friction, and may resist rolling and twisting."""
FLAT = 1e-6
"""Largest x or y of a wall's normal, and distance, in radii, of contacts from the wall's plane."""


def export_scene(path):
    """Write the network of the present scene; InputError for what a network does not know."""
    with named(path):
        network = network_of_scene()
    write_network(path, network)
    pulling = int((network.force_normal < 0).sum())
    print(
        f"{path}: {network.n_particles} spheres, {network.n_contacts} contacts, "
        f"{int(network.with_wall.sum())} of them with walls, {pulling} pull"
    )


def network_of_scene():
    """The spheres and contacts of the present scene; spheres in the order of their ids."""
    bodies = _spheres()
    index = {body.id: k for k, body in enumerate(bodies)}
    position = np.array([body.state.pos for body in bodies])
    of_spheres = spheres(bodies)
    radius = of_spheres["radius"]
    contacts = [contact for contact in O.interactions if contact.isReal]
    for contact in contacts:
        _refuse_unknown(contact)
    # The first body is a sphere: a contact with a wall is turned round where it comes first.
    swap = np.array([contact.id1 not in index for contact in contacts], dtype=bool)
    sign = np.where(swap, -1, 1)
    ends = [(c.id2, c.id1) if s else (c.id1, c.id2) for c, s in zip(contacts, swap, strict=True)]
    i = np.array([index[first] for first, _ in ends], dtype=int)
    j = np.array([index.get(second, SOURCE_WALL) for _, second in ends], dtype=int)
    wall = j < 0
    of_contacts = springs(contacts, sign, i, j, radius)
    normal, overlap = of_contacts["normal"], of_contacts["overlap"]
    j[wall & (normal[:, 2] > 0)] = RECEIVER_WALL
    reach = position[i, 2] + np.sign(normal[:, 2]) * (radius[i] - overlap)
    walls = _planes(ends, normal, reach, radius[i], j)
    low, high, periodic = _cell(position, radius, walls)
    periods = np.floor((position - low) / (high - low)).astype(int) * periodic
    position = position - periods * (high - low)
    # YADE adds cellDist periods to the second body.
    shift = sign[:, None] * np.array([c.cellDist for c in contacts], dtype=int).reshape(-1, 3)
    partner = np.where(wall, 0, j)
    shift = np.where(wall[:, None], 0, shift + periods[partner] - periods[i])
    network = Network(
        position=position,
        **of_spheres,
        particle_i=i,
        particle_j=j,
        **of_contacts,
        cell_shift=shift,
        cell_size=high - low,
        cell_periodic=periodic,
        wall_position=np.array([low[2], high[2]]),
        provenance=Provenance(
            "yade_scripts/export_scene.py", versions=versions(yade=config.version)
        ).attributes(),
    )
    clumps = sorted({body.clumpId for body in bodies if body.isClumpMember})
    if not clumps:
        return network
    # Ids from 1, as no member of a clump has 0.
    own = np.array([body.clumpId + 1 if body.isClumpMember else 0 for body in bodies])
    return joined(network, own, _clumps(clumps))


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
    """The scene's spheres; other bodies may be walls, nothing else."""
    bodies = []
    for body in O.bodies:
        if body is None or body.shape is None:
            continue
        kind = type(body.shape).__name__
        if kind == "Sphere":
            bodies.append(body)
        elif kind not in ("Clump", *WALLS):
            raise InputError(f"body {body.id} is a {kind}; known are Sphere, {', '.join(WALLS)}")
    if not bodies:
        raise InputError("the scene has no spheres")
    return bodies


def _refuse_unknown(contact):
    """InputError for a contact that is more than springs with friction."""
    kind, where = type(contact.phys).__name__, f"contact {contact.id1}-{contact.id2}"
    if kind not in CONTACTS:
        raise InputError(f"{where} is a {kind}: known are {', '.join(CONTACTS)}, no other cohesion")
    for name in ("kr", "ktw", "adhesionForce") if kind != "CohFrictPhys" else ():
        if getattr(contact.phys, name, 0.0):
            raise InputError(f"{where} has {name}: no spring of a network does that; set it to 0")
    if not hasattr(contact.geom, "penetrationDepth"):
        raise InputError(f"{where} is a {type(contact.geom).__name__}; use ScGeom or ScGeom6D")


def _planes(ends, normal, reach, radius, j):
    """z of the source and of the receiver wall, m, from the contacts; NaN for none."""
    planes = [np.nan, np.nan]
    for side, code in enumerate((SOURCE_WALL, RECEIVER_WALL)):
        at = np.flatnonzero(j == code)
        tilted = at[abs(normal[at, :2]).max(axis=1, initial=0.0) > FLAT]
        if len(tilted):
            first, second = ends[tilted[0]]
            raise InputError(
                f"sphere {first} touches body {second} along x or y: a network has flat walls at "
                "low and high z alone; turn the scene, or make x and y periodic"
            )
        if len(at):
            planes[side] = float(np.median(reach[at]))
            off = at[abs(reach[at] - planes[side]) > FLAT * radius[at]]
            if len(off):
                first, second = ends[off[0]]
                raise InputError(
                    f"sphere {first} touches body {second} at z = {reach[off[0]]:.6g} m, others "
                    f"at {planes[side]:.6g} m: a network has one flat wall at each end"
                )
    return planes


def _cell(position, radius, walls):
    """Low and high corner (3,), m, and periods (3,) bool; between the walls, if there are any."""
    low, high = (position - radius[:, None]).min(axis=0), (position + radius[:, None]).max(axis=0)
    periodic = np.zeros(3, bool)
    if O.periodic:
        size = np.array(O.cell.hSize)
        if abs(size - np.diag(np.diag(size))).max() > FLAT * size.max():
            raise InputError("the cell is at angles: only rectangular periods are known")
        periodic[:] = (True, True, all(np.isnan(wall) for wall in walls))
        low, high = np.where(periodic, 0.0, low), np.where(periodic, np.diag(size), high)
    if not periodic[2]:
        low[2], high[2] = (
            end if np.isnan(wall) else wall
            for wall, end in zip(walls, (low[2], high[2]), strict=True)
        )
    return low, high, periodic


def main():
    """Load a saved scene and export it."""
    from yade_scripts.scene import find_contacts

    if len(sys.argv) != 3:
        raise InputError("two arguments needed: SCENE.yade.bz2 OUT.network.h5")
    if not Path(sys.argv[1]).is_file():
        raise InputError(f"{sys.argv[1]}: no such file; check the name")
    O.load(sys.argv[1])
    # Geometry is not saved with every contact: a step without motion makes it again.
    find_contacts()
    export_scene(sys.argv[2])


if __name__ == "__main__":
    from yade_scripts.scene import finish

    finish(main)
