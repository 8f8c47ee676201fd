"""Modes below the first wave of a periodic cell, beside closed forms and whole spectra."""

import numpy as np
import pytest

import analysis
import modal

NAMES = ["first_wave", "soft_participation", "soft_rotation", "soft_contacts"]


def test_modes_below_the_first_wave_are_those_of_the_whole_spectrum():
    """Their number, frequencies and motions as all modes of a dense solver have them."""
    net = modal.random_packing(spheres=110, friction=0.6, seed=2, aspect=1, periodic=True)
    found = analysis.measure(net, quantities=NAMES)
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
    found = analysis.measure(net, quantities=NAMES)
    slow = 2 * np.pi * modal.FccLattice(1e5).bloch(np.array([0, 0, 1.0]))[0][0]
    assert found["first_wave"].value == pytest.approx(slow / net.cell_size[2], rel=1e-6)


def test_walls_have_no_such_waves():
    """A packing between walls is refused in one line that says what to take."""
    found = analysis.measure(modal.fcc(cells=(2, 2, 10)), quantities=["first_wave"])
    assert not found["first_wave"].known and "periodic" in found["first_wave"].caveats[0]
