"""Effective medium theory: the velocity if every sphere followed the mean strain.

Exact for the FCC crystal along [001]; an upper bound for a random packing, whose spheres relax from
the mean strain (Otsubo et al. 2017, section 2, refs. 16 and 22).
"""

import numpy as np

from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.packing.state import affine_stiffness
from modal.tools.errors import UnavailableError

MARGIN = 5.0
"""Mean diameters next to each wall that do not count."""


def velocity_of_contacts(network: Network) -> float:
    """V_P, m/s: mean strain imposed on the very contacts, `MARGIN` diameters from the walls.

    With spheres that neither relax nor turn, M is the sum of `affine_stiffness` over the volume, a
    contact counting by the part of its branch that lies inside. The density is that of the
    force-bearing spheres, from the slope of their number over z, which a crystal's layers do not
    disturb. InputError if nothing is inside.
    """
    zone = MARGIN * 2 * float(network.radius.mean())
    low, high = network.wall_position + np.array([zone, -zone])
    bearing = force_bearing(network)
    z = np.sort(network.position[bearing, 2])
    inside = (z > low) & (z < high)
    pair = ~network.with_wall
    branch = network.branch[pair]
    start = network.position[network.particle_i[pair], 2]
    ends = np.sort(np.column_stack([start, start + branch[:, 2]]), axis=1)
    span = np.maximum(ends[:, 1] - ends[:, 0], 1e-12 * network.radius.mean())
    part = np.clip(np.minimum(ends[:, 1], high) - np.maximum(ends[:, 0], low), 0, None) / span
    if inside.sum() < 2 or not part.any():
        raise UnavailableError(
            f"the packing is {network.length / (zone / MARGIN):.1f} diameters long: it has no bulk "
            f"{MARGIN:g} diameters away from both walls; take one of more than {2 * MARGIN:g}",
            code="too_short",
        )
    per_length = np.polyfit(z[inside], np.flatnonzero(inside), 1)[0]
    density = float(network.mass.mean()) * per_length / network.area
    modulus = part @ affine_stiffness(network) / (network.area * (high - low))
    return float(np.sqrt(modulus / density))
