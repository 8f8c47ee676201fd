"""Tests of clumps: closed forms of the union, conservation laws in flight, networks, files."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

import modal
from modal.__main__ import main
from modal.dem.motion import Dynamics
from modal.packing.clumps import clump_template, parse_template
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.sample import Sample, read_sample, write_sample
from modal.packing.state import stress_tensor
from modal.preparation.cloud import make_cloud
from modal.preparation.study import Study

TWO = "0 0 -0.5 1 0 0 0.5 1"
UNEQUAL = "0 0 0 1 0.9 0.2 0 0.7 0.1 1 0.3 0.6"


def test_union_of_two_spheres_has_its_closed_form():
    """Subtract the lens from both volumes; integrate discs for the tensor. The rays err by 1e-5."""
    template = clump_template(np.array([[0, 0, -0.5], [0, 0, 0.5]]), np.ones(2))
    lens = np.pi * (4 + 1) * (2 - 1) ** 2 / 12
    assert template.volume == pytest.approx(8 / 3 * np.pi - lens, rel=1e-5)

    def disc(z):
        return 1 - (abs(z) - 0.5) ** 2

    axial = 2 * quad(lambda z: np.pi / 2 * disc(z) ** 2, 0, 1.5)[0]
    lateral = axial / 2 + 2 * quad(lambda z: np.pi * disc(z) * z * z, 0, 1.5)[0]
    expected = np.diag([lateral, lateral, axial])
    assert template.tensor == pytest.approx(expected, rel=2e-5, abs=1e-9)
    sphere = template.scaled(RADIUS)
    assert sphere.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=1e-12)


def test_union_of_spheres_apart_is_the_sum_and_turns_with_them():
    """Compare with the theorem of parallel axes, and a union in two orientations."""
    position = np.array([[0.0, 0, 0], [1.0, 2.0, 3.0]])
    radius = np.array([1.0, 0.5])
    template = clump_template(position, radius)
    volume = 4 / 3 * np.pi * radius**3
    assert template.volume == pytest.approx(volume.sum(), rel=1e-4)
    centre = volume @ position / volume.sum()
    assert template.arm == pytest.approx(position - centre, abs=1e-4)
    arm = position - centre
    expected = np.sum(0.4 * volume * radius**2) * np.eye(3)
    for part, each in zip(volume, arm, strict=True):
        expected += part * (each @ each * np.eye(3) - np.outer(each, each))
    assert template.tensor == pytest.approx(expected, rel=1e-3, abs=1e-3)
    one = parse_template(UNEQUAL.split())
    turned = clump_template(one.arm[:, [1, 2, 0]], one.radius)
    assert turned.volume == pytest.approx(one.volume, rel=3e-5)
    assert turned.tensor == pytest.approx(
        one.tensor[np.ix_([1, 2, 0], [1, 2, 0])], abs=1e-4 * one.tensor[0, 0]
    )


def cloud(words, count=100):
    """Return clumps of a template in a cloud."""
    return make_cloud(Study(0.3, count, 5.0, clump=words, walls="none"))


def set_in_motion(sample, velocity, spin):
    """Return the sample with velocities and spins (k, 3) of its clumps."""
    body = sample.body
    return replace(
        sample,
        velocity=velocity[body] + np.cross(spin[body], sample.arm),
        angular_velocity=spin[body],
        strain_rate=np.zeros(3),
    )


def kinetic_energy(motion):
    """Return the kinetic energy of all clumps, J, at the time of the velocities."""
    clumps = motion.clumps
    start = motion.sample(moving=True)
    spin = start.angular_velocity[start.clumps.first_members]
    translation = 0.5 * (start.body_mass[:, None] * clumps.velocity**2).sum()
    return translation + 0.5 * (clumps.angular_momentum * spin).sum()


def test_free_clump_keeps_its_momentum_to_round_off_and_its_energy_to_second_order():
    """Let an asymmetric top tumble, which has no axis to turn about steadily."""
    random = np.random.default_rng(2)
    sample = cloud(UNEQUAL)
    spin = 30 * random.standard_normal((100, 3))
    moving = set_in_motion(sample, np.zeros((100, 3)), spin)
    spreads = []
    for count in (50, 100):
        motion = Dynamics(moving)
        before = motion.clumps.angular_momentum.copy()
        energies = []
        for _ in range(count):
            motion.step(0.04 / count)
            energies.append(kinetic_energy(motion))
        assert motion.clumps.angular_momentum == pytest.approx(before, abs=1e-14 * before.max())
        spreads.append(np.ptp(energies) / energies[0])
        position = motion.contacts.position.reshape(-1, 3, 3)
        lengths = motion.contacts.lengths
        apart = position[:, 1] - position[:, 0]
        apart -= lengths * np.round(apart / lengths)
        start = np.linalg.norm(sample.arm[1] - sample.arm[0])
        assert np.linalg.norm(apart, axis=1) == pytest.approx(start, rel=1e-12)
    assert spreads[0] < 1e-2
    assert np.log2(spreads[0] / spreads[1]) == pytest.approx(2, abs=0.4)


def colliding_pair():
    """Return two clumps of two spheres that fly at each other, off their centres."""
    template = parse_template(TWO.split()).scaled(RADIUS)
    side = 20 * RADIUS
    centre = np.full((2, 3), side / 2)
    centre[1] += [1.75 * RADIUS, 0.3 * RADIUS, 0.6 * RADIUS]
    arm = np.tile(template.arm, (2, 1))
    sample = Sample(
        np.repeat(centre, 2, axis=0) + arm,
        np.full(2, side),
        np.array([0.0, side]),
        0.3,
        radius=float(template.radius[0]),
        periodic_z=True,
        body=np.repeat([0, 1], 2),
        arm=arm,
        body_mass=np.full(2, GLASS.density * template.volume),
        body_tensor=np.tile(GLASS.density * template.tensor, (2, 1, 1)),
    )
    velocity = np.array([[0.0, 0, 0], [-1.0, 0, 0]])
    return set_in_motion(sample, velocity, np.zeros((2, 3)))


def stop_at_touch():
    """Return the motion of two clumps that have just touched."""
    motion = Dynamics(colliding_pair())
    while not motion.contacts.touching:
        motion.step(2e-7)
    return motion


def test_collision_keeps_both_momenta_and_loses_energy_to_friction_alone():
    """Sum momenta about the origin; the energy book closes to the square of the step."""
    motion = Dynamics(stop_at_touch().sample(moving=True), track_energy=True)
    mass = motion.sample(moving=True).body_mass[:, None]

    def momenta():
        clumps = motion.clumps
        linear = mass * clumps.velocity
        angular = np.cross(clumps.centre, linear) + clumps.angular_momentum
        return np.concatenate([linear.sum(axis=0), angular.sum(axis=0)])

    start = momenta()
    energy = kinetic_energy(Dynamics(colliding_pair()))
    for _ in range(400):
        motion.step(2e-7)
    assert motion.contacts.touching == 0
    assert momenta() == pytest.approx(start, abs=1e-10 * abs(start).max())
    assert abs(motion.clumps.angular_momentum).max() > 0
    lost = energy - kinetic_energy(motion)
    assert motion.contacts.slipped > 0
    assert lost == pytest.approx(motion.contacts.slipped, abs=2e-4 * energy)


def test_network_of_clumps_has_their_mass_and_stress(tmp_path, one_line):
    """Stop a collision: compare stress, void ratio and modes of its file with the clumps' own."""
    table = tmp_path / "two.csv"
    table.write_text("x,y,z,radius\n0,0,-0.5,1\n0,0,0.5,1\n")
    motion = stop_at_touch()
    for _ in range(10):
        motion.step(2e-7)
    stopped = motion.sample(moving=False)
    network = stopped.network()
    assert network.n_particles == 2
    assert network.n_contacts == motion.contacts.touching
    volume = 4 / 3 * np.pi * RADIUS**3
    assert network.mass == pytest.approx(GLASS.density * volume, rel=1e-12)
    assert network.radius == pytest.approx(RADIUS, rel=1e-12)
    cell = stopped.side.prod() * stopped.length
    assert network.study["void_ratio"] == pytest.approx(cell / (2 * volume) - 1, rel=1e-12)
    motion.find_forces(0.0)
    assert motion.stress() == pytest.approx(np.diag(stress_tensor(network)), rel=1e-9)
    path = tmp_path / "clumps.sample.h5"
    write_sample(path, stopped)
    again = read_sample(path)
    assert again.network().matches(network.fingerprint)
    assert modal.count_modes(network, 1e9) == 12
    one_line(
        main, f"pack --clump {table} --stress 1e4 -o {tmp_path}/a".split(), code="unused_option"
    )


@pytest.mark.parametrize("text", ["1,2,3\n", "0,0,0,1\n5,0,0,1\n", "0,0,0,-1\n", "a,b,c,d\n"])
def test_wrong_templates_are_refused(text, tmp_path, one_line):
    table = tmp_path / "t.csv"
    table.write_text(text)
    words = f"pack --spheres 100 --friction 0.3 --clump {table} --stress 1e4 -o {tmp_path}/a"
    one_line(main, words.split(), code="clump")
