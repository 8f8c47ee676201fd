"""Spheres of several sizes and densities: quantities against sums sphere by sphere."""

import numpy as np
import packings
import pytest

import modal
from modal.packing.state import contacts_per_particle, profile, void_ratio


@pytest.mark.parametrize(
    "made",
    [
        packings.polydisperse,  # radii 1:3 of glass and steel, out of balance
        lambda: modal.random_packing(60, 1e6, seed=3, sizes=("two", 2, 0.5), aspect=1.5),
    ],
    ids=["radii 1:3", "two sizes"],
)
def test_densities_and_coordination_are_counted_sphere_by_sphere(made):
    network = made()
    solid = sum(4 / 3 * np.pi * r**3 for r in network.radius)
    assert void_ratio(network) == pytest.approx(network.cell_size.prod() / solid - 1, rel=1e-12)
    touching = np.zeros(network.n_particles)
    for i, j in zip(network.particle_i, network.particle_j, strict=True):
        touching[i] += 1
        if j >= 0:
            touching[j] += 1
    np.testing.assert_array_equal(contacts_per_particle(network), touching)
    large = network.radius > network.radius.mean()
    assert touching[large].mean() > touching[~large].mean()
    layers = profile(network)
    assert layers.particles.sum() == network.n_particles
    volume = network.cell_size.prod() / len(layers.void_ratio)
    assert (volume / (1 + layers.void_ratio)).sum() == pytest.approx(solid, rel=1e-12)
