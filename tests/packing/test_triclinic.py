"""Cells whose periods are at angles: other descriptions of one packing, and sheared crystals."""

from dataclasses import replace

import numpy as np
import pytest
from oracles import slow_stiffness
from packings import polydisperse
from refusals import refusal
from scipy.linalg import eigvalsh

import modal
from modal.packing.columns import SOURCE_WALL
from modal.packing.crystal import fcc
from modal.packing.missing_contacts import missing_contacts
from modal.packing.neighbours import touching
from modal.packing.network import Network, read_network, write_network
from modal.packing.sample import sample_of_network
from modal.packing.tiling import repeat
from modal.system.assembly import stiffness_matrix
from modal.waves.sources import Plane

OTHER_CELL = np.array([[1, 0, 0], [1, 1, 0], [-1, 2, 1]])
"""Whole numbers of the old periods in the new ones; the determinant is 1, so no point is lost."""


def at_angles(network: Network, *, shift: bool = True) -> Network:
    """Return the same packing in a cell at angles, with each centre inside of it."""
    old = network.period_vectors
    vectors = OTHER_CELL @ old
    to_new = np.rint(np.linalg.inv(OTHER_CELL)).astype(int)
    turns = np.floor(network.position @ np.linalg.inv(vectors)).astype(int)
    i, j = network.particle_i, network.partner
    shifts = network.periods @ to_new + turns[j] - turns[i]
    return replace(
        network,
        position=network.position - turns @ vectors,
        cell_vectors=vectors,
        cell_size=np.diag(vectors),
        cell_shift=shifts if shift else None,
    )


@pytest.fixture(scope="module")
def cubic():
    return fcc(cells=(2, 2, 4), periodic_z=True)


@pytest.fixture(scope="module")
def aslant(cubic):
    return at_angles(cubic)


def test_the_spectrum_is_that_of_the_cubic_description(cubic, aslant):
    """The same packing, whose frequencies agree to round-off: eps of the largest omega^2."""
    expected = modal.eigenmodes(cubic, all=True).frequency
    modes = modal.eigenmodes(aslant, all=True)
    scale = expected[-1] ** 2
    assert abs(modes.frequency**2 - expected**2).max() < 1e-12 * scale
    middle = (expected[20] + expected[24]) / 2 + 1.0
    assert modal.count_modes(aslant, middle) == modal.count_modes(cubic, middle)
    one = modal.density_of_states(cubic).count_below([middle])[0]
    other = modal.density_of_states(aslant).count_below([middle])[0]
    np.testing.assert_allclose(other, one, rtol=1e-9)


@pytest.mark.parametrize("network", [fcc(cells=(2, 2, 4), periodic_z=True), polydisperse(True)])
def test_branches_do_not_depend_on_the_description(network):
    """Also where the periods are found from the levers; volume and area times length agree."""
    for shift in (True, False):
        other = at_angles(network, shift=shift)
        np.testing.assert_allclose(other.branch, network.branch, atol=1e-12 * network.length)
    assert other.area * other.length == pytest.approx(network.area * network.length, rel=1e-12)
    assert abs(stiffness_matrix(other) - stiffness_matrix(network)).max() == 0


def test_moduli_and_waves(cubic, aslant):
    """Layers are the same: only the period along z, which leans, has another name."""
    one = modal.elastic_moduli(cubic)
    other = modal.elastic_moduli(aslant)
    np.testing.assert_allclose(other.stiffness, one.stiffness, atol=1e-9 * one.stiffness.max())
    assert other.density == pytest.approx(one.density, rel=1e-12)
    source = Plane(0.45 * cubic.length)
    for direction in ("z", "x"):
        settings = {"source": source, "direction": direction, "whole": True}
        first = modal.propagate(cubic, 1e-5, **settings).signals
        second = modal.propagate(aslant, 1e-5, **settings).signals
        largest = abs(first.layer_displacement).max()
        difference = second.layer_displacement - first.layer_displacement
        assert abs(difference).max() < 1e-9 * largest
    with refusal("triclinic_cell"):
        sample_of_network(aslant, 0.5)


@pytest.mark.parametrize("network", [fcc(cells=(2, 2, 4), periodic_z=True), polydisperse(True)])
def test_contacts_are_found_in_the_cell(network):
    other = at_angles(network)
    walls = np.full(2, np.nan)
    contacts = touching(other.position, np.zeros(3), other.cell_vectors, walls, other.radius)
    assert len(contacts.overlap) == network.n_contacts
    np.testing.assert_allclose(np.sort(contacts.overlap), np.sort(network.overlap), atol=1e-15)
    assert missing_contacts(other).pairs == 0
    fewer = other.with_contacts(slice(3, None))
    assert missing_contacts(fewer).pairs == 3


def test_between_walls_the_periods_are_horizontal():
    """A lattice of period a, b is also one of a, a + b, between the same walls."""
    crystal = fcc(cells=(2, 2, 6))
    size = crystal.cell_size
    vectors = np.diag(size)
    vectors[1, 0] = size[0]
    shifts = crystal.periods.copy()
    # n_x a + n_y b = (n_x - n_y) a + n_y (a + b)
    shifts[:, 0] -= shifts[:, 1]
    other = replace(crystal, cell_vectors=vectors, cell_shift=shifts)
    assert (other.particle_j == SOURCE_WALL).any()
    one = modal.propagate(crystal, 2e-5, particles=True, whole=True).signals
    two = modal.propagate(other, 2e-5, particles=True).signals
    np.testing.assert_allclose(
        two.particle_displacement, one.particle_displacement, atol=1e-9 * 1e-9
    )
    np.testing.assert_array_equal(two.chain_particle, one.chain_particle)
    leaning = vectors.copy()
    leaning[0, 2] = 0.1 * size[2]
    with refusal("cell_vectors"):
        replace(crystal, cell_vectors=leaning)
    with refusal("cell_vectors"):
        replace(crystal, cell_vectors=2 * vectors)


