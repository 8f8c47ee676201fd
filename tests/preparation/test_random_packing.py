"""Frictionless packings: forces, descent, energy and stress, seeds, mixtures, bad input."""

import numpy as np
import pytest
from packings import random_sample

from modal.__main__ import main
from modal.dem import contacts
from modal.dem.contacts import MovingContacts
from modal.dem.forces import forces_by_arrays, forces_by_loop
from modal.packing.sample import read_sample
from modal.packing.state import net_forces, stress_tensor, void_ratio
from modal.packing.summary import summary
from modal.preparation import frictionless
from modal.preparation.cloud import cloud
from modal.preparation.frictionless import Descent, Pressure
from modal.preparation.protocol import Study, by_tens, stages_of
from modal.preparation.random_packing import sound_aspect, width_of
from modal.preparation.sizes import radii_of, words
from modal.tools.slabs import SLABS


def of(spheres, aspect, seed, **mixture):
    """What a packing without friction is made of."""
    return Study(0.0, spheres, width_of(spheres, aspect), seed, **words(mixture))


def points(*given, **mixture):
    """Overlapping random points, where such a packing begins."""
    return cloud(of(*given, **mixture))


@pytest.mark.two_ways
def test_forces_are_the_gradient_of_the_energy():
    """Central differences of the energy along a random motion, and along each length."""
    sample = points(200, 2.0, 3)
    start = MovingContacts(sample, history=False)

    def rise(change):
        """Of the energy from before a change to after it."""
        energies = []
        for way in (-1, 1):
            contacts = MovingContacts(sample, history=False)
            change(contacts, way)
            contacts.touch()
            energies.append(contacts.elastic_energy)
        return energies[1] - energies[0]

    motion, step = np.random.default_rng(4).standard_normal((200, 3)), 1e-6 * sample.radius

    def move(contacts, way):
        contacts.position += way * step * motion

    def stretch(contacts, way):
        by = np.where(np.arange(3) == axis, (1 + 1e-6) ** way, 1.0)
        contacts.position *= by
        contacts.side *= by[:2]
        contacts.walls *= by[2]

    # Error of order (step / overlap)^2 and of the round-off of the energy over the step.
    assert rise(move) / (2 * step) == pytest.approx(-(start.load * motion).sum(), rel=1e-5, abs=0)
    for axis in range(3):
        # The walls move with the length, so their work is part of the virial.
        assert rise(stretch) / (2 * np.log1p(1e-6)) == pytest.approx(-start.virial[axis], rel=1e-5)


@pytest.mark.two_ways
def test_minimum_has_the_stress_and_lower_enthalpy():
    study, pressure = of(150, 1.5, 5), 1e7
    start = cloud(study)

    def enthalpy(sample):
        there = MovingContacts(sample, history=False)
        return there.elastic_energy + pressure * there.lengths.prod()

    stage = Pressure(f"{pressure:g}", study)
    stage.limits = 1e-3, 1e-5
    motion, seen = Descent(start, stage), [enthalpy(start)]
    for _ in range(1000):
        motion.advance(25, 1.0, 1)
        seen.append(enthalpy(motion.sample(moving=False)))
        if stage.settled(motion.unbalanced()):
            break
    packed = motion.sample(moving=False)
    assert motion.unbalanced() < 1e-5
    # What is left of it comes and goes with the velocities: residual times overlap, some 1e-7.
    assert seen[-1] < min(seen) + 1e-6 * (seen[0] - min(seen)) < seen[0]
    network = packed.network()
    assert np.diag(stress_tensor(network)) == pytest.approx([pressure] * 3, rel=1e-3)
    for code in (-1, -2):
        on_wall = network.force_normal[network.particle_j == code].sum()
        # Walls and contacts carry the same stress, as far as the spheres are in balance.
        assert on_wall / packed.side.prod() == pytest.approx(pressure, rel=2e-3)
    inside = (packed.position[:, 2] > 0) & (packed.position[:, 2] < packed.walls[1])
    assert inside.all() and (packed.position[:, :2] < packed.side).all()


@pytest.mark.parametrize("spheres", [37, 6000])
def test_compiled_steps_of_a_descent_are_those_of_numpy(spheres):
    """Sums, by threads and without, and one motion: to round-off."""
    velocity, force, position = np.random.default_rng(spheres).standard_normal((3, spheres, 3))
    one, other = np.zeros((2, SLABS, 5))
    frictionless.sums_by_loop(velocity, force, one)
    frictionless.sums_by_arrays(velocity, force, other)
    # A sum of products without a sign: by their size, sqrt(3 n) times that of one.
    same = pytest.approx(other[:, :3].sum(axis=0), rel=1e-12, abs=1e-12 * spheres)
    assert one[:, :3].sum(axis=0) == same and (one.max(axis=0) == other.max(axis=0))[3:].all()
    moved = []
    for by in (frictionless.descend_by_loop, frictionless.descend_by_arrays):
        x, v = position.copy(), velocity.copy()
        by(x, v, force, 0.9, 0.2, np.array([1.1, 1.0, 0.8]), 0.3)
        moved.append(np.hstack([x, v]))
    assert moved[0] == pytest.approx(moved[1], rel=1e-13, abs=1e-14)


