"""Shared by the tests: an independent, slow spectrum of a network."""

from __future__ import annotations

import numpy as np
import pytest

from modal.network import Network


def slow_stiffness(network: Network) -> np.ndarray:
    """Dense K (6n, 6n), column by column from forces: an oracle without the 12x12 matrices.

    Each degree of freedom is displaced by one unit in turn; the springs' forces and the torques
    they exert with their levers are summed, contact by contact, in plain vector algebra.
    """
    n = network.n_particles
    K = np.zeros((6 * n, 6 * n))
    for column in range(6 * n):
        motion = np.zeros((n, 2, 3))
        motion[column // 6, (column % 6) // 3, column % 3] = 1.0
        load = np.zeros((n, 2, 3))
        for c in range(network.n_contacts):
            i, j = network.particle_i[c], network.particle_j[c]
            normal = network.normal[c]
            slip = -motion[i, 0] - np.cross(motion[i, 1], network.lever_i[c])
            if j >= 0:
                slip = slip + motion[j, 0] + np.cross(motion[j, 1], network.lever_j[c])
            along = np.dot(slip, normal) * normal
            force = network.stiffness_normal[c] * along
            force = force + network.stiffness_tangential[c] * (slip - along)
            load[i, 0] -= force
            load[i, 1] -= np.cross(network.lever_i[c], force)
            if j >= 0:
                load[j, 0] += force
                load[j, 1] += np.cross(network.lever_j[c], force)
        K[:, column] = load.ravel()
    return K


@pytest.fixture(scope="session")
def slow_K():
    """The oracle as a fixture."""
    return slow_stiffness
