"""Invariances: position, direction, numbering, units, and the form in which springs are given.

A changed network is the same physics in other floating-point numbers. Spectra agree within
size * eps * f_max^2 in f^2 (backward error of the eigensolver and of the changed entries); signals
agree within the tolerance of their expansion.
"""

from dataclasses import replace

import numpy as np
import pytest
from changes import SPRINGS, from_other_end, in_units, mirrored, renumbered, turned
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from modal.modes.counts import count_below
from modal.modes.eigenmodes import modes_of
from modal.modes.zero_modes import by_structure
from modal.packing import crystal as gallery
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.system.linear_system import LinearSystem
from modal.waves.motions import Pulse
from modal.waves.propagate import propagate

EPS = np.finfo(float).eps
SEEDS = st.integers(0, 2**32 - 1)
FOUR_EXAMPLES = settings(max_examples=4, deadline=None)
"""Each run draws other examples; one that fails is made smaller, printed, and tried first in the
next run. There are four, as each takes two whole spectra, two waves and several factorisations."""


def random_packing(seed: int) -> Network:
    """Return a small crystal between walls with random stiffnesses and masses.

    About 15 % of its contacts are missing.
    """
    random = np.random.default_rng(seed)
    network = gallery.fcc(cells=(2, 2, 5))
    network = network.with_contacts(random.random(network.n_contacts) > 0.15)
    assume({SOURCE_WALL, RECEIVER_WALL} <= {*network.particle_j})
    mass = network.mass * random.uniform(0.5, 2, network.n_particles)
    normal = network.stiffness_normal * random.uniform(0.2, 2, network.n_contacts)
    tangential = random.uniform(0, 1, network.n_contacts) * normal
    return replace(
        network,
        mass=mass,
        inertia=0.4 * mass * network.radius**2,
        stiffness_normal=normal,
        stiffness_tangential=tangential,
    )


def all_frequencies(network: Network) -> np.ndarray:
    """Return all frequencies (6n,), Hz, ascending; those with omega^2 < 0 are negative."""
    return modes_of(LinearSystem.of(network), all=True).frequency


def assert_same_spectra(first: Network, second: Network) -> None:
    """Compare the signed squares of all frequencies."""
    expected = all_frequencies(first)
    frequency = all_frequencies(second)
    difference = np.sign(frequency) * frequency**2 - np.sign(expected) * expected**2
    assert abs(difference).max() <= len(expected) * EPS * expected[-1] ** 2


def assert_same_counts(first: Network, second: Network) -> None:
    """Compare exact counts between frequencies that are apart, and the zero modes by kind."""
    system = LinearSystem.of(second)
    assert by_structure(system).kinds == by_structure(LinearSystem.of(first)).kinds
    frequency = all_frequencies(first)
    separated = np.flatnonzero(np.diff(frequency) > 1e-3 * frequency[-1])
    for k in separated[::20]:
        between = (frequency[k] + frequency[k + 1]) / 2
        assert count_below(system, between) == k + 1


def assert_same_signals(first: Network, second: Network, order: np.ndarray) -> None:
    """Compare u_z of every particle, layer and wall; sphere k of the first is order[k].

    The chain is not compared: it may take another path of equal cost.
    """
    expected = propagate(first, 3e-5, particles=True).signals
    signals = propagate(second, 3e-5, particles=True).signals
    largest = abs(expected.particle_displacement).max()
    # Coefficients below 1e-9 are dropped; each network has its own bound of the spectrum.
    tolerance = 1e-8
    of_particles = signals.particle_displacement[:, order] - expected.particle_displacement
    assert abs(of_particles).max() < tolerance * largest
    of_layers = signals.layer_displacement - expected.layer_displacement
    assert abs(of_layers).max() < tolerance * largest
    largest_stress = abs(expected.source_stress).max()
    for name in ("source_stress", "receiver_stress"):
        stress = getattr(expected, name)
        difference = abs(getattr(signals, name) - stress).max()
        assert difference < tolerance * max(largest_stress, abs(stress).max())


def translated(network: Network, random: np.random.Generator) -> Network:
    """Return the network at another place."""
    shift = random.uniform(-10, 10, 3)
    walls = network.wall_position + shift[2]
    return replace(network, position=network.position + shift, wall_position=walls)


