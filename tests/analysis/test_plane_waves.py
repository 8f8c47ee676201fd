"""S_L and S_T of cells without walls: Bloch waves of the crystal, sum rules, long waves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from changes import stiffer
from packings import polydisperse
from refusals import refusal
from scipy.linalg import eigh

import modal
from analysis.estimators.structure_factor import plane_waves, structure_factor, wave_vectors
from modal.modes.mode_set import participation_ratio
from modal.packing.network import Network
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator
from modal.system.root_mass import RootMass
from modal.theory.fcc import FccLattice

CRYSTAL = FccLattice(1e5)


def moments(network: Network, order: Sequence[int], polarisation: str = "L", count: int = 6):
    """Return sums (count,) over all modes of weight times omega^2k, k = 0, 1, ...

    They are products of the dynamical matrix with the plane wave, so no mode is computed. Six
    moments determine the positions and the weights of three lines.
    """
    (vector,) = wave_vectors(network, np.array([order]))
    operator = ContactOperator(network, mass_scaled=True)
    wave = plane_waves(network, vector, polarisation)
    power_times_wave = wave
    sums = []
    for _ in range(count):
        sums.append((wave * power_times_wave).sum())
        power_times_wave = operator.apply(power_times_wave)
    return np.array(sums)


@pytest.fixture(scope="module")
def crystal():
    return modal.fcc(cells=(4, 2, 6), periodic_z=True)


@pytest.fixture(scope="module")
def cell():
    return polydisperse(periodic_z=True)


ORDERS = [(0, 0, 1), (0, 0, 3), (1, 0, 0), (2, 0, 0), (1, 1, 0), (1, 0, 2), (3, 1, -2)]


@pytest.mark.parametrize("polarisation", ["L", "T"])
@pytest.mark.parametrize("order", ORDERS)
def test_moments_of_the_crystal_are_those_of_its_bloch_waves(crystal, order, polarisation):
    """Expand a plane wave of the crystal in the six Bloch waves of its wave vector.

    1e-9: round-off of five products.
    """
    (vector,) = wave_vectors(crystal, np.array([order]))
    frequency, waves = CRYSTAL.bloch(vector)
    direction = vector / np.linalg.norm(vector)
    translation = waves[:3]
    longitudinal = abs(direction @ translation) ** 2
    transverse = ((abs(translation) ** 2).sum(axis=0) - longitudinal) / 2
    weight = {"L": longitudinal, "T": transverse}[polarisation]
    square = (2 * np.pi * frequency) ** 2
    expected = [weight @ square**k for k in range(6)]
    assert moments(crystal, order, polarisation) == pytest.approx(expected, rel=1e-9)


@dataclass
class Lines:
    """Structure factor of a plane wave by the kernel method, and its exact lines by all modes."""

    frequency: np.ndarray
    weight_of_bin: np.ndarray
    mean_square: float
    mode_frequency: np.ndarray
    mode_weight: np.ndarray


RESOLUTION = 4e3
"""Hz; full width of the kernel at half its height."""


@pytest.fixture(scope="module", params=["L", "T"])
def lines(cell, request):
    order = np.array([[1, 0, 2]])
    A = LinearSystem.of(cell).dynamical_matrix.toarray()
    pattern = plane_waves(cell, wave_vectors(cell, order)[0], request.param)
    factor = structure_factor(cell, order, RESOLUTION, None, request.param)
    step = factor.frequency[1] - factor.frequency[0]
    square, vectors = eigh(A)
    return Lines(
        frequency=factor.frequency,
        weight_of_bin=factor.power[0] * step,
        mean_square=np.einsum("ip,ip", pattern, A @ pattern),
        mode_frequency=np.sqrt(np.maximum(square, 0)) / (2 * np.pi),
        mode_weight=((vectors.T @ pattern) ** 2).sum(axis=1),
    )


def test_weights_of_a_structure_factor_add_up_to_one(lines):
    assert lines.weight_of_bin.sum() == pytest.approx(1, abs=0.01)


def test_mean_square_frequency_is_that_of_the_plane_wave(lines):
    """Compare with u . A u of the plane wave u.

    The kernel adds its own variance (resolution / 2.35)^2 to omega^2, at most some 1e-3 of it.
    """
    mean = lines.weight_of_bin @ (2 * np.pi * lines.frequency) ** 2
    assert mean == pytest.approx(lines.mean_square, rel=0.01)


@pytest.mark.parametrize("cut", [4e4, 8e4, 1.6e5])
def test_weight_below_a_frequency_is_that_of_the_modes(lines, cut):
    """Count lines within two resolutions of the cut as uncertain; the rest may be off by 2 %."""
    below = lines.weight_of_bin[lines.frequency < cut].sum()
    uncertain = lines.mode_weight[abs(lines.mode_frequency - cut) < 2 * RESOLUTION].sum()
    exact = lines.mode_weight[lines.mode_frequency < cut].sum()
    assert abs(below - exact) < 0.02 + uncertain


def test_first_moment_of_long_longitudinal_waves_is_the_affine_stiffness():
    """Compare with omega^2 = k^2 C_affine / rho: all spheres follow the wave without turning.

    One wavelength fits in the cell. The difference of the displacements at the ends of a branch
    vector b is sin^2(k b / 2) instead of (k b / 2)^2, smaller by (k b)^2 / 12 of it; b along the
    wave is at most one spacing.
    """
    network = modal.fcc(cells=(10, 2, 2), periodic_z=True)
    (vector,) = wave_vectors(network, np.array([(1, 0, 0)]))
    moduli = modal.elastic_moduli(network)
    square = moments(network, (1, 0, 0), count=2)[1]
    speed = np.sqrt(moduli.affine[0, 0] / moduli.density)
    largest_error = (vector[0] * CRYSTAL.spacing) ** 2 / 12
    assert np.sqrt(square) / vector[0] == pytest.approx(speed, rel=largest_error)


@pytest.fixture(scope="module")
def disordered_crystal():
    """Return 60 layers with springs of 0.5 to 1.5 times the crystal's, at random."""
    network = modal.fcc(cells=(1, 1, 60), periodic_z=True)
    normal, tangential = np.random.default_rng(4).uniform(0.5, 1.5, (2, network.n_contacts))
    return stiffer(network, normal, tangential)


