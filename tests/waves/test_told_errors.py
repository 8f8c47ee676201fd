"""The error that a wave or a response is told to have is above the true one, by dense oracles."""

from functools import cache

import numpy as np
import pytest
from packings import wall_pattern
from scipy.linalg import expm

import modal
from modal.packing import crystal as gallery
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.waves.source import Pulse, SampledMotion, chirp, step

PACKINGS = {
    "crystal": lambda: modal.fcc(cells=(1, 1, 12)),
    "column": lambda: gallery.column(8),
    "random": lambda: modal.random_packing(spheres=30, seed=2),
}
RECORDED = np.array([0, 1.1e-5, 3e-5, 4.7e-5, 1.3e-4, 2.2e-4])
MOTIONS = {
    "step": step(1e-9, 1e-4),
    "chirp": chirp(1e-9, 1e4, 5e4, 4e-4),
    "pulse": Pulse(),
    "recorded": SampledMotion(RECORDED, 1e-9 * np.array([0, 1, -2, 0.5, 1, -1])),
}
EVERY, DURATION = 2e-5, 2e-3


@cache
def network_of(name):
    return PACKINGS[name]()


@cache
def exact(name, moved):
    """Motion (nt, 6n) and stresses on both walls by matrix exponentials of state and source."""
    network, motion = network_of(name), MOTIONS[moved]
    K, M = stiffness_matrix(network).toarray(), mass_diagonal(network)
    (push, row, held), (_, far, _) = (
        wall_pattern(network, w) for w in (SOURCE_WALL, RECEIVER_WALL)
    )
    N, drive = len(M), 2e5 * np.pi
    L = np.zeros((2 * N + 3, 2 * N + 3))
    L[:N, N : 2 * N] = np.eye(N)
    L[N : 2 * N, :N], L[N : 2 * N, 2 * N], L[2 * N, 2 * N + 1] = -K / M[:, None], push / M, 1
    if moved == "pulse":
        L[2 * N + 1, [2 * N, 2 * N + 2]] = -(drive**2), drive**2 * motion.amplitude
    unit = np.concatenate([np.ones(N), np.full(N, 1e6), [1, 1e6, 1]])  # um, um/us
    L = L * unit / unit[:, None]
    time = EVERY * np.arange(round(DURATION / EVERY) + 1)
    nodes = np.union1d(time, motion.corners[motion.corners < time[-1]])
    nodes = nodes[np.append(True, np.diff(nodes) > 1e-12)]
    d, state, states, steps = motion.displacement(nodes), np.zeros(2 * N + 3), [], {}
    state[-1] = 1
    for k, h in enumerate(np.diff(nodes)):
        states.append(state)
        state = state.copy()
        if moved != "pulse":
            state[2 * N : 2 * N + 2] = d[k], (d[k + 1] - d[k]) / h / 1e6
        elif nodes[k] > motion.corners[-1] - 1e-12:
            state[2 * N :] = 0
        key = round(h * 1e13)
        if key not in steps:
            steps[key] = expm(L * h)
        state = steps[key] @ state
    states.append(state)
    u = np.array(states)[np.searchsorted(nodes, time - 1e-12), :N]
    stress = (held * motion.displacement(time) - u @ row, u @ far)
    return u, np.array(stress) / network.area


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
    for a, b in ((wave.signals.particle_displacement, u[:, 2::6]), (found, stress)):
        assert abs(a - b).max() <= wave.truncation * abs(b).max()


def test_stress_that_has_not_come_yet_counts_beside_the_sources():
    """Else the wave would be summed until round-off ends it, for a receiver that hears nothing."""
    crystal = modal.fcc(cells=(1, 1, 100))
    wave = modal.propagate(crystal, 1e-5, tolerance=1e-6)
    assert abs(wave.signals.receiver_stress).max() < 1e-9 * abs(wave.signals.source_stress).max()
    assert 1e-12 < wave.truncation <= 1e-6
    assert wave.products < 0.9 * modal.propagate(crystal, 1e-5, tolerance=1e-12).products


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
    with pytest.raises(modal.InputError, match="finer resolution"):
        modal.frequency_response(network, resolution=1e5)
