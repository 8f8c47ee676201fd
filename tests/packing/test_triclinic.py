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


def in_oblique_cell(network: Network) -> Network:
    """Return the same packing in a cell at angles, with each centre inside of it."""
    vectors = OTHER_CELL @ network.period_vectors
    old_in_new = np.rint(np.linalg.inv(OTHER_CELL)).astype(int)
    cell_of_sphere = np.floor(network.position @ np.linalg.inv(vectors)).astype(int)
    shift = network.periods @ old_in_new
    shift = shift + cell_of_sphere[network.partner] - cell_of_sphere[network.particle_i]
    return replace(
        network,
        position=network.position - cell_of_sphere @ vectors,
        cell_vectors=vectors,
        cell_size=np.diag(vectors),
        cell_shift=shift,
    )


@pytest.fixture(scope="module")
def cubic():
    """Return a crystal in a rectangular cell."""
    return fcc(cells=(2, 2, 4), periodic_z=True)


@pytest.fixture(scope="module")
def oblique(cubic):
    """Return the same crystal in a cell at angles."""
    return in_oblique_cell(cubic)


@pytest.fixture(scope="module")
def frequency(cubic):
    """Return all frequencies of the crystal, Hz, ascending, in the rectangular cell."""
    return modal.eigenmodes(cubic, all=True).frequency


@pytest.fixture(scope="module")
def between_modes(frequency):
    """Return a frequency, Hz, between two modes."""
    return (frequency[20] + frequency[24]) / 2 + 1.0


def test_spectrum_of_an_oblique_cell(oblique, frequency):
    """Compare to round-off: eps of the largest omega^2 times some thousand."""
    modes = modal.eigenmodes(oblique, all=True)
    assert abs(modes.frequency**2 - frequency**2).max() < 1e-12 * frequency[-1] ** 2


def test_counts_in_an_oblique_cell(cubic, oblique, between_modes):
    expected = modal.count_modes(cubic, between_modes)
    assert modal.count_modes(oblique, between_modes) == expected


def test_density_of_states_of_an_oblique_cell(cubic, oblique, between_modes):
    expected, _ = modal.density_of_states(cubic).count_below([between_modes])
    count, _ = modal.density_of_states(oblique).count_below([between_modes])
    np.testing.assert_allclose(count, expected, rtol=1e-9)


PACKINGS = {"crystal": fcc(cells=(2, 2, 4), periodic_z=True), "random": polydisperse(True)}


@pytest.fixture(scope="module", params=PACKINGS.values(), ids=PACKINGS)
def descriptions(request):
    """Return a packing in a rectangular cell and in one at angles."""
    return request.param, in_oblique_cell(request.param)


def test_branches_in_an_oblique_cell(descriptions):
    network, oblique = descriptions
    np.testing.assert_allclose(oblique.branch, network.branch, atol=1e-12 * network.length)


def test_branches_in_an_oblique_cell_from_the_levers(descriptions):
    """Leave out the periods of contacts, which the levers determine."""
    network, oblique = descriptions
    oblique = replace(oblique, cell_shift=None)
    np.testing.assert_allclose(oblique.branch, network.branch, atol=1e-12 * network.length)


def test_volume_of_an_oblique_cell(descriptions):
    network, oblique = descriptions
    volume = network.area * network.length
    assert oblique.area * oblique.length == pytest.approx(volume, rel=1e-12)


def test_stiffness_matrix_in_an_oblique_cell(descriptions):
    network, oblique = descriptions
    assert abs(stiffness_matrix(oblique) - stiffness_matrix(network)).max() == 0


def test_contacts_are_found_in_an_oblique_cell(descriptions):
    network, oblique = descriptions
    no_walls = np.full(2, np.nan)
    contacts = touching(
        oblique.position, np.zeros(3), oblique.cell_vectors, no_walls, oblique.radius
    )
    assert len(contacts.overlap) == network.n_contacts
    # Round-off of positions of some centimetres.
    np.testing.assert_allclose(np.sort(contacts.overlap), np.sort(network.overlap), atol=1e-15)


@pytest.mark.parametrize("removed", [0, 3])
def test_missing_contacts_are_counted_in_an_oblique_cell(descriptions, removed):
    _, oblique = descriptions
    assert missing_contacts(oblique.with_contacts(slice(removed, None))).pairs == removed


