"""Numbers of a packing at rest that its preparation decides, each measured from the packing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from analysis.estimators.coherent import longest_waves
from analysis.estimators.layer_lattice import is_fcc
from analysis.estimators.low_pass import UNKNOWN, Edge, Passband
from analysis.estimators.own_wave import coherent_of, own_wave
from modal.elasticity.static_velocity import static_velocity
from modal.packing.network import Network
from modal.packing.sample import read_sample
from modal.packing.summary import summary
from modal.preparation.relax import balance_of
from modal.tools.errors import InputError

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
    "f_low_pass": "of the 2 % rule, mean over the columns of spheres as chains, Hz",
    "residual": "mean net force over mean contact force",
    "stress_error": "largest relative deviation of a principal stress from the state's target",
}
"""Columns of a row, and what they are."""


def low_pass(network: Network, velocity: float | None = None) -> Edge:
    """f_low-pass, Hz, by the rule of `analysis.estimators.low_pass` on the wave of the springs.

    Mean over all columns, each a diameter wide and a chain of its own, as a report has it of a
    packing that no run was made of. `velocity` (m/s) of the long waves cuts the record; without it
    that of the wave itself does.
    """
    crystal = is_fcc(network)
    wave = own_wave(network)
    if velocity is None:
        velocity = longest_waves(coherent_of(network, wave, crystal))[0]
    return Passband(network, wave, None, velocity=velocity, crystal=crystal).mean_of_columns


def measured(path: str | Path) -> dict[str, Any]:
    """The `QUANTITIES` of a sample, in their order; NaN for what it does not have.

    Then `f_low_pass_error`, the scatter over the columns, and `remarks`: why a number is NaN.
    """
    sample = read_sample(path)
    network = sample.network()
    found = summary(network, sample.friction)
    force = network.require("force_normal", "the state of a packing")
    force = force[~network.with_wall]
    velocity, passing, remarks = np.nan, UNKNOWN, []
    try:
        velocity = static_velocity(network)[0]
        passing = low_pass(network)
    except InputError as error:  # too short for a bulk, or with parts that nothing holds
        remarks.append(str(error))
    if passing.why:
        remarks.append(f"f_low_pass: {passing.why}")
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
        passing.value,
        balance_of(sample, network)[1].residual,
        max(abs(stress / sample.study.get("stress", np.nan) - 1) for stress in found["stress_pa"]),
    )
    numbers = dict(zip(QUANTITIES, map(float, values), strict=True))
    return {**numbers, "f_low_pass_error": passing.error, "remarks": remarks}
