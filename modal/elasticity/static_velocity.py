"""What the springs do under a steady load: displacements, and the velocity of the longest waves.

Conjugate gradients with each sphere's own block of K as preconditioner take some hundreds of
products K u of a few ms, where a factorisation of 35,201 spheres takes minutes or gigabytes.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from modal.packing.layers import Layers
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.rattlers import force_bearing
from modal.packing.state import WALL_ZONE
from modal.system.assembly import own_blocks
from modal.system.imposed import WallMoves, put_on
from modal.system.operator import ContactOperator
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

MAX_PRODUCTS = 5000
"""Products K u after which a load counts as one that the springs cannot balance."""
STRAIN_TOLERANCE, STRAIN_SHIFT = 1e-6, 1e-12
"""Of the compression by a wall. A shift holds every sphere a little: over 150 layers a share of
1e-5 of the mean stiffness would carry a third of the load, 1e-12 nothing that shows."""


def spring_motion(
    network: Network, load: Floats, tolerance: float, shift: float
) -> tuple[Floats, int]:
    """The motion u with K u = `load`, by conjugate gradients, and the number of products K u.

    `load` (n, 6): forces, N, and torques, N m, on the particles; the motion (n, 6): displacements,
    m, and rotations. `tolerance` bounds the norm of the unbalanced load over that of the load, with
    torques divided by the mean radius; InputError where it is not reached in `MAX_PRODUCTS`.
    `shift` times the mean diagonal of K, that of translations or of rotations, is added to the
    diagonal, so that particles which no contact holds do not move far.
    """
    # Rotations as arcs, so that forces and torques have one unit.
    arm = np.array([1.0] * 3 + [float(network.radius.mean())] * 3)
    blocks = own_blocks(network) / np.outer(arm, arm)
    # Translations and rotations still differ in stiffness, so each has its own mean.
    mean = np.einsum("nii->ni", blocks).reshape(-1, 2, 3).mean(axis=(0, 2)).repeat(3)
    operator = ContactOperator(network).renumbered()
    inverse = np.linalg.inv(blocks + max(shift, 1e-8) * np.diag(mean))
    if operator.order is not None:
        inverse = inverse[operator.order]
    per_arm, held = (np.tile(part, len(load)) for part in (1 / arm, shift * mean))
    pushed = operator.inward((load / arm).ravel())
    products = 0

    def resist(arcs: Floats) -> Floats:
        nonlocal products
        products += 1
        force = operator.apply(arcs * per_arm)
        force *= per_arm
        force += held * arcs
        return force

    def ease(rest: Floats) -> Floats:
        return np.einsum("nij,nj->ni", inverse, rest.reshape(load.shape)).ravel()

    size = operator.shape
    arcs, unfinished = cg(
        LinearOperator(size, resist, dtype=float),
        pushed,
        M=LinearOperator(size, ease, dtype=float),
        rtol=tolerance,
        maxiter=MAX_PRODUCTS,
    )
    if unfinished or not np.isfinite(arcs).all():
        left = np.linalg.norm(pushed - resist(arcs)) / np.linalg.norm(pushed)
        raise InputError(
            f"the springs do not balance the load: {left:.1e} of it is left after {products} "
            f"products with K, {tolerance:g} was asked for; parts of the packing are not held"
        )
    return operator.outward(arcs).reshape(load.shape) / arm, products


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
    load = put_on(network, (), WallMoves(SOURCE_WALL)).push.reshape(-1, 6)
    row = put_on(network, (), WallMoves(RECEIVER_WALL)).pull
    motion, _ = spring_motion(network, load, STRAIN_TOLERANCE, STRAIN_SHIFT)
    area = network.area
    stress = float(row[:, 0] @ motion.ravel()) / area
    strain = -np.polyfit(layers.position[inner], layers.means(motion[:, 2])[inner], 1)[0]
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
