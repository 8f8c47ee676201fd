"""YADE's own contacts as a contact network (format of modal/network.py)."""

import numpy as np
from yade import O

from modal.network import RECEIVER_WALL, SOURCE_WALL, Network


def contact_network(sizes, study, provenance):
    """Read particles and contacts of the present scene; sphere ids are the indices."""
    n = sizes["n"]
    bodies = [O.bodies[k] for k in range(n)]
    cell = np.array([sizes["side"], sizes["side"], sizes["length"]])
    period = np.array([O.cell.hSize[axis][axis] for axis in range(3)])
    rows = {name: [] for name in ("i", "j", "normal", "lever_i", "lever_j", "kn", "ks")}
    rows |= {name: [] for name in ("force_n", "force_t", "overlap", "sliding", "shift")}
    for contact in O.interactions:
        if not contact.isReal:
            continue
        geom, phys = contact.geom, contact.phys
        i, j, sign = contact.id1, contact.id2, 1
        if i >= n:
            i, j, sign = j, i, -1
        # YADE adds cellDist periods to the second body, in the order of its own ids.
        shift = np.array(contact.cellDist) * sign
        point = np.array(geom.contactPoint)
        here = np.array(O.bodies[i].state.pos)
        if sign < 0:
            point = point + shift * period
        wall = {n: SOURCE_WALL, n + 1: RECEIVER_WALL}.get(j)
        there = point if wall else np.array(O.bodies[j].state.pos) + shift * period
        rows["i"].append(i)
        rows["j"].append(j if wall is None else wall)
        rows["normal"].append(sign * np.array(geom.normal))
        rows["lever_i"].append(point - here)
        rows["lever_j"].append(point - there)
        rows["kn"].append(phys.kn)
        rows["ks"].append(phys.ks)
        normal_force = np.array(phys.normalForce)
        rows["force_n"].append(float(np.dot(normal_force, np.array(geom.normal))))
        # YADE applies -(normal + shear force) to the first body.
        shear = np.array(phys.shearForce)
        rows["force_t"].append(-sign * shear)
        rows["overlap"].append(geom.penetrationDepth)
        limit = phys.tangensOfFrictionAngle * np.linalg.norm(normal_force)
        rows["sliding"].append(bool(np.linalg.norm(shear) >= limit * (1 - 1e-9)))
        rows["shift"].append(shift if wall is None else np.zeros(3))
    order = np.lexsort((rows["j"], rows["i"]))
    columns = {name: np.array(values)[order] for name, values in rows.items()}
    mass = np.array([body.state.mass for body in bodies])
    radius = np.array([body.shape.radius for body in bodies])
    solid = (4 / 3 * np.pi * radius**3).sum()
    ends = (columns["j"] >= 0).sum() * 2 + (columns["j"] < 0).sum()
    return Network(
        position=np.array([body.state.pos for body in bodies]),
        radius=radius,
        mass=mass,
        inertia=np.array([body.state.inertia[0] for body in bodies]),
        particle_i=columns["i"],
        particle_j=columns["j"],
        normal=columns["normal"],
        lever_i=columns["lever_i"],
        lever_j=columns["lever_j"],
        stiffness_normal=columns["kn"],
        stiffness_tangential=columns["ks"],
        force_normal=columns["force_n"],
        force_tangential=columns["force_t"],
        overlap=columns["overlap"],
        sliding=columns["sliding"],
        cell_shift=columns["shift"].astype(int),
        cell_size=cell,
        cell_periodic=np.array([True, True, False]),
        wall_position=np.array([0.0, sizes["length"]]),
        study=study
        | {
            "void_ratio": float(np.prod(cell) / solid - 1),
            "coordination_number": float(ends / n),
        },
        provenance=provenance,
    )
