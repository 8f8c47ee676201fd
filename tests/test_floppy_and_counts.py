"""Zero modes found by structure, exact counts, and every factorisation, against dense spectra."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from packings import scaled

from modal.__main__ import main
from modal.formats.hdf5 import InputError
from modal.modes.counts import count_below, count_negative, layers_of_contacts
from modal.modes.highest import all_modes
from modal.modes.lowest import lowest_modes, modes_between
from modal.modes.mode_set import ModeSet
from modal.modes.problem import SMALL, Eigenproblem, frequency_of, slipping
from modal.packing import examples as gallery
from modal.packing.network import Network
from modal.packing.network_file import write_network
from modal.solvers.factor import SOLVERS, available, factorise
from modal.solvers.lanczos import TOLERANCE, modes_nearest
from modal.stiffness.matrices import stiffness_matrix

PER_CONTACT = [
    "particle_i",
    "particle_j",
    "normal",
    "lever_i",
    "lever_j",
    "stiffness_normal",
    "stiffness_tangential",
    "force_normal",
    "force_tangential",
    "overlap",
    "sliding",
    "cell_shift",
]


def with_contacts(network: Network, keep: np.ndarray) -> Network:
    """The network with some of its contacts (indices or booleans)."""
    return replace(network, **{name: getattr(network, name)[keep] for name in PER_CONTACT})


def diluted(share: float, seed: int, layers: int = 6) -> Network:
    """A crystal that has lost a share of its contacts at random: loose parts of every kind."""
    network = gallery.fcc(cells=(4, 4, layers))
    return with_contacts(network, np.random.default_rng(seed).random(network.n_contacts) > share)


def dense_squares(problem: Eigenproblem) -> np.ndarray:
    """All omega^2, ascending, by a dense solver."""
    return np.linalg.eigvalsh(problem.scaled.toarray())


def residual_promised(problem: Eigenproblem, found: ModeSet) -> np.ndarray:
    """Bound of the residuals of a search: a residual r of (A - sigma)^-1 below TOLERANCE theta
    leaves |A v - omega^2 v| = |(A - sigma) r / theta| <= |A| TOLERANCE, in units of omega^2."""
    return TOLERANCE * problem.bound / (2 * np.pi * found.frequency) ** 2


def zero_modes(problem: Eigenproblem) -> int:
    """Rank deficiency of the dense matrix; round-off is some 1e-14 of the largest eigenvalue."""
    square = dense_squares(problem)
    return int((square < 1e-11 * square[-1]).sum())


@pytest.mark.parametrize("share", [0.3, 0.5, 0.6])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_floppy_modes_of_a_diluted_crystal(share, seed):
    """Structure gives exact zero modes, orthonormal, and (these parts are small) all of them."""
    problem = Eigenproblem.of(diluted(share, seed))
    basis = problem.floppy.basis
    scale = problem.scaled.diagonal().max()
    assert abs((problem.scaled @ basis).toarray()).max(initial=0.0) < 1e-11 * scale
    gram = (basis.T @ basis).toarray()
    assert gram == pytest.approx(np.eye(len(gram)), abs=1e-10)
    assert problem.floppy.total == zero_modes(problem)
    assert sum(problem.floppy.by_kind().values()) == problem.floppy.total


def test_parts_too_large_for_a_dense_null_space_count_as_held(monkeypatch):
    """What is left is a part of the zero modes, still exact; the counts tell how many there are."""
    network = diluted(0.5, 1)
    everything = Eigenproblem.of(network).floppy
    monkeypatch.setattr("modal.modes.zero_modes.LARGEST_PART", 1)
    problem = Eigenproblem.of(diluted(0.5, 1))
    assert 0 < problem.floppy.hinged < everything.hinged
    assert problem.floppy.free_particles == everything.free_particles
    basis, scale = problem.floppy.basis, problem.scaled.diagonal().max()
    assert abs((problem.scaled @ basis).toarray()).max() < 1e-11 * scale
    assert count_below(problem, 1.0) == everything.total


@pytest.mark.parametrize("share", [0.8, 0.9])
def test_floppy_modes_without_rotations(share):
    """A single contact with both springs holds a sphere: only whole clusters move freely."""
    problem = Eigenproblem.of(diluted(share, 2), translations_only=True)
    basis, scale = problem.floppy.basis, problem.scaled.diagonal().max()
    assert abs((problem.scaled @ basis).toarray()).max() < 1e-11 * scale
    assert problem.floppy.total == zero_modes(problem) > 0


def test_two_spheres_and_one_spring():
    """An oblique contact without friction resists one motion of twelve."""
    crystal = gallery.fcc(cells=(2, 2, 3))
    oblique = np.flatnonzero((abs(crystal.normal) > 0.1).sum(axis=1) >= 2)[:1]
    slippery = replace(crystal, sliding=np.ones(crystal.n_contacts, bool))
    problem = Eigenproblem.of(slipping(with_contacts(slippery, oblique)))
    assert problem.floppy.total == zero_modes(problem) == problem.size - 1
    assert problem.floppy.loose_clusters == 11


def test_each_kind_is_named():
    """A free sphere has six zero modes, one on one contact three, one on two contacts one."""
    network = gallery.column(4)
    i, j = network.particle_i, network.particle_j
    free = with_contacts(network, (i != 3) & (j != 3))
    kinds = Eigenproblem.of(free).floppy.by_kind()
    assert kinds["free_particles"] == 6
    # Sphere 2 hangs on one contact. 0 and 1 turn about the axis, 2 about its contact point, and
    # the whole hanging column swings about the wall: dense rank says how many.
    assert sum(kinds.values()) == zero_modes(Eigenproblem.of(free))
    single = with_contacts(network, np.flatnonzero(j == -1))
    assert Eigenproblem.of(single).floppy.by_kind() == {
        "free_particles": 18,
        "loose_clusters": 0,
        "hinged": 3,
        "spinning": 0,
    }


@pytest.mark.parametrize("periodic", ["x and y", "x", "none"])
def test_cluster_without_walls_moves_as_a_whole(periodic):
    """Three translations; of the rotations a period leaves one about its own axis, or none."""
    network = gallery.fcc(cells=(4, 4, 5))
    inside = network.particle_j >= 0
    if periodic != "x and y":
        inside &= network.cell_shift[:, 1] == 0
    if periodic == "none":
        inside &= network.cell_shift[:, 0] == 0
    problem = Eigenproblem.of(with_contacts(network, inside))
    assert problem.floppy.loose_clusters == {"x and y": 3, "x": 4, "none": 6}[periodic]
    assert problem.floppy.total == zero_modes(problem)


@pytest.mark.parametrize("share", [0.3, 0.6, 1.0])
def test_a_cluster_is_followed_through_contacts_named_either_way(share):
    """Its places, and so its rigid rotations, whichever body of a contact comes first."""
    crystal = gallery.fcc(cells=(4, 4, 5))
    network = with_contacts(crystal, (crystal.particle_j >= 0) & ~crystal.cell_shift.any(axis=1))
    other = np.random.default_rng(1).random(network.n_contacts) < share
    swap = other[:, None]
    network = replace(
        network,
        particle_i=np.where(other, network.particle_j, network.particle_i),
        particle_j=np.where(other, network.particle_i, network.particle_j),
        normal=np.where(swap, -network.normal, network.normal),
        lever_i=np.where(swap, network.lever_j, network.lever_i),
        lever_j=np.where(swap, network.lever_i, network.lever_j),
    )
    floppy = Eigenproblem.of(network).floppy
    assert floppy.loose_clusters == floppy.total == 6


def test_without_tangential_springs_every_sphere_spins():
    network = replace(
        gallery.fcc(cells=(3, 3, 5)), sliding=np.ones(gallery.fcc(cells=(3, 3, 5)).n_contacts, bool)
    )
    problem = Eigenproblem.of(slipping(network))
    assert problem.floppy.spinning == 3 * network.n_particles
    assert problem.floppy.total == zero_modes(problem)


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_counts_are_exact(share):
    """Inertia, layer by layer and by a sparse factorisation, against the dense spectrum."""
    network = diluted(share, 7)
    problem = Eigenproblem.of(network)
    frequency = frequency_of(dense_squares(problem))
    for hz in (1.0, 3e4, 7.7e4, 1.3e5, 2.5e5):
        expected = int((frequency < hz).sum())
        shifted = problem.shifted((2 * np.pi * hz) ** 2)
        assert count_negative(shifted, 6, network.position[:, 2]) == expected
        assert count_below(problem, hz) == expected
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
    problem = Eigenproblem.of(gallery.column(120), solver=solver)
    block = problem.scaled[78:84, 78:84].toarray()
    square = np.linalg.eigvalsh(block)[which]
    exact = dense_squares(problem)
    assert abs(exact - square).min() > 1e-4 * exact[-1]
    assert count_below(problem, frequency_of(square)) == int((exact < square).sum())


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


def test_growth_of_the_factor_is_no_exact_count():
    """A star's leaves come first; one of 1e-12 makes an entry of 1e12 of the centre's 0.3."""
    star = np.diag([0.3, 1e-12, 1.0, 1.0])
    star[0, 1:] = star[1:, 0] = 1.0
    assert factorise(sp.csr_matrix(star), definite=False, solver="superlu").negative is None
    star[1, 1] = 1.0
    assert factorise(sp.csr_matrix(star), definite=False, solver="superlu").negative == 1
    network = gallery.column(2)
    problem = Eigenproblem.of(network)
    block = problem.scaled[:6, :6].toarray()
    near = np.linalg.eigvalsh(block)[-1] * (1 - 1e-12)
    with pytest.raises(InputError, match="ask for a different one"):
        count_negative(problem.shifted(near), 6, network.position[:, 2])


@pytest.mark.parametrize("solver", ["pardiso", "superlu", "layers"])
def test_a_mode_at_the_frequency_asked_is_refused(solver):
    """Whether a mode lies below its own frequency is round-off: no count is given as exact."""
    if not available(solver) and solver != "layers":
        pytest.skip("pypardiso is not installed")
    problem = Eigenproblem.of(columns_side_by_side(60), solver=solver)
    frequency = frequency_of(dense_squares(problem))
    for hz in (frequency[-1], frequency[-200]):
        count = None
        try:
            count = count_below(problem, hz)
        except InputError as error:
            assert "slightly different" in str(error)
        # Some round-off decides for all or for none of the equal modes.
        low, high = (frequency < hz * (1 - 1e-9)).sum(), (frequency < hz * (1 + 1e-9)).sum()
        assert count is None or low <= count <= high


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
    problem = Eigenproblem.of(gallery.fcc(cells=(4, 4, 8)), solver=solver)
    assert problem.size > SMALL
    assert count_below(problem, 0.0) == count_below(problem, -5e4) == 0
    assert count_below(problem, 5e4) == int((frequency_of(dense_squares(problem)) < 5e4).sum())
    fast = solver or ("pardiso" if available("pardiso") else None)
    assert made == ([fast] if fast else [])
    assert not kept


@pytest.mark.parametrize("above", [3, 4])
def test_counts_beside_an_uncertain_frequency_must_agree(above, monkeypatch):
    """Where no method can tell at a frequency, three modes below and three above it are three;
    three and four mean a mode in between."""
    problem = Eigenproblem.of(gallery.fcc(cells=(4, 4, 8)))
    square = (2 * np.pi * 5e4) ** 2

    def negative(_, place, method):
        if abs(place / square - 1) > 1e-5:
            return 99  # too far to tell anything
        return None if place == square else 3 if place < square else above

    monkeypatch.setattr("modal.modes.counts._negative", negative)
    if above == 3:
        assert count_below(problem, 5e4) == 3
    else:
        with pytest.raises(InputError, match="a mode is so near"):
            count_below(problem, 5e4)


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


@pytest.mark.parametrize("solver", SOLVERS)
def test_lowest_modes_by_every_factorisation(solver):
    if not available(solver):
        pytest.skip("pypardiso is not installed")
    problem = Eigenproblem.of(diluted(0.35, 4, layers=8), solver=solver)
    elastic = frequency_of(dense_squares(problem))[problem.floppy.total :]
    lowest = lowest_modes(problem, 40)
    assert lowest.attributes["certified"]
    # omega^2 is known to eps times the largest one; f to that over 2 (f / f_max)^2.
    tolerance = 1e-13 * (elastic[-1] / elastic[0]) ** 2
    assert lowest.frequency == pytest.approx(elastic[:40], rel=tolerance)
    assert (lowest.residual < residual_promised(problem, lowest)).all()


@pytest.mark.parametrize("solver", [None, "superlu"])
def test_intervals_are_cut_and_complete(monkeypatch, solver):
    """Slices of at most 40 modes give the same list as the dense solver, each one once.

    The lowest slice has its shift in its middle with PARDISO, just below zero with scipy alone.
    """
    monkeypatch.setattr("modal.modes.lowest.DENSE_LIMIT", 0)
    monkeypatch.setattr("modal.modes.lowest.SLICE", 40)
    problem = Eigenproblem.of(diluted(0.35, 5, layers=7), solver=solver)
    frequency = frequency_of(dense_squares(problem))
    elastic = frequency[problem.floppy.total :]
    # Ends in the middle of gaps, away from the round-off of any frequency.
    middle = (elastic[1:] + elastic[:-1]) / 2
    for low, high in ((0.0, middle[130]), (middle[100], middle[190])):
        found = modes_between(problem, low, high)
        expected = elastic[(elastic >= low) & (elastic < high)]
        assert found.attributes["certified"]
        assert found.frequency == pytest.approx(expected, rel=1e-8)


def columns_side_by_side(copies: int) -> Network:
    """Uncoupled columns of two spheres: every frequency at least so many times."""
    single = gallery.column(2)
    many = {}
    for name in PER_CONTACT:
        data = getattr(single, name)
        many[name] = np.concatenate([data] * copies)
    ids = np.repeat(np.arange(copies) * 2, single.n_contacts)
    many["particle_i"] = many["particle_i"] + ids
    many["particle_j"] = np.where(
        many["particle_j"] >= 0, many["particle_j"] + ids, many["particle_j"]
    )
    spheres = {
        name: np.concatenate([getattr(single, name)] * copies)
        for name in ("position", "radius", "mass", "inertia")
    }
    return replace(single, **many, **spheres)


def test_degenerate_spectrum_is_complete():
    problem = Eigenproblem.of(columns_side_by_side(100))
    expected = frequency_of(dense_squares(problem))
    assert problem.floppy.total == int((expected < 1.0).sum())
    elastic = expected[problem.floppy.total :]
    lowest = lowest_modes(problem, 120)
    assert lowest.frequency == pytest.approx(elastic[:120], rel=1e-7)
    assert lowest.attributes["certified"]


def test_a_hundred_equal_frequencies_in_a_slice_take_one_factorisation(monkeypatch):
    """Where a round of the search finds some only, the next goes on with the same factor."""
    made, asked = [], []

    def noted(*arguments, **options):
        made.append(factorise(*arguments, **options))
        return made[-1]

    def some_of(solve, size, count, sigma, held):
        asked.append(count)
        return modes_nearest(solve, size, min(count, 30), sigma, held)

    monkeypatch.setattr("modal.modes.lowest.DENSE_LIMIT", 0)
    monkeypatch.setattr("modal.modes.search.factorise", noted)
    monkeypatch.setattr("modal.modes.search.modes_nearest", some_of)
    problem = Eigenproblem.of(columns_side_by_side(100))
    expected = frequency_of(dense_squares(problem))[problem.floppy.total :]
    low, high = 0.999 * expected[0], 1.001 * expected[0]
    wanted = int(((expected >= low) & (expected < high)).sum())
    assert wanted >= 100
    found = modes_between(problem, low, high)
    assert found.attributes["certified"]
    assert len(found.frequency) == wanted
    assert len(asked) > 3
    assert len(made) == 1


def test_stiffness_contrast_of_a_million():
    """Contacts a million times softer among stiff ones: counts exact, residuals reached."""
    network = gallery.fcc(cells=(4, 4, 8))
    soft = np.random.default_rng(3).random(network.n_contacts) < 0.3
    names = "stiffness_normal", "stiffness_tangential"
    softer = {name: scaled(getattr(network, name), soft, 1e-6) for name in names}
    network = replace(network, **softer)
    problem = Eigenproblem.of(network)
    frequency = frequency_of(dense_squares(problem))
    for hz in (10.0, 100.0, 1e4, 1e5):
        assert count_below(problem, hz) == int((frequency < hz).sum())
    lowest = lowest_modes(problem, 30)
    assert lowest.attributes["certified"]
    assert (lowest.residual < residual_promised(problem, lowest)).all()


def test_order_of_particles_and_contacts_does_not_matter():
    network = diluted(0.4, 6, layers=8)
    random = np.random.default_rng(8)
    rank = random.permutation(network.n_particles)
    order = np.argsort(rank)
    mixed = with_contacts(network, random.permutation(network.n_contacts))
    names = ("position", "radius", "mass", "inertia")
    mixed = replace(
        mixed,
        **{name: getattr(network, name)[order] for name in names},
        particle_i=rank[mixed.particle_i],
        particle_j=np.where(mixed.particle_j >= 0, rank[mixed.particle_j], mixed.particle_j),
    )
    problem, other = Eigenproblem.of(network), Eigenproblem.of(mixed)
    assert problem.floppy.by_kind() == other.floppy.by_kind()
    found, again = lowest_modes(problem, 40), lowest_modes(other, 40)
    assert again.frequency == pytest.approx(found.frequency, rel=1e-8)


def test_all_modes_contain_the_zero_modes():
    problem = Eigenproblem.of(diluted(0.5, 9))
    everything = all_modes(problem).frequency
    assert len(everything) == problem.size
    assert int((everything < 1e-4 * everything[-1]).sum()) == problem.floppy.total


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--lowest", "9999"], "modes asked"),
        (["--between", "200", "100"], "is empty"),
        (["--solver", "magic"], "invalid choice"),
        (["--below", "nan"], "is empty"),
    ],
)
def test_bad_requests_get_one_line(tmp_path, capsys, arguments, message):
    path = tmp_path / "x.network.h5"
    write_network(path, gallery.fcc(cells=(3, 3, 6)))
    assert main(["modes", str(path), *arguments]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert message in lines[0]


def test_too_little_memory_is_refused(monkeypatch):
    monkeypatch.setattr("modal.solvers.factor.memory_at_hand", lambda: 1e3)
    problem = Eigenproblem.of(gallery.fcc(cells=(4, 4, 10)), solver="banded")
    with pytest.raises(InputError, match=r"needs about .* GB"):
        lowest_modes(problem, 5)
