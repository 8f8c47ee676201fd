"""Slow and plain computations, with which other tests compare."""

import numpy as np
import scipy.sparse as sp

from modal.packing.network import Network
from modal.system.assembly import block
from modal.system.contacts import contact_tangent, terms_of
from modal.system.imposed import WallMoves, put_on
from modal.system.linear_system import LinearSystem
from modal.waves.propagate import propagate
from modal.waves.signals import Signals


def dense_squares(system: LinearSystem) -> np.ndarray:
    """Return all omega^2, ascending, by a dense solver."""
    return np.linalg.eigvalsh(system.dynamical_matrix.toarray())


def wall_pattern(network: Network, wall: int, pre_stress: str = "none", axis: int = 2):
    """Return push on the particles (6n,), pull on the wall (6n,) and holding force, N/m."""
    coupling = put_on(network, terms_of(pre_stress), WallMoves(wall, axis))
    push = coupling.push.toarray()[:, 0]
    pull = coupling.pull.toarray()[:, 0]
    return push, pull, float(coupling.held[0, 0])


def contact_matrices(network: Network, pre_stress: str | tuple[str, ...] = "none") -> np.ndarray:
    """Return the stiffness (m, 12, 12) of each contact on (u_i, theta_i, u_j, theta_j).

    Rows and columns of a wall are zero.
    """
    terms = terms_of(pre_stress) if isinstance(pre_stress, str) else pre_stress
    tangent = contact_tangent(network, terms)
    matrices = np.block([[block(tangent, a, b) for b in (0, 1)] for a in (0, 1)])
    matrices[network.with_wall, 6:] = 0
    matrices[network.with_wall, :, 6:] = 0
    return matrices


def stepped(
    network: Network, duration: float, step: float, *, every: int = 1, **settings
) -> Signals:
    """Return the signals of a wave by leapfrog, recorded at each `every`-th `step`, s."""
    settings = {"interval": every * step, "time_step": step, **settings}
    return propagate(network, duration, **settings).signals


def slow_stiffness(network: Network) -> np.ndarray:
    """Return the dense K (6n, 6n), column by column from forces, without 12x12 matrices.

    Each degree of freedom is displaced by one unit in turn; the springs' forces and the torques
    they exert with their levers are summed in plain vector algebra. Walls are a body that rests.
    """
    n = network.n_particles
    normal = network.normal
    i = network.particle_i
    j = np.where(network.with_wall, n, network.particle_j)

    def spring_force(slip: np.ndarray, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Return forces (m, 3) from slips (m, 3) and stiffnesses (m,) along and across normals."""
        normal_slip = (slip * normal).sum(axis=1)[:, None] * normal
        return along[:, None] * normal_slip + across[:, None] * (slip - normal_slip)

    K = np.zeros((6 * n, 6 * n))
    for column in range(6 * n):
        motion = np.zeros((n + 1, 2, 3))
        motion.flat[column] = 1.0
        u = motion[:, 0]
        turn = motion[:, 1]
        at_i = u[i] + np.cross(turn[i], network.lever_i)
        at_j = u[j] + np.cross(turn[j], network.lever_j)
        force = spring_force(at_j - at_i, network.stiffness_normal, network.stiffness_tangential)
        torque = np.zeros_like(force)
        if network.stiffness_rolling is not None:
            torque = spring_force(
                turn[j] - turn[i], network.stiffness_twisting, network.stiffness_rolling
            )
        load = np.zeros((n + 1, 2, 3))
        for end, lever, sign in ((i, network.lever_i, -1), (j, network.lever_j, 1)):
            np.add.at(load[:, 0], end, sign * force)
            np.add.at(load[:, 1], end, sign * (np.cross(lever, force) + torque))
        K[:, column] = load[:n].ravel()
    return K


def kinematics(network: Network) -> np.ndarray:
    """Return the matrices (m, 3, 12) from (u_i, theta_i, u_j, theta_j) to the slip."""
    B = np.zeros((network.n_contacts, 3, 12))
    for axis, unit in enumerate(np.eye(3)):
        B[:, axis, axis] = -1
        B[:, axis, 6 + axis] = 1
        B[:, :, 3 + axis] = -np.cross(unit, network.lever_i)
        B[:, :, 9 + axis] = np.cross(unit, network.lever_j)
    B[network.with_wall, :, 6:] = 0
    return B


PRE_STRESS = ("none", "normal", "full")
"""Values of `pre_stress` that are possible for every network with forces."""


def asymmetry(matrix: sp.csr_matrix) -> float:
    """Return the Frobenius norm of the antisymmetric part divided by that of the matrix."""
    difference = (matrix - matrix.T) / 2
    return float(np.sqrt((difference.data**2).sum() / (matrix.data**2).sum()))
