"""Motions without energy: counted exactly, by kind, and those that many spheres share."""

from functools import cache, partial

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

pytestmark = pytest.mark.two_ways


def zero_modes(system: LinearSystem) -> int:
    """Rank deficiency of the dense matrix; round-off is some 1e-14 of the largest eigenvalue."""
    square = dense_squares(system)
    return int((square < 1e-11 * square[-1]).sum())


def without_walls(system: LinearSystem) -> int:
    """The same of the spheres that no contacts join to a wall."""
    network = system.network
    part = connected_components(_adjacency(network), directed=False)[1]
    rows = np.repeat(~np.isin(part, part[network.particle_i[network.with_wall]]), system.dof)
    square = np.linalg.eigvalsh(system.dynamical_matrix.toarray()[rows][:, rows])
    return int((square < 1e-11 * system.row_sum_bound).sum())


@pytest.mark.parametrize(
    ("share", "seed", "translations_only"),
    [*((share, seed, False) for share in (0.3, 0.6, 0.85) for seed in (1, 2, 3))]
    + [(0.8, 2, True), (0.9, 2, True)],
)
def test_floppy_modes_of_a_diluted_crystal(share, seed, translations_only):
    """Structure gives exact zero modes, orthonormal, and (these parts are small) all of them.

    Without rotations a single contact with both springs holds a sphere: only clusters are free.
    """
    system = LinearSystem.of(diluted(share, seed), translations_only=translations_only)
    floppy, scale = by_structure(system), system.dynamical_matrix.diagonal().max()
    assert abs((system.dynamical_matrix @ floppy.basis).toarray()).max(initial=0.0) < 1e-11 * scale
    gram = (floppy.basis.T @ floppy.basis).toarray()
    assert gram == pytest.approx(np.eye(len(gram)), abs=1e-10)
    assert sum(floppy.kinds.values()) == floppy.total == zero_modes(system)
    loose = floppy.kinds["free_particles"] + floppy.kinds["loose_clusters"]
    assert loose == without_walls(system)
    assert floppy.total or share < 0.5


def test_parts_too_large_for_a_dense_null_space_count_as_held():
    """What is left is a part of the zero modes, still exact; the counts tell how many there are."""
    network = diluted(0.5, 1)
    everything = by_structure(LinearSystem.of(network))
    system = LinearSystem.of(diluted(0.5, 1), limits=Limits(piece=1))
    assert 0 < by_structure(system).kinds["hinged"] < everything.kinds["hinged"]
    assert by_structure(system).kinds["free_particles"] == everything.kinds["free_particles"]
    basis, scale = by_structure(system).basis, system.dynamical_matrix.diagonal().max()
    assert abs((system.dynamical_matrix @ basis).toarray()).max() < 1e-11 * scale
    assert count_below(system, 1.0) == everything.total


def test_zero_modes_are_kept_for_their_limits():
    """A network keeps what it was asked with one size of parts apart from that with another."""
    network = diluted(0.5, 1)
    systems = [LinearSystem.of(network, limits=limits) for limits in (Limits(), Limits(piece=1))]
    hinged = [by_structure(system).kinds["hinged"] for system in systems]
    assert hinged == [5, 4]


def test_each_kind_is_named():
    """A free sphere has six zero modes, one on one contact three, one on two contacts one."""
    network = gallery.column(4)
    i, j = network.particle_i, network.particle_j
    free = network.with_contacts((i != 3) & (j != 3))
    kinds = by_structure(LinearSystem.of(free)).kinds
    assert kinds["free_particles"] == 6
    # Sphere 2 hangs on one contact. 0 and 1 turn about the axis, 2 about its contact point, and
    # the whole hanging column swings about the wall: dense rank says how many.
    assert sum(kinds.values()) == zero_modes(LinearSystem.of(free))
    single = network.with_contacts(np.flatnonzero(j == -1))
    kinds = by_structure(LinearSystem.of(single)).kinds
    assert {name: n for name, n in kinds.items() if n} == {"free_particles": 18, "hinged": 3}


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("periodic", ["x and y", "x", "none"])
def test_cluster_without_walls_moves_as_a_whole(periodic, share):
    """Three translations; of the rotations a period leaves one about its own axis, or none.

    Whichever body of a contact comes first.
    """
    network = gallery.fcc(cells=(4, 4, 5))
    inside = network.particle_j >= 0
    if periodic != "x and y":
        inside &= network.cell_shift[:, 1] == 0
    if periodic == "none":
        inside &= network.cell_shift[:, 0] == 0
    network = network.with_contacts(inside)
    other = np.random.default_rng(1).random(network.n_contacts) < share
    system = LinearSystem.of(from_other_end(network, other))
    floppy, rigid = by_structure(system), {"x and y": 3, "x": 4, "none": 6}[periodic]
    assert floppy.kinds["loose_clusters"] == rigid and floppy.total == zero_modes(system)


