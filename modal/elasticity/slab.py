"""Separate the bulk of a packing between walls from the layers that the walls order.

The strains xx, yy and xy are those of the cell everywhere; zz, yz and zx differ from layer to layer
and are measured in the bulk, as the slopes of the layers' mean motion. The stress in the bulk is
that of its contacts, each counted with the share of its branch that lies there. Stresses and
strains of the six load cases give the stiffness of the bulk. The weight of the bulk falls to zero
over some diameters, so that single layers at its edge hardly matter, even in a crystal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from modal.elasticity.steady import steady_motion
from modal.elasticity.strain import AXES, UNIT_STRAINS
from modal.packing.ends import end_heights
from modal.packing.layers import Layers
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.packing.state import WALL_ZONE_IN_DIAMETERS
from modal.system.contacts import contact_tangent, motion_of_contacts
from modal.system.imposed import Gradients, end_moves
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError

SOFT_END_DIAMETERS = 4.0
"""Depth over which the weight of the bulk falls from 1 to 0 at its two ends, in mean diameters."""
MIN_STRAIN_SHARE = 1e-3
"""Least share of the strain between the walls that must reach the bulk."""
MIN_LAYERS = 5
"""Least number of layers of the bulk for which a slope across them is meaningful."""
STRAINED_TOLERANCE = 0.03
"""Error of the motion under a uniform strain, in the norm of energy, divided by the root of the
affine energy."""
STRAINED_ERROR = 4e-3
"""Relative error of a velocity at that tolerance: in case 6, 35,201 spheres, V_P is off by 0.1 %,
V_S by 0.3 % from a tenth of it."""
MOTION_TOLERANCE = 1e-6
"""Relative error of the motion under a wall, in the norm of its energy."""


@dataclass(frozen=True)
class Bulk:
    """The bulk of a slab, from `low` to `high`, m, whose weight falls to 0 over `fade`, m."""

    low: float
    high: float
    fade: float

    @classmethod
    def of(cls, network: Network) -> Bulk | None:
        """Find the bulk beyond the zones near both walls; None if the packing is too short."""
        diameter = 2 * float(network.radius.mean())
        wall_zone = WALL_ZONE_IN_DIAMETERS * diameter
        low, high = end_heights(network) + np.array([wall_zone, -wall_zone])
        if high - low < max(MIN_LAYERS, 2 * SOFT_END_DIAMETERS) * diameter:
            return None
        return cls(float(low), float(high), SOFT_END_DIAMETERS * diameter)

    @property
    def length(self) -> float:
        """Return the length of the bulk, m; each end of falling weight counts by half."""
        return self.high - self.low - self.fade

    def below(self, z: Floats) -> Floats:
        """Return the length of the bulk, m, that lies below the heights z, m."""
        up = np.clip((z - self.low) / self.fade, 0, 1)
        down = np.clip((z - self.high) / self.fade + 1, 0, 1)
        flat = np.clip(z, self.low + self.fade, self.high - self.fade) - self.low - self.fade
        # The weight rises as sin^2(pi s / 2): its integral to s is s / 2 - sin(pi s) / (2 pi).
        rising = up / 2 - np.sin(np.pi * up) / (2 * np.pi)
        falling = down / 2 + np.sin(np.pi * down) / (2 * np.pi)
        return self.fade * (rising + falling) + flat

    def share(self, start: Floats, rise: Floats) -> Floats:
        """Return the share of each straight line that lies in the bulk.

        The lines start at the heights `start`, m, and rise by `rise`, m.
        """
        min_rise = 1e-4 * self.fade
        span = np.where(abs(rise) < min_rise, min_rise, rise)
        low_end = start + (rise - span) / 2
        return (self.below(low_end + span) - self.below(low_end)) / span

    def density(self, network: Network) -> float:
        """Return the mass of the force-bearing spheres of the bulk per volume, kg/m^3."""
        share = self.share(network.position[:, 2], np.zeros(network.n_particles))
        mass = float((network.mass * share)[force_bearing(network)].sum())
        return mass / (network.area * self.length)

    def slope(self, layers: Layers, motion: Floats) -> float:
        """Return the slope along z of the layers' mean motion, from motions (n,) of the spheres."""
        weight = self.share(layers.position, np.zeros(len(layers.position)))
        line = np.polyfit(layers.position, layers.means(motion), 1, w=np.sqrt(weight))
        return float(line[0])

    def growth(self, layers: Layers, motion: Floats) -> float:
        """Return the mean change of the layers' motion along z, per metre.

        The result differs from the slope of a straight line where the bulk is not even.
        """
        start = layers.position[:-1]
        rise = np.diff(layers.position)
        share = self.share(start, rise)
        return float(share @ np.diff(layers.means(motion)) / (share @ rise))


