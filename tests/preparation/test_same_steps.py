"""Steps of moving spheres, taken in other ways: by numpy, and in YADE."""

import json

import numpy as np
import pytest
from in_yade import script
from packings import agitated_sample
from places import ROOT

from modal.dem import contacts as moving_contacts
from modal.dem import motion as dynamics
from modal.dem.forces_by_arrays import forces_by_arrays
from modal.dem.leapfrog import advance_by_arrays
from modal.dem.motion import Dynamics
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.sample import read_sample, write_sample
from modal.preparation.durations import time_step
from modal.preparation.strain_control import INERTIAL_NUMBER, ConstantRate, Servo
from modal.tools import slabs

EPS = np.finfo(float).eps
STEP = time_step(3e5)


def run(sample, steps, **options):
    """Return the motion of a sample under a servo to 300 kPa."""
    servo = Servo(3e5, INERTIAL_NUMBER)
    motion = Dynamics(sample, damping=0.2, control=servo.follow, **options)
    motion.advance(steps, STEP, 5)
    return motion


MIXTURES = [
    {"sizes": ("two", 2, 0.5)},
    {"sizes": ("lognormal", 0.3)},
    {"densities": (2230, 7800), "walls": (2e9, 0.4)},
    {"sizes": ("two", 2, 0.5), "densities": (7800, 1200), "walls": (2.1e11, 0.3)},
]
"""The last wall is stiffer than a box of positive modulus can be in YADE."""


@pytest.mark.parametrize("mixture", [{}, MIXTURES[-1], {"periodic": True}])
def test_compiled_steps_are_those_of_numpy(mixture, monkeypatch):
    """Compare, to round-off, a hundred steps in which contacts slide, open and close."""
    sample = agitated_sample(**mixture)
    compiled = run(sample, 100)
    monkeypatch.setattr(moving_contacts, "forces_by_loop", forces_by_arrays)
    monkeypatch.setattr(dynamics, "advance_by_loop", advance_by_arrays)
    arrays = run(sample, 100)
    assert compiled.contacts.touching == arrays.contacts.touching
    difference = abs(compiled.contacts.position - arrays.contacts.position).max()
    # Rounding of a coordinate, eps times the length, grows a thousandfold by collisions.
    assert difference < 1e3 * EPS * 50 * RADIUS
    mean = compiled.contacts.mean_force
    assert abs(compiled.contacts.load - arrays.contacts.load)[:, :3].max() < 1e-8 * mean
    assert compiled.stress() == pytest.approx(arrays.stress(), rel=1e-9)


@pytest.mark.parametrize("crossing", [0, 300])
def test_slabs_of_one_pass_share_no_sphere(crossing):
    """Check every other slab, and that all contacts are in one slab.

    With a period along z the last contacts join both ends.
    """
    random = np.random.default_rng(4)
    n_spheres = 5000
    n_contacts = 20000
    first = np.sort(random.integers(0, n_spheres, n_contacts))
    second = np.minimum(first + random.integers(1, 200, n_contacts), n_spheres - 1)
    second[random.random(n_contacts) < 0.05] = -1
    ends = np.column_stack([first, second])
    low = random.integers(0, 200, crossing)
    across = np.column_stack([low, n_spheres - 1 - random.integers(0, 200, crossing)])
    ends = np.concatenate([ends, across])
    bounds = slabs.slabs_of(ends, n_spheres, crossing)
    assert bounds[0] == 0
    assert bounds[-1] == len(ends)
    assert (np.diff(bounds) >= 0).all()
    spheres = [np.setdiff1d(slab, -1) for slab in np.split(ends, bounds[1:-1])]
    assert len(spheres) > 7
    for slabs_of_pass in (spheres[::2], spheres[1::2]):
        n_in_slabs = sum(len(slab) for slab in slabs_of_pass)
        assert np.unique(np.concatenate(slabs_of_pass)).size == n_in_slabs


