"""Forces between a wall and the particles that touch it, as the packing moves."""

from __future__ import annotations

import numpy as np

from modal.formats.arrays import Floats
from modal.packing.network import Network
from modal.stiffness.matrices import tangent_of


def wall_pattern(
    network: Network, wall: int, pre_stress: str = "none", axis: int = 2
) -> tuple[Floats, Floats, float]:
    """What couples a wall's motion along an axis to that of the particles; `wall` is its code in j.

    Three results. The pattern (6n,), N/m and N: forces and torques on the particles for a unit
    displacement of the wall. The row (6n,), whose product with the particles' motion is the force
    along the axis on the wall at rest, N. The force that holds the wall at its own unit
    displacement, with all particles at rest, N/m. Pattern and row are equal where the tangent is
    symmetric.
    """
    touching = network.some(network.particle_j == wall)
    local = tangent_of(touching, pre_stress)
    pattern, row = np.zeros((2, network.n_particles, 6))
    # Only the motion of a particle relative to the wall counts: the wall up is the particle down.
    np.add.at(pattern, touching.particle_i, local[:, 0:6, axis])
    np.add.at(row, touching.particle_i, local[:, axis, 0:6])
    return pattern.ravel(), row.ravel(), float(local[:, axis, axis].sum())