def test_moduli_in_an_oblique_cell(cubic, oblique):
    expected = modal.elastic_moduli(cubic)
    moduli = modal.elastic_moduli(oblique)
    tolerance = 1e-9 * expected.stiffness.max()
    np.testing.assert_allclose(moduli.stiffness, expected.stiffness, atol=tolerance)
    assert moduli.density == pytest.approx(expected.density, rel=1e-12)


@pytest.mark.parametrize("direction", ["z", "x"])
def test_waves_in_an_oblique_cell(cubic, oblique, direction):
    """Compare layers, which are the same, though the period along z leans."""
    source = Plane(0.45 * cubic.length)
    settings = {"source": source, "direction": direction, "whole": True}
    expected = modal.propagate(cubic, 1e-5, **settings).signals.layer_displacement
    displacement = modal.propagate(oblique, 1e-5, **settings).signals.layer_displacement
    assert abs(displacement - expected).max() < 1e-9 * abs(expected).max()


def test_a_sample_of_an_oblique_cell_is_refused(oblique):
    with refusal("triclinic_cell"):
        sample_of_network(oblique, 0.5)


def crystal_between_walls():
    """Return a crystal between walls, with periods a and b, and the vectors a, a + b and c."""
    crystal = fcc(cells=(2, 2, 6))
    vectors = np.diag(crystal.cell_size)
    vectors[1, 0] = crystal.cell_size[0]
    return crystal, vectors


def test_horizontal_periods_at_an_angle_between_walls():
    """Describe a lattice of periods a and b by a and a + b, between the same walls."""
    crystal, vectors = crystal_between_walls()
    shift = crystal.periods.copy()
    # n_x a + n_y b = (n_x - n_y) a + n_y (a + b)
    shift[:, 0] -= shift[:, 1]
    oblique = replace(crystal, cell_vectors=vectors, cell_shift=shift)
    assert (oblique.particle_j == SOURCE_WALL).any()
    expected = modal.propagate(crystal, 2e-5, particles=True, whole=True).signals
    signals = modal.propagate(oblique, 2e-5, particles=True).signals
    # Displacements are up to 1e-9 m; the expansion has an error of 1e-9 of them.
    np.testing.assert_allclose(
        signals.particle_displacement, expected.particle_displacement, atol=1e-18
    )
    np.testing.assert_array_equal(signals.chain_particle, expected.chain_particle)


def test_a_leaning_period_between_walls_is_refused():
    crystal, vectors = crystal_between_walls()
    vectors[0, 2] = 0.1 * crystal.cell_size[2]
    with refusal("cell_vectors"):
        replace(crystal, cell_vectors=vectors)


def test_vectors_of_another_size_than_the_cell_are_refused():
    crystal, vectors = crystal_between_walls()
    with refusal("cell_vectors"):
        replace(crystal, cell_vectors=2 * vectors)


SPRINGS_OF_LATTICE = [3e4, 2e4, 1e4]
"""Normal stiffness of the contacts along a, b and c, N/m."""
MASS = 1e-6
SPACING = 1e-3


def sheared_lattice(angle: float, n: int = 3) -> Network:
    """Return n^3 unit cells of a simple lattice sheared by an angle: c leans along x.

    Each sphere touches six others, along a, b and c, with springs of their own.
    """
    c = SPACING * np.array([np.sin(angle), 0, np.cos(angle)])
    lattice = np.array([[SPACING, 0, 0], [0, SPACING, 0], c])
    index = np.indices((n, n, n)).reshape(3, -1).T
    count = len(index)
    neighbours = np.concatenate([index + step for step in np.eye(3, dtype=int)])
    particle_j = np.ravel_multi_index((neighbours % n).T, (n, n, n))
    normal = np.repeat(lattice / SPACING, count, axis=0)
    stiffness = np.repeat(SPRINGS_OF_LATTICE, count)
    radius = SPACING / 2
    return Network(
        position=index @ lattice + 0.1 * SPACING,
        radius=np.full(count, radius),
        mass=np.full(count, MASS),
        inertia=np.full(count, 0.4 * MASS * radius**2),
        particle_i=np.tile(np.arange(count), 3),
        particle_j=particle_j,
        normal=normal,
        lever_i=radius * normal,
        lever_j=-radius * normal,
        stiffness_normal=stiffness,
        stiffness_tangential=0.8 * stiffness,
        cell_size=np.diag(n * lattice),
        cell_vectors=n * lattice,
        cell_periodic=np.ones(3, bool),
        wall_position=np.array([0.0, n * c[2]]),
        cell_shift=np.floor_divide(neighbours, n),
    )


