"""The compact form: neighbour search against all pairs, rebuilt network against its source."""

from itertools import product

import changes
import numpy as np
import pytest

from modal.packing import crystal as gallery
from modal.packing.contact_law import RADIUS
from modal.packing.neighbours import periodic_pairs
from modal.packing.sample import Sample, read_sample, sample_of_network, write_sample
from modal.tools.errors import InputError

SIDES = [(0.9, 1.3), (2.2, 3.1), (6.0, 5.0), (1.3, 1.6, 1.4), (3.6, 3.3, 4.0), (1e9, 1e9)]


@pytest.mark.parametrize("side", SIDES)
def test_pairs_equal_those_of_all_images(side):
    """The slow way: every pair of images within three periods; cells narrow, or nearly empty."""
    axes = len(side)
    position = np.random.default_rng(1).random((30, 3)) * np.minimum((*side, 4.0)[:3], 6)
    position[:, :2] = (position[:, :2] + 0.4 * np.array(side[:2])) % side[:2]
    position[1:, 2] += side[1] * (axes == 2)
    i, j, shift = periodic_pairs(position, np.array(side), 1.0)
    found = {(*pair, *moved[:axes]) for *pair, moved in zip(i, j, shift.tolist(), strict=True)}
    slow = set()
    for turns in product(range(-3, 4), repeat=axes):
        image = position.copy()
        image[:, :axes] += np.multiply(turns, side)
        near = np.linalg.norm(image[None] - position[:, None], axis=2) <= 1.0
        kept = np.triu(near, 0 if turns > (0,) * axes else 1)
        slow |= {(i, j, *turns) for i, j in np.argwhere(kept)}
    assert len(found) == len(i) and found == slow


@pytest.mark.parametrize("width", [1, 2, 4])
def test_network_rebuilt_from_positions(width):
    """The FCC generator knows its contacts by index arithmetic; here they follow from distance."""
    made = gallery.fcc(cells=(width, width, 10))
    side = made.cell_size[:2]
    position = made.position.copy()
    position[:, :2] %= side
    rebuilt = Sample(position, side, made.wall_position, friction=0.1).network()
    assert rebuilt.n_contacts == made.n_contacts
    # Positions reach 10 diameters: their round-off is eps * 10 D, against overlaps of 3e-4 R.
    tolerance = 10 * 2 * RADIUS * np.finfo(float).eps / made.overlap.min()
    found, wanted = (np.sort(net.overlap) for net in (rebuilt, made))
    assert found == pytest.approx(wanted, rel=10 * tolerance, abs=0)
    for name in ("void_ratio", "coordination_number"):
        assert rebuilt.study[name] == pytest.approx(made.study[name], rel=1e-12)


def sample_with_shear() -> Sample:
    made = gallery.fcc(cells=(3, 3, 6))
    sample = Sample(made.position, made.cell_size[:2], made.wall_position, friction=0.3)
    contacts = len(sample.contacts().overlap)
    sample.shear = np.random.default_rng(3).standard_normal((contacts, 2)) * 1e-3
    sample.velocity = np.random.default_rng(4).standard_normal(made.position.shape)
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
    # Listed in another order, some from the other end: the same sample.
    random = np.random.default_rng(1)
    listed = network.with_contacts(random.permutation(network.n_contacts))
    other = (listed.particle_j >= 0) & (random.random(listed.n_contacts) < 0.5)
    turned = changes.from_other_end(listed, other)
    assert other.any()
    assert sample_of_network(turned, 0.3).shear == pytest.approx(sample.shear, abs=1e-17)
    normal_part = (network.force_tangential * network.normal).sum(axis=1)
    assert abs(normal_part).max() < 1e-17
    assert network.study["case"] == "31"


def test_sample_that_does_not_fit_is_refused(tmp_path):
    sample = sample_with_shear()
    sample.shear = sample.shear[:-1]
    with pytest.raises(InputError, match="shear forces for"):
        sample.network()
    sample.walls = sample.walls[::-1]
    write_sample(tmp_path / "x.sample.h5", sample)
    with pytest.raises(InputError, match="two walls"):
        read_sample(tmp_path / "x.sample.h5")