def test_slabs_that_a_period_joins_are_one_slab():
    """Join spheres of the second and the last slab: no two slabs can be computed at once."""
    n_spheres = 5000
    first = np.arange(n_spheres - 1)
    ends = np.concatenate([np.column_stack([first, first + 1]), [[600, n_spheres - 1]]])
    assert slabs.slabs_of(ends, n_spheres, 1).tolist() == [0, n_spheres]
    assert len(slabs.slabs_of(ends[:-1], n_spheres)) > 15


def steps_in_yade(start, folder, settings):
    """Return the sample after the steps of a script that runs inside YADE."""
    end = folder / "end.sample.h5"
    script(ROOT / "tests/yade/steps.py", ROOT, start, end, json.dumps(settings), folder=folder)
    return read_sample(end)


def steps_in_modal(start, settings):
    """Return the motion after the same steps, and the stresses after every fifth step.

    Contacts must form, open and slide all the time.
    """
    motion = Dynamics(read_sample(start), damping=settings["damping"])
    if "rate" in settings:
        control = ConstantRate(settings["rate"])
    else:
        control = Servo(settings["stress"], INERTIAL_NUMBER)
    stresses = []
    touching = [motion.contacts.touching]
    sliding = []
    for k in range(settings["steps"]):
        if k > 0 and k % settings["interval"] == 0:
            motion.step(settings["dt"], control.follow)
            stresses.append(control.stress)
        else:
            motion.step(settings["dt"], None)
        touching.append(motion.contacts.touching)
        sliding.append(motion.contacts.sliding)
    change = np.diff(touching)
    assert (change > 0).sum() > 20
    assert (change < 0).sum() > 20
    assert np.mean(sliding) > 10
    return motion, np.array(stresses)


@pytest.mark.parametrize(
    ("drive", "mixture"),
    [
        pytest.param({"stress": 3e5}, {}, id="stress"),
        pytest.param({"rate": 1.0}, {}, id="rate"),
        *(({"stress": 3e5}, mixture) for mixture in MIXTURES),
    ],
)
def test_steps_are_those_of_yade(drive, mixture, tmp_path, yade):
    """Take 500 steps of 200 spheres that fly, spin, slide, separate and meet, in a strained cell.

    1e-8 of a diameter, of the mean contact force and of the stress: positions are rounded at 1e-17
    m, an overlap of 1e-6 m and forces at 1e-11 of themselves, and 500 steps of collisions enlarge a
    difference by a factor of some hundred.
    """
    sample = agitated_sample(200, aspect=2, **mixture)
    start = tmp_path / "start.sample.h5"
    write_sample(start, sample)
    lightest = np.min(sample.masses[0] / sample.sizes) / (GLASS.sphere(RADIUS)[0] / RADIUS)
    dt = time_step(3e5, radius=RADIUS * np.sqrt(lightest))
    settings = {"steps": 500, "dt": dt, "damping": 0.2, "interval": 5, **drive}
    expected = steps_in_yade(start, tmp_path, settings)
    motion, stresses = steps_in_modal(start, settings)
    assert stresses == pytest.approx(np.array(expected.study["stresses"]), rel=1e-8)
    result = motion.sample(moving=True)
    assert_same_sample(result, expected)
    assert_same_forces(result.network(), expected.network())


def assert_same_sample(result, expected):
    """Compare cell and positions; centres may be whole periods apart."""
    assert result.side == pytest.approx(expected.side, rel=1e-12)
    assert result.walls == pytest.approx(expected.walls, abs=1e-12 * RADIUS)
    difference = result.position - expected.position
    difference[:, :2] -= result.side * np.round(difference[:, :2] / result.side)
    assert abs(difference).max() < 1e-8 * 2 * RADIUS


def assert_same_forces(result, expected):
    """Compare contacts and their forces."""
    for name in ("particle_i", "particle_j", "cell_shift"):
        assert np.array_equal(getattr(result, name), getattr(expected, name))
    tolerance = 1e-8 * expected.force_normal.mean()
    for name in ("force_normal", "force_tangential"):
        assert abs(getattr(result, name) - getattr(expected, name)).max() < tolerance
