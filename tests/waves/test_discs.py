"""Discs of spheres as sources and receivers: their spheres, their motion, and their records."""

import numpy as np
import pytest
from packings import polydisperse
from refusals import refusal

import modal
from modal.motions import Pulse, SineBurst, SquareWave
from modal.packing.crystal import column
from modal.sources import Disc, Wall
from modal.waves.oscillator import oscillation
from modal.waves.propagate import propagate_motions
from modal.waves.signals import read_signals, write_signals


@pytest.fixture(scope="module")
def crystal():
    return modal.fcc(cells=(3, 3, 24))


@pytest.fixture(scope="module")
def middle_layer(crystal):
    """Return height, m, and spheres of a layer in the middle of the crystal."""
    height = crystal.position[:, 2].max() / 2
    distance = abs(crystal.position[:, 2] - height)
    return height, np.flatnonzero(distance < np.sqrt(1 / 2) * crystal.radius)


def wide_disc(crystal, height):
    """Return a disc at this height that is wider than the crystal."""
    return Disc((0, 0, height), 10 * crystal.cell_size[0])


def test_a_wide_disc_has_one_layer(crystal, middle_layer):
    height, layer = middle_layer
    disc = wide_disc(crystal, height)
    assert np.array_equal(disc.spheres(crystal), layer)
    mean_height = crystal.position[layer, 2].mean()
    assert disc.position_in(crystal)[2] == pytest.approx(mean_height, rel=1e-12)


@pytest.mark.parametrize("share", np.linspace(0, 1, 14).round(3))
def test_a_wide_disc_has_one_layer_at_any_height(crystal, share):
    disc = wide_disc(crystal, share * crystal.length)
    assert len(disc.spheres(crystal)) == crystal.n_particles // 24


def test_a_disc_at_a_wall_has_the_lowest_layer(crystal):
    spheres = wide_disc(crystal, 0.0).spheres(crystal)
    assert (crystal.position[spheres, 2] < 1.1 * crystal.radius[0]).all()


def test_a_disc_has_the_nearest_images_of_spheres(crystal, middle_layer):
    """Put a disc two periods beside a sphere, with half of its radius."""
    height, layer = middle_layer
    width = crystal.cell_size[0]
    x, y, _ = crystal.position[layer[0]]
    disc = Disc((x + 2 * width, y - width, height), crystal.radius[0] / 2)
    assert disc.spheres(crystal).tolist() == [layer[0]]


def test_a_disc_outside_the_packing_is_refused(crystal):
    with refusal("disc_outside_cell"):
        wide_disc(crystal, 2 * crystal.length).spheres(crystal)


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        pytest.param(((0, 0), 1.0), "disc", id="two coordinates"),
        pytest.param(((0, 0, 0), 0.0), "disc", id="no radius"),
        pytest.param(((0, 0, 0), 1.0, "torsion"), "unknown_word", id="torsion"),
        pytest.param(((0, 0, 0), 1.0, "z", "hammer"), "unknown_word", id="unknown drive"),
    ],
)
def test_a_wrong_disc_is_refused(arguments, code):
    with refusal(code):
        Disc(*arguments)


def test_the_direction_of_a_wave_is_that_of_its_disc(crystal):
    disc = Disc((0, 0, 0), 1.0, "x")
    assert modal.propagate(crystal, 1e-5, source=disc).signals.direction == "x"


def test_another_direction_than_that_of_the_source_is_refused(crystal):
    with refusal("direction"):
        modal.propagate(crystal, 1e-5, source=Disc((0, 0, 0), 1.0, "x"), direction="z")


def test_a_receiver_of_another_direction_is_refused(crystal):
    source = Disc((0, 0, 0), 1.0, "x")
    with refusal("direction"):
        modal.propagate(crystal, 1e-5, source=source, receivers=[Disc((0, 0, 0.01), 1.0, "z")])


@pytest.fixture(scope="module", params=["x", "z"])
def layer_wave(crystal, request):
    """Return a wave sent by the lowest layer as a plate, with a disc in each layer, and its motion.

    The third value are the discs.
    """
    heights = np.unique(crystal.position[:, 2].round(9))
    discs = [Disc((0, 0, z), 1.0, request.param) for z in heights]
    motion = Pulse(1e-9, 1e5)
    settings = {"source": discs[0], "motion": motion, "receivers": discs, "particles": True}
    return modal.propagate(crystal, 6e-5, **settings).signals, motion, discs


