"""Sound networks of every kind that a reader must accept."""

from dataclasses import replace
from functools import cache

import numpy as np
import scipy.sparse as sp
from places import SHEARED

from modal.packing import crystal as gallery
from modal.packing.columns import COLUMNS
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.sample import Sample, read_sample
from modal.packing.tiling import repeat
from modal.preparation.random_packing import random_network
from modal.system.assembly import block
from modal.system.contacts import contact_tangent, terms_of, with_sliding
from modal.system.imposed import WallMoves, put_on
from modal.system.linear_system import LinearSystem
from modal.waves.propagate import propagate
from modal.waves.signals import Signals

YOUNG, POISSON = 60e9, 0.2


def polydisperse(periodic_z: bool = False, seed: int = 1, n: int = 60) -> Network:
    """Spheres of radii 1:3, of glass and of steel, pushed apart to overlaps of some per cent.

    Hertz and Mindlin with R* = R_i R_j / (R_i + R_j); the contact point divides the branch as the
    radii do, and one contact in five slides. Not in balance. Between walls, or periodic in all
    directions.
    """
    random = np.random.default_rng(seed)
    radius = random.uniform(0.5e-3, 1.5e-3, n)
    side = np.cbrt((4 / 3 * np.pi * radius**3).sum() / 0.60)
    position = random.random((n, 3)) * side
    wrapped = np.array([True, True, periodic_z])
    first, second = np.triu_indices(n, 1)
    for _ in range(400):
        branch = position[second] - position[first]
        branch[:, wrapped] -= side * np.round(branch[:, wrapped] / side)
        distance = np.linalg.norm(branch, axis=1)
        deep = np.maximum(radius[first] + radius[second] - distance - 1e-5, 0)
        push = 0.4 * (deep / distance)[:, None] * branch
        np.add.at(position, first, -push)
        np.add.at(position, second, push)
        if not periodic_z:
            position[:, 2] = np.clip(position[:, 2], 0.97 * radius, side - 0.97 * radius)
    position[:, wrapped] %= side
    shift = np.zeros((len(first), 3), int)
    raw = position[second] - position[first]
    shift[:, wrapped] = -np.round(raw[:, wrapped] / side)
    distance = np.linalg.norm(raw + shift * side, axis=1)
    near = distance < radius[first] + radius[second]
    ends = [(first[near], second[near], shift[near], (raw + shift * side)[near])]
    if not periodic_z:
        for wall, z, sign in ((SOURCE_WALL, 0.0, -1), (RECEIVER_WALL, side, 1)):
            at = np.flatnonzero(sign * (z - position[:, 2]) < radius)
            branch = np.column_stack([0 * at, 0 * at, z - position[at, 2]])
            ends.append((at, np.full(len(at), wall), np.zeros((len(at), 3), int), branch))
    i, j, shift, branch = (np.concatenate(column) for column in zip(*ends, strict=True))
    pair = j >= 0
    distance = np.linalg.norm(branch, axis=1)
    normal = branch / distance[:, None]
    other = np.where(pair, radius[j], 0.0)
    overlap = radius[i] + other - distance
    reduced = np.where(pair, radius[i] * other / (radius[i] + other), radius[i])
    stiff = YOUNG / (1 - POISSON**2) * np.sqrt(reduced * overlap)
    force = 2 / 3 * stiff * overlap
    across = np.cross(normal, random.standard_normal(normal.shape))
    share = np.linalg.norm(across, axis=1)
    limit = np.quantile(share, 0.8)
    across *= np.minimum(1, limit / share)[:, None]
    mass = random.choice([2230.0, 7850.0], n) * 4 / 3 * np.pi * radius**3
    at_i = np.where(pair, radius[i] * distance / (radius[i] + other), distance)
    return Network(
        position=position,
        radius=radius,
        mass=mass,
        inertia=0.4 * mass * radius**2,
        particle_i=i,
        particle_j=j,
        normal=normal,
        lever_i=at_i[:, None] * normal,
        lever_j=np.where(pair, at_i - distance, 0.0)[:, None] * normal,
        stiffness_normal=stiff,
        stiffness_tangential=2 * (1 - POISSON) / (2 - POISSON) * stiff,
        cell_size=np.full(3, side),
        cell_periodic=wrapped,
        wall_position=np.array([0.0, side]),
        force_normal=force,
        force_tangential=0.1 * force[:, None] * across,
        overlap=overlap,
        sliding=share >= limit,
        cell_shift=shift,
    )


