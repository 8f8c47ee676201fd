"""Estimate the velocity by effective medium theory, in which every sphere follows the mean strain.

The theory is exact for the FCC crystal along [001]. For a random packing, whose spheres relax from
the mean strain, it is an upper bound (Otsubo et al. 2017, section 2, refs. 16 and 22).
"""

import numpy as np

from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.packing.state import affine_stiffness
from modal.tools.errors import UnavailableError

WALL_ZONE_IN_DIAMETERS = 5.0
"""Thickness of the zone next to each wall that is left out, in mean diameters."""


def velocity_of_contacts(network: Network) -> float:
    """Return V_P, m/s, if the mean strain is imposed on the contacts away from the walls.

    If spheres neither relax nor turn, the modulus M is the sum of `affine_stiffness` divided by the
    volume. Each contact is weighted with the part of its branch vector in the inner zone, which
    begins `WALL_ZONE_IN_DIAMETERS` from the walls. The density is that of the force-bearing
    spheres, from the slope of their cumulative number along z, so that layers of a crystal do not
    matter. Raises UnavailableError if no contact reaches the inner zone.
    """
    mean_radius = float(network.radius.mean())
    zone = WALL_ZONE_IN_DIAMETERS * 2 * mean_radius
    low, high = network.wall_position + np.array([zone, -zone])
    z = np.sort(network.position[force_bearing(network), 2])
    inside = (z > low) & (z < high)
    inside_share = _share_of_branches(network, low, high)
    if inside.sum() < 2 or not inside_share.any():
        raise UnavailableError(
            "too_short",
            f"the packing is {network.length / (2 * mean_radius):.1f} diameters long",
            f"it has no bulk {WALL_ZONE_IN_DIAMETERS:g} diameters away from both walls",
            f"take one of more than {2 * WALL_ZONE_IN_DIAMETERS:g}",
        )
    spheres_per_length = np.polyfit(z[inside], np.flatnonzero(inside), 1)[0]
    density = float(network.mass.mean()) * spheres_per_length / network.area
    modulus = inside_share @ affine_stiffness(network) / (network.area * (high - low))
    return float(np.sqrt(modulus / density))


def _share_of_branches(network: Network, low: float, high: float) -> np.ndarray:
    """Return the share of each branch vector (m,) between spheres from z `low` to `high`, m."""
    pair = ~network.with_wall
    start = network.position[network.particle_i[pair], 2]
    end = start + network.branch[pair, 2]
    bottom = np.minimum(start, end)
    top = np.maximum(start, end)
    # A horizontal branch has no extent along z; the floor keeps its share a number.
    extent = np.maximum(top - bottom, 1e-12 * network.radius.mean())
    extent_inside = np.clip(np.minimum(top, high) - np.maximum(bottom, low), 0, None)
    return extent_inside / extent