def slip_of_motion(lever: np.ndarray) -> np.ndarray:
    """Return the matrix (3, 6) from translation and turn to the motion of a contact point."""
    turn = np.column_stack([np.cross(unit, lever) for unit in np.eye(3)])
    return np.hstack([np.eye(3), turn])


def bloch_squares(network: Network, n: int) -> np.ndarray:
    """Return omega^2 of all waves of a lattice of one sphere with three contacts: (6 n^3,).

    The dynamical matrix of 6 x 6 follows from the slip u_j - u_i of each contact, whose far end
    moves as its own sphere does times exp(i q R).
    """
    # The contacts of the first sphere along a, b and c.
    contacts = network.n_particles * np.arange(3)
    root_mass = np.sqrt([network.mass[0]] * 3 + [network.inertia[0]] * 3)
    squares = []
    for phase in 2 * np.pi * np.indices((n, n, n)).reshape(3, -1).T / n:
        K = np.zeros((6, 6), complex)
        for axis, contact in enumerate(contacts):
            normal = network.normal[contact]
            kn = network.stiffness_normal[contact]
            kt = network.stiffness_tangential[contact]
            spring = kt * np.eye(3) + (kn - kt) * np.outer(normal, normal)
            at_i = slip_of_motion(network.lever_i[contact])
            at_j = slip_of_motion(network.lever_j[contact])
            slip = np.exp(1j * phase[axis]) * at_j - at_i
            K += slip.conj().T @ spring @ slip
        squares.append(eigvalsh(K / np.outer(root_mass, root_mass)))
    return np.sort(np.concatenate(squares))


@pytest.fixture(scope="module", params=[0.0, 0.2])
def lattice(request):
    """Return a simple lattice sheared by an angle, and the angle."""
    return sheared_lattice(request.param), request.param


def test_a_sheared_crystal_has_the_waves_of_its_lattice(lattice):
    network, _ = lattice
    square = (2 * np.pi * modal.eigenmodes(network, all=True).frequency) ** 2
    expected = bloch_squares(network, 3)
    assert abs(square - expected).max() < 1e-12 * expected[-1]


def test_volume_of_a_sheared_crystal(lattice):
    network, angle = lattice
    volume = 27 * SPACING**3 * np.cos(angle)
    assert network.area * network.length == pytest.approx(volume)


def test_stiffness_matrix_of_a_sheared_crystal(lattice):
    """Compare with forces of unit displacements; entries are up to 1e5 N/m."""
    network, _ = lattice
    K = stiffness_matrix(network).toarray()
    np.testing.assert_allclose(K, slow_stiffness(network), atol=1e-9)


def test_velocity_in_a_sheared_crystal(lattice):
    """Send a wave along y, which stretches springs of one kind alone: sqrt(k / m) times b."""
    network, _ = lattice
    velocity = np.sqrt(SPRINGS_OF_LATTICE[1] / MASS) * SPACING
    moduli = modal.elastic_moduli(network)
    assert moduli.velocities((0, 1, 0))[0] == pytest.approx(velocity, rel=1e-9)


def test_copies_of_an_oblique_cell(oblique):
    """Repeat the cell three times: its moduli stay."""
    tripled = repeat(oblique, 3, 1)
    assert tripled.n_particles == 3 * oblique.n_particles
    np.testing.assert_allclose(tripled.cell_vectors, oblique.cell_vectors * [[3], [1], [1]])
    expected = modal.elastic_moduli(oblique).stiffness
    stiffness = modal.elastic_moduli(tripled).stiffness
    np.testing.assert_allclose(stiffness, expected, atol=1e-9 * expected.max())


def test_a_file_contains_the_cell_vectors(oblique, tmp_path):
    path = tmp_path / "oblique.network.h5"
    write_network(path, oblique)
    again = read_network(path)
    np.testing.assert_array_equal(again.cell_vectors, oblique.cell_vectors)
    assert again.fingerprint == oblique.fingerprint


def test_a_rectangular_cell_has_no_vectors():
    crystal = fcc(cells=(1, 1, 4))
    assert replace(crystal, cell_vectors=np.diag(crystal.cell_size)).cell_vectors is None
