"""Tests of contacts that resist turns: closed forms, a slow oracle, tangent, energy, files."""

from dataclasses import replace

import numpy as np
import pytest
from changes import in_flight
from refusals import refusal
from scipy.spatial.transform import Rotation

import modal
from modal.__main__ import main
from modal.dem import contacts as moving_contacts
from modal.dem.contacts import MovingContacts
from modal.dem.forces_by_arrays import forces_by_arrays
from modal.dem.motion import Dynamics
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.sample import Sample, read_sample, sample_of_network, write_sample
from modal.preparation.relax import relax
from modal.waves.motions import Pulse
from modal.waves.sources import Point

EFFECTIVE = RADIUS / 2
BOND = "cement-bond 1e9 0.5 1e7"
KINDS = {
    "rolling": {"rolling": 0.2},
    "twisting": {"twisting": 0.1},
    "both": {"rolling": 0.2, "twisting": 0.1},
    "bond": {"material": replace(GLASS, contact_model=BOND)},
}
"""Changes of a sample whose contacts then resist turns, by what resists."""


@pytest.fixture(scope="module")
def packed():
    bare = sample_of_network(modal.random_packing(60, seed=2, aspect=1.0), 0.3)
    return replace(bare, study={}, shear=None)


def pair_of_spheres(overlap=1e-6, **changes):
    """Return two spheres along (1, 1, 1) with an overlap, m, far from the walls."""
    side = 20 * RADIUS
    direction = np.ones(3) / np.sqrt(3)
    position = side / 2 + np.outer([-0.5, 0.5], direction) * (2 * RADIUS - overlap)
    sample = Sample(position, np.full(2, side), np.array([0.0, side]), 0.5)
    return replace(sample, **changes)


def turn_by(contacts, axis, angle):
    """Turn both spheres by opposite halves of an angle, rad, about an axis, where they are."""
    motion = np.zeros((2, 6))
    motion[:, 3:] = np.outer([-0.5, 0.5], angle * np.asarray(axis))
    contacts.move(motion)


ALONG = np.ones(3) / np.sqrt(3)
ACROSS = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)


@pytest.mark.parametrize(("name", "axis"), [("rolling", ACROSS), ("twisting", ALONG)])
def test_moment_is_a_spring_up_to_its_limit(name, axis):
    """Turn spheres against each other: kt R*^2 per rad, then the coefficient times R* N.

    Opposite turns about an axis do not slip across it: both surfaces move alike.
    """
    sample = pair_of_spheres(**{name: 0.1})
    law = sample.laws[0]
    overlap = sample.contacts().overlap[0]
    stiffness = law.stiffness_tangential(overlap, EFFECTIVE) * EFFECTIVE**2
    limit = 0.1 * law.normal_force(overlap, EFFECTIVE) * EFFECTIVE
    contacts = MovingContacts(sample, track_energy=True)
    angle = 0.4 * limit / stiffness
    turn_by(contacts, axis, angle)
    # The angle is rounded at eps, a spring's force at 1e-10 of the overlap's digits.
    assert contacts.load[0, 3:] == pytest.approx(stiffness * angle * axis, abs=1e-9 * limit)
    assert contacts.load[1, 3:] == pytest.approx(-stiffness * angle * axis, abs=1e-9 * limit)
    assert contacts.work.sum() == pytest.approx(0.5 * stiffness * angle**2, rel=1e-8)
    turn_by(contacts, axis, 5 * limit / stiffness)
    assert contacts.load[0, 3:] == pytest.approx(limit * axis, abs=1e-9 * limit)
    assert contacts.work[:, 0].sum() == pytest.approx(limit**2 / (2 * stiffness), rel=1e-8)
    # By the trapezoidal rule: the mean of 0.4 and 1 times the limit, over 4.4 turns of its spring.
    assert contacts.slipped == pytest.approx(0.7 * 4.4 * limit**2 / stiffness, rel=1e-8)
    other = ALONG if name == "rolling" else ACROSS
    before = contacts.load[0, 3:].copy()
    turn_by(contacts, other, 1e-6)
    assert contacts.load[0, 3:] == pytest.approx(before, abs=1e-6 * limit)


