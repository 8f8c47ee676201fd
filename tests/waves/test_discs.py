"""Discs of spheres as sources and receivers: which spheres, what they read, in every wave."""

import numpy as np
import pytest
from packings import polydisperse
from refusals import refusal

import modal
from modal.motions import Pulse, SineBurst, SquareWave
from modal.packing.crystal import column
from modal.sources import Disc, Wall
from modal.waves.propagate import propagate_motions
from modal.waves.signals import read_signals, write_signals


@pytest.fixture(scope="module")
def crystal():
    return modal.fcc(cells=(3, 3, 24))


def test_which_spheres(crystal):
    """One layer of a crystal wherever the plane is, within the radius, by the nearest images."""
    width, height = crystal.cell_size[0], crystal.position[:, 2].max() / 2
    layer = abs(crystal.position[:, 2] - height) < np.sqrt(1 / 2) * crystal.radius
    everywhere = Disc((0, 0, height), 10 * width)
    assert np.array_equal(everywhere.spheres(crystal), np.flatnonzero(layer))
    x, y, _ = crystal.position[np.flatnonzero(layer)[0]]
    beside = Disc((x + 2 * width, y - width, height), crystal.radius[0] / 2)
    assert list(beside.spheres(crystal)) == [np.flatnonzero(layer)[0]]
    at_wall = Disc((x, y, 0.0), 10 * width)
    assert (crystal.position[at_wall.spheres(crystal), 2] < 1.1 * crystal.radius[0]).all()
    place = everywhere.position_in(crystal)
    assert place[2] == pytest.approx(crystal.position[layer, 2].mean(), rel=1e-12)
    per_layer = crystal.n_particles // 24
    for share in np.linspace(0, 1, 14):
        disc = Disc((0, 0, share * crystal.length), 10 * width)
        assert len(disc.spheres(crystal)) == per_layer
    with refusal("disc_outside_cell"):
        Disc((0, 0, 2 * crystal.length), width).spheres(crystal)


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (((0, 0), 1.0), "disc"),
        (((0, 0, 0), 0.0), "disc"),
        (((0, 0, 0), 1.0, "torsion"), "unknown_word"),
        (((0, 0, 0), 1.0, "z", "hammer"), "unknown_word"),
    ],
)
def test_no_disc(arguments, code):
    with refusal(code):
        Disc(*arguments)


def test_direction_is_that_of_the_disc(crystal):
    disc = Disc((0, 0, 0), 1.0, "x")
    assert modal.propagate(crystal, 1e-5, source=disc).signals.direction == "x"
    with refusal("direction"):
        modal.propagate(crystal, 1e-5, source=disc, direction="z")
    with refusal("direction"):
        modal.propagate(crystal, 1e-5, source=disc, receivers=[Disc((0, 0, 0.01), 1.0, "z")])


@pytest.mark.parametrize("direction", ["x", "z"])
def test_layer_that_moves_is_a_wall(crystal, direction):
    """A plate of the whole lowest layer: what is above feels d(t), as behind a rough wall.

    A disc that reads the plate itself reads its motion; one of all spheres of a layer their mean.
    """
    heights = np.unique(crystal.position[:, 2].round(9))
    discs = [Disc((0, 0, z), 1.0, direction) for z in heights]
    motion = Pulse(1e-9, 1e5)
    wave = modal.propagate(
        crystal, 6e-5, source=discs[0], motion=motion, receivers=discs, particles=True
    ).signals
    assert wave.disc_displacement[:, 0] == pytest.approx(motion.displacement(wave.time), abs=1e-21)
    layers = wave.particle_displacement.reshape(len(wave.time), -1)
    for k, disc in enumerate(discs):
        mean = layers[:, disc.spheres(crystal)].mean(axis=1)
        assert wave.disc_displacement[:, k] == pytest.approx(mean, abs=1e-21)
    assert abs(wave.disc_displacement[:, 5]).max() > 1e-10
    assert wave.disc_position[:, 2] == pytest.approx(heights, rel=1e-6)
    assert wave.source_position[2] == pytest.approx(heights[0], rel=1e-6)


def test_plate_in_a_column():
    """Masses and springs: u_j'' = (k / m)(...), the plate's neighbours driven; both ends are walls.

    By numbers of a matrix of its own.
    """
    network = column(9)
    z, motion = network.position[:, 2], SineBurst(1e-10, 4e4, 2)
    plate = Disc((0, 0, z[3]), 1.0)
    wave = modal.propagate(network, 1e-4, source=plate, motion=motion, particles=True).signals
    stiffness = np.zeros((9, 9))
    for i, j, k in zip(
        network.particle_i, network.particle_j, network.stiffness_normal, strict=True
    ):
        stiffness[i, i] += k
        if j >= 0:
            stiffness[j, j] += k
            stiffness[[i, j], [j, i]] -= k
    free = np.delete(np.arange(9), 3)
    square, shape = np.linalg.eigh(stiffness[np.ix_(free, free)] / network.mass[0])
    from modal.waves.oscillator import oscillation

    push = -stiffness[free, 3] / network.mass[0] @ shape
    exact = (shape @ (push[:, None] * oscillation(motion, square, wave.time))).T
    assert wave.particle_displacement[:, free] == pytest.approx(exact, abs=1e-8 * abs(exact).max())
    force = motion.displacement(wave.time) * stiffness[3, 3] + exact @ stiffness[free, 3]
    assert wave.source_stress * network.area == pytest.approx(force, abs=1e-8 * abs(force).max())


