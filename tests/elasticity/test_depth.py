"""Tests of velocities by depth: a crystal, two stiffnesses, spheres under their weight."""

from dataclasses import replace

import numpy as np
import pytest
from places import DATA
from refusals import refusal
from scipy.linalg import eigvalsh

import modal
from modal.packing.state import contacts_per_particle, profile
from modal.packing.weight import gravity_of, unbalanced_forces

G = 9.81
"""m/s^2."""


def crystal(**changes):
    """Return a crystal of equal springs between walls, 24 cells along z."""
    return replace(modal.fcc(cells=(2, 2, 24)), **changes)


def without_receiver(network):
    """Return a packing with a free end at high z: its wall is far away."""
    kept = network.with_contacts(network.particle_j != modal.RECEIVER_WALL)
    low, high = network.wall_position
    return replace(kept, wall_position=np.array([low, 2 * high]))


@pytest.fixture(scope="module")
def deposit():
    """Return spheres that LAMMPS has let fall on a floor."""
    return modal.read(
        DATA / "lammps_deposit.atoms.gz",
        contacts=DATA / "lammps_deposit.contacts.gz",
        log=DATA / "lammps_deposit.log",
    )


@pytest.mark.parametrize("open_end", [False, True])
def test_a_crystal_has_the_velocities_of_theory_in_each_layer(open_end):
    """Allow 1e-3: layers are no whole number of crystal planes, so their density is off."""
    network = crystal()
    if open_end:
        network = without_receiver(network)
    expected = modal.elastic_moduli(modal.fcc(cells=(2, 2, 24), periodic_z=True))
    v_p, v_s, _ = expected.velocities((0, 0, 1))
    layers = modal.velocities_by_depth(network)
    known = np.isfinite(layers.v_p)
    known[[0, -1]] = False
    assert known.sum() >= 2
    assert layers.v_p[known] == pytest.approx(v_p, rel=1e-3)
    assert layers.v_s[known] == pytest.approx(v_s, rel=1e-3)


def test_each_half_of_a_packing_of_two_stiffnesses_has_its_own():
    """Make springs four times as stiff in the upper half: velocities are twice as high there."""
    network = crystal()
    z = network.position[network.particle_i, 2] + network.branch[:, 2] / 2
    factor = np.where(z > network.length / 2, 4.0, 1.0)
    network = replace(
        network,
        stiffness_normal=factor * network.stiffness_normal,
        stiffness_tangential=factor * network.stiffness_tangential,
        force_normal=None,
        force_tangential=None,
        overlap=None,
    )
    layers = modal.velocities_by_depth(network)
    # Moduli are known to 1e-6 by default, velocities to half of that.
    assert layers.v_p[2] / layers.v_p[1] == pytest.approx(2.0, rel=1e-6)
    assert layers.v_s[2] / layers.v_s[1] == pytest.approx(2.0, rel=1e-6)


def test_gravity_comes_from_the_log_and_balances_the_forces(deposit):
    assert gravity_of(deposit) == pytest.approx([0, 0, -G])
    assert unbalanced_forces(deposit).mean() < 1e-3


def test_stress_grows_by_the_weight_above(deposit):
    """Compare with the weight above the middle of a layer, divided by the area."""
    layers = profile(deposit, 0.04)
    z = deposit.position[:, 2]
    middle = (layers.edges[1:] + layers.edges[:-1]) / 2
    has_load = contacts_per_particle(deposit) > 0
    above = np.array([deposit.mass[(z > height) & has_load].sum() for height in middle])
    assert layers.stress[:-1, 2] == pytest.approx(G * above[:-1] / deposit.area, rel=0.03)


def column_frequencies(velocity, layers, count):
    """Return the lowest natural frequencies, Hz, of a column of layers, held below, free above."""
    velocity = np.where(np.isnan(velocity), velocity[np.isfinite(velocity)][-1], velocity)
    cells = 300
    thickness = layers.layers.edges[-1] / cells
    middle = (np.arange(cells) + 0.5) * thickness
    layer = np.searchsorted(layers.layers.edges, middle, side="right") - 1
    density = layers.density[layer]
    half = thickness / (2 * density * velocity[layer] ** 2)
    spring = 1 / np.append(half[0], half[1:] + half[:-1])
    stiffness = np.diag(spring + np.append(spring[1:], 0))
    stiffness -= np.diag(spring[1:], 1) + np.diag(spring[1:], -1)
    squares = eigvalsh(stiffness, np.diag(density * thickness), subset_by_index=[0, count - 1])
    return np.sqrt(squares) / (2 * np.pi)


def test_layers_foretell_the_lowest_modes_of_a_column(deposit):
    """Compare two shear waves and a P-wave, each a quarter of a wave long."""
    layers = modal.velocities_by_depth(deposit)
    lowest = modal.eigenmodes(deposit, lowest=3).frequency
    shear = column_frequencies(layers.v_s, layers, 1)[0]
    pressure = column_frequencies(layers.v_p, layers, 1)[0]
    assert lowest == pytest.approx([shear, shear, pressure], rel=0.05)


def test_velocities_fall_towards_the_surface(deposit):
    """Compare with stress to the power 1/6 (Hertz); lost contacts make the fall steeper."""
    layers = modal.velocities_by_depth(deposit)
    known = np.isfinite(layers.v_s)
    assert known.sum() >= 4
    assert (np.diff(layers.v_s[known]) < 0).all()
    stress = layers.layers.stress[known, 2]
    exponent = np.polyfit(np.log(stress), np.log(layers.v_s[known]), 1)[0]
    assert 0.1 < exponent < 0.3


def test_a_typed_gravity_is_noted(tmp_path, deposit):
    path = tmp_path / "a.network.h5"
    modal.write(path, replace(deposit, study={}))
    tilted = modal.read(path, gravity=(1.0, 0.0, -9.0))
    assert gravity_of(tilted) == pytest.approx([1, 0, -9])
    assert unbalanced_forces(tilted).mean() > unbalanced_forces(deposit).mean()
    with refusal("gravity"):
        modal.read(path, gravity=(1.0, np.nan, 0.0))


def test_the_command_writes_layers(tmp_path, deposit, printed):
    path = tmp_path / "a.network.h5"
    modal.write(path, deposit)
    result = printed("moduli", path, "--layers", tmp_path / "layers.csv")
    table = np.genfromtxt(tmp_path / "layers.csv", delimiter=",", names=True)
    written = table["v_s_m_per_s"]
    expected = np.array(result["v_s_m_per_s"], float)
    np.testing.assert_allclose(written, expected, rtol=1e-8)


def test_packings_without_depth_are_refused():
    with refusal("no_walls"):
        modal.velocities_by_depth(modal.fcc(cells=(2, 2, 4), periodic_z=True))
    floating = without_receiver(crystal())
    floating = floating.with_contacts(~floating.with_wall)
    with refusal("no_walls"):
        modal.velocities_by_depth(floating)
