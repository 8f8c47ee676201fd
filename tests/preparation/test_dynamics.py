"""Moving spheres: conservation laws, closed forms of one contact, the same steps in YADE."""

from dataclasses import replace

import numpy as np
import pytest
from changes import in_flight
from packings import agitated_sample
from refusals import refusal
from scipy.spatial.transform import Rotation

from modal.dem.contacts import MAX_SKIN, MovingContacts
from modal.dem.motion import Dynamics
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.sample import Sample
from modal.preparation.durations import time_step

EPS = np.finfo(float).eps
STEP = time_step(3e5)


@pytest.fixture(scope="module")
def hot():
    """Return 120 flying spheres of one size."""
    return agitated_sample()


def make_pair(separation, velocity, friction):
    """Return two spheres along (1, 1, 1), far from the walls, with velocities (2, 3)."""
    side = 20 * RADIUS
    centre = np.full(3, side / 2)
    direction = np.ones(3) / np.sqrt(3)
    position = centre + np.outer([-0.5, 0.5], direction) * separation
    pair = Sample(position, np.full(2, side), np.array([0.0, side]), friction)
    return in_flight(pair, np.array(velocity, float))


def spread_of_energy(sample, steps_per_interval):
    """Return the spread of the energy over 60 intervals, divided by its mean.

    The kinetic energy at a time is that of the velocities half a step before and after it.
    """
    motion = Dynamics(sample)
    mass = motion.masses[0, 0]
    energy = []
    contact_counts = set()
    for _ in range(60 * steps_per_interval):
        before = motion.velocity[:, :3].copy()
        motion.step(STEP / steps_per_interval)
        kinetic = 0.5 * mass * (before * motion.velocity[:, :3]).sum()
        energy.append(kinetic + motion.contacts.elastic_energy)
        contact_counts.add(motion.contacts.touching)
    # Contacts open and close.
    assert len(contact_counts) > 5
    return np.ptp(energy) / np.mean(energy)


def test_energy_is_conserved_to_second_order(hot):
    """Halve the step without friction and damping: the spread of the energy falls to a quarter.

    Hertz's force has no second derivative where contacts open and close, which the leapfrog
    notices at a higher order than its own error dt^2.
    """
    smooth = replace(hot, friction=0.0, angular_velocity=None, shear=None)
    spread = spread_of_energy(smooth, 4)
    assert spread < 1e-2
    order = np.log2(spread / spread_of_energy(smooth, 8))
    assert order == pytest.approx(2, abs=0.4)


CENTRE = 0.03
"""Coordinate, m, about which the angular momentum is taken."""


@pytest.fixture
def cluster():
    """Return 27 touching spheres in motion, with friction and spin but no wall and no period."""
    random = np.random.default_rng(2)
    grid = np.indices((3, 3, 3)).reshape(3, -1).T
    position = CENTRE + 2 * RADIUS * (0.999 * grid + 0.0004 * random.standard_normal((27, 3)))
    velocity = 0.03 * random.standard_normal((27, 3))
    surface_velocity = 0.03 * random.standard_normal((27, 3))
    sample = Sample(position, np.full(2, 0.1), np.array([0.0, 0.1]), 0.2)
    return Dynamics(in_flight(sample, velocity, surface_velocity / RADIUS))


def momenta(motion):
    """Return linear momentum, kg m/s, and angular momentum about the centre, kg m^2/s."""
    mass, inertia = motion.masses[0]
    linear = mass * motion.velocity[:, :3]
    orbital = np.cross(motion.contacts.position - CENTRE, linear)
    spin = inertia * motion.velocity[:, 3:]
    return linear.sum(axis=0), (orbital + spin).sum(axis=0)


