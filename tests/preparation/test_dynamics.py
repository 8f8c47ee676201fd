"""Tests of moving spheres: conservation laws, closed forms of one contact, numpy, YADE."""

import json
from dataclasses import replace

import numpy as np
import pytest
from changes import in_flight
from in_yade import script
from packings import random_sample
from places import ROOT
from scipy.spatial.transform import Rotation

from modal.dem import contacts as moving_contacts
from modal.dem import motion as dynamics
from modal.dem.contacts import MAX_SKIN, MovingContacts
from modal.dem.forces_by_arrays import forces_by_arrays
from modal.dem.motion import Dynamics
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.sample import Sample, read_sample, write_sample
from modal.preparation.durations import time_step
from modal.preparation.strain_control import INERTIAL_NUMBER, ConstantRate, Servo
from modal.tools import slabs
from modal.tools.errors import InputError

EPS = np.finfo(float).eps
STEP = time_step(3e5)


def agitated(spheres=120, friction=0.3, speed=0.05, aspect=1.5, **mixture):
    """Return a packing at 100 kPa whose spheres fly by two overlaps in 50 steps, and spin."""
    random = np.random.default_rng(5)
    packed = random_sample(spheres, 1e5, aspect=aspect, tolerance=1e-3, **mixture)
    velocity, surface_velocity = speed * random.standard_normal((2, spheres, 3))
    shear = np.zeros((packed.network().n_contacts, 2))
    packed = replace(packed, friction=friction, shear=shear)
    return in_flight(packed, velocity, surface_velocity / packed.radius)


@pytest.fixture(scope="module")
def hot():
    return agitated()


def make_pair(separation, velocity, friction):
    """Return two spheres along (1, 1, 1), far from the walls, with velocities (2, 3)."""
    side = 20 * RADIUS
    centre = np.full(3, side / 2)
    direction = np.ones(3) / np.sqrt(3)
    position = centre + np.outer([-0.5, 0.5], direction) * separation
    pair = Sample(position, np.full(2, side), np.array([0.0, side]), friction)
    return in_flight(pair, np.array(velocity, float))


def test_energy_is_kept_at_second_order(hot):
    """Halve the step without friction and damping: the spread of the energy falls to a quarter.

    Contacts open and close; Hertz's force has no second derivative there, which the leapfrog
    notices at a higher order than its own error dt^2.
    """
    spread = []
    for over in (4, 8):
        motion = Dynamics(replace(hot, friction=0.0, angular_velocity=None, shear=None))
        dt, energy, opened = STEP / over, [], set()
        mass = motion.masses[0, 0]
        for _ in range(60 * over):
            before = motion.velocity[:, :3].copy()
            motion.step(dt)
            opened.add(motion.contacts.touching)
            kinetic = 0.5 * mass * (before * motion.velocity[:, :3]).sum()
            energy.append(kinetic + motion.contacts.elastic_energy)
        assert len(opened) > 5
        spread.append(np.ptp(energy) / np.mean(energy))
    assert spread[0] < 1e-2
    assert np.log2(spread[0] / spread[1]) == pytest.approx(2, abs=0.4)


def test_momenta_of_a_free_cluster_are_kept():
    """Compare both momenta, to round-off, with friction and spin but no wall and no period."""
    random = np.random.default_rng(2)
    grid = np.array([(x, y, z) for x in range(3) for y in range(3) for z in range(3)])
    position = 0.03 + 2 * RADIUS * (0.999 * grid + 0.0004 * random.standard_normal((27, 3)))
    velocity, turning = 0.03 * random.standard_normal((2, 27, 3))
    sample = Sample(position, np.full(2, 0.1), np.array([0.0, 0.1]), 0.2)
    motion = Dynamics(in_flight(sample, velocity, turning / RADIUS))

    def momenta():
        mass, inertia = motion.masses[0]
        linear = mass * motion.velocity[:, :3]
        turning = np.cross(motion.contacts.position - 0.03, linear)
        return linear.sum(axis=0), (turning + inertia * motion.velocity[:, 3:]).sum(axis=0)

    start, sliding = momenta(), 0
    for _ in range(300):
        motion.step(STEP)
        sliding += motion.contacts.sliding
    assert sliding > 100
    assert motion.contacts.touching != 54
    # Each step adds the forces of some 54 contacts, rounded at EPS; they are at most some 100 N.
    rounding = 300 * 54 * EPS * 100 * STEP
    assert rounding < 1e-6 * motion.masses[0, 0] * abs(velocity).sum()
    assert abs(momenta()[0] - start[0]).max() < rounding
    assert abs(momenta()[1] - start[1]).max() < rounding * 6 * RADIUS


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, -1, 0), (0.3, 0.5, -0.8)])
def test_shear_force_turns_with_a_rigid_motion(axis):
    """Rotate a sheared pair about an axis as a whole: its shear force rotates with it.

    In finite steps of an angle a the law takes the velocity of half a step before for the present
    normal: an error a^2 in each, which is of the order of a in the end.
    """
    axis = np.array(axis) / np.linalg.norm(axis)
    errors = []
    for steps in (500, 1000):
        contacts = MovingContacts(make_pair(2 * RADIUS * 0.99, np.zeros((2, 3)), 1.0), np.inf)
        shake = np.zeros((2, 6))
        shake[1, :3] = 1e-5 * np.array([1.0, -1.0, 0.3])
        contacts.move(shake)
        contacts.move(np.zeros((2, 6)))
        sheared = contacts.load[0, :3].copy()
        turn, centre = Rotation.from_rotvec(axis / steps), contacts.position.mean(axis=0)
        for _ in range(steps):
            motion = np.zeros((2, 6))
            motion[:, :3] = turn.apply(contacts.position - centre) + centre - contacts.position
            motion[:, 3:] = axis / steps
            contacts.move(motion)
        expected = Rotation.from_rotvec(axis).apply(sheared)
        errors.append(np.linalg.norm(contacts.load[0, :3] - expected) / np.linalg.norm(sheared))
    # Half of a times l over the shear displacement, times the direction cosines: 0.03.
    assert errors[1] < 0.04
    assert errors[1] < 0.55 * errors[0]


