"""Quantities on request beside closed forms, whole spectra and bounds of their own."""

import numpy as np
import pytest

import analysis
import modal
from analysis.__main__ import main
from analysis.packing_data import PackingData
from analysis.quantities.amplitude import AMPLITUDE
from modal.elasticity.plane_waves import isotropic_mean
from modal.packing import crystal as gallery
from modal.packing.sample import sample_of_network, write_sample
from modal.preparation.relax import relax
from modal.theory.fcc import FccLattice

CRYSTAL = FccLattice(1e5)
LINES = ["scattering_of_p", "scattering_of_s"]
SOFT = ["first_wave", "soft_participation", "soft_rotation", "soft_contacts"]


def test_a_packing_without_stiffness_has_no_velocity_but_a_reason():
    crystal = modal.fcc(cells=(2, 2, 20))
    few = np.random.default_rng(1).random(crystal.n_contacts) < 0.2
    soft = crystal.with_contacts(few | (crystal.particle_j < 0))
    found = analysis.measure(soft, quantities=["v_p", "v_s", "v_p_static", "low_pass"])
    for value in found.values():
        assert not value.known and value.caveats


def test_moduli_over_coordination_number_of_the_crystal():
    """Closed form: twelve contacts, 18 forces less 6 balances a sphere; sqrt(2) spheres a D^3."""
    cell = modal.fcc(cells=(2, 2, 4), periodic_z=True)
    names = ["coordination_of_bearing", "bulk_modulus", "shear_modulus", "bulk_over_affine"]
    names += ["shear_over_affine", "shear_over_indeterminacy"]
    found = [one.value for one in analysis.measure(cell, quantities=names).values()]
    K, G = isotropic_mean(CRYSTAL.stiffness)
    # Every sphere is a centre of symmetry: none leaves the mean strain, Voigt's bound is reached.
    # Spheres overlap by 4e-4 of the diameter here: the lattice is that much closer, in each length.
    last = G * 2 * CRYSTAL.radius / CRYSTAL.kn / (12 * np.sqrt(2))
    assert found[0] == 12 and found[1:5] == pytest.approx([K, G, 1, 1], rel=1e-3)
    assert found[5] == pytest.approx(last, rel=3e-3)


def test_orders_of_a_column_of_hertz_spheres():
    """Even part and second harmonic go as A, the odd part's change as A^2; nothing slides or opens.

    The series in A over the overlap converges fast at the thousandths that are taken.
    """
    column = gallery.column(40)
    sizes = column.overlap[1] * np.array([0.01, 0.02])
    found = analysis.measure(sample_of_network(column, 0.3), amplitudes=sizes)
    assert list(found) == list(AMPLITUDE)
    for name, order in (("even_part", 1), ("second_harmonic", 1), ("odd_part", 2)):
        low, high = found[name].value
        assert np.log2(high / low) == pytest.approx(order, abs=0.05), name
        assert 0 < high < 0.1
    for name in ("slip_loss", "slip_sharing", "slipping_share", "opening_share"):
        assert not found[name].value.any()


def test_more_contacts_slide_and_open_the_larger_the_wave(tmp_path, printed):
    packed = modal.random_packing(300, seed=2, aspect=6)
    sample, _ = relax(sample_of_network(packed, 0.3))
    found = analysis.measure(sample, amplitudes=[1e-9, 1e-7])
    for name in ("slipping_share", "opening_share", "even_part", "odd_part", "slip_loss"):
        low, high = found[name].value
        assert 0 <= low < high < 1, name
    # Contacts that share the loss: more than one, fewer than slid.
    slid = found["slipping_share"].value[1] * sample.network().n_contacts
    assert 1 < found["slip_sharing"].value[1] < slid
    write_sample(tmp_path / "a.sample.h5", sample)
    command = ["measure", tmp_path / "a.sample.h5", "--quantities", "even_part"]
    unknown = printed(*command, main=main, status=3)["even_part"]
    assert unknown["error"] is None
    assert unknown["codes"] == ["no_amplitudes"]
    told = printed(*command, "--amplitudes", "1e-7", main=main)
    assert told["even_part"]["value"] == pytest.approx(found["even_part"].value[1:])


