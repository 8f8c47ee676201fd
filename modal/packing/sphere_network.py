"""Spheres of one elastic material, equal or not: the network of their contacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.packing.contact_law import HERTZ_MINDLIN, Elasticity, Material
from modal.packing.contact_models import law_of_each, laws_of
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
    """The network of spheres: springs of their contact model at the overlaps of `contact`.

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
    law = law_of_each(laws_of(material, walls), wall)
    force = law.normal_force(overlap, effective)
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
        stiffness_normal=law.stiffness_normal(overlap, effective),
        stiffness_tangential=law.stiffness_tangential(overlap, effective),
        force_normal=force,
        force_tangential=tangential,
        overlap=overlap,
        sliding=sliding,
        cell_shift=contact.cell_shift,
    )
    return Network(**columns, study=study | constants(material, densities, walls), **places)


def constants(
    material: Material, densities: Floats | None, walls: Elasticity | None
) -> dict[str, Any]:
    """What a network's `study` notes of its materials; no density where the spheres' differ."""
    noted: dict[str, Any] = {"young": material.young, "poisson": material.poisson}
    if material.contact_model != HERTZ_MINDLIN:
        noted["contact_model"] = material.contact_model
    if densities is None:
        noted["density"] = material.density
    if walls is not None:
        noted |= {"wall_young": walls.young, "wall_poisson": walls.poisson}
    return noted
