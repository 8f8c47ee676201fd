"""What must not matter: place, direction, numbering, units, how springs are written down.

Changed networks are other floating-point numbers of the same physics. Spectra agree within
size * eps * f_max^2 in f^2 (backward error of the eigensolver and of the changed entries); signals
within the tolerance of their expansion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from modal.modes.counts import count_below
from modal.modes.dense import all_modes
from modal.modes.zero_modes import by_structure
from modal.packing import crystal as gallery
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.system.linear_system import LinearSystem
from modal.waves.propagate import propagate
from modal.waves.source import Pulse

EPS = np.finfo(float).eps
seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=8, deadline=None, derandomize=True, phases=[Phase.generate])


def packing(seed: int) -> Network:
    """A small packing of unequal stiffnesses and masses, some contacts missing."""
    random = np.random.default_rng(seed)
    network = gallery.fcc(cells=(2, 2, 5))
    network = network.with_contacts(random.random(network.n_contacts) > 0.15)
    n, m = network.n_particles, network.n_contacts
    mass = network.mass * random.uniform(0.5, 2, n)
    kn = network.stiffness_normal * random.uniform(0.2, 2, m)
    return replace(
        network,
        mass=mass,
        inertia=0.4 * mass * network.radius**2,
        stiffness_normal=kn,
        stiffness_tangential=random.uniform(0, 1, m) * kn,
    )


def free_cluster(seed: int) -> Network:
    """The packing cut loose from walls and periods: it may be turned."""
    network = packing(seed)
    network = network.with_contacts(~network.with_wall & ~network.cell_shift.any(axis=1))
    none = {"cell_periodic": np.zeros(3, bool), "wall_position": np.zeros(2)}
    return replace(network, **none)


def squares(network: Network) -> np.ndarray:
    """Shape (6n,), Hz^2: signed squares of all frequencies."""
    f = all_modes(LinearSystem.of(network)).frequency
    return np.sign(f) * f**2


def agree(first: np.ndarray, second: np.ndarray, factor: float = 1.0) -> None:
    assert abs(first * factor - second).max() <= len(first) * EPS * abs(second).max()


def same_counts(first: Network, second: Network) -> None:
    """Exact counts between frequencies that are apart, and the zero modes by kind."""
    one, two = LinearSystem.of(first), LinearSystem.of(second)
    assert by_structure(one).by_kind() == by_structure(two).by_kind()
    f = all_modes(one).frequency
    for k in np.flatnonzero(np.diff(f) > 1e-3 * f[-1])[::20]:
        at = (f[k] + f[k + 1]) / 2
        assert count_below(two, at) == k + 1


def same_signals(first: Network, second: Network, mirrored: float = 1.0) -> None:
    """u_z of every particle, layer and wall; the chain may take another path of equal cost."""
    one, two = (propagate(net, 3e-5, particles=True).signals for net in (first, second))
    size = abs(one.particle_displacement).max()
    # Coefficients below 1e-9 are dropped; each network has its own bound of the spectrum.
    assert abs(one.particle_displacement - mirrored * two.particle_displacement).max() < 1e-8 * size
    assert abs(one.layer_displacement - mirrored * two.layer_displacement).max() < 1e-8 * size
    for name in ("source_stress", "receiver_stress"):
        a, b = getattr(one, name), getattr(two, name)
        assert abs(a - b).max() < 1e-8 * max(abs(one.source_stress).max(), abs(a).max())


def turned(network: Network, matrix: np.ndarray) -> Network:
    """All vectors turned; cell and walls are left to those who have them."""
    vectors = ("position", "normal", "lever_i", "lever_j", "force_tangential")
    return network.unchecked(**{name: getattr(network, name) @ matrix.T for name in vectors})


@few
@given(seeds, st.tuples(*[st.floats(-10, 10)] * 3))
def test_translation(seed, shift):
    network = packing(seed)
    moved = replace(
        network,
        position=network.position + shift,
        wall_position=network.wall_position + shift[2],
    )
    assert np.array_equal(squares(moved), squares(network))
    same_signals(network, moved)


@few
@given(seeds, seeds)
def test_rotation_of_an_unbounded_cluster(seed, turn):
    network = free_cluster(seed)
    rotated = replace(turned(network, Rotation.random(random_state=turn).as_matrix()))
    agree(squares(rotated), squares(network))
    same_counts(network, rotated)


@few
@given(seeds)
def test_mirror(seed):
    """Upside down, with the walls' roles changed back: left and right do not matter."""
    network = packing(seed)
    flip = np.diag([-1.0, 1.0, 1.0])
    mirrored = replace(turned(network, flip), cell_shift=network.cell_shift * [-1, 1, 1])
    agree(squares(mirrored), squares(network))
    same_signals(network, mirrored)