def test_bond_is_a_beam_against_turns():
    """Expect E I / L in rolling, E J / (q L) in twisting, limits s I / r and s J / r."""
    sample = pair_of_spheres(**KINDS["bond"])
    radius = 0.5 * RADIUS
    inertia = np.pi * radius**4 / 4
    length = 2 * RADIUS
    for axis, stiffness, limit in (
        (ACROSS, 1e9 * inertia / length, 1e7 * inertia / radius),
        (ALONG, 1e9 * 2 * inertia / (2.5 * length), 1e7 * 2 * inertia / radius),
    ):
        contacts = MovingContacts(sample)
        turn_by(contacts, axis, 0.5 * limit / stiffness)
        assert contacts.load[0, 3:] == pytest.approx(0.5 * limit * axis, abs=1e-9 * limit)
        turn_by(contacts, axis, 2 * limit / stiffness)
        assert contacts.load[0, 3:] == pytest.approx(limit * axis, abs=1e-9 * limit)


def slow_moment(steps, rolling, twisting, bounds):
    """Return the moment of one contact after steps (normal before, normal, spins, time step).

    Rotations are those of `scipy`, exact for any angle; the parts of the moment are cut one after
    the other.
    """
    moment = np.zeros(3)
    for before, normal, spin_i, spin_j, dt in steps:
        axis = np.cross(before, normal)
        size = np.linalg.norm(axis)
        if size > 0:
            axis *= np.arcsin(size) / size
        moment = Rotation.from_rotvec(axis).apply(moment)
        spin = 0.5 * (spin_i + spin_j)
        moment = Rotation.from_rotvec(dt * normal * (normal @ spin)).apply(moment)
        turn = dt * (spin_j - spin_i)
        along = normal * (moment @ normal) + twisting * normal * (turn @ normal)
        across = moment - normal * (moment @ normal)
        across += rolling * (turn - normal * (turn @ normal))
        parts = []
        for part, bound in zip((across, along), bounds, strict=True):
            size = np.linalg.norm(part)
            parts.append(part * min(1.0, bound / size))
        moment = sum(parts)
    return moment


def test_moment_of_a_tumbling_pair_is_that_of_the_slow_oracle():
    """Turn and roll a pair by a radian in all; the law's turns are of first order in a step."""
    sample = pair_of_spheres(rolling=0.3, twisting=0.2)
    law = sample.laws[0]
    overlap = sample.contacts().overlap[0]
    stiffness = law.stiffness_tangential(overlap, EFFECTIVE) * EFFECTIVE**2
    bearing = law.normal_force(overlap, EFFECTIVE) * EFFECTIVE
    bounds = (0.3 * bearing, 0.2 * bearing)
    yields_at = bounds[0] / stiffness
    random = np.random.default_rng(3)
    common = random.standard_normal(3)
    errors = []
    for count in (200, 400):
        contacts = MovingContacts(sample)
        steps = []
        centre = contacts.position.mean(axis=0)
        for k in range(count):
            difference = yields_at * np.cos(6 * k / count) * np.array([1.0, 2.0, -3.0])
            spins = common + np.outer([-0.5, 0.5], difference)
            normal_before = np.subtract(*contacts.position[::-1])
            turned = Rotation.from_rotvec(common / count).apply(contacts.position - centre)
            motion = np.hstack([turned + centre - contacts.position, spins / count])
            contacts.move(motion)
            normal = np.subtract(*contacts.position[::-1])
            normals = [normal_before, normal]
            normals = [each / np.linalg.norm(each) for each in normals]
            steps.append((*normals, *spins, 1 / count))
        expected = slow_moment(steps, stiffness, stiffness, bounds)
        actual = contacts.sample().network().moment[0]
        errors.append(np.linalg.norm(actual - expected) / bounds[0])
    assert np.linalg.norm(expected) > 0.5 * bounds[1]
    assert errors[1] < 1e-2
    assert errors[1] < 0.6 * errors[0]


@pytest.mark.parametrize("kind", KINDS)
def test_compiled_loop_is_that_of_numpy_and_energy_adds_up(packed, kind, monkeypatch):
    """Compare spheres that fly, spin, part and meet; the energy is lost to slip alone.

    Leapfrog keeps the sum to the square of its step over the fastest period, and to the change of
    stiffness in a step: some 1e-5 here.
    """
    random = np.random.default_rng(1)
    velocity = 0.05 * random.standard_normal((2, 60, 3))
    moving = in_flight(replace(packed, **KINDS[kind]), velocity[0], velocity[1] / RADIUS)
    runs = []
    for _ in range(2):
        motion = Dynamics(moving, track_energy=True)
        energy = []
        for _ in range(150):
            before = motion.velocity.copy()
            motion.step(2e-7)
            inertia = np.repeat(motion.masses, 3, axis=1)
            contacts = motion.contacts
            kinetic = 0.5 * (inertia * before * motion.velocity).sum()
            stored = contacts.elastic_energy + contacts.work[:, 0].sum()
            energy.append(kinetic + stored + contacts.slipped)
        assert np.ptp(energy) < 1e-4 * energy[0]
        runs.append(contacts)
        monkeypatch.setattr(moving_contacts, "forces_by_loop", forces_by_arrays)
    compiled, arrays = runs
    assert compiled.touching == arrays.touching
    moments = compiled.sample().network().moment
    scale = abs(moments).max()
    assert scale > 0
    assert moments == pytest.approx(arrays.sample().network().moment, abs=1e-7 * scale)
    # Round-off of the steps.
    assert compiled.load == pytest.approx(arrays.load, abs=1e-7 * compiled.mean_force)
    assert compiled.slipped == pytest.approx(arrays.slipped, rel=1e-6, abs=1e-20)


