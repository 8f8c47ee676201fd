"""Average over layers: the firmly held particles in slabs along the wave.

These means show the coherent wave; single particles of a random packing scatter about them.
"""

import numpy as np

from modal.packing.network import Network
from modal.packing.rattlers import firmly_held
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError

EDGE_IN_SLABS = 1e-9
"""Distance below the upper edge of a slab, divided by its thickness, up to which a centre counts to
the slab above, so that round-off does not decide where a layer of a crystal belongs."""


class Layers:
    """Slabs of equal thickness, about a mean diameter, from wall to wall or over a period along z.

    Slabs without firmly held particles are left out.

    Attributes
    ----------
    position : ndarray (nl,)
        Mean z of the particles of each layer, m.
    size : ndarray (nl,)
        Number of particles of each layer.
    layer : ndarray (n,)
        The layer of each particle; -1 if it is not firmly held.
    """

    def __init__(self, network: Network) -> None:
        if not network.length > 0:
            raise UnavailableError(
                "no_volume", "the walls are in one place", remedy="such a packing carries no wave"
            )
        if network.period_vectors[:2, 2].any():
            raise UnavailableError(
                "triclinic_cell",
                "the periods along x or y rise along z",
                "no layer across z repeats itself",
                "turn the packing until they are horizontal",
            )
        bearing = firmly_held(network)
        if not bearing.any():
            raise UnavailableError(
                "carries_no_wave",
                "no particle has two contacts",
                remedy="such a packing carries no wave",
            )
        diameter = 2 * float(network.radius.mean())
        count = max(1, round(network.length / diameter))
        z = network.position[:, 2]
        # A crystal's layer may lie on an edge: round-off must not tear it apart.
        depth = (z - network.wall_position[0]) * (count / network.length) + EDGE_IN_SLABS
        if network.cell_periodic[2]:
            # A centre may lie in another period than the cell's.
            periods = np.floor(depth / count)
            z = z - periods * network.length
            depth = depth - periods * count
        slab = np.clip(depth[bearing].astype(int), 0, count - 1)
        size = np.bincount(slab, minlength=count)
        layer_of_slab = np.cumsum(size > 0) - 1
        self.layer = np.full(network.n_particles, -1)
        self.layer[bearing] = layer_of_slab[slab]
        # Other particles fall into an extra bin in front, which is dropped.
        self._bin = self.layer + 1
        self.size = size[size > 0]
        self.position = self.means(z)

    def means(self, values: Floats) -> Floats:
        """Return the mean (nl,) of `values` (n,) over the particles of each layer."""
        return np.bincount(self._bin, values, len(self.size) + 1)[1:] / self.size
