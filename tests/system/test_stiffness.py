"""K against a slow oracle, rigid motions, and the derivative of the force law."""

import numpy as np
import pytest

from modal.packing import crystal as gallery
from modal.system.assembly import stiffness_matrix
from modal.theory.fcc import FccLattice


@pytest.mark.parametrize(
    "network", [gallery.fcc(cells=(1, 1, 4)), gallery.fcc(cells=(2, 2, 4)), gallery.column(4)]
)
def test_assembly_equals_slow_oracle(network, slow_K):
    K = stiffness_matrix(network).toarray()
    oracle = slow_K(network)
    # Sums of at most 24 products of size max|K|: round-off stays below 1e-13 of it.
    assert abs(K - oracle).max() <= 1e-13 * abs(oracle).max()


def test_translations_only_is_the_translational_part_of_K():
    network = gallery.fcc(cells=(2, 2, 4))
    full = stiffness_matrix(network).toarray().reshape(16, 6, 16, 6)
    part = stiffness_matrix(network, 3).toarray()
    assert abs(full[:, :3, :, :3].reshape(48, 48) - part).max() <= 1e-15 * abs(part).max()


@pytest.mark.parametrize("stress", [1e3, 1e5, 1e7])
def test_fcc_balances_the_stress(stress):
    """Contact forces of the sample give the stress (Love-Weber), and each sphere rests."""
    network = gallery.fcc(stress, (3, 3, 6))
    total = np.zeros((network.n_particles, 3))
    push = network.force_normal[:, None] * network.normal
    pair = ~network.with_wall
    np.add.at(total, network.particle_i, -push)
    np.add.at(total, network.particle_j[pair], push[pair])
    assert abs(total).max() <= 1e-12 * network.force_normal.max()
    area = network.cell_size[0] * network.cell_size[1]
    at_source = network.particle_j == -1
    assert network.force_normal[at_source].sum() / area == pytest.approx(stress, rel=1e-12)
    crystal = FccLattice(stress)
    layer = crystal.layer_distance
    branch = network.lever_i - network.lever_j
    lateral = pair & (abs(branch[:, 0]) > 0)
    sigma_xx = (push[:, 0] * branch[:, 0])[lateral].sum() / (area * layer * 6)
    # 6 layers in the plane, but only 5 gaps between them carry their share.
    in_plane = crystal.contact_force / crystal.spacing / layer
    between = in_plane * 5 / 6
    assert sigma_xx == pytest.approx(in_plane + between, rel=1e-12)