@pytest.mark.parametrize("kind", KINDS)
def test_full_tangent_is_the_difference_of_forces(packed, kind):
    """Move spheres that carry moments; nothing slips. Differences err by h / overlap, 1e-7."""
    changes = KINDS[kind] | {"friction": 100.0}
    for name in ("rolling", "twisting"):
        if name in changes:
            changes[name] = 100.0
    random = np.random.default_rng(1)
    contacts = MovingContacts(replace(packed, **changes))
    for _ in range(10):
        motion = 1e-8 * random.standard_normal((60, 6))
        motion[:, 3:] /= RADIUS
        contacts.move(motion)
    state = contacts.sample()
    network = state.network()
    assert abs(network.moment).max() > 0
    direction = random.standard_normal((60, 6))
    direction[:, 3:] /= RADIUS
    loads = []
    for step in (1e-10, -1e-10):
        moved = MovingContacts(state)
        moved.move(step * direction)
        loads.append(moved.load.copy())
    measured = (loads[1] - loads[0]) / 2e-10
    tangent = modal.stiffness_matrix(network, pre_stress="full") @ direction.ravel()
    error = measured - tangent.reshape(-1, 6)
    for part in (slice(0, 3), slice(3, 6)):
        assert np.linalg.norm(error[:, part]) < 2e-7 * np.linalg.norm(measured[:, part])


@pytest.mark.parametrize("kind", KINDS)
def test_rested_written_and_read_it_carries_a_wave_whose_energy_balances(packed, kind, tmp_path):
    path = tmp_path / "rested.sample.h5"
    rested, state = relax(replace(packed, **KINDS[kind]))
    assert state.at_rest
    write_sample(path, rested)
    sample = read_sample(path)
    network = sample.network()
    assert network.matches(rested.network().fingerprint)
    assert network.stiffness_rolling is not None
    again = sample_of_network(network, 0.3).network()
    assert again.moment == pytest.approx(network.moment, abs=1e-12 * abs(network.moment).max())
    wave = modal.propagate(sample, 2e-5, nonlinear=True, motion=Pulse(1e-9, 1e5))
    assert wave.error < 1e-3
    assert wave.noise < 1e-2
    assert abs(wave.signals.balance.gap) < 1e-4


def test_wave_of_small_amplitude_is_the_linear_wave(packed):
    """Turn a sphere by a torque, N m; without the springs against turns the wave is another."""
    rested, _ = relax(replace(packed, **KINDS["both"]))
    network = rested.network()
    arguments = {
        "source": Point(int(network.particle_i[network.n_contacts // 2])),
        "motion": Pulse(1e-8, 5e4),
        "interval": 1e-6,
        "direction": "torsion",
        "particles": True,
    }
    linear = modal.propagate(network, 3e-5, pre_stress="full", **arguments)
    freely = replace(network, stiffness_rolling=None, stiffness_twisting=None, moment=None)
    without = modal.propagate(freely, 3e-5, pre_stress="full", **arguments)
    moving = modal.propagate(rested, 3e-5, nonlinear=True, **arguments)
    expected = linear.signals.particle_displacement
    scale = abs(expected).max()
    # The time step errs by 1e-3 of the largest motion.
    assert abs(moving.signals.particle_displacement - expected).max() < 2e-3 * scale
    assert abs(without.signals.particle_displacement - expected).max() > 1e-2 * scale


@pytest.mark.parametrize("word", ["--rolling", "--twisting"])
def test_coefficients_are_refused_where_they_mean_nothing(word, tmp_path, one_line):
    pack = f"pack --spheres 60 --stress 1e4 -o {tmp_path / 'out'} {word}"
    one_line(main, f"{pack} 0.1".split(), code="unused_option")
    one_line(main, f"{pack} -1 --spheres 100 --friction 0.3".split(), code="rolling_or_twisting")
    with refusal("rolling_or_twisting"):
        modal.propagate(pair_of_spheres(), 1e-5, nonlinear=True, rolling=-1.0)
