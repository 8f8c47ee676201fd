"""Numbers of a packing at rest that its preparation decides, each measured from the packing."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modal.formats.hdf5 import InputError
from modal.packing.sample import read_sample
from modal.packing.state import summary
from modal.preparation.relax import balance_of
from modal.stiffness.static_load import static_velocity

QUANTITIES = {
    "e": "void ratio, wall to wall",
    "e_bulk": "void ratio away from the walls",
    "Z": "contacts of a sphere",
    "Z_bearing": "contacts of a force-bearing sphere",
    "rattlers": "share of spheres that bear no force",
    "fabric_zz": "mean n_z^2 of contact normals",
    "force_squared": "mean squared normal force over squared mean",
    "weak_forces": "share of normal forces below half the mean",
    "V_P": "long-wave velocity along z from a steady push, m/s",
    "residual": "mean net force over mean contact force",
    "stress_error": "largest relative deviation of a principal stress from the state's target",
}
"""Columns of a row, and what they are."""


def measured(path: str | Path) -> dict[str, float]:
    """The `QUANTITIES` of a sample, in their order; NaN for what it does not have."""
    sample = read_sample(path)
    network = sample.network()
    found = summary(network, sample.friction)
    force = network.known("force_normal", "the state of a packing")
    force = force[~network.with_wall]
    try:
        velocity = static_velocity(network)[0]
    except InputError:
        velocity = np.nan  # too short for a bulk, or with parts that nothing holds
    values = (
        found["void_ratio"],
        found.get("void_ratio_of_bulk", np.nan),
        found["coordination_number"],
        found["coordination_number_without_rattlers"],
        found["rattlers"] / network.n_particles,
        found["fabric_diagonal"][2],
        (force**2).mean() / force.mean() ** 2,
        (force < 0.5 * force.mean()).mean(),
        velocity,
        balance_of(sample, network)[1].residual,
        max(abs(stress / sample.study.get("stress", np.nan) - 1) for stress in found["stress_pa"]),
    )
    return dict(zip(QUANTITIES, map(float, values), strict=True))
