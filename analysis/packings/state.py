"""Numbers of a packing at rest that its preparation decides, each measured from the packing."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from analysis.estimators.low_pass import PASSAGES, Passband
from modal.formats.hdf5 import InputError
from modal.packing.affine import affine_velocity
from modal.packing.network import Network
from modal.packing.sample import read_sample
from modal.packing.summary import summary
from modal.preparation.relax import balance_of
from modal.stiffness.static_load import static_velocity
from modal.waves.propagate import propagate

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
SHORTEST = 50.0
"""Length, diameters, from which f_low-pass is read. At 0.4, 0.5 and 0.6 of the length, friction 0.4
shows 33, 20 and 16 kHz at 100 kPa where it is 41 diameters long, 11.5, 10.3 and 9.4 where it is 87,
8.7, 8.1 and 7.6 where it is 143 as in the study."""


def low_pass(network: Network, velocity: float) -> float:
    """f_low-pass, Hz, by the rule of `analysis.estimators.low_pass` on the wave of the springs.

    Mean over all columns, each a diameter wide and a chain of its own; NaN where half of them have
    no value, or where the sample is shorter than `SHORTEST`: the record ends as the waves of
    `velocity`, m/s, reach the other wall, and one of T tells frequencies 1 / T apart.
    """
    if network.length < SHORTEST * 2 * float(network.radius.mean()):
        return np.nan
    record = PASSAGES * network.length / velocity
    interval = 0.4 * 2 * float(network.radius.mean()) / affine_velocity(network)
    wave = propagate(network, record, interval=interval, particles=True).signals
    band = Passband(network, wave, None, velocity=velocity, crystal=False)
    columns = band.of_columns[:, 0]
    known = columns[np.isfinite(columns)]
    return float(known.mean()) if 2 * len(known) > len(columns) else np.nan


def measured(path: str | Path) -> dict[str, float]:
    """The `QUANTITIES` of a sample, in their order; NaN for what it does not have."""
    sample = read_sample(path)
    network = sample.network()
    found = summary(network, sample.friction)
    force = network.known("force_normal", "the state of a packing")
    force = force[~network.with_wall]
    try:
        velocity = static_velocity(network)[0]
        passing = low_pass(network, velocity)
    except InputError:
        velocity = passing = np.nan  # too short for a bulk, or with parts that nothing holds
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
        passing,
        balance_of(sample, network)[1].residual,
        max(abs(stress / sample.study.get("stress", np.nan) - 1) for stress in found["stress_pa"]),
    )
    return dict(zip(QUANTITIES, map(float, values), strict=True))
