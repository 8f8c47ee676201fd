"""Cells without walls: their stress, steps that know no place, packings to be used."""

from dataclasses import replace

import numpy as np
import pytest
from changes import in_flight

import modal
from modal.__main__ import main
from modal.dem.motion import Dynamics
from modal.packing.sample import read_sample, write_sample
from modal.packing.state import net_forces
from modal.preparation.durations import time_step
from modal.preparation.random_packing import pack
from modal.preparation.strain_control import Servo
from modal.tools.errors import InputError


def packed(folder, **options):
    """A sample at 100 kPa from `pack`, its file in `folder`."""
    files = pack(folder, lambda text: None, 200, [1e5], seed=2, aspect=1.5, **options)
    return read_sample(files[-1][1])


@pytest.fixture(scope="module")
def smooth(tmp_path_factory):
    return packed(tmp_path_factory.mktemp("smooth"), friction=0.0, periodic=True)


@pytest.fixture(scope="module")
def rough(tmp_path_factory):
    return packed(tmp_path_factory.mktemp("rough"), friction=0.3, periodic=True)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_packing_has_its_stress_without_walls(friction, smooth, rough):
    """Contacts alone say so: in balance, the stress their forces' moments, none with a wall."""
    sample = rough if friction else smooth
    network = sample.network()
    assert network.cell_periodic.all() and not network.with_wall.any()
    force = network.force_normal[:, None] * network.normal - network.force_tangential
    stress = network.branch.T @ force / network.cell_size.prod()
    assert np.diag(stress) == pytest.approx(1e5, rel=4e-3)
    assert abs(stress - np.diag(np.diag(stress))).max() < 0.1 * 1e5
    residual = np.linalg.norm(net_forces(network)[:, :3], axis=1).mean()
    assert residual < 2e-3 * network.force_normal.mean()


def shifted(sample, by):
    """The same packing with the origin elsewhere along z."""
    low, high = sample.walls
    position = sample.position.copy()
    position[:, 2] = low + (position[:, 2] - low + by) % (high - low)
    # Contacts keep their order and their shear forces where no first end changes: without shear.
    return replace(sample, position=position, shear=None)


def test_steps_know_no_place(rough):
    """Strained by a servo, spheres slide, part and meet: the same from another origin along z."""
    random, low = np.random.default_rng(1), rough.walls[0]
    velocity = 0.03 * random.standard_normal(rough.position.shape)
    still = in_flight(replace(rough, shear=None), velocity, velocity / rough.radius)
    by = 0.37 * (rough.walls[1] - low)
    runs = []
    for sample in (still, shifted(still, by)):
        motion, servo = Dynamics(sample, damping=0.2), Servo(2e5, 0.01)
        touched = set()
        for k in range(100):
            motion.step(time_step(3e5), servo.follow if k % 5 == 4 else None)
            touched.add(motion.contacts.touching)
        runs.append(motion)
    assert len(touched) > 5
    first, second = (motion.sample(moving=False) for motion in runs)
    assert second.walls == pytest.approx(first.walls, rel=1e-9)
    length = float(np.diff(first.walls)[0])
    apart = second.position - first.position
    apart[:, 2] -= by * length / (rough.walls[1] - low)
    apart -= np.round(apart / [*first.side, length]) * [*first.side, length]
    # Round-off of places, 1e-17 m, grows as collisions part the ways.
    assert abs(apart).max() < 1e-9 * 2 * rough.radius
    assert runs[0].stress() == pytest.approx(runs[1].stress(), rel=1e-6)


def test_file_and_commands_take_a_cell_without_walls(rough, tmp_path, printed, one_line):
    path = tmp_path / "cell.sample.h5"
    write_sample(path, rough)
    assert read_sample(path).periodic_z
    lengths = rough.walls[1] - rough.walls[0]
    for words in (f"moduli {path}", f"wave {path} --plane {lengths / 2} --duration 2e-5"):
        assert printed(*words.split())
    one_line(main, ["wave", path, "--nonlinear"], "no wall sends a wave")


def test_walls_of_a_cell_without_walls_are_refused():
    with pytest.raises(InputError, match="has none"):
        modal.random_packing(100, periodic=True, walls=(2e9, 0.4))