def test_packings_are_isostatic_or_denser_and_uncrystallised():
    """Frictionless spheres need six contacts each but for rattlers; a crystal has e 0.35."""
    sample = random_sample(300, 1e6, seed=9, aspect=2.0, tolerance=1e-3)
    network = sample.network()
    touching = np.bincount(network.particle_i, minlength=300)
    touching += np.bincount(network.particle_j[~network.with_wall], minlength=300)
    held = touching >= 4
    assert touching[held].mean() > 5.8
    assert held.mean() > 0.9
    # Random close packing has e 0.56; walls a few diameters apart add some hundredths.
    found = summary(network)
    assert 0.48 < found["void_ratio"] < 0.64
    # Isotropic: a third along each axis; 900 normals scatter by 0.3 / sqrt(900).
    assert found["fabric_diagonal"] == pytest.approx([1 / 3] * 3, abs=0.03)
    # Contacts and both walls bear the pressure, to some times the tolerance of 1e-3.
    assert found["stress_pa"] == pytest.approx([1e6] * 3, rel=5e-3)
    assert found["wall_stress_pa"] == pytest.approx([1e6] * 2, rel=5e-3)


def test_higher_peak_leaves_a_denser_packing(tmp_path):
    """What a peak has pushed together stays so: at one stress the voids fall with the peak."""
    command = ["pack", "--spheres", "300", "--aspect", "2", "--stress", "1e6", "--peak"]
    voids = []
    for peak in ("1e7", "3e8"):
        assert main([*command, peak, "-o", str(tmp_path / peak)]) == 0
        study = read_sample(tmp_path / peak / "1e+06Pa.sample.h5").study
        assert study["peak"] == float(peak) and study["settled"]
        voids.append(study["void_ratio"])
    assert voids[1] < voids[0] - 0.005


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("stresses", [[1e3], [1e6, 1e7], [1e5, 3e6]])
def test_a_path_goes_by_stresses_at_most_ten_times_apart(friction, stresses):
    """From the peak, or from where it has jammed, to each; no stage has the name of another."""
    names = stages_of(Study(friction, 200, 4.5), stresses)
    assert len(set(names)) == len(names)
    way = [float(name.split()[0]) for name in names if name[0].isdigit()]
    assert [float(name) for name in names if name[0].isdigit() and " " not in name] == stresses
    before = [1e4 if friction else 2e8, *way]
    assert all(0.099 < one / other < 10.1 for one, other in zip(before, way, strict=False))
    assert by_tens(1e4, 5e5) == [1e5, 5e5]


@pytest.mark.parametrize("spheres", [300, 2000, 20_000, 35_201])
def test_default_shape_is_sound_for_any_number(spheres):
    """8 diameters wide even as dense as random spheres get, 0.64; a cube or the study's at ends."""
    aspect = sound_aspect(spheres)
    width = (spheres * np.pi / 6 / 0.64 / aspect) ** (1 / 3)
    assert width >= 8 or aspect == 1
    assert aspect == pytest.approx(10.05) if spheres > 7500 else width < 8.5


@pytest.mark.parametrize("sizes", [("lognormal", 0.3), ("two", 2, 0.5)])
def test_mixtures_come_to_rest_and_keep_their_sizes(sizes):
    """Balance, stress and voids by the network's own sums."""
    sample = random_sample(120, stress=1e6, seed=2, aspect=1.5, tolerance=1e-4, sizes=sizes)
    radii = radii_of(120, sizes, seed=2)
    np.testing.assert_array_equal(sample.radii, radii)
    network = sample.network()
    mean = network.force_normal.mean()
    net = np.linalg.norm(net_forces(network)[:, :3], axis=1)
    # The residual at which it stopped, its largest sphere.
    assert net.mean() < 2e-4 * mean
    np.testing.assert_allclose(np.diag(stress_tensor(network)), 1e6, rtol=2e-3)
    assert void_ratio(network) == pytest.approx(network.study["void_ratio"], rel=1e-12)


@pytest.mark.parametrize("sizes", [None, ("lognormal", 0.4)])
def test_loop_and_arrays_agree(sizes, monkeypatch):
    """The compiled loop against numpy, sphere by sphere, and the list against all pairs."""
    rough = points(200, 1.5, 4, sizes=sizes)
    results = []
    for compute in (forces_by_loop, forces_by_arrays):
        monkeypatch.setattr(contacts, "forces_by_loop", compute)
        found = MovingContacts(rough, history=False)
        sums = found.elastic_energy, found.mean_force, found.mean_stiffness, *found.virial
        results.append((found.load.copy(), found.stiffness.copy(), *sums, found.touching))
        # Two in the same place have no direction of contact, and no force.
        found.position[11] = found.position[10]
        found.touch()
        assert np.isfinite(found.load).all()
    for one, other in zip(*results, strict=True):
        largest = np.max(np.abs(other), initial=0)
        assert one == pytest.approx(other, rel=1e-12, abs=1e-12 * largest)
    assert results[0][-1] == len(rough.contacts().particle_i)


def test_log_normal_sizes_have_their_moments():
    """Mean ln R and its spread: quantiles at mid-steps miss 1 % of the variance at n = 1,000."""
    logarithm = np.log(radii_of(1000, ("lognormal", 0.25), seed=3))
    assert logarithm.std() == pytest.approx(0.25, rel=0.01)
    skew = ((logarithm - logarithm.mean()) ** 3).mean() / logarithm.std() ** 3
    assert abs(skew) < 1e-9
