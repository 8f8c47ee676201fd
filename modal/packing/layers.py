"""Layers: mean motion of the firmly held particles in slabs along the wave.

The coherent wave lives in these means; single particles of a random packing scatter about them.
"""

import numpy as np

from modal.packing.network import Network
from modal.packing.rattlers import firmly_held
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError

EDGE = 1e-9
"""Of a slab: a centre less than this below the upper edge of a slab counts to the slab above, so
that round-off does not decide where a layer of a crystal belongs."""


class Layers:
    """Equal slabs from wall to wall, or of a period along z, about one mean diameter thick.

    `position` (nl,) m: mean z of the firmly held particles in a slab; `layer` (n,) the slab of
    each particle, -1 for all others; `size` (nl,) how many it has. Slabs without any are left out.
    """

    def __init__(self, network: Network) -> None:
        if not network.length > 0:
            raise UnavailableError(
                "the walls are in one place; such a packing carries no wave", code="no_volume"
            )
        bearing = firmly_held(network)
        if not bearing.any():
            raise UnavailableError(
                "no particle has two contacts; such a packing carries no wave",
                code="carries_no_wave",
            )
        diameter = 2 * float(network.radius.mean())
        count = max(1, round(network.length / diameter))
        z = network.position[:, 2]
        # A crystal's layer may lie on an edge: round-off must not tear it apart.
        at = (z - network.wall_position[0]) * (count / network.length) + EDGE
        if network.cell_periodic[2]:
            # A centre may be told in another period than the cell's.
            periods = np.floor(at / count)
            z, at = z - periods * network.length, at - periods * count
        slab = np.clip(at[bearing].astype(int), 0, count - 1)
        size = np.bincount(slab, minlength=count)
        layer = (np.cumsum(size > 0) - 1)[slab]
        self.layer = np.full(network.n_particles, -1)
        self.layer[bearing] = layer
        # Particles that are not held fall into an extra bin in front, which is dropped.
        self._bin = self.layer + 1
        self.size = size[size > 0]
        self.position = self.means(z)

    def means(self, values: Floats) -> Floats:
        """Shape (nl,): mean of `values` (n,) over the particles of each layer."""
        return np.bincount(self._bin, values, len(self.size) + 1)[1:] / self.size
