"""Find the walls at both ends of a packing along z: flat walls, or rough walls of held bodies.

A rough wall consists of bodies that are held in all six motions (`Network.fixed`), from the lowest
or the highest surface of the packing on, without a gap in height wider than the largest diameter.
Held bodies that reach beyond the middle of the bodies that move, such as spheres held along a side,
are not a wall of an end. Bodies without a contact are ignored.
"""

from typing import Literal

import numpy as np

from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.tools.arrays import Floats, Ints

End = Literal["source", "receiver"]
"""The end at low z, which sends a wave, and that at high z, which receives it."""
FLAT_WALLS: dict[End, int] = {"source": SOURCE_WALL, "receiver": RECEIVER_WALL}
"""Values of particle_j for the flat walls at both ends."""


def rough_wall(network: Network, end: End) -> Ints:
    """Return the indices (k,) of the held bodies that are the wall at an end; empty for none.

    Examples
    --------
    >>> import dataclasses, modal
    >>> crystal = modal.fcc(cells=(1, 1, 4))
    >>> lowest_layer = crystal.position[:, 2] < 1.1 * crystal.position[:, 2].min()
    >>> held = dataclasses.replace(crystal, fixed=np.repeat(lowest_layer[:, None], 6, axis=1))
    >>> rough_wall(held, "source"), rough_wall(held, "receiver")
    (array([0]), array([], dtype=int64))
    """
    if network.cell_periodic[2] or network.fixed is None:
        return np.empty(0, int)
    return network.cached(f"rough wall, {end}", lambda: _rough_wall(network, end))


def _rough_wall(network: Network, end: End) -> Ints:
    """Find the held bodies as `rough_wall` does, without the cache."""
    nothing = np.empty(0, int)
    held = network.held
    inward = 1.0 if end == "source" else -1.0
    height = inward * network.position[:, 2]
    is_part = held.copy()
    is_part[network.particle_i] = True
    is_part[network.particle_j[~network.with_wall]] = True
    surface = np.where(is_part, height - network.radius, np.inf)
    if held.all() or not held[np.argmin(surface)]:
        return nothing
    bodies = np.flatnonzero(held)
    bodies = bodies[np.argsort(height[bodies], kind="stable")]
    gaps = np.diff(height[bodies]) > 2 * network.radius.max()
    count = len(bodies)
    if gaps.any():
        count = int(np.argmax(gaps)) + 1
    wall = bodies[:count]
    moving = height[~held]
    if height[wall[-1]] > (moving.min() + moving.max()) / 2:
        return nothing
    return np.sort(wall)


def bodies_at_end(network: Network, end: End) -> Ints:
    """Return the indices (k,) of the bodies that move and touch the wall at an end."""
    held = network.held
    in_wall = np.zeros(network.n_particles, bool)
    in_wall[rough_wall(network, end)] = True
    pair = ~network.with_wall
    i = network.particle_i
    j = network.partner
    touching = [
        i[network.particle_j == FLAT_WALLS[end]],
        i[pair & in_wall[j]],
        j[pair & in_wall[i]],
    ]
    bodies = np.unique(np.concatenate(touching))
    return bodies[~held[bodies]]


def has_two_ends(network: Network) -> bool:
    """Tell whether bodies that move touch a wall, flat or rough, at each end."""
    return bool(len(bodies_at_end(network, "source")) and len(bodies_at_end(network, "receiver")))


def end_heights(network: Network) -> Floats:
    """Return the heights (2,), m, between which bodies can move.

    A flat wall is at its plane. A rough wall ends at the centre of its innermost body.
    """
    low, high = network.wall_position
    z = network.position[:, 2]
    source = rough_wall(network, "source")
    receiver = rough_wall(network, "receiver")
    if len(source):
        low = max(low, z[source].max())
    if len(receiver):
        high = min(high, z[receiver].min())
    return np.array([low, high])


def is_open_end(network: Network, end: End) -> bool:
    """Tell whether neither a flat nor a rough wall is at an end of a packing."""
    return FLAT_WALLS[end] not in network.particle_j and not len(rough_wall(network, end))
