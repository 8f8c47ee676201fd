"""S_L and S_T of cells without walls: Bloch waves of the crystal, sum rules, long waves."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
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
    """Sums (count,) over all modes of weight times omega^2k, k = 0, 1, ..., without any mode.

    Those of six lines say where these are and what each weighs.
    """
    (vector,) = wave_vectors(network, np.array([order]))
    operator = ContactOperator(network, mass_scaled=True)
    start = now = plane_waves(network, vector, polarisation)
    found = []
    for _ in range(count):
        found.append((start * now).sum())
        now = operator.apply(now)
    return np.array(found)


@pytest.fixture(scope="module")
def crystal():
    return modal.fcc(cells=(4, 2, 6), periodic_z=True)


@pytest.fixture(scope="module")
def cell():
    return polydisperse(periodic_z=True)


ORDERS = [(0, 0, 1), (0, 0, 3), (1, 0, 0), (2, 0, 0), (1, 1, 0), (1, 0, 2), (3, 1, -2)]


@pytest.mark.parametrize("order", ORDERS)
def test_moments_of_the_crystal_are_those_of_its_bloch_waves(crystal, order):
    """A plane wave of the crystal is a sum of its six Bloch waves, by the parts that these have.

    1e-9: round-off of five products.
    """
    (vector,) = wave_vectors(crystal, np.array([order]))
    frequency, waves = CRYSTAL.bloch(vector)
    along = vector / np.linalg.norm(vector)
    share = abs(along @ waves[:3]) ** 2
    across = ((abs(waves[:3]) ** 2).sum(axis=0) - share) / 2
    square = (2 * np.pi * frequency) ** 2
    for polarisation, weight in (("L", share), ("T", across)):
        expected = [weight @ square**k for k in range(6)]
        assert moments(crystal, order, polarisation) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("polarisation", ["L", "T"])
def test_sum_rules_of_a_random_cell(cell, polarisation):
    """Weights add up to 1; the mean omega^2 is the pattern's own, as of all modes."""
    order, resolution = np.array([[1, 0, 2]]), 4e3
    A = LinearSystem.of(cell).dynamical_matrix.toarray()
    pattern = plane_waves(cell, wave_vectors(cell, order)[0], polarisation)
    wanted = np.einsum("ip,ip", pattern, A @ pattern)
    found = structure_factor(cell, order, resolution, None, polarisation)
    step = found.frequency[1] - found.frequency[0]
    assert found.power[0].sum() * step == pytest.approx(1, abs=0.01)
    # The kernel adds its own variance to omega^2: (resolution / 2.35)^2, at most some 1e-3 of it.
    mean = found.power[0] @ (2 * np.pi * found.frequency) ** 2 * step
    assert mean == pytest.approx(wanted, rel=0.01)
    # Against the modes themselves, each a line: what lies below a frequency.
    square, vectors = eigh(A)
    weight = ((vectors.T @ pattern) ** 2).sum(axis=1)
    for f in (4e4, 8e4, 1.6e5):
        below = found.power[0][found.frequency < f].sum() * step
        near = weight[abs(np.sqrt(abs(square)) / (2 * np.pi) - f) < 2 * resolution].sum()
        exact = weight[square < (2 * np.pi * f) ** 2].sum()
        assert abs(below - exact) < 0.02 + near


def test_first_moment_of_long_longitudinal_waves_is_the_affine_stiffness():
    """omega^2 = k^2 C_affine / rho for a wave that all spheres follow without turning.

    Of cosine and sine in a cell that a wave just fits in: sin^2(k b / 2) is bent by (k b)^2 / 12,
    b up to two radii of some 13 in the cell: 3 %; the density is that of all that carries force.
    """
    network = modal.fcc(cells=(10, 2, 2), periodic_z=True)
    (vector,) = wave_vectors(network, np.array([(1, 0, 0)]))
    moduli = modal.elastic_moduli(network)
    square = moments(network, (1, 0, 0), count=2)[1]
    speed = np.sqrt(moduli.affine[0, 0] / moduli.density)
    bent = (vector[0] * CRYSTAL.spacing) ** 2 / 12
    assert np.sqrt(square) / vector[0] == pytest.approx(speed, rel=bent)


def test_long_waves_of_a_disordered_cell_have_the_velocities_of_its_moduli():
    """One wave in 60 layers of random springs, 0.5 to 1.5 of the crystal's.

    The wave bends by (kappa l)^2 / 24, 5e-4; beyond that disorder alone, which scatters it by the
    squared share of its springs' deviation, 1/12, in 60 layers: 2e-3.
    """
    network = modal.fcc(cells=(1, 1, 60), periodic_z=True)
    random = np.random.default_rng(4).uniform(0.5, 1.5, (2, network.n_contacts))
    network = replace(
        network,
        stiffness_normal=network.stiffness_normal * random[0],
        stiffness_tangential=network.stiffness_tangential * random[1],
    )
    v = modal.elastic_moduli(network).velocities((0, 0, 1))
    order = np.array([(0, 0, 1)])
    for polarisation, wanted in (("L", v[0]), ("T", v[1:].mean())):
        found = structure_factor(network, order, 500.0, 2e4, polarisation)
        speed = 2 * np.pi * found.ridge()[0][0] / found.wavenumber[0]
        assert speed == pytest.approx(wanted, rel=5e-3)


def test_participation_ratio():
    """Plane standing waves 2/3, a motion of all alike 1, one sphere 1/n; a rotation counts too."""
    n = 1000
    z = (np.arange(n) + 0.5) / n
    root = RootMass(np.sqrt(np.tile([2.0] * 3 + [0.5] * 3, n)))
    shape = np.zeros((4, n, 6))
    shape[0, :, 2] = 1
    shape[1, :, 0] = np.sin(3 * np.pi * z)
    shape[2, 7, 1] = 5
    shape[3, : n // 2, 0], shape[3, n // 2 :, 4] = 1, 2  # 2 of m v^2 against 2 of I w^2
    assert participation_ratio(shape, root) == pytest.approx([1, 2 / 3, 1 / n, 1])
    # Walls give way: the waves end a little beyond them, by a layer or two of 200.
    network = modal.fcc(cells=(1, 1, 200))
    found = modal.eigenmodes(network, lowest=3)
    assert found.participation(network) == pytest.approx([2 / 3] * 3, rel=0.03)


def test_density_of_states_is_level_at_the_debye_level(crystal):
    """Modes of an endless crystal in a small sphere of frequencies, from Bloch's slopes.

    The level from moduli against a mean over random directions of 1 / V^3 of long Bloch waves.
    """
    moduli = modal.elastic_moduli(crystal)
    random = np.random.default_rng(3).standard_normal((400, 3))
    total = []
    for n in random / np.linalg.norm(random, axis=1)[:, None]:
        kappa = 1e-2 / CRYSTAL.spacing
        slope = 2 * np.pi * CRYSTAL.bloch(kappa * n)[0][:3] / kappa
        total.append((1 / slope**3).sum())
    mean, error = np.mean(total), np.std(total) / np.sqrt(len(total))
    assert moduli.debye_level == pytest.approx(4 * np.pi * mean, abs=4 * np.pi * 4 * error)
    states = modal.density_of_states(crystal, resolution=1e4)
    value, error = states.reduced(np.array([5e4, 1e5]))
    full, _ = states.density(np.array([5e4, 1e5]))
    assert value == pytest.approx(full[:, 6] / np.array([5e4, 1e5]) ** 2, rel=1e-6, abs=0)


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
