"""Slab means and the particles that they average over."""

from dataclasses import replace

import numpy as np
import pytest

from modal.packing import crystal as gallery
from modal.packing.layers import Layers
from modal.packing.network import RECEIVER_WALL
from modal.packing.rattlers import firmly_held, force_bearing
from modal.tools.errors import InputError


def test_a_dangling_chain_bears_no_force():
    """The uppermost sphere of a column loses the wall: then all of them hang on one contact."""
    column = gallery.column(4)
    assert force_bearing(column).all()
    cut = column.with_contacts(column.particle_j != RECEIVER_WALL)
    assert not force_bearing(cut).any()
    with pytest.raises(InputError, match="carries no wave"):
        Layers(cut)


def test_means_equal_a_loop():
    network = gallery.fcc(cells=(3, 3, 20))
    position = network.position.copy()
    position[:, 2] += np.random.default_rng(0).uniform(-1e-4, 1e-4, network.n_particles)
    network = network.unchecked(position=position)
    layers = Layers(network)
    values = np.random.default_rng(1).standard_normal(network.n_particles)
    for k, (z, mean) in enumerate(zip(layers.position, layers.means(values), strict=True)):
        inside = layers.layer == k
        assert mean == pytest.approx(values[inside].mean(), rel=1e-12)
        assert z == pytest.approx(network.position[inside, 2].mean(), rel=1e-12)
    # The slabs are equal and one diameter thick to within half a diameter over all of them.
    width = np.diff(layers.position)
    assert (width > 0).all()
    assert len(width) + 1 == round(network.length / (2 * network.radius[0]))


def test_particles_on_hardly_loaded_contacts_are_left_out():
    """One sphere of a crystal with a thousandth of the force everywhere: it bears, barely."""
    crystal = gallery.fcc(cells=(4, 4, 6))
    own = (crystal.particle_i == 40) | (crystal.particle_j == 40)
    force = np.where(own, 1e-3, 1.0)
    weak = replace(crystal, force_normal=force)
    assert force_bearing(weak).all()
    assert np.flatnonzero(~firmly_held(weak)).tolist() == [40]
    assert np.flatnonzero(Layers(weak).layer < 0).tolist() == [40]
    assert firmly_held(replace(crystal, force_normal=0 * force)).all()


def test_centres_told_in_another_period_are_in_their_layers():
    """A cell without walls: z may be any whole number of periods off, as a DEM run leaves it."""
    cell = gallery.fcc(cells=(2, 2, 6), periodic_z=True)
    away = np.random.default_rng(2).integers(-2, 3, cell.n_particles)
    position = cell.position + away[:, None] * [0, 0, cell.length]
    layers, moved = Layers(cell), Layers(cell.unchecked(position=position))
    assert len(layers.position) == round(cell.length / (2 * cell.radius[0]))
    np.testing.assert_array_equal(moved.layer, layers.layer)
    np.testing.assert_allclose(moved.position, layers.position, rtol=1e-12)
