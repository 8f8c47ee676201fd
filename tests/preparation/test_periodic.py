"""Tests of cells without walls: stress, invariance to shifts, files, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from changes import in_flight
from refusals import refusal

import modal
from modal.__main__ import main
from modal.dem.motion import Dynamics
from modal.packing.sample import read_sample, write_sample
from modal.packing.state import net_forces
from modal.preparation.durations import time_step
from modal.preparation.mixture import MixtureWords
from modal.preparation.random_packing import pack, width_of
from modal.preparation.strain_control import Servo
from modal.preparation.stress_path import StressPath
from modal.preparation.study import Study


def packed(folder, friction):
    """Pack 200 spheres at 100 kPa in a cell without walls and return the sample."""
    words = MixtureWords(periodic=True).texts()
    study = Study(friction, 200, width_of(200, aspect=1.5), seed=2, **words)
    files = pack(folder, study, StressPath((1e5,)), lambda text: None)
    return read_sample(files[-1][1])


@pytest.fixture(scope="module")
def frictionless(tmp_path_factory):
    return packed(tmp_path_factory.mktemp("frictionless"), friction=0.0)


@pytest.fixture(scope="module")
def frictional(tmp_path_factory):
    return packed(tmp_path_factory.mktemp("frictional"), friction=0.3)


@pytest.mark.parametrize("name", ["frictionless", "frictional"])
def test_packing_has_its_stress_without_walls(name, request):
    """Compute stress and balance from contact forces and branches alone."""
    network = request.getfixturevalue(name).network()
    assert network.cell_periodic.all()
    assert not network.with_wall.any()
    force = network.force_normal[:, None] * network.normal - network.force_tangential
    stress = network.branch.T @ force / network.cell_size.prod()
    assert np.diag(stress) == pytest.approx(1e5, rel=4e-3)
    assert abs(stress - np.diag(np.diag(stress))).max() < 0.1 * 1e5
    residual = np.linalg.norm(net_forces(network)[:, :3], axis=1).mean()
    assert residual < 2e-3 * network.force_normal.mean()


def shifted(sample, shift):
    """Move the origin of a packing along z."""
    low, high = sample.walls
    position = sample.position.copy()
    position[:, 2] = low + (position[:, 2] - low + shift) % (high - low)
    # Contacts keep their order and their shear forces where no first end changes: without shear.
    return replace(sample, position=position, shear=None)


def run_under_servo(sample):
    """Return the motion of a sample after 100 steps under a servo, with contacts that change."""
    motion = Dynamics(sample, damping=0.2)
    servo = Servo(2e5, 0.01)
    contact_counts = set()
    for k in range(100):
        motion.step(time_step(3e5), servo.follow if k % 5 == 4 else None)
        contact_counts.add(motion.contacts.touching)
    assert len(contact_counts) > 5
    return motion


def test_motion_does_not_depend_on_the_origin(frictional):
    """Strain a cell by a servo, from two origins along z: spheres slide, part and meet."""
    random = np.random.default_rng(1)
    velocity = 0.03 * random.standard_normal(frictional.position.shape)
    still = replace(frictional, shear=None)
    start = in_flight(still, velocity, velocity / frictional.radius)
    length_before = frictional.walls[1] - frictional.walls[0]
    shift = 0.37 * length_before
    motion = run_under_servo(start)
    shifted_motion = run_under_servo(shifted(start, shift))
    sample = motion.sample(moving=False)
    shifted_sample = shifted_motion.sample(moving=False)
    assert shifted_sample.walls == pytest.approx(sample.walls, rel=1e-9)
    length = float(np.diff(sample.walls)[0])
    lengths = [*sample.side, length]
    difference = shifted_sample.position - sample.position
    difference[:, 2] -= shift * length / length_before
    difference -= np.round(difference / lengths) * lengths
    # Round-off of positions, 1e-17 m, grows as collisions separate the paths.
    assert abs(difference).max() < 1e-9 * 2 * frictional.radius
    assert motion.stress() == pytest.approx(shifted_motion.stress(), rel=1e-6)


@pytest.fixture
def periodic_file(frictional, tmp_path):
    """Return the file of a cell without walls."""
    path = tmp_path / "cell.sample.h5"
    write_sample(path, frictional)
    assert read_sample(path).periodic_z
    return path


def test_commands_read_a_cell_without_walls(periodic_file, frictional, printed):
    middle = (frictional.walls[1] - frictional.walls[0]) / 2
    assert printed("moduli", periodic_file)
    assert printed("wave", periodic_file, "--plane", middle, "--duration", 2e-5)


def test_nonlinear_wave_without_walls_is_refused(periodic_file, one_line):
    one_line(main, ["wave", periodic_file, "--nonlinear"])


def test_walls_of_a_cell_without_walls_are_refused():
    with refusal("walls_and_periodic"):
        modal.random_packing(100, periodic=True, walls=(2e9, 0.4))
