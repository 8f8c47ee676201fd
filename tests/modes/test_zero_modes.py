"""Motions without energy: counted exactly, by kind, and those that many spheres share."""

from functools import cache, partial
from itertools import product

import numpy as np
import pytest
from changes import from_other_end, slippery
from oracles import dense_squares
from packings import diluted, sliding
from refusals import refusal
from scipy.linalg import eigvals_banded
from scipy.sparse.csgraph import connected_components

import modal
from modal.modes.collective import counted_floppy, every_floppy
from modal.modes.counts import count_below, counts_below
from modal.modes.eigenmodes import modes_of
from modal.modes.zero_modes import _adjacency, by_structure
from modal.packing import crystal as gallery
from modal.packing.network import Network
from modal.solvers.factor import Cost, available, direct_solvers
from modal.system.linear_system import Limits, LinearSystem, frequency_of


def zero_modes(system: LinearSystem) -> int:
    """Return the rank deficiency of the dense matrix.

    Round-off is some 1e-14 of the largest eigenvalue.
    """
    square = dense_squares(system)
    return int((square < 1e-11 * square[-1]).sum())


def without_walls(system: LinearSystem) -> int:
    """Return the rank deficiency of the spheres that no contacts join to a wall."""
    network = system.network
    cluster = connected_components(_adjacency(network), directed=False)[1]
    rows = np.repeat(~np.isin(cluster, cluster[network.particle_i[network.with_wall]]), system.dof)
    square = np.linalg.eigvalsh(system.dynamical_matrix.toarray()[rows][:, rows])
    return int((square < 1e-11 * system.row_sum_bound).sum())


WITH_ROTATIONS = [(*case, False) for case in product((0.3, 0.6, 0.85), (1, 2, 3))]
WITHOUT_ROTATIONS = [(0.8, 2, True), (0.9, 2, True)]


@pytest.mark.two_ways
@pytest.mark.parametrize(
    ("share", "seed", "translations_only"), [*WITH_ROTATIONS, *WITHOUT_ROTATIONS]
)
def test_floppy_modes_of_a_diluted_crystal(share, seed, translations_only):
    """Check that the zero modes of the structure are exact, orthonormal and complete.

    They are complete because these clusters are small. Without rotations a single contact with both
    springs holds a sphere, so that only clusters are free.
    """
    system = LinearSystem.of(diluted(share, seed), translations_only=translations_only)
    floppy = by_structure(system)
    scale = system.dynamical_matrix.diagonal().max()
    assert abs((system.dynamical_matrix @ floppy.basis).toarray()).max(initial=0.0) < 1e-11 * scale
    gram = (floppy.basis.T @ floppy.basis).toarray()
    assert gram == pytest.approx(np.eye(len(gram)), abs=1e-10)
    assert sum(floppy.kinds.values()) == floppy.total == zero_modes(system)
    loose = floppy.kinds["free_particles"] + floppy.kinds["loose_clusters"]
    assert loose == without_walls(system)
    assert floppy.total or share < 0.5


def test_parts_too_large_for_a_dense_null_space_count_as_held():
    """Check that large clusters count as held: fewer zero modes, but still exact ones.

    The count below a frequency has all of them.
    """
    network = diluted(0.5, 1)
    floppy = by_structure(LinearSystem.of(network))
    system = LinearSystem.of(diluted(0.5, 1), limits=Limits(piece=1))
    assert 0 < by_structure(system).kinds["hinged"] < floppy.kinds["hinged"]
    assert by_structure(system).kinds["free_particles"] == floppy.kinds["free_particles"]
    basis = by_structure(system).basis
    scale = system.dynamical_matrix.diagonal().max()
    assert abs((system.dynamical_matrix @ basis).toarray()).max() < 1e-11 * scale
    assert count_below(system, 1.0) == floppy.total


def test_zero_modes_are_kept_for_their_limits():
    """Ask one packing under two limits: the answers are kept apart."""
    network = diluted(0.5, 1)
    systems = [LinearSystem.of(network, limits=limits) for limits in (Limits(), Limits(piece=1))]
    hinged = [by_structure(system).kinds["hinged"] for system in systems]
    assert hinged == [5, 4]