def in_units(network: Network, length: float, mass: float, time: float) -> Network:
    """The same packing in other units, and without notes, whose units nobody knows."""
    stiffness = mass / time**2
    units = {"m": length, "kg": mass, "kg m^2": mass * length**2}
    units |= {"N/m": stiffness, "N": stiffness * length}
    changed = {
        name: units[column.unit] * getattr(network, name)
        for name, column in COLUMNS.items()
        if column.unit in units and getattr(network, name) is not None
    }
    return replace(network, study={}, **changed)


@cache
def frictionless() -> Network:
    """150 spheres without friction at 100 kPa, some rattling; made once."""
    return random_network(150, 1e5, seed=3)


@cache
def slender(seed: int = 3) -> Network:
    """200 such spheres: more than 10 diameters long, so that it has a bulk away from its walls."""
    return random_network(200, 1e5, seed=seed, aspect=4.0)


@cache
def sheared() -> Network:
    """150 spheres compressed with friction in YADE, at rest."""
    return read_sample(SHEARED).network()


def random_springs(seed: int, particles: int = 12, contacts: int = 60) -> Network:
    """Contacts that no packing has: any levers, repeated pairs, spheres touching themselves."""
    rng = np.random.default_rng(seed)
    n, m = particles, contacts
    i, j = rng.integers(0, n, m), rng.integers(-2, n, m)
    normal = rng.standard_normal((m, 3))
    wall = j < 0
    return gallery.column(2).unchecked(
        position=rng.random((n, 3)),
        radius=rng.uniform(0.5, 2, n),
        mass=rng.uniform(0.5, 2, n),
        inertia=rng.uniform(0.1, 0.4, n),
        particle_i=i,
        particle_j=j,
        normal=normal / np.linalg.norm(normal, axis=1)[:, None],
        lever_i=rng.standard_normal((m, 3)),
        lever_j=np.where(wall[:, None], 0, rng.standard_normal((m, 3))),
        stiffness_normal=rng.uniform(0, 3, m),
        stiffness_tangential=rng.uniform(0, 3, m),
        force_normal=rng.uniform(0, 0.1, m),
        force_tangential=0.1 * rng.standard_normal((m, 3)),
        overlap=rng.uniform(0, 0.1, m),
        sliding=np.zeros(m, bool),
        cell_shift=np.where(wall[:, None], 0, [[1, 0, 0]]),
        cell_size=np.ones(3),
        cell_periodic=np.array([True, True, False]),
        wall_position=np.array([0.0, 1.0]),
    )


def deep() -> Network:
    """A crystal whose spheres overlap by 0.1 of their radius."""
    network = gallery.fcc(4e8, (2, 2, 6))
    assert 0.09 < network.overlap.max() / network.radius[0] < 0.12
    return network


def bonded(network: Network) -> Network:
    """Contacts that roll and twist as well, and bodies with tensors of inertia."""
    rng = np.random.default_rng(2)
    turned = np.linalg.qr(rng.standard_normal((network.n_particles, 3, 3)))[0]
    moments = network.inertia[:, None, None] * np.diag([0.8, 1.0, 1.2])
    reach = network.radius.mean() ** 2 * network.stiffness_normal
    return replace(
        network,
        stiffness_rolling=rng.uniform(0, 0.1, network.n_contacts) * reach,
        stiffness_twisting=rng.uniform(0, 0.1, network.n_contacts) * reach,
        inertia_tensor=turned @ moments @ turned.transpose(0, 2, 1),
    )


