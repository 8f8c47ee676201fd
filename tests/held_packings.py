"""Packings of which some bodies cannot make some motions, and their dense matrices."""

from dataclasses import replace

import numpy as np
from oracles import slow_stiffness
from packings import polydisperse
from scipy.linalg import eigh

from modal.packing.network import Network
from modal.system.assembly import mass_diagonal, stiffness_matrix


def held_at_random(network: Network, seed: int = 5) -> Network:
    """Return the network with one sphere in six held, and one in three held in half its motions."""
    random = np.random.default_rng(seed)
    n = network.n_particles
    choice = random.random(n)
    fixed = random.random((n, 6)) < 0.5
    fixed[choice > 1 / 2] = False
    fixed[choice < 1 / 6] = True
    return replace(network, fixed=fixed)


def between_rough_walls(network: Network) -> Network:
    """Return the network without flat walls; the spheres that touched them are held."""
    held = np.zeros(network.n_particles, bool)
    held[network.particle_i[network.with_wall]] = True
    fixed = np.repeat(held[:, None], 6, axis=1)
    return replace(network.with_contacts(~network.with_wall), fixed=fixed)


def with_inertia_tensors() -> Network:
    """Return twelve bodies with unequal principal moments of inertia, some of them held."""
    random = np.random.default_rng(2)
    spheres = polydisperse(n=12)
    axes = np.linalg.qr(random.standard_normal((12, 3, 3)))[0]
    unit_tensor = axes * [0.7, 1.0, 1.3] @ axes.transpose(0, 2, 1)
    tensor = unit_tensor * spheres.inertia[:, None, None]
    mean = np.trace(tensor, axis1=1, axis2=2) / 3
    return held_at_random(replace(spheres, inertia_tensor=tensor, inertia=mean), seed=1)


def free_rows(network: Network) -> np.ndarray:
    """Return the rows of K and M that belong to motions which are not held."""
    return np.flatnonzero(network.free_motions)


def dense_squares_of_free(network: Network, pre_stress: str = "none") -> np.ndarray:
    """Return all omega^2, ascending, from dense K and M without the rows of held motions."""
    if pre_stress == "none":
        K = slow_stiffness(network)
    else:
        K = stiffness_matrix(network, 6, pre_stress).toarray()
    rows = free_rows(network)
    M = np.diag(mass_diagonal(network)[rows])
    return eigh(K[np.ix_(rows, rows)], M, eigvals_only=True)


def signed_squares(frequency: np.ndarray) -> np.ndarray:
    """Return omega^2 from frequencies, Hz, of which those of unstable modes are negative."""
    return np.sign(frequency) * (2 * np.pi * frequency) ** 2
