"""Crystalline order: crystals whole, random points not, whatever the axes."""

import numpy as np
import pytest

from modal.packing import crystal as gallery
from modal.packing.contact_law import RADIUS
from modal.packing.order import crystalline
from modal.packing.sample import Sample


@pytest.mark.parametrize("strength, least, most", [(0.02, 0.99, 1.0), (0.35, 0.0, 0.1)])
def test_shaken_crystal_loses_its_order(strength, least, most):
    network = gallery.fcc(cells=(5, 5, 10))
    shake = np.random.default_rng(7).standard_normal(network.position.shape)
    network = network.unchecked(position=network.position + strength * 2 * RADIUS * shake)
    assert least <= crystalline(network).mean() <= most


def test_turned_crystal_is_as_crystalline():
    """A crystal in the middle of a large cell, along the axes and turned by one radian."""
    cluster = gallery.fcc(cells=(6, 6, 8)).position
    cluster = cluster - cluster.mean(axis=0)
    c, s = np.cos(1.0), np.sin(1.0)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    cell, shares = 40 * RADIUS, []
    for rotation in (np.eye(3), turn):
        position = cluster @ rotation.T + cell / 2
        sample = Sample(position, np.full(2, cell), np.array([0, cell]), friction=0.0)
        shares.append(crystalline(sample.network()).sum())
    assert shares[0] == shares[1] > 100
