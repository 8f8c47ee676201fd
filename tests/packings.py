"""Packings that tests share, of every kind."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from changes import ENDS, PER_CONTACT, in_flight, stiffer
from places import SHEARED

from modal.packing import crystal as gallery
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.sample import Sample, read_sample
from modal.preparation.mixture import MixtureWords
from modal.preparation.random_packing import pack, width_of
from modal.preparation.stress_path import StressPath
from modal.preparation.study import Study
from modal.system.linear_system import LinearSystem

YOUNG = 60e9
POISSON = 0.2


def _pushed_apart(position, radius, side, periodic, steps=400) -> np.ndarray:
    """Return positions (n, 3) of spheres moved apart until they overlap by some percent at most.

    Each step moves both spheres of a pair along the line of centres; between walls, spheres stay
    inside.
    """
    first, second = np.triu_indices(len(radius), 1)
    for _ in range(steps):
        branch = position[second] - position[first]
        branch[:, periodic] -= side * np.round(branch[:, periodic] / side)
        distance = np.linalg.norm(branch, axis=1)
        overlap = np.maximum(radius[first] + radius[second] - distance - 1e-5, 0)
        push = 0.4 * (overlap / distance)[:, None] * branch
        np.add.at(position, first, -push)
        np.add.at(position, second, push)
        if not periodic[2]:
            position[:, 2] = np.clip(position[:, 2], 0.97 * radius, side - 0.97 * radius)
    position[:, periodic] %= side
    return position


def _touching_pairs(position, radius, side, periodic) -> tuple[np.ndarray, ...]:
    """Return both spheres (m,), cell shifts (m, 3) and branch vectors (m, 3) of contacts."""
    first, second = np.triu_indices(len(radius), 1)
    branch = position[second] - position[first]
    shift = np.zeros((len(first), 3), int)
    shift[:, periodic] = -np.round(branch[:, periodic] / side)
    branch = branch + shift * side
    touching = np.linalg.norm(branch, axis=1) < radius[first] + radius[second]
    return first[touching], second[touching], shift[touching], branch[touching]


def _touching_wall(position, radius, wall, height) -> tuple[np.ndarray, ...]:
    """Return the same of the spheres that touch a horizontal wall; its number is the second."""
    gap = abs(height - position[:, 2])
    spheres = np.flatnonzero(gap < radius)
    n_contacts = len(spheres)
    branch = np.zeros((n_contacts, 3))
    branch[:, 2] = height - position[spheres, 2]
    return spheres, np.full(n_contacts, wall), np.zeros((n_contacts, 3), int), branch


def polydisperse(periodic_z: bool = False, seed: int = 1, n: int = 60) -> Network:
    """Return a copy of the packing of `_make_polydisperse`, which is made once."""
    return replace(_make_polydisperse(periodic_z, seed, n))


@cache
def _make_polydisperse(periodic_z: bool, seed: int, n: int) -> Network:
    """Return spheres of radii 1:3, of glass and steel, pushed apart to overlaps of some percent.

    Contacts obey Hertz and Mindlin with R* = R_i R_j / (R_i + R_j); the contact point divides the
    branch as the radii do, and one contact in five slides. The packing is not in balance. It is
    between walls, or periodic in all directions.
    """
    random = np.random.default_rng(seed)
    radius = random.uniform(0.5e-3, 1.5e-3, n)
    side = np.cbrt((4 / 3 * np.pi * radius**3).sum() / 0.60)
    periodic = np.array([True, True, periodic_z])
    position = _pushed_apart(random.random((n, 3)) * side, radius, side, periodic)
    ends = [_touching_pairs(position, radius, side, periodic)]
    if not periodic_z:
        ends.append(_touching_wall(position, radius, SOURCE_WALL, 0.0))
        ends.append(_touching_wall(position, radius, RECEIVER_WALL, side))
    i, j, shift, branch = (np.concatenate(column) for column in zip(*ends, strict=True))

    pair = j >= 0
    distance = np.linalg.norm(branch, axis=1)
    normal = branch / distance[:, None]
    radius_j = np.where(pair, radius[j], 0.0)
    overlap = radius[i] + radius_j - distance
    effective_radius = np.where(pair, radius[i] * radius_j / (radius[i] + radius_j), radius[i])
    stiffness = YOUNG / (1 - POISSON**2) * np.sqrt(effective_radius * overlap)
    force = 2 / 3 * stiffness * overlap

    shear = np.cross(normal, random.standard_normal(normal.shape))
    mobilised = np.linalg.norm(shear, axis=1)
    limit = np.quantile(mobilised, 0.8)
    shear *= np.minimum(1, limit / mobilised)[:, None]
    mass = random.choice([2230.0, 7850.0], n) * 4 / 3 * np.pi * radius**3
    arm_i = np.where(pair, radius[i] * distance / (radius[i] + radius_j), distance)
    arm_j = np.where(pair, arm_i - distance, 0.0)
    return Network(
        position=position,
        radius=radius,
        mass=mass,
        inertia=0.4 * mass * radius**2,
        particle_i=i,
        particle_j=j,
        normal=normal,
        lever_i=arm_i[:, None] * normal,
        lever_j=arm_j[:, None] * normal,
        stiffness_normal=stiffness,
        stiffness_tangential=2 * (1 - POISSON) / (2 - POISSON) * stiffness,
        cell_size=np.full(3, side),
        cell_periodic=periodic,
        wall_position=np.array([0.0, side]),
        force_normal=force,
        force_tangential=0.1 * force[:, None] * shear,
        overlap=overlap,
        sliding=mobilised >= limit,
        cell_shift=shift,
    )


def random_sample(spheres, stress, seed=1, aspect=2.5, tolerance=1e-4, **mixture) -> Sample:
    """Return a packing without friction at a stress, Pa; `mixture` as in `MixtureWords`."""
    words = MixtureWords(**mixture).texts()
    study = Study(0.0, spheres, width_of(spheres, aspect), seed, residual=tolerance, **words)
    with TemporaryDirectory() as folder:
        ((_, path),) = pack(Path(folder), study, StressPath((stress,)), lambda _: None)
        return replace(read_sample(path), study={}, provenance={})


@cache
def frictionless() -> Network:
    """Return 150 spheres without friction at 100 kPa, some of them rattlers."""
    return random_sample(150, 1e5, seed=3).network()


@cache
def slender(seed: int = 3) -> Network:
    """Return 200 such spheres, more than 10 diameters long: with a bulk away from the walls."""
    return random_sample(200, 1e5, seed=seed, aspect=4.0).network()


@cache
def slim() -> Network:
    """Return 60 such spheres, to be repeated side by side."""
    return random_sample(60, 1e5, seed=2, aspect=4).network()


@cache
def sheared() -> Network:
    """Return 150 spheres compressed with friction in YADE, at rest."""
    return read_sample(SHEARED).network()


def sheared_crystal() -> Network:
    """Return 720 spheres of a crystal with shear forces, which the full tangent needs."""
    network = gallery.fcc(cells=(3, 3, 80))
    rng = np.random.default_rng(1)
    across = np.cross(network.normal, rng.standard_normal((network.n_contacts, 3)))
    return replace(network, force_tangential=0.1 * network.force_normal[:, None] * across)


def random_springs(seed: int, particles: int = 12, contacts: int = 60) -> Network:
    """Return springs of no packing: any levers, repeated pairs, spheres touching themselves."""
    rng = np.random.default_rng(seed)
    particle_i = rng.integers(0, particles, contacts)
    particle_j = rng.integers(-2, particles, contacts)
    with_wall = (particle_j < 0)[:, None]
    normal = rng.standard_normal((contacts, 3))
    return gallery.column(2).unchecked(
        position=rng.random((particles, 3)),
        radius=rng.uniform(0.5, 2, particles),
        mass=rng.uniform(0.5, 2, particles),
        inertia=rng.uniform(0.1, 0.4, particles),
        particle_i=particle_i,
        particle_j=particle_j,
        normal=normal / np.linalg.norm(normal, axis=1)[:, None],
        lever_i=rng.standard_normal((contacts, 3)),
        lever_j=np.where(with_wall, 0, rng.standard_normal((contacts, 3))),
        stiffness_normal=rng.uniform(0, 3, contacts),
        stiffness_tangential=rng.uniform(0, 3, contacts),
        force_normal=rng.uniform(0, 0.1, contacts),
        force_tangential=0.1 * rng.standard_normal((contacts, 3)),
        overlap=rng.uniform(0, 0.1, contacts),
        sliding=np.zeros(contacts, bool),
        cell_shift=np.where(with_wall, 0, [[1, 0, 0]]),
        cell_size=np.ones(3),
        cell_periodic=np.array([True, True, False]),
        wall_position=np.array([0.0, 1.0]),
    )


def sliding(times: float, cells: tuple[int, int, int] = (3, 3, 14)) -> Network:
    """Return a crystal that slides along its walls as one body.

    Its omega^2 is `times` the threshold below which a mode counts as floppy.
    """
    crystal = gallery.fcc(cells=cells)
    # Its omega^2 is the sum of the walls' springs over its mass.
    square = times * LinearSystem.of(crystal).zero_threshold
    wall_stiffness = square * crystal.mass.sum() / crystal.with_wall.sum()
    tangential = np.where(crystal.with_wall, wall_stiffness, crystal.stiffness_tangential)
    return replace(crystal, stiffness_tangential=tangential)


def disordered(cells: tuple[int, int, int] = (3, 3, 14)) -> Network:
    """Return a crystal with normal springs that differ by up to 30 %, and one highest mode."""
    crystal = gallery.fcc(cells=cells)
    return stiffer(crystal, 1 + 0.3 * np.random.default_rng(4).random(crystal.n_contacts))


def deep() -> Network:
    """Return a crystal whose spheres overlap by 0.1 of their radius."""
    network = gallery.fcc(4e8, (2, 2, 6))
    assert 0.09 < network.overlap.max() / network.radius[0] < 0.12
    return network


def cohesive() -> Network:
    """Return a column with a contact that pulls across a gap of 2 % of the radius.

    The spheres from the fourth on, and the upper wall, are lifted by the gap and the old overlap.
    """
    network = gallery.column(5)
    radius = network.radius[0]
    gap = 0.02 * radius
    lift = gap + network.overlap[3]
    position = network.position.copy()
    position[3:, 2] += lift
    lever = network.lever_i.copy()
    lever[3] = [0, 0, radius + gap / 2]
    force = network.force_normal.copy()
    force[3] = -force[3]
    overlap = network.overlap.copy()
    overlap[3] = -gap
    return replace(
        network,
        position=position,
        lever_i=lever,
        lever_j=np.where(network.with_wall[:, None], 0.0, -lever),
        force_normal=force,
        overlap=overlap,
        wall_position=network.wall_position + [0, lift],
    )


def diluted(share: float, seed: int, layers: int = 6) -> Network:
    """Return a crystal without a random share of its contacts: with loose parts of every kind."""
    network = gallery.fcc(cells=(4, 4, layers))
    return network.with_contacts(np.random.default_rng(seed).random(network.n_contacts) > share)


def columns_side_by_side(copies: int, high: int = 2) -> Network:
    """Return uncoupled columns of `high` spheres: every frequency occurs `copies` times."""
    column = gallery.column(high)
    columns = {}
    for name in (*PER_CONTACT, "position", "radius", "mass", "inertia"):
        columns[name] = np.concatenate([getattr(column, name)] * copies)
    first_sphere = np.repeat(np.arange(copies) * high, column.n_contacts)
    for end in ENDS:
        # Numbers of walls are negative and stay.
        columns[end] = np.where(columns[end] >= 0, columns[end] + first_sphere, columns[end])
    return replace(column, **columns)


def agitated_sample(spheres=120, friction=0.3, speed=0.05, aspect=1.5, **mixture):
    """Return a packing at 100 kPa whose spheres fly by two overlaps in 50 steps, and spin."""
    random = np.random.default_rng(5)
    packed = random_sample(spheres, 1e5, aspect=aspect, tolerance=1e-3, **mixture)
    velocity = speed * random.standard_normal((spheres, 3))
    surface_velocity = speed * random.standard_normal((spheres, 3))
    shear = np.zeros((packed.network().n_contacts, 2))
    packed = replace(packed, friction=friction, shear=shear)
    return in_flight(packed, velocity, surface_velocity / packed.radius)
