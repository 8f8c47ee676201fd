"""Tests of samples: neighbours against all pairs, rebuilt networks against their source."""

from itertools import product

import changes
import numpy as np
import pytest
from refusals import refusal

from modal.packing import crystal as gallery
from modal.packing.contact_law import RADIUS
from modal.packing.neighbours import periodic_pairs
from modal.packing.sample import Sample, read_sample, sample_of_network, write_sample

SIDES = [(0.9, 1.3), (2.2, 3.1), (6.0, 5.0), (1.3, 1.6, 1.4), (3.6, 3.3, 4.0), (1e9, 1e9)]


@pytest.mark.parametrize("side", SIDES)
def test_pairs_equal_those_of_all_images(side):
    """Compare with every pair of images within three periods, in narrow and nearly empty cells."""
    axes = len(side)
    position = np.random.default_rng(1).random((30, 3)) * np.minimum((*side, 4.0)[:3], 6)
    position[:, :2] = (position[:, :2] + 0.4 * np.array(side[:2])) % side[:2]
    position[1:, 2] += side[1] * (axes == 2)
    i, j, shift = periodic_pairs(position, np.array(side), 1.0)
    pairs = set(zip(i.tolist(), j.tolist(), *shift[:, :axes].T.tolist(), strict=True))
    expected = set()
    for periods in product(range(-3, 4), repeat=axes):
        image = position.copy()
        image[:, :axes] += np.multiply(periods, side)
        near = np.linalg.norm(image[None] - position[:, None], axis=2) <= 1.0
        # A point meets its own image on one side only.
        first_diagonal = 0 if periods > (0,) * axes else 1
        for i_near, j_near in np.argwhere(np.triu(near, first_diagonal)).tolist():
            expected.add((i_near, j_near, *periods))
    assert len(pairs) == len(i)
    assert pairs == expected


@pytest.mark.parametrize("width", [1, 2, 4])
def test_network_rebuilt_from_positions(width):
    """Compare contacts from distances with those of the crystal, from index arithmetic."""
    crystal = gallery.fcc(cells=(width, width, 10))
    side = crystal.cell_size[:2]
    position = crystal.position.copy()
    position[:, :2] %= side
    rebuilt = Sample(position, side, crystal.wall_position, friction=0.1).network()
    assert rebuilt.n_contacts == crystal.n_contacts
    # Positions reach 10 diameters: their round-off is eps * 10 D, against overlaps of 3e-4 R.
    tolerance = 10 * 2 * RADIUS * np.finfo(float).eps / crystal.overlap.min()
    expected = np.sort(crystal.overlap)
    assert np.sort(rebuilt.overlap) == pytest.approx(expected, rel=10 * tolerance, abs=0)
    for name in ("void_ratio", "coordination_number"):
        assert rebuilt.study[name] == pytest.approx(crystal.study[name], rel=1e-12)


def sample_with_shear() -> Sample:
    """Return a crystal in motion with random shear forces."""
    crystal = gallery.fcc(cells=(3, 3, 6))
    sample = Sample(crystal.position, crystal.cell_size[:2], crystal.wall_position, friction=0.3)
    contacts = len(sample.contacts().overlap)
    sample.shear = np.random.default_rng(3).standard_normal((contacts, 2)) * 1e-3
    sample.velocity = np.random.default_rng(4).standard_normal(crystal.position.shape)
    sample.study = {"case": "31", "stress": 1e6}
    return sample


def test_shear_forces_survive_the_file(tmp_path):
    sample = sample_with_shear()
    path = tmp_path / "x.sample.h5"
    write_sample(path, sample)
    again = read_sample(path)
    assert (again.position == sample.position).all()
    assert (again.velocity == sample.velocity).all()
    assert again.angular_velocity is None
    network = again.network()
    # A frame of unit vectors: the components come back to a few eps of the force.
    assert sample_of_network(network, 0.3).shear == pytest.approx(sample.shear, abs=1e-17)
    normal_part = (network.force_tangential * network.normal).sum(axis=1)
    assert abs(normal_part).max() < 1e-17
    assert network.study["case"] == "31"


def test_shear_forces_do_not_depend_on_how_contacts_are_listed():
    """List contacts in another order, and half of them from the other end."""
    sample = sample_with_shear()
    network = sample.network()
    random = np.random.default_rng(1)
    permuted = network.with_contacts(random.permutation(network.n_contacts))
    is_turned = (permuted.particle_j >= 0) & (random.random(permuted.n_contacts) < 0.5)
    turned = changes.from_other_end(permuted, is_turned)
    assert is_turned.any()
    # A few eps of the force.
    assert sample_of_network(turned, 0.3).shear == pytest.approx(sample.shear, abs=1e-17)


def test_shear_forces_of_other_contacts_are_refused():
    sample = sample_with_shear()
    sample.shear = sample.shear[:-1]
    with refusal("shear_forces"):
        sample.network()


def test_exchanged_walls_are_refused(tmp_path):
    sample = sample_with_shear()
    sample.walls = sample.walls[::-1]
    write_sample(tmp_path / "x.sample.h5", sample)
    with refusal("no_cell"):
        read_sample(tmp_path / "x.sample.h5")
