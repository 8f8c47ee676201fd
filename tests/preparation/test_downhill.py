"""Passes over the spheres of a descent against numpy; pairs by cells against those of a tree."""

import numpy as np
import pytest

from modal.dem import downhill
from modal.dem.pairs import pairs_by_cells, suit_cells
from modal.packing.neighbours import periodic_pairs

pytestmark = pytest.mark.two_ways

EPS = np.finfo(float).eps
BOTH_SIDES_OF_THREADS = [37, 6000]


@pytest.mark.parametrize("n", BOTH_SIDES_OF_THREADS)
def test_passes_are_those_of_numpy(n):
    """Sums of n terms differ by n roundings at most, moves by a few."""
    random = np.random.default_rng(n)
    position, velocity, force = random.standard_normal((3, n, 3))
    given = {"keep": 0.9, "push": 0.03, "stretch": np.array([0.99, 1.0, 1.02]), "dt": 0.1}
    one, other = downhill.drive(velocity, force), downhill.drive_by_arrays(velocity, force)
    assert np.array(one) == pytest.approx(np.array(other), abs=3 * n * EPS * other[1])
    moved, start = (position.copy(), velocity.copy()), position.copy()
    downhill.go(position, velocity, force, *given.values())
    downhill.go_by_arrays(*moved, force, *given.values())
    assert abs(position - moved[0]).max() < 50 * EPS
    assert abs(velocity - moved[1]).max() < 50 * EPS
    ways = (downhill.longest_ways, downhill.longest_ways_by_arrays)
    for way in (of(position, start, given["stretch"]).max() for of in ways):
        assert way == pytest.approx(0.1 * np.sqrt((velocity**2).sum(axis=1)).max(), rel=1e-12)
    position[n // 2, 1] = np.nan
    assert np.isnan(downhill.longest_ways(position, start, given["stretch"]).max())


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("lengths", [[3.1, 4.7, 6.2], [5.0, 3.3, 0.4]])
def test_pairs_by_cells_are_those_of_a_tree(lengths, whole):
    """Crowded and empty cells, cells that lie beside their own images, points on the borders."""
    lengths, random = np.array(lengths), np.random.default_rng(2)
    places = random.random((400, 3)) ** 2 * lengths
    places[0], places[1] = 0.0, [0.0, 0.0, lengths[2] * (1 - EPS)]
    if not suit_cells(len(places), lengths, 1.0, whole):
        pytest.skip("these are for the tree")
    ends, shift = pairs_by_cells(places, lengths, 1.0, whole)
    assert (np.diff(ends[:, 0]) >= 0).all() and (ends[:, 0] < ends[:, 1]).all()
    i, j, periods = periodic_pairs(places, lengths if whole else lengths[:2], 1.0)
    found = set(zip(*ends.T.tolist(), *shift.T.tolist(), strict=True))
    assert len(found) == len(ends) > 400
    assert found == set(zip(i.tolist(), j.tolist(), *periods.T.tolist(), strict=True))