def test_each_kind_is_named():
    """Count the zero modes of spheres without a contact (6), with one (3) and with two (1)."""
    network = gallery.column(4)
    i = network.particle_i
    j = network.particle_j
    free = network.with_contacts((i != 3) & (j != 3))
    kinds = by_structure(LinearSystem.of(free)).kinds
    assert kinds["free_particles"] == 6
    # Sphere 2 hangs on one contact. 0 and 1 turn about the axis, 2 about its contact point, and
    # the whole hanging column swings about the wall: dense rank says how many.
    assert sum(kinds.values()) == zero_modes(LinearSystem.of(free))
    single = network.with_contacts(np.flatnonzero(j == -1))
    kinds = by_structure(LinearSystem.of(single)).kinds
    assert {name: n for name, n in kinds.items() if n} == {"free_particles": 18, "hinged": 3}


@pytest.mark.two_ways
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("periodic", ["x and y", "x", "none"])
def test_cluster_without_walls_moves_as_a_whole(periodic, share):
    """Count three translations, and the rotations that the periods leave.

    One period leaves the rotation about its own axis, two leave none. The order of the two bodies
    of a contact does not matter.
    """
    network = gallery.fcc(cells=(4, 4, 5))
    inside = network.particle_j >= 0
    if periodic != "x and y":
        inside &= network.cell_shift[:, 1] == 0
    if periodic == "none":
        inside &= network.cell_shift[:, 0] == 0
    network = network.with_contacts(inside)
    reversed_contacts = np.random.default_rng(1).random(network.n_contacts) < share
    system = LinearSystem.of(from_other_end(network, reversed_contacts))
    floppy = by_structure(system)
    rigid = {"x and y": 3, "x": 4, "none": 6}[periodic]
    assert floppy.kinds["loose_clusters"] == rigid
    assert floppy.total == zero_modes(system)


SLIPPERY = {0.3: 1, 0.45: 4, 0.5: 19}
"""Of contacts left out of a crystal without tangential springs: the zero modes of 672 that
structure does not show, with 1.33, 1.03 and 0.95 springs for each motion that it leaves."""
DILUTED = {(0.6, 1): 1, (0.62, 2): 1, (0.65, 1): 1, (0.7, 2): 5, (0.7, 3): 35}
"""The same with all springs, by share and seed."""
CASES = SLIPPERY | DILUTED


def packing(case: float | tuple[float, int]) -> Network:
    """Return a new crystal of 112 spheres that has lost contacts."""
    if isinstance(case, tuple):
        return diluted(*case, 7)
    return slippery(diluted(case, 1, 7))


@cache
def by_dense_solver(case: float | tuple[float, int]) -> tuple[int, np.ndarray]:
    """Return the number of zero modes, and the frequencies of all other modes, Hz."""
    system = LinearSystem.of(packing(case))
    assert system.size > Limits().small
    square = np.linalg.eigvalsh(system.dynamical_matrix.toarray())
    zero = int((abs(square) < 1e-12 * square[-1]).sum())
    assert square[zero] > 1e-8 * square[-1]  # nothing between
    return zero, frequency_of(square[zero:])


def middle(frequency: np.ndarray, after: int) -> float:
    """Return a frequency in the middle of the gap after the first `after` frequencies."""
    return float(frequency[after - 1 : after + 1].mean())


NUMBERS_OF_ZERO_MODES = {
    "count": lambda network: modal.count_modes(network, 1e-3),
    "exact density": lambda network: modal.density_of_states(network).zero_modes.sum(),
    "density": lambda network: modal.density_of_states(network, tolerance=0.3).zero_modes.sum(),
    "description": lambda network: number_in_description(network),
    "all modes": lambda network: modal.eigenmodes(network, all=True).floppy_modes,
}
"""Functions that return the number of zero modes."""


