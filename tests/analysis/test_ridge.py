"""Wavelength over frequency of lattices that are known in closed form."""

import numpy as np
import pytest
from exact_crystal import CHAIN, noisy
from scipy.linalg import eigh
from shear_lattice import driven_by_pulse

from analysis.estimators.layer_lattice import LayerLattice, lattice_signals
from analysis.estimators.ridge import ridge
from analysis.packing_data import PackingData
from analysis.quantities.passband import edge_wavelength, wavelength_at
from modal.packing.crystal import fcc
from modal.waves.motions import Pulse
from modal.waves.signals import Signals


def second_neighbours(share: float, passages: float) -> Signals:
    """Record a chain with springs C to the next and share C to the second neighbour.

    Amplitude and pulse are those of the crystal's record; the motion is the sum of the modes.
    """
    u = np.eye(CHAIN.layers)
    # Extensions of the springs.
    near = u[1:] - u[:-1]
    far = u[2:] - u[:-2]
    stiffness = CHAIN.stiffness * (near.T @ near + share * far.T @ far)
    stiffness[[0, -1], [0, -1]] += CHAIN.wall_stiffness
    square, shape = eigh(stiffness / CHAIN.mass)
    velocity = np.sqrt(1 + 4 * share) * CHAIN.velocity
    time = np.arange(0, passages * CHAIN.layers * CHAIN.distance / velocity, 4e-7)
    record = lattice_signals(CHAIN, time)

    force = 2.5e-9 * CHAIN.wall_stiffness / CHAIN.mass * shape[0]
    record.chain_displacement = (force * driven_by_pulse(time, np.sqrt(square), 1e5)) @ shape.T
    return record


def exact_frequency(share: float, kappa: np.ndarray) -> np.ndarray:
    """Return the frequency, Hz, of such a chain without ends at a wave number, 1/m."""
    half = kappa * CHAIN.distance / 2
    square = np.sin(half) ** 2 + share * np.sin(2 * half) ** 2
    return np.sqrt(4 * CHAIN.stiffness / CHAIN.mass * square) / (2 * np.pi)


@pytest.mark.parametrize("passages", [1.0, 1.95])
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_each_lattice_gives_its_own_wavelengths(share, passages):
    """Find the band edge of springs C / 2 to second neighbours at cos kappa l = -1/2: 3 l, not 2 l.

    A window of T resolves 1/T, 3 to 6 kHz of 140; a peak is located to some thirtieth of that,
    about 0.1 kHz, which is 0.5 % of the lowest frequency here. At the edge the resolution of the
    chain decides, 1 / 100 of the wave number.
    """
    edge = np.arccos(-0.5 if share else -1.0) / CHAIN.distance
    measured = ridge(second_neighbours(share, passages))
    for part in (0.1, 0.25, 0.5):
        frequency = float(exact_frequency(share, part * edge))
        assert measured.wavelength(frequency) == pytest.approx(2 * np.pi / (part * edge), rel=5e-3)
    assert measured.edge_wavelength == pytest.approx(2 * np.pi / edge, rel=1e-2)
    assert measured.edge_frequency == pytest.approx(exact_frequency(share, edge), rel=3e-3)


def test_other_distance_gives_other_ratio_to_the_diameter():
    """Measure a straight row of spheres, a diameter apart: the edge is 2 D, not that of the FCC."""
    row = LayerLattice(mass=1e-6, stiffness=3e6, wall_stiffness=1e6, distance=1e-3, layers=120)
    time = np.arange(0, 120 * row.distance / row.velocity, 1e-7)
    measured = ridge(lattice_signals(row, time, Pulse(frequency=3e5)))
    assert measured.edge_wavelength == pytest.approx(2e-3, rel=1e-2)


@pytest.mark.parametrize(
    ("noise", "edge_wavelength"),
    [
        pytest.param(1e-3, 2 * CHAIN.distance, id="weak noise"),
        pytest.param(0.3, np.nan, id="noise that hides the edge"),
    ],
)
def test_noise_that_hides_the_edge_gives_no_wavelength(noise, edge_wavelength):
    record = lattice_signals(CHAIN, np.arange(0, 3.5e-4, 4e-7))
    measured = ridge(noisy(record, noise, np.random.default_rng(3)))
    assert measured.edge_wavelength == pytest.approx(edge_wavelength, rel=1e-2, nan_ok=True)


def test_measured_case_has_no_wavelength_above_its_edge():
    """Measure an FCC column, with sqrt 2 D at its edge, and no wavelength above."""
    crystal = PackingData(fcc(cells=(1, 1, 200)))
    assert edge_wavelength(crystal, "linear").value == pytest.approx(np.sqrt(2), rel=1e-2)
    edge = crystal.lattice.low_pass_frequency
    for share in (1.01, 1.2, 2):
        assert np.isnan(wavelength_at(crystal, share * edge, "linear"))
    # kappa l = pi / 2
    exact = 2 * np.pi / (np.pi / 2 / crystal.lattice.distance)
    measured = wavelength_at(crystal, edge * np.sin(np.pi / 4), "linear")
    assert measured == pytest.approx(exact, rel=5e-3)
