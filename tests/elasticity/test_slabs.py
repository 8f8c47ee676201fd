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

from modal.elasticity.moduli import elastic_moduli, read_moduli
from modal.elasticity.slab import static_velocity
from modal.packing import crystal as gallery
from modal.packing.network import Network
from modal.packing.rattlers import keeping_contacts
from modal.system.assembly import mass_diagonal
from modal.theory.fcc import FccLattice


def test_crystal_between_walls_has_the_bulk_of_the_endless_one():
    """Soft ends of the bulk: the sum over layers l against the integral over its length L.

    The weight's slope kinks by pi^2 / (2 fade^2) at four places, each of which costs at most 0.048
    l^3 / 6 of that (Euler and Maclaurin): together 8e-5 of L.
    """
    crystal = FccLattice(1e5)
    found = elastic_moduli(gallery.fcc(cells=(2, 2, 80)))
    scale = crystal.stiffness.max()
    assert found.region == "bulk"
    assert found.stiffness == pytest.approx(crystal.stiffness, abs=1e-4 * scale)
    # What the slope along z is made of has no ends.
    assert found.stiffness[2:5, 2:5] == pytest.approx(crystal.stiffness[2:5, 2:5], abs=1e-8 * scale)
    assert found.density == pytest.approx(crystal.mass * np.sqrt(2) / crystal.spacing**3, rel=1e-4)
    # Springs in a row: 79 between layers, and at each end a wall, over the distance of the walls.
    network = gallery.fcc(cells=(2, 2, 80))
    wall = network.stiffness_normal[network.with_wall][0]
    give = 79 / crystal.C + 2 / wall
    assert found.whole[2, 2] == pytest.approx(network.length / give / crystal.spacing**2, rel=1e-7)


def disordered(network: Network, spheres: int) -> Network:
    """A crystal whose contacts have any stiffness, the same again after so many `spheres`."""
    random = np.random.default_rng(5)
    key = np.column_stack([network.particle_i % spheres, np.round(4 * network.normal).astype(int)])
    pair = ~network.with_wall
    kinds, kind = np.unique(key[pair], axis=0, return_inverse=True)
    factor = np.ones((2, network.n_contacts))
    factor[:, pair] = random.uniform(0.1, 1.9, (2, len(kinds)))[:, kind.ravel()]
    return stiffer(network, *factor)


def test_bulk_of_a_disordered_slab_is_that_of_the_endless_disorder():
    """Four layers of random springs, again and again: between walls, and for ever.

    The bulk holds 14 of them. What motion beyond the strain gives back is 0.09 of the moduli; ends
    that do not fit would leave 1/14 of that, 6e-3, soft ends and weights leave far less.
    """
    slab = disordered(gallery.fcc(cells=(2, 2, 80)), 16)
    endless = elastic_moduli(disordered(gallery.fcc(cells=(2, 2, 4), periodic_z=True), 16))
    found = elastic_moduli(slab)
    scale = endless.stiffness.max()
    assert abs(endless.affine - endless.stiffness).max() > 0.08 * scale
    off = np.linalg.norm(found.stiffness - endless.stiffness) / np.linalg.norm(endless.stiffness)
    assert off < 2 * found.asymmetry < 1e-3
    # Nothing moves beyond the strain: only the ends are left, and both sums know no balance.
    assert found.affine == pytest.approx(endless.affine, abs=1e-4 * scale)
    # The same slope by another program: a wall pushes, one direction at a time.
    velocity, modulus, _ = static_velocity(slab)
    assert found.stiffness[2, 2] == pytest.approx(modulus, rel=1e-3)
    # The fastest wave of so few random springs moves a little sideways, too.
    assert found.velocities((0, 0, 1))[0] == pytest.approx(velocity, rel=3e-3)


