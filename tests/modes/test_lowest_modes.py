"""Lowest modes and intervals: complete, certified, by every factorisation."""

import numpy as np
import pytest
from oracles import dense_squares
from packings import columns_side_by_side, diluted

from modal.modes.eigenmodes import modes_of
from modal.modes.mode_set import ModeSet
from modal.modes.zero_modes import by_structure
from modal.solvers.factor import Cost, available, direct_solvers
from modal.solvers.lanczos import TOLERANCE
from modal.system.linear_system import Limits, LinearSystem, frequency_of

pytestmark = pytest.mark.two_ways


def residual_promised(system: LinearSystem, modes: ModeSet) -> np.ndarray:
    """Return the bound (k,) of the residuals of a search.

    A residual r of (A - sigma)^-1 below TOLERANCE theta leaves |A v - omega^2 v| = |(A - sigma) r /
    theta| <= |A| TOLERANCE, in units of omega^2.
    """
    return TOLERANCE * system.row_sum_bound / (2 * np.pi * modes.frequency) ** 2


@pytest.mark.parametrize("solver", direct_solvers())
@pytest.mark.parametrize(
    ("network", "count"), [(diluted(0.35, 4, layers=8), 40), (columns_side_by_side(100), 120)]
)
def test_lowest_modes_by_every_factorisation(network, count, solver):
    """Find the lowest modes of disorder, and of columns with every frequency a hundred times."""
    if not available(solver):
        pytest.skip("pypardiso is not installed")
    system = LinearSystem.of(network, solver=solver)
    elastic = frequency_of(dense_squares(system))[by_structure(system).total :]
    lowest = modes_of(system, lowest=count)
    assert lowest.attributes["certified"]
    # omega^2 is known to eps times the largest one; f to that over 2 (f / f_max)^2.
    tolerance = 1e-13 * (elastic[-1] / elastic[0]) ** 2
    assert lowest.frequency == pytest.approx(elastic[:count], rel=tolerance)
    assert (lowest.residual < residual_promised(system, lowest)).all()


@pytest.mark.parametrize("solver", [None, "superlu", "blocks"])
def test_intervals_are_cut_and_complete(solver):
    """Compare slices of at most 40 modes with the dense spectrum: each mode is there once."""
    limits = Limits(dense=0, slice=40)
    system = LinearSystem.of(diluted(0.35, 5, layers=7), solver=solver, limits=limits)
    frequency = frequency_of(dense_squares(system))
    elastic = frequency[by_structure(system).total :]
    # Ends in the middle of gaps, away from the round-off of any frequency.
    middle = (elastic[1:] + elastic[:-1]) / 2
    for low, high in ((0.0, middle[130]), (middle[100], middle[190])):
        modes = modes_of(system, between=(low, high))
        expected = elastic[(elastic >= low) & (elastic < high)]
        assert modes.attributes["certified"]
        assert modes.frequency == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("network", [diluted(0.35, 5, layers=7), columns_side_by_side(30, 8)])
def test_modes_below_a_frequency_by_a_polynomial(monkeypatch, network):
    """Find the modes of the dense solver with no factor but that of the count.

    Columns side by side have every frequency thirty times, which is more than the width of a block:
    the count requests further rounds.
    """
    monkeypatch.setattr("modal.modes.effort.near_a_shift", lambda *_: Cost(0.0, 1e19, 0.0))
    monkeypatch.delattr(LinearSystem, "factor")
    system = LinearSystem.of(network, limits=Limits(dense=0))
    elastic = frequency_of(dense_squares(system))[by_structure(system).total :]
    gap = 40 + int(np.argmax(np.diff(elastic[40:80])))
    high = elastic[gap : gap + 2].mean()
    # Nothing but floppy modes lies below the lower end, zero or not; and as many as are asked,
    # below a frequency that a density of states tells.
    for question in (
        {"between": (0.0, high)},
        {"between": (elastic[0] / 2, high)},
        {"lowest": gap + 1},
    ):
        modes = modes_of(system, **question)
        assert modes.certified
        assert "products" in modes.attributes["solver"]
        assert modes.frequency == pytest.approx(elastic[: gap + 1], rel=1e-8)
        assert (modes.residual < 10 * residual_promised(system, modes)).all()


def test_a_small_part_of_a_small_packing_is_not_solved_dense():
    """Take the dense solver for a third of the modes, and a search for a twentieth."""
    system = LinearSystem.of(diluted(0.35, 5, layers=7))
    elastic = frequency_of(dense_squares(system))[by_structure(system).total :]
    middle = (elastic[1:] + elastic[:-1]) / 2
    for last, dense in ((len(elastic) // 20, False), (system.size // 3, True)):
        modes = modes_of(system, between=(0.0, middle[last]))
        assert (modes.attributes["solver"] == "dense") is dense
        tolerance = 1e-13 * (elastic[-1] / elastic[0]) ** 2
        assert modes.frequency == pytest.approx(elastic[: last + 1], rel=tolerance)
