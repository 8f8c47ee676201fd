"""Forces and torques on spheres from pulls on the ends of their contacts."""

from __future__ import annotations

import numpy as np

from modal.formats.arrays import Floats
from modal.packing.network import Network


def loads(network: Network, pull: Floats) -> tuple[Floats, Floats]:
    """What pulls (s, m, 3), N, on the ends i of the contacts do to spheres; two arrays (6n, s).

    The other ends are pulled the other way. The first array is the sum on each sphere, N and N m,
    the second the root of the sum of squares, which says how well round-off lets the sum vanish.
    """
    n, pair = network.n_particles, ~network.with_wall
    i, j = network.particle_i, network.particle_j[pair]
    load, square = np.empty((2, n, 6, len(pull)))
    for strain, force in enumerate(pull):
        on_i = np.hstack([force, np.cross(network.lever_i, force)])
        on_j = np.hstack([force, np.cross(network.lever_j, force)])[pair]
        for axis in range(6):
            load[:, axis, strain] = np.bincount(i, on_i[:, axis], n)
            load[:, axis, strain] -= np.bincount(j, on_j[:, axis], n)
            square[:, axis, strain] = np.bincount(i, on_i[:, axis] ** 2, n)
            square[:, axis, strain] += np.bincount(j, on_j[:, axis] ** 2, n)
    return load.reshape(6 * n, -1), np.sqrt(square.reshape(6 * n, -1))
