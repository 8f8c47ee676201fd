"""The springs' way to rest: against damped motion alone, gain of a step, what it leaves out."""

from dataclasses import replace

import numpy as np
import pytest

from modal.dem.contacts import MovingContacts
from modal.packing.state import net_forces, stress_tensor
from modal.preparation import relax as relaxation
from modal.preparation.random_packing import random_sample
from modal.preparation.relax import RESERVE, equilibrium_of, relax
from modal.preparation.springs_rest import STRIDE, elastic_motion, loose_rest


@pytest.fixture(scope="module")
def rested():
    """200 spheres at rest, every contact with shear from a shake by 2 % of an overlap."""
    return relax(shaken(made(), 0.02, np.inf))[0]


def made():
    """200 frictionless spheres, not quite at rest, given friction.

    Of eight seeds two to four, which round-off decides, have a sphere so loosely held that the
    springs leave it out; this one has none.
    """
    return replace(random_sample(200, 1e6, seed=3, aspect=1.5, tolerance=1e-3), friction=0.5)


def shaken(sample, share, friction=None, seed=3):
    """The sample after random motions of `share` of the median overlap, as arcs where they turn."""
    motion = np.random.default_rng(seed).standard_normal((len(sample.position), 6))
    motion *= share * np.median(sample.network().overlap)
    motion[:, 3:] /= sample.radius
    contacts = MovingContacts(sample, friction)
    contacts.move(motion)
    return contacts.sample()


def alone(monkeypatch):
    """Damped motion without the springs."""
    monkeypatch.setattr(relaxation, "elastic_motion", lambda contacts, sample: None)


def between(a, b):
    """Shape (n,): how far the spheres of two samples of a cell are apart, m."""
    apart = a.position - b.position
    apart[:, :2] -= np.round(apart[:, :2] / a.side) * a.side
    return np.linalg.norm(apart, axis=1)


def test_rest_is_that_of_damped_motion(rested, monkeypatch):
    """Both undo a shake by a hundredth of an overlap, on which hardly any contact slides or opens.

    Shear forces grow with the stiffness of the moment, so that the two ways differ by products of
    two such motions: 1e-4 of an overlap, of each of some six contacts. Spheres without contacts
    stay where they were.
    """
    start = shaken(rested, 0.01)
    monkeypatch.setattr(relaxation, "FIRST", 100)  # so few spheres soon rest anyway
    found, state = relax(start)
    alone(monkeypatch)
    expected, slow = relax(start)
    assert state.at_rest and slow.at_rest
    assert state.steps < slow.steps
    one, other = found.network(), expected.network()
    assert one.n_contacts == other.n_contacts
    overlap = np.median(one.overlap)
    held = np.unique(one.particle_i)
    assert np.median(between(found, expected)[held]) < 1e-3 * overlap
    assert one.force_normal.mean() == pytest.approx(other.force_normal.mean(), rel=1e-3)
    assert one.study["void_ratio"] == pytest.approx(other.study["void_ratio"], rel=1e-12)
    stress = np.diag(stress_tensor(one))
    assert stress == pytest.approx(np.diag(stress_tensor(other)), rel=1e-3)


def test_each_step_gains_a_digit(rested):
    """Residuals of the law itself after steps of the springs alone.

    Forces change direction by an overlap over a radius, 1e-3 here, and stiffnesses by half of the
    share of the overlap that a step goes; the solver stops at an error of 1e-2 in the energy.
    """
    contacts = MovingContacts(shaken(rested, 1e-3))
    residuals = [equilibrium_of(contacts.sample()).residual]
    for _ in range(3):
        contacts.move(elastic_motion(contacts, contacts.sample()))
        residuals.append(equilibrium_of(contacts.sample()).residual)
    assert (np.array(residuals[1:]) < 0.1 * np.array(residuals[:-1])).all()