def test_oblique_collision_against_its_closed_form():
    """Compare the largest overlap with Hertz, the rebound with an elastic one, slip with Coulomb.

    With a tangential velocity of ten times the normal one the contact slides from its first
    steps to its end: each sphere gains mu times the normal impulse along the contact, and the spin
    of its moment. Terms that are left out: overlap / R (1e-3), the contact's turn while it lasts,
    tangential velocity times duration over D (1.3e-3), its centrifugal share of the deceleration
    (1.4e-2), and the steps before and after full sliding.
    """
    friction, approach, glide = 0.1, 0.02, 0.2
    normal = np.ones(3) / np.sqrt(3)
    along = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    velocity = np.array([approach / 2 * normal, -approach / 2 * normal])
    velocity += np.array([-glide / 2 * along, glide / 2 * along])
    motion = Dynamics(make_pair(2 * RADIUS * (1 - 1e-9), velocity, friction))
    mass, modulus = motion.masses[0, 0], GLASS.effective_young
    dt, largest = 2e-8, 0.0
    reduced, root = mass / 2, np.sqrt(RADIUS / 2)
    deepest = (15 / 16 * reduced * approach**2 / (modulus * root)) ** 0.4
    duration = 2.943 * deepest / approach
    for _ in range(int(1.5 * duration / dt)):
        motion.step(dt)
        apart = np.linalg.norm(np.subtract(*motion.contacts.position))
        largest = max(largest, 2 * RADIUS - apart)
    assert motion.contacts.touching == 0
    assert largest == pytest.approx(deepest, rel=1e-2)
    gained = motion.velocity[1, :3] - velocity[1]
    assert gained @ normal == pytest.approx(approach, rel=2e-2)
    assert gained @ along == pytest.approx(-friction * approach, rel=0.1)
    spin = np.cross(normal, along) * 2.5 * friction * approach / RADIUS
    assert np.linalg.norm(motion.velocity[0, 3:]) == pytest.approx(np.linalg.norm(spin), rel=3e-2)
    assert np.allclose(motion.velocity[0, 3:], motion.velocity[1, 3:])


def test_spheres_at_rest_in_the_cell_stay_at_their_share_of_it():
    """Strain a cell of spheres at rest without contacts: x divided by the side stays."""
    random = np.random.default_rng(1)
    position = np.array([[1, 1, 2], [5, 2, 6], [-2, 8, 3], [3, 17, 8]]) * 3e-3
    sample = Sample(position, np.full(2, 0.03), np.array([0.0, 0.03]), 0.3)
    motion = Dynamics(sample, damping=0.2)
    share = position[:, :2] / sample.side
    for _ in range(200):
        motion.step(1e-6, lambda stress: 50 * random.standard_normal(3))
    assert abs(motion.contacts.side / 0.03 - 1).max() > 1e-4
    # Rounding of 200 steps; damping has nothing to oppose.
    assert abs(motion.contacts.position[:, :2] / motion.contacts.side - share).max() < 1e3 * EPS
    moved = motion.sample(moving=True)
    # Of all images, half a step later: 1e-6 s at some 100 / s.
    assert moved.velocity == pytest.approx(moved.strain_rate * moved.position, rel=1e-3)


