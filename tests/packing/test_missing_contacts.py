"""Contacts that a file has lost show as spheres, or walls, that overlap without one."""

import time
from dataclasses import replace
from itertools import product

import numpy as np
import packings
import pytest

import modal
from modal.packing.missing_contacts import missing_contacts
from modal.packing.network import Network, write_network


def of_two_sizes(ratio: float) -> Network:
    """A packing whose large spheres are so many times as large as the small ones."""
    mixture = {"sizes": ["two", ratio, 0.8], "aspect": 1.0, "tolerance": 1e-2}
    return packings.random_sample(900, 1e5, seed=4, **mixture).network()


def without_periods(network: Network) -> Network:
    """The same spheres and walls with free sides: contacts through a period are gone."""
    inner = network.with_contacts(~network.periods.any(axis=1))
    return replace(inner, cell_periodic=np.zeros(3, bool), cell_shift=None)


CELLS = {
    "walls": packings.frictionless,
    "free sides": lambda: without_periods(packings.frictionless()),
    "two sizes": lambda: of_two_sizes(5.5),
    "two sizes, free sides": lambda: without_periods(of_two_sizes(5.5)),
    "periodic": lambda: packings.random_sample(100, 1e5, seed=2, periodic=True).network(),
    "wide range of sizes": lambda: packings.polydisperse(),
    "crystal, a cell wide": lambda: modal.fcc(cells=(1, 1, 6)),
    "cohesive": packings.cohesive,
}


@pytest.mark.parametrize("name", CELLS)
def test_as_many_as_were_taken_away(name):
    network = CELLS[name]()
    assert missing_contacts(network) == (0, 0)
    kept = np.random.default_rng(3).random(network.n_contacts) < 0.5
    overlap = overlap_of(network)
    # What is shallower than a tenth of the mean overlap of the others does not count.
    deep = ~kept & (overlap > 0.1 * abs(overlap[kept]).mean())
    found = missing_contacts(network.with_contacts(kept))
    wall = network.with_wall
    assert found == ((deep & ~wall).sum(), (deep & wall).sum())
    assert found.pairs > 0


def overlap_of(network: Network):
    """Shape (m,), m: overlaps by positions and radii."""
    other = np.where(network.with_wall, 0, network.radius[network.partner])
    reach = network.radius[network.particle_i] + other
    return reach - np.linalg.norm(network.branch, axis=1)


@pytest.mark.parametrize("periodic", list(product([False, True], repeat=2)))
def test_all_pairs_of_any_sizes_are_found(periodic):
    """Against all pairs of all images, of radii 1 to 30, in a cell that is periodic as it likes."""
    random = np.random.default_rng(7)
    network = packings.polydisperse()
    n, side = network.n_particles, network.cell_size[0]
    radius = 10 ** random.uniform(-4, -2.5, n)
    axes = np.array([*periodic, False])
    walls = network.wall_position + np.array([-1.0, 1.0])
    cloud = network.unchecked(radius=radius, cell_periodic=axes, wall_position=walls)
    cloud = cloud.with_contacts(np.zeros(network.n_contacts, bool))
    count = 0
    for turns in product((-1, 0, 1), repeat=2):
        shift = np.array([*turns, 0]) * side
        if (np.array(turns)[~axes[:2]] != 0).any():
            continue
        apart = network.position[:, None] - network.position - shift
        overlap = radius[:, None] + radius - np.linalg.norm(apart, axis=2)
        np.fill_diagonal(overlap, overlap.diagonal() if any(turns) else -1.0)
        count += int((overlap > 0).sum())
    assert missing_contacts(cloud).pairs == count // 2 > 0


def test_bonds_across_gaps_and_lost_walls(tmp_path, printed):
    """A bond where nothing overlaps is no missing contact; a wall that nothing touches may be."""
    network = packings.frictionless()
    found = missing_contacts(network.with_contacts(~network.with_wall))
    assert (found.pairs, found.with_wall) == (0, network.with_wall.sum())
    write_network(tmp_path / "a.network.h5", network.with_contacts(~network.with_wall))
    told = printed("info", tmp_path / "a.network.h5")
    assert told["missing_wall_contacts"] == network.with_wall.sum()


def test_it_takes_a_second_of_a_full_packing():
    network = modal.fcc(cells=(16, 16, 137))
    started = time.process_time()
    assert missing_contacts(network) == (0, 0)
    assert network.n_particles > 35_000
    assert time.process_time() - started < 3  # 0.6 s on a quiet machine