def number_in_description(network: Network) -> int:
    """Return the number of floppy modes that the description of a packing states."""
    return int(modal.describe(network).split("floppy modes")[1].split()[0])


def expected_lists(elastic: np.ndarray) -> list[tuple[dict, np.ndarray]]:
    """Return requests for lists of modes, each with the frequencies, Hz, that it must have."""
    many = len(elastic) // 2
    low = middle(elastic, 20)
    high = middle(elastic, many)
    return [
        ({"highest": 5}, elastic[-5:]),
        ({"highest": 300}, elastic[-300:]),
        ({"lowest": many}, elastic[:many]),
        ({"lowest": 32}, elastic[:32]),
        ({"lowest": 5}, elastic[:5]),
        ({"below": high}, elastic[:many]),
        ({"between": (1e-6, high)}, elastic[:many]),
        ({"between": (low, high)}, elastic[20:many]),
    ]


@pytest.mark.parametrize("case", CASES)
def test_every_answer_has_the_same_number_of_zero_modes_in_any_order(case):
    """Compare lists, dense or not, counts, densities of states and descriptions.

    One packing answers all of them; every second packing is asked in the reverse order.
    """
    zero, elastic = by_dense_solver(case)
    questions = [*expected_lists(elastic), *NUMBERS_OF_ZERO_MODES.values()]
    if [*CASES].index(case) % 2 == 0:
        questions.reverse()
    network = packing(case)
    for question in questions:
        if callable(question):
            assert question(network) == pytest.approx(zero, rel=1e-12)
        else:
            request, expected = question
            modes = modal.eigenmodes(network, **request)
            assert modes.certified
            assert modes.floppy_modes == zero
            assert modes.missing == 0
            assert modes.frequency == pytest.approx(expected, rel=1e-6)


@pytest.mark.two_ways
@pytest.mark.parametrize("case", CASES)
def test_basis_with_collective_modes_is_exact_and_orthonormal(case, monkeypatch):
    """Check the basis with collective modes.

    They are counted at any size if there are fewer springs than motions, or if contacts slip.
    """
    if case not in [*DILUTED][:3]:
        monkeypatch.setattr("modal.modes.collective.MAX_EASY_OPERATIONS", 0.0)
    system = LinearSystem.of(packing(case))
    floppy = every_floppy(system)
    assert floppy.kinds["collective"] == CASES[case] == floppy.total - by_structure(system).total
    assert sum(floppy.kinds.values()) == floppy.total == by_dense_solver(case)[0]
    assert (
        abs((system.dynamical_matrix @ floppy.basis).toarray()).max()
        < 1e-13 * system.diagonal.max()
    )
    gram = (floppy.basis.T @ floppy.basis).toarray()
    assert gram == pytest.approx(np.eye(floppy.total), abs=1e-12)


def test_more_zero_modes_than_there_are_are_not_made_up(monkeypatch):
    """Let a count be too large by one: the search for the missing mode is refused."""
    count = by_dense_solver(0.5)[0]
    monkeypatch.setattr("modal.modes.collective.count_below", lambda _, f: (count + 1) * (f > 0))
    with refusal("not_converged"):
        counted_floppy(LinearSystem.of(packing(0.5)))


