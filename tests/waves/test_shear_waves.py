"""S-waves: the linear wave against the crystal's sliding and turning layers, exactly."""

import numpy as np
import pytest
from changes import stiffer
from refusals import refusal
from shear_lattice import ShearLattice

import modal
from analysis.estimators.damped_transform import chain_dispersion
from modal.theory.fcc import FccLattice
from modal.waves.motions import Pulse

CRYSTAL = FccLattice(1e5)
LAYERS = 40
EXACT = ShearLattice.of_crystal(CRYSTAL, LAYERS)


@pytest.fixture(scope="module")
def crystal():
    return modal.fcc(cells=(2, 2, LAYERS))


def test_branches_are_those_of_bloch():
    """Compare two of six Bloch waves at any wave number along z, twice: along x and along y."""
    kappa = np.linspace(0.02, 1, 9) * np.pi / CRYSTAL.layer_distance
    branches = EXACT.branches(kappa) / (2 * np.pi)
    for k, pair in zip(kappa, branches.T, strict=True):
        bloch = CRYSTAL.bloch(np.array([0, 0, k]))[0]
        # The longest wave has 1/2,000 of the largest omega^2 of the 6 x 6 matrix: 2,000 eps.
        for f in pair:
            assert (abs(bloch / f - 1) < 1e-11).sum() >= 2
    slope = branches[0, 0] * 2 * np.pi / kappa[0]
    # The branch bends by some (kappa l)^2 / 24 = 2e-4.
    assert slope == pytest.approx(EXACT.velocity, rel=5e-4)
    moduli = modal.elastic_moduli(modal.fcc(cells=(1, 1, 2), periodic_z=True))
    assert moduli.velocities((0, 0, 1))[1:] == pytest.approx([EXACT.velocity] * 2, rel=1e-9)


def test_modes_between_walls_are_among_all_modes(crystal):
    """Find the modes of layers that move as a whole at least twice: along x and along y."""
    frequency_of_all = modal.eigenmodes(crystal, all=True).frequency
    # The lowest mode has 1e-4 of the largest omega^2, whose round-off is some tens of eps.
    for f in EXACT.eigenmodes()[0] / (2 * np.pi):
        assert (abs(frequency_of_all / f - 1) < 1e-9).sum() >= 2


@pytest.mark.parametrize("direction", ["x", "y"])
def test_linear_wave_against_the_exact_layers(crystal, direction):
    """Compare within 1e-9: the expansion's tolerance is 1e-12 of its largest coefficient."""
    wave = modal.propagate(
        crystal,
        duration=3e-4,
        direction=direction,
        tolerance=1e-12,
        particles=True,
        motion=Pulse(2.5e-9, 1e5),
        interval=1e-6,
    )
    signals = wave.signals
    exact = EXACT.displacement(signals.time, 2.5e-9, 1e5)
    scale = abs(exact).max()
    layer = np.repeat(np.arange(LAYERS), 4)
    assert signals.particle_displacement == pytest.approx(exact[:, layer], abs=1e-9 * scale)
    expected = exact[:, layer[signals.chain_particle]]
    assert signals.chain_displacement == pytest.approx(expected, abs=1e-9 * scale)
    assert signals.direction == direction
    # Far from the source wall the wave has come by V_S, not by V_P: its peak is half a period late.
    last = exact[:, -5]
    peak = signals.time[np.argmax(abs(last))]
    distance = (LAYERS - 5) * CRYSTAL.layer_distance
    assert distance / CRYSTAL.velocity + 1e-5 < peak < distance / EXACT.velocity + 2.5e-5


def test_chi_tells_shear_from_compression(crystal):
    """Check modes that move along x alone: chi_x is 1 and chi_z is 0; sums are 1 for all modes."""
    modes = modal.eigenmodes(crystal, lowest=6)
    total = modes.chi("x") + modes.chi("y") + modes.chi("z")
    # Shares of one sum of 640 squares each: 640 eps at most.
    assert total == pytest.approx(np.ones(6), abs=1e-12)
    assert modes.chi("z") == pytest.approx(modes.chi_z, abs=1e-12)
    # Modes have converged to 1e-10 of omega^2; chi_z is quadratic in what a mode lacks.
    first = EXACT.eigenmodes()[0][0] / (2 * np.pi)
    assert modes.frequency[:2] == pytest.approx([first] * 2, rel=1e-9)
    assert modes.chi_z[:2] == pytest.approx([0, 0], abs=1e-9)
    with refusal("axis", "'w'"):
        modes.chi("w")


def test_directions_that_the_wall_cannot_take(crystal):
    smooth = stiffer(crystal, 1, ~crystal.with_wall)
    with refusal("source_moves_nothing", "tangential"):
        modal.propagate(smooth, duration=1e-5, direction="x")
    with refusal("direction", "torsion"):
        modal.propagate(crystal, duration=1e-5, direction="r")


def test_dispersion_of_an_s_wave_from_its_signals():
    """Fit the chain's neighbour ratio by a polynomial of higher order: layers that turn bend it."""
    lattice = ShearLattice.of_crystal(CRYSTAL, 200)
    wave = modal.propagate(modal.fcc(cells=(1, 1, 200)), 7e-4, interval=5e-7, direction="x")
    dispersion = chain_dispersion(wave.signals, order=5)
    kappa = np.linspace(0.02, 0.9, 100) * np.pi / CRYSTAL.layer_distance
    branch = lattice.branches(kappa)[0]
    assert np.sqrt(np.mean((dispersion.omega(kappa) / branch - 1) ** 2)) < 2e-4
    assert dispersion.velocity == pytest.approx(lattice.velocity, rel=2e-4)
    edge = lattice.branches(np.array([np.pi / CRYSTAL.layer_distance]))[0, 0] / (2 * np.pi)
    assert dispersion.low_pass_frequency == pytest.approx(edge, rel=2e-3)
