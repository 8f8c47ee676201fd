"""How a wall and the particles that touch it pull at each other."""

from __future__ import annotations

import numpy as np

from modal.packing.network import Network
from modal.stiffness.pre_stress import contact_tangent


def wall_pattern(
    network: Network, wall: int, pre_stress: str = "none"
) -> tuple[np.ndarray, np.ndarray, float]:
    """How a wall and the particles pull at each other along z.

    Forces on the particles (6n,) for a unit displacement of the wall; the row (6n,) that gives the
    force on the resting wall from the particles' motion; and the force that pushes the wall back
    for its own unit displacement, N/m. Pattern and row are equal where the tangent is symmetric.
    """
    touching = network.with_contacts(network.particle_j == wall)
    local = contact_tangent(touching, pre_stress)
    pattern, row = np.zeros((2, network.n_particles, 6))
    # Only the motion of a particle relative to the wall counts: the wall up is the particle down.
    np.add.at(pattern, touching.particle_i, local[:, 0:6, 2])
    np.add.at(row, touching.particle_i, local[:, 2, 0:6])
    return pattern.ravel(), row.ravel(), float(local[:, 2, 2].sum())