def left_for_right(network: Network, random: np.random.Generator) -> Network:
    """Return the mirror image of the network."""
    return mirrored(network)


def in_another_order(network: Network, random: np.random.Generator) -> Network:
    """Return the network with particles and contacts in another order."""
    return renumbered(network, random.permutation(network.n_particles))


def swapped(network: Network, random: np.random.Generator) -> Network:
    """Return the network with the two bodies of half of the contacts in the other order."""
    half = random.random(network.n_contacts) < 0.5
    return from_other_end(network, half & ~network.with_wall)


def doubled(network: Network, random: np.random.Generator) -> Network:
    """Return the network with each spring replaced by two parallel ones of the same sum."""
    n_contacts = network.n_contacts
    share = random.uniform(0.05, 0.95)
    twice = network.some(np.tile(np.arange(n_contacts), 2))
    shares = np.repeat([share, 1 - share], n_contacts)
    return twice.unchecked(**{name: shares * getattr(twice, name) for name in SPRINGS})


CHANGES = [translated, left_for_right, in_another_order, swapped, doubled]


@pytest.mark.parametrize("change", CHANGES)
@FOUR_EXAMPLES
@given(SEEDS, SEEDS)
def test_changes_of_form_do_not_matter(change, packing_seed, change_seed):
    network = random_packing(packing_seed)
    changed = change(network, np.random.default_rng(change_seed))
    # No two spheres have equal masses.
    _, order = np.where(network.mass[:, None] == changed.mass)
    assert_same_spectra(network, changed)
    assert_same_counts(network, changed)
    assert_same_signals(network, changed, order)


@FOUR_EXAMPLES
@given(SEEDS, SEEDS)
def test_rotation_of_an_unbounded_cluster(packing_seed, rotation_seed):
    """Cut a packing loose from walls and periods, and rotate it."""
    network = random_packing(packing_seed)
    network = network.with_contacts(~network.with_wall & ~network.cell_shift.any(axis=1))
    network = replace(network, cell_periodic=np.zeros(3, bool), wall_position=np.zeros(2))
    rotated = turned(network, Rotation.random(random_state=rotation_seed).as_matrix())
    assert_same_spectra(network, rotated)
    assert_same_counts(network, rotated)


def upside_down(network: Network) -> Network:
    """Return the network turned about x, so that source and receiver wall change places."""
    turn = np.array([1, -1, -1])
    other_wall = {SOURCE_WALL: RECEIVER_WALL, RECEIVER_WALL: SOURCE_WALL}
    return turned(
        network,
        np.diag(turn),
        particle_j=np.array([other_wall.get(j, j) for j in network.particle_j.tolist()]),
        cell_shift=network.cell_shift * turn,
        wall_position=-network.wall_position[::-1],
    )


@FOUR_EXAMPLES
@given(SEEDS)
def test_upside_down(seed):
    """Compare the stress at the receiver: the two walls are reciprocal."""
    network = random_packing(seed)
    inverted = upside_down(network)
    assert_same_spectra(network, inverted)
    assert_same_counts(network, inverted)
    expected = propagate(network, 3e-5).signals
    signals = propagate(inverted, 3e-5).signals
    difference = abs(signals.receiver_stress - expected.receiver_stress).max()
    assert difference < 1e-8 * abs(expected.source_stress).max()


decades = st.floats(-9, 9)


@FOUR_EXAMPLES
@given(SEEDS, decades, decades, decades)
def test_units(seed, length_decades, mass_decades, time_decades):
    """Change the units of length, mass and time by up to nine decades each."""
    length = 10.0**length_decades
    mass = 10.0**mass_decades
    time = 10.0**time_decades
    network = random_packing(seed)
    converted = in_units(network, length, mass, time)
    kinds = by_structure(LinearSystem.of(network)).kinds
    assert by_structure(LinearSystem.of(converted)).kinds == kinds
    pulse = Pulse(2.5e-9, 1e5)
    converted_pulse = Pulse(2.5e-9 * length, 1e5 / time)
    wave = propagate(network, 3e-5, motion=pulse, interval=1e-6).signals
    converted_wave = propagate(
        converted, 3e-5 * time, motion=converted_pulse, interval=1e-6 * time
    ).signals
    expected = wave.chain_displacement
    difference = converted_wave.chain_displacement / length - expected
    assert abs(difference).max() < 1e-8 * abs(expected).max()
