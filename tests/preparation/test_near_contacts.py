"""Which contacts are near: against the pairs of a tree, and before any of them can be missed."""

import numpy as np
import pytest

from modal.dem import near_contacts
from modal.dem.contacts import MovingContacts
from modal.packing.neighbours import periodic_pairs
from modal.preparation.cloud import cloud
from modal.preparation.protocol import Study
from modal.tools.slabs import SLABS

pytestmark = pytest.mark.two_ways

EPS = np.finfo(float).eps


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize(
    ("lengths", "count"),
    [([3.1, 4.7, 6.2], 400), ([5.0, 3.3, 0.41], 400), ([2.9, 4.7, 6.2], 400), ([9, 7, 31], 6000)],
)
@pytest.mark.parametrize("sizes", [(0.4, 0.4), (0.1, 0.4)])
def test_contacts_are_those_of_a_tree(sizes, lengths, count, whole):
    """Crowded and empty cells, beside their own images, too few, points on borders; by threads.

    The skin is 0.1, and walls reach as far as the largest radius.
    """
    lengths, random = np.array(lengths, float), np.random.default_rng(2)
    places, radius = random.random((count, 3)) ** 2 * lengths, random.choice(sizes, count)
    places[0], places[1] = 0.0, [0.0, 0.0, lengths[2] * (1 - EPS)]
    ends, shift = near_contacts.contacts_in_reach(places, lengths, radius, 0.1, whole)
    found = set(zip(*ends.T.tolist(), *shift.T.tolist(), strict=True))
    assert (np.diff(ends[:, 0]) >= 0).all() and len(found) == len(ends) > 100
    i, j, periods = periodic_pairs(places, lengths if whole else lengths[:2], 1.0)
    apart = np.linalg.norm(places[j] + periods * lengths - places[i], axis=1)
    near = apart <= radius[i] + radius[j] + 0.2
    expected = set(zip(i[near].tolist(), j[near].tolist(), *periods[near].T.tolist(), strict=True))
    for wall, distance in () if whole else ((-1, places[:, 2]), (-2, lengths[2] - places[:, 2])):
        expected |= {(k, wall, 0, 0, 0) for k in np.flatnonzero(distance < 0.5).tolist()}
    assert found == expected


def test_list_expires_before_a_contact_is_missed():
    """A sphere that has gone by the skin of a radius, a cell that has shrunk, or a wall."""

    def renewed(change):
        contacts = MovingContacts(cloud(Study(0.0, 200, 4.4, 3)), skin=0.1, history=False)
        before = contacts._ends
        change(contacts)
        contacts.touch()
        return contacts._ends is not before

    def shrink(contacts, share):
        stretch = np.array([1, 1, 1 - share])
        contacts.position *= stretch
        contacts.walls *= stretch[2]

    for share, over in ((0.99, False), (1.01, True)):
        assert (
            renewed(lambda c, s=share: c.position[7].__iadd__([0.1 * s * c.largest, 0, 0])) is over
        )
        assert renewed(lambda c, s=share: shrink(c, s * 0.1 / 1.1)) is over
        assert renewed(lambda c, s=share: c.walls.__iadd__(0.1 * s * c.largest)) is over


@pytest.mark.parametrize("n", [37, 6000])
def test_longest_way_is_that_of_numpy(n):
    """By threads and without; what is no number stays in sight."""
    position, start = np.random.default_rng(n).standard_normal((2, n, 3))
    stretch = np.array([0.99, 1.0, 1.02])
    one, other = np.empty((2, SLABS))
    near_contacts.longest_ways(position, start, stretch, one)
    near_contacts.longest_ways_by_arrays(position, start, stretch, other)
    assert one.max() == pytest.approx(other.max(), rel=10 * EPS)
    position[n // 2, 1] = np.nan
    near_contacts.longest_ways(position, start, stretch, one)
    assert np.isnan(one.max())
