"""The error that a wave or a response is told to have is above the true one, by dense oracles."""

from functools import cache

import numpy as np
import pytest
from oracles import wall_pattern
from refusals import refusal
from test_sources import dense_wave

import modal
from modal.packing import crystal as gallery
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.linear_system import LinearSystem
from modal.waves.motions import Pulse, SampledMotion, chirp, step
from modal.waves.sources import Wall

PACKINGS = {
    "crystal": lambda: modal.fcc(cells=(1, 1, 12)),
    "column": lambda: gallery.column(8),
    "random": lambda: modal.random_packing(spheres=30, seed=2),
}
RECORDED = np.array([0, 1.1e-5, 3e-5, 4.7e-5, 1.3e-4, 2.2e-4])
MOTIONS = {
    "step": step(1e-9, 1e-4),
    "chirp": chirp(1e-9, 1e4, 5e4, 4e-4),
    "pulse": Pulse(cycles=3),
    "recorded": SampledMotion(RECORDED, 1e-9 * np.array([0, 1, -2, 0.5, 1, -1])),
}
EVERY, DURATION = 2e-5, 2e-3


@cache
def network_of(name):
    return PACKINGS[name]()


@cache
def exact(name, moved):
    """Motion (nt, n) and stresses on both walls by matrix exponentials of state and source."""
    network, time = network_of(name), EVERY * np.arange(round(DURATION / EVERY) + 1)
    u, *forces = dense_wave(network, Wall(), "z", "none", None, MOTIONS[moved], time)
    return u, np.array(forces) / network.area


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("moved", MOTIONS)
@pytest.mark.parametrize("name", PACKINGS)
def test_wave_is_as_exact_as_told(name, moved, tolerance):
    """Of the largest motion, and of the largest stress on either wall; the oracle's is 3e-10."""
    u, stress = exact(name, moved)
    wave = modal.propagate(
        network_of(name), DURATION, interval=EVERY, motion=MOTIONS[moved], tolerance=tolerance,
        particles=True,
    )  # fmt: skip
    found = np.array([wave.signals.source_stress, wave.signals.receiver_stress])
    assert wave.truncation <= tolerance
    for a, b in ((wave.signals.particle_displacement, u), (found, stress)):
        assert abs(a - b).max() <= wave.truncation * abs(b).max()


def test_stress_that_has_not_come_yet_counts_beside_the_sources():
    """Else the wave would be summed until round-off ends it, for a receiver that hears nothing."""
    crystal = modal.fcc(cells=(1, 1, 100))
    wave = modal.propagate(crystal, 1e-5, tolerance=1e-6)
    assert abs(wave.signals.receiver_stress).max() < 1e-9 * abs(wave.signals.source_stress).max()
    assert 1e-12 < wave.truncation <= 1e-6
    # Beside those of the end of the spectrum, which both have.
    end, closer = (
        LinearSystem.of(crystal).spectral_bound_and_cost[1],
        modal.propagate(crystal, 1e-5, tolerance=1e-12),
    )
    assert wave.products - end < 0.9 * (closer.products - end)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
@pytest.mark.parametrize("resolution", [1e3, 1e4])
@pytest.mark.parametrize("name", [*PACKINGS, "long"])
def test_response_keeps_its_tolerance(name, resolution, tolerance, monkeypatch):
    """Of the largest of each record over the frequencies: by all modes, in closed form."""
    monkeypatch.setitem(PACKINGS, "long", lambda: modal.fcc(cells=(1, 1, 60)))
    network = network_of(name)
    found = modal.frequency_response(network, resolution=resolution, tolerance=tolerance)
    root = np.sqrt(mass_diagonal(network))
    square, shape = np.linalg.eigh(stiffness_matrix(network).toarray() / root / root[:, None])
    (push, row, held), (_, far, _) = (
        wall_pattern(network, w) for w in (SOURCE_WALL, RECEIVER_WALL)
    )
    s = (2 * np.pi * found.frequency + 1j * np.pi * resolution) ** 2
    u = ((shape.T @ (push / root)) / (square - s[:, None])) @ shape.T / root
    for a, b in (
        (found.chain_displacement, u[:, 6 * found.chain_particle + 2]),
        (found.source_stress, (held - u @ row) / network.area),
        (found.receiver_stress, u @ far / network.area),
    ):
        assert abs(a - b).max() <= tolerance * abs(b).max()


def test_what_round_off_hides_is_not_said():
    """Of a wave the told error is then above the tolerance; a response is refused."""
    network = modal.fcc(cells=(1, 1, 60))
    wave = modal.propagate(network, 1e-4, tolerance=1e-16)
    assert 1e-16 < wave.truncation < 1e-11
    with refusal("not_converged"):
        modal.frequency_response(network, resolution=1e5)
