"""Rest by the springs and by damped motion: balance, rigid motions, friction, gain of a step."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from packings import random_sample

from modal.__main__ import main
from modal.cli import relax as relax_command
from modal.dem.contacts import MovingContacts
from modal.packing.sample import Sample, read_sample, write_sample
from modal.packing.state import net_forces, stress_tensor
from modal.preparation import relax as relaxation
from modal.preparation.relax import NEAR, RESERVE, STRIDE, elastic_motion, equilibrium_of, relax
from modal.tools.errors import InputError


@pytest.fixture(scope="module")
def packed():
    """150 frictionless spheres, not quite at rest, given friction."""
    return replace(random_sample(150, 1e6, seed=2, aspect=1.5, tolerance=1e-3), friction=0.3)


@pytest.fixture(scope="module")
def sheared(packed):
    """The same at rest after a random shake, so that every contact carries shear."""
    return relax(shaken(packed, 0.02, np.inf))[0]


def test_rest_is_reached_and_stress_kept(packed):
    before = packed.network()
    rested, state = relax(packed)
    network = rested.network()
    assert state.residual < 1e-9 < equilibrium_of(packed).residual
    assert equilibrium_of(rested).residual == pytest.approx(state.residual, rel=1e-6, abs=0)
    # In balance the two walls carry the same force: their difference is what the spheres lack.
    wall = [network.force_normal[network.particle_j == code].sum() for code in (-1, -2)]
    lacking = abs(net_forces(network)[:, 2]).sum()
    assert abs(wall[0] - wall[1]) <= lacking * (1 + 1e-9) + 1e-12 * wall[0]
    # Fixed cell, first-order residual 1e-3: the stress may move by the same order.
    assert network.force_normal.mean() == pytest.approx(before.force_normal.mean(), rel=1e-2)
    # Lengths times 4 are forces times 4^2, masses 4^3, inertias 4^5, with exact roots: to the bit.
    scaled = {name: 4 * getattr(packed, name) for name in ("position", "side", "walls", "radius")}
    larger, same = relax(replace(packed, **scaled))
    assert same.steps == state.steps and np.array_equal(larger.position, 4 * rested.position)


def test_contacts_slide_until_friction_holds_them(packed):
    """With a friction that the shaken packing's shear forces exceed in several contacts."""
    weak = replace(shaken(packed, 0.02, np.inf, seed=31), friction=0.01)
    before = equilibrium_of(weak)
    rested, state = relax(weak)
    assert before.sliding > 0 == state.sliding
    # RESERVE limits the forces while spheres move; what is left over from there is round-off.
    assert state.friction_used <= RESERVE * (1 + 1e-9)
    assert state.residual < 1e-9 and state.largest < 1e-8


def test_state_at_rest_keeps_the_friction_of_its_compression(sheared):
    """Said to be made with 0.2, a wave follows with 0.3: no contact bears more than 0.2."""
    start = replace(shaken(sheared, 0.4, np.inf, seed=5), friction=0.3)
    used = []
    for study in ({"mu_comp": 0.2}, {}):
        rested, state = relax(replace(start, study=study))
        assert state.at_rest
        network = rested.network()
        shear = np.linalg.norm(network.force_tangential, axis=1)
        used.append((shear / network.force_normal).max())
    assert used[0] <= 0.2 * (1 + 1e-9) < used[1] <= 0.3 * RESERVE * (1 + 1e-9)


def test_rest_is_seen_after_a_large_shake(packed):
    """By an overlap: contacts turn so far that their shear forces get a part along the normal.

    A sample cannot hold this part, so that the moving contacts would be in balance and the sample
    never. Damped waves need some hundred steps for four decades, a thousand for ten.
    """
    _, state = relax(shaken(packed, 1.0, np.inf, seed=2), max_steps=4000)
    assert state.at_rest and state.steps < 4000


def test_moving_contacts_are_the_sample(sheared):
    """Loads from the positions and shear forces of the file, and back, to round-off."""
    contacts, network = MovingContacts(sheared), sheared.network()
    size = np.finfo(float).eps * network.length / network.overlap.min() * network.force_normal.max()
    assert abs(contacts.load[:, :3] - net_forces(network)[:, :3]).max() < 100 * size
    assert contacts.sample().shear == pytest.approx(sheared.shear, abs=100 * size)
    assert np.array_equal(contacts.sample().position, sheared.position)


