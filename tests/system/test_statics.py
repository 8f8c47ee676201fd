"""Steady loads: against direct solves, the crystal's theory, and springs in a row."""

from dataclasses import replace

import numpy as np
import pytest
from changes import scaled
from oracles import wall_pattern
from packings import random_sample
from refusals import refusal

from modal.elasticity import steady
from modal.elasticity.slab import static_velocity
from modal.elasticity.steady import steady_motion
from modal.packing import crystal as gallery
from modal.packing.columns import CONTACTS
from modal.packing.network import SOURCE_WALL
from modal.system.imposed import WallMoves
from modal.system.linear_system import LinearSystem
from modal.theory.fcc import FccLattice
from modal.tools.errors import InputError


def test_motion_is_that_of_the_least_squares_solution():
    """Compare with the shortest of all solutions, in the norm of the mass: loose spheres rest."""
    network = random_sample(150, 1e6, aspect=1.5).network()
    system = LinearSystem.of(network)
    push = wall_pattern(network, SOURCE_WALL)[0]
    exact = np.linalg.pinv(system.dynamical_matrix.toarray(), rcond=1e-11) @ system.sqrt_mass.over(
        push
    )
    wall = system.put_on(WallMoves(SOURCE_WALL))
    solution, _ = steady_motion(system, wall, lambda work: 1e-18 * work, "gradients")
    deviation = system.sqrt_mass.times(solution.motion.ravel()) - exact
    A = system.dynamical_matrix
    # The error in energy is 1e-18 of the work as asked. A mode of the dense inverse errs by eps
    # times the largest omega^2 over its own: squared 1e-16 at 1e-8 of the largest, below which a
    # push at the wall leaves little energy.
    assert deviation @ (A @ deviation) < 1e-16 * (exact @ (A @ exact))


@pytest.mark.parametrize("stress", [1e4, 1e7])
def test_velocity_of_the_crystal(stress):
    """Compare with V = l sqrt(C / m), Eq. 7 of the paper; the layers' strain is uniform."""
    crystal = FccLattice(stress)
    velocity, modulus, _ = static_velocity(gallery.fcc(stress, (3, 3, 80)))
    # Its soft ends leave 1e-4 of the density, as of moduli (`test_slabs`).
    assert velocity == pytest.approx(crystal.velocity, rel=1e-4)
    expected = crystal.C * crystal.layer_distance / crystal.spacing**2
    assert modulus == pytest.approx(expected, rel=1e-5)


def layer_of(network):
    """Return the number (n,) of each sphere's crystal layer, from the source wall."""
    z = network.position[:, 2]
    return np.round((z - z.min()) / FccLattice(1e5).layer_distance).astype(int)


def heavy_and_loose_ends(network):
    """Return the packing with heavy spheres and spheres without contacts near the walls."""
    layer = layer_of(network)
    j = network.particle_j
    near = (layer < 5) | (layer >= 75)
    network = network.unchecked(mass=scaled(network.mass, near, 7))
    loose = np.zeros(network.n_particles, bool)
    loose[np.flatnonzero(near & (layer > 0) & (layer < 79))[::3]] = True
    return network.with_contacts(~loose[network.particle_i] & ((j < 0) | ~loose[j]))


def more_that_touch_nothing_else(network):
    """Return the packing with a third more spheres in every layer, which no wave moves.

    They touch each other but none of the first spheres.
    """
    n = network.n_particles
    loose = np.random.default_rng(2).choice(n, n // 3, replace=False)
    columns = {name: np.concatenate([x, x[loose]]) for name, x in network.bodies().items()}
    new_number = np.full(n + 1, -1)
    new_number[loose] = n + np.arange(n // 3)
    ends = new_number[[network.particle_i, network.particle_j]]
    among = (ends >= 0).all(axis=0) & ~network.with_wall & ~network.periods.any(axis=1)
    contact_columns = [(name, x) for name in CONTACTS if (x := getattr(network, name)) is not None]
    columns |= {name: np.concatenate([x, x[among]]) for name, x in contact_columns}
    columns["particle_i"][-among.sum() :], columns["particle_j"][-among.sum() :] = ends[:, among]
    return replace(network, **columns)


def lighter_layers(network):
    """Return the packing with half the mass in every second layer."""
    return network.unchecked(mass=scaled(network.mass, layer_of(network) % 2 == 0, 0.5))


@pytest.mark.parametrize(
    ("change", "density", "near"),
    [
        (heavy_and_loose_ends, 1, 1e-4),
        (more_that_touch_nothing_else, 1, 1e-9),  # both stop at an error in energy of 1e-12
        (lighter_layers, 0.75, 1e-3),  # as many of the one kind as of the other, but for the ends
    ],
)
def test_density_is_that_of_what_moves_in_the_bulk(change, density, near):
    network = gallery.fcc(cells=(3, 3, 80))
    before = static_velocity(network)
    after = static_velocity(change(network))
    assert after[0] == pytest.approx(before[0] / np.sqrt(density), rel=near)
    assert after[1] == pytest.approx(before[1], rel=near)


def test_load_that_is_not_balanced_is_said(monkeypatch):
    network = gallery.fcc(cells=(3, 3, 40))
    monkeypatch.setattr(steady, "MAX_PRODUCTS", 5)
    with refusal("not_converged"):
        static_velocity(network)


def test_packing_that_is_cut_has_no_velocity():
    network = gallery.fcc(cells=(3, 3, 40))
    z = network.position[:, 2]
    j = network.particle_j
    upper = z > network.wall_position.mean()
    across = (j >= 0) & (upper[network.particle_i] != upper[j])
    with pytest.raises(InputError) as refused:
        static_velocity(network.with_contacts(~across))
    assert refused.value.code in ("no_wave", "not_converged")


def test_packing_without_a_bulk_has_no_velocity():
    with refusal("too_short"):
        static_velocity(gallery.fcc(cells=(2, 2, 8)))