def test_what_nothing_holds_is_left_out(rested):
    """A push on a sphere without contacts: all others go where they go without it."""
    network = rested.network()
    free = np.setdiff1d(np.arange(network.n_particles), [*network.particle_i, *network.particle_j])
    assert len(free) > 0
    contacts = MovingContacts(shaken(rested, 1e-3))
    sample = contacts.sample()
    expected = elastic_motion(contacts, sample)
    contacts.load[free[0], :3] = contacts.mean_force
    found = elastic_motion(contacts, sample)
    stride = STRIDE * np.median(network.overlap)
    assert np.linalg.norm(found[free[0], :3]) <= stride * (1 + 1e-12)
    others = np.delete(np.arange(len(found)), free[0])
    assert found[others] == pytest.approx(expected[others], abs=1e-3 * abs(expected).max())


def test_springs_that_lead_away_are_not_followed(rested, monkeypatch):
    """A motion by half an overlap at random: the residual grows, and damped motion goes on."""
    asked = []

    def astray(contacts, sample):
        asked.append(contacts)
        motion = np.random.default_rng(len(asked)).standard_normal(contacts.load.shape)
        motion[:, 3:] /= sample.radius
        return 0.5 * np.median(sample.network().overlap) * motion

    monkeypatch.setattr(relaxation, "elastic_motion", astray)
    monkeypatch.setattr(relaxation, "FIRST", 100)
    found, state = relax(shaken(rested, 0.01))
    assert state.at_rest and asked
    expected = relax_alone(rested, monkeypatch)
    assert np.array_equal(found.position, expected.position)


def relax_alone(rested, monkeypatch):
    """What damped motion alone makes of the same shake."""
    alone(monkeypatch)
    return relax(shaken(rested, 0.01))[0]


@pytest.fixture(scope="module")
def longer():
    """2,000 spheres at rest: a loose one is few among them."""
    packed = replace(random_sample(2000, 1e6, aspect=6, tolerance=1e-3), friction=0.5)
    return relax(packed)[0]


def pushed_aside(sample, body, share):
    """Contacts after the motion of one sphere by a share of the median overlap."""
    contacts = MovingContacts(sample)
    motion = np.zeros_like(contacts.load)
    motion[body, :3] = share * np.median(sample.network().overlap) / np.sqrt(3)
    contacts.move(motion)
    return contacts


def test_a_loose_sphere_comes_to_rest_by_itself(longer):
    """It is moved aside by an overlap; those far from it keep their places, and shear forces.

    These are turned once a step with a contact that does not turn: 200 roundings a look.
    """
    middle = int(np.argmin(abs(longer.position[:, 2] - longer.walls.mean())))
    contacts = pushed_aside(longer, middle, 1.0)
    start, allowed = contacts.sample(), 1e-8 * contacts.mean_force
    contacts = MovingContacts(start)
    before = np.linalg.norm(contacts.load[:, :3], axis=1)
    found = loose_rest(start, contacts, allowed)
    load = net_forces(found.network())
    assert np.linalg.norm(load[middle, :3]) < 10 * allowed < 1e-3 * before[middle]
    stood = (found.position == start.position).all(axis=1)
    assert not stood[middle] and stood.mean() > 0.5
    # Shear forces: of contacts both of whose spheres stood still.
    old, new = start.network(), found.network()
    held = [stood[n.particle_i] & (n.with_wall | stood[n.partner]) for n in (old, new)]
    rounding = 1e4 * np.finfo(float).eps * contacts.mean_force
    shear, kept = old.force_tangential[held[0]], new.force_tangential[held[1]]
    assert abs(shear - kept).max() < rounding
    assert np.array_equal(old.particle_i[held[0]], new.particle_i[held[1]])


def test_many_loose_spheres_move_with_all(longer):
    start = shaken(longer, 0.1)
    contacts = MovingContacts(start)
    assert loose_rest(start, contacts, 1e-12 * contacts.mean_force) is None
    assert loose_rest(longer, MovingContacts(longer), contacts.mean_force) is None


def test_rest_after_a_loose_sphere_is_that_of_the_law(longer):
    """Springs and the loose sphere's own way in turn: balance and friction from the positions."""
    middle = int(np.argmin(abs(longer.position[:, 2] - longer.walls.mean())))
    rested, state = relax(pushed_aside(longer, middle, 1.0).sample())
    again = equilibrium_of(rested)
    assert state.at_rest and again.residual == state.residual
    assert again.friction_used <= RESERVE * (1 + 1e-9)