@pytest.mark.parametrize("solver", ["pardiso", "gradients"])
def test_walls_that_slide_cannot_shear_the_bulk(solver):
    """Without tangential springs at the walls yz and zx move these alone; soft ones still grip."""
    pytest.importorskip("pypardiso" if solver == "pardiso" else "numpy")
    slab = disordered(gallery.fcc(cells=(2, 2, 40)), 16)
    grip = elastic_moduli(slab, solver=solver)
    soft, smooth = (stiffer(slab, 1, np.where(slab.with_wall, f, 1)) for f in (0.01, 0))
    found = elastic_moduli(soft, solver=solver)
    assert found.region == grip.region == "bulk"
    assert found.stiffness == pytest.approx(grip.stiffness, abs=1e-5 * grip.stiffness.max())
    slides = elastic_moduli(smooth, solver=solver)
    assert slides.region == "slab with walls" and len(slides.soft_strains()) == 2
    codes = [remark.code for remark in slides.remarks()]
    assert codes == ["soft_strain", "soft_strain", "walls_in_moduli"]
    with refusal("unstable"):
        slides.debye_level  # noqa: B018


def test_slabs_that_are_short_or_uneven_say_so():
    """Of springs that grow fourfold the harmonic mean, soft ends by half, is in the error."""
    found = elastic_moduli(gallery.fcc(cells=(2, 2, 6)))
    assert found.region == "slab with walls"
    assert [remark.code for remark in found.remarks()] == ["walls_in_moduli"]
    uneven = replace(found, asymmetry=0.02).remarks()[-1]
    assert uneven.code == "uneven_bulk"
    assert "2.0%" in uneven.text
    slab = gallery.fcc(cells=(2, 2, 80))
    factor = 1 + 3 * slab.position[slab.particle_i, 2] / slab.length
    (even, *_), (graded, _, error) = map(static_velocity, (slab, stiffer(slab, factor, factor)))
    end = 7 * 2 * slab.radius[0] / slab.length
    mean = np.log((4 - 3 * end) / (1 + 3 * end)) / (3 * (1 - 2 * end))
    assert abs(graded - even / np.sqrt(mean)) < error < 0.02 * graded


def long_waves(network: Network, wavevector: np.ndarray, pre_stress: str) -> np.ndarray:
    """V^2 (3,) of the three Bloch waves that move all spheres alike, m^2/s^2, ascending.

    Of the cell repeated for ever: contacts through a period have a phase.
    """
    n, scale = network.n_particles, 1 / np.sqrt(mass_diagonal(network))
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
    """Only spheres with three contacts or more: all that has mass then moves with a long wave."""
    kept = keeping_contacts(network, 3)
    place = np.cumsum(kept) - 1
    network = network.with_contacts(kept[network.particle_i] & kept[network.particle_j])
    return replace(
        network,
        **{name: column[kept] for name, column in network.bodies().items()},
        particle_i=place[network.particle_i],
        particle_j=place[network.particle_j],
    )


@pytest.mark.parametrize("pre_stress", ["normal", "full"])
@pytest.mark.parametrize("direction", [(0, 0, 1), (1, -2, 3)])
def test_first_order_of_the_bloch_waves(pre_stress, direction):
    """60 spheres of radii 1:3, with a share of their forces, and half of it.

    What is left of the change of V^2 is of second order: half as much, relative, at half the
    forces. The branches bend by (kappa L)^2 in both alike; at a smaller kappa, or with smaller
    forces, round-off of the largest eigenvalue would be seen.
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
        found = stressed.velocities(n)[::-1] ** 2 - moduli.velocities(n)[::-1] ** 2
        wanted = long_waves(loaded, wavevector, pre_stress) - unloaded
        errors.append(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))
    assert errors[0] < 5e-3
    assert errors[1] < 0.6 * errors[0]


def test_command_and_file(tmp_path, printed):
    product = tmp_path / "a.moduli.h5"
    command = "moduli", PACKINGS / "triaxial.network.h5", "-o", product, "--pre-stress"
    told = [printed(*command, pre_stress) for pre_stress in ("none", "full")]
    v, w = (np.array(each["velocity_m_per_s"]["z"]) for each in told)
    # The order of stress over modulus: 1 MPa over some 300 MPa.
    assert 1e-4 < abs(w / v - 1).max() < 2e-2
    assert told[0]["stiffness_pa"] == told[1]["stiffness_pa"]
    again = read_moduli(product)
    assert again.pre_stress == "full" and (again.velocities((0, 0, 1)) == w).all()
