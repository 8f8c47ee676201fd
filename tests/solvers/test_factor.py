"""Factorisations: solutions and inertia of each against dense ones, or no count where unsure."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from packings import diluted, polydisperse
from refusals import refusal
from scipy.sparse.csgraph import reverse_cuthill_mckee as order_of
from scipy.sparse.linalg import splu

import modal
from modal.solvers import factor as registry
from modal.solvers.factor import (
    Shape,
    SingularError,
    available,
    band,
    certain,
    choose,
    direct_solvers,
    factorise,
    named,
    reach_of,
)
from modal.solvers.factorisations.blocks import MIN_BLOCK_ROWS
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError

pytestmark = pytest.mark.two_ways

HERE = [solver for solver in direct_solvers() if available(solver)]


@pytest.fixture(scope="module")
def systems():
    """Return a crystal, a diluted one, and a cell of unequal spheres, periodic along z."""
    networks = modal.fcc(cells=(3, 3, 20)), diluted(0.4, 1, 12), polydisperse(True)
    return [LinearSystem.of(network) for network in networks]


@pytest.mark.parametrize("solver", HERE)
@pytest.mark.parametrize("place", [-1e-7, 0.013, 0.51])
def test_solutions_and_inertia_of_real_matrices(systems, solver, place):
    """Compare residuals and inertia with dense matrices.

    Residuals are as small as promised where the signs count. Blocks always count; their residuals
    are some hundred eps |A| |x|.
    """
    promised = 1e-13 if solver == "blocks" else registry.BACKWARD
    for system in systems:
        exact = np.linalg.eigvalsh(system.dynamical_matrix.toarray())
        shift = place * exact[-1]
        matrix = system.shifted(shift)
        rhs = np.random.default_rng(1).standard_normal((system.size, 5))
        factor = factorise(matrix, solver=solver)
        solution = factor.solve(rhs)
        error = np.linalg.norm(matrix @ solution - rhs, axis=0)
        assert factor.solve(rhs[:, 0]) == pytest.approx(solution[:, 0], rel=1e-9)
        if factor.negative is None and solver != "blocks":
            continue
        assert (error <= promised * exact[-1] * np.linalg.norm(solution, axis=0)).all()
        assert factor.negative == (exact < shift).sum()
        assert factor.solver == solver
        factor.release()
        counted = factorise(matrix, solver=solver, kept=False)
        assert counted.negative == (exact < shift).sum()
        counted.release()
        if place > 0:
            with pytest.raises(SingularError):
                factorise(matrix, solver=solver, definite=True)


@pytest.mark.parametrize("solver", HERE)
def test_solutions_of_complex_and_of_unsymmetric_matrices(systems, solver):
    """Solve with dashpots and with shear forces; a solver that cannot is refused by name."""
    size = systems[0].size
    shifted = systems[0].shifted(2e11)
    random = np.random.default_rng(2)
    rhs = random.standard_normal((size, 3))
    damped = (shifted + 0.1j * systems[0].dynamical_matrix).tocsr()
    skewed = shifted.copy()
    skewed.data *= 1 + 0.1 * random.random(shifted.nnz)
    for matrix, symmetric, loads in ((damped, True, rhs + 1j * rhs[::-1]), (skewed, False, rhs)):
        if not symmetric and not named(solver).unsymmetric:
            with refusal("unsymmetric"):
                factorise(matrix, symmetric=False, solver=solver)
            continue
        factor = factorise(matrix, symmetric=symmetric, solver=solver)
        solution = factor.solve(loads)
        bound = 1e-12 * abs(matrix).max() * np.linalg.norm(solution)
        assert np.linalg.norm(matrix @ solution - loads) <= bound
        assert factor.negative is None
        factor.release()


@pytest.mark.parametrize("size", [1e-30, 1e-9, 1.0, 1e30])
def test_counts_do_not_depend_on_the_unit_of_stiffness(size):
    """Count the eigenvalues of a shifted chain below zero, in several units.

    Sylvester's law is about signs alone.
    """
    n = 700
    chain = sp.diags([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], [-1, 0, 1], format="csr")
    angle = np.arange(1, n + 1) * np.pi / (n + 1)
    for shift in (0.1, 1.2, 1.99, 3.7):
        # Eigenvalues of a chain between walls: 2 - 2 cos(angle).
        expected = int((2 - 2 * np.cos(angle) < shift).sum())
        for solver in HERE:
            count = factorise((size * (chain - shift * sp.eye(n))).tocsr(), solver=solver).negative
            # PARDISO replaces pivots below some 1e-8 in themselves, and then does not count.
            assert count == (None if solver == "pardiso" and size < 1e-8 else expected)


def test_a_package_that_cannot_be_loaded_counts_as_absent(monkeypatch):
    """Treat pypardiso without MKL as if it were not installed."""
    pytest.importorskip("pypardiso")

    def load():
        raise ImportError("mkl_rt")

    broken = replace(named("pardiso"), load=load)
    monkeypatch.setattr("modal.solvers.factorisations.pardiso.FACTORISATION", broken)
    registry._loads.cache_clear()
    shape = Shape(rows=1e5, nonzeros=6e6, layer=3e3)
    try:
        assert not available("pardiso")
        assert choose(shape, None, kept=True).name != "pardiso"
        with pytest.raises(InputError) as refused:
            choose(shape, "pardiso", kept=True)
    finally:
        registry._loads.cache_clear()
    assert refused.value.code == "not_installed"


def test_a_perturbed_pivot_is_not_called_exact():
    """Factorise uncoupled pairs whose first pivot is 1e-12 of the rest: PARDISO perturbs it."""
    if not available("pardiso"):
        pytest.skip("pypardiso is not installed")
    diagonal = np.ones(24)
    diagonal[::2] = 1e-12
    factor = factorise(sp.csr_matrix(np.diag(diagonal)), solver="pardiso")
    assert factor.negative is None
    factor.release()


@pytest.mark.parametrize("solver", HERE)
def test_a_matrix_with_an_empty_diagonal_is_counted(solver):
    """Factorise [[0, 1], [1, 0]], whose eigenvalues are -1 and 1, with stored zeros or without."""
    matrix = sp.csr_matrix(np.kron(np.eye(3), [[0.0, 1.0], [1.0, 0.0]]))
    factor = factorise(matrix, solver=solver)
    assert factor.negative in (3, None)
    assert factor.solve(np.eye(6)) == pytest.approx(matrix.toarray(), abs=1e-12)


def test_a_factor_off_by_more_than_counts_promise_gives_none():
    """Refuse the count of a factor that is off by 1e-10 of the largest eigenvalue.

    An eigenvalue of 5e-11 then has the wrong sign.
    """
    exact = np.diag([1.0, 5e-11])
    off = np.diag([1.0, -5e-11])
    assert certain(1, lambda rhs: np.linalg.solve(off, rhs), sp.csr_matrix(exact)) is None
    assert certain(0, lambda rhs: np.linalg.solve(exact, rhs), sp.csr_matrix(exact)) == 0


def test_growth_of_the_factor_is_no_exact_count():
    """Refuse the count if an entry of the factor grows to 1e12.

    The leaves of a star come first; one of them is 1e-12, beside the centre's 0.3.
    """
    star = np.diag([0.3, 1e-12, 1.0, 1.0])
    star[0, 1:] = star[1:, 0] = 1.0
    assert factorise(sp.csr_matrix(star), solver="superlu").negative is None
    star[1, 1] = 1.0
    assert factorise(sp.csr_matrix(star), solver="superlu").negative == 1


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e30])
@pytest.mark.parametrize("kept", [True, False])
def test_growth_of_a_block_is_no_exact_count(size, kept):
    """Refuse the count of a chain at an eigenvalue of its first block of rows."""
    n = 500
    chain = sp.diags([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], [-1, 0, 1], format="csr")
    for off, certainly in ((1e-12, False), (1e-4, True)):
        shift = (2 - 2 * np.cos(51 * np.pi / (MIN_BLOCK_ROWS + 1))) * (1 + off)
        factor = factorise((size * (chain - shift * sp.eye(n))).tocsr(), solver="blocks", kept=kept)
        expected = int((2 - 2 * np.cos(np.arange(1, n + 1) * np.pi / (n + 1)) < shift).sum())
        assert factor.negative == (expected if certainly else None)


@pytest.mark.parametrize("zero", [0, 250, 499])
def test_exactly_singular_is_refused_and_not_counted(zero):
    """Refuse a count with an eigenvalue of zero, which has no sign, in any block."""
    diagonal = np.tile([3.0, -1, 2, -5, 4], 100)
    assert factorise(sp.diags(diagonal, format="csr"), solver="blocks").negative == 200
    diagonal[zero] = 0
    with pytest.raises(SingularError) as refused:
        factorise(sp.diags(diagonal, format="csr"), solver="blocks")
    assert refused.value.code == "singular"


def test_spheres_without_contacts_widen_no_block():
    """Estimate a long crystal among spheres without contacts, which reach no others."""
    bound = LinearSystem.of(modal.fcc(cells=(7, 7, 20))).shifted(-1.0)
    free = sp.block_diag([bound, sp.identity(3000)], format="csr")
    mixed = np.random.default_rng(3).permutation(free.shape[0])
    alone = Shape.of(bound)
    among = Shape.of(free[mixed][:, mixed])
    assert among.layer < alone.layer


def test_places_along_a_wide_packing_narrow_its_front():
    """Compare the front of a cube with and without the heights of its spheres.

    From one sphere on, layers of a cube are oblique; by height they are flat. A row of the flat
    band reaches no further than the end of the next layer of 100 spheres. The inertia does not
    depend on the order.
    """
    system = LinearSystem.of(modal.fcc(cells=(10, 10, 12)))
    matrix = system.shifted(1e10)
    height = np.repeat(system.network.position[:, 2], 6)
    mixed = np.random.default_rng(4).permutation(system.size)
    matrix = matrix[mixed][:, mixed]
    height = height[mixed]
    reaches = [band(matrix, along)[1] for along in (None, height)]
    corner, flat = (np.sqrt(((reach - np.arange(system.size)) ** 2.0).mean()) for reach in reaches)
    assert flat < 2 * 6 * 100
    assert flat < 0.95 * corner
    counts = [factorise(matrix, solver="blocks", kept=False, along=x) for x in (None, height)]
    assert counts[0].negative == counts[1].negative


@pytest.mark.parametrize("solver", HERE)
def test_too_little_memory_is_refused(solver, monkeypatch):
    matrix = LinearSystem.of(modal.fcc(cells=(4, 4, 10))).shifted(-1.0)
    monkeypatch.setattr("modal.tools.workload.memory_at_hand", lambda: 1e3)
    with refusal("too_large"):
        factorise(matrix, solver=solver)


@pytest.mark.parametrize("solver", ["superlu", "blocks"])
def test_memory_is_that_of_the_factor(solver):
    """Compare the estimate with the factor, within a factor of three.

    `test_effort` compares PARDISO's estimate with measurements.
    """
    matrix = LinearSystem.of(modal.fcc(cells=(8, 8, 20))).shifted(-1.0)
    cost = named(solver).cost(Shape.of(matrix), True).bytes
    if solver == "superlu":
        options = {"SymmetricMode": True}
        lu = splu(matrix.tocsc(), "MMD_AT_PLUS_A", diag_pivot_thresh=0, options=options)
        stored = 12 * (lu.L.nnz + lu.U.nnz)
    else:
        reach = reach_of(matrix, order_of(matrix))
        stored = 8 * (reach - np.arange(len(reach)) + 1).sum()
    assert 1 / 3 < cost / stored < 3
