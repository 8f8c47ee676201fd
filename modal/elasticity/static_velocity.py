"""V_P of the longest waves, from the static answer of the springs to the source wall."""

from __future__ import annotations

import numpy as np

from modal.elasticity.steady import steady_motion
from modal.packing.layers import Layers
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.rattlers import force_bearing
from modal.packing.state import WALL_ZONE
from modal.system.imposed import WallMoves
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

TOLERANCE = 1e-6
"""Of the motion under a wall, relative, in the norm of its energy."""


def static_velocity(network: Network) -> tuple[float, float]:
    """P-wave velocity, m/s, and P-wave modulus, Pa, of the bulk in the limit of long waves.

    A displacement of the source wall compresses the springs. The modulus is the stress over the
    strain, the velocity sqrt(modulus / density). Strain and density are taken further than
    `WALL_ZONE` from both walls. The strain is that of firmly held spheres, and only force-bearing
    spheres count in the density: rattlers do not move with a wave. InputError where the packing is
    too short or carries no force from wall to wall.
    """
    layers = Layers(network)
    reach = WALL_ZONE * 2 * float(network.radius.mean())
    low, high = network.wall_position + np.array([reach, -reach])
    inner = (layers.position > low) & (layers.position < high)
    if inner.sum() < 5:
        raise InputError("the packing is too short for a velocity of its bulk; take a longer one")
    system = LinearSystem.of(network)
    wall = system.put_on(WallMoves(SOURCE_WALL))
    beyond = system.put_on(WallMoves(RECEIVER_WALL))
    # A factor takes minutes or gigabytes where some hundred products take a second.
    found, _ = steady_motion(system, wall, lambda work: TOLERANCE**2 * work, "gradients")
    motion = found.motion[:, 0]
    area = network.area
    stress = float((beyond.pull.T @ motion)[0]) / area
    strain = -np.polyfit(layers.position[inner], layers.means(motion[2::6])[inner], 1)[0]
    if not (stress > 0 and strain > 0):
        raise InputError("no force goes from wall to wall; such a packing carries no wave")
    density = _mass_between(network, low, high) / (area * (high - low))
    modulus = stress / strain
    return float(np.sqrt(modulus / density)), float(modulus)


def _mass_between(network: Network, low: float, high: float) -> float:
    """Mass, kg, of the force-bearing spheres between two heights, m, cut where these cut them."""
    z, radius = network.position[:, 2], network.radius

    def share_below(height: float) -> Floats:
        cap = np.clip(height - z + radius, 0, 2 * radius) / radius
        return cap**2 * (3 - cap) / 4

    between = share_below(high) - share_below(low)
    return float((network.mass * between)[force_bearing(network)].sum())
