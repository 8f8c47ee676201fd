"""Packings that tests share, of every kind."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from changes import ENDS, PER_CONTACT, stiffer
from places import SHEARED

from modal.packing import crystal as gallery
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.sample import Sample, read_sample
from modal.preparation.random_packing import pack
from modal.system.linear_system import LinearSystem

YOUNG, POISSON = 60e9, 0.2


def polydisperse(periodic_z: bool = False, seed: int = 1, n: int = 60) -> Network:
    """Return a copy of the packing of `_make_polydisperse`, which is made once."""
    return replace(_make_polydisperse(periodic_z, seed, n))


@cache
def _make_polydisperse(periodic_z: bool, seed: int, n: int) -> Network:
    """Return spheres of radii 1:3, of glass and steel, pushed apart to overlaps of some percent.

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


def random_sample(spheres, stress, seed=1, aspect=2.5, tolerance=1e-4, **mixture) -> Sample:
    """Return a packing without friction at a stress, Pa; `mixture` as in `pack`."""
    given = {"aspect": aspect, "residual": tolerance, **mixture}
    with TemporaryDirectory() as folder:
        ((_, path),) = pack(Path(folder), lambda _: None, spheres, [stress], 0.0, seed, **given)
        return replace(read_sample(path), study={}, provenance={})


@cache
def frictionless() -> Network:
    """Return 150 spheres without friction at 100 kPa, some of them rattlers; made once."""
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


def sliding(times: float, cells: tuple[int, int, int] = (3, 3, 14)) -> Network:
    """Return a crystal that slides along its walls as one body.

    Its omega^2 is `times` the threshold below which a mode counts as floppy.
    """
    crystal = gallery.fcc(cells=cells)
    # Its omega^2 is the sum of the walls' springs over its mass.
    square = times * LinearSystem.of(crystal).zero_threshold
    held = square * crystal.mass.sum() / crystal.with_wall.sum()
    tangential = np.where(crystal.with_wall, held, crystal.stiffness_tangential)
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
    """Return a column with a contact that pulls across a gap of 2 % of the radius."""
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


def diluted(share: float, seed: int, layers: int = 6) -> Network:
    """Return a crystal without a random share of its contacts: with loose parts of every kind."""
    network = gallery.fcc(cells=(4, 4, layers))
    return network.with_contacts(np.random.default_rng(seed).random(network.n_contacts) > share)


def columns_side_by_side(copies: int, high: int = 2) -> Network:
    """Return uncoupled columns of `high` spheres: every frequency occurs `copies` times."""
    single = gallery.column(high)
    names = (*PER_CONTACT, "position", "radius", "mass", "inertia")
    many = {name: np.concatenate([getattr(single, name)] * copies) for name in names}
    first = np.repeat(np.arange(copies) * high, single.n_contacts)
    for end in ENDS:
        many[end] = np.where(many[end] >= 0, many[end] + first, many[end])
    return replace(single, **many)