def test_a_crystal_does_not_scatter_and_its_lines_lie_on_the_branches():
    """Frequencies of a cubic lattice, along all axes, by its velocities: 1 % at ten layers."""
    net = modal.fcc(cells=(10, 10, 14), periodic_z=True)
    found = analysis.measure(net, quantities=[*LINES, "v_p_moduli"])
    line = PackingData(net).line
    for name in LINES:
        narrow = np.hypot(0.3 * line, 3 * found[name].error)
        assert (found[name].value < narrow).all() and (found[name].error < 0.5 * line).all()
    # Along z, and across at 45 degrees to the cubic axes, where P-waves are 0.7 % faster.
    slowest = found["v_p_moduli"].value / net.cell_size.max()
    assert found["scattering_of_p"].at[0] == pytest.approx(slowest, rel=0.05)


def test_the_width_of_a_random_packing_is_that_of_its_modes():
    """Line and width of the longest waves from all modes, each as wide as the resolution."""
    net = modal.random_packing(spheres=500, friction=0.3, seed=1, aspect=1, periodic=True)
    found = analysis.measure(net, quantities=["scattering_of_p"])["scattering_of_p"]
    line = PackingData(net).line
    modes = modal.eigenmodes(net, all=True)
    f = np.arange(0, 4 * found.at[0], line / 20)
    total = np.zeros(len(f))
    for axis in range(3):
        wave = np.exp(2j * np.pi * net.position[:, axis] / net.cell_size[axis])
        moving = np.unique(np.concatenate([net.particle_i, net.particle_j]))
        pattern = np.zeros(len(wave), complex)
        pattern[moving] = wave[moving]
        overlap = abs((modes.mode_shape[:, :, axis] * net.mass) @ pattern) ** 2
        spread = line / 2.3548
        shape = np.exp(-0.5 * ((f[:, None] - modes.frequency) / spread) ** 2)
        total += shape @ overlap
    above = f[total > total.max() / 2]
    assert f[total.argmax()] == pytest.approx(found.at[0], abs=0.2 * line)
    width = np.sqrt(np.ptp(above) ** 2 - line**2)
    assert width == pytest.approx(found.value[0], abs=0.2 * line)


def test_modes_below_the_first_wave_are_those_of_the_whole_spectrum():
    """Their number, frequencies and motions as all modes of a dense solver have them."""
    net = modal.random_packing(spheres=110, friction=0.6, seed=2, aspect=1, periodic=True)
    found = analysis.measure(net, quantities=SOFT)
    every = modal.eigenmodes(net, all=True)
    mass = np.repeat([net.mass, net.inertia], 3, axis=0).T
    energy = mass * every.mode_shape**2
    below = (every.frequency > 1) & (every.frequency < found["first_wave"].value)
    spheres = energy[below].sum(axis=2)
    assert below.sum() > 3
    for name, expected in {
        "soft_participation": spheres.sum(axis=1) ** 2 / (spheres**2).sum(axis=1),
        "soft_rotation": energy[below, :, 3:].sum(axis=(1, 2)) / energy[below].sum(axis=(1, 2)),
    }.items():
        np.testing.assert_allclose(found[name].at, every.frequency[below], rtol=1e-8)
        np.testing.assert_allclose(found[name].value, expected, rtol=1e-5)
    first = int(np.argmax((every.mode_shape[below][0, :, :3] ** 2).sum(axis=1)))
    ends = np.concatenate([net.particle_i, net.particle_j])
    assert found["soft_contacts"].value[0] == (ends == first).sum()


def test_the_first_wave_of_a_crystal_is_its_shear_velocity_over_the_side():
    """V_S of the lattice, by theory, along z, where a wave of this cell is the longest."""
    net = modal.fcc(cells=(4, 4, 6), periodic_z=True)
    found = analysis.measure(net, quantities=SOFT)
    slow = 2 * np.pi * modal.FccLattice(1e5).bloch(np.array([0, 0, 1.0]))[0][0]
    assert found["first_wave"].value == pytest.approx(slow / net.cell_size[2], rel=1e-6)


@pytest.mark.parametrize("name", ["first_wave", *LINES])
def test_what_needs_a_periodic_cell_is_refused_between_walls(name):
    found = analysis.measure(modal.fcc(cells=(2, 2, 10)), quantities=[name])
    assert not found[name].known and found[name].codes[0] in ("walls", "not_periodic")
