"""Two transducers in columns with free sides: waves of bars against the columns' own modes."""

from dataclasses import replace

import numpy as np
import pytest
from long_packing import long_packing

import analysis
import modal
from analysis.bench import modulus_velocities
from analysis.estimators.arrival_rules import phase_delays
from modal.packing.network import Network

PERIOD_LAYERS = 48
WAVES_IN_PERIOD = 2
LAYERS = 240


def with_free_sides(network: Network) -> Network:
    """Return the packing without its contacts through periods along x and y."""
    inner = network.with_contacts(~network.periods[:, :2].any(axis=1))
    periodic = np.array([False, False, network.cell_periodic[2]])
    return replace(inner, cell_periodic=periodic)


def held_at_base(network: Network) -> Network:
    """Return a column whose lowest layer is held in place of a wall, with a free top."""
    is_base = network.position[:, 2] < network.position[:, 2].min() + network.radius.min()
    fixed = np.repeat(is_base[:, None], 6, axis=1)
    return replace(network.with_contacts(~network.with_wall), fixed=fixed)


def without_ends(network: Network) -> Network:
    """Return a column with two free ends."""
    return network.with_contacts(~network.with_wall)


@pytest.fixture(scope="module")
def bar():
    """Return a crystal between two walls, with free sides."""
    return with_free_sides(modal.fcc(cells=(2, 2, LAYERS)))


@pytest.fixture(scope="module")
def bar_wave():
    """Return frequency, Hz, and phase velocity, m/s, of a wave along a bar of the crystal.

    A bar with periods along z has plane waves as modes. This is the one whose layers move most as
    a wave of so many lengths in the period.
    """
    endless = with_free_sides(modal.fcc(cells=(2, 2, PERIOD_LAYERS), periodic_z=True))
    modes = modal.eigenmodes(endless, lowest=40)
    wavenumber = 2 * np.pi * WAVES_IN_PERIOD / endless.length
    wave = np.exp(1j * wavenumber * endless.position[:, 2])
    frequency = modes.frequency[np.argmax(abs(modes.shapes()[:, :, 2] @ wave))]
    return frequency, 2 * np.pi * frequency / wavenumber


def two_walls(network: Network) -> Network:
    """Return the column itself."""
    return network


# A plate hinders the sides of the bar beside it, over a fifth of its width: some 1e-3 of the way.
@pytest.mark.parametrize("ends", [two_walls, held_at_base, without_ends])
def test_phase_velocity_of_a_bar_is_that_of_its_modes(bar, bar_wave, ends):
    """Compare columns between walls, held at the base, and with free ends."""
    frequency, velocity = bar_wave
    heights = (0.3 * bar.length, 0.6 * bar.length)
    settings = {"radius": 1.0, "direction": "z", "cycles": 4}
    test = analysis.transducers(ends(bar), heights, [frequency], **settings)
    delays = phase_delays(test.pairs[0])
    delay = np.interp(frequency, delays.frequency, delays.phase)
    assert test.distance / delay == pytest.approx(velocity, rel=2e-3)
    assert all("free_sides" in row.velocity.codes for row in test.rows)


def test_moduli_of_a_bar(bar, bar_wave):
    """Compare a wave 24 layers long, which disperses by 2 %; no S-wave goes along a bar."""
    v_p, v_s = modulus_velocities(bar, "x")
    assert v_p == pytest.approx(bar_wave[1], rel=0.03)
    assert np.isnan(v_s)
    assert np.isnan(modulus_velocities(without_ends(bar), "z")).all()


@pytest.mark.slow
def test_random_column():
    """Compare with the first longitudinal mode between its walls, 2 L f, and with its moduli.

    Parts of a column 5 D wide differ by some per cent. The moduli are those of its bulk, away from
    the walls, the wavelength of the burst is 25 D.
    """
    column = with_free_sides(long_packing())
    modes = modal.eigenmodes(column, lowest=20)
    first_mode = np.sin(np.pi * column.position[:, 2] / column.length) * column.mass
    first = modes.frequency[np.argmax(abs(modes.shapes()[:, :, 2] @ first_mode))]
    velocity, _ = modulus_velocities(column, "z")
    assert velocity == pytest.approx(2 * column.length * first, rel=0.03)
    heights = (0.33 * column.length, 0.62 * column.length)
    diameter = 2 * column.radius.mean()
    settings = {"radius": 1.0, "direction": "z"}
    test = analysis.transducers(column, heights, [velocity / (25 * diameter)], **settings)
    for row in test.rows:
        if row.rule in ("cross_correlation", "phase"):
            assert abs(row.velocity.value - velocity) < 2 * row.velocity.error, row


def test_ways_by_the_ends(bar):
    """Put the receiver 0.1 L below the upper wall: the wave from there comes 0.2 L later."""
    heights = (0.5 * bar.length, 0.9 * bar.length)
    settings = {"radius": 1.0, "direction": "z"}
    layer = bar.length / LAYERS
    for periods, expected in ((0.9, True), (1.1, False)):
        frequency = periods * modulus_velocities(bar, "z")[0] / (0.2 * bar.length)
        test = analysis.transducers(bar, heights, [frequency], **settings)
        for row in test.rows:
            assert ("end_reflections" in row.velocity.codes) == expected
            for caveat in row.velocity.caveats:
                if caveat.code == "end_reflections":
                    allowed = 2 * layer / (0.2 * bar.length)
                    assert caveat.values["periods"] == pytest.approx(periods, rel=allowed)


def test_the_other_way_round_a_period():
    """Put discs 0.4 L from each other in a cell of the length L: the other way is 0.2 L longer."""
    crystal = modal.fcc(cells=(2, 2, 60), periodic_z=True)
    heights = (0.25 * crystal.length, 0.65 * crystal.length)
    test = analysis.transducers(crystal, heights, [1e4], radius=1.0, direction="z")
    delay = (crystal.length - 2 * test.distance) * 1e4 / test.v_p
    codes = [caveat for caveat in test.rows[0].velocity.caveats if caveat.code == "end_reflections"]
    assert codes[0].values["periods"] == pytest.approx(delay, rel=1e-9)
