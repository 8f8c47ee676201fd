"""K against a slow oracle; the part of its translations."""

import pytest
from oracles import slow_stiffness
from packings import polydisperse

from modal.packing import crystal as gallery
from modal.system.assembly import stiffness_matrix


@pytest.mark.parametrize(
    "network",
    [gallery.fcc(cells=(1, 1, 4)), gallery.fcc(cells=(2, 2, 4)), gallery.column(4), polydisperse()],
)
def test_assembly_equals_slow_oracle(network):
    K = stiffness_matrix(network).toarray()
    oracle = slow_stiffness(network)
    # Sums of at most 24 products of size max|K|: round-off stays below 1e-13 of it.
    assert abs(K - oracle).max() <= 1e-13 * abs(oracle).max()


def test_translations_only_is_the_translational_part_of_K():
    network = gallery.fcc(cells=(2, 2, 4))
    full = stiffness_matrix(network).toarray().reshape(16, 6, 16, 6)
    part = stiffness_matrix(network, 3).toarray()
    assert abs(full[:, :3, :, :3].reshape(48, 48) - part).max() <= 1e-15 * abs(part).max()
