"""Tests of lateral repeats: how many equal parts a packing has, and when it has none."""

from dataclasses import replace

import changes
import numpy as np
import pytest
import scipy.sparse as sp
from packings import slim

from modal.packing import crystal as gallery
from modal.packing.repeats import SAME, lateral_repeats
from modal.packing.tiling import repeat
from modal.system.assembly import stiffness_matrix


@pytest.mark.parametrize(
    ("network", "count"),
    [
        (lambda: gallery.fcc(cells=(5, 1, 6)), 5),
        (lambda: gallery.fcc(cells=(3, 2, 6)), 6),
        (lambda: gallery.fcc(cells=(4, 6, 5)), 24),
        (lambda: repeat(slim(), 3, 1), 3),
        (lambda: repeat(slim(), 2, 2), 4),
        (slim, 1),
        (lambda: repeat(slim(), 2, 3).unchecked(cell_periodic=np.arange(3) == 0), 2),
    ],
)
@pytest.mark.parametrize("pre_stress", ["none", "full"])
def test_the_part_has_the_folded_matrix(network, count: int, pre_stress: str):
    """Compare with P^T K P / count of the whole matrix, where P repeats a motion of the part.

    Both sum the same blocks; each entry is rounded some ten times.
    """
    network = network()
    repeats = lateral_repeats(network, pre_stress=pre_stress != "none")
    assert repeats.count == count
    assert len(repeats.first) * count == network.n_particles
    assert np.array_equal(repeats.member[repeats.first], np.arange(len(repeats.first)))
    assert (np.bincount(repeats.member) == count).all()
    P = sp.kron(np.eye(len(repeats.first))[repeats.member], np.eye(6), "csr")
    K = stiffness_matrix(network, pre_stress=pre_stress)
    K_part = stiffness_matrix(repeats.part, pre_stress=pre_stress)
    assert abs(K_part - P.T @ K @ P / count).max() < 1e-9 * abs(K).max()
    assert repeats.difference < SAME
    for name in ("mass", "inertia"):
        all_parts = getattr(repeats.part, name)[repeats.member]
        np.testing.assert_allclose(all_parts, getattr(network, name), rtol=1e-12)


def test_numbering_turned_contacts_and_the_origin_do_not_matter():
    network = repeat(slim(), 3, 2)
    rng = np.random.default_rng(5)
    changed = changes.renumbered(network, rng.permutation(network.n_particles))
    turned = ~changed.with_wall & (rng.random(changed.n_contacts) < 0.5)
    # A fifth of a period aside, in which no sphere keeps its cell, and far out of the cell.
    position = changed.position + network.cell_size * [0.2, 3.7, 0]
    changed = changes.from_other_end(changed, turned).unchecked(cell_shift=None)
    changed = replace(changed, position=position)
    assert lateral_repeats(changed, pre_stress=True).count == 6


@pytest.mark.parametrize(
    "name",
    ["radius", "mass", "inertia", "stiffness_normal", "stiffness_tangential", "normal", "lever_j"],
)
def test_one_number_that_differs_by_1e_6_leaves_no_parts(name):
    network = repeat(slim(), 3, 1)
    data = getattr(network, name).copy()
    data[len(data) // 2] *= 1 + 1e-6
    assert lateral_repeats(network.unchecked(**{name: data})).count == 1


def test_a_sphere_out_of_place_and_a_contact_less_leave_no_parts():
    network = repeat(slim(), 3, 1)
    position = network.position.copy()
    position[7] += 1e-4 * network.radius[7]
    assert lateral_repeats(replace(network, position=position)).count == 1
    assert lateral_repeats(network.with_contacts(slice(1, None))).count == 1
    # Leave a different contact out of each part: the numbers of contacts are still equal.
    remains = np.ones(network.n_contacts, bool)
    remains[np.flatnonzero(~network.with_wall)[[0, 5, 11]]] = False
    assert lateral_repeats(network.with_contacts(remains)).count == 1


def test_forces_count_with_pre_stress_alone():
    network = repeat(slim(), 2, 1)
    force = network.force_normal.copy()
    force[np.argmax(force)] *= 1 + 1e-6
    changed = replace(network, force_normal=force)
    assert lateral_repeats(changed).count == 2
    assert lateral_repeats(changed, pre_stress=True).count == 1