@few
@given(seeds)
def test_upside_down(seed):
    """Turned about x, source and receiver change places: reciprocity of the two walls."""
    network = packing(seed)
    turn = np.diag([1.0, -1.0, -1.0])
    walls = {SOURCE_WALL: RECEIVER_WALL, RECEIVER_WALL: SOURCE_WALL}
    j = np.array([walls.get(int(other), int(other)) for other in network.particle_j])
    over = replace(
        turned(network, turn),
        particle_j=j,
        cell_shift=network.cell_shift * [1, -1, -1],
        wall_position=-network.wall_position[::-1],
    )
    agree(squares(over), squares(network))
    same_counts(network, over)
    one, two = (propagate(net, 3e-5).signals for net in (network, over))
    assert (
        abs(one.receiver_stress - two.receiver_stress).max() < 1e-8 * abs(one.source_stress).max()
    )


@few
@given(seeds, seeds)
def test_numbering_of_particles_and_order_of_contacts(seed, order):
    network, random = packing(seed), np.random.default_rng(order)
    new = random.permutation(network.n_particles)  # particle k becomes new[k]
    old = np.argsort(new)
    particles = ("position", "radius", "mass", "inertia")
    j = network.particle_j
    renumbered = replace(
        network,
        **{name: getattr(network, name)[old] for name in particles},
        particle_i=new[network.particle_i],
        particle_j=np.where(j < 0, j, new[j]),
    ).with_contacts(random.permutation(network.n_contacts))
    agree(squares(renumbered), squares(network))
    same_counts(network, renumbered)
    one, two = (propagate(net, 3e-5, particles=True).signals for net in (network, renumbered))
    moved = two.particle_displacement[:, new]
    size = abs(one.particle_displacement).max()
    assert abs(one.particle_displacement - moved).max() < 1e-8 * size


def swapped(network: Network, chosen: np.ndarray) -> Network:
    """The two bodies of the chosen contacts in the other order."""
    chosen = chosen & ~network.with_wall
    column = chosen[:, None]

    def either(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return np.where(column if first.ndim == 2 else chosen, first, second)

    return replace(
        network,
        particle_i=either(network.particle_j, network.particle_i),
        particle_j=either(network.particle_i, network.particle_j),
        lever_i=either(network.lever_j, network.lever_i),
        lever_j=either(network.lever_i, network.lever_j),
        normal=either(-network.normal, network.normal),
        force_tangential=either(-network.force_tangential, network.force_tangential),
        cell_shift=either(-network.cell_shift, network.cell_shift),
    )


@few
@given(seeds, seeds)
def test_which_body_of_a_contact_is_named_first(seed, order):
    network = packing(seed)
    other = swapped(network, np.random.default_rng(order).random(network.n_contacts) < 0.5)
    agree(squares(other), squares(network))
    same_counts(network, other)
    same_signals(network, other)


@few
@given(seeds, st.floats(0.05, 0.95))
def test_one_spring_as_two_parallel_ones(seed, share):
    network = packing(seed)
    m = network.n_contacts
    twice = network.some(np.tile(np.arange(m), 2))
    part = np.repeat([share, 1 - share], m)
    twice = twice.unchecked(
        stiffness_normal=part * twice.stiffness_normal,
        stiffness_tangential=part * twice.stiffness_tangential,
    )
    agree(squares(twice), squares(network))
    same_signals(network, twice)


@few
@given(seeds, st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9))
def test_units(seed, length, mass, time):
    """Other units of length, mass and time, each up to nine decades away."""
    L, M, T = 10.0**length, 10.0**mass, 10.0**time
    network = packing(seed)
    scaled = replace(
        network,
        **{
            name: getattr(network, name) * L
            for name in ("position", "radius", "lever_i", "lever_j", "overlap", "cell_size")
        },
        study={},
        force_normal=network.force_normal * M * L / T**2,
        wall_position=network.wall_position * L,
        mass=network.mass * M,
        inertia=network.inertia * M * L**2,
        stiffness_normal=network.stiffness_normal * M / T**2,
        stiffness_tangential=network.stiffness_tangential * M / T**2,
    )
    agree(squares(network), squares(scaled), T**-2)
    assert (
        by_structure(LinearSystem.of(scaled)).by_kind()
        == by_structure(LinearSystem.of(network)).by_kind()
    )
    here = propagate(network, 3e-5).signals
    there = propagate(
        scaled, 3e-5 * T, motion=Pulse(2.5e-9 * L, 1e5 / T), interval=1e-6 * T
    ).signals
    difference = here.chain_displacement - there.chain_displacement / L
    assert abs(difference).max() < 1e-8 * abs(here.chain_displacement).max()


@pytest.mark.parametrize("factor", [0.5, 3.0])
def test_amplitude_scales_the_linear_wave(factor):
    network = packing(5)
    here = propagate(network, 3e-5).signals
    there = propagate(network, 3e-5, motion=Pulse(2.5e-9 * factor)).signals
    assert there.receiver_stress == pytest.approx(factor * here.receiver_stress, rel=1e-12)