@pytest.mark.parametrize("drive", ["plate", "force"])
def test_waves_together_are_waves_one_by_one(crystal, drive):
    """Several motions share the products; each has the tolerance of its own record."""
    source = Disc((0, 0, crystal.length / 4), 0.003, "x", drive)
    receiver = Disc((0, 0, crystal.length / 2), 0.003, "x")
    motions = [SineBurst(1e-9, 2e4), SineBurst(1e-9, 8e4, 3, "hann"), SquareWave(1e-9, 4e4)]
    settings = {"source": source, "receivers": [receiver], "interval": 1e-6}
    together = propagate_motions(crystal, 1e-4, motions, **settings)
    for motion, wave in zip(motions, together, strict=True):
        alone = modal.propagate(crystal, 1e-4, motion=motion, **settings)
        assert wave.truncation <= 1e-9 and wave.products >= alone.products
        for name in ("disc_displacement", "layer_displacement", "source_stress"):
            found, wanted = getattr(wave.signals, name), getattr(alone.signals, name)
            assert found == pytest.approx(wanted, abs=3e-9 * abs(wanted).max(initial=0.0)), name


def test_file_keeps_discs(crystal, tmp_path):
    source = Disc((0, 0, crystal.length / 4), 0.003)
    receivers = [Disc((0, 0, crystal.length * share), 0.003) for share in (0.5, 0.75)]
    wave = modal.propagate(crystal, 2e-5, source=source, receivers=receivers).signals
    write_signals(tmp_path / "disc.signals.h5", wave)
    read = read_signals(tmp_path / "disc.signals.h5", of_any_source=True)
    for name in ("disc_position", "disc_displacement", "source_position"):
        assert np.array_equal(getattr(read, name), getattr(wave, name)), name
    assert read.source == source.name and not read.from_wall_to_wall


def test_receivers_of_a_wall(crystal):
    """Discs read waves of other sources too; damped ones, and responses."""
    receiver = Disc((0, 0, crystal.length / 2), 1.0)
    wave = modal.propagate(crystal, 2e-5, source=Wall(), receivers=[receiver]).signals
    layer = np.argmin(abs(wave.layer_position - receiver.position_in(crystal)[2]))
    assert wave.disc_displacement.shape == (len(wave.time), 1) and layer > 0
    found = modal.frequency_response(crystal, highest=2e4, receivers=[receiver])
    assert found.disc_displacement.shape == (len(found.frequency), 1)
    assert abs(found.disc_displacement).max() > 0


def test_small_nonlinear_wave_of_a_plate_is_the_linear_one():
    """What is left is the error of the time step, which falls as its square; the energy adds up."""
    crystal = modal.fcc(cells=(2, 2, 16))
    settings = {
        "source": Disc((0, 0, crystal.length / 3), 0.003, "x"),
        "receivers": [Disc((0, 0, 2 * crystal.length / 3), 0.003, "x")],
        "motion": Pulse(1e-10, 1e5),
        "interval": 1e-6,
    }
    linear = modal.propagate(crystal, 3e-5, pre_stress="full", **settings).signals
    differences = []
    for time_step in (8e-8, 4e-8):
        wave = modal.propagate(
            crystal, 3e-5, nonlinear=True, friction=10.0, time_step=time_step, **settings
        )
        found = []
        for name in ("disc_displacement", "source_stress", "receiver_stress"):
            wanted = getattr(linear, name)
            off = abs(getattr(wave.signals, name) - wanted).max() / abs(wanted).max()
            found.append(off)
        differences.append(found)
        work, kinetic, stored, lost = wave.energy.T
        assert abs(kinetic + stored + lost - work).max() < 1e-3 * abs(work).max()
    coarse, fine = np.array(differences)
    assert (fine < 2e-3).all() and coarse / fine == pytest.approx(4, rel=0.2), differences


def test_periodic_cell_and_free_sides():
    cell = polydisperse(periodic_z=True, n=30)
    source, receiver = (Disc((0.002, 0.002, z), 0.002, "y", "force") for z in (0.001, 0.005))
    wave = modal.propagate(cell, 2e-5, source=source, receivers=[receiver]).signals
    assert not len(wave.source_stress) and abs(wave.disc_displacement).max() > 0