SLIPPERY = {0.3: 1, 0.45: 4, 0.5: 19}
"""Of contacts left out of a crystal without tangential springs: the zero modes of 672 that
structure does not show, with 1.33, 1.03 and 0.95 springs for each motion that it leaves."""
DILUTED = {(0.6, 1): 1, (0.62, 2): 1, (0.65, 1): 1, (0.7, 2): 5, (0.7, 3): 35}
"""The same with all springs, by share and seed."""
CASES = SLIPPERY | DILUTED


def packing(case: float | tuple[float, int]) -> Network:
    """A crystal of 112 spheres that has lost contacts; made anew: nothing is known of it."""
    if isinstance(case, tuple):
        return diluted(*case, 7)
    return slippery(diluted(case, 1, 7))


@cache
def by_dense_solver(case: float | tuple[float, int]) -> tuple[int, np.ndarray]:
    """How many zero modes there are, and the frequencies of all others, Hz."""
    system = LinearSystem.of(packing(case))
    assert system.size > Limits().small
    square = np.linalg.eigvalsh(system.dynamical_matrix.toarray())
    zero = int((abs(square) < 1e-12 * square[-1]).sum())
    assert square[zero] > 1e-8 * square[-1]  # nothing between
    return zero, frequency_of(square[zero:])


def middle(frequency: np.ndarray, after: int) -> float:
    """A frequency in the middle of the gap after so many."""
    return float(frequency[after - 1 : after + 1].mean())


@pytest.mark.parametrize("case", CASES)
def test_every_answer_has_the_same_number_of_zero_modes_in_any_order(case):
    """Lists, dense or not, counts, the density of states, what is printed of a packing.

    Every second case is asked the other way round.
    """
    zero, elastic = by_dense_solver(case)
    many = len(elastic) // 2
    low, high = middle(elastic, 20), middle(elastic, many)
    asked = [
        *(({"highest": n}, elastic[-n:]) for n in (5, 300)),
        *(({"lowest": n}, elastic[:n]) for n in (many, 32, 5)),
        *(({"below": high}, elastic[:many]), ({"between": (1e-6, high)}, elastic[:many])),
        ({"between": (low, high)}, elastic[20:many]),
        lambda network: modal.count_modes(network, 1e-3),
        lambda network: modal.density_of_states(network).zero_modes.sum(),
        lambda network: modal.density_of_states(network, tolerance=0.3).zero_modes.sum(),
        lambda network: int(modal.describe(network).split("floppy modes")[1].split()[0]),
        lambda network: modal.eigenmodes(network, all=True).floppy_modes,
    ]
    network = packing(case)
    for ask in asked[:: 1 if [*CASES].index(case) % 2 else -1]:
        if callable(ask):
            assert ask(network) == pytest.approx(zero, rel=1e-12)
            continue
        found = modal.eigenmodes(network, **ask[0])
        assert found.certified and found.floppy_modes == zero and found.missing == 0
        assert found.frequency == pytest.approx(ask[1], rel=1e-6)


@pytest.mark.parametrize("case", CASES)
def test_basis_with_collective_modes_is_exact_and_orthonormal(case, monkeypatch):
    """They are counted in any size where springs are fewer than motions, or contacts slip."""
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
    """A count that were wrong by one: the search for the missing one ends by name."""
    every = by_dense_solver(0.5)[0]
    monkeypatch.setattr("modal.modes.collective.count_below", lambda _, f: (every + 1) * (f > 0))
    with refusal("not_converged"):
        counted_floppy(LinearSystem.of(packing(0.5)))


