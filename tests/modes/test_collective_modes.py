"""Zero modes that many spheres share: counted and left out, whatever is asked for in any order."""

from dataclasses import replace

import numpy as np
import pytest
from packings import diluted
from scipy.linalg import eigvals_banded

import modal
from modal.modes import lowest
from modal.modes.collective import counted_floppy, every_floppy
from modal.modes.effort import Effort
from modal.modes.zero_modes import by_structure
from modal.packing import crystal as gallery
from modal.packing.network import Network
from modal.solvers.factor import SOLVERS, available
from modal.system.contacts import with_sliding
from modal.system.linear_system import Limits, LinearSystem, frequency_of
from modal.tools.errors import InputError

pytestmark = pytest.mark.two_ways

SHARES = 0.3, 0.45, 0.5
"""Of contacts left out of a crystal without tangential springs: 1, 6 and 19 zero modes of 960 that
structure does not show, with 1.35, 1.04 and 0.97 springs for each motion that it leaves."""


def slippery(share: float, layers: int = 10) -> Network:
    """A crystal without tangential springs that has lost a share of its contacts."""
    network = diluted(share, 1, layers)
    return with_sliding(replace(network, sliding=np.ones(network.n_contacts, bool)), "slip")


def by_dense_solver(network: Network) -> tuple[int, np.ndarray]:
    """How many zero modes there are, and the frequencies of all others, Hz."""
    square = np.linalg.eigvalsh(LinearSystem.of(network).scaled.toarray())
    zero = int((abs(square) < 1e-12 * square[-1]).sum())
    assert square[zero] > 1e-7 * square[-1]  # nothing between
    return zero, frequency_of(square[zero:])


def middle(frequency: np.ndarray, after: int) -> float:
    """A frequency in the middle of the gap after so many."""
    return float(frequency[after - 1 : after + 1].mean())


@pytest.mark.parametrize("solver", [None, "superlu"])
@pytest.mark.parametrize("share", SHARES)
def test_lists_hold_elastic_modes_alone_and_are_complete(share, solver):
    """The lowest, those below and between frequencies: as the dense solver has them, certified."""
    zero, elastic = by_dense_solver(slippery(share))
    assert by_structure(LinearSystem.of(slippery(share))).total < zero
    low, high = middle(elastic, 20), middle(elastic, 40)
    for question, expected in (
        ({"lowest": 10}, elastic[:10]),
        ({"lowest": 32}, elastic[:32]),
        ({"below": high}, elastic[:40]),
        ({"between": (1e-6, high)}, elastic[:40]),
        ({"between": (low, high)}, elastic[20:40]),
    ):
        found = modal.eigenmodes(slippery(share), solver=solver, **question)
        assert found.certified and found.missing == 0
        assert found.frequency == pytest.approx(expected, rel=1e-6)
        assert found.floppy_modes == zero


@pytest.mark.parametrize("share", SHARES)
def test_every_answer_has_the_same_number_of_zero_modes(share):
    """All modes, many of the lowest and the highest, the density of states, what info says."""
    zero, elastic = by_dense_solver(slippery(share))
    many = len(elastic) // 2
    for question in ({"all": True}, {"highest": 5}, {"highest": 500}, {"lowest": many + 10}):
        assert modal.eigenmodes(slippery(share), **question).floppy_modes == zero
    lowest_half = modal.eigenmodes(slippery(share), lowest=many)
    assert lowest_half.frequency == pytest.approx(elastic[:many], rel=1e-6)
    for tolerance in (1e-3, 0.3):
        states = modal.density_of_states(slippery(share), tolerance=tolerance)
        assert states.zero_modes.sum() == pytest.approx(zero, rel=1e-12)
    kinds = every_floppy(LinearSystem.of(slippery(share))).by_kind()
    assert sum(kinds.values()) == zero and kinds["collective"] > 0
    assert f"{zero} (" in modal.describe(slippery(share))


@pytest.mark.parametrize("share", SHARES)
def test_basis_with_collective_modes_is_exact_and_orthonormal(share):
    system = LinearSystem.of(slippery(share))
    basis = every_floppy(system).basis
    assert abs((system.scaled @ basis).toarray()).max() < 1e-13 * system.diagonal.max()
    assert (basis.T @ basis).toarray() == pytest.approx(np.eye(basis.shape[1]), abs=1e-12)


