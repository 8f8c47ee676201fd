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


RECORDS = (
    *("chain_displacement", "layer_displacement", "particle_displacement"),
    *("source_stress", "receiver_stress"),
)


@pytest.mark.parametrize(
    ("network", "count"), [(lambda: FCC, 6), (partial(tiled, 3, 1), 3), (partial(tiled, 1, 2), 2)]
)
@pytest.mark.parametrize("direction", ["x", "y", "z"])
@pytest.mark.parametrize("pre_stress", ["none", "normal", "full"])
def test_all_records_are_those_of_the_whole(network, count, direction, pre_stress):
    """Both are off by less than they are told to be of the largest motion, and the largest stress.

    Every sphere's motion is compared, thus the energies of all parts.
    """
    settings = {"direction": direction, "pre_stress": pre_stress, "tolerance": 1e-9}
    network = network()
    one = propagate(network, DURATION, particles=True, **settings)
    all_of_it = propagate(network, DURATION, particles=True, whole=True, **settings)
    assert (one.repeats, all_of_it.repeats) == (count, 1)
    largest = {"m": abs(all_of_it.signals.particle_displacement).max()}
    largest["Pa"] = abs(all_of_it.signals.source_stress).max()
    for name in RECORDS:
        a, b = getattr(one.signals, name), getattr(all_of_it.signals, name)
        scale = largest["Pa" if name.endswith("stress") else "m"]
        assert abs(b).max() > 0
        assert abs(a - b).max() < (one.truncation + all_of_it.truncation) * scale, name
    for name in ("chain_particle", "chain_position", "layer_position"):
        assert np.array_equal(getattr(one.signals, name), getattr(all_of_it.signals, name))


def test_parts_that_differ_change_the_wave_by_less_than_is_said():
    """Stiffnesses with a noise of 2e-11, and the bound of what that does to the largest motion."""
    rng = np.random.default_rng(3)
    network = tiled(3, 1)
    noisy = network.stiffness_normal * (1 + 2e-11 * rng.uniform(-1, 1, network.n_contacts))
    network = replace(network, stiffness_normal=noisy)
    _, driven = one_part(LinearSystem.of(network), DURATION, 1e-6)
    assert driven.count == 3 and 1e-10 < driven.difference < 1e-7
    one = propagate(network, DURATION, tolerance=driven.difference, particles=True)
    assert one.repeats == 3 and one.truncation > driven.difference
    exact = propagate(network, DURATION, tolerance=1e-14, particles=True)
    assert exact.repeats == 1, "a tighter tolerance than the parts are alike: all is computed"
    a, b = one.signals.particle_displacement, exact.signals.particle_displacement
    assert 0 < abs(a - b).max() < one.truncation * abs(b).max()


def test_response_of_a_repeated_packing_is_the_small_ones():
    """Below the tolerance of both, relative to the highest resonance."""
    small, large = (
        frequency_response(network, highest=4e4, resolution=4e3, tolerance=1e-8)
        for network in (slim(), tiled(3, 1))
    )
    for name in ("layer_displacement", "receiver_stress", "source_stress"):
        a, b = getattr(small, name), getattr(large, name)
        assert abs(a - b).max() < 1e-6 * abs(a).max(), name
