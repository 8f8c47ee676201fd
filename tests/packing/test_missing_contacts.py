"""Tests that lost contacts show as spheres, or spheres and walls, that overlap without one."""

import time
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import packings
import pytest

import modal
from modal.packing.missing_contacts import missing_contacts
from modal.packing.network import Network, write_network


@cache
def with_two_sizes(ratio: float) -> Network:
    """Return a packing of two sizes, whose radii have this ratio."""
    mixture = {"sizes": ["two", ratio, 0.8], "aspect": 1.0, "tolerance": 1e-2}
    return packings.random_sample(400, 1e5, seed=4, **mixture).network()


def without_periods(network: Network) -> Network:
    """Return the packing with free sides, without the contacts through periods."""
    inner = network.with_contacts(~network.periods.any(axis=1))
    return replace(inner, cell_periodic=np.zeros(3, bool), cell_shift=None)


CELLS = {
    "walls": packings.frictionless,
    "free sides": lambda: without_periods(packings.frictionless()),
    "two sizes": lambda: with_two_sizes(5.5),
    "two sizes, free sides": lambda: without_periods(with_two_sizes(5.5)),
    "periodic": lambda: packings.random_sample(100, 1e5, seed=2, periodic=True).network(),
    "wide range of sizes": lambda: packings.polydisperse(),
    "crystal, a cell wide": lambda: modal.fcc(cells=(1, 1, 6)),
    "cohesive": packings.cohesive,
}


@pytest.mark.parametrize("name", CELLS)
def test_as_many_as_were_taken_away(name):
    network = CELLS[name]()
    assert missing_contacts(network) == (0, 0)
    remains = np.random.default_rng(3).random(network.n_contacts) < 0.5
    overlap = overlap_of(network)
    # Overlaps below a tenth of the mean of the others do not count.
    deep = ~remains & (overlap > 0.1 * abs(overlap[remains]).mean())
    missing = missing_contacts(network.with_contacts(remains))
    wall = network.with_wall
    assert missing == ((deep & ~wall).sum(), (deep & wall).sum())
    assert missing.pairs > 0


def overlap_of(network: Network):
    """Compute the overlaps (m,), m, from positions and radii."""
    radius_j = np.where(network.with_wall, 0, network.radius[network.partner])
    reach = network.radius[network.particle_i] + radius_j
    return reach - np.linalg.norm(network.branch, axis=1)


@pytest.mark.parametrize("periodic", list(product([False, True], repeat=2)))
def test_all_pairs_of_any_sizes_are_found(periodic):
    """Compare with all pairs of all images, for radii 1 to 30 and any periodic axes."""
    random = np.random.default_rng(7)
    network = packings.polydisperse()
    n = network.n_particles
    side = network.cell_size[0]
    radius = 10 ** random.uniform(-4, -2.5, n)
    axes = np.array([*periodic, False])
    walls = network.wall_position + np.array([-1.0, 1.0])
    cloud = network.unchecked(radius=radius, cell_periodic=axes, wall_position=walls)
    cloud = cloud.with_contacts(np.zeros(network.n_contacts, bool))
    count = 0
    for periods in product((-1, 0, 1), repeat=2):
        shift = np.array([*periods, 0]) * side
        if (np.array(periods)[~axes[:2]] != 0).any():
            continue
        branch = network.position[:, None] - network.position - shift
        overlap = radius[:, None] + radius - np.linalg.norm(branch, axis=2)
        if not any(periods):
            np.fill_diagonal(overlap, -1.0)
        count += int((overlap > 0).sum())
    assert missing_contacts(cloud).pairs == count // 2 > 0


def test_bonds_across_gaps_and_lost_walls(tmp_path, printed):
    """Count contacts with walls, but no place where nothing overlaps."""
    network = packings.frictionless()
    without_walls = network.with_contacts(~network.with_wall)
    assert missing_contacts(without_walls) == (0, network.with_wall.sum())
    write_network(tmp_path / "a.network.h5", without_walls)
    numbers = printed("info", tmp_path / "a.network.h5")
    assert numbers["missing_wall_contacts"] == network.with_wall.sum()


def test_it_takes_a_second_of_a_full_packing():
    network = modal.fcc(cells=(16, 16, 137))
    started = time.process_time()
    assert missing_contacts(network) == (0, 0)
    assert network.n_particles > 35_000
    assert time.process_time() - started < 3  # 0.6 s on a quiet machine
