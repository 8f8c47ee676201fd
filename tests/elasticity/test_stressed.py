"""Velocities of a cell that carries forces, against Bloch waves on the tangent of the law."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from packings import contact_matrices, polydisperse
from places import PACKINGS
from test_moduli import bloch_matrix, without_loose_spheres

from modal.__main__ import main
from modal.elasticity.moduli import elastic_moduli, read_moduli, write_moduli
from modal.packing.network import Network, read_network


def long_waves(network: Network, wavevector: np.ndarray, pre_stress: str) -> np.ndarray:
    """V^2 (3,) of the three Bloch waves that move all spheres alike, m^2/s^2, ascending."""
    matrix = bloch_matrix(network, wavevector, contact_matrices(network, pre_stress))
    square, shape = np.linalg.eig(matrix)
    alike = np.zeros((network.n_particles, 6, 3))
    alike[:, range(3), range(3)] = np.sqrt(network.mass)[:, None]
    share = np.linalg.norm(alike.reshape(-1, 3).T @ shape, axis=0) / np.linalg.norm(shape, axis=0)
    return np.sort(square[np.argsort(share)[-3:]].real) / (wavevector @ wavevector)


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
        loaded = replace(
            network,
            force_normal=share * network.force_normal,
            force_tangential=share * network.force_tangential,
        )
        stressed = elastic_moduli(loaded, tolerance=1e-10, pre_stress=pre_stress)
        found = stressed.velocities(n)[::-1] ** 2 - moduli.velocities(n)[::-1] ** 2
        wanted = long_waves(loaded, wavevector, pre_stress) - unloaded
        errors.append(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))
    assert errors[0] < 5e-3
    assert errors[1] < 0.6 * errors[0]


def test_command_and_file(tmp_path, capsys):
    path = str(PACKINGS / "triaxial.network.h5")
    told = []
    for pre_stress in ("none", "full"):
        assert main(["moduli", path, "--pre-stress", pre_stress, "--json"]) == 0
        told.append(json.loads(capsys.readouterr().out))
    v, w = (np.array(each["velocity_m_per_s"]["z"]) for each in told)
    # The order of stress over modulus: 1 MPa over some 300 MPa.
    assert 1e-4 < abs(w / v - 1).max() < 2e-2
    assert told[0]["stiffness_pa"] == told[1]["stiffness_pa"]
    product = tmp_path / "a.moduli.h5"
    moduli = elastic_moduli(read_network(path), pre_stress="full")
    write_moduli(product, moduli)
    again = read_moduli(product)
    assert (again.stressed == moduli.stressed).all() and again.pre_stress == "full"
    assert (again.velocities((0, 0, 1)) == w).all()
