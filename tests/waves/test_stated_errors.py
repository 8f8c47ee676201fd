"""The reported error of a wave or a response is above the true one, by dense oracles."""

from functools import cache

import numpy as np
import pytest
from dense_waves import dense_wave
from oracles import wall_pattern
from refusals import refusal

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
INTERVAL = 2e-5
DURATION = 2e-3


@cache
def network_of(name):
    return PACKINGS[name]()


@cache
def exact_wave(name, motion):
    """Return motion (nt, n) and stresses on both walls by exponentials of state and source."""
    network = network_of(name)
    time = INTERVAL * np.arange(round(DURATION / INTERVAL) + 1)
    u, *forces = dense_wave(network, Wall(), "z", "none", None, MOTIONS[motion], time)
    return u, np.array(forces) / network.area


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", PACKINGS)
def test_wave_is_as_exact_as_reported(name, motion, tolerance):
    """Compare with exponentials, relative to the largest motion and stress.

    The error of the exponentials is 3e-10.
    """
    u, stress = exact_wave(name, motion)
    wave = modal.propagate(
        network_of(name),
        DURATION,
        interval=INTERVAL,
        motion=MOTIONS[motion],
        tolerance=tolerance,
        particles=True,
    )
    signals = wave.signals
    assert wave.truncation <= tolerance
    assert relative_error(signals.particle_displacement, u) <= wave.truncation
    stresses = np.array([signals.source_stress, signals.receiver_stress])
    assert relative_error(stresses, stress) <= wave.truncation


def relative_error(record, expected):
    return abs(record - expected).max() / abs(expected).max()


def test_stress_that_has_not_arrived_is_judged_with_that_of_the_source():
    """End the sum for a receiver without a signal before round-off ends it."""
    crystal = modal.fcc(cells=(1, 1, 100))
    wave = modal.propagate(crystal, 1e-5, tolerance=1e-6)
    assert abs(wave.signals.receiver_stress).max() < 1e-9 * abs(wave.signals.source_stress).max()
    assert 1e-12 < wave.truncation <= 1e-6
    more_exact = modal.propagate(crystal, 1e-5, tolerance=1e-12)
    # Both take the same products for the end of the spectrum.
    _, end_products = LinearSystem.of(crystal).spectral_bound_and_cost
    assert wave.products - end_products < 0.9 * (more_exact.products - end_products)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
@pytest.mark.parametrize("resolution", [1e3, 1e4])
@pytest.mark.parametrize("name", [*PACKINGS, "long"])
def test_response_keeps_its_tolerance(name, resolution, tolerance, monkeypatch):
    """Compare with all modes, relative to the largest of each record over the frequencies."""
    monkeypatch.setitem(PACKINGS, "long", lambda: modal.fcc(cells=(1, 1, 60)))
    network = network_of(name)
    response = modal.frequency_response(network, resolution=resolution, tolerance=tolerance)
    root = np.sqrt(mass_diagonal(network))
    square, shape = np.linalg.eigh(stiffness_matrix(network).toarray() / root / root[:, None])
    push, pull, holding_force = wall_pattern(network, SOURCE_WALL)
    _, receiver_pull, _ = wall_pattern(network, RECEIVER_WALL)
    s = (2 * np.pi * response.frequency + 1j * np.pi * resolution) ** 2
    u = ((shape.T @ (push / root)) / (square - s[:, None])) @ shape.T / root
    chain = u[:, 6 * response.chain_particle + 2]
    source_stress = (holding_force - u @ pull) / network.area
    receiver_stress = u @ receiver_pull / network.area
    assert relative_error(response.chain_displacement, chain) <= tolerance
    assert relative_error(response.source_stress, source_stress) <= tolerance
    assert relative_error(response.receiver_stress, receiver_stress) <= tolerance


def test_error_of_a_wave_is_reported_where_round_off_exceeds_the_tolerance():
    network = modal.fcc(cells=(1, 1, 60))
    wave = modal.propagate(network, 1e-4, tolerance=1e-16)
    assert 1e-16 < wave.truncation < 1e-11


def test_response_that_round_off_hides_is_refused():
    """Refuse a response of which hardly anything comes through within so short a window."""
    with refusal("not_converged"):
        modal.frequency_response(modal.fcc(cells=(1, 1, 60)), resolution=1e5)