# Displacements are up to 1e-9 m; 1e-21 m is their round-off times some thousand sums.


def test_a_disc_in_the_plate_records_its_motion(layer_wave):
    wave, motion, _ = layer_wave
    assert wave.disc_displacement[:, 0] == pytest.approx(motion.displacement(wave.time), abs=1e-21)


def test_a_disc_records_the_mean_of_its_spheres(crystal, layer_wave):
    wave, _, discs = layer_wave
    spheres = wave.particle_displacement.reshape(len(wave.time), -1)
    for k, disc in enumerate(discs):
        mean = spheres[:, disc.spheres(crystal)].mean(axis=1)
        assert wave.disc_displacement[:, k] == pytest.approx(mean, abs=1e-21)
    # The wave arrives at the sixth layer.
    assert abs(wave.disc_displacement[:, 5]).max() > 1e-10


def test_a_record_has_the_heights_of_its_discs(layer_wave):
    wave, _, discs = layer_wave
    heights = [disc.centre[2] for disc in discs]
    # The discs were put at heights that are rounded to 1e-9 m; the lowest is 1e-3 m.
    assert wave.disc_position[:, 2] == pytest.approx(heights, rel=1e-6)
    assert wave.source_position[2] == pytest.approx(heights[0], rel=1e-6)


def column_matrix(network):
    """Return the stiffness (n, n), N/m, of a column of spheres for motions along z."""
    n = network.n_particles
    stiffness = np.zeros((n, n))
    for i, j, k in zip(
        network.particle_i, network.particle_j, network.stiffness_normal, strict=True
    ):
        stiffness[i, i] += k
        if j >= 0:
            stiffness[j, j] += k
            stiffness[i, j] -= k
            stiffness[j, i] -= k
    return stiffness


def test_a_plate_in_a_column():
    """Drive the fourth of nine spheres: its neighbours are oscillators, both ends are walls.

    Compare with the modes of the other eight spheres, each driven by the springs of the plate.
    """
    network = column(9)
    plate = 3
    mass = network.mass[0]
    motion = SineBurst(1e-10, 4e4, 2)
    source = Disc((0, 0, network.position[plate, 2]), 1.0)
    wave = modal.propagate(network, 1e-4, source=source, motion=motion, particles=True).signals

    stiffness = column_matrix(network)
    free = np.delete(np.arange(9), plate)
    square, shape = np.linalg.eigh(stiffness[np.ix_(free, free)] / mass)
    push = -stiffness[free, plate] / mass @ shape
    oscillators = oscillation(motion, square, wave.time)
    exact = (shape @ (push[:, None] * oscillators)).T
    # The expansion in time has an error of 1e-9 of the largest displacement.
    tolerance = 1e-8 * abs(exact).max()
    assert wave.particle_displacement[:, free] == pytest.approx(exact, abs=tolerance)
    drive = motion.displacement(wave.time)
    force = drive * stiffness[plate, plate] + exact @ stiffness[free, plate]
    tolerance = 1e-8 * abs(force).max()
    assert wave.source_stress * network.area == pytest.approx(force, abs=tolerance)


@pytest.mark.parametrize("drive", ["plate", "force"])
def test_waves_together_are_waves_one_by_one(crystal, drive):
    """Send several motions, which share the products; each has the tolerance of its own record."""
    source = Disc((0, 0, crystal.length / 4), 0.003, "x", drive)
    receiver = Disc((0, 0, crystal.length / 2), 0.003, "x")
    motions = [SineBurst(1e-9, 2e4), SineBurst(1e-9, 8e4, 3, "hann"), SquareWave(1e-9, 4e4)]
    settings = {"source": source, "receivers": [receiver], "interval": 1e-6}
    together = propagate_motions(crystal, 1e-4, motions, **settings)
    for motion, wave in zip(motions, together, strict=True):
        alone = modal.propagate(crystal, 1e-4, motion=motion, **settings)
        assert wave.truncation <= 1e-9
        assert wave.products >= alone.products
        for name in ("disc_displacement", "layer_displacement", "source_stress"):
            expected = getattr(alone.signals, name)
            # Both are truncated at 1e-9; a force has no stress at its source.
            tolerance = 3e-9 * abs(expected).max(initial=0.0)
            assert getattr(wave.signals, name) == pytest.approx(expected, abs=tolerance), name