def levers_of_radii(network: Network) -> Network:
    """Levers as long as the radii, as some programs have them; to the plane of a wall."""
    pair = ~network.with_wall
    plane = network.wall_position[np.where(network.particle_j == SOURCE_WALL, 0, 1)]
    to_wall = abs(plane - network.position[network.particle_i, 2])
    length = np.where(pair, network.radius[network.particle_i], to_wall)
    other = np.where(pair, network.radius[network.particle_j], 0.0)
    return replace(
        network,
        lever_i=length[:, None] * network.normal,
        lever_j=-other[:, None] * network.normal,
    )


def scaled(values: np.ndarray, rows: object, factor: float) -> np.ndarray:
    """A copy with some rows times a factor."""
    changed = values.copy()
    changed[rows] *= factor
    return changed


def rounded(network: Network, digits: int = 7) -> Network:
    """All numbers as a text of so many significant digits keeps them."""
    columns = {}
    for name, data in vars(network).items():
        if isinstance(data, np.ndarray) and data.dtype.kind == "f":
            text = [float(f"{x:.{digits - 1}e}") for x in data.ravel()]
            columns[name] = np.reshape(text, data.shape)
    return replace(network, **columns)


def cohesive() -> Network:
    """Some contacts pull, some across a gap of 2 % of the radius."""
    network = gallery.column(5)
    z = network.position[:, 2].copy()
    gap = 0.02 * network.radius[0]
    z[3:] += gap + network.overlap[3]
    lever = network.lever_i.copy()
    lever[3] = [0, 0, network.radius[0] + gap / 2]
    force, overlap = network.force_normal.copy(), network.overlap.copy()
    force[3], overlap[3] = -force[3], -gap
    lift = gap + network.overlap[3]
    return replace(
        network,
        position=np.column_stack([network.position[:, :2], z]),
        lever_i=lever,
        lever_j=np.where(network.with_wall[:, None], 0.0, -lever),
        force_normal=force,
        overlap=overlap,
        wall_position=network.wall_position + [0, lift],
    )


def shells() -> Network:
    """A crystal of hollow spheres."""
    network = gallery.fcc(cells=(3, 3, 4))
    return replace(network, inertia=2 / 3 * network.mass * network.radius**2, study={})


def unwrapped() -> Network:
    """Centres several periods away, with the periods that bring them back."""
    network = gallery.fcc(cells=(2, 2, 5))
    away = np.random.default_rng(1).integers(-3, 4, network.position.shape) * [1, 1, 0]
    pair = ~network.with_wall
    shift = network.cell_shift.copy()
    shift[pair] += (away[network.particle_i] - away[network.particle_j])[pair]
    return replace(network, position=network.position + away * network.cell_size, cell_shift=shift)


SOUND = {
    "crystal": lambda: gallery.fcc(cells=(2, 2, 8)),
    "crystal one sphere wide": lambda: gallery.fcc(cells=(1, 1, 8)),
    "long crystal": lambda: gallery.fcc(cells=(1, 1, 300)),
    "hardly pressed": lambda: gallery.fcc(1e-3, (2, 2, 8)),
    "column": lambda: gallery.column(3),
    "copies side by side": lambda: repeat(gallery.fcc(cells=(1, 1, 5)), 3, 2),
    "sheared": sheared,
    "deep overlaps": deep,
    "levers as long as deep radii": lambda: levers_of_radii(deep()),
    "levers as long as radii": lambda: levers_of_radii(sheared()),
    "radii 1:3": polydisperse,
    "radii 1:3, levers as long": lambda: levers_of_radii(polydisperse()),
    "periodic in all directions": lambda: polydisperse(periodic_z=True),
    "cohesive": cohesive,
    "shells": shells,
    "unwrapped": unwrapped,
}
"""Name -> maker of a network."""
OPTIONAL = ("force_normal", "force_tangential", "overlap", "sliding", "cell_shift")


def bare(network: Network, *kept: str) -> Network:
    """The network without its optional data, but for those `kept`."""
    return replace(network, **{name: None for name in OPTIONAL if name not in kept})


