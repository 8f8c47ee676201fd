"""What the springs do under a steady load: displacements, and the velocity of the longest waves.

Conjugate gradients with each sphere's own block of K as preconditioner take some hundreds of
products K u of a few ms, where a factorisation of 35,201 spheres takes minutes or gigabytes.
"""

from __future__ import annotations

import numpy as np

from modal.contact import contact_stiffness
from modal.layers import Layers, force_bearing
from modal.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.operator import ContactOperator
from modal.receivers import wall_pattern
from modal.statistics import WALL_ZONE, profile
from modal.storage import InputError

MAX_PRODUCTS = 5000
"""Products K u after which a solution is taken as it is."""
STRAIN_TOLERANCE, STRAIN_SHIFT = 1e-6, 1e-12
"""Of the compression by a wall. A shift holds every sphere a little: over 150 layers a share of
1e-5 of the mean stiffness would carry a third of the load, 1e-12 nothing that shows."""


def spring_motion(
    network: Network, load: np.ndarray, tolerance: float, shift: float
) -> tuple[np.ndarray, int]:
    """The motion (n, 6) that the springs balance `load` (n, 6) with, and the products K u spent.

    `tolerance` of the residual in the norm of the preconditioner; `shift` times the mean diagonal
    of K is added to it, so that what nothing holds does not go far.
    """
    blocks = _own_blocks(network)
    # Translations and rotations differ in unit, so each has its own mean.
    mean = np.einsum("nii->ni", blocks).reshape(-1, 2, 3).mean(axis=(0, 2)).repeat(3)
    inverse = np.linalg.inv(blocks + max(shift, 1e-8) * np.diag(mean))
    operator, held = ContactOperator(network), shift * mean
    motion, rest = np.zeros_like(load), load.copy()
    eased = np.einsum("nij,nj->ni", inverse, rest)
    direction, size = eased, np.vdot(rest, eased)
    goal, products = tolerance**2 * size, 0
    while size > goal and products < MAX_PRODUCTS:
        products += 1
        resisted = operator.apply(direction.ravel()).reshape(load.shape) + held * direction
        length = size / np.vdot(direction, resisted)
        motion += length * direction
        rest -= length * resisted
        eased = np.einsum("nij,nj->ni", inverse, rest)
        before, size = size, np.vdot(rest, eased)
        direction = eased + (size / before) * direction
    return motion, products


def _own_blocks(network: Network) -> np.ndarray:
    """Shape (n, 6, 6): K's block of each sphere with itself."""
    local, n = contact_stiffness(network), network.n_particles
    j, pair = network.particle_j, ~network.with_wall
    blocks = np.empty((n, 6, 6))
    for a in range(6):
        for b in range(6):
            blocks[:, a, b] = np.bincount(network.particle_i, local[:, a, b], n)
            blocks[:, a, b] += np.bincount(j[pair], local[pair, 6 + a, 6 + b], n)
    return blocks


def static_velocity(network: Network) -> tuple[float, float]:
    """P-wave velocity, m/s, and modulus, Pa, of the bulk for waves without end.

    The source wall compresses the springs; V^2 is stress over strain and density. The strain is
    that of the layers further than `WALL_ZONE` from both walls, the density that of the
    force-bearing spheres there.
    """
    layers, whole = Layers(network), profile(network)
    reach = WALL_ZONE * 2 * float(network.radius.mean())
    depth = np.minimum(
        layers.position - network.wall_position[0], network.wall_position[1] - layers.position
    )
    inner = depth > reach
    if inner.sum() < 5 or not whole.bulk.any():
        raise InputError("the packing is too short for a velocity of its bulk; take a longer one")
    pattern, _, _ = wall_pattern(network, SOURCE_WALL)
    _, row, _ = wall_pattern(network, RECEIVER_WALL)
    load = pattern.reshape(-1, 6)
    motion, _ = spring_motion(network, load, STRAIN_TOLERANCE, STRAIN_SHIFT)
    area = network.area
    stress = float(row @ motion.ravel()) / area
    strain = -np.polyfit(layers.position[inner], layers.means(motion[:, 2])[inner], 1)[0]
    solid = float(np.mean(1 / (1 + whole.void_ratio[whole.bulk])))
    own = float(network.mass.sum() / (4 / 3 * np.pi * network.radius**3).sum())
    density = own * solid * float(force_bearing(network).mean())
    modulus = stress / strain
    return float(np.sqrt(modulus / density)), float(modulus)
