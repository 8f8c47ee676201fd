"""Compare sources, systems and integrators in all combinations with dense matrices.

The action of a source follows here from rigid motions: a wall, or all bodies above a plane, moves
or turns as one body, and the contacts with the other bodies push back.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from changes import bonded
from packings import polydisperse, sheared
from program_files import of_law
from scipy.linalg import expm

import modal
from modal.packing.layers import Layers
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.system.assembly import block, stiffness_matrix
from modal.system.contacts import SHEAR, contact_tangent, terms_of
from modal.system.damping import ContactDamping
from modal.waves.discs import Disc
from modal.waves.motions import Pulse, SampledMotion
from modal.waves.sources import Plane, Point, Wall, hold_own_bodies

pytestmark = pytest.mark.two_ways

EVERY = 1e-6
RECORDS = 30
MOTION = SampledMotion(EVERY * np.array([0, 2, 5, 9, 14]), 1e-9 * np.array([0, 2, -1, 1.5, 0]))
DAMPING = ContactDamping(0.05, 0.03)
COMPONENT = {"x": 0, "y": 1, "z": 2, "torsion": 5}


def free_sides() -> Network:
    """Return spheres of radii 1:3 between two walls, without periods."""
    network = polydisperse(n=40)
    inside = network.with_contacts(~network.cell_shift.any(axis=1))
    return replace(inside, cell_periodic=np.zeros(3, bool), cell_shift=None)


PACKINGS = {
    "free sides": free_sides,
    "cell": lambda: polydisperse(periodic_z=True, n=30),
    "bodies": lambda: bonded(polydisperse(n=30)),
    "sheared": sheared,
    "law": of_law,
}


@cache
def packing(name: str) -> Network:
    return PACKINGS[name]()


def rigid(network: Network, places: np.ndarray, direction: str) -> np.ndarray:
    """Return the motion (k, 6) at places (k, 3) of a body that moves, or turns about the middle."""
    motion = np.zeros((len(places), 6))
    motion[:, COMPONENT[direction]] = 1
    if direction == "torsion":
        motion[:, :3] = np.cross([0, 0, 1], places - [*network.cell_size[:2] / 2, 0])
    return motion


def of_wall(network: Network, wall: int, direction: str, pre_stress: str):
    """Return push (6n,), pull (6n,) and the holding force of a wall, contact by contact."""
    tangent = contact_tangent(network, terms_of(pre_stress))
    push = np.zeros((network.n_particles, 6))
    pull = np.zeros((network.n_particles, 6))
    holding = 0.0
    for contact in np.flatnonzero(network.particle_j == wall):
        i = network.particle_i[contact]
        tangent_of_contact = tangent[contact : contact + 1]
        contact_point = network.position[i] + network.lever_i[contact]
        wall_motion = rigid(network, contact_point[None], direction)[0]
        push[i] -= block(tangent_of_contact, 0, 1)[0] @ wall_motion
        pull[i] -= block(tangent_of_contact, 1, 0)[0].T @ wall_motion
        holding += wall_motion @ block(tangent_of_contact, 1, 1)[0] @ wall_motion
        if direction == "torsion" and SHEAR in terms_of(pre_stress):
            # The wall feels -t where the sphere is: the torque u_i x -t about z.
            pull[i, :3] += np.cross([0, 0, 1], network.force_tangential[contact])
    return push.ravel(), pull.ravel(), holding


def of_plane(network: Network, height: float, direction: str, pre_stress: str):
    """Return push, pull and holding force if all bodies above a plane move together.

    Only contacts between bodies count.
    """
    inner = network.with_contacts(network.particle_j >= 0)
    K = stiffness_matrix(inner, pre_stress=pre_stress).toarray()
    above = rigid(network, network.position, direction)
    above *= (network.position[:, 2] >= height)[:, None]
    u = above.ravel()
    return K @ u, K.T @ u, u @ K @ u


def plate(network, source):
    """Return (n,): 1 for the spheres of a disc that moves, which make no other motion."""
    moving = np.zeros(network.n_particles)
    if isinstance(source, Disc) and not source.pushes:
        moving[source.spheres(network)] = 1
    return moving


def of_disc(network: Network, moving: np.ndarray, direction: str, pre_stress: str):
    """Return the same for the spheres `moving` (n,) along the direction: all contacts resist."""
    e = np.kron(moving, np.eye(6)[COMPONENT[direction]])
    K = stiffness_matrix(network, pre_stress=pre_stress).toarray()
    return -K @ e, -K.T @ e, e @ K @ e


def sourced(network, source, moving, direction, pre_stress):
    if isinstance(source, Disc) and source.pushes:
        share = np.zeros((network.n_particles, 6))
        share[source.spheres(network), COMPONENT[direction]] = 1 / len(source.spheres(network))
        return share.ravel(), 0 * share.ravel(), 0.0
    if isinstance(source, Disc):
        return of_disc(network, moving, direction, pre_stress)
    if isinstance(source, Plane):
        return of_plane(network, source.height, direction, pre_stress)
    if isinstance(source, Point):
        push = np.zeros(6 * network.n_particles)
        push[6 * source.particle + COMPONENT[direction]] = 1
        return push, 0 * push, 0.0
    return of_wall(network, SOURCE_WALL, direction, pre_stress)


def matrices(network, source, direction, pre_stress, damping):
    """Return dense K, C, M^-1, and push, pull and holding force of source and receiver.

    The last four are those of the source's springs and dashpots, and of the receiver's.
    """
    M = np.zeros((network.n_particles, 6, 6))
    M[:, range(3), range(3)] = network.mass[:, None]
    tensor = network.inertia_tensor
    M[:, 3:, 3:] = network.inertia[:, None, None] * np.eye(3) if tensor is None else tensor
    N = 6 * network.n_particles
    inverse = np.zeros((N, N))
    for k, inverse_of_body in enumerate(np.linalg.inv(M)):
        inverse[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = inverse_of_body
    dashpots = None if damping is None else damping.dashpots(hold_own_bodies(network, source))
    K = stiffness_matrix(network, pre_stress=pre_stress).toarray()
    C = 0 * K if dashpots is None else stiffness_matrix(dashpots).toarray()
    no_action = np.zeros(N), np.zeros(N), 0.0
    moving = plate(network, source)
    spring = sourced(network, source, moving, direction, pre_stress)
    viscous = no_action
    if dashpots is not None and not source.pushes:
        viscous = sourced(dashpots, source, moving, direction, "none")
    inverse[np.repeat(moving, 6) == 1] = 0
    receiver_spring = of_wall(network, RECEIVER_WALL, direction, pre_stress)
    receiver_dashpot = (
        no_action if dashpots is None else of_wall(dashpots, RECEIVER_WALL, direction, "none")
    )
    return K, C, inverse, spring, viscous, receiver_spring, receiver_dashpot


def dense_wave(network, source, direction, pre_stress, damping, motion, time):
    """Compute motions (nt, n) and forces on both walls (nt,) by matrix exponentials.

    The state u, v, d, d' is taken from each corner of the motion, or time (nt,), s, to the next;
    that of a pulse includes d'' = Omega^2 (A - d).
    """
    K, C, inverse, spring, viscous, receiver_spring, receiver_dashpot = matrices(
        network, source, direction, pre_stress, damping
    )
    N = len(K)
    corners = motion.corners
    L = np.zeros((2 * N + 3, 2 * N + 3))
    L[:N, N : 2 * N] = np.eye(N)
    L[2 * N, 2 * N + 1] = 1
    L[N : 2 * N, :-1] = inverse @ np.column_stack([-K, -C, spring[0], viscous[0]])
    if pulse := isinstance(motion, Pulse):
        drive = (2 * np.pi * motion.frequency) ** 2
        L[-2, [-3, -1]] = -drive, drive * motion.amplitude
    unit = np.concatenate([np.ones(N), np.full(N, 1e6), [1, 1e6, 1]])  # um, um/us
    L = L * unit / unit[:, None]
    nodes = np.union1d(time, corners[corners < time[-1]])
    nodes = nodes[np.append(True, np.diff(nodes) > 1e-12)]
    d = motion.displacement(nodes)
    steps = {}
    state = np.zeros(2 * N + 3)
    states = []
    speeds = np.append(np.diff(d) / np.diff(nodes), 0.0)
    state[-1] = 1
    for k, node in enumerate(nodes):
        if not pulse:
            state[-3:-1] = d[k], speeds[k] / 1e6
        elif node > corners[-1] - 1e-12:
            state[-3:] = 0
        states.append(state.copy())
        if k < len(nodes) - 1:
            h = nodes[k + 1] - node
            key = round(h * 1e13)
            steps[key] = steps[key] if key in steps else expm(L * h)
            state = steps[key] @ state
    states = np.array(states)[np.searchsorted(nodes, time - 1e-12)]
    u = states[:, :N]
    v = states[:, N : 2 * N] * 1e6
    d = states[:, -3]
    rate = states[:, -2] * 1e6
    source_force = spring[2] * d - u @ spring[1] + viscous[2] * rate - v @ viscous[1]
    return (
        u[:, COMPONENT[direction] :: 6],
        source_force,
        u @ receiver_spring[1] + v @ receiver_dashpot[1],
    )


CASES = [
    ("free sides", Wall(), "torsion", "none", None),
    ("free sides", Wall(), "torsion", "full", DAMPING),
    ("free sides", Wall(), "y", "normal", DAMPING),
    ("free sides", Wall(), "z", "none", DAMPING),
    ("free sides", Plane(0.004), "torsion", "none", None),
    ("free sides", Plane(0.004), "torsion", "none", DAMPING),
    ("free sides", Plane(0.004), "x", "normal", None),
    ("free sides", Point(7), "torsion", "full", None),
    ("cell", Point(3), "x", "none", DAMPING),
    ("cell", Point(3), "torsion", "normal", None),
    ("bodies", Wall(), "x", "none", DAMPING),
    ("bodies", Wall(), "z", "none", None),
    ("bodies", Point(4), "torsion", "none", DAMPING),
    ("law", Wall(), "z", "law", None),
    ("free sides", Disc((0.004, 0.004, 0.004), 0.002, "x"), "x", "none", None),
    ("free sides", Disc((0.004, 0.004, 0.0), 0.003, "z"), "z", "normal", DAMPING),
    ("cell", Disc((0.0, 0.0, 0.003), 0.002, "y"), "y", "none", DAMPING),
    ("bodies", Disc((0.004, 0.004, 0.004), 0.002, "z", "force"), "z", "none", None),
]


@pytest.mark.parametrize(("name", "source", "direction", "pre_stress", "damping"), CASES)
def test_wave_against_a_matrix_exponential(name, source, direction, pre_stress, damping):
    """Compare every sphere and both walls; round-off of the exponential is 1e-11 of the motion."""
    network = packing(name)
    wave = modal.propagate(
        network,
        EVERY * RECORDS,
        source=source,
        direction=direction,
        pre_stress=pre_stress,
        damping=damping,
        motion=MOTION,
        interval=EVERY,
        particles=True,
    )
    time = EVERY * np.arange(RECORDS + 1)
    exact_motion, source_force, receiver_force = dense_wave(
        network, source, direction, pre_stress, damping, MOTION, time
    )
    exact_motion = exact_motion + np.outer(MOTION.displacement(time), plate(network, source))
    signals = wave.signals
    assert signals.particle_displacement == pytest.approx(
        exact_motion, abs=1e-8 * abs(exact_motion).max()
    )
    assert signals.source == source.name
    if source.pushes:
        assert not len(signals.source_stress)
    else:
        # At corners of the motion its rate jumps, and with it the force of dashpots.
        smooth = np.ones(len(source_force), bool)
        smooth[np.rint(MOTION.time / EVERY).astype(int)] = damping is None
        stress = source_force / network.area
        scale = 1e-8 * abs(stress).max()
        assert signals.source_stress[smooth] == pytest.approx(stress[smooth], abs=scale)
    if name != "cell":
        receiver_force = receiver_force / network.area
        scale = 1e-8 * max(abs(receiver_force).max(), abs(signals.source_stress).max(initial=0.0))
        assert signals.receiver_stress == pytest.approx(receiver_force, abs=scale)


@pytest.mark.parametrize(
    ("name", "source", "direction", "pre_stress", "damping"),
    [case for case in CASES if case[3] == "none" or case[4]]
    + [("sheared", Plane(0.01), "x", "full", None), ("sheared", Point(9), "z", "normal", None)],
)
def test_response_against_dense_solves(name, source, direction, pre_stress, damping):
    """Compare with dense solves, at real frequencies with dashpots.

    Without dashpots the solves are under the window whose width is the resolution. Forces that
    contacts carry need a packing at rest, or dashpots: other packings are unstable.
    """
    network = packing(name)
    resolution = 8e3
    response = modal.frequency_response(
        network,
        source=source,
        direction=direction,
        pre_stress=pre_stress,
        damping=damping,
        highest=4e4,
        resolution=resolution,
        tolerance=1e-9,
    )
    K, C, inverse, spring, viscous, receiver_spring, receiver_dashpot = matrices(
        network, source, direction, pre_stress, damping
    )
    layers = []
    source_force = []
    receiver_force = []
    springs = inverse @ K
    viscosity = inverse @ C
    for f in response.frequency:
        s = -2j * np.pi * f + (np.pi * resolution if damping is None else 0)
        matrix = springs + s * viscosity + s**2 * np.eye(len(K))
        u = np.linalg.solve(matrix, inverse @ (spring[0] + s * viscous[0]))
        layers.append(u[COMPONENT[direction] :: 6] + plate(network, source))
        source_force.append(spring[2] + s * viscous[2] - u @ (spring[1] + s * viscous[1]))
        receiver_force.append(u @ (receiver_spring[1] + s * receiver_dashpot[1]))
    means = np.array([Layers(network).means(u.real) for u in layers])
    means = means + 1j * np.array([Layers(network).means(u.imag) for u in layers])
    assert response.layer_displacement == pytest.approx(means, abs=1e-8 * abs(means).max())
    for stress, force in (
        (response.source_stress, source_force),
        (response.receiver_stress, receiver_force),
    ):
        if len(stress):
            expected = np.array(force) / network.area
            assert stress == pytest.approx(expected, abs=1e-8 * abs(expected).max())
