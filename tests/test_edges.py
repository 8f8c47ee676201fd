"""Extreme packings: tiny and huge overlaps, contrasts, few contacts, one sphere, far origins.

Every frequency is compared with a closed form or with the singular values of the springs' stretch
matrix. These have an absolute error of eps f_max, frequencies from eigenvalues of K one of
eps f_max^2 / f.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from changes import OPTIONAL, slippery, stiffer
from oracles import kinematics
from places import SHEARED
from refusals import refusal
from scipy.linalg import qr

from analysis.estimators.layer_lattice import LayerLattice
from modal.__main__ import main
from modal.modes.counts import count_below
from modal.modes.eigenmodes import modes_of
from modal.modes.zero_modes import by_structure
from modal.packing import crystal as gallery
from modal.packing.neighbours import tangents
from modal.packing.network import SOURCE_WALL, Network, write_network
from modal.packing.sample import Sample, read_sample
from modal.solvers.factor import factorise
from modal.system.linear_system import LinearSystem
from modal.theory.fcc import FccLattice
from modal.waves.motions import Pulse
from modal.waves.propagate import propagate

EPS = np.finfo(float).eps


def stretch_matrix(network: Network, *, normal_only: bool = False) -> np.ndarray:
    """Return the matrix (springs, 6n) of the stretch of each spring by a unit of each motion.

    A row is multiplied by the root of its stiffness, a column divided by the root of its mass or
    moment of inertia. The singular values are then the angular frequencies.
    """
    B = kinematics(network)
    directions = [(network.normal, network.stiffness_normal)]
    if not normal_only:
        for tangent in tangents(network.normal):
            directions.append((tangent, network.stiffness_tangential))
    rows = []
    for direction, stiffness in directions:
        stretch = np.einsum("ca,cab->cb", direction, B)
        rows.append(np.sqrt(stiffness)[:, None] * stretch)
    rows = np.concatenate(rows)
    i = np.tile(network.particle_i, len(directions))
    j = np.tile(network.particle_j, len(directions))
    G = np.zeros((len(rows), 6 * network.n_particles))
    for k, row in enumerate(rows):
        G[k, 6 * i[k] : 6 * i[k] + 6] += row[:6]
        if j[k] >= 0:
            G[k, 6 * j[k] : 6 * j[k] + 6] += row[6:]
    inertia = np.column_stack([network.mass] * 3 + [network.inertia] * 3)
    return G / np.sqrt(inertia.ravel())


def exact_frequencies(network: Network) -> np.ndarray:
    """Return all frequencies, Hz, ascending: singular values of the stretch matrix / (2 pi)."""
    G = stretch_matrix(network)
    omega = np.linalg.svd(G, compute_uv=False)
    zeros = np.zeros(max(0, G.shape[1] - len(omega)))
    return np.sort(np.concatenate([omega, zeros])) / (2 * np.pi)


def relative_error(frequency: np.ndarray, highest: float, size: int) -> np.ndarray:
    """Return the error of frequencies from K of this size, divided by them.

    Their squares have an error of size * eps * f_max^2 (LAPACK's bound, with p(n) = n).
    """
    return size * EPS * (highest / frequency) ** 2 + 1e-12


STRESSES = [2e-8, 1e-4, 1.0, 1e2, 1e5, 1e8, 6.7e8, 9e8]
"""Pa; overlaps of the crystal from 1e-12 to a tenth of the radius."""


@pytest.mark.parametrize("stress", STRESSES)
def test_resonances_of_a_crystal_under_any_stress(stress):
    """Compare with the chain of layers."""
    network = gallery.fcc(stress, (1, 1, 20))
    modes = modes_of(LinearSystem.of(network), all=True)
    omega, _ = LayerLattice.of_network(network).eigenmodes()
    assert modes.resonance_frequency == pytest.approx(omega / 2 / np.pi, rel=1e-11)


@pytest.mark.parametrize("stress", STRESSES)
def test_overlaps_of_a_crystal_are_found_from_its_positions(stress):
    """Subtract positions to find the overlaps, which costs eps times the length."""
    network = gallery.fcc(stress, (1, 1, 20))
    sample = Sample(network.position, network.cell_size[:2], network.wall_position, 0.1)
    rebuilt = sample.network()
    assert rebuilt.n_contacts == network.n_contacts
    loss = 4 * EPS * network.length / FccLattice(stress).overlap
    assert np.sort(rebuilt.overlap) == pytest.approx(np.sort(network.overlap), rel=loss, abs=0)


def with_stiffness_contrast(network: Network, decades: float, seed: int = 1) -> Network:
    """Return a network whose stiffnesses differ by up to so many decades."""
    exponent = -decades * np.random.default_rng(seed).random(network.n_contacts)
    factor = 10**exponent
    return stiffer(network, factor, factor)


def with_mass_contrast(network: Network, decades: float, seed: int = 1) -> Network:
    """Return a network whose masses differ by up to so many decades; inertia is as m^(5/3)."""
    exponent = decades * np.random.default_rng(seed).random(network.n_particles)
    factor = 10**exponent
    mass = network.mass * factor
    inertia = network.inertia * factor ** (5 / 3)
    return network.unchecked(mass=mass, inertia=inertia)


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((with_stiffness_contrast, 4), id="stiffness 4 decades"),
        pytest.param((with_stiffness_contrast, 8), id="stiffness 8 decades"),
        pytest.param((with_stiffness_contrast, 12), id="stiffness 12 decades"),
        pytest.param((with_mass_contrast, 3), id="mass 3 decades"),
        # Radii 1 to 100, moments of inertia over ten decades.
        pytest.param((with_mass_contrast, 6), id="mass 6 decades"),
    ],
)
def contrasted(request):
    """Return a system of large contrast and its exact frequencies."""
    change, decades = request.param
    network = change(gallery.fcc(cells=(2, 2, 15)), decades)
    return LinearSystem.of(network), exact_frequencies(network)


def test_all_modes_at_large_contrast(contrasted):
    system, exact = contrasted
    frequency = modes_of(system, all=True).frequency
    bound = relative_error(exact, exact[-1], system.size)
    assert (abs(frequency / exact - 1) < bound).all()


def test_lowest_modes_at_large_contrast(contrasted):
    system, exact = contrasted
    modes = modes_of(system, lowest=4)
    assert modes.attributes["certified"]
    bound = relative_error(exact[:4], exact[-1], system.size)
    assert (abs(modes.frequency / exact[:4] - 1) < bound).all()


def test_highest_modes_at_large_contrast(contrasted):
    system, exact = contrasted
    assert modes_of(system, highest=2).frequency == pytest.approx(exact[-2:], rel=1e-10)


def test_count_at_large_contrast(contrasted):
    system, exact = contrasted
    between = (exact[100] + exact[101]) / 2
    assert count_below(system, between) == 101


def test_more_contrast_than_double_precision_holds_is_refused():
    """Refuse masses over nine decades: omega^2 spans fourteen, the lowest are not separated."""
    network = with_mass_contrast(gallery.fcc(cells=(2, 2, 40)), 9)
    with refusal("not_converged"):
        modes_of(LinearSystem.of(network), lowest=6)


@pytest.mark.parametrize("ratio", [0.0, 1e-9, 1e-6, 1e-3, 0.5, 1.0])
def test_tangential_over_normal_stiffness(ratio):
    """Compare squares, as frequencies of zero are found with either sign."""
    network = gallery.fcc(cells=(2, 2, 6))
    network = replace(network, stiffness_tangential=ratio * network.stiffness_normal)
    system = LinearSystem.of(network)
    exact = exact_frequencies(network)
    frequency = modes_of(system, all=True).frequency
    error = system.size * EPS * exact[-1] ** 2
    assert abs(np.sign(frequency) * frequency**2 - exact**2).max() < error


def test_floppy_modes_without_tangential_springs():
    """Count three spins of every sphere, and two translations of all spheres along both walls."""
    network = gallery.fcc(cells=(2, 2, 6))
    network = replace(network, stiffness_tangential=0 * network.stiffness_normal)
    assert by_structure(LinearSystem.of(network)).total == 3 * network.n_particles + 2


@pytest.mark.parametrize("ratio", [1e-9, 1e-6, 1e-3, 0.5, 1.0])
def test_no_floppy_modes_with_tangential_springs(ratio):
    network = gallery.fcc(cells=(2, 2, 6))
    network = replace(network, stiffness_tangential=ratio * network.stiffness_normal)
    assert by_structure(LinearSystem.of(network)).total == 0


def sphere_held_at(normals: np.ndarray) -> Network:
    """Return one sphere held by contacts in the directions `normals` (m, 3)."""
    sphere = gallery.column(1)
    n_contacts = len(normals)
    return sphere.unchecked(
        particle_i=np.zeros(n_contacts, int),
        particle_j=np.full(n_contacts, SOURCE_WALL),
        normal=normals,
        lever_i=sphere.radius[0] * normals,
        lever_j=0 * normals,
        stiffness_normal=np.full(n_contacts, 1e6),
        stiffness_tangential=np.full(n_contacts, 8e5),
        **dict.fromkeys(OPTIONAL),
    )


@pytest.mark.parametrize("angle", [1e-1, 1e-2, 1e-3, 1e-4])
def test_nearly_coincident_contacts(angle):
    """Hold a sphere at three points within a small angle: it rocks softly, in proportion to it."""
    sine = np.sin(angle)
    cosine = np.cos(angle)
    network = sphere_held_at(np.array([[0, 0, -1], [sine, 0, -cosine], [0, sine, -cosine]]))
    system = LinearSystem.of(network)
    exact = exact_frequencies(network)
    frequency = modes_of(system, all=True).frequency
    assert by_structure(system).total == 0
    assert (abs(frequency / exact - 1) < relative_error(exact, exact[-1], 6)).all()


@dataclass
class Isostatic:
    """A network of translations with normal springs that could lose no spring without a mode."""

    network: Network
    stretch: np.ndarray
    """The stretch matrix (springs, 3n)."""
    independent: np.ndarray
    """Contacts (3n,) whose springs are linearly independent."""


@pytest.fixture(scope="module")
def isostatic():
    """Choose as many independent springs of a distorted crystal as it has translations.

    The normals are turned at random: without symmetry no state of self-stress is left by accident.
    """
    crystal = gallery.fcc(cells=(4, 4, 16))
    normal = crystal.normal + 0.05 * np.random.default_rng(3).standard_normal(crystal.normal.shape)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    crystal = crystal.unchecked(normal=normal, stiffness_tangential=0 * crystal.overlap)
    translations = np.arange(6 * crystal.n_particles).reshape(-1, 6)[:, :3].ravel()
    stretch = stretch_matrix(crystal, normal_only=True)[:, translations]
    _, order = qr(stretch.T, mode="r", pivoting=True)
    return Isostatic(crystal, stretch, order[: stretch.shape[1]])


@pytest.mark.parametrize("removed", [0, 1, 5])
def test_isostatic_network_without_stress(isostatic, removed):
    """Find one zero mode for every spring that is removed (Maxwell)."""
    n_springs = len(isostatic.independent) - removed
    contacts = np.sort(isostatic.independent[:n_springs])
    system = LinearSystem.of(isostatic.network.with_contacts(contacts), translations_only=True)
    softest = np.linalg.svd(isostatic.stretch[contacts], compute_uv=False)[-1] / (2 * np.pi)
    # f_max is 200 kHz; a mode can be counted if it is far above round-off, sqrt(eps) f_max.
    assert softest > 1e-5 * 2e5
    assert count_below(system, softest / 2) == removed
    factor = factorise(system.shifted((np.pi * softest) ** 2), solver="blocks", kept=False)
    assert factor.negative == removed


@pytest.mark.parametrize("distance", [1.0, 1e3])
def test_waves_far_from_the_origin_are_the_same(distance):
    """Move a network along all axes: its springs do not depend on where it is."""
    network = read_sample(SHEARED).network()
    walls = network.wall_position + distance
    moved = replace(network, position=network.position + distance, wall_position=walls)
    # The default pulse depends on the length between walls, which the shift rounds.
    settings = {"motion": Pulse(), "interval": 1e-6}
    wave = propagate(network, 2e-5, **settings).signals
    moved_wave = propagate(moved, 2e-5, **settings).signals
    assert np.array_equal(moved_wave.chain_particle, wave.chain_particle)
    assert np.array_equal(moved_wave.chain_displacement, wave.chain_displacement)


@pytest.mark.parametrize("distance", [1.0, 1e3])
def test_overlaps_far_from_the_origin_lose_digits_alone(distance):
    """Move a sample up: positions are rounded to eps times the distance."""
    sample = read_sample(SHEARED)
    network = sample.network()
    position = sample.position + [0, 0, distance]
    moved = replace(sample, position=position, walls=sample.walls + distance).network()
    assert moved.n_contacts == network.n_contacts
    # Two positions make an overlap.
    assert abs(moved.overlap - network.overlap).max() < 2 * EPS * distance


def single_spheres():
    """Return networks of one sphere between walls: alone or touching its images, also slipping."""
    column = gallery.column(1)
    crystal = gallery.fcc(cells=(1, 1, 1))
    return {
        "alone": column,
        "with images": crystal,
        "alone and slipping": slippery(column),
        "with images and slipping": slippery(crystal),
    }


@pytest.fixture(scope="module", params=single_spheres().values(), ids=single_spheres())
def sphere(request):
    """Return a network of one sphere: the wall's number -2 is outside its arrays."""
    network = request.param
    assert network.n_particles == 1
    return network


def test_modes_of_a_single_sphere(sphere):
    """Compare with the singular values; a millionth of the largest frequency counts as zero."""
    exact = exact_frequencies(sphere)
    system = LinearSystem.of(sphere)
    n_floppy = int((exact < 1e-6 * exact[-1]).sum())
    assert by_structure(system).total == n_floppy
    frequency = modes_of(system, all=True).frequency
    assert frequency[n_floppy:] == pytest.approx(exact[n_floppy:], rel=1e-12)
    assert count_below(system, exact[-1] / 2) == int((exact < exact[-1] / 2).sum())


def test_wave_in_a_single_sphere(sphere):
    assert propagate(sphere, 1e-5).signals.chain_displacement[-1] > 0


@pytest.mark.parametrize(
    "command",
    [
        "info",
        "modes --lowest 1",
        "modes --highest 1",
        "modes --all",
        "count --at 1e5",
        "density",
        "wave --duration 1e-5 -o out.h5",
        "response",
    ],
)
def test_every_command_takes_a_single_sphere(sphere, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_network("sphere.network.h5", sphere)
    name, *options = command.split()
    assert main([name, "sphere.network.h5", *options]) == 0
