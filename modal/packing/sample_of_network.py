"""Networks of spheres as samples: positions and history in place of contacts and springs."""

import numpy as np

from modal.packing.checks import density_of
from modal.packing.contact_models import acts_across_gaps
from modal.packing.neighbours import canonical, contact_keys
from modal.packing.network import Network
from modal.packing.noted_laws import noted_material, noted_walls
from modal.packing.sphere_sample import Sample
from modal.tools.arrays import Ints
from modal.tools.errors import InputError

MAX_DENSITY_ERROR = 1e-9
"""Largest relative deviation of a density from that of the material that round-off explains."""
MAX_STIFFNESS_ERROR = 1e-6
"""Largest deviation of a stiffness from that of the contact law, divided by the mean stiffness;
beyond it a contact follows another law."""


def sample_of_network(network: Network, friction: float) -> Sample:
    """Return the sample of a network of spheres, with the contacts in canonical order.

    Moduli and contact model are taken from the `study` of the network, or are those of glass.
    Raises InputError if the stiffnesses or the list of contacts do not follow from them.
    """
    sample = bare_sample(network, friction)
    shift = network.require("cell_shift", "sample with its contacts in order")
    force = network.require("force_tangential", "sample with its history")
    rows, i, j, ordered_shift, turned = canonical(network.particle_i, network.particle_j, shift)
    if acts_across_gaps(sample.laws[0]):
        sample.acting = np.isin(sample.pairs_in_reach().keys, contact_keys(i, j, ordered_shift))
    contact = sample.contacts()
    ends_agree = np.array_equal(i, contact.particle_i) and np.array_equal(j, contact.particle_j)
    if not ends_agree or not np.array_equal(ordered_shift, contact.cell_shift):
        raise InputError(
            "other_contacts",
            "the network's contacts are not those of spheres that overlap in a lateral cell",
            "by round-off, or from another program",
            "take the network itself",
        )
    shear = contact.along(force[rows] * np.where(turned, -1, 1)[:, None])
    sample.shear = shear if shear.any() else None
    if network.moment is not None and network.moment.any():
        sample.moment = network.moment[rows] * np.where(turned, -1, 1)[:, None]
    _check_stiffnesses(network, sample, sample.sphere_network(contact), rows)
    return sample


def bare_sample(network: Network, friction: float) -> Sample:
    """Return the sample of a network as `sample_of_network` does, but without shear forces."""
    network.refuse_angles("sample")
    radius = float(network.radius[0])
    radii = None
    if (network.radius != radius).any():
        radius = float(network.radius.mean())
        radii = network.radius.copy()
    study = network.study
    material = noted_material(study)
    densities = None
    density = density_of(network)
    if abs(density / material.density - 1).max() > MAX_DENSITY_ERROR:
        densities = density
    periodic_x, periodic_y, periodic_z = network.cell_periodic.tolist()
    return Sample(
        position=network.position.copy(),
        side=network.cell_size[:2].copy(),
        walls=network.wall_position.copy(),
        friction=friction,
        radius=radius,
        radii=radii,
        material=material,
        densities=densities,
        wall_material=noted_walls(study),
        periodic_z=periodic_z,
        periodic_sides=(periodic_x, periodic_y),
        fixed=network.fixed,
        rolling=network.noted("rolling") or 0.0,
        twisting=network.noted("twisting") or 0.0,
        study=study,
        provenance=network.provenance,
    )


def _check_stiffnesses(network: Network, sample: Sample, rebuilt: Network, rows: Ints) -> None:
    """Raise InputError if the stiffnesses of contacts `rows` (m,) are not those of `rebuilt`."""
    material = sample.material
    for name in ("stiffness_normal", "stiffness_tangential"):
        stiffness = getattr(network, name)[rows]
        error = abs(getattr(rebuilt, name) - stiffness).max(initial=0.0)
        if error > MAX_STIFFNESS_ERROR * stiffness.mean():
            raise InputError(
                "other_law",
                f"the network's {name} is not that of {material.contact_model} contacts of E "
                f"{material.young:g} Pa and nu {material.poisson:g}",
                remedy=(
                    "note young, poisson, contact_model and, of other walls, wall_young and "
                    "wall_poisson in its group study, or take the linear wave, which knows any law"
                ),
            )