def sheared_lattice(angle: float, n: int = 3) -> Network:
    """Return n^3 unit cells of a simple lattice sheared by an angle: c leans along x.

    Each sphere touches six others, along a, b and c, with springs of their own.
    """
    d = 1e-3
    a = np.array([d, 0, 0])
    b = np.array([0, d, 0])
    c = d * np.array([np.sin(angle), 0, np.cos(angle)])
    lattice = np.array([a, b, c])
    index = np.indices((n, n, n)).reshape(3, -1).T
    count = len(index)
    neighbours = [(index + step) for step in np.eye(3, dtype=int)]
    shift = np.concatenate([np.floor_divide(place, n) for place in neighbours])
    j = np.concatenate([np.ravel_multi_index((place % n).T, (n, n, n)) for place in neighbours])
    normal = np.repeat(lattice / d, count, axis=0)
    kn = np.repeat([3e4, 2e4, 1e4], count)
    return Network(
        position=index @ lattice + 0.1 * d,
        radius=np.full(count, d / 2),
        mass=np.full(count, 1e-6),
        inertia=np.full(count, 0.4 * 1e-6 * (d / 2) ** 2),
        particle_i=np.tile(np.arange(count), 3),
        particle_j=j,
        normal=normal,
        lever_i=d / 2 * normal,
        lever_j=-d / 2 * normal,
        stiffness_normal=kn,
        stiffness_tangential=0.8 * kn,
        cell_size=np.diag(n * lattice),
        cell_vectors=n * lattice,
        cell_periodic=np.ones(3, bool),
        wall_position=np.array([0.0, n * c[2]]),
        cell_shift=shift,
    )


def bloch_squares(network: Network, n: int) -> np.ndarray:
    """Return omega^2 of all waves of a lattice of one sphere with three contacts: (6 n^3,).

    The dynamical matrix of 6 x 6 follows from the slip u_j - u_i of each contact, whose far end
    moves as its own sphere does times exp(i q R).
    """
    count = network.n_particles
    rows = count * np.arange(3)
    squares = []
    phases = 2 * np.pi * np.indices((n, n, n)).reshape(3, -1).T / n
    root = np.sqrt([network.mass[0]] * 3 + [network.inertia[0]] * 3)
    for phase in phases:
        K = np.zeros((6, 6), complex)
        for number, row in enumerate(rows):
            normal = network.normal[row]
            kn = network.stiffness_normal[row]
            kt = network.stiffness_tangential[row]
            spring = kt * np.eye(3) + (kn - kt) * np.outer(normal, normal)
            turn_i = np.column_stack([np.cross(unit, network.lever_i[row]) for unit in np.eye(3)])
            turn_j = np.column_stack([np.cross(unit, network.lever_j[row]) for unit in np.eye(3)])
            at_i = np.hstack([np.eye(3), turn_i])
            at_j = np.hstack([np.eye(3), turn_j])
            slip = np.exp(1j * phase[number]) * at_j - at_i
            K += slip.conj().T @ spring @ slip
        squares.append(eigvalsh(K / np.outer(root, root)))
    return np.sort(np.concatenate(squares))


@pytest.mark.parametrize("angle", [0.0, 0.2])
def test_a_sheared_crystal_has_the_waves_of_its_lattice(angle):
    crystal = sheared_lattice(angle)
    found = (2 * np.pi * modal.eigenmodes(crystal, all=True).frequency) ** 2
    expected = bloch_squares(crystal, 3)
    assert abs(found - expected).max() < 1e-12 * expected[-1]
    assert crystal.area * crystal.length == pytest.approx(27 * 1e-9 * np.cos(angle))
    np.testing.assert_allclose(
        stiffness_matrix(crystal).toarray(), slow_stiffness(crystal), atol=1e-9
    )
    moduli = modal.elastic_moduli(crystal)
    # Along y the springs of one kind of contact alone are stretched: sqrt(k / m) d.
    velocity = np.sqrt(2e4 / 1e-6) * 1e-3
    assert moduli.velocities((0, 1, 0))[0] == pytest.approx(velocity, rel=1e-9)


def test_copies_and_files(aslant, tmp_path):
    tripled = repeat(aslant, 3, 1)
    assert tripled.n_particles == 3 * aslant.n_particles
    np.testing.assert_allclose(tripled.cell_vectors, aslant.cell_vectors * [[3], [1], [1]])
    one = modal.elastic_moduli(aslant).stiffness
    np.testing.assert_allclose(modal.elastic_moduli(tripled).stiffness, one, atol=1e-9 * one.max())
    path = tmp_path / "aslant.network.h5"
    write_network(path, aslant)
    again = read_network(path)
    np.testing.assert_array_equal(again.cell_vectors, aslant.cell_vectors)
    assert again.fingerprint == aslant.fingerprint
    upright = fcc(cells=(1, 1, 4))
    assert replace(upright, cell_vectors=np.diag(upright.cell_size)).cell_vectors is None
