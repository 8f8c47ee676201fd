"""Steady loads: against direct solves, the crystal's theory, and springs in a row."""

from dataclasses import replace

import numpy as np
import pytest
from packings import scaled, wall_pattern
from scipy.linalg import eigh, eigvalsh_tridiagonal

from modal.elasticity import steady
from modal.elasticity.slab import static_velocity
from modal.elasticity.steady import steady_motion
from modal.packing import crystal as gallery
from modal.packing.layers import Layers
from modal.packing.network import SOURCE_WALL
from modal.packing.state import WALL_ZONE
from modal.preparation.random_packing import random_network
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.imposed import WallMoves
from modal.system.linear_system import LinearSystem
from modal.theory.fcc import FccLattice
from modal.tools.errors import InputError


def under_wall(network, tolerance=1e-9):
    """Motion (n, 6) of the bodies for a unit displacement of the source wall."""
    system = LinearSystem.of(network)
    wall = system.put_on(WallMoves(SOURCE_WALL))
    allowed = lambda work: tolerance**2 * work  # noqa: E731
    found, _ = steady_motion(system, wall, allowed, "gradients")
    return found.motion.reshape(-1, 6)


def test_motion_is_that_of_the_least_squares_solution():
    """Loose spheres stay where they are: of all solutions the shortest, in the norm of the mass."""
    network = random_network(150, 1e6, aspect=1.5)
    system = LinearSystem.of(network)
    push = wall_pattern(network, SOURCE_WALL)[0]
    exact = np.linalg.pinv(system.scaled.toarray(), rcond=1e-11) @ system.root.over(push)
    found = system.root.times(under_wall(network).ravel())
    wrong, A = found - exact, system.scaled
    assert wrong @ (A @ wrong) < 1e-16 * (exact @ (A @ exact))


def test_column_under_a_wall():
    """Springs in a row: each takes its share of the wall's displacement."""
    network = gallery.column(6)
    motion = under_wall(network)
    give = 1 / network.stiffness_normal
    below = np.cumsum(give)[:-1]
    assert motion[:, 2] == pytest.approx(1 - below / give.sum(), rel=1e-9)
    assert abs(motion[:, [0, 1, 3, 4, 5]]).max() < 1e-9


@pytest.mark.parametrize("stress", [1e4, 1e7])
def test_velocity_of_the_crystal(stress):
    """Layers of FCC: V = l sqrt(C / m), Eq. 7 of the paper; the layers' strain is uniform."""
    crystal = FccLattice(stress)
    velocity, modulus = static_velocity(gallery.fcc(stress, (3, 3, 80)))
    # Its soft ends leave 1e-4 of the density, as of moduli (`test_slabs`).
    assert velocity == pytest.approx(crystal.velocity, rel=1e-4)
    assert modulus == pytest.approx(
        crystal.C * crystal.layer_distance / crystal.spacing**2, rel=1e-5
    )


def layer_of(network):
    """Shape (n,): number of each sphere's crystal layer, from the source wall."""
    z = network.position[:, 2]
    return np.round((z - z.min()) / FccLattice(1e5).layer_distance).astype(int)


def test_density_is_that_of_the_bulk_by_mass():
    """What lies near the walls has no say, neither heavy spheres nor loose ones."""
    network, wanted = gallery.fcc(cells=(3, 3, 80)), FccLattice(1e5).velocity
    layer = layer_of(network)
    near = (layer < 5) | (layer >= 75)
    network = network.unchecked(mass=scaled(network.mass, near, 7))
    loose = np.zeros(network.n_particles, bool)
    loose[np.flatnonzero(near & (layer > 0) & (layer < 79))[::3]] = True
    j = network.particle_j
    network = network.with_contacts(~loose[network.particle_i] & ((j < 0) | ~loose[j]))
    assert static_velocity(network)[0] == pytest.approx(wanted, rel=1e-4)


def test_light_loose_spheres_of_the_bulk_leave_its_velocity():
    """A quarter of the mass in every layer, in spheres that touch nothing: no wave moves it."""
    network = gallery.fcc(cells=(3, 3, 80))
    before = static_velocity(network)[0]
    count = network.n_particles // 3
    loose = np.random.default_rng(2).choice(network.n_particles, count, replace=False)
    names = ("position", "radius", "mass", "inertia")
    more = {
        name: np.concatenate([getattr(network, name), getattr(network, name)[loose]])
        for name in names
    }
    # Both stop at an error in energy of 1e-12.
    after = static_velocity(replace(network, **more))[0]
    assert after == pytest.approx(before, rel=1e-9)


