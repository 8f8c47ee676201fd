"""Tests of relaxation by elastic steps and damped motion: balance, friction, gain of a step."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from packings import random_sample
from refusals import refusal

from modal.__main__ import main
from modal.cli import relax as relax_command
from modal.dem.contacts import MovingContacts
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.packing.sample import Sample, read_sample, write_sample
from modal.packing.state import friction_used, net_forces, stress_tensor
from modal.preparation import relax as relaxation
from modal.preparation import scanned
from modal.preparation.protocol import SETTLED
from modal.preparation.relax import (
    ACCEPTED_RESIDUAL,
    FRICTION_SHARE,
    MAX_DISPLACEMENT_OVERLAPS,
    elastic_motion,
    measure_equilibrium,
    relax,
)


@pytest.fixture(scope="module")
def packed():
    """Return 150 frictionless spheres, not quite at rest, given friction."""
    return replace(random_sample(150, 1e6, seed=2, aspect=1.5, tolerance=1e-3), friction=0.3)


@pytest.fixture(scope="module")
def sheared(packed):
    """Return a packing at rest after a random shake: every contact carries shear."""
    return relax(shaken(packed, 0.02, np.inf))[0]


@pytest.fixture(scope="module")
def relaxed(packed):
    """Return the packing after relaxation, and its balance."""
    return relax(packed)


def test_rest_is_reached(packed, relaxed):
    sample, state = relaxed
    assert state.residual < 1e-9 < measure_equilibrium(packed).residual
    assert measure_equilibrium(sample).residual == pytest.approx(state.residual, rel=1e-6, abs=0)


def test_walls_carry_equal_forces_at_rest(relaxed):
    """Bound the difference of both forces by the net forces of the spheres."""
    network = relaxed[0].network()
    source_force = network.force_normal[network.particle_j == SOURCE_WALL].sum()
    receiver_force = network.force_normal[network.particle_j == RECEIVER_WALL].sum()
    net_force = abs(net_forces(network)[:, 2]).sum()
    bound = net_force * (1 + 1e-9) + 1e-12 * source_force
    assert abs(source_force - receiver_force) <= bound


def test_relaxation_keeps_the_stress(packed, relaxed):
    """Allow a change of the order of the first residual, 1e-3, at a fixed cell."""
    mean_before = packed.network().force_normal.mean()
    assert relaxed[0].network().force_normal.mean() == pytest.approx(mean_before, rel=1e-2)


def test_relaxation_has_no_length_scale(packed, relaxed):
    """Scale lengths by 4: forces scale by 4^2, masses 4^3, inertias 4^5, all exact to the bit."""
    sample, state = relaxed
    larger = replace(
        packed,
        position=4 * packed.position,
        side=4 * packed.side,
        walls=4 * packed.walls,
        radius=4 * packed.radius,
    )
    larger_sample, larger_state = relax(larger)
    assert larger_state.steps == state.steps
    assert np.array_equal(larger_sample.position, 4 * sample.position)


def test_contacts_slide_until_friction_holds_them(packed):
    """Relax with a friction that the shear forces after a shake exceed in several contacts."""
    weak = replace(shaken(packed, 0.02, np.inf, seed=31), friction=0.01)
    before = measure_equilibrium(weak)
    rested, state = relax(weak)
    assert before.sliding > 0
    assert state.sliding == 0
    # FRICTION_SHARE limits the forces while spheres move, to round-off.
    assert state.friction_used <= FRICTION_SHARE * (1 + 1e-9)
    assert state.residual < 1e-9
    assert state.largest < 1e-8


def test_state_at_rest_keeps_the_friction_of_its_compression(sheared):
    """Relax at 0.3 a state that was compressed with 0.2: no contact bears more than 0.2."""
    start = replace(shaken(sheared, 0.4, np.inf, seed=5), friction=0.3)
    limited = largest_shear_ratio(replace(start, study={"mu_comp": 0.2}))
    unlimited = largest_shear_ratio(replace(start, study={}))
    assert limited <= 0.2 * (1 + 1e-9) < unlimited <= 0.3 * FRICTION_SHARE * (1 + 1e-9)


def largest_shear_ratio(sample):
    """Return the largest shear force divided by its normal force after relaxation."""
    rested, state = relax(sample)
    assert state.at_rest
    network = rested.network()
    shear = np.linalg.norm(network.force_tangential, axis=1)
    return (shear / network.force_normal).max()


def test_rest_is_seen_after_a_large_shake(packed):
    """Shake by an overlap: contacts turn so far that shear forces get a part along the normal.

    A sample does not hold this part, so that the moving contacts would be in balance and the sample
    never. Damped waves need some hundred steps for four decades, a thousand for ten.
    """
    _, state = relax(shaken(packed, 1.0, np.inf, seed=2), max_steps=4000)
    assert state.at_rest
    assert state.steps < 4000


def test_moving_contacts_are_the_sample(sheared):
    """Compare loads from positions and shear forces of the file, and back, to round-off."""
    contacts = MovingContacts(sheared)
    network = sheared.network()
    size = np.finfo(float).eps * network.length / network.overlap.min() * network.force_normal.max()
    assert abs(contacts.load[:, :3] - net_forces(network)[:, :3]).max() < 100 * size
    assert contacts.sample().shear == pytest.approx(sheared.shear, abs=100 * size)
    assert np.array_equal(contacts.sample().position, sheared.position)


def test_wedged_sphere_is_freed():
    """Lean a sphere on two columns of two spheres between the walls, held by nothing else.

    Its two forces could cancel only along the line through the contacts, some 45 degrees off the
    normals, for which a friction of 0.3 is not enough: the force zero alone is in balance.
    """
    radius = 1e-3
    overlap = 1e-6
    weak_overlap = 1e-9
    side = 8 * radius
    rise = 0.2 * radius
    height = radius - overlap
    distance = np.sqrt(((2 * radius - weak_overlap) ** 2 - rise**2) / 2)
    columns = [[x, radius, z] for x in (side / 2 - distance, side / 2 + distance) for z in (1, 3)]
    position = np.array([*columns, [side / 2, radius + distance, 1]])
    position[:, 2] *= height
    position[4, 2] += rise
    walls = np.array([0.0, 4 * height])
    wedged = Sample(position, np.full(2, side), walls, 0.3, radius=radius)
    assert wedged.network().n_contacts == 8
    rested, state = relax(wedged)
    network = rested.network()
    assert state.sliding == 0
    assert network.n_contacts == 6
    assert 4 not in network.particle_i
    assert 4 not in network.particle_j
    assert network.force_normal == pytest.approx(network.force_normal[0], rel=1e-6)


def test_command_writes_a_sample_at_rest(packed, tmp_path, printed):
    write_sample(tmp_path / "a.sample.h5", packed)
    out = tmp_path / "b.sample.h5"
    shown = printed("relax", tmp_path / "a.sample.h5", "--friction", 0.5, "-o", out)
    assert shown["residual"] < 1e-9 < shown["residual_before"]
    paths = tmp_path / "a.sample.h5", out
    before, after = (np.array(printed("info", path)["stress_pa"]) for path in paths)
    change = abs(after - before).max() / before.max()
    assert abs(shown["stress_change"]) == pytest.approx(change, rel=1e-6)
    rested = read_sample(out)
    assert rested.friction == 0.5
    assert measure_equilibrium(rested).residual < 1e-9


def test_sample_without_friction_is_refused(packed):
    with refusal("friction"):
        relax(replace(packed, friction=0.0))


def test_sample_without_contacts_is_refused():
    lone_sphere = Sample(np.ones((1, 3)), np.full(2, 2.0), np.array([0, 2.0]), 0.1)
    with refusal("no_contacts"):
        relax(lone_sphere)


def test_command_without_its_file_is_one_line(tmp_path, one_line):
    path = tmp_path / "a.sample.h5"
    output = tmp_path / "b.sample.h5"
    one_line(main, ["relax", path, "-o", output], path.name, code="no_file")
    assert not (tmp_path / "b.sample.h5").exists()


def test_sample_that_does_not_come_to_rest_is_refused(packed):
    with refusal("not_at_rest"):
        relax(shaken(packed, 20.0, np.inf), max_steps=3)


@pytest.fixture
def damped_states(packed, monkeypatch):
    """Return the balance at each check to 1e-12 by damping alone, which passes every digit."""
    states = []
    disable_elastic_steps(monkeypatch)
    relax(packed, tolerance=1e-12, watch=lambda state: states.append(replace(state)))
    return states


def test_tolerance_that_is_not_reached_is_reported(
    packed, damped_states, tmp_path, capsys, monkeypatch
):
    """Stop between the residual that is still accepted and the requested one."""
    goal = 0.5 * ACCEPTED_RESIDUAL
    steps = next(state.steps for state in damped_states if state.within(goal))
    short = partial(relax, max_steps=steps)
    rested, state = short(packed, tolerance=1e-12)
    reached = measure_equilibrium(rested)
    assert state.residual == reached.residual > 10 * max(state.tolerance, state.attainable)
    assert state.tolerance == 1e-12
    assert not state.at_rest
    assert relax(packed)[1].at_rest
    path, out = tmp_path / "a.sample.h5", tmp_path / "b.sample.h5"
    write_sample(path, packed)
    monkeypatch.setattr(relax_command, "relax", short)
    assert main(["relax", str(path), "--tolerance", "1e-12", "-o", str(out)]) == 3
    assert "1e-12" in capsys.readouterr().err
    study = read_sample(out).study
    assert study["tolerance"] == 1e-12
    assert not study["at_rest"]
    assert study["residual"] == state.residual


def test_sample_creeps_under_its_stress(tmp_path):
    """Bring a sample to rest whose compression had less friction than it bears.

    Its contacts slide. The servo holds the stress to `SETTLED.stress_error`, and what is left to
    creep then is a hundredth of what was left before.
    """
    wide = replace(random_sample(250, 1e6, seed=2, aspect=1.2, tolerance=1e-3), friction=0.3)
    sheared = relax(shaken(wide, 0.02, np.inf))[0]
    path = tmp_path / "a.sample.h5"
    out = tmp_path / "b.sample.h5"
    write_sample(path, replace(sheared, study={"mu_comp": 0.1}))
    stress = np.trace(stress_tensor(sheared.network())) / 3
    command = ["relax", str(path), "--stress", f"{stress}", "-o", str(out)]
    assert main(command) == 0
    rested = read_sample(out)
    assert rested.friction == sheared.friction
    principal = np.diag(stress_tensor(rested.network()))
    assert principal == pytest.approx(stress, rel=1.1 * SETTLED.stress_error)
    assert friction_used(sheared.network(), 0.1).max() > 1.2
    # Shear forces are cut back to the limit of the normal force at that step.
    assert friction_used(rested.network(), 0.1).max() < 1 + 1e-6


def test_sample_that_still_creeps_comes_to_rest_all_the_same(tmp_path, monkeypatch):
    """Ask for a residual that no servo reaches: the cell is then fixed, and the sample rests."""
    monkeypatch.setattr(relax_command, "CREEP_RESIDUAL", 1e-14)
    monkeypatch.setattr(scanned, "MAX_CHECKPOINTS", 1)
    path = tmp_path / "a.sample.h5"
    out = tmp_path / "b.sample.h5"
    loose = random_sample(250, 1e6, seed=2, aspect=1.2, tolerance=1e-3)
    write_sample(path, replace(loose, friction=0.3))
    assert main(["relax", str(path), "--stress", "1e6", "-o", str(out)]) == 0
    assert read_sample(out).study["at_rest"]


def test_balance_is_that_of_the_returned_sample(packed):
    """Include the round-off of positions, which allows 10 eps L / overlap."""
    rested, state = relax(packed, tolerance=1e-300)
    assert state.at_rest
    assert measure_equilibrium(rested).within(state.attainable)
    overlap = np.median(rested.network().overlap)
    length = rested.walls[1] - rested.walls[0]
    allowed = 10 * np.finfo(float).eps * length / overlap
    assert state.attainable == pytest.approx(allowed, rel=1e-2, abs=0)


def test_spheres_that_come_apart_are_refused():
    """Relax a sphere that a wall pushes away, with nothing behind it."""
    position = np.array([[2e-3, 2e-3, 1e-3 - 1e-8]])
    sample = Sample(position, np.full(2, 4e-3), np.array([0.0, 4e-3]), 0.3, radius=1e-3)
    with refusal("comes_apart"):
        relax(sample)


def test_sample_that_loses_half_of_its_contacts_has_come_apart():
    """Relax a row of three spheres, which its period holds, beside four pairs, which nothing holds.

    Three of seven contacts remain, and would for all 60,000 steps.
    """
    radius = 1e-3
    distance = 2 * radius - 1e-8
    row = [[distance * (place + 0.5), radius, 4e-3] for place in range(3)]
    pairs = []
    for y in (4e-3, 7e-3, 10e-3, 13e-3):
        pairs += [[3e-3, y, 4e-3], [3e-3, y, 4e-3 + distance]]
    side = np.array([3 * distance, 15e-3])
    sample = Sample(np.array(row + pairs), side, np.array([0.0, 1e-2]), 0.3, radius=radius)
    contacts = []
    with refusal("comes_apart"):
        relax(sample, watch=lambda state: contacts.append(state.contacts))
    assert contacts[0] == 7


@pytest.fixture(scope="module")
def rested():
    """Return 200 spheres at rest, every contact with shear from a shake by 2 % of an overlap.

    Of eight seeds two to four, which round-off decides, have a sphere so loosely held that elastic
    steps exclude it; this one has none.
    """
    sample = random_sample(200, 1e6, seed=3, aspect=1.5, tolerance=1e-3)
    return relax(shaken(replace(sample, friction=0.5), 0.02, np.inf))[0]


def shaken(sample, share, friction=None, seed=3):
    """Move the sample at random by `share` of the median overlap; rotations count as arcs."""
    motion = np.random.default_rng(seed).standard_normal((len(sample.position), 6))
    motion *= share * np.median(sample.network().overlap)
    motion[:, 3:] /= sample.radius
    contacts = MovingContacts(sample, friction)
    contacts.move(motion)
    return contacts.sample()


def disable_elastic_steps(monkeypatch):
    """Make relaxation use damped motion alone."""
    monkeypatch.setattr(relaxation, "elastic_motion", lambda contacts, sample: None)


def sphere_distances(first, second):
    """Return the distances (n,) of the spheres of two samples of one cell, m."""
    distance = first.position - second.position
    distance[:, :2] -= np.round(distance[:, :2] / first.side) * first.side
    return np.linalg.norm(distance, axis=1)


def test_rest_is_that_of_damped_motion(rested, monkeypatch):
    """Undo, with and without elastic steps, a shake by a hundredth of an overlap.

    Hardly any contact slides or opens. Shear forces grow with the present stiffness, so that both
    results differ by products of two such motions: 1e-4 of an overlap for each of some six
    contacts. Spheres without contacts stay where they were.
    """
    start = shaken(rested, 0.01)
    monkeypatch.setattr(relaxation, "FIRST_ELASTIC_STEP", 100)  # so few spheres soon rest anyway
    sample, state = relax(start)
    disable_elastic_steps(monkeypatch)
    damped_sample, damped_state = relax(start)
    assert state.at_rest
    assert damped_state.at_rest
    assert state.steps < damped_state.steps
    network = sample.network()
    expected = damped_sample.network()
    assert network.n_contacts == expected.n_contacts
    overlap = np.median(network.overlap)
    touching = np.unique(network.particle_i)
    distances = sphere_distances(sample, damped_sample)[touching]
    assert np.median(distances) < 1e-3 * overlap
    assert network.force_normal.mean() == pytest.approx(expected.force_normal.mean(), rel=1e-3)
    assert network.study["void_ratio"] == pytest.approx(expected.study["void_ratio"], rel=1e-12)
    stress = np.diag(stress_tensor(network))
    assert stress == pytest.approx(np.diag(stress_tensor(expected)), rel=1e-3)


def test_each_step_gains_a_digit(rested):
    """Compute residuals of the contact law after elastic steps alone.

    Forces change direction by an overlap over a radius, 1e-3 here, and stiffnesses by half of the
    share of the overlap that a step goes; the solver stops at an error of 1e-2 in the energy.
    """
    contacts = MovingContacts(shaken(rested, 1e-3))
    residuals = [measure_equilibrium(contacts.sample()).residual]
    for _ in range(3):
        contacts.move(elastic_motion(contacts, contacts.sample()))
        residuals.append(measure_equilibrium(contacts.sample()).residual)
    # The error of a step is bounded in the energy; in the residual a digit is gained on average.
    assert residuals[-1] < 1e-3 * residuals[0]


def test_sphere_without_contacts_is_excluded(rested):
    """Push a sphere without contacts: all others move as they do without the push."""
    network = rested.network()
    free = np.setdiff1d(np.arange(network.n_particles), [*network.particle_i, *network.particle_j])
    assert len(free) > 0
    contacts = MovingContacts(shaken(rested, 1e-3))
    sample = contacts.sample()
    expected = elastic_motion(contacts, sample)
    contacts.load[free[0], :3] = contacts.mean_force
    motion = elastic_motion(contacts, sample)
    max_displacement = MAX_DISPLACEMENT_OVERLAPS * np.median(network.overlap)
    assert np.linalg.norm(motion[free[0], :3]) <= max_displacement * (1 + 1e-12)
    others = np.delete(np.arange(len(motion)), free[0])
    assert motion[others] == pytest.approx(expected[others], abs=1e-3 * abs(expected).max())


def test_elastic_step_that_leads_away_is_rejected(rested, monkeypatch):
    """Replace the elastic motion by a random one of half an overlap: the residual grows.

    Damped motion goes on as if the step had not been tried.
    """
    calls = []

    def random_motion(contacts, sample):
        calls.append(contacts)
        motion = np.random.default_rng(len(calls)).standard_normal(contacts.load.shape)
        motion[:, 3:] /= sample.radius
        return 0.5 * np.median(sample.network().overlap) * motion

    monkeypatch.setattr(relaxation, "elastic_motion", random_motion)
    monkeypatch.setattr(relaxation, "FIRST_ELASTIC_STEP", 100)
    sample, state = relax(shaken(rested, 0.01))
    assert state.at_rest
    assert calls
    disable_elastic_steps(monkeypatch)
    expected, _ = relax(shaken(rested, 0.01))
    assert np.array_equal(sample.position, expected.position)
