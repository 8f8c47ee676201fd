"""Bodies that cannot make some motions: matrices, moduli, walls, files, clumps and relaxation."""

from dataclasses import replace

import numpy as np
import pytest
from held_packings import between_rough_walls, free_rows, held_at_random, with_inertia_tensors
from oracles import slow_stiffness
from packings import polydisperse, sheared
from places import SHEARED
from refusals import refusal

import modal
from modal.elasticity.strain import UNIT_STRAINS
from modal.packing.crystal import column, fcc
from modal.packing.ends import end_heights, rough_wall
from modal.packing.network import RECEIVER_WALL, read_network, write_network
from modal.packing.rigid_bodies import joined
from modal.packing.sample import read_sample, sample_of_network, write_sample
from modal.preparation.relax import relax
from modal.system.contacts import contact_tangent
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.system.root_mass import RootMass


def dynamical_matrix_of_held():
    """Return a system with held motions, its dense dynamical matrix and its held rows."""
    network = held_at_random(polydisperse())
    system = LinearSystem.of(network)
    return system, system.dynamical_matrix.toarray(), network.fixed.ravel()


def test_held_motions_have_no_entry_in_the_matrix():
    _, A, held = dynamical_matrix_of_held()
    assert not A[held].any()
    assert not A[:, held].any()


@pytest.mark.two_ways
@pytest.mark.parametrize("name", ["operator", "renumbered"])
def test_products_are_those_of_the_matrix(name):
    """Compare the loops over contacts; some 30 terms a row, each with an error of eps."""
    system, A, _ = dynamical_matrix_of_held()
    operator = getattr(system, name)
    u = np.random.default_rng(1).standard_normal((system.size, 3))
    product = operator.outward(operator.apply(operator.inward(u)))
    np.testing.assert_allclose(product, A @ u, rtol=0, atol=1e-12 * abs(A).max())


def test_diagonal_is_that_of_the_matrix():
    system, A, _ = dynamical_matrix_of_held()
    # A sum of some ten contacts; what cancels in it is round-off of the largest entry.
    np.testing.assert_allclose(system.diagonal, A.diagonal(), rtol=1e-12, atol=1e-14 * A.max())


@pytest.mark.two_ways
def test_product_with_tensors_of_inertia():
    system = LinearSystem.of(with_inertia_tensors())
    u = np.random.default_rng(3).standard_normal(system.size)
    A = system.dynamical_matrix
    # Some 30 terms a row, each with an error of eps; the roots of tensors add their condition.
    atol = 1e-12 * abs(A).max()
    np.testing.assert_allclose(system.operator.apply(u), A @ u, atol=atol)


def test_root_of_tensors_of_inertia_keeps_the_free_turns():
    """Multiply by the inverse root of M and by its root: free motions remain, held ones vanish."""
    network = with_inertia_tensors()
    u = np.random.default_rng(3).standard_normal(network.fixed.size)
    root_mass = RootMass.of(network)
    free_motions = np.where(network.free_motions.ravel(), u, 0)
    # Roots of 3 x 3 tensors of condition below 10: some hundred eps of a number of order 1.
    np.testing.assert_allclose(root_mass.times(root_mass.over(u)), free_motions, atol=1e-12)


@pytest.fixture(scope="module")
def chains():
    """Return a column whose last sphere is held, and the shorter column with a wall in its place.

    The third value are the contacts that both have.
    """
    chain = column(6)
    last = chain.n_particles - 1
    fixed = np.zeros((chain.n_particles, 6), bool)
    fixed[last] = True
    held = replace(chain, fixed=fixed)
    common = ~((chain.particle_i == last) & chain.with_wall)
    shorter = chain.with_contacts(common)
    at_last = (shorter.particle_j == last) | (shorter.particle_i == last)
    with_wall = shorter.unchecked(
        position=chain.position[:-1],
        radius=chain.radius[:-1],
        mass=chain.mass[:-1],
        inertia=chain.inertia[:-1],
        particle_j=np.where(at_last, RECEIVER_WALL, shorter.particle_j),
        lever_j=np.where(at_last[:, None], 0.0, shorter.lever_j),
    )
    return held, with_wall, common