def turned(network: Network, matrix: np.ndarray, **columns: np.ndarray) -> Network:
    """All vectors turned; cell and walls are left to those who have them."""
    vectors = ("position", "normal", "lever_i", "lever_j", "force_tangential")
    network = network.unchecked(**{name: getattr(network, name) @ matrix.T for name in vectors})
    return replace(network, **columns)


def mirrored(network: Network) -> Network:
    """Left and right exchanged along x: another packing with as many contacts."""
    flip = np.array([-1, 1, 1])
    return turned(network, np.diag(flip), cell_shift=network.cell_shift * flip)


ENDS = ("particle_i", "particle_j")
SPRINGS = ("stiffness_normal", "stiffness_tangential")
PER_CONTACT = (*ENDS, "normal", "lever_i", "lever_j", *SPRINGS, *OPTIONAL)


def from_other_end(network: Network, other: np.ndarray) -> Network:
    """The contacts of `other` (m,) bool, none with a wall, told from their second sphere."""
    i, j, side = network.particle_i, network.particle_j, other[:, None]
    names = ("normal", "force_tangential", "cell_shift")
    vectors = {name: getattr(network, name) for name in names}
    return replace(
        network,
        particle_i=np.where(other, j, i),
        particle_j=np.where(other, i, j),
        lever_i=np.where(side, network.lever_j, network.lever_i),
        lever_j=np.where(side, network.lever_i, network.lever_j),
        **{name: np.where(side, -1, 1) * data for name, data in vectors.items()},
    )


def renumbered(network: Network, number: np.ndarray) -> Network:
    """The same packing, sphere k being number[k], its contacts in another order."""
    back = np.argsort(number)
    mixed = network.with_contacts(np.random.default_rng(2).permutation(network.n_contacts))
    return replace(
        mixed,
        **{k: getattr(network, k)[back] for k in ("position", "radius", "mass", "inertia")},
        particle_i=number[mixed.particle_i],
        particle_j=np.where(mixed.with_wall, mixed.particle_j, number[mixed.partner]),
    )


def diluted(share: float, seed: int, layers: int = 6) -> Network:
    """A crystal that has lost a share of its contacts at random: loose parts of every kind."""
    network = gallery.fcc(cells=(4, 4, layers))
    return network.with_contacts(np.random.default_rng(seed).random(network.n_contacts) > share)


def dense_squares(system: LinearSystem) -> np.ndarray:
    """All omega^2, ascending, by a dense solver."""
    return np.linalg.eigvalsh(system.scaled.toarray())


def columns_side_by_side(copies: int, high: int = 2) -> Network:
    """Uncoupled columns of `high` spheres: every frequency at least so many times."""
    single = gallery.column(high)
    names = (*PER_CONTACT, "position", "radius", "mass", "inertia")
    many = {name: np.concatenate([getattr(single, name)] * copies) for name in names}
    first = np.repeat(np.arange(copies) * high, single.n_contacts)
    for end in ENDS:
        many[end] = np.where(many[end] >= 0, many[end] + first, many[end])
    return replace(single, **many)


def wall_pattern(network: Network, wall: int, pre_stress: str = "none", axis: int = 2):
    """Push on the particles (6n,), pull on the wall (6n,) and what holds it, N/m and N."""
    coupling = put_on(network, terms_of(pre_stress), WallMoves(wall, axis))
    push, pull = (each.toarray()[:, 0] for each in (coupling.push, coupling.pull))
    return push, pull, float(coupling.held[0, 0])


def contact_matrices(network: Network, pre_stress: str | tuple[str, ...] = "none") -> np.ndarray:
    """Shape (m, 12, 12): of each contact on (u_i, theta_i, u_j, theta_j); zero for a wall's."""
    terms = terms_of(pre_stress) if isinstance(pre_stress, str) else pre_stress
    tangent, pair = contact_tangent(network, terms), network.particle_j >= 0
    whole = np.block([[block(tangent, a, b) for b in (0, 1)] for a in (0, 1)])
    whole[~pair, 6:] = 0
    whole[~pair, :, 6:] = 0
    return whole


