"""A wave in one of equal parts is the wave in all of them."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from packings import slim

from modal.packing import crystal as gallery
from modal.packing.network import Network
from modal.packing.tiling import repeat
from modal.system.linear_system import LinearSystem
from modal.waves.forced_system import one_part
from modal.waves.propagate import propagate
from modal.waves.response import frequency_response

DURATION = 6e-5
FCC = gallery.fcc(cells=(3, 2, 12))


@cache
def tiled(*times: int) -> Network:
    return repeat(slim(), *times)


DISPLACEMENTS = ("chain_displacement", "layer_displacement", "particle_displacement")
STRESSES = ("source_stress", "receiver_stress")


@pytest.mark.parametrize(
    ("network", "count"), [(lambda: FCC, 6), (partial(tiled, 3, 1), 3), (partial(tiled, 1, 2), 2)]
)
@pytest.mark.parametrize("direction", ["x", "y", "z"])
@pytest.mark.parametrize("pre_stress", ["none", "normal", "full"])
def test_all_records_are_those_of_the_whole(network, count, direction, pre_stress):
    """Compare a wave in one part with the wave in all parts, within both errors.

    Errors are relative to the largest motion and stress. Every sphere's motion is compared.
    """
    settings = {"direction": direction, "pre_stress": pre_stress, "tolerance": 1e-9}
    network = network()
    wave_of_part = propagate(network, DURATION, particles=True, **settings)
    wave_of_all = propagate(network, DURATION, particles=True, whole=True, **settings)
    assert (wave_of_part.repeats, wave_of_all.repeats) == (count, 1)
    signals_of_part = wave_of_part.signals
    signals_of_all = wave_of_all.signals
    error = wave_of_part.truncation + wave_of_all.truncation
    for name in DISPLACEMENTS:
        compare(
            getattr(signals_of_part, name),
            getattr(signals_of_all, name),
            error * largest(signals_of_all, DISPLACEMENTS[2]),
        )
    for name in STRESSES:
        compare(
            getattr(signals_of_part, name),
            getattr(signals_of_all, name),
            error * largest(signals_of_all, STRESSES[0]),
        )
    for name in ("chain_particle", "chain_position", "layer_position"):
        assert np.array_equal(getattr(signals_of_part, name), getattr(signals_of_all, name))


def largest(signals, name):
    return abs(getattr(signals, name)).max()


def compare(record, expected, tolerance):
    assert abs(expected).max() > 0
    assert abs(record - expected).max() < tolerance


def test_parts_that_differ_change_the_wave_by_less_than_is_said():
    """Add a noise of 2e-11 to stiffnesses: the error bounds its effect on the largest motion."""
    rng = np.random.default_rng(3)
    network = tiled(3, 1)
    noisy = network.stiffness_normal * (1 + 2e-11 * rng.uniform(-1, 1, network.n_contacts))
    network = replace(network, stiffness_normal=noisy)
    _, repeats = one_part(LinearSystem.of(network), DURATION, 1e-6)
    assert repeats.count == 3
    assert 1e-10 < repeats.difference < 1e-7
    wave = propagate(network, DURATION, tolerance=repeats.difference, particles=True)
    assert wave.repeats == 3
    assert wave.truncation > repeats.difference
    # The parts are less alike than this tolerance: all of them are computed.
    exact = propagate(network, DURATION, tolerance=1e-14, particles=True)
    assert exact.repeats == 1
    expected = exact.signals.particle_displacement
    difference = abs(wave.signals.particle_displacement - expected).max()
    assert 0 < difference < wave.truncation * abs(expected).max()


def test_response_of_a_repeated_packing_is_the_small_ones():
    """Compare two responses, each with a tolerance of 1e-8 of the highest resonance."""
    settings = {"highest": 4e4, "resolution": 4e3, "tolerance": 1e-8}
    small = frequency_response(slim(), **settings)
    large = frequency_response(tiled(3, 1), **settings)
    for name in ("layer_displacement", "receiver_stress", "source_stress"):
        expected = getattr(small, name)
        assert abs(getattr(large, name) - expected).max() < 1e-6 * abs(expected).max(), name
