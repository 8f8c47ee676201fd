"""Multigrid: its solutions, modes and moduli against those of direct factors; its steps."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse as sp
from packings import diluted, disordered, sheared
from refusals import refusal
from scipy.linalg import eigh
from scipy.sparse.linalg import spsolve

import modal
from modal.elasticity import steady
from modal.modes.eigenmodes import modes_of
from modal.modes.soft_motions import soft_motions
from modal.solvers import factor as registry
from modal.solvers.factor import Cost, available, named
from modal.solvers.factorisations import multigrid
from modal.system.linear_system import Limits, LinearSystem


def without_friction():
    """Return a disordered crystal whose contacts slide: its spheres turn without energy."""
    network = disordered((3, 3, 12))
    return replace(network, stiffness_tangential=np.zeros(network.n_contacts))


def with_held_spheres():
    """Return a disordered crystal in which some spheres cannot move along x, or not turn at all."""
    network = disordered((3, 3, 12))
    fixed = np.zeros((network.n_particles, 6), bool)
    fixed[::7, 0] = True
    fixed[::5, 3:] = True
    return replace(network, fixed=fixed)


def in_a_plane():
    """Return a disordered crystal whose spheres move along x and z, and turn about y, alone."""
    network = disordered((3, 3, 12))
    fixed = np.zeros((network.n_particles, 6), bool)
    fixed[:, [1, 3, 5]] = True
    return replace(network, fixed=fixed)


def many_grains():
    """Return 27 parts of a disordered crystal that do not touch each other."""
    network = disordered((6, 6, 6))
    edges = np.linspace(0, 1, 4)[1:-1]
    place = (network.position - network.position.min(axis=0)) / np.ptp(network.position, axis=0)
    part = np.digitize(place, edges) @ [1, 3, 9]
    is_inside = part[network.particle_i] == part[network.partner]
    return network.with_contacts(is_inside | network.with_wall)


needs_pyamg = pytest.mark.skipif(not available("multigrid"), reason="needs PyAMG and numba")
PACKINGS = {
    "walls": lambda: LinearSystem.of(disordered((3, 3, 12))),
    "periodic": lambda: LinearSystem.of(modal.fcc(cells=(4, 4, 4), periodic_z=True)),
    "loose": lambda: LinearSystem.of(diluted(0.4, 1, 12)),
    "frictionless": lambda: LinearSystem.of(without_friction()),
    "held": lambda: LinearSystem.of(with_held_spheres()),
    "in a plane": lambda: LinearSystem.of(in_a_plane()),
    "apart": lambda: LinearSystem.of(many_grains()),
    "pre-stressed": lambda: LinearSystem.of(modal.fcc(cells=(3, 3, 8)), pre_stress="normal"),
}


@pytest.fixture(autouse=True)
def several_levels(monkeypatch):
    """Let small packings have several levels: usually the factor of a thousand rows ends them."""
    if available("multigrid"):
        monkeypatch.setattr("modal.solvers.hierarchy.MAX_COARSEST_ROWS", 100)


@pytest.fixture(scope="module", params=PACKINGS)
def system(request):
    return PACKINGS[request.param]()


def factor_of(system, shift=1e-7):
    """Return the multigrid solver of A + shift times its largest diagonal entry, and this sum."""
    square = -shift * system.diagonal.max()
    factor = system.factorised(square, definite=True, solver="multigrid", soft=soft_motions(system))
    return factor, system.shifted(square)


@needs_pyamg
def test_solutions_equal_those_of_a_direct_factor(system):
    """Compare motions, also those without energy.

    The relative error in energy is 1e-11. Eigenvalues lie between 1e-7 and 1 of the largest; the
    error of a motion may be larger by the root of their ratio, 3e3.
    """
    factor, matrix = factor_of(system)
    load = np.random.default_rng(1).standard_normal((system.size, 3))
    solution = factor.solve(load)
    exact = spsolve(matrix.tocsc(), load)
    assert np.linalg.norm(solution - exact) <= 1e-7 * np.linalg.norm(exact)
    free = soft_motions(system).free
    elastic = load - free @ (free.T @ load)
    residual = matrix @ factor.solve(elastic) - elastic
    assert np.linalg.norm(residual) <= 1e-8 * np.linalg.norm(elastic)
    assert factor.solve(load[:, 0]) == pytest.approx(solution[:, 0], rel=1e-6, abs=1e-9)
    assert factor.negative is None


@needs_pyamg
def test_a_cycle_is_linear_symmetric_and_positive(system):
    """Check what conjugate gradients rely on; columns do not notice each other.

    Single precision rounds at 6e-8; sums of many entries may lose a further digit.
    """
    factor, _ = factor_of(system)
    basis = soft_motions(system).free
    load = np.random.default_rng(2).standard_normal((system.size, 11))
    load -= basis @ (basis.T @ load)
    result = factor.precondition(load)
    products = load.T @ result
    assert products == pytest.approx(products.T, rel=1e-5, abs=1e-6 * abs(products).max())
    assert eigh(products, eigvals_only=True).min() > 0
    alone = factor.precondition(load[:, 3:4])
    assert np.linalg.norm(alone - result[:, 3:4]) <= 1e-6 * np.linalg.norm(alone)
    mixed = load @ np.ones((11, 1))
    total = result.sum(axis=1, keepdims=True)
    assert np.linalg.norm(factor.precondition(mixed) - total) <= 1e-5 * np.linalg.norm(total)


@needs_pyamg
@pytest.mark.parametrize("enough", [1, 10**6])
def test_sweeps_are_those_of_gauss_seidel(enough, monkeypatch):
    """Compare the sweeps of a level, in several slabs or one, with triangular solutions.

    Slabs of the same half do not touch, so that their order makes no difference.
    """
    from modal.solvers.block_matrices import scale_to_unit_blocks
    from modal.solvers.hierarchy import Level

    monkeypatch.setattr("modal.solvers.hierarchy.ENOUGH", enough)
    monkeypatch.setattr("modal.tools.slabs.ENOUGH", enough)
    system = LinearSystem.of(disordered((3, 3, 12)))
    matrix = system.shifted(-1e-3 * system.diagonal.max()).tobsr((6, 6))
    scale_to_unit_blocks(matrix)
    level = Level.of(matrix)
    order, bounds, halves = level.slabs
    assert (len(bounds) > 2) == (enough == 1)
    rows = (6 * order[:, None] + np.arange(6)).ravel()
    A = matrix.toarray()[np.ix_(rows, rows)]
    body = np.arange(len(rows)) // 6
    slab = np.repeat(np.arange(len(bounds) - 1), np.diff(bounds))[body]
    for first, last in pairwise(halves):
        of_half = np.flatnonzero((first <= slab) & (slab < last))
        same_slab = slab[of_half, None] == slab[of_half]
        assert (A[np.ix_(of_half, of_half)] == 0)[~same_slab].all()
    lower = A * (body[:, None] > body)
    load = np.random.default_rng(4).standard_normal((len(order), 6, 8)).astype(np.float32)
    by_row = load.reshape(-1, 8)
    solution, residual = level.smooth(load)
    exact = np.linalg.solve(lower + np.eye(len(A)), by_row)
    assert solution.reshape(-1, 8) == pytest.approx(exact, rel=1e-4, abs=1e-5)
    assert residual.reshape(-1, 8) == pytest.approx(by_row - A @ exact, rel=1e-4, abs=1e-5)
    level.smooth_back(solution, load)
    exact = np.linalg.solve(lower.T + np.eye(len(A)), by_row - lower @ exact)
    assert solution.reshape(-1, 8) == pytest.approx(exact, rel=1e-4, abs=1e-5)


@needs_pyamg
def test_eliminated_bodies_do_not_touch_and_the_others_are_stiff(monkeypatch):
    """Solve in one cycle with one level: with the inverse of what remains elimination is exact."""
    from modal.solvers import elimination
    from modal.solvers.block_matrices import own_blocks, some_blocks

    system = LinearSystem.of(diluted(0.4, 1, 12))
    matrix = system.shifted(-1e-3 * system.diagonal.max()).tobsr((6, 6))
    every = np.arange(matrix.shape[0] // 6)
    monkeypatch.setattr(elimination, "MIN_STIFFNESS", 0.7)
    monkeypatch.setattr(elimination, "MAX_LATER_CONTACTS", 8)
    parts = elimination.eliminate(matrix.copy())
    first, *others = parts.rounds
    blocks = some_blocks(matrix, first.bodies, first.bodies)
    assert len(first.bodies) > 10
    assert len(blocks.data) == len(first.bodies)
    assert (np.diff(matrix.indptr)[first.bodies] <= 1 + elimination.MAX_CONTACTS).all()
    out = np.concatenate([each.bodies for each in parts.rounds])
    assert len(others) > 0
    contacts = [np.bincount(each.coupling.indices) for each in others]
    assert np.concatenate(contacts).max() == 8
    assert sorted([*out, *parts.remaining]) == every.tolist()
    unit = np.tile(np.eye(6), (len(parts.remaining), 1, 1))
    assert own_blocks(parts.schur) == pytest.approx(unit, abs=1e-9)
    load = np.random.default_rng(3).standard_normal((system.size, 3))
    for most in (100, 10**6):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("modal.solvers.hierarchy.MAX_COARSEST_ROWS", most)
            motions = soft_motions(system).rigid
            inverse = elimination.EliminationHierarchy(matrix.copy(), motions, every[::-1])
        residual = np.linalg.norm(matrix @ inverse.apply(load) - load) / np.linalg.norm(load)
        assert (residual < 1e-4) == (most == 10**6)


@needs_pyamg
def test_stiffness_of_pairs_is_that_of_their_own_matrices():
    """Compare with the eigenvalues of the two bodies' 12 x 12 part of the matrix, one by one."""
    from modal.solvers.block_matrices import scale_to_unit_blocks
    from modal.solvers.elimination import pair_stiffness

    system = LinearSystem.of(diluted(0.4, 1, 12))
    matrix = system.shifted(-1e-3 * system.diagonal.max()).tobsr((6, 6))
    scale_to_unit_blocks(matrix)
    blocks = matrix.toarray().reshape(-1, 6, matrix.shape[0] // 6, 6).swapaxes(1, 2)
    softest = np.full(len(blocks), np.inf)
    for one, other in np.argwhere(blocks.any(axis=(2, 3))):
        if one != other:
            pair = blocks[np.ix_([one, other], [one, other])].swapaxes(1, 2).reshape(12, 12)
            softest[one] = min(softest[one], np.linalg.eigvalsh(pair)[0])
    most = np.median(softest)
    computed = pair_stiffness(matrix, most)
    is_soft = softest < most
    assert 0 < is_soft.sum() < len(blocks)
    assert computed[is_soft] == pytest.approx(softest[is_soft], abs=1e-12)
    assert (computed[~is_soft] > most - 1e-12).all()


@needs_pyamg
def test_loosely_held_pairs_are_eliminated():
    """Let bodies 0 and 1 hold each other a thousand times as much as six others and the ground do.

    Each alone is stiff. The last body, with one contact, starts the rounds.
    """
    from modal.solvers.elimination import eliminate

    springs = np.full((8, 8), 1e-3)
    springs[0, 1] = springs[1, 0] = 1
    springs[7, 1:] = springs[1:, 7] = 0
    stiffness = np.diag(springs.sum(axis=1)) - springs * (1 - np.eye(8))
    assert np.linalg.eigvalsh(stiffness)[0] > 0
    matrix = sp.bsr_matrix(np.kron(stiffness, np.eye(6)), blocksize=(6, 6))
    parts = eliminate(matrix)
    assert parts.rounds[0].bodies.tolist() == [7]
    assert parts.rounds[1].bodies.tolist() in ([0], [1])


@needs_pyamg
def test_bodies_with_the_fewest_contacts_are_eliminated_first():
    """Take the ends of a star of three contacts, not its centre, which has as few as is allowed."""
    from modal.solvers.elimination import independent_bodies

    touching = np.eye(4)
    touching[0] = touching[:, 0] = 1
    matrix = sp.bsr_matrix(np.kron(touching, np.eye(6)), blocksize=(6, 6))
    contacts = np.diff(matrix.indptr) - 1
    assert independent_bodies(matrix, contacts, 3).tolist() == [1, 2, 3]


@needs_pyamg
def test_a_hierarchy_is_the_same_every_time():
    """Apply two hierarchies of one matrix; PyAMG's random vectors are the same, and given back."""
    system = LinearSystem.of(disordered((3, 3, 12)))
    load = np.random.default_rng(5).standard_normal((system.size, 2))
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    one, another = (factor_of(system)[0].precondition(load) for _ in range(2))
    assert (one == another).all()
    assert (np.random.get_state()[1] == before).all()  # noqa: NPY002


@needs_pyamg
def test_steps_do_not_grow_with_the_packing(monkeypatch):
    """Solve for a crystal with random stiffnesses and for one of eight times the spheres.

    Without coarser matrices the number of steps would double with the length.
    """
    products = []
    solve = multigrid.conjugate_gradients

    def counted(*arguments, **options):
        solution = solve(*arguments, **options)
        products.append(solution.products)
        return solution

    monkeypatch.setattr(multigrid, "conjugate_gradients", counted)
    for cells in ((6, 6, 12), (12, 12, 24)):
        system = LinearSystem.of(disordered(cells))
        factor, _ = factor_of(system, shift=1e-9)
        factor.solve(np.random.default_rng(1).standard_normal((system.size, 2)))
    assert products[1] <= 1.3 * products[0]


@needs_pyamg
def test_lowest_modes_equal_those_of_whole_matrices():
    """Compare frequencies to 1e-9, whether the modes are counted or not.

    A list without a count says what supports it. The number that moments expect is within four
    standard errors and the width of their kernel.
    """
    network = disordered((3, 3, 12))
    exact = modal.eigenmodes(network, all=True)
    elastic = exact.frequency[exact.frequency > 1e-3 * exact.frequency[-1]]
    limits = Limits(small=0, dense=0)
    for certify in (True, False):
        system = replace(LinearSystem.of(network, solver="multigrid"), limits=limits)
        modes = modes_of(system, lowest=12, certify=certify)
        assert modes.frequency == pytest.approx(elastic[:12], rel=1e-9)
        assert "multigrid" in modes.attributes["solver"]
        assert modes.certified == certify
        assert modes.missing == 0
        assert ("expected_modes" in modes.attributes) == (not certify)
    noted = modes.attributes
    assert noted["found_by_second_search"] == 0
    last = modes.frequency[-1]
    low = (elastic < 0.9 * last).sum()
    high = (elastic < 1.1 * last).sum()
    margin = 4 * noted["expected_modes_error"]
    assert low - margin <= noted["expected_modes"] <= high + margin


@needs_pyamg
def test_moduli_equal_those_of_another_solver():
    """Compare for a packing with rattlers and walls."""
    by_multigrid = modal.elastic_moduli(sheared(), solver="multigrid", tolerance=1e-9)
    by_blocks = modal.elastic_moduli(sheared(), solver="gradients", tolerance=1e-9)
    scale = abs(by_blocks.stiffness).max()
    assert abs(by_multigrid.stiffness - by_blocks.stiffness).max() <= 1e-7 * scale
    assert by_multigrid.solver == "multigrid"


@needs_pyamg
@pytest.mark.parametrize("factor", ["absent", "cheap", "dear"])
def test_moduli_take_the_cheaper_of_multigrid_and_a_factor(factor, monkeypatch):
    """Take multigrid also where no factor is at hand, but not in small packings."""
    system = LinearSystem.of(disordered((3, 3, 12)))
    operations = {"absent": 0.0, "cheap": 0.0, "dear": 1e11}[factor]
    monkeypatch.setattr(steady, "available", lambda name: factor != "absent" or name == "multigrid")
    monkeypatch.setattr(steady, "factorisation", lambda *_, kept: Cost(0.0, operations))
    small = "gradients" if factor == "absent" else "pardiso"
    assert steady._faster_solver(system, 6) == small
    monkeypatch.setattr(steady, "MIN_MULTIGRID_ROWS", 0)
    assert steady._faster_solver(system, 6) == ("pardiso" if factor == "cheap" else "multigrid")


@needs_pyamg
def test_few_contacts_are_estimated_to_take_more_steps(monkeypatch):
    """Take a factor that costs more than the steps with many contacts, and less than with few."""
    system = LinearSystem.of(disordered((3, 3, 12)))
    monkeypatch.setattr(steady, "MIN_MULTIGRID_ROWS", 0)
    monkeypatch.setattr(steady, "available", lambda name: True)
    hierarchy = Cost(0.0, 0.0, approximation=1e6)
    monkeypatch.setattr(
        steady, "named", lambda name: replace(named(name), cost=lambda *_: hierarchy)
    )
    factor = Cost(0.0, 60 * 6 * 1e6)
    monkeypatch.setattr(steady, "factorisation", lambda *_, kept: factor)
    for few, solver in ((0, "multigrid"), (100, "pardiso")):
        monkeypatch.setattr(steady, "FEW_CONTACTS", few)
        assert steady._faster_solver(system, 6) == solver


def test_it_counts_no_modes_and_solves_below_them_alone():
    network = disordered((2, 2, 6))
    if not available("multigrid"):
        with refusal("not_installed"):
            modal.count_modes(network, 1e4, solver="multigrid")
        return
    with refusal("no_inertia"):
        modal.count_modes(network, 1e4, solver="multigrid")
    system = LinearSystem.of(network)
    with refusal("no_inertia"):
        system.factorised(1e8, solver="multigrid", soft=soft_motions(system))


def test_without_pyamg_all_goes_as_before(monkeypatch):
    """Compute and count the lowest modes by a factor; refuse a request for multigrid."""

    def load():
        raise ImportError("pyamg")

    broken = replace(named("multigrid"), load=load)
    monkeypatch.setattr("modal.solvers.factorisations.multigrid.FACTORISATION", broken)
    registry._loads.cache_clear()
    try:
        network = disordered((2, 2, 8))
        assert not available("multigrid")
        system = replace(LinearSystem.of(network), limits=Limits(small=0, dense=0))
        assert modes_of(system, lowest=3).certified
        with_multigrid = replace(system, solver="multigrid")
        with refusal("not_installed"):
            modes_of(with_multigrid, lowest=3)
    finally:
        registry._loads.cache_clear()
