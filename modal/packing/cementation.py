"""Bond the contacts of a packing at rest by cement that hardens under its load.

The cement is without stress there: contacts keep their forces, and get the springs of a beam beside
their own (`modal.packing.contact_models.cement_bond`). A contact no longer slides.
"""

from dataclasses import replace

import numpy as np

from modal.packing.contact_law import Material
from modal.packing.contact_models import law_of_each, laws_of
from modal.packing.contact_models.cement_bond import MAX_STRAIN, STIFFNESS_RATIO
from modal.packing.network import Network
from modal.packing.noted_laws import noted_material, noted_walls
from modal.tools.errors import UnavailableError

CEMENT = "cement"
"""Note of a network: Young's modulus of its cement, Pa, radius of the beams divided by that of the
spheres, and ratio of normal to shear stiffness."""


def cemented(
    network: Network, young: float, radius_share: float, stiffness_ratio: float = STIFFNESS_RATIO
) -> Network:
    """Return the network with a beam of cement at each contact.

    Parameters
    ----------
    network : Network
        Of spheres.
    young : float
        Young's modulus of the cement, Pa.
    radius_share : float
        Radius of the beams divided by that of the spheres.
    stiffness_ratio : float
        Normal over shear stiffness of the beams.

    Raises
    ------
    InputError
        If no cement has such numbers.
    UnavailableError
        For bodies that are no spheres, whose radii of contact are not known, and for a network
        without contacts or with cement already.
    """
    if network.inertia_tensor is not None:
        raise UnavailableError("clumps", "cement between bodies that are no spheres")
    if not network.n_contacts:
        raise UnavailableError("no_contacts", "cement of spheres without contacts")
    if CEMENT in network.study:
        raise UnavailableError("cemented", "the contacts have cement already")
    # The strength does not enter the springs.
    model = f"cement-bond {young!r} {radius_share!r} {MAX_STRAIN * young!r} {stiffness_ratio!r}"
    material: Material = replace(noted_material(network.study), contact_model=model)
    wall = network.with_wall
    law = law_of_each(laws_of(material, noted_walls(network.study)), wall)
    radius_i = network.radius[network.particle_i]
    radius_j = network.radius[network.partner]
    effective = np.where(wall, radius_i, radius_i * radius_j / (radius_i + radius_j))
    at_touch = np.zeros(network.n_contacts)
    springs = {}
    for name in ("normal", "tangential", "rolling", "twisting"):
        own = getattr(network, f"stiffness_{name}")
        beam = getattr(law, f"stiffness_{name}")(at_touch, effective)
        springs[f"stiffness_{name}"] = beam if own is None else own + beam
    return replace(
        network,
        sliding=np.zeros(network.n_contacts, bool),
        study=dict(network.study) | {CEMENT: model.split(maxsplit=1)[1]},
        **springs,
    )