@pytest.mark.two_ways
def test_modes_with_a_held_body_are_those_with_a_wall(chains):
    held, with_wall, _ = chains
    expected = modal.eigenmodes(with_wall, all=True).frequency
    frequency = modal.eigenmodes(held, all=True).frequency
    np.testing.assert_allclose(frequency, expected, rtol=1e-12, atol=1e-9 * expected[-1])


def test_dashpots_at_a_held_body_are_those_at_a_wall(chains):
    """Make a dashpot critical for the mass of the sphere that moves."""
    held, with_wall, common = chains
    damping = ContactDamping(0.1, 0.2)
    expected = damping.dashpots(with_wall).stiffness_normal
    dashpots = damping.dashpots(held).stiffness_normal[common]
    # One closed form in both: round-off of some ten operations.
    np.testing.assert_allclose(dashpots, expected, rtol=1e-12)


@pytest.fixture(scope="module")
def cell_with_held_turns():
    """Return a periodic cell of spheres of which some cannot turn about some axes."""
    cell = polydisperse(periodic_z=True)
    fixed = held_at_random(cell).fixed.copy()
    fixed[:, :3] = False
    return replace(cell, fixed=fixed)


VOIGT_AXES = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
"""The axis along which a plane moves in each unit strain, and the axis across the plane."""


@pytest.mark.parametrize("component", range(6))
def test_held_turns_do_not_follow_a_strain(cell_with_held_turns, component):
    """Turn free spheres with the antisymmetric part of the displacement gradient."""
    network = cell_with_held_turns
    gradient = np.zeros((3, 3))
    gradient[VOIGT_AXES[component]] = 1
    antisymmetric = gradient - gradient.T
    rotation = np.array([antisymmetric[2, 1], antisymmetric[0, 2], antisymmetric[1, 0]]) / 2
    free_turns = network.free_motions[:, 3:]
    strain = UNIT_STRAINS.on(network)
    np.testing.assert_allclose(strain[component, :, 3:6], rotation * free_turns[network.particle_i])


@pytest.mark.two_ways
def test_moduli_of_a_cell_with_held_turns(cell_with_held_turns):
    """Compare with V C_ab = d_a . k d_b - f_a . K^-1 f_b without held rows."""
    network = cell_with_held_turns
    moduli = modal.elastic_moduli(network, solver="gradients", tolerance=1e-9)
    strain = UNIT_STRAINS.on(network)
    rows = free_rows(network)
    K = slow_stiffness(network)[np.ix_(rows, rows)]
    inverse = np.linalg.pinv(K, rcond=1e-10, hermitian=True)
    push = LinearSystem.of(network).put_on(UNIT_STRAINS).push.toarray()[rows]
    affine = np.einsum("sca,cab,tcb->st", strain, contact_tangent(network), strain)
    relaxed = affine - push.T @ inverse @ push
    volume = network.area * network.length
    # Gradients stop at a residual of 1e-9; the softest modes enlarge its error a thousandfold.
    tolerance = 1e-6 * affine.max() / volume
    np.testing.assert_allclose(moduli.stiffness, relaxed / volume, atol=tolerance)


@pytest.fixture(scope="module")
def crystal_between_rough_walls():
    """Return a crystal of 80 layers of which the first and the last are held."""
    crystal = fcc(cells=(2, 2, 40))
    return between_rough_walls(replace(crystal, cell_shift=crystal.periods))


@pytest.mark.two_ways
def test_moduli_between_rough_walls(crystal_between_rough_walls):
    """Compare with the crystal without end, within 1e-4 of the stiffest component."""
    endless = modal.elastic_moduli(fcc(cells=(2, 2, 40), periodic_z=True))
    moduli = modal.elastic_moduli(crystal_between_rough_walls)
    assert moduli.region == "bulk"
    tolerance = 1e-4 * endless.stiffness.max()
    np.testing.assert_allclose(moduli.stiffness, endless.stiffness, atol=tolerance)
    assert moduli.density == pytest.approx(endless.density, rel=1e-4)


def test_rough_walls_end_at_their_innermost_spheres(crystal_between_rough_walls):
    crystal = crystal_between_rough_walls
    height = crystal.position[:, 2]
    source_end, receiver_end = end_heights(crystal)
    assert source_end == height[rough_wall(crystal, "source")].max()
    assert receiver_end == height[rough_wall(crystal, "receiver")].min()


@pytest.fixture(scope="module")
def partly_held():
    """Return 150 spheres with friction, some of them held."""
    return held_at_random(sheared())


