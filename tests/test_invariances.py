"""What must not matter: place, direction, numbering, units, how springs are written down.

Changed networks are other floating-point numbers of the same physics. Spectra agree within
size * eps * f_max^2 in f^2 (backward error of the eigensolver and of the changed entries); signals
within the tolerance of their expansion.
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
seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=4, deadline=None)
"""Others in each run; what fails is made smaller, printed, and tried first in the next one. Four of
each, as every one takes two whole spectra, two waves and half a dozen factorisations."""


def packing(seed: int) -> Network:
    """A small packing of unequal stiffnesses and masses, between walls, some contacts missing."""
    random = np.random.default_rng(seed)
    network = gallery.fcc(cells=(2, 2, 5))
    network = network.with_contacts(random.random(network.n_contacts) > 0.15)
    assume({SOURCE_WALL, RECEIVER_WALL} <= {*network.particle_j})
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


def squares(network: Network) -> np.ndarray:
    """Shape (6n,), Hz^2: signed squares of all frequencies."""
    f = modes_of(LinearSystem.of(network), all=True).frequency
    return np.sign(f) * f**2


def agree(first: np.ndarray, second: np.ndarray, factor: float = 1.0) -> None:
    assert abs(first * factor - second).max() <= len(first) * EPS * abs(second).max()


def same_counts(first: Network, second: Network) -> None:
    """Exact counts between frequencies that are apart, and the zero modes by kind."""
    one, two = LinearSystem.of(first), LinearSystem.of(second)
    assert by_structure(one).kinds == by_structure(two).kinds
    f = modes_of(one, all=True).frequency
    for k in np.flatnonzero(np.diff(f) > 1e-3 * f[-1])[::20]:
        at = (f[k] + f[k + 1]) / 2
        assert count_below(two, at) == k + 1


def same_signals(first: Network, second: Network, order: np.ndarray) -> None:
    """u_z of every particle, layer and wall; the chain may take another path of equal cost."""
    one, two = (propagate(net, 3e-5, particles=True).signals for net in (first, second))
    size = abs(one.particle_displacement).max()
    # Coefficients below 1e-9 are dropped; each network has its own bound of the spectrum.
    difference = one.particle_displacement - two.particle_displacement[:, order]
    assert abs(difference).max() < 1e-8 * size
    assert abs(one.layer_displacement - two.layer_displacement).max() < 1e-8 * size
    for name in ("source_stress", "receiver_stress"):
        a, b = getattr(one, name), getattr(two, name)
        assert abs(a - b).max() < 1e-8 * max(abs(one.source_stress).max(), abs(a).max())


def translated(network: Network, random: np.random.Generator) -> Network:
    shift = random.uniform(-10, 10, 3)
    walls = network.wall_position + shift[2]
    return replace(network, position=network.position + shift, wall_position=walls)


def left_for_right(network: Network, random: np.random.Generator) -> Network:
    return mirrored(network)


def in_another_order(network: Network, random: np.random.Generator) -> Network:
    """Particles and contacts."""
    return renumbered(network, random.permutation(network.n_particles))


def swapped(network: Network, random: np.random.Generator) -> Network:
    """The two bodies of some contacts in the other order."""
    chosen = random.random(network.n_contacts) < 0.5
    return from_other_end(network, chosen & ~network.with_wall)


def doubled(network: Network, random: np.random.Generator) -> Network:
    """Return the packing with each spring replaced by two parallel ones of the same sum."""
    m, share = network.n_contacts, random.uniform(0.05, 0.95)
    twice = network.some(np.tile(np.arange(m), 2))
    part = np.repeat([share, 1 - share], m)
    return twice.unchecked(**{name: part * getattr(twice, name) for name in SPRINGS})


@pytest.mark.parametrize("change", [translated, left_for_right, in_another_order, swapped, doubled])
@few
@given(seeds, seeds)
def test_what_must_not_matter(change, seed, other):
    network = packing(seed)
    same = change(network, np.random.default_rng(other))
    _, order = np.where(network.mass[:, None] == same.mass)  # no two spheres have equal masses
    agree(squares(same), squares(network))
    same_counts(network, same)
    same_signals(network, same, order)


@few
@given(seeds, seeds)
def test_rotation_of_an_unbounded_cluster(seed, turn):
    """The packing cut loose from walls and periods."""
    network = packing(seed)
    network = network.with_contacts(~network.with_wall & ~network.cell_shift.any(axis=1))
    none = {"cell_periodic": np.zeros(3, bool), "wall_position": np.zeros(2)}
    network = replace(network, **none)
    rotated = turned(network, Rotation.random(random_state=turn).as_matrix())
    agree(squares(rotated), squares(network))
    same_counts(network, rotated)


@few
@given(seeds)
def test_upside_down(seed):
    """Turned about x, source and receiver change places: reciprocity of the two walls."""
    network, turn = packing(seed), np.array([1, -1, -1])
    walls = {SOURCE_WALL: RECEIVER_WALL, RECEIVER_WALL: SOURCE_WALL}
    over = turned(
        network,
        np.diag(turn),
        particle_j=np.array([walls.get(j, j) for j in network.particle_j.tolist()]),
        cell_shift=network.cell_shift * turn,
        wall_position=-network.wall_position[::-1],
    )
    agree(squares(over), squares(network))
    same_counts(network, over)
    one, two = (propagate(net, 3e-5).signals for net in (network, over))
    difference = abs(one.receiver_stress - two.receiver_stress).max()
    assert difference < 1e-8 * abs(one.source_stress).max()


@few
@given(seeds, st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9))
def test_units(seed, length, mass, time):
    """Other units of length, mass and time, each up to nine decades away."""
    L, M, T = 10.0**length, 10.0**mass, 10.0**time
    network = packing(seed)
    scaled = in_units(network, L, M, T)
    one, two = (by_structure(LinearSystem.of(net)).kinds for net in (network, scaled))
    assert one == two
    here = propagate(network, 3e-5, motion=Pulse(2.5e-9, 1e5), interval=1e-6).signals
    pulse = Pulse(2.5e-9 * L, 1e5 / T)
    there = propagate(scaled, 3e-5 * T, motion=pulse, interval=1e-6 * T).signals
    difference = here.chain_displacement - there.chain_displacement / L
    assert abs(difference).max() < 1e-8 * abs(here.chain_displacement).max()