def stiffness_of(network: Network, bulk: Bulk, motion: Floats) -> tuple[Floats, Floats] | None:
    """Return the stiffness of the bulk and its affine stiffness, shape (6, 6) each, Pa.

    The stiffness is stress divided by strain, and not quite symmetric. The affine stiffness is that
    of spheres that all follow the strain, computed from its energy: such spheres are not in
    balance, and the torques on them would make the stress unsymmetric. The result is None if some
    strain hardly reaches the bulk, because the walls slide or yield.

    `motion` (6n, 6), m and rad per unit strain, is that of the spheres beyond the mean strain.
    """
    tangent = contact_tangent(network)
    affine_motion = UNIT_STRAINS.on(network)
    branch = network.branch
    layers = Layers(network)
    # The share of each contact that lies in the bulk, per volume, 1/m^3.
    share = bulk.share(network.position[network.particle_i, 2], branch[:, 2])
    share /= network.area * bulk.length
    stress = np.empty((6, 6))
    strain = np.eye(6)
    for case, gradient in enumerate(UNIT_STRAINS.gradient):
        beyond_affine = motion[:, case].reshape(-1, 6)
        contact_motion = motion_of_contacts(network, beyond_affine) + affine_motion[case]
        force = np.einsum("cab,cb->ca", tangent[:, :3], contact_motion)
        # Rows zz, yz, zx are what planes across z carry, the same in every layer at rest.
        virial = (force * share[:, None]).T @ branch
        stress[:, case] = [virial[a, b] for a, b in AXES]
        for row in (2, 3, 4):
            moving = AXES[row][0]
            slope = bulk.slope(layers, beyond_affine[:, moving])
            strain[row, case] = slope + gradient[moving, 2]
    if np.linalg.svd(strain, compute_uv=False)[-1] < MIN_STRAIN_SHARE:
        return None
    affine_force = np.einsum("cij,scj->sci", tangent, affine_motion)
    affine = np.einsum("aci,bci->ab", affine_motion * share[:, None], affine_force)
    return stress @ np.linalg.inv(strain), affine


class StaticVelocity(NamedTuple):
    """Velocity and modulus of waves of infinite length in the bulk of a slab.

    velocity: m/s. modulus: P-wave modulus or shear modulus, Pa. error: error of the velocity, m/s.
    """

    velocity: float
    modulus: float
    error: float


