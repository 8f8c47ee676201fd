"""Spheres of one elastic material, equal or not: the network of their Hertz-Mindlin contacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.packing.contact_law import (
    Elasticity,
    Material,
    Moduli,
    normal_force,
    stiffness_normal,
    stiffness_tangential,
)
from modal.packing.neighbours import ContactList
from modal.packing.network import Network, freeze_arrays
from modal.tools.arrays import Bools, Floats


def network_of(
    contact: ContactList,
    radius: float | Floats,
    material: Material,
    *,
    densities: Floats | None = None,
    walls: Elasticity | None = None,
    tangential: Floats | None = None,
    friction: float | None = None,
    study: dict[str, Any],
    **places: Any,
) -> Network:
    """The network of spheres: springs of the Hertz-Mindlin law at the overlaps of `contact`.

    `radius` in m, of all, or of each (n,); `densities` (n,), kg/m^3, and `walls` where they are
    not those of the `material`; `tangential` (m, 3), N, forces on i, zero without; `friction` says
    which contacts slide, none without; `places` are the network's `position`, `cell_size`,
    `cell_periodic`, `wall_position` and `provenance`.
    """
    n, m, overlap = len(places["position"]), len(contact.particle_i), contact.overlap
    wall = contact.particle_j < 0
    each = np.broadcast_to(radius, n)
    first, second = each[contact.particle_i], each[np.where(wall, 0, contact.particle_j)]
    effective = np.where(wall, first, first * (second / (first + second)))
    of_pairs, of_walls = material.moduli, material.against(walls or material)
    moduli = zip(of_pairs, of_walls, strict=True)
    law = Moduli(*(np.where(wall, flat, curved) for curved, flat in moduli))
    force = normal_force(overlap, effective, law)
    if tangential is None:
        tangential = np.zeros((m, 3))
    sliding: Bools = np.zeros(m, bool)
    if friction is not None:
        sliding = np.linalg.norm(tangential, axis=1) >= friction * force * (1 - 1e-9)
    # The contact point lies in the middle of the overlap, also at a wall, as in the DEM law.
    lever = (first - overlap / 2)[:, None] * contact.normal
    backwards = (overlap / 2 - second)[:, None] * contact.normal
    backwards[wall] = 0
    mass, inertia = material.sphere(each, densities)
    columns: dict[str, Any] = freeze_arrays(
        radius=np.array(each),
        mass=mass,
        inertia=inertia,
        particle_i=contact.particle_i,
        particle_j=contact.particle_j,
        normal=contact.normal,
        lever_i=lever,
        lever_j=backwards,
        stiffness_normal=stiffness_normal(overlap, effective, law),
        stiffness_tangential=stiffness_tangential(overlap, effective, law),
        force_normal=force,
        force_tangential=tangential,
        overlap=overlap,
        sliding=sliding,
        cell_shift=contact.cell_shift,
    )
    return Network(**columns, study=study | constants(material, densities, walls), **places)


def constants(
    material: Material, densities: Floats | None, walls: Elasticity | None
) -> dict[str, float]:
    """What a network's `study` notes of its materials; no density where the spheres' differ."""
    noted = {"young": material.young, "poisson": material.poisson}
    if densities is None:
        noted["density"] = material.density
    if walls is not None:
        noted |= {"wall_young": walls.young, "wall_poisson": walls.poisson}
    return noted
