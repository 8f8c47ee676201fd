"""Read contact laws from the notes of a packing, and compute the force that bounds friction."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from modal.formats.attributes import number_noted
from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, Elasticity, Material
from modal.packing.contact_models import friction_force, law_of_each, laws_of
from modal.packing.network import Network
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

ELASTIC = ("young", "poisson")
WALL_ELASTIC = ("wall_young", "wall_poisson")
"""Names of the elastic constants of walls, in attributes of files and in notes of networks."""


def noted_material(study: Mapping[str, Any]) -> Material:
    """Return the material in the notes of a network; missing constants are those of glass."""
    constants = {}
    for name in (*ELASTIC, "density"):
        number = number_noted(study, name)
        if number is not None:
            constants[name] = number
    contact_model = str(study.get("contact_model", HERTZ_MINDLIN))
    return replace(GLASS, contact_model=contact_model, **constants)


def noted_walls(study: Mapping[str, Any]) -> Elasticity | None:
    """Return the material of the walls in the notes of a network; None if there is none."""
    return wall_material({name: number_noted(study, name) for name in WALL_ELASTIC})


def wall_material(notes: Mapping[str, float | None]) -> Elasticity | None:
    """Return the material of the walls from notes or attributes; None if there is none.

    InputError if one of the two numbers is missing.
    """
    young = notes.get("wall_young")
    poisson = notes.get("wall_poisson")
    if young is None and poisson is None:
        return None
    if young is None or poisson is None:
        raise InputError(
            "incomplete",
            "one of wall_young and wall_poisson lacks",
            remedy="give both, or none",
        )
    return Elasticity(young, poisson)


def friction_bearing_force(network: Network) -> Floats:
    """Return the force (m,), N, whose product with the friction bounds each shear force.

    This is the normal force or, if the notes name an adhesive contact model, the force that presses
    the surfaces together. UnavailableError if forces or, for such a model, overlaps are absent;
    InputError for an unknown model.
    """
    purpose = "share of friction"
    force = network.require("force_normal", purpose)
    material = noted_material(network.study)
    if material.contact_model == HERTZ_MINDLIN:
        return force
    laws = laws_of(material, noted_walls(network.study))
    if not hasattr(laws[0], "friction_force"):
        return force
    wall = network.with_wall
    radius_i = network.radius[network.particle_i]
    radius_j = network.radius[network.partner]
    effective = np.where(wall, radius_i, radius_i * (radius_j / (radius_i + radius_j)))
    law = law_of_each(laws, wall)
    bearing: Floats = friction_force(law, network.require("overlap", purpose), effective)
    return bearing