@pytest.mark.parametrize(
    "make", [lambda: packing((0.65, 1)), partial(sliding, 100), partial(sliding, 0.3)]
)
def test_one_count_at_its_end_tells_a_list_what_lies_at_zero(monkeypatch, make):
    """Find zero modes by the count at the end of a list if they were not counted before.

    Large packings with enough springs skip the count. Here they have a zero mode that structure
    does not show, two modes at a thousandth of the first wave, or two sliding motions.
    """
    monkeypatch.setattr("modal.modes.collective.MAX_EASY_OPERATIONS", 0.0)
    assert every_floppy(LinearSystem.of(diluted(0.75, 1))).counted  # as many springs as motions
    square = dense_squares(LinearSystem.of(make()))
    zero = int((square < 1e-11 * square[-1]).sum())
    elastic = frequency_of(square[zero:])
    assert modal.density_of_states(make(), tolerance=0.3).counted is False
    high = {"below": middle(elastic, 8)}
    for question, lifted in (({"lowest": 8}, False), (high, False), (high, True)):
        network = make()
        limits = Limits(dense=0 if lifted else 6000)
        if lifted:
            monkeypatch.setattr("modal.modes.effort.near_a_shift", lambda *_: Cost(0.0, 1e19, 0.0))

        modes = modes_of(LinearSystem.of(network, limits=limits), **question)
        assert modes.certified
        assert modes.floppy_modes == zero
        assert ("products" in modes.attributes["solver"]) is lifted
        # Both solutions know omega^2 to n eps of the largest one, and f to half of that each.
        round_off = len(square) * np.finfo(float).eps
        error = round_off * (elastic[-1] / elastic[:8]) ** 2
        assert (abs(modes.frequency / elastic[:8] - 1) < error).all()
        # What is kept of a network is kept for the limits that it was asked with.
        assert every_floppy(LinearSystem.of(network, limits=limits)).counted
        if lifted:
            continue
        states = modal.density_of_states(network, tolerance=0.3)
        assert states.counted
        assert states.zero_modes.sum() == pytest.approx(zero, rel=1e-12)
        assert "at least" not in modal.describe(network)


@pytest.mark.two_ways
def test_a_long_chain_without_side_contacts():
    """Compare a chain with a hand-made matrix of its axial springs.

    Each contact has three springs. Along the axis there is one spring more than motions; all other
    motions are free.
    """
    chain = gallery.column(130)
    zero = 6 * 130 - 3 * chain.n_contacts + 1
    modes = modal.eigenmodes(chain, lowest=4)
    # Axial motion alone has energy at low frequency: springs 2 k at the walls, k between.
    k = chain.stiffness_normal[1]
    mass = chain.mass[0]
    matrix = np.zeros((2, 130))
    matrix[0] = 2 * k
    matrix[0, [0, -1]] = k + chain.stiffness_normal[[0, -1]]
    matrix[1] = -k
    assert modes.certified
    assert modes.floppy_modes == zero
    axial = np.sqrt(eigvals_banded(matrix, lower=True)[:4] / mass) / (2 * np.pi)
    along = modes.chi_z > 0.99
    assert along.any()
    assert modes.frequency[along] == pytest.approx(axial[: along.sum()], rel=1e-6)
    between = modal.eigenmodes(chain, between=(1.0, modes.frequency[1]))
    assert between.certified
    assert between.floppy_modes == zero


@pytest.mark.parametrize("way", ["slices", "a polynomial"])
def test_long_lists_that_start_at_zero(monkeypatch, way):
    """Find a list from zero by slices and by a polynomial.

    Vectors of zero frequency that come back are no elastic modes.
    """
    zero, elastic = by_dense_solver(0.5)
    slices = way == "slices"
    if not slices:
        monkeypatch.setattr("modal.modes.effort.near_a_shift", lambda *_: Cost(0.0, 1e19, 0.0))
    limits = Limits(dense=0, part=1, slice=40 if slices else 700)
    solver = "superlu"
    system = LinearSystem.of(packing(0.5), solver=solver if slices else None, limits=limits)
    modes = modes_of(system, **({"lowest": 100} if slices else {"below": middle(elastic, 100)}))
    assert ("products" in modes.attributes["solver"]) is not slices
    assert modes.frequency == pytest.approx(elastic[:100], rel=1e-6)
    assert modes.certified
    assert modes.floppy_modes == zero


@pytest.mark.two_ways
@pytest.mark.parametrize("solver", direct_solvers())
def test_counts_just_above_zero_are_those_of_the_zero_modes(solver):
    """Count at frequencies whose omega^2 is below the round-off of a factorisation."""
    if not available(solver):
        pytest.skip("pypardiso is not installed")
    system = LinearSystem.of(packing(0.5), solver=solver)
    counts = counts_below(system, [1e-9, 1e-6, 1e-3, 0.1, 1.0])
    assert counts.tolist() == [by_dense_solver(0.5)[0]] * 5