def test_a_file_contains_the_held_motions(partly_held, tmp_path):
    path = tmp_path / "partly.network.h5"
    write_network(path, partly_held)
    again = read_network(path)
    np.testing.assert_array_equal(again.fixed, partly_held.fixed)
    assert again.fingerprint == partly_held.fingerprint


def test_held_motions_change_the_fingerprint(partly_held):
    assert partly_held.fingerprint != sheared().fingerprint


def test_a_network_without_held_motions_has_no_such_column(partly_held):
    free = replace(partly_held, fixed=np.zeros_like(partly_held.fixed))
    assert free.fixed is None
    assert free.fingerprint == sheared().fingerprint


def test_held_motions_have_six_columns(partly_held):
    with refusal("wrong_shape", "fixed"):
        replace(partly_held, fixed=partly_held.fixed[:, :3])


@pytest.fixture(scope="module")
def rough_sample():
    """Return 150 spheres with friction at rest, of which those at both flat walls are held."""
    sample = read_sample(SHEARED)
    contacts = sample.contacts()
    fixed = np.zeros((len(sample.position), 6), bool)
    fixed[contacts.particle_i[contacts.particle_j < 0]] = True
    return replace(sample, fixed=fixed, friction=0.5, shear=None)


@pytest.fixture(scope="module")
def relaxed(rough_sample):
    """Return the displaced positions of inner spheres, the sample at rest again, and its state.

    The displacements are a tenth of the median overlap.
    """
    noise = np.random.default_rng(1).standard_normal(rough_sample.position.shape)
    overlap = float(np.median(rough_sample.network().overlap))
    displaced = rough_sample.position + 0.1 * overlap * noise
    held = rough_sample.fixed.all(axis=1)
    displaced[held] = rough_sample.position[held]
    displaced[:, :2] %= rough_sample.side
    sample, state = relax(replace(rough_sample, position=displaced))
    return displaced, sample, state


@pytest.mark.two_ways
def test_relax_leaves_held_spheres_in_place(rough_sample, relaxed):
    displaced, sample, state = relaxed
    held = rough_sample.fixed.all(axis=1)
    assert state.residual < 1e-6
    np.testing.assert_array_equal(sample.position[held], rough_sample.position[held])
    assert (sample.position[~held] != displaced[~held]).any()


def test_a_sample_file_contains_the_held_motions(relaxed, tmp_path):
    sample = relaxed[1]
    path = tmp_path / "rough.sample.h5"
    write_sample(path, sample)
    np.testing.assert_array_equal(read_sample(path).fixed, sample.fixed)


def test_a_sample_made_from_a_network_contains_the_held_motions(relaxed):
    sample = relaxed[1]
    again = sample_of_network(sample.network(), 0.5)
    np.testing.assert_array_equal(again.fixed, sample.fixed)


@pytest.fixture(scope="module")
def rough():
    """Return 60 spheres of several sizes between two walls of held spheres."""
    return between_rough_walls(polydisperse())


def test_coordination_number_counts_held_bodies_as_walls(rough):
    held = rough.held
    ends_at_free = (~held[rough.particle_i]).sum() + (~held[rough.particle_j]).sum()
    assert rough.coordination_number == pytest.approx(ends_at_free / (~held).sum())


def test_a_description_counts_held_bodies(rough):
    assert f"{rough.held.sum()} spheres in all motions" in modal.describe(rough)


@pytest.mark.two_ways
def test_modes_between_rough_walls_are_certified(rough):
    assert modal.eigenmodes(rough, lowest=1).attributes["certified"]


@pytest.fixture
def chain_of_pairs():
    """Return a column of four spheres, and the clump to which each belongs (0: none)."""
    return column(4), np.array([1, 1, 0, 0])


def test_clumps_are_held_as_a_whole(chain_of_pairs):
    chain, body = chain_of_pairs
    fixed = np.zeros((4, 6), bool)
    fixed[:2] = True
    clumps = joined(replace(chain, fixed=fixed), body)
    assert clumps.held.tolist() == [True, False, False]


def test_clumps_held_in_part_are_refused(chain_of_pairs):
    chain, body = chain_of_pairs
    fixed = np.zeros((4, 6), bool)
    fixed[0] = True
    with refusal("held_bodies"):
        joined(replace(chain, fixed=fixed), body)
