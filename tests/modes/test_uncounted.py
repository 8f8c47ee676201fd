"""Lists of the lowest modes without a count, by a polynomial that lifts the low end."""

from dataclasses import replace

import numpy as np
import pytest
from packings import disordered

import modal
from modal.modes import effort, search
from modal.modes.eigenmodes import modes_of
from modal.modes.mode_set import Choice
from modal.modes.strategy import ModeRequest
from modal.solvers.factor import Cost
from modal.system.linear_system import Limits, LinearSystem

COUNT = 12


@pytest.fixture
def system(monkeypatch):
    """Return a small system for which the polynomial is the only cheap method."""
    monkeypatch.setattr(effort, "below_an_edge", lambda *_, **__: Cost(0.0, 0.0))
    return replace(LinearSystem.of(disordered((3, 3, 12))), limits=Limits(small=0, dense=0))


@pytest.fixture(scope="module")
def exact():
    """Return the elastic frequencies, Hz, of its whole matrix."""
    frequency = modal.eigenmodes(disordered((3, 3, 12)), all=True).frequency
    return frequency[frequency > 1e-3 * frequency[-1]]


def test_frequencies_are_those_of_the_whole_matrix(system, exact):
    """Compare to the tolerance of Lanczos, 1e-10 of omega^2; the list says what supports it."""
    modes = modes_of(system, lowest=COUNT, certify=False)
    assert "products a vector" in modes.attributes["solver"]
    assert modes.frequency == pytest.approx(exact[:COUNT], rel=1e-9)
    assert not modes.certified
    assert modes.missing == 0
    assert modes.attributes["found_by_second_search"] == 0
    last = modes.frequency[-1]
    margin = 4 * modes.attributes["expected_modes_error"]
    expected = modes.attributes["expected_modes"]
    assert (exact < 0.9 * last).sum() - margin <= expected <= (exact < 1.1 * last).sum() + margin


def test_a_count_that_does_not_fit_is_left_out(system, monkeypatch):
    """Let the factor take more hours than allowed: the reason stands with the list."""
    monkeypatch.setattr(effort, "factorisation", lambda *_, **__: Cost(1.0, 1e20, 1e20))
    modes = modes_of(system, lowest=COUNT)
    assert "takes too much time or memory" in modes.attributes["uncertified_because"]
    assert len(modes.frequency) == COUNT


def test_an_edge_below_wanted_modes_is_raised(system, exact, monkeypatch):
    """Estimate the last frequency so low that the edge lies at the eighth mode."""
    low = exact[7] / 1.15
    monkeypatch.setattr(ModeRequest, "upper_frequency", property(lambda _: low))
    modes = modes_of(system, lowest=COUNT, certify=False)
    assert modes.frequency == pytest.approx(exact[:COUNT], rel=1e-9)
    assert modes.missing == 0


def test_a_missed_mode_is_found_by_the_second_search(system, exact, monkeypatch):
    """Let the first search leave out its fourth mode: the second one adds it to the list."""
    find = search.modes_below
    calls = []

    def leave_out_once(low_end, count, held, *tolerance):
        calls.append(count)
        if len(calls) > 1:
            return find(low_end, count, held, *tolerance)
        found = find(low_end, count + 1, held)
        others = np.delete(np.arange(count + 1), 3)
        found.square = found.square[others]
        found.vector = found.vector[:, others]
        found.converged = found.converged[others]
        return found

    monkeypatch.setattr(search, "modes_below", leave_out_once)
    modes = modes_of(system, lowest=COUNT, certify=False)
    assert calls == [COUNT, 1, 4]
    assert modes.attributes["found_by_second_search"] == 1
    assert modes.frequency == pytest.approx(exact[:COUNT], rel=1e-9)


def test_costs_decide_between_the_polynomial_and_multigrid(monkeypatch):
    """Take the cheaper of the two, and only one that fits into the memory."""
    system = LinearSystem.of(disordered((3, 3, 12)), limits=Limits(small=0, dense=0))
    monkeypatch.setattr("modal.modes.strategy.available", lambda name: True)
    monkeypatch.setattr(effort, "near_a_shift", lambda *_: Cost(0.0, 1e20))
    cheap, dear = Cost(1.0, 1.0), Cost(1.0, 2.0)
    too_large = Cost(1e15, 0.0)
    for polynomial, multigrid, method in (
        (cheap, dear, "lifted"),
        (dear, cheap, "multigrid"),
        (too_large, dear, "multigrid"),
        (dear, too_large, "lifted"),
    ):
        monkeypatch.setattr(effort, "below_an_edge", lambda *_, cost=polynomial, **__: cost)
        monkeypatch.setattr(effort, "by_multigrid", lambda *_, cost=multigrid: cost)
        choice = Choice("lowest", COUNT)
        request = ModeRequest(system, choice, COUNT, system.degrees_of_freedom, certify=False)
        assert request.method == method
