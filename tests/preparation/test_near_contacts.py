"""Tests of the list of near contacts: completeness, and renewal before a contact is missed."""

import numpy as np
import pytest

from modal.dem import near_contacts
from modal.dem.contacts import MovingContacts
from modal.packing.neighbours import periodic_pairs
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.preparation.cloud import make_cloud
from modal.preparation.study import Study
from modal.tools.slabs import SLABS

pytestmark = pytest.mark.two_ways

EPS = np.finfo(float).eps


@pytest.mark.parametrize("periodic_z", [False, True], ids=["walls", "periodic"])
@pytest.mark.parametrize(
    ("lengths", "count"),
    [([3.1, 4.7, 6.2], 400), ([5.0, 3.3, 0.41], 400), ([2.9, 4.7, 6.2], 400), ([9, 7, 31], 6000)],
)
@pytest.mark.parametrize("sizes", [(0.4, 0.4), (0.1, 0.4)])
def test_contacts_are_those_of_a_tree(sizes, lengths, count, periodic_z):
    """Compare with pairs of a tree, in crowded, empty and narrow cells and with points on borders.

    The skin is 0.1, and walls reach as far as the largest radius. Many spheres use threads. Pairs
    across a period along z are the last.
    """
    lengths = np.array(lengths, float)
    random = np.random.default_rng(2)
    position = random.random((count, 3)) ** 2 * lengths
    radius = random.choice(sizes, count)
    position[0] = 0.0
    position[1] = 0.0, 0.0, lengths[2] * (1 - EPS)
    ends, shift = near_contacts.contacts_in_reach(position, lengths, radius, 0.1, periodic_z)
    contacts = set(map(tuple, np.hstack([ends, shift]).tolist()))
    crosses = shift[:, 2] != 0
    assert (np.diff(np.where(crosses, count, ends[:, 0])) >= 0).all()
    assert len(contacts) == len(ends) > 100
    periods = lengths if periodic_z else lengths[:2]
    i, j, images = periodic_pairs(position, periods, 1.0)
    distance = np.linalg.norm(position[j] + images * lengths - position[i], axis=1)
    is_near = distance <= radius[i] + radius[j] + 0.2
    expected = set(map(tuple, np.column_stack([i, j, images])[is_near].tolist()))
    if not periodic_z:
        at_source = np.flatnonzero(position[:, 2] < 0.5).tolist()
        at_receiver = np.flatnonzero(lengths[2] - position[:, 2] < 0.5).tolist()
        expected |= {(k, SOURCE_WALL, 0, 0, 0) for k in at_source}
        expected |= {(k, RECEIVER_WALL, 0, 0, 0) for k in at_receiver}
    assert contacts == expected


SKIN = 0.1
"""Reach of the list of pairs beyond contact, in radii."""


def move_sphere(contacts, share):
    """Move a sphere by a share of the skin."""
    contacts.position[7] += [SKIN * share * contacts.largest, 0, 0]


def shrink_cell(contacts, share):
    """Shrink the cell along z by a share of what brings two spheres nearer by the skin."""
    stretch = np.array([1, 1, 1 - share * SKIN / (1 + SKIN)])
    contacts.position *= stretch
    contacts.walls *= stretch[2]


def move_walls(contacts, share):
    """Move the walls by a share of the skin."""
    contacts.walls += SKIN * share * contacts.largest


@pytest.mark.parametrize(("share", "is_renewed"), [(0.99, False), (1.01, True)])
@pytest.mark.parametrize("change", [move_sphere, shrink_cell, move_walls])
def test_list_is_renewed_before_a_contact_is_missed(change, share, is_renewed):
    contacts = MovingContacts(make_cloud(Study(0.0, 200, 4.4, 3)), skin=SKIN, history=False)
    before = contacts._ends
    change(contacts, share)
    contacts.touch()
    assert (contacts._ends is not before) is is_renewed


@pytest.mark.parametrize("n", [37, 6000])
def test_largest_displacement_is_that_of_numpy(n):
    """Compare the loop, with threads and without, with numpy; NaN is not lost."""
    position, start = np.random.default_rng(n).standard_normal((2, n, 3))
    stretch = np.array([0.99, 1.0, 1.02])
    distances, expected = np.empty((2, SLABS))
    near_contacts.longest_paths(position, start, stretch, distances)
    near_contacts.longest_paths_by_arrays(position, start, stretch, expected)
    assert distances.max() == pytest.approx(expected.max(), rel=10 * EPS)
    position[n // 2, 1] = np.nan
    near_contacts.longest_paths(position, start, stretch, distances)
    assert np.isnan(distances.max())
