"""Moduli of slabs, the bulk's and the walls' told apart; moduli under the forces of contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from changes import changed, stiffer, times
from oracles import contact_matrices
from packings import polydisperse
from places import PACKINGS
from refusals import refusal

from modal.elasticity.moduli import read_moduli
from modal.elasticity.slab import static_velocity
from modal.elasticity.static_response import elastic_moduli
from modal.packing import crystal as gallery
from modal.packing.network import Network
from modal.packing.rattlers import keeping_contacts
from modal.system.assembly import mass_diagonal
from modal.theory.fcc import FccLattice


def test_crystal_between_walls_has_the_bulk_of_the_endless_one():
    """Compare the bulk of a slab with the endless crystal.

    The ends of the bulk are soft, so that the sum over layers l is close to the integral over its
    length L. The slope of the weight has kinks of pi^2 / (2 fade^2) at four places, each of which
    costs at most 0.048 l^3 / 6 of that (Euler and Maclaurin): together 8e-5 of L.
    """
    crystal = FccLattice(1e5)
    moduli = elastic_moduli(gallery.fcc(cells=(2, 2, 80)))
    scale = crystal.stiffness.max()
    assert moduli.region == "bulk"
    assert moduli.stiffness == pytest.approx(crystal.stiffness, abs=1e-4 * scale)
    # What the slope along z is made of has no ends.
    assert moduli.stiffness[2:5, 2:5] == pytest.approx(
        crystal.stiffness[2:5, 2:5], abs=1e-8 * scale
    )
    assert moduli.density == pytest.approx(crystal.mass * np.sqrt(2) / crystal.spacing**3, rel=1e-4)
    # Springs in a row: 79 between layers, and at each end a wall, over the distance of the walls.
    network = gallery.fcc(cells=(2, 2, 80))
    wall = network.stiffness_normal[network.with_wall][0]
    give = 79 / crystal.C + 2 / wall
    assert moduli.whole[2, 2] == pytest.approx(network.length / give / crystal.spacing**2, rel=1e-7)


def disordered(network: Network, spheres: int) -> Network:
    """Return the crystal with random stiffnesses that repeat after a number of `spheres`."""
    random = np.random.default_rng(5)
    key = np.column_stack([network.particle_i % spheres, np.round(4 * network.normal).astype(int)])
    pair = ~network.with_wall
    kinds, kind = np.unique(key[pair], axis=0, return_inverse=True)
    factor = np.ones((2, network.n_contacts))
    factor[:, pair] = random.uniform(0.1, 1.9, (2, len(kinds)))[:, kind.ravel()]
    return stiffer(network, *factor)


def test_bulk_of_a_disordered_slab_is_that_of_the_endless_disorder():
    """Compare four layers of random springs, repeated between walls and endlessly.

    The bulk holds 14 repeats. The motion beyond the strain reduces the moduli by 0.09. Sharp ends
    that do not fit would leave 1/14 of that, 6e-3; soft ends and weights leave far less.
    """
    slab = disordered(gallery.fcc(cells=(2, 2, 80)), 16)
    endless = elastic_moduli(disordered(gallery.fcc(cells=(2, 2, 4), periodic_z=True), 16))
    moduli = elastic_moduli(slab)
    scale = endless.stiffness.max()
    assert abs(endless.affine - endless.stiffness).max() > 0.08 * scale
    off = np.linalg.norm(moduli.stiffness - endless.stiffness) / np.linalg.norm(endless.stiffness)
    assert off < 2 * moduli.asymmetry < 1e-3
    # Nothing moves beyond the strain: only the ends are left, and both sums know no balance.
    assert moduli.affine == pytest.approx(endless.affine, abs=1e-4 * scale)
    # The same slope by another program: a wall pushes, one direction at a time.
    velocity, modulus, _ = static_velocity(slab)
    assert moduli.stiffness[2, 2] == pytest.approx(modulus, rel=1e-3)
    # The fastest wave of so few random springs moves a little sideways, too.
    assert moduli.velocities((0, 0, 1))[0] == pytest.approx(velocity, rel=3e-3)


@pytest.mark.parametrize("solver", ["pardiso", "gradients"])
def test_walls_that_slide_cannot_shear_the_bulk(solver):
    """Remove the tangential springs at the walls: yz and zx then move only these.

    Soft springs still grip.
    """
    pytest.importorskip("pypardiso" if solver == "pardiso" else "numpy")
    slab = disordered(gallery.fcc(cells=(2, 2, 40)), 16)
    grip = elastic_moduli(slab, solver=solver)
    soft = stiffer(slab, 1, np.where(slab.with_wall, 0.01, 1))
    smooth = stiffer(slab, 1, np.where(slab.with_wall, 0, 1))
    gripped_softly = elastic_moduli(soft, solver=solver)
    assert gripped_softly.region == grip.region == "bulk"
    assert gripped_softly.stiffness == pytest.approx(
        grip.stiffness, abs=1e-5 * grip.stiffness.max()
    )
    slides = elastic_moduli(smooth, solver=solver)
    assert slides.region == "slab with walls"
    assert len(slides.soft_strains()) == 2
    codes = [remark.code for remark in slides.remarks()]
    assert codes == ["soft_strain", "soft_strain", "walls_in_moduli"]
    with refusal("unstable"):
        slides.debye_level  # noqa: B018


def test_slabs_that_are_short_or_uneven_say_so():
    moduli = elastic_moduli(gallery.fcc(cells=(2, 2, 6)))
    assert moduli.region == "slab with walls"
    assert [remark.code for remark in moduli.remarks()] == ["walls_in_moduli"]
    uneven = replace(moduli, asymmetry=0.02).remarks()[-1]
    assert uneven.code == "uneven_bulk"
    assert "2.0%" in uneven.text


def test_error_of_a_velocity_covers_an_uneven_bulk():
    """Compare with the harmonic mean of springs that grow fourfold along z.

    The soft ends of the bulk count by half.
    """
    slab = gallery.fcc(cells=(2, 2, 80))
    factor = 1 + 3 * slab.position[slab.particle_i, 2] / slab.length
    (even, *_), (graded, _, error) = map(static_velocity, (slab, stiffer(slab, factor, factor)))
    end = 7 * 2 * slab.radius[0] / slab.length
    mean = np.log((4 - 3 * end) / (1 + 3 * end)) / (3 * (1 - 2 * end))
    assert abs(graded - even / np.sqrt(mean)) < error < 0.02 * graded


def long_waves(network: Network, wavevector: np.ndarray, pre_stress: str) -> np.ndarray:
    """Return V^2 (3,), m^2/s^2, ascending, of the three Bloch waves that move all spheres alike.

    The cell is repeated endlessly: contacts through a period have a phase.
    """
    n = network.n_particles
    scale = 1 / np.sqrt(mass_diagonal(network))
    K = np.zeros((n, 6, n, 6), complex)
    phase = np.exp(1j * (network.cell_shift * network.cell_size) @ wavevector)
    contacts = network.particle_i, network.particle_j, contact_matrices(network, pre_stress), phase
    for i, j, local, turn in zip(*contacts, strict=True):
        K[i, :, i] += local[:6, :6]
        K[j, :, j] += local[6:, 6:]
        K[i, :, j] += local[:6, 6:] * turn
        K[j, :, i] += local[6:, :6] * turn.conj()
    square, shape = np.linalg.eig(scale[:, None] * K.reshape(6 * n, 6 * n) * scale)
    alike = np.zeros((n, 6, 3))
    alike[:, range(3), range(3)] = np.sqrt(network.mass)[:, None]
    share = np.linalg.norm(alike.reshape(-1, 3).T @ shape, axis=0) / np.linalg.norm(shape, axis=0)
    return np.sort(square[np.argsort(share)[-3:]].real) / (wavevector @ wavevector)


def without_loose_spheres(network: Network) -> Network:
    """Return the spheres with three contacts or more, all of which move with a long wave."""
    bearing = keeping_contacts(network, 3)
    new_number = np.cumsum(bearing) - 1
    network = network.with_contacts(bearing[network.particle_i] & bearing[network.particle_j])
    return replace(
        network,
        **{name: column[bearing] for name, column in network.bodies().items()},
        particle_i=new_number[network.particle_i],
        particle_j=new_number[network.particle_j],
    )


@pytest.mark.parametrize("pre_stress", ["normal", "full"])
@pytest.mark.parametrize("direction", [(0, 0, 1), (1, -2, 3)])
def test_first_order_of_the_bloch_waves(pre_stress, direction):
    """Compare the change of V^2 by the forces with Bloch waves, to first order.

    The rest is of second order: half as large, relative, at half the forces. The branches bend by
    (kappa L)^2 in both alike; at a smaller kappa, or with smaller forces, round-off of the largest
    eigenvalue would show.
    """
    network = without_loose_spheres(polydisperse(periodic_z=True, n=60))
    n = np.array(direction) / np.linalg.norm(direction)
    wavevector = 1e-2 / network.cell_size[0] * n
    moduli = elastic_moduli(network, tolerance=1e-10)
    unloaded = long_waves(network, wavevector, "none")
    assert np.sqrt(unloaded[::-1]) == pytest.approx(moduli.velocities(n), rel=1e-4)
    errors = []
    for share in (0.2, 0.1):
        loaded = changed(network, force_normal=times(share), force_tangential=times(share))
        stressed = elastic_moduli(loaded, tolerance=1e-10, pre_stress=pre_stress)
        change = stressed.velocities(n)[::-1] ** 2 - moduli.velocities(n)[::-1] ** 2
        exact_change = long_waves(loaded, wavevector, pre_stress) - unloaded
        errors.append(np.linalg.norm(change - exact_change) / np.linalg.norm(exact_change))
    assert errors[0] < 5e-3
    assert errors[1] < 0.6 * errors[0]


def test_command_and_file(tmp_path, printed):
    product = tmp_path / "a.moduli.h5"
    command = "moduli", PACKINGS / "triaxial.network.h5", "-o", product, "--pre-stress"
    outputs = [printed(*command, pre_stress) for pre_stress in ("none", "full")]
    v, w = (np.array(output["velocity_m_per_s"]["z"]) for output in outputs)
    # The order of stress over modulus: 1 MPa over some 300 MPa.
    assert 1e-4 < abs(w / v - 1).max() < 2e-2
    assert outputs[0]["stiffness_pa"] == outputs[1]["stiffness_pa"]
    again = read_moduli(product)
    assert again.pre_stress == "full"
    assert (again.velocities((0, 0, 1)) == w).all()