@pytest.mark.parametrize(
    "make", [lambda: packing((0.65, 1)), partial(sliding, 100), partial(sliding, 0.3)]
)
def test_one_count_at_its_end_tells_a_list_what_lies_at_zero(monkeypatch, make):
    """Where it was not counted before, as in large packings that seem sound: a zero mode that
    structure does not show, two modes at a thousandth of the first wave, two sliding motions."""
    monkeypatch.setattr("modal.modes.collective.MAX_EASY_OPERATIONS", 0.0)
    assert every_floppy(LinearSystem.of(diluted(0.75, 1))).counted  # as many springs as motions
    square = dense_squares(LinearSystem.of(make()))
    zero = int((square < 1e-11 * square[-1]).sum())
    elastic = frequency_of(square[zero:])
    assert modal.density_of_states(make(), tolerance=0.3).counted is False
    high = {"below": middle(elastic, 8)}
    for question, lifted in (({"lowest": 8}, False), (high, False), (high, True)):
        network, limits = make(), Limits(dense=0 if lifted else 6000)
        if lifted:
            monkeypatch.setattr("modal.modes.effort.near_a_shift", lambda *_: Cost(0.0, 1e19, 0.0))

        found = modes_of(LinearSystem.of(network, limits=limits), **question)
        assert found.certified and found.floppy_modes == zero
        assert ("products" in found.attributes["solver"]) is lifted
        # omega^2 is known to round-off of the largest one.
        error = 1e-13 * (elastic[-1] / elastic[:8]) ** 2
        assert (abs(found.frequency / elastic[:8] - 1) < error).all()
        # What is kept of a network is kept for the limits that it was asked with.
        assert every_floppy(LinearSystem.of(network, limits=limits)).counted
        if lifted:
            continue
        states = modal.density_of_states(network, tolerance=0.3)
        assert states.counted and states.zero_modes.sum() == pytest.approx(zero, rel=1e-12)
        assert "at least" not in modal.describe(network)


def test_a_long_chain_without_side_contacts():
    """Three springs for a contact, one of them too many along the axis: the rest moves freely."""
    chain = gallery.column(130)
    zero = 6 * 130 - 3 * chain.n_contacts + 1
    found = modal.eigenmodes(chain, lowest=4)
    # Axial motion alone has energy at low frequency: springs 2 k at the walls, k between.
    k, mass = chain.stiffness_normal[1], chain.mass[0]
    matrix = np.zeros((2, 130))
    matrix[0] = 2 * k
    matrix[0, [0, -1]] = k + chain.stiffness_normal[[0, -1]]
    matrix[1] = -k
    assert found.certified and found.floppy_modes == zero
    axial = np.sqrt(eigvals_banded(matrix, lower=True)[:4] / mass) / (2 * np.pi)
    along = found.chi_z > 0.99
    assert along.any() and found.frequency[along] == pytest.approx(axial[: along.sum()], rel=1e-6)
    between = modal.eigenmodes(chain, between=(1.0, found.frequency[1]))
    assert between.certified and between.floppy_modes == zero


@pytest.mark.parametrize("way", ["slices", "a polynomial"])
def test_long_lists_that_start_at_zero(monkeypatch, way):
    """Cut into slices, or lifted by a polynomial: what comes back at zero is no elastic mode."""
    zero, elastic = by_dense_solver(0.5)
    slices = way == "slices"
    if not slices:
        monkeypatch.setattr("modal.modes.effort.near_a_shift", lambda *_: Cost(0.0, 1e19, 0.0))
    limits, solver = Limits(dense=0, part=1, slice=40 if slices else 700), "superlu"
    system = LinearSystem.of(packing(0.5), solver=solver if slices else None, limits=limits)
    found = modes_of(system, **({"lowest": 100} if slices else {"below": middle(elastic, 100)}))
    assert ("products" in found.attributes["solver"]) is not slices
    assert found.frequency == pytest.approx(elastic[:100], rel=1e-6)
    assert found.certified and found.floppy_modes == zero


@pytest.mark.parametrize("solver", direct_solvers())
def test_counts_just_above_zero_are_those_of_the_zero_modes(solver):
    """At frequencies whose omega^2 is below the round-off of a factorisation."""
    if not available(solver):
        pytest.skip("pypardiso is not installed")
    system = LinearSystem.of(packing(0.5), solver=solver)
    counts = counts_below(system, [1e-9, 1e-6, 1e-3, 0.1, 1.0])
    assert counts.tolist() == [by_dense_solver(0.5)[0]] * 5
