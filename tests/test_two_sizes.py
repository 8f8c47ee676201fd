"""Spheres of several sizes and densities: every quantity against sums that know no radius."""

import numpy as np
import packings
import pytest
import scipy.linalg

import modal
from modal.packing.network import SOURCE_WALL, Network
from modal.packing.state import coordination_by_size, profile, void_ratio
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.waves.propagate import propagate
from modal.waves.source import Pulse


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


def test_wave_is_that_of_the_dense_modes(network, slow_K):
    """Modal superposition of the pulse, each mode an oscillator with its closed form."""
    time = np.linspace(0, 3e-5, 16)
    wave = propagate(network, 3e-5, interval=2e-6, particles=True).signals
    K, mass = slow_K(network), mass_diagonal(network)
    squares, shapes = scipy.linalg.eigh(K, np.diag(mass))
    # The wall at low z pushes those that touch it: minus its own springs times its motion.
    wall = network.with_contacts(network.particle_j == SOURCE_WALL)
    push = np.zeros((network.n_particles, 6))
    for c in range(wall.n_contacts):
        n, lever = wall.normal[c], wall.lever_i[c]
        kn, kt = wall.stiffness_normal[c], wall.stiffness_tangential[c]
        force = kt * np.array([0, 0, 1.0]) + (kn - kt) * n[2] * n
        push[wall.particle_i[c], :3] += force
        push[wall.particle_i[c], 3:] += np.cross(lever, force)
    response = Pulse().response(np.maximum(squares, 0), time)
    motion = shapes @ ((shapes.T @ push.ravel())[:, None] * response)
    wanted = motion.reshape(network.n_particles, 6, -1)[:, 2].T
    assert len(wave.time) == len(time)
    assert abs(wave.particle_displacement - wanted).max() < 1e-7 * abs(wanted).max()


def test_densities_and_coordination_are_counted_sphere_by_sphere(network):
    solid = sum(4 / 3 * np.pi * r**3 for r in network.radius)
    assert void_ratio(network) == pytest.approx(network.cell_size.prod() / solid - 1, rel=1e-12)
    touching = np.zeros(network.n_particles)
    for i, j in zip(network.particle_i, network.particle_j, strict=True):
        touching[i] += 1
        if j >= 0:
            touching[j] += 1
    radius, ends = coordination_by_size(network)
    assert (np.diff(radius) > 0).all()
    if len(np.unique(network.radius)) == 2:
        for size, mean in zip(radius, ends, strict=True):
            assert mean == touching[np.isclose(network.radius, size)].mean()
        assert ends[1] > ends[0]
    else:
        order = np.argsort(network.radius)
        parts = np.array_split(order, 4)
        np.testing.assert_allclose(radius, [network.radius[p].mean() for p in parts], rtol=0.1)
    layers = profile(network)
    assert layers.particles.sum() == network.n_particles
    volume = network.cell_size.prod() / len(layers.void_ratio)
    assert (volume / (1 + layers.void_ratio)).sum() == pytest.approx(solid, rel=1e-12)