def test_a_file_contains_the_discs(crystal, tmp_path):
    source = Disc((0, 0, crystal.length / 4), 0.003)
    receivers = [Disc((0, 0, crystal.length * share), 0.003) for share in (0.5, 0.75)]
    wave = modal.propagate(crystal, 2e-5, source=source, receivers=receivers).signals
    write_signals(tmp_path / "disc.signals.h5", wave)
    again = read_signals(tmp_path / "disc.signals.h5", of_any_source=True)
    for name in ("disc_position", "disc_displacement", "source_position"):
        assert np.array_equal(getattr(again, name), getattr(wave, name)), name
    assert again.source == source.name
    assert not again.from_wall_to_wall


def test_a_disc_records_the_wave_of_a_wall(crystal):
    receiver = Disc((0, 0, crystal.length / 2), 1.0)
    wave = modal.propagate(crystal, 2e-5, source=Wall(), receivers=[receiver]).signals
    assert wave.disc_displacement.shape == (len(wave.time), 1)


def test_a_disc_records_the_response_to_a_wall(crystal):
    receiver = Disc((0, 0, crystal.length / 2), 1.0)
    response = modal.frequency_response(crystal, highest=2e4, receivers=[receiver])
    assert response.disc_displacement.shape == (len(response.frequency), 1)
    assert abs(response.disc_displacement).max() > 0


PLATE_RECORDS = ("disc_displacement", "source_stress", "receiver_stress")


@pytest.fixture(scope="module")
def plate_waves():
    """Return the linear wave of a plate, and non-linear ones of small amplitude by their steps.

    The amplitude, 1e-10 m, is a thousandth of the overlaps.
    """
    crystal = modal.fcc(cells=(2, 2, 16))
    settings = {
        "source": Disc((0, 0, crystal.length / 3), 0.003, "x"),
        "receivers": [Disc((0, 0, 2 * crystal.length / 3), 0.003, "x")],
        "motion": Pulse(1e-10, 1e5),
        "interval": 1e-6,
    }
    linear = modal.propagate(crystal, 3e-5, pre_stress="full", **settings).signals
    nonlinear = {}
    for time_step in (8e-8, 4e-8):
        nonlinear[time_step] = modal.propagate(
            crystal, 3e-5, nonlinear=True, friction=10.0, time_step=time_step, **settings
        )
    return linear, nonlinear


@pytest.mark.parametrize("name", PLATE_RECORDS)
def test_a_small_nonlinear_wave_of_a_plate_is_the_linear_one(plate_waves, name):
    """Allow the error of the time step, which falls as its square."""
    linear, nonlinear = plate_waves
    expected = getattr(linear, name)

    def error(time_step):
        record = getattr(nonlinear[time_step].signals, name)
        return abs(record - expected).max() / abs(expected).max()

    assert error(4e-8) < 2e-3
    # A fifth: the part of higher order, and that of the amplitude.
    assert error(8e-8) / error(4e-8) == pytest.approx(4, rel=0.2)


@pytest.mark.parametrize("time_step", [8e-8, 4e-8])
def test_the_work_of_a_plate_is_in_the_energy_balance(plate_waves, time_step):
    """Allow a thousandth for the time step."""
    work, kinetic, stored, lost = plate_waves[1][time_step].energy.T
    assert abs(kinetic + stored + lost - work).max() < 1e-3 * abs(work).max()


def test_discs_in_a_cell_without_walls():
    """Push spheres: there is no stress of a source, but a wave."""
    cell = polydisperse(periodic_z=True, n=30)
    source = Disc((0.002, 0.002, 0.001), 0.002, "y", "force")
    receiver = Disc((0.002, 0.002, 0.005), 0.002, "y", "force")
    wave = modal.propagate(cell, 2e-5, source=source, receivers=[receiver]).signals
    assert len(wave.source_stress) == 0
    assert abs(wave.disc_displacement).max() > 0