def test_momenta_of_a_free_cluster_are_conserved(cluster):
    """Compare both momenta after 300 steps, to round-off."""
    linear, angular = momenta(cluster)
    all_linear = cluster.masses[0, 0] * abs(cluster.velocity[:, :3]).sum()
    n_sliding = 0
    for _ in range(300):
        cluster.step(STEP)
        n_sliding += cluster.contacts.sliding
    # Contacts slide, and some of the 54 have opened.
    assert n_sliding > 100
    assert cluster.contacts.touching != 54
    # Each step adds the forces of some 54 contacts, rounded at EPS; they are at most some 100 N.
    rounding = 300 * 54 * EPS * 100 * STEP
    assert rounding < 1e-6 * all_linear
    linear_after, angular_after = momenta(cluster)
    assert abs(linear_after - linear).max() < rounding
    assert abs(angular_after - angular).max() < rounding * 6 * RADIUS


def error_of_rotated_shear_force(axis, steps):
    """Return the relative error of the shear force of a pair rotated by one radian in steps."""
    contacts = MovingContacts(make_pair(2 * RADIUS * 0.99, np.zeros((2, 3)), 1.0), np.inf)
    shear = np.zeros((2, 6))
    shear[1, :3] = 1e-5 * np.array([1.0, -1.0, 0.3])
    contacts.move(shear)
    contacts.move(np.zeros((2, 6)))
    force = contacts.load[0, :3].copy()
    rotation = Rotation.from_rotvec(axis / steps)
    centre = contacts.position.mean(axis=0)
    for _ in range(steps):
        rotated = rotation.apply(contacts.position - centre) + centre
        motion = np.zeros((2, 6))
        motion[:, :3] = rotated - contacts.position
        motion[:, 3:] = axis / steps
        contacts.move(motion)
    expected = Rotation.from_rotvec(axis).apply(force)
    return np.linalg.norm(contacts.load[0, :3] - expected) / np.linalg.norm(force)


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, -1, 0), (0.3, 0.5, -0.8)])
def test_shear_force_turns_with_a_rigid_motion(axis):
    """Rotate a sheared pair about an axis as a whole: its shear force rotates with it.

    In finite steps of an angle a the law takes the velocity of half a step before for the present
    normal: an error a^2 in each, which is of the order of a in the end.
    """
    axis = np.array(axis) / np.linalg.norm(axis)
    error = error_of_rotated_shear_force(axis, 1000)
    # Half of a times l over the shear displacement, times the direction cosines: 0.03.
    assert error < 0.04
    assert error < 0.55 * error_of_rotated_shear_force(axis, 500)


FRICTION = 0.1
APPROACH = 0.02
"""Normal velocity of the colliding spheres towards each other, m/s."""
GLIDE = 0.2
"""Their tangential velocity against each other, m/s."""
NORMAL = np.ones(3) / np.sqrt(3)
TANGENT = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)


@pytest.fixture(scope="module")
def collision():
    """Collide two spheres obliquely; return their motion and the overlaps, computed and Hertz's.

    With a tangential velocity of ten times the normal one the contact slides from its first steps
    to its end: each sphere gains mu times the normal impulse along the contact, and the spin of its
    moment. Terms that are left out: overlap / R (1e-3), the contact's turn while it lasts,
    tangential velocity times duration over D (1.3e-3), its centrifugal share of the deceleration
    (1.4e-2), and the steps before and after full sliding.
    """
    relative = APPROACH * NORMAL - GLIDE * TANGENT
    velocity = np.array([relative / 2, -relative / 2])
    motion = Dynamics(make_pair(2 * RADIUS * (1 - 1e-9), velocity, FRICTION))
    reduced_mass = motion.masses[0, 0] / 2
    stiffness = GLASS.effective_young * np.sqrt(RADIUS / 2)
    deepest = (15 / 16 * reduced_mass * APPROACH**2 / stiffness) ** 0.4
    duration = 2.943 * deepest / APPROACH
    dt = 2e-8
    largest_overlap = 0.0
    for _ in range(int(1.5 * duration / dt)):
        motion.step(dt)
        first, second = motion.contacts.position
        largest_overlap = max(largest_overlap, 2 * RADIUS - np.linalg.norm(first - second))
    assert motion.contacts.touching == 0
    velocity_gain = motion.velocity[1, :3] - velocity[1]
    return motion, velocity_gain, largest_overlap, deepest


