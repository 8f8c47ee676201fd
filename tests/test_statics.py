"""Steady loads: against direct solves, the crystal's theory, and springs in a row."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from modal import gallery
from modal.assembly import stiffness_matrix
from modal.equilibrium import net_forces
from modal.lattice import FccCrystal
from modal.random_packing import random_network
from modal.receivers import wall_pattern
from modal.statics import spring_motion, static_velocity
from modal.storage import InputError


def test_motion_solves_the_shifted_system():
    network, shift, tolerance = random_network(150, 1e6, aspect=1.5), 1e-4, 1e-6
    load = net_forces(network) + np.random.default_rng(8).standard_normal((150, 6)) * 1e-3
    motion, products = spring_motion(network, load, tolerance, shift)
    K = stiffness_matrix(network)
    diagonal = K.diagonal().reshape(-1, 2, 3).mean(axis=(0, 2)).repeat(3)
    shifted = K + sp.diags(np.tile(shift * diagonal, network.n_particles))
    exact = spsolve(shifted.tocsc(), load.ravel())
    wrong = motion.ravel() - exact
    # Energy norm: the preconditioned residual times the root of a condition number below 1e6.
    assert wrong @ (shifted @ wrong) < (1e3 * tolerance) ** 2 * (exact @ (shifted @ exact))
    assert 1 < products < 6 * network.n_particles


def test_column_under_a_wall():
    """Springs in a row: each takes its share of the wall's displacement."""
    network = gallery.column(6)
    load = wall_pattern(network, -1)[0].reshape(-1, 6)
    motion, _ = spring_motion(network, load, 1e-12, 0.0)
    give = 1 / network.stiffness_normal
    below = np.cumsum(give)[:-1]
    assert motion[:, 2] == pytest.approx(1 - below / give.sum(), rel=1e-9)
    assert abs(motion[:, [0, 1, 3, 4, 5]]).max() < 1e-9


@pytest.mark.parametrize("stress", [1e4, 1e7])
def test_velocity_of_the_crystal(stress):
    """Layers of FCC: V = l sqrt(C / m), Eq. 7 of the paper; the layers' strain is uniform."""
    crystal = FccCrystal(stress)
    velocity, modulus = static_velocity(gallery.fcc(3, 80, stress))
    # The edges of the bulk cut the crystal anywhere: up to a layer of some 60 in its density.
    assert velocity == pytest.approx(crystal.velocity, rel=5e-3)
    assert modulus == pytest.approx(
        crystal.C * crystal.layer_distance / crystal.spacing**2, rel=1e-5
    )


def test_short_packing_is_refused():
    with pytest.raises(InputError, match="too short"):
        static_velocity(gallery.fcc(2, 8))
