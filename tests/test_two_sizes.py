"""Spheres of several sizes and densities: every quantity against sums that know no radius."""

import numpy as np
import packings
import pytest
import scipy.linalg

import modal
from modal.packing.network import Network
from modal.packing.state import contacts_per_particle, profile, void_ratio
from modal.system.assembly import stiffness_matrix


@pytest.fixture(scope="module", params=["between walls", "radii 1:2"])
def network(request) -> Network:
    """Radii 1:3 of glass and steel, out of balance; or a mixture of two sizes at rest."""
    if request.param == "between walls":
        return packings.polydisperse()
    return modal.random_packing(60, stress=1e6, seed=3, sizes=("two", 2, 0.5), aspect=1.5)


def test_stiffness_and_modes_are_those_of_the_dense_matrix(network, slow_K):
    """K by forces of unit displacements; all frequencies by LAPACK's generalised problem."""
    K = slow_K(network)
    np.testing.assert_allclose(stiffness_matrix(network).toarray(), K, atol=1e-9 * abs(K).max())
    density = network.mass / (4 / 3 * np.pi * network.radius**3)
    assert len(np.unique(np.round(density))) <= 2
    mass = np.column_stack([network.mass] * 3 + [0.4 * network.mass * network.radius**2] * 3)
    squares = scipy.linalg.eigh(K, np.diag(mass.ravel()), eigvals_only=True)
    modes = modal.eigenmodes(network, highest=5)
    exact = np.sqrt(squares[-5:]) / (2 * np.pi)
    np.testing.assert_allclose(modes.frequency, exact, rtol=1e-9)
    middle = float(np.sqrt(squares[len(squares) // 2 : len(squares) // 2 + 2].mean()) / (2 * np.pi))
    assert modal.count_modes(network, [middle])[0] == len(squares) // 2 + 1


def test_densities_and_coordination_are_counted_sphere_by_sphere(network):
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