def stepped(
    network: Network, duration: float, step: float, *, every: int = 1, **settings
) -> Signals:
    """The signals of a wave by leapfrog, recorded at each `every`-th time step, s."""
    how = {"interval": every * step, "time_step": step, **settings}
    return propagate(network, duration, **how).signals


def slow_stiffness(network: Network) -> np.ndarray:
    """Dense K (6n, 6n), column by column from forces: an oracle without the 12x12 matrices.

    Each degree of freedom is displaced by one unit in turn; the springs' forces and the torques
    they exert with their levers are summed in plain vector algebra. Walls are a body that rests.
    """
    n, normal = network.n_particles, network.normal
    i, j = (
        network.particle_i,
        np.where(network.particle_j < 0, network.n_particles, network.particle_j),
    )

    def split(vector: np.ndarray, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        part = (vector * normal).sum(axis=1)[:, None] * normal
        return along[:, None] * part + across[:, None] * (vector - part)

    K = np.zeros((6 * n, 6 * n))
    for column in range(6 * n):
        motion, load = np.zeros((2, n + 1, 2, 3))
        motion.flat[column] = 1.0
        u, turn = motion[:, 0], motion[:, 1]
        slip = u[j] + np.cross(turn[j], network.lever_j) - u[i] - np.cross(turn[i], network.lever_i)
        force = split(slip, network.stiffness_normal, network.stiffness_tangential)
        for end, lever, sign in ((i, network.lever_i, -1), (j, network.lever_j, 1)):
            np.add.at(load[:, 0], end, sign * force)
            np.add.at(load[:, 1], end, sign * np.cross(lever, force))
            if network.stiffness_rolling is not None:
                rolling, twisting = network.stiffness_rolling, network.stiffness_twisting
                np.add.at(load[:, 1], end, sign * split(turn[j] - turn[i], twisting, rolling))
        K[:, column] = load[:n].ravel()
    return K


def kinematics(network: Network) -> np.ndarray:
    """Shape (m, 3, 12): from (u_i, theta_i, u_j, theta_j) to the slip, by its definition."""
    B = np.zeros((network.n_contacts, 3, 12))
    for axis, unit in enumerate(np.eye(3)):
        B[:, axis, axis], B[:, axis, 6 + axis] = -1, 1
        B[:, :, 3 + axis] = -np.cross(unit, network.lever_i)
        B[:, :, 9 + axis] = np.cross(unit, network.lever_j)
    B[network.with_wall, :, 6:] = 0
    return B


def changed(network: Network, **columns) -> Network:
    """The network with functions of its columns in their place."""
    return replace(network, **{name: f(getattr(network, name)) for name, f in columns.items()})


def stiffer(network: Network, normal=1.0, tangential=1.0) -> Network:
    """Springs times factors, of all contacts or (m,) each, beside the checks of a network."""
    return network.unchecked(
        stiffness_normal=normal * network.stiffness_normal,
        stiffness_tangential=tangential * network.stiffness_tangential,
    )


def slippery(network: Network) -> Network:
    """All contacts slide: no tangential spring is left."""
    return with_sliding(replace(network, sliding=np.ones(network.n_contacts, bool)), "slip")


def in_flight(sample: Sample, velocity: np.ndarray, spin: np.ndarray | None = None) -> Sample:
    """With velocities (n, 3), m/s, and spins, rad/s, of its spheres, in a cell at rest."""
    spin = np.zeros_like(velocity) if spin is None else spin
    return replace(sample, velocity=velocity, angular_velocity=spin, strain_rate=np.zeros(3))


def times(factor: float):
    return lambda data: factor * data


def permuted(data: np.ndarray) -> np.ndarray:
    return np.random.default_rng(1).permutation(data)


PRE_STRESS = ("none", "normal", "full")
"""Choices that every network with forces knows."""


def asymmetry(matrix: sp.csr_matrix) -> float:
    """Frobenius norm of a matrix's antisymmetric part over its own: 0 where it is symmetric."""
    difference = (matrix - matrix.T) / 2
    return float(np.sqrt((difference.data**2).sum() / (matrix.data**2).sum()))