def static_velocity(network: Network) -> StaticVelocity:
    """Measure velocity and modulus of P-waves in the bulk, in the limit of long waves.

    The source wall is pushed. The mean lateral motion is zero, so that the stress divided by the
    strain of the bulk is the P-wave modulus. The velocity is sqrt(modulus / density). The strain is
    the slope of the mean motion of layers. The error is half the difference to the velocity from
    the mean strain, which differs from the slope where the bulk is not uniform. InputError if the
    packing is too short or carries no force from wall to wall.
    """
    system = LinearSystem.of(network)
    bulk = _bulk_of(network)
    source = system.put_on(end_moves(network, "source"))
    receiver = system.put_on(end_moves(network, "receiver"))
    # A factor takes minutes or gigabytes where some hundred products take a second.
    solution, _ = steady_motion(
        system, source, lambda work: MOTION_TOLERANCE**2 * work, "gradients"
    )
    motion = solution.motion[:, 0]
    stress = float((receiver.pull.T @ motion)[0]) / network.area
    layers = Layers(network)
    motion_along_z = motion[2::6]
    strain = -bulk.slope(layers, motion_along_z)
    if not (stress > 0 and strain > 0):
        raise UnavailableError(
            "no_wave", "no force goes from wall to wall", remedy="such a packing carries no wave"
        )
    modulus = stress / strain
    velocity = float(np.sqrt(modulus / bulk.density(network)))
    unevenness = abs(bulk.growth(layers, motion_along_z) / -strain - 1)
    return StaticVelocity(velocity, modulus, velocity * unevenness / 2)


def _sticking_to_walls(network: Network) -> Network:
    """Return the packing with walls whose tangential stiffness equals their normal stiffness."""
    stiffness = network.stiffness_tangential
    sticking = np.where(network.with_wall, network.stiffness_normal, stiffness)
    return replace(network, stiffness_tangential=sticking)


def _bulk_of(network: Network) -> Bulk:
    """Return the bulk of a packing; raise UnavailableError if it is too short to have one."""
    bulk = Bulk.of(network)
    if bulk is None:
        raise UnavailableError(
            "too_short",
            "the packing is too short for a velocity of its bulk",
            remedy="take a longer one",
        )
    return bulk


def strained_velocities(network: Network, axes: Sequence[int]) -> list[StaticVelocity]:
    """Measure velocities and moduli of waves along z, for given axes of the spheres' motion.

    Axis 2 gives P-waves, axes 0 and 1 give S-waves. All spheres start from a uniform strain, zz or
    a shear with z, and relax. The remaining motion is local, so that some tens of products with K
    give the velocities to `STRAINED_ERROR`; a push from the wall takes hundreds. Stress and strain
    are those of the bulk, as in `stiffness_of`. Spheres stick to the walls: walls without friction
    would let the whole packing slide back out of a shear. UnavailableError if the packing is too
    short or a strain meets no resistance.
    """
    bulk = _bulk_of(network)
    network = _sticking_to_walls(network)
    system = LinearSystem.of(network)
    gradient = np.zeros((len(axes), 3, 3))
    gradient[np.arange(len(axes)), axes, 2] = 1
    strains = Gradients(gradient)
    coupling = system.put_on(strains)
    allowed = STRAINED_TOLERANCE**2 * np.diag(coupling.held)
    solution, _ = steady_motion(system, coupling, lambda work: allowed, "gradients")
    layers = Layers(network)
    tangent = contact_tangent(network)
    share = bulk.share(network.position[network.particle_i, 2], network.branch[:, 2])
    share /= network.area * bulk.length
    velocities = []
    for case, axis in enumerate(axes):
        beyond_affine = solution.motion[:, case].reshape(-1, 6)
        contact_motion = motion_of_contacts(network, beyond_affine) + strains.on(network)[case]
        force = np.einsum("cb,cb->c", tangent[:, axis], contact_motion)
        stress = float((force * share) @ network.branch[:, 2])
        strain = 1 + bulk.slope(layers, beyond_affine[:, axis])
        if not (stress > 0 and strain > 0):
            raise UnavailableError(
                "no_wave", "nothing resists a strain", remedy="such a packing carries no wave"
            )
        modulus = stress / strain
        velocity = float(np.sqrt(modulus / bulk.density(network)))
        unevenness = abs((1 + bulk.growth(layers, beyond_affine[:, axis])) / strain - 1)
        error = velocity * float(np.hypot(unevenness / 2, STRAINED_ERROR))
        velocities.append(StaticVelocity(velocity, modulus, error))
    return velocities
