"""Velocities of a cell that carries forces, against Bloch waves on the tangent of the law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from changes import changed, times
from oracles import contact_matrices
from packings import polydisperse
from places import PACKINGS

from modal.elasticity.moduli import elastic_moduli, read_moduli
from modal.packing.network import Network
from modal.packing.rattlers import keeping_contacts
from modal.system.assembly import mass_diagonal


def long_waves(network: Network, wavevector: np.ndarray, pre_stress: str) -> np.ndarray:
    """V^2 (3,) of the three Bloch waves that move all spheres alike, m^2/s^2, ascending.

    Of the cell repeated for ever: contacts through a period have a phase.
    """
    n, scale = network.n_particles, 1 / np.sqrt(mass_diagonal(network))
    K = np.zeros((n, 6, n, 6), complex)
    phase = np.exp(1j * (network.cell_shift * network.cell_size) @ wavevector)
    contacts = network.particle_i, network.particle_j, contact_matrices(network, pre_stress), phase
    for i, j, local, turn in zip(*contacts, strict=True):
        K[i, :, i] += local[:6, :6]
        K[j, :, j] += local[6:, 6:]
        K[i, :, j] += local[:6, 6:] * turn
        K[j, :, i] += local[6:, :6] * turn.conj()
    square, shape = np.linalg.eig(scale[:, None] * K.reshape(6 * n, 6 * n) * scale)
    alike = np.zeros((n, 6, 3))
    alike[:, range(3), range(3)] = np.sqrt(network.mass)[:, None]
    share = np.linalg.norm(alike.reshape(-1, 3).T @ shape, axis=0) / np.linalg.norm(shape, axis=0)
    return np.sort(square[np.argsort(share)[-3:]].real) / (wavevector @ wavevector)


def without_loose_spheres(network: Network) -> Network:
    """Only spheres with three contacts or more: all that has mass then moves with a long wave."""
    kept = keeping_contacts(network, 3)
    place = np.cumsum(kept) - 1
    network = network.with_contacts(kept[network.particle_i] & kept[network.particle_j])
    return replace(
        network,
        **{name: column[kept] for name, column in network.bodies().items()},
        particle_i=place[network.particle_i],
        particle_j=place[network.particle_j],
    )


@pytest.mark.parametrize("pre_stress", ["normal", "full"])
@pytest.mark.parametrize("direction", [(0, 0, 1), (1, -2, 3)])
def test_first_order_of_the_bloch_waves(pre_stress, direction):
    """60 spheres of radii 1:3, with a share of their forces, and half of it.

    What is left of the change of V^2 is of second order: half as much, relative, at half the
    forces. The branches bend by (kappa L)^2 in both alike; at a smaller kappa, or with smaller
    forces, round-off of the largest eigenvalue would be seen.
    """
    network = without_loose_spheres(polydisperse(periodic_z=True, n=60))
    n = np.array(direction) / np.linalg.norm(direction)
    wavevector = 1e-2 / network.cell_size[0] * n
    moduli = elastic_moduli(network, tolerance=1e-10)
    unloaded = long_waves(network, wavevector, "none")
    assert np.sqrt(unloaded[::-1]) == pytest.approx(moduli.velocities(n), rel=1e-4)
    errors = []
    for share in (0.2, 0.1):
        loaded = changed(network, force_normal=times(share), force_tangential=times(share))
        stressed = elastic_moduli(loaded, tolerance=1e-10, pre_stress=pre_stress)
        found = stressed.velocities(n)[::-1] ** 2 - moduli.velocities(n)[::-1] ** 2
        wanted = long_waves(loaded, wavevector, pre_stress) - unloaded
        errors.append(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))
    assert errors[0] < 5e-3
    assert errors[1] < 0.6 * errors[0]


def test_command_and_file(tmp_path, printed):
    product = tmp_path / "a.moduli.h5"
    command = "moduli", PACKINGS / "triaxial.network.h5", "-o", product, "--pre-stress"
    told = [printed(*command, pre_stress) for pre_stress in ("none", "full")]
    v, w = (np.array(each["velocity_m_per_s"]["z"]) for each in told)
    # The order of stress over modulus: 1 MPa over some 300 MPa.
    assert 1e-4 < abs(w / v - 1).max() < 2e-2
    assert told[0]["stiffness_pa"] == told[1]["stiffness_pa"]
    again = read_moduli(product)
    assert again.pre_stress == "full" and (again.velocities((0, 0, 1)) == w).all()