def test_wedged_sphere_is_freed():
    """Two columns of two spheres between the walls; a fifth leans on both, held by nothing else.

    Its two forces could cancel only along the line through the contacts, some 45 degrees off the
    normals, for which a friction of 0.3 is not enough: the force zero alone is in balance.
    """
    radius, overlap, weak = 1e-3, 1e-6, 1e-9
    side, rise, middle = 8 * radius, 0.2 * radius, radius - overlap
    away = np.sqrt(((2 * radius - weak) ** 2 - rise**2) / 2)
    columns = [[x, radius, z] for x in (side / 2 - away, side / 2 + away) for z in (1, 3)]
    position = np.array([*columns, [side / 2, radius + away, 1]])
    position[:, 2] *= middle
    position[4, 2] += rise
    walls = np.array([0.0, 4 * middle])
    wedged = Sample(position, np.full(2, side), walls, 0.3, radius=radius)
    assert wedged.network().n_contacts == 8
    rested, state = relax(wedged)
    network = rested.network()
    assert state.sliding == 0 and network.n_contacts == 6
    assert 4 not in network.particle_i and 4 not in network.particle_j
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
    assert equilibrium_of(rested).residual < 1e-9


@pytest.mark.parametrize("fault", ["frictionless", "no contacts", "missing"])
def test_bad_input_is_one_line(fault, packed, tmp_path, one_line):
    path = tmp_path / "a.sample.h5"
    if fault == "frictionless":
        write_sample(path, replace(packed, friction=0.0))
    if fault == "no contacts":
        write_sample(path, Sample(np.array([[1.0, 1, 1]]), np.ones(2) * 2, np.array([0, 2.0]), 0.1))
    one_line(main, ["relax", path, "-o", tmp_path / "b.sample.h5"])
    assert not (tmp_path / "b.sample.h5").exists()


def test_far_from_rest_is_said(packed):
    with pytest.raises(InputError, match="does not come to rest"):
        relax(shaken(packed, 20.0, np.inf), max_steps=3)


@pytest.fixture
def approach(packed, monkeypatch):
    """Residuals every hundred steps to 1e-12 by damping alone: springs pass many digits at once."""
    seen = []
    monkeypatch.setattr(relaxation, "elastic_motion", lambda contacts, sample: None)
    relax(packed, tolerance=1e-12, watch=lambda state: seen.append(replace(state)))
    return seen


def test_tolerance_that_is_not_reached_is_said(packed, approach, tmp_path, capsys, monkeypatch):
    """Stopped between the residual that is still given back and the one that was asked for."""
    steps = next(state.steps for state in approach if state.within(0.5 * NEAR))
    short = partial(relax, max_steps=steps)
    rested, state = short(packed, tolerance=1e-12)
    reached = equilibrium_of(rested)
    assert state.residual == reached.residual > 10 * max(state.tolerance, state.attainable)
    assert state.tolerance == 1e-12 and not state.at_rest
    assert relax(packed)[1].at_rest
    path, out = tmp_path / "a.sample.h5", tmp_path / "b.sample.h5"
    write_sample(path, packed)
    monkeypatch.setattr(relax_command, "relax", short)
    assert main(["relax", str(path), "--tolerance", "1e-12", "-o", str(out)]) == 3
    assert "1e-12 was asked for" in capsys.readouterr().err
    study = read_sample(out).study
    assert study["tolerance"] == 1e-12 and not study["at_rest"]
    assert study["residual"] == state.residual


def test_rest_is_that_of_the_sample_that_is_given_back(packed):
    """Round-off of the positions included; 10 eps L / overlap is what they allow."""
    rested, state = relax(packed, tolerance=1e-300)
    again = equilibrium_of(rested)
    assert state.at_rest and again.within(state.attainable)
    overlap = np.median(rested.network().overlap)
    length = rested.walls[1] - rested.walls[0]
    allowed = 10 * np.finfo(float).eps * length / overlap
    assert state.attainable == pytest.approx(allowed, rel=1e-2, abs=0)


def test_spheres_that_come_apart_are_said():
    """A sphere that a wall pushes away, with nothing behind it."""
    place, size = np.array([[2e-3, 2e-3, 1e-3 - 1e-8]]), np.array([0.0, 4e-3])
    with pytest.raises(InputError, match="come apart"):
        relax(Sample(place, np.full(2, 4e-3), size, 0.3, radius=1e-3))


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
    alone(monkeypatch)
    assert np.array_equal(found.position, relax(shaken(rested, 0.01))[0].position)
