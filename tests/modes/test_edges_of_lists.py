"""Lists and counts at their edges: unstable packings, ends on a mode, all modes, no springs."""

from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest
from changes import scaled
from oracles import dense_squares
from packings import columns_side_by_side, diluted, sliding
from refusals import refusal

import modal
from modal.modes.collective import summary_at_zero
from modal.modes.counts import count_below
from modal.modes.eigenmodes import modes_of
from modal.modes.zero_modes import by_structure
from modal.packing import crystal as gallery
from modal.packing.network import Network, write_network
from modal.packing.tiling import repeat
from modal.solvers.factor import available, direct_solvers
from modal.system.linear_system import Limits, LinearSystem, frequency_of
from modal.tools.errors import InputError


def unstable(cells: tuple[int, int, int]) -> Network:
    """Return a crystal with a free sphere and with some springs of negative stiffness.

    The checks of a network would refuse such springs.
    """
    network = gallery.fcc(cells=cells)
    network = network.with_contacts((network.particle_i != 7) & (network.particle_j != 7))
    stiffness = scaled(network.stiffness_normal, slice(10, 90, 30), -20)
    return network.unchecked(stiffness_normal=stiffness)


@pytest.mark.parametrize("cells", [(3, 3, 5), (3, 3, 14)])
@pytest.mark.parametrize("solver", [None, "superlu", "blocks"])
def test_unstable_modes_are_counted_and_left_out_of_lists_at_any_size(cells, solver):
    """Compare counts and lists of an unstable packing with its dense spectrum.

    Lists have only the modes above zero, unless all modes are requested.
    """
    network = unstable(cells)
    system = LinearSystem.of(network, solver=solver)
    assert (system.size <= system.limits.small) == (cells[2] == 5)
    square = np.linalg.eigvalsh(system.dynamical_matrix.toarray())
    square[abs(square) < 1e-11 * square[-1]] = 0.0
    negative = int((square < 0).sum())
    assert negative > 0
    assert (square == 0).sum() == 6
    frequencies = [0.0, 1e-3, 8e3, 5e4]
    expected = [int((frequency_of(square) < f).sum()) for f in frequencies]
    assert modal.count_modes(network, frequencies, solver=solver).tolist() == expected
    assert summary_at_zero(system)["unstable_modes"] == negative
    assert f"{negative} unstable" in modal.describe(network)
    elastic = frequency_of(square[square > 0])
    for question, listed in (
        ({"lowest": 3}, elastic[:3]),
        ({"highest": 3}, elastic[-3:]),
        ({"below": 5e4}, elastic[elastic < 5e4]),
        ({"between": (2e4, 5e4)}, elastic[(elastic >= 2e4) & (elastic < 5e4)]),
        ({"all": True}, frequency_of(square)),
    ):
        modes = modal.eigenmodes(network, **question, solver=solver)
        assert modes.certified
        assert modes.unstable_modes == negative
        # Round-off leaves some 1e-16 of the largest square for free motions. Frequencies below zero
        # stand for negative squares.
        square_of_modes = modes.frequency * abs(modes.frequency)
        expected_square = listed * abs(listed)
        round_off = 1e-14 * elastic[-1] ** 2
        assert square_of_modes == pytest.approx(expected_square, rel=2e-7, abs=round_off)
    for tolerance in (1e-3, 0.3):
        with refusal("unstable", f"({negative} "):
            modal.density_of_states(network, tolerance=tolerance)


@pytest.mark.two_ways
@pytest.mark.parametrize("end", ["high", "low", "both"])
@pytest.mark.parametrize("width", [1, 60])
def test_an_interval_that_ends_on_a_mode_ends_its_search_and_is_complete(end, width):
    """End an interval on a single mode, or on sixty modes of one frequency.

    Round-off of 1e-9 decides whether the modes at the ends are in the list; all modes between the
    ends are.
    """
    network = diluted(0.1, 3, 7) if width == 1 else columns_side_by_side(60, 3)
    exact = frequency_of(np.linalg.eigvalsh(LinearSystem.of(network).dynamical_matrix.toarray()))
    first_index = np.flatnonzero(exact > 0.1 * exact[-1])[0]
    first = exact[first_index]
    last = exact[first_index + 90]
    low = first if end != "high" else 0.999 * first
    high = last if end != "low" else 1.001 * last
    system = LinearSystem.of(network, limits=Limits(part=1))
    modes = modes_of(system, between=(low, high))
    assert modes.certified
    for margin, compare in ((1e-9, np.less_equal), (-1e-9, np.greater_equal)):
        inside = (exact >= low * (1 - margin)) & (exact < high * (1 + margin))
        assert compare(len(modes.frequency), inside.sum())