def test_small_sphere_flies_far_between_two_lists_of_a_mixture():
    """Move it by 2 of its radii in steps of a hundredth; a step of 1.1 radii is refused."""
    radii = RADIUS * np.array([8.0, 1.0])
    start = np.array([[10.0, 10, 20], [30, 30, 20]]) * RADIUS
    size, flight = 40 * RADIUS, np.array([[0.0, 0, 0], [0, 0, 1]])
    sample = Sample(start, np.full(2, size), np.array([0.0, size]), 0.3, radii=radii)
    motion = Dynamics(in_flight(sample, flight), skin=MAX_SKIN)
    for _ in range(200):
        motion.step(0.01 * RADIUS)
    # Rounding of 200 sums.
    wanted = start + 2 * RADIUS * flight
    np.testing.assert_allclose(motion.contacts.position, wanted, rtol=200 * EPS)
    motion.step(1.1 * RADIUS)
    with pytest.raises(InputError) as error:
        motion.step(1.1 * RADIUS)
    assert error.value.code == "unstable_step"


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
def test_compiled_steps_are_those_of_numpy(hot, mixture, monkeypatch):
    """Compare, to round-off, a hundred steps in which contacts slide, open and close."""
    sample = agitated(**mixture) if mixture else hot
    compiled = run(sample, 100)
    monkeypatch.setattr(moving_contacts, "forces_by_loop", forces_by_arrays)
    monkeypatch.setattr(dynamics, "advance_by_loop", dynamics.advance_by_arrays)
    arrays = run(sample, 100)
    assert compiled.contacts.touching == arrays.contacts.touching
    apart = abs(compiled.contacts.position - arrays.contacts.position).max()
    # Rounding of a coordinate, eps times the length, grows as collisions part the ways.
    assert apart < 1e3 * EPS * 50 * RADIUS
    mean = compiled.contacts.mean_force
    assert abs(compiled.contacts.load - arrays.contacts.load)[:, :3].max() < 1e-8 * mean
    assert compiled.stress() == pytest.approx(arrays.stress(), rel=1e-9)


def test_slabs_of_one_pass_share_no_sphere():
    """Check every other slab, and that all contacts are in one slab."""
    random = np.random.default_rng(4)
    n = 5000
    first = np.sort(random.integers(0, n, 20000))
    second = np.minimum(first + random.integers(1, 200, 20000), n - 1)
    second[random.random(20000) < 0.05] = -1
    ends = np.column_stack([first, second])
    bounds = slabs.slabs_of(ends, n)
    assert bounds[0] == 0 and bounds[-1] == 20000 and (np.diff(bounds) >= 0).all()
    spheres = [np.setdiff1d(part, -1) for part in np.split(ends, bounds[1:-1])]
    assert len(spheres) > 7
    for taken in (spheres[::2], spheres[1::2]):
        assert np.unique(np.concatenate(taken)).size == sum(map(len, taken))


@pytest.mark.parametrize(
    ("drive", "mixture"),
    [({"stress": 3e5}, {}), ({"rate": 1.0}, {}), *(({"stress": 3e5}, m) for m in MIXTURES)],
)
def test_steps_are_those_of_yade(drive, mixture, tmp_path, yade):
    """Take 500 steps of 200 spheres that fly, spin, slide, part and meet, in a strained cell.

    1e-8 of a diameter, of the mean contact force and of the stress; positions are rounded at 1e-17
    m, an overlap of 1e-6 m, forces at 1e-11 of themselves, and 500 steps of collisions take the
    ways apart by a factor of some hundred.
    """
    sample = agitated(200, aspect=2, **mixture)
    start, end = tmp_path / "start.sample.h5", tmp_path / "end.sample.h5"
    write_sample(start, sample)
    lightest = np.min(sample.masses[0] / sample.sizes) / (GLASS.sphere(RADIUS)[0] / RADIUS)
    dt = time_step(3e5, radius=RADIUS * np.sqrt(lightest))
    settings = {"steps": 500, "dt": dt, "damping": 0.2, "interval": 5} | drive
    steps = ROOT / "tests" / "yade" / "steps.py"
    script(steps, ROOT, start, end, json.dumps(settings), folder=tmp_path)
    theirs, motion = read_sample(end), Dynamics(read_sample(start), damping=0.2)
    control = ConstantRate(1.0) if "rate" in drive else Servo(3e5, 0.01)
    stresses, touching, sliding = [], [motion.contacts.touching], []
    for k in range(500):
        due = k > 0 and k % 5 == 0
        motion.step(dt, control.follow if due else None)
        touching.append(motion.contacts.touching)
        sliding.append(motion.contacts.sliding)
        if due:
            stresses.append(control.stress)
    met, parted = (np.diff(touching) > 0).sum(), (np.diff(touching) < 0).sum()
    assert min(met, parted) > 20 and np.mean(sliding) > 10
    ours = motion.sample(moving=True)
    assert ours.side == pytest.approx(theirs.side, rel=1e-12)
    assert ours.walls == pytest.approx(theirs.walls, abs=1e-12 * RADIUS)
    apart = ours.position - theirs.position
    apart[:, :2] -= ours.side * np.round(apart[:, :2] / ours.side)
    assert abs(apart).max() < 1e-8 * 2 * RADIUS
    assert np.array(stresses) == pytest.approx(theirs.study["stresses"], rel=1e-8)
    ours, theirs = ours.network(), theirs.network()
    mean = theirs.force_normal.mean()
    for name in ("particle_i", "particle_j", "cell_shift"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name))
    assert abs(ours.force_tangential - theirs.force_tangential).max() < 1e-8 * mean
    assert abs(ours.force_normal - theirs.force_normal).max() < 1e-8 * mean