@pytest.mark.parametrize(("share", "seed"), [(0.6, 1), (0.62, 2), (0.65, 3), (0.7, 2), (0.5, 1)])
def test_zero_modes_that_structure_does_not_show_are_counted_in_any_order(share, seed):
    """With all springs too, of crystals that have lost contacts: 45 where structure shows 44."""
    zero, elastic = by_dense_solver(diluted(share, seed, 10))
    asked = {
        "list": lambda network: modal.eigenmodes(network, lowest=5).floppy_modes,
        "count": lambda network: modal.count_modes(network, 1e-3),
        "density": lambda network: modal.density_of_states(network).zero_modes.sum(),
        "estimate": lambda network: modal.density_of_states(
            network, tolerance=0.3
        ).zero_modes.sum(),
        "print": lambda network: int(modal.describe(network).split("floppy modes")[1].split()[0]),
    }
    for order in (list(asked), list(asked)[::-1]):
        network = diluted(share, seed, 10)
        for name in order:
            assert asked[name](network) == pytest.approx(zero, rel=1e-12), name
    found = modal.eigenmodes(network, lowest=5)
    assert found.certified and found.frequency == pytest.approx(elastic[:5], rel=1e-6)


def test_more_zero_modes_than_there_are_are_not_made_up(monkeypatch):
    """A count that were wrong by one: the search for the missing one ends by name."""
    system = LinearSystem.of(slippery(0.5))
    every = counted_floppy(LinearSystem.of(slippery(0.5))).total
    monkeypatch.setattr("modal.modes.collective.count_below", lambda *given, **named: every + 1)
    with pytest.raises(InputError, match="were counted, but not all were found"):
        counted_floppy(system)


def test_a_list_that_meets_zero_modes_counts_them(monkeypatch):
    """Where they were not counted before, as in large packings that seem sound."""
    monkeypatch.setattr("modal.modes.collective.EASY", 0.0)
    zero, elastic = by_dense_solver(diluted(0.65, 3, 10))
    network = diluted(0.65, 3, 10)
    assert f"at least {zero - 2} (" in modal.describe(network)
    assert modal.density_of_states(network, tolerance=0.3).counted is False
    for question in ({"lowest": 10}, {"below": middle(elastic, 10)}):
        found = modal.eigenmodes(diluted(0.65, 3, 10), **question)
        assert found.certified and found.floppy_modes == zero
        assert found.frequency == pytest.approx(elastic[:10], rel=1e-6)


def test_a_long_chain_without_side_contacts():
    """Three springs for a contact, one of them too many along the axis: the rest moves freely."""
    chain = gallery.column(700)
    zero = 6 * 700 - 3 * chain.n_contacts + 1
    found = modal.eigenmodes(chain, lowest=4)
    # Axial motion alone has energy at low frequency: springs 2 k at the walls, k between.
    k, mass = chain.stiffness_normal[1], chain.mass[0]
    matrix = np.zeros((2, 700))
    matrix[0] = 2 * k
    matrix[0, [0, -1]] = k + chain.stiffness_normal[[0, -1]]
    matrix[1] = -k
    assert found.certified and found.floppy_modes == zero
    axial = np.sqrt(eigvals_banded(matrix, lower=True)[:4] / mass) / (2 * np.pi)
    assert found.frequency[found.chi_z > 0.99] == pytest.approx(
        axial[: (found.chi_z > 0.99).sum()], rel=1e-6
    )
    between = modal.eigenmodes(chain, between=(1.0, found.frequency[1]))
    assert between.certified and between.floppy_modes == zero


@pytest.mark.parametrize("way", ["slices", "a polynomial"])
def test_long_lists_that_start_at_zero(monkeypatch, way):
    """Cut into slices, or lifted by a polynomial: what comes back at zero is no elastic mode."""
    limits = Limits(dense=0, part=1, slice=40 if way == "slices" else 700)
    zero, elastic = by_dense_solver(slippery(0.5))
    if way != "slices":
        monkeypatch.setattr("modal.modes.lowest.near_a_shift", lambda *_: Effort(1e9, 0.0))
    solver = "superlu" if way == "slices" else None
    system = LinearSystem.of(slippery(0.5), solver=solver, limits=limits)
    if way == "slices":
        found = lowest.lowest_modes(system, 100)
        assert found.frequency == pytest.approx(elastic[:100], rel=1e-6)
    else:
        found = lowest.modes_between(system, 0.0, middle(elastic, 60))
        assert "a vector" in found.attributes["solver"]
        assert found.frequency == pytest.approx(elastic[:60], rel=1e-8)
    assert found.certified and found.floppy_modes == zero


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("layers", [4, 10])
def test_counts_just_above_zero_are_those_of_the_zero_modes(solver, layers):
    """At frequencies whose omega^2 is below the round-off of a factorisation."""
    if not available(solver):
        pytest.skip("pypardiso is not installed")
    network = slippery(0.5, layers)
    assert (LinearSystem.of(network).size <= Limits().small) == (layers == 4)
    zero, _ = by_dense_solver(network)
    counts = modal.count_modes(network, [1e-9, 1e-6, 1e-3, 0.1, 1.0], solver=solver)
    assert counts.tolist() == [zero] * 5