@pytest.mark.two_ways
@pytest.mark.parametrize("solver", direct_solvers())
@pytest.mark.parametrize(
    "network", [diluted(0.1, 3, 3), diluted(0.1, 3, 7), columns_side_by_side(60), sliding(100)]
)
def test_a_count_on_a_mode_is_refused(network, solver):
    """Refuse a count within the round-off of one or of sixty modes; it is exact further away."""
    if not available(solver):
        pytest.skip("pypardiso is not installed")
    system = LinearSystem.of(network, solver=solver)
    square = np.linalg.eigvalsh(system.dynamical_matrix.toarray())
    gap = 1e-6 * square[-1]
    zero = system.zero_threshold
    isolated = np.flatnonzero((np.diff(square) > gap) & (square[:-1] > 10 * zero))
    for k, offset in zip(
        isolated[:: max(1, len(isolated) // 6)], cycle([0.7, 0.0, -0.7]), strict=False
    ):
        on, beside = frequency_of(square[k] + zero * np.array([offset, 1.4]))
        with refusal("not_converged"):
            modal.count_modes(network, on, solver=solver)
        assert modal.count_modes(network, beside, solver=solver) == k + 1


@pytest.mark.two_ways
@pytest.mark.parametrize("solver", direct_solvers())
@pytest.mark.parametrize("which", [2, 4])
def test_a_singular_block_on_the_way_does_not_spoil_the_count(solver, which):
    """Count below an eigenvalue of one sphere's block of A, which is no eigenvalue of A.

    Every sphere of the column then has a pivot of zero. PARDISO replaces such pivots and would
    count 110 modes instead of 136.
    """
    if not available(solver):
        pytest.skip("pypardiso is not installed")
    system = LinearSystem.of(gallery.column(120), solver=solver)
    block = system.dynamical_matrix[78:84, 78:84].toarray()
    square = np.linalg.eigvalsh(block)[which]
    exact = dense_squares(system)
    assert abs(exact - square).min() > 1e-4 * exact[-1]
    assert count_below(system, frequency_of(square)) == int((exact < square).sum())


@pytest.mark.two_ways
@pytest.mark.parametrize("factor", [0.3, 3.3])
@pytest.mark.parametrize("cells", [(2, 2, 6), (3, 3, 6)])
def test_the_threshold_of_zero_is_one(factor, cells):
    """Check that one threshold decides everywhere which modes are floppy.

    A crystal slides on walls with hardly a tangential spring. Its softest modes are floppy below
    the threshold and elastic above it: by structure, in counts, in lists and in the density of
    states.
    """
    network = sliding(factor, cells)
    is_floppy = int(factor < 1)
    system = LinearSystem.of(network)
    soft = factor * system.zero_threshold
    round_off = system.size * np.finfo(float).eps * system.row_sum_bound
    lowest = np.linalg.eigvalsh(system.dynamical_matrix.toarray())[:2]
    assert lowest == pytest.approx(soft, rel=1e-4, abs=round_off)
    assert round_off < 0.2 * soft
    for floppy in (
        by_structure(system).total,
        modal.count_modes(network, 1e-6),
        modal.eigenmodes(network, lowest=3).floppy_modes,
        modal.density_of_states(network, tolerance=0.3).zero_modes.sum(),
    ):
        assert floppy == pytest.approx(2 * is_floppy, abs=1e-9)


def test_residuals_where_a_symmetry_is_used_are_those_of_the_whole():
    """Check that the residuals of a crystal's waves are those in A, not in a block of the symmetry.

    Stiffnesses differ by 8e-10, which the symmetry does not see.
    """
    crystal = gallery.fcc(cells=(3, 3, 14))
    rough = 1 + 8e-10 * np.random.default_rng(1).uniform(-0.4, 0.4, crystal.n_contacts)
    network = replace(crystal, stiffness_normal=crystal.stiffness_normal * rough)
    system = LinearSystem.of(network)
    modes = modes_of(system, all=True)
    assert modes.attributes["solver"] == "symmetry 3x3"
    vector = system.sqrt_mass.times(modes.shapes().reshape(len(modes.frequency), -1).T)
    square = (2 * np.pi * modes.frequency) ** 2
    residual = np.linalg.norm(system.dynamical_matrix @ vector - square * vector, axis=0) / square
    # Standing waves are halves of travelling ones: their residual differs by sqrt(2) at most.
    isolated = abs(np.diff(square, prepend=0, append=2e30)) > 1e-6 * square[-1]
    isolated = isolated[:-1] & isolated[1:]
    assert isolated.sum() > 5
    assert residual.max() > 1e-10
    assert modes.residual[isolated] == pytest.approx(residual[isolated], rel=1e-3)
    assert (modes.residual > 0.7 * residual - 1e-14).all()


def test_all_modes_follow_the_time_that_is_given():
    """Refuse all modes of more than 6,000 degrees of freedom by the estimated time."""
    network = repeat(diluted(0.1, 3, 3), 5, 5)
    rough = 1 + 0.1 * np.random.default_rng(1).random(network.n_contacts)
    network = replace(network, stiffness_normal=network.stiffness_normal * rough)
    with pytest.raises(InputError) as refused:
        modal.eigenmodes(network, all=True, hours=0.01)
    assert refused.value.code == "too_large"
    assert "3.11 min" in refused.value.problem
    assert "0.01" in refused.value.remedy


@pytest.mark.two_ways
@pytest.mark.parametrize("layers", [4, 20])
def test_without_contacts_every_motion_is_free(layers, tmp_path, printed):
    """Ask a packing without contacts, below and above the size of dense solvers."""
    crystal = gallery.fcc(cells=(3, 3, layers))
    network = crystal.with_contacts(np.zeros(crystal.n_contacts, bool))
    size = 6 * network.n_particles
    assert f"{size} ({size} free particles)" in modal.describe(network)
    assert modal.count_modes(network, [0.0, 1.0]).tolist() == [0, size]
    for question in ({"below": 1e4}, {"all": True}):
        modes = modal.eigenmodes(network, **question)
        assert modes.certified
        assert modes.floppy_modes == size
    for question in ({"lowest": 1}, {"highest": 1}):
        with refusal("no_stiffness"):
            modal.eigenmodes(network, **question)
    path = tmp_path / "free.network.h5"
    write_network(path, network)
    assert printed("count", path, "--at", 1)["floppy_modes"] == size