@pytest.mark.parametrize("polarisation", ["L", "T"])
def test_long_waves_have_the_velocities_of_the_moduli(disordered_crystal, polarisation):
    """Measure one wavelength in 60 layers.

    The lattice lowers its frequency by (kappa l)^2 / 24, 5e-4. Disorder scatters the wave by the
    variance of its springs, 1/12, divided by the number of layers: 2e-3.
    """
    velocities = modal.elastic_moduli(disordered_crystal).velocities((0, 0, 1))
    expected = {"L": velocities[0], "T": velocities[1:].mean()}[polarisation]
    order = np.array([(0, 0, 1)])
    factor = structure_factor(disordered_crystal, order, 500.0, 2e4, polarisation)
    frequency = factor.ridge()[0][0]
    assert 2 * np.pi * frequency / factor.wavenumber[0] == pytest.approx(expected, rel=5e-3)


N_SPHERES = 1000


def all_alike(shape):
    shape[:, 2] = 1


def standing_wave(shape):
    height = (np.arange(N_SPHERES) + 0.5) / N_SPHERES
    shape[:, 0] = np.sin(3 * np.pi * height)


def single_sphere(shape):
    shape[7, 1] = 5


def translations_and_rotations(shape):
    """Give each sphere an energy of 2: m v^2 in the lower half, I w^2 in the upper half."""
    shape[: N_SPHERES // 2, 0] = 1
    shape[N_SPHERES // 2 :, 4] = 2


@pytest.mark.parametrize(
    ("motion", "expected"),
    [
        (all_alike, 1),
        (standing_wave, 2 / 3),
        (single_sphere, 1 / N_SPHERES),
        (translations_and_rotations, 1),
    ],
)
def test_participation_ratio_of_a_known_motion(motion, expected):
    """Spread the energy over all spheres, as sin^2, over one sphere; count rotations, too."""
    # Mass 2 and moment of inertia 0.5, as their roots.
    root_mass = RootMass(np.sqrt(np.tile([2.0] * 3 + [0.5] * 3, N_SPHERES)))
    shape = np.zeros((1, N_SPHERES, 6))
    motion(shape[0])
    assert participation_ratio(shape, root_mass) == pytest.approx([expected])


def test_participation_ratio_of_plane_waves_between_walls():
    """Allow 3 %: walls give way, and the wave ends a layer or two of 200 beyond each of them."""
    network = modal.fcc(cells=(1, 1, 200))
    modes = modal.eigenmodes(network, lowest=3)
    assert modes.participation(network) == pytest.approx([2 / 3] * 3, rel=0.03)


def test_debye_level_is_that_of_long_bloch_waves(crystal):
    """Compare the level from moduli with 4 pi times the mean of sum 1 / V^3 over directions.

    V = d omega / d kappa of the three long Bloch waves in each of 400 random directions; the mean
    has a standard error, of which four are allowed.
    """
    directions = np.random.default_rng(3).standard_normal((400, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    kappa = 1e-2 / CRYSTAL.spacing
    inverse_cubes = []
    for direction in directions:
        frequency, _ = CRYSTAL.bloch(kappa * direction)
        velocity = 2 * np.pi * frequency[:3] / kappa
        inverse_cubes.append((1 / velocity**3).sum())
    mean = np.mean(inverse_cubes)
    error = np.std(inverse_cubes) / np.sqrt(len(inverse_cubes))
    level = modal.elastic_moduli(crystal).debye_level
    assert level == pytest.approx(4 * np.pi * mean, abs=4 * np.pi * 4 * error)


def test_reduced_density_of_states_is_divided_by_the_square_of_the_frequency(crystal):
    states = modal.density_of_states(crystal, resolution=1e4)
    frequency = np.array([5e4, 1e5])
    reduced, _ = states.reduced(frequency)
    density, _ = states.density(frequency)
    assert reduced == pytest.approx(density[:, 6] / frequency**2, rel=1e-6, abs=0)


@pytest.mark.parametrize(
    ("order", "polarisation", "code"),
    [
        pytest.param((0, 0, 0), "L", "zero_wave_vector", id="no wave"),
        pytest.param((0.5, 0, 0), "L", "wave_vector", id="half a wave in the cell"),
        pytest.param((1, 0, 0), "P", "unknown_word", id="unknown polarisation"),
    ],
)
def test_wrong_waves_are_refused(cell, order, polarisation, code):
    with refusal(code):
        moments(cell, order, polarisation)


def test_plane_waves_between_walls_are_refused():
    with refusal("not_periodic"):
        moments(modal.fcc(cells=(2, 2, 6)), (0, 0, 1))


def test_a_resolution_of_zero_is_refused(cell):
    with refusal("resolution_or_orders"):
        structure_factor(cell, np.array([(1, 0, 0)]), 0.0)


def test_participation_without_mode_shapes_is_refused():
    slab = modal.fcc(cells=(2, 2, 6))
    modes_without_shapes = replace(modal.eigenmodes(slab, lowest=1), mode_shape=None)
    with refusal("no_mode_shapes"):
        modes_without_shapes.participation(slab)
