"""Exact counts of modes below a frequency: right, or refused, at any scale."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from packings import (
    columns_side_by_side,
    dense_squares,
    diluted,
    with_contacts,
)

import modal
from modal.modes.counts import count_below, count_negative, layers_of_contacts
from modal.modes.lowest import lowest_modes
from modal.packing import crystal as gallery
from modal.solvers.factor import _certain, available, factorise
from modal.system.assembly import stiffness_matrix
from modal.system.linear_system import SMALL, LinearSystem, frequency_of
from modal.tools.errors import InputError


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_counts_are_exact(share):
    """Inertia, layer by layer and by a sparse factorisation, against the dense spectrum."""
    network = diluted(share, 7)
    system = LinearSystem.of(network)
    frequency = frequency_of(dense_squares(system))
    for hz in (1.0, 3e4, 7.7e4, 1.3e5, 2.5e5):
        expected = int((frequency < hz).sum())
        shifted = system.shifted((2 * np.pi * hz) ** 2)
        assert count_negative(shifted, 6, network.position[:, 2]) == expected
        assert count_below(system, hz) == expected
        for solver in ("pardiso", "superlu"):
            if available(solver):
                found = factorise(shifted, definite=False, solver=solver).negative
                assert found == expected


@pytest.mark.parametrize("solver", ["pardiso", "superlu", "layers"])
@pytest.mark.parametrize("which", [2, 4])
def test_a_singular_block_on_the_way_does_not_spoil_the_count(solver, which):
    """At an eigenvalue of one sphere's block of A every sphere of a column asks for a pivot that
    is zero, while no eigenvalue of A is near. PARDISO replaces such pivots: 110 for 136 modes."""
    if not available(solver) and solver != "layers":
        pytest.skip("pypardiso is not installed")
    system = LinearSystem.of(gallery.column(120), solver=solver)
    block = system.scaled[78:84, 78:84].toarray()
    square = np.linalg.eigvalsh(block)[which]
    exact = dense_squares(system)
    assert abs(exact - square).min() > 1e-4 * exact[-1]
    assert count_below(system, frequency_of(square)) == int((exact < square).sum())


def test_a_perturbed_pivot_is_not_called_exact():
    """Twelve uncoupled pairs whose first pivot is zero to 1e-12 of the rest: PARDISO perturbs."""
    if not available("pardiso"):
        pytest.skip("pypardiso is not installed")
    diagonal = np.ones(24)
    diagonal[::2] = 1e-12
    factor = factorise(sp.csr_matrix(np.diag(diagonal)), definite=False, solver="pardiso")
    assert factor.negative is None
    factor.release()


def test_a_matrix_with_an_empty_diagonal_is_counted():
    """[[0, 1], [1, 0]] has the eigenvalues -1 and 1, whether or not its zeros are stored."""
    matrix = sp.csr_matrix(np.kron(np.eye(3), [[0.0, 1.0], [1.0, 0.0]]))
    for solver in ("pardiso", "superlu"):
        if available(solver):
            factor = factorise(matrix, definite=False, solver=solver)
            assert factor.negative in (3, None)
            assert factor.solve(np.eye(6)) == pytest.approx(matrix.toarray(), abs=1e-12)


def test_a_factor_off_by_more_than_counts_promise_gives_none():
    """Off by 1e-10 of the largest eigenvalue it has another sign than an eigenvalue of 5e-11."""
    exact, off = np.diag([1.0, 5e-11]), np.diag([1.0, -5e-11])
    assert _certain(1, lambda rhs: np.linalg.solve(off, rhs), sp.csr_matrix(exact)) is None
    assert _certain(0, lambda rhs: np.linalg.solve(exact, rhs), sp.csr_matrix(exact)) == 0


def test_growth_of_the_factor_is_no_exact_count():
    """A star's leaves come first; one of 1e-12 makes an entry of 1e12 of the centre's 0.3."""
    star = np.diag([0.3, 1e-12, 1.0, 1.0])
    star[0, 1:] = star[1:, 0] = 1.0
    assert factorise(sp.csr_matrix(star), definite=False, solver="superlu").negative is None
    star[1, 1] = 1.0
    assert factorise(sp.csr_matrix(star), definite=False, solver="superlu").negative == 1
    network = gallery.column(2)
    system = LinearSystem.of(network)
    block = system.scaled[:6, :6].toarray()
    near = np.linalg.eigvalsh(block)[-1] * (1 - 1e-12)
    with pytest.raises(InputError, match="ask for a different one"):
        count_negative(system.shifted(near), 6, network.position[:, 2])


@pytest.mark.parametrize("solver", ["pardiso", "superlu", "layers"])
def test_a_mode_at_the_frequency_asked_is_refused(solver):
    """Whether a mode lies below its own frequency is round-off: no count is given as exact."""
    if not available(solver) and solver != "layers":
        pytest.skip("pypardiso is not installed")
    system = LinearSystem.of(columns_side_by_side(60), solver=solver)
    frequency = frequency_of(dense_squares(system))
    for hz in (frequency[-1], frequency[-200]):
        count = None
        try:
            count = count_below(system, hz)
        except InputError as error:
            assert "slightly different" in str(error)
        # Some round-off decides for all or for none of the equal modes.
        low, high = (frequency < hz * (1 - 1e-9)).sum(), (frequency < hz * (1 + 1e-9)).sum()
        assert count is None or low <= count <= high


@pytest.mark.parametrize("solver", ["pardiso", "superlu"])
def test_solutions_show_a_mode_that_a_count_cannot_lie_on(solver):
    """Beside a frequency of sixty equal modes all of them are on one side."""
    if not available(solver):
        pytest.skip("pypardiso is not installed")
    network = columns_side_by_side(60)
    hz = float(frequency_of(dense_squares(LinearSystem.of(network)))[-200])
    below, above = modal.count_modes(network, [hz * (1 - 1e-6), hz * (1 + 1e-6)], solver=solver)
    assert (above - below) % 60 == 0 < above - below
    with pytest.raises(InputError, match="slightly different"):
        modal.count_modes(network, hz, solver=solver)


@pytest.mark.parametrize("contacts_apart", [1, 3])
def test_layers_of_contacts_of_a_crystal_are_its_planes(contacts_apart):
    """Contacts join neighbouring layers only, and none is thicker than a plane of the crystal.

    Two clusters, one far above the other, are each counted from their own lowest plane, whose
    spheres need not be equally low.
    """
    crystal = gallery.fcc(cells=(3, 3, 12))
    plane = np.unique(crystal.position[:, 2].round(9), return_inverse=True)[1]
    cut = plane < 12 // contacts_apart
    i, j = crystal.particle_i, crystal.particle_j
    network = with_contacts(crystal, (j < 0) | (cut[i] == cut[j]))
    matrix = stiffness_matrix(network)
    uneven = 0.2 * network.length / 12 * np.random.default_rng(1).random(network.n_particles)
    layer = layers_of_contacts(matrix, 6, network.position[:, 2] + uneven)
    assert np.array_equal(layer, np.where(cut, plane, plane - cut.sum() // 9))
    assert not layers_of_contacts(matrix, 6, np.zeros(network.n_particles)).any()


@pytest.mark.parametrize("size", [1e-30, 1e-9, 1.0, 1e30])
def test_counts_do_not_depend_on_the_unit_of_stiffness(size):
    """Sylvester's law is about signs; the chain's matrix with its shift has both, of any size."""
    chain = sp.diags([-np.ones(19), 2 * np.ones(20), -np.ones(19)], [-1, 0, 1], format="csr")
    angle = np.arange(1, 21) * np.pi / 21
    for shift in (0.1, 1.2, 1.99, 3.7):
        # Eigenvalues of a chain between walls: 2 - 2 cos(angle).
        expected = int((2 - 2 * np.cos(angle) < shift).sum())
        shifted = (size * (chain - shift * sp.eye(20))).tocsr()
        assert count_negative(shifted, 1, np.arange(20.0)) == expected
        for solver in ("pardiso", "superlu"):
            if available(solver):
                found = factorise(shifted, definite=False, solver=solver).negative
                # PARDISO replaces pivots below some 1e-8 in themselves, and then does not count.
                assert found == (None if solver == "pardiso" and size < 1e-8 else expected)


@pytest.mark.parametrize("solver", [None, "pardiso", "superlu"])
def test_a_count_factorises_once_and_gives_the_memory_back(solver, monkeypatch):
    """By PARDISO where it is installed and nothing else is asked for; else by layers, without."""
    if solver is not None and not available(solver):
        pytest.skip("pypardiso is not installed")
    made, kept = [], []

    def noted(*arguments, **options):
        factor = factorise(*arguments, **options)
        made.append(factor.solver)
        kept.append(factor)

        def release():
            factor.release()
            kept.remove(factor)

        return replace(factor, release=release)

    monkeypatch.setattr("modal.modes.counts.factorise", noted)
    system = LinearSystem.of(gallery.fcc(cells=(4, 4, 8)), solver=solver)
    assert system.size > SMALL
    assert count_below(system, 0.0) == count_below(system, -5e4) == 0
    assert count_below(system, 5e4) == int((frequency_of(dense_squares(system)) < 5e4).sum())
    fast = solver or ("pardiso" if available("pardiso") else None)
    assert made == ([fast] if fast else [])
    assert not kept


@pytest.mark.parametrize("above", [3, 4])
def test_counts_beside_an_uncertain_frequency_must_agree(above, monkeypatch):
    """Where no method can tell at a frequency, three modes below and three above it are three;
    three and four mean a mode in between."""
    system = LinearSystem.of(gallery.fcc(cells=(4, 4, 8)))
    square = (2 * np.pi * 5e4) ** 2

    def negative(_, place, method, apart):
        if abs(place / square - 1) > 1e-5:
            return 99  # too far to tell anything
        return None if place == square else 3 if place < square else above

    monkeypatch.setattr("modal.modes.counts._negative", negative)
    if above == 3:
        assert count_below(system, 5e4) == 3
    else:
        with pytest.raises(InputError, match="a mode is so near"):
            count_below(system, 5e4)


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e30])
def test_growth_of_a_layer_is_no_exact_count(size):
    """As for a sparse factor: a leading entry of 1e-12 of the others, whatever their unit."""
    matrix = size * sp.csr_matrix([[1e-12, 1.0], [1.0, 0.3]])
    with pytest.raises(InputError, match="singular"):
        count_negative(matrix, 1, np.arange(2.0))


@pytest.mark.parametrize("zero", [0, 2, 4])
def test_exactly_singular_is_refused_and_not_counted(zero):
    """At the frequency of a mode its eigenvalue has no sign, in whichever layer it is met."""
    diagonal = np.array([3.0, -1, 2, -5, 4])
    assert count_negative(sp.diags(diagonal, format="csr"), 1, np.arange(5.0)) == 2
    diagonal[zero] = 0
    with pytest.raises(InputError, match="singular"):
        count_negative(sp.diags(diagonal, format="csr"), 1, np.arange(5.0))


def test_too_little_memory_is_refused(monkeypatch):
    monkeypatch.setattr("modal.solvers.factor.memory_at_hand", lambda: 1e3)
    system = LinearSystem.of(gallery.fcc(cells=(4, 4, 10)), solver="banded")
    with pytest.raises(InputError, match=r"needs about .* GB"):
        lowest_modes(system, 5)
