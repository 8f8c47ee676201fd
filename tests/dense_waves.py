"""Waves and responses by dense matrices, for every source, direction and kind of damping.

The action of a source follows from rigid motions: a wall, or all bodies above a plane, moves or
turns as one body, and the contacts with the other bodies push back.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.system.assembly import block, stiffness_matrix
from modal.system.contacts import SHEAR, contact_tangent, terms_of
from modal.system.damping import ContactDamping
from modal.waves.discs import Disc
from modal.waves.motions import Motion, Pulse
from modal.waves.sources import Plane, Point, Source, hold_own_bodies

COMPONENT = {"x": 0, "y": 1, "z": 2, "torsion": 5}
"""Component of the motion of a body in each direction."""


class Coupling(NamedTuple):
    """The forces of springs, or of dashpots, between the bodies and a source or receiver."""

    push: np.ndarray
    """Forces on the bodies (6n,) if the source moves by one unit."""
    pull: np.ndarray
    """Forces on the source (6n,), with the opposite sign, if a body moves by one unit."""
    holding: float
    """Force that the source needs to move by one unit while the bodies rest."""


def no_coupling(network: Network) -> Coupling:
    """Return a coupling without any force."""
    zeros = np.zeros(6 * network.n_particles)
    return Coupling(zeros, zeros, 0.0)


def rigid_motion(network: Network, points: np.ndarray, direction: str) -> np.ndarray:
    """Return the motion (k, 6) at points (k, 3) of a body that moves, or turns about the middle."""
    motion = np.zeros((len(points), 6))
    motion[:, COMPONENT[direction]] = 1
    if direction == "torsion":
        motion[:, :3] = np.cross([0, 0, 1], points - [*network.cell_size[:2] / 2, 0])
    return motion


def wall_coupling(network: Network, wall: int, direction: str, pre_stress: str) -> Coupling:
    """Return the coupling of a wall, contact by contact."""
    tangent = contact_tangent(network, terms_of(pre_stress))
    push = np.zeros((network.n_particles, 6))
    pull = np.zeros((network.n_particles, 6))
    holding = 0.0
    for contact in np.flatnonzero(network.particle_j == wall):
        i = network.particle_i[contact]
        tangent_of_contact = tangent[contact : contact + 1]
        contact_point = network.position[i] + network.lever_i[contact]
        wall_motion = rigid_motion(network, contact_point[None], direction)[0]
        push[i] -= block(tangent_of_contact, 0, 1)[0] @ wall_motion
        pull[i] -= block(tangent_of_contact, 1, 0)[0].T @ wall_motion
        holding += wall_motion @ block(tangent_of_contact, 1, 1)[0] @ wall_motion
        if direction == "torsion" and SHEAR in terms_of(pre_stress):
            # The wall feels -t where the sphere is: the torque u_i x -t about z.
            pull[i, :3] += np.cross([0, 0, 1], network.force_tangential[contact])
    return Coupling(push.ravel(), pull.ravel(), holding)


def plane_coupling(network: Network, height: float, direction: str, pre_stress: str) -> Coupling:
    """Return the coupling of all bodies above a plane, which move together.

    Only contacts between bodies count.
    """
    between_bodies = network.with_contacts(network.particle_j >= 0)
    K = stiffness_matrix(between_bodies, pre_stress=pre_stress).toarray()
    motion = rigid_motion(network, network.position, direction)
    motion *= (network.position[:, 2] >= height)[:, None]
    u = motion.ravel()
    return Coupling(K @ u, K.T @ u, u @ K @ u)


def plate_coupling(
    network: Network, moving: np.ndarray, direction: str, pre_stress: str
) -> Coupling:
    """Return the coupling of the spheres `moving` (n,), which move together as a plate.

    All their contacts resist.
    """
    u = np.kron(moving, np.eye(6)[COMPONENT[direction]])
    K = stiffness_matrix(network, pre_stress=pre_stress).toarray()
    return Coupling(-K @ u, -K.T @ u, u @ K @ u)


def force_on(network: Network, spheres, direction: str) -> Coupling:
    """Return the coupling of a force that spheres share."""
    push = np.zeros((network.n_particles, 6))
    push[spheres, COMPONENT[direction]] = 1 / len(spheres)
    return no_coupling(network)._replace(push=push.ravel())


def moving_spheres(network: Network, source: Source) -> np.ndarray:
    """Return (n,): 1 for the spheres of a disc that moves, which make no other motion."""
    moving = np.zeros(network.n_particles)
    if isinstance(source, Disc) and not source.pushes:
        moving[source.spheres(network)] = 1
    return moving


def source_coupling(
    network: Network, source: Source, moving: np.ndarray, direction: str, pre_stress: str
) -> Coupling:
    """Return the coupling of any source; `moving` are the spheres of a disc that moves."""
    if isinstance(source, Disc) and source.pushes:
        return force_on(network, source.spheres(network), direction)
    if isinstance(source, Disc):
        return plate_coupling(network, moving, direction, pre_stress)
    if isinstance(source, Plane):
        return plane_coupling(network, source.height, direction, pre_stress)
    if isinstance(source, Point):
        return force_on(network, [source.particle], direction)
    return wall_coupling(network, SOURCE_WALL, direction, pre_stress)


def inverse_mass(network: Network, moving: np.ndarray) -> np.ndarray:
    """Return M^-1 (6n, 6n); it is zero for the spheres of a plate, whose motion is imposed."""
    M = np.zeros((network.n_particles, 6, 6))
    M[:, range(3), range(3)] = network.mass[:, None]
    if network.inertia_tensor is None:
        M[:, 3:, 3:] = network.inertia[:, None, None] * np.eye(3)
    else:
        M[:, 3:, 3:] = network.inertia_tensor
    inverse = np.zeros((6 * network.n_particles, 6 * network.n_particles))
    for k, inverse_of_body in enumerate(np.linalg.inv(M)):
        rows = slice(6 * k, 6 * k + 6)
        inverse[rows, rows] = inverse_of_body
    inverse[np.repeat(moving, 6) == 1] = 0
    return inverse


@dataclass
class DenseSystem:
    """Dense K, C and M^-1, and the couplings of springs and dashpots with source and receiver."""

    K: np.ndarray
    C: np.ndarray
    inverse_mass: np.ndarray
    source_springs: Coupling
    source_dashpots: Coupling
    receiver_springs: Coupling
    receiver_dashpots: Coupling

    @cached_property
    def springs_over_mass(self) -> np.ndarray:
        """Return M^-1 K."""
        return self.inverse_mass @ self.K

    @cached_property
    def dashpots_over_mass(self) -> np.ndarray:
        """Return M^-1 C."""
        return self.inverse_mass @ self.C

    @classmethod
    def of(
        cls,
        network: Network,
        source: Source,
        direction: str,
        pre_stress: str,
        damping: ContactDamping | None,
    ) -> "DenseSystem":
        """Return the matrices of a network with a source that acts in a direction."""
        moving = moving_spheres(network, source)
        K = stiffness_matrix(network, pre_stress=pre_stress).toarray()
        C = np.zeros_like(K)
        source_dashpots = no_coupling(network)
        receiver_dashpots = no_coupling(network)
        if damping is not None:
            dashpots = damping.dashpots(hold_own_bodies(network, source))
            C = stiffness_matrix(dashpots).toarray()
            receiver_dashpots = wall_coupling(dashpots, RECEIVER_WALL, direction, "none")
            if not source.pushes:
                source_dashpots = source_coupling(dashpots, source, moving, direction, "none")
        return cls(
            K=K,
            C=C,
            inverse_mass=inverse_mass(network, moving),
            source_springs=source_coupling(network, source, moving, direction, pre_stress),
            source_dashpots=source_dashpots,
            receiver_springs=wall_coupling(network, RECEIVER_WALL, direction, pre_stress),
            receiver_dashpots=receiver_dashpots,
        )


def rate_matrix(system: DenseSystem, motion: Motion) -> np.ndarray:
    """Return the matrix of the state (u, v, d, d', 1), in um and um/us, between two corners.

    The last rows are those of the motion d of the source: a straight line, or for a pulse
    d'' = Omega^2 (A - d).
    """
    N = len(system.K)
    L = np.zeros((2 * N + 3, 2 * N + 3))
    L[:N, N : 2 * N] = np.eye(N)
    L[2 * N, 2 * N + 1] = 1
    forces = [-system.K, -system.C, system.source_springs.push, system.source_dashpots.push]
    L[N : 2 * N, :-1] = system.inverse_mass @ np.column_stack(forces)
    if isinstance(motion, Pulse):
        square = (2 * np.pi * motion.frequency) ** 2
        L[-2, -3] = -square
        L[-2, -1] = square * motion.amplitude
    unit = np.concatenate([np.ones(N), np.full(N, 1e6), [1, 1e6, 1]])
    return L * unit / unit[:, None]


def states_of_wave(system: DenseSystem, motion: Motion, time: np.ndarray) -> np.ndarray:
    """Return the states (nt, 2N + 3) of a wave from rest by matrix exponentials.

    Each leads from a corner of the motion, or one of the times (nt,), s, to the next.
    """
    L = rate_matrix(system, motion)
    corners = motion.corners
    nodes = np.union1d(time, corners[corners < time[-1]])
    nodes = nodes[np.append(True, np.diff(nodes) > 1e-12)]
    d = motion.displacement(nodes)
    speeds = np.append(np.diff(d) / np.diff(nodes), 0.0)
    exponentials = {}
    states = []
    state = np.zeros(len(L))
    state[-1] = 1
    for k, node in enumerate(nodes):
        if not isinstance(motion, Pulse):
            state[-3] = d[k]
            state[-2] = speeds[k] / 1e6
        elif node > corners[-1] - 1e-12:
            # The pulse is over.
            state[-3:] = 0
        states.append(state.copy())
        if k < len(nodes) - 1:
            duration = nodes[k + 1] - node
            key = round(duration * 1e13)
            if key not in exponentials:
                exponentials[key] = expm(L * duration)
            state = exponentials[key] @ state
    return np.array(states)[np.searchsorted(nodes, time - 1e-12)]


def dense_wave(network, source, direction, pre_stress, damping, motion, time):
    """Return motions (nt, n), m, and the forces (nt,), N, on source and receiver."""
    system = DenseSystem.of(network, source, direction, pre_stress, damping)
    states = states_of_wave(system, motion, time)
    N = len(system.K)
    u = states[:, :N]
    v = states[:, N : 2 * N] * 1e6
    d = states[:, -3]
    rate = states[:, -2] * 1e6
    springs = system.source_springs
    dashpots = system.source_dashpots
    source_force = springs.holding * d - u @ springs.pull
    source_force = source_force + dashpots.holding * rate - v @ dashpots.pull
    receiver_force = u @ system.receiver_springs.pull + v @ system.receiver_dashpots.pull
    return u[:, COMPONENT[direction] :: 6], source_force, receiver_force


def dense_response(system: DenseSystem, s: complex) -> tuple[np.ndarray, complex, complex]:
    """Return u (6n,) and the forces on source and receiver for a source that moves as exp(s t)."""
    springs = system.source_springs
    dashpots = system.source_dashpots
    matrix = system.springs_over_mass + s * system.dashpots_over_mass + s**2 * np.eye(len(system.K))
    u = np.linalg.solve(matrix, system.inverse_mass @ (springs.push + s * dashpots.push))
    source_force = springs.holding + s * dashpots.holding - u @ (springs.pull + s * dashpots.pull)
    receiver_force = u @ (system.receiver_springs.pull + s * system.receiver_dashpots.pull)
    return u, source_force, receiver_force