def test_velocity_of_spheres_of_several_masses():
    """Every second layer of half the density: V^2 = M / density, the density that of mass."""
    network = gallery.fcc(cells=(3, 3, 80))
    whole = static_velocity(network)
    half = scaled(network.mass, layer_of(network) % 2 == 0, 0.5)
    network = network.unchecked(mass=half)
    velocity, modulus = static_velocity(network)
    assert modulus == pytest.approx(whole[1], rel=1e-6)
    # As many of the one kind as of the other, but for the ends.
    assert velocity == pytest.approx(whole[0] / np.sqrt(0.75), rel=1e-3)


def lowest_of_chain(mass, stiffness):
    """Lowest frequency, Hz, of masses (k,) between walls, joined by springs (k + 1,)."""
    scale = 1 / np.sqrt(mass)
    diagonal, off = scale**2 * (stiffness[:-1] + stiffness[1:]), stiffness[1:-1]
    square = eigvalsh_tridiagonal(diagonal, -off * scale[:-1] * scale[1:])
    return np.sqrt(square[0]) / (2 * np.pi)


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_long_waves_of_a_random_packing_are_those_of_its_static_strain(seed):
    """The lowest P mode against a chain of the layers' masses and static springs.

    Then the same with the bulk's springs and masses replaced by what modulus and velocity say.
    """
    network = random_network(400, 1e7, seed=seed, aspect=8.0)
    layers = Layers(network)
    scale = 1 / np.sqrt(mass_diagonal(network))
    K = stiffness_matrix(network).toarray()
    square, vector = eigh(scale[:, None] * K * scale, subset_by_index=[0, 60])
    mass = network.mass[0] * np.bincount(layers.layer[layers.layer >= 0])
    # Kinetic energy of the layers' mean motion along z: one mode has nearly all of its own there.
    coherent = np.array([layers.means((v * scale)[2::6]) for v in vector.T]) ** 2 @ mass
    first = np.flatnonzero(coherent > 0.9)[0]
    measured = np.sqrt(square[first]) / (2 * np.pi)

    row = wall_pattern(network, -2)[1]
    motion = under_wall(network)
    height = np.concatenate([[1], layers.means(motion[:, 2]), [0]])
    springs = row @ motion.ravel() / -np.diff(height)
    # What the mode moves apart from its layers' means, the chain lacks: the same share of omega^2.
    assert (lowest_of_chain(mass, springs) / measured) ** 2 == pytest.approx(
        1, abs=1 - coherent[first]
    )

    velocity, modulus = static_velocity(network)
    area, z = np.prod(network.cell_size[:2]), layers.position
    reach = WALL_ZONE * 2 * network.radius[0]
    bulk = np.flatnonzero(abs(z - network.wall_position.mean()) < network.length / 2 - reach)
    springs[bulk[1:]] = modulus * area / np.diff(z[bulk])
    mass[bulk] = modulus / velocity**2 * area * (z[bulk[-1]] - z[bulk[0]]) / (len(bulk) - 1)
    # A line through the strain of some ten uneven layers, not its mean: up to 10 % of the bulk's
    # compliance, which is half of the chain's; the frequency goes with its root.
    assert lowest_of_chain(mass, springs) == pytest.approx(measured, rel=0.03)


def test_load_that_is_not_balanced_is_said(monkeypatch):
    network = gallery.fcc(cells=(3, 3, 40))
    monkeypatch.setattr(steady, "MOST_PRODUCTS", 5)
    with pytest.raises(InputError, match="do not balance the load: after 5"):
        static_velocity(network)


def test_packing_that_is_cut_has_no_velocity():
    network = gallery.fcc(cells=(3, 3, 40))
    z, j = network.position[:, 2], network.particle_j
    upper = z > network.wall_position.mean()
    across = (j >= 0) & (upper[network.particle_i] != upper[j])
    with pytest.raises(InputError, match="no force goes from wall to wall|do not balance"):
        static_velocity(network.with_contacts(~across))
    with pytest.raises(InputError, match="too short"):
        static_velocity(gallery.fcc(cells=(2, 2, 8)))
