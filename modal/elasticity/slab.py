"""A packing between walls: its bulk told apart from the layers that the walls order.

The strains xx, yy and xy are those of the cell everywhere; zz, yz and zx differ from layer to layer
and are measured in the bulk, as the slopes of the layers' mean motion. The stress in the bulk is
that of its contacts, each counted with the share of its branch that lies there. Both together, of
six strains, are the stiffness of the bulk. The bulk ends softly, over some diameters: what lies at
its edge then hardly matters, not even the layers of a crystal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.elasticity.steady import steady_motion
from modal.elasticity.strain import AXES, STRAINED
from modal.packing.layers import Layers
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.rattlers import force_bearing
from modal.packing.state import WALL_ZONE
from modal.system.contacts import contact_tangent, motion_of_contacts
from modal.system.imposed import WallMoves
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

FADE = 4.0
"""Depth over which the bulk begins, mean diameters."""
GRIP = 1e-3
"""Least part of a strain between the walls that must reach the bulk."""
FEWEST_LAYERS = 5
"""Layers of the bulk below which a slope across them says little."""
TOLERANCE = 1e-6
"""Of the motion under a wall, relative, in the norm of its energy."""


@dataclass(frozen=True)
class Bulk:
    """Where the bulk of a slab lies: from `low` to `high`, m, with soft ends of `fade`, m."""

    low: float
    high: float
    fade: float

    @classmethod
    def of(cls, network: Network) -> Bulk | None:
        """The bulk further than `WALL_ZONE` from both walls; None where there is hardly any."""
        diameter = 2 * float(network.radius.mean())
        reach = WALL_ZONE * diameter
        low, high = network.wall_position + np.array([reach, -reach])
        bulk = cls(float(low), float(high), FADE * diameter)
        return bulk if high - low >= max(FEWEST_LAYERS, 2 * FADE) * diameter else None

    @property
    def length(self) -> float:
        """Length of the bulk, m, each soft end counted by half."""
        return self.high - self.low - self.fade

    def below(self, z: Floats) -> Floats:
        """Length of the bulk, m, below the heights z, m."""
        up = np.clip((z - self.low) / self.fade, 0, 1)
        down = np.clip((z - self.high) / self.fade + 1, 0, 1)
        flat = np.clip(z, self.low + self.fade, self.high - self.fade) - self.low - self.fade
        # The weight rises as sin^2(pi s / 2): its integral to s is s / 2 - sin(pi s) / (2 pi).
        rising = up / 2 - np.sin(np.pi * up) / (2 * np.pi)
        falling = down / 2 + np.sin(np.pi * down) / (2 * np.pi)
        return self.fade * (rising + falling) + flat

    def share(self, start: Floats, rise: Floats) -> Floats:
        """Share of straight lines from the heights `start` that lies in the bulk; `rise` in m."""
        least = 1e-4 * self.fade
        span = np.where(abs(rise) < least, least, rise)
        middle = start + (rise - span) / 2
        return (self.below(middle + span) - self.below(middle)) / span

    def density(self, network: Network) -> float:
        """Mass of the force-bearing spheres of the bulk over its volume, kg/m^3."""
        at = self.share(network.position[:, 2], np.zeros(network.n_particles))
        mass = float((network.mass * at)[force_bearing(network)].sum())
        return mass / (network.area * self.length)

    def slope(self, layers: Layers, motion: Floats) -> float:
        """Growth along z of the layers' mean motion, for motions (n,) of the spheres."""
        weight = self.share(layers.position, np.zeros(len(layers.position)))
        line = np.polyfit(layers.position, layers.means(motion), 1, w=np.sqrt(weight))
        return float(line[0])

    def growth(self, layers: Layers, motion: Floats) -> float:
        """The same as the mean over its length: another number where the bulk is not even."""
        start, rise = layers.position[:-1], np.diff(layers.position)
        share = self.share(start, rise)
        return float(share @ np.diff(layers.means(motion)) / (share @ rise))


def stiffness_of(network: Network, bulk: Bulk, motion: Floats) -> tuple[Floats, Floats] | None:
    """Shape (6, 6), Pa, twice: stress over strain of the bulk, not quite symmetric, and affine.

    None where some strain hardly reaches the bulk: walls that slide, or yield, take it up.

    `motion` (6n, 6), m and rad per unit strain, is that of the spheres beyond the mean strain. The
    affine stiffness is that if all spheres followed the strain, by the energy of it: such spheres
    are not in balance, and the torques on them would make the stress unsymmetric.
    """
    tangent, strained = contact_tangent(network), STRAINED.on(network)
    branch, layers = network.branch, Layers(network)
    # The share of each contact that lies in the bulk, over its volume, 1/m^3.
    share = bulk.share(network.position[network.particle_i, 2], branch[:, 2])
    share /= network.area * bulk.length
    stress, strain = np.empty((6, 6)), np.eye(6)
    for case, gradient in enumerate(STRAINED.gradient):
        free = motion[:, case].reshape(-1, 6)
        moved = motion_of_contacts(network, free) + strained[case]
        pull = np.einsum("cab,cb->ca", tangent[:, :3], moved)
        # Rows zz, yz, zx are what planes across z carry, the same in every layer at rest.
        carried = (pull * share[:, None]).T @ branch
        stress[:, case] = [carried[a, b] for a, b in AXES]
        for row in (2, 3, 4):
            moving = AXES[row][0]
            strain[row, case] = bulk.slope(layers, free[:, moving]) + gradient[moving, 2]
    if np.linalg.svd(strain, compute_uv=False)[-1] < GRIP:
        return None
    resisted = np.einsum("cij,scj->sci", tangent, strained)
    affine = np.einsum("aci,bci->ab", strained * share[:, None], resisted)
    return stress @ np.linalg.inv(strain), affine


def static_velocity(network: Network) -> tuple[float, float, float]:
    """P-wave velocity, m/s, and P-wave modulus, Pa, of the bulk in the limit of long waves.

    And the velocity's error: how far the strain as a mean and as a slope are apart, which they are
    where the bulk is not even. The source wall is pushed; nothing moves sideways in the mean, so
    that one load in place of six tells the modulus: the stress over the strain of the bulk. The
    velocity is sqrt(modulus / density). InputError where the packing is too short or carries no
    force from wall to wall.
    """
    system, bulk = LinearSystem.of(network), Bulk.of(network)
    if bulk is None:
        raise InputError("the packing is too short for a velocity of its bulk; take a longer one")
    wall, beyond = (system.put_on(WallMoves(each)) for each in (SOURCE_WALL, RECEIVER_WALL))
    # A factor takes minutes or gigabytes where some hundred products take a second.
    found, _ = steady_motion(system, wall, lambda work: TOLERANCE**2 * work, "gradients")
    motion = found.motion[:, 0]
    stress = float((beyond.pull.T @ motion)[0]) / network.area
    layers, along = Layers(network), motion[2::6]
    strain = -bulk.slope(layers, along)
    if not (stress > 0 and strain > 0):
        raise InputError("no force goes from wall to wall; such a packing carries no wave")
    modulus, uneven = stress / strain, abs(bulk.growth(layers, along) / -strain - 1)
    velocity = float(np.sqrt(modulus / bulk.density(network)))
    return velocity, modulus, velocity * uneven / 2
