"""Exact counts of modes below a frequency: right, or refused, at any scale."""

import numpy as np
import pytest
from oracles import dense_squares
from packings import diluted

import modal
from modal.modes.counts import count_below
from modal.packing import crystal as gallery
from modal.solvers.factor import SOLVERS, available
from modal.system.linear_system import LinearSystem, frequency_of

pytestmark = pytest.mark.two_ways


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_counts_are_exact(share):
    """Inertia by each factorisation against the dense spectrum."""
    network = diluted(share, 7)
    frequency = frequency_of(dense_squares(LinearSystem.of(network)))
    at = [1.0, 3e4, 7.7e4, 1.3e5, 2.5e5]
    for solver in filter(available, SOLVERS):
        counted = modal.count_modes(network, at, solver=solver)
        assert counted.tolist() == [(frequency < hz).sum() for hz in at]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("which", [2, 4])
def test_a_singular_block_on_the_way_does_not_spoil_the_count(solver, which):
    """At an eigenvalue of one sphere's block of A every sphere of a column asks for a pivot that
    is zero, while no eigenvalue of A is near. PARDISO replaces such pivots: 110 for 136 modes."""
    if not available(solver):
        pytest.skip("pypardiso is not installed")
    system = LinearSystem.of(gallery.column(120), solver=solver)
    block = system.scaled[78:84, 78:84].toarray()
    square = np.linalg.eigvalsh(block)[which]
    exact = dense_squares(system)
    assert abs(exact - square).min() > 1e-4 * exact[-1]
    assert count_below(system, frequency_of(square)) == int((exact < square).sum())