def test_largest_overlap_of_a_collision_is_that_of_hertz(collision):
    _, _, largest_overlap, deepest = collision
    assert largest_overlap == pytest.approx(deepest, rel=1e-2)


def test_a_collision_is_elastic_along_the_normal(collision):
    _, velocity_gain, _, _ = collision
    assert velocity_gain @ NORMAL == pytest.approx(APPROACH, rel=2e-2)


def test_a_collision_slips_by_coulombs_law(collision):
    _, velocity_gain, _, _ = collision
    assert velocity_gain @ TANGENT == pytest.approx(-FRICTION * APPROACH, rel=0.1)


def test_a_collision_makes_both_spheres_spin(collision):
    """Compare with the moment of the friction, mu R times the normal impulse, over 2/5 m R^2."""
    motion, _, _, _ = collision
    first_spin, second_spin = motion.velocity[:, 3:]
    expected = 2.5 * FRICTION * APPROACH / RADIUS
    assert np.linalg.norm(first_spin) == pytest.approx(expected, rel=3e-2)
    assert np.allclose(first_spin, second_spin)


def test_slip_of_spheres_that_do_not_touch_at_first_is_counted():
    """Lose to slip what the motion loses; the step errs by 1e-3 of this."""
    relative = APPROACH * NORMAL - GLIDE * TANGENT
    velocity = np.array([relative / 2, -relative / 2])
    pair = make_pair(2 * RADIUS * (1 + 1e-6), velocity, FRICTION)
    motion = Dynamics(pair, track_energy=True)
    inertia = np.repeat(motion.masses, 3, axis=1)
    energy_before = (inertia * motion.velocity**2).sum() / 2
    for _ in range(3000):
        motion.step(2e-8)
    assert motion.contacts.touching == 0
    energy_after = (inertia * motion.velocity**2).sum() / 2
    assert motion.contacts.slipped > 0
    assert energy_before - energy_after == pytest.approx(motion.contacts.slipped, rel=3e-3)


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
    strained = motion.sample(moving=True)
    # The velocity is that half a step later: 1e-6 s at some 100 / s.
    expected = strained.strain_rate * strained.position
    assert strained.velocity == pytest.approx(expected, rel=1e-3)


@pytest.fixture
def mixture_in_flight():
    """Return a resting sphere of 8 radii and a small one that flies at 1 m/s, far apart."""
    radii = RADIUS * np.array([8.0, 1.0])
    start = np.array([[10.0, 10, 20], [30, 30, 20]]) * RADIUS
    size = 40 * RADIUS
    flight = np.array([[0.0, 0, 0], [0, 0, 1]])
    sample = Sample(start, np.full(2, size), np.array([0.0, size]), 0.3, radii=radii)
    return Dynamics(in_flight(sample, flight), skin=MAX_SKIN)


def test_small_sphere_flies_far_between_two_lists_of_a_mixture(mixture_in_flight):
    """Move it by 2 of its radii in steps of a hundredth."""
    start = mixture_in_flight.contacts.position.copy()
    for _ in range(200):
        mixture_in_flight.step(0.01 * RADIUS)
    expected = start + [[0, 0, 0], [0, 0, 2 * RADIUS]]
    # Rounding of 200 sums.
    np.testing.assert_allclose(mixture_in_flight.contacts.position, expected, rtol=200 * EPS)


def test_a_step_farther_than_a_radius_is_refused(mixture_in_flight):
    """Refuse the second of two steps of 1.1 radii of the small sphere."""
    mixture_in_flight.step(1.1 * RADIUS)
    with refusal("unstable_step"):
        mixture_in_flight.step(1.1 * RADIUS)
