"""Tests of frictionless packings: forces, descent, energy, stress and mixtures."""

import numpy as np
import pytest
from packings import random_sample

from modal.__main__ import main
from modal.dem import contacts
from modal.dem.contacts import MovingContacts
from modal.dem.forces import forces_by_loop
from modal.dem.forces_by_arrays import forces_by_arrays
from modal.packing.sample import read_sample
from modal.packing.state import net_forces, stress_tensor, void_ratio
from modal.packing.summary import summary
from modal.preparation import frictionless
from modal.preparation.cloud import make_cloud
from modal.preparation.frictionless import Descent, Pressure
from modal.preparation.mixture import MixtureWords
from modal.preparation.protocol import SettlingLimits, list_intermediate_stresses, name_stages
from modal.preparation.random_packing import sound_aspect, width_of
from modal.preparation.sizes import draw_radii
from modal.preparation.study import Study
from modal.tools.slabs import SLABS


def make_study(spheres, aspect, seed, **mixture):
    """Return the study of a packing without friction."""
    return Study(0.0, spheres, width_of(spheres, aspect), seed, **MixtureWords(**mixture).texts())


def make_points(spheres, aspect, seed, **mixture):
    """Return overlapping random spheres, from which a packing without friction begins."""
    return make_cloud(make_study(spheres, aspect, seed, **mixture))


@pytest.mark.two_ways
def test_forces_are_the_gradient_of_the_energy():
    """Compare with central differences of the energy along a random motion and each length."""
    sample = make_points(200, 2.0, 3)
    start = MovingContacts(sample, history=False)

    def energy_change(change):
        """Return the energy after a change minus the energy after the opposite change."""
        energies = []
        for sign in (-1, 1):
            contacts = MovingContacts(sample, history=False)
            change(contacts, sign)
            contacts.touch()
            energies.append(contacts.elastic_energy)
        return energies[1] - energies[0]

    motion = np.random.default_rng(4).standard_normal((200, 3))
    step = 1e-6 * sample.radius

    def move(contacts, sign):
        contacts.position += sign * step * motion

    def stretch(contacts, sign):
        factor = np.where(np.arange(3) == axis, (1 + 1e-6) ** sign, 1.0)
        contacts.position *= factor
        contacts.side *= factor[:2]
        contacts.walls *= factor[2]

    # Error of order (step / overlap)^2 and of the round-off of the energy over the step.
    work = (start.load * motion).sum()
    assert energy_change(move) / (2 * step) == pytest.approx(-work, rel=1e-5, abs=0)
    for axis in range(3):
        # The walls move with the length, so their work is part of the virial.
        slope = energy_change(stretch) / (2 * np.log1p(1e-6))
        assert slope == pytest.approx(-start.virial[axis], rel=1e-5)


@pytest.mark.two_ways
def test_minimum_has_the_stress_and_lower_enthalpy():
    study = make_study(150, 1.5, 5)
    pressure = 1e7
    start = make_cloud(study)

    def enthalpy(sample):
        contacts = MovingContacts(sample, history=False)
        return contacts.elastic_energy + pressure * contacts.lengths.prod()

    stage = Pressure(f"{pressure:g}", study)
    stage.limits = SettlingLimits(stress_error=1e-3, residual=1e-5)
    motion = Descent(start, stage)
    enthalpies = [enthalpy(start)]
    for _ in range(1000):
        motion.advance(25, 1.0, 1)
        enthalpies.append(enthalpy(motion.sample(moving=False)))
        if stage.settled(motion.unbalanced()):
            break
    packed = motion.sample(moving=False)
    assert motion.unbalanced() < 1e-5
    # What is left of it comes and goes with the velocities: residual times overlap, some 1e-7.
    lowest = min(enthalpies)
    assert enthalpies[-1] < lowest + 1e-6 * (enthalpies[0] - lowest) < enthalpies[0]
    network = packed.network()
    assert np.diag(stress_tensor(network)) == pytest.approx([pressure] * 3, rel=1e-3)
    for code in (-1, -2):
        on_wall = network.force_normal[network.particle_j == code].sum()
        # Walls and contacts carry the same stress, as far as the spheres are in balance.
        assert on_wall / packed.side.prod() == pytest.approx(pressure, rel=2e-3)
    inside = (packed.position[:, 2] > 0) & (packed.position[:, 2] < packed.walls[1])
    assert inside.all()
    assert (packed.position[:, :2] < packed.side).all()


@pytest.mark.parametrize("spheres", [37, 6000])
def test_compiled_steps_of_a_descent_are_those_of_numpy(spheres):
    """Compare sums, with threads and without, and one motion, to round-off."""
    velocity, force, position = np.random.default_rng(spheres).standard_normal((3, spheres, 3))
    compiled_sums, array_sums = np.zeros((2, SLABS, 5))
    frictionless.sums_by_loop(velocity, force, compiled_sums)
    frictionless.sums_by_arrays(velocity, force, array_sums)
    # A sum of products of either sign: its size is sqrt(3 n) times that of one.
    expected = pytest.approx(array_sums[:, :3].sum(axis=0), rel=1e-12, abs=1e-12 * spheres)
    assert compiled_sums[:, :3].sum(axis=0) == expected
    assert np.array_equal(compiled_sums[:, 3:].max(axis=0), array_sums[:, 3:].max(axis=0))
    results = []
    for descend in (frictionless.descend_by_loop, frictionless.descend_by_arrays):
        moved_position = position.copy()
        moved_velocity = velocity.copy()
        step = frictionless.DescentStep(0.9, 0.2, np.array([1.1, 1.0, 0.8]), 0.3)
        descend(moved_position, moved_velocity, force, step)
        results.append(np.hstack([moved_position, moved_velocity]))
    assert results[0] == pytest.approx(results[1], rel=1e-13, abs=1e-14)


def test_packings_are_isostatic_or_denser_and_uncrystallised():
    """Count six contacts per sphere but for rattlers; a crystal would have a void ratio of 0.35."""
    sample = random_sample(300, 1e6, seed=9, aspect=2.0, tolerance=1e-3)
    network = sample.network()
    touching = np.bincount(network.particle_i, minlength=300)
    touching += np.bincount(network.particle_j[~network.with_wall], minlength=300)
    is_held = touching >= 4
    assert touching[is_held].mean() > 5.8
    assert is_held.mean() > 0.9
    # Random close packing has e 0.56; walls a few diameters apart add some hundredths.
    properties = summary(network)
    assert 0.48 < properties["void_ratio"] < 0.64
    # Isotropic: a third along each axis; 900 normals scatter by 0.3 / sqrt(900).
    assert properties["fabric_diagonal"] == pytest.approx([1 / 3] * 3, abs=0.03)
    # Contacts and both walls bear the pressure, to some times the tolerance of 1e-3.
    assert properties["stress_pa"] == pytest.approx([1e6] * 3, rel=5e-3)
    assert properties["wall_stress_pa"] == pytest.approx([1e6] * 2, rel=5e-3)


def test_higher_peak_leaves_a_denser_packing(tmp_path):
    """Compare void ratios at one stress after two peaks."""
    command = ["pack", "--spheres", "300", "--aspect", "2", "--stress", "1e6", "--peak"]
    voids = []
    for peak in ("1e7", "3e8"):
        assert main([*command, peak, "-o", str(tmp_path / peak)]) == 0
        study = read_sample(tmp_path / peak / "1e+06Pa.sample.h5").study
        assert study["peak"] == float(peak)
        assert study["settled"]
        voids.append(study["void_ratio"])
    assert voids[1] < voids[0] - 0.005


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("stresses", [[1e3], [1e6, 1e7], [1e5, 3e6]])
def test_a_path_goes_by_stresses_at_most_ten_times_apart(friction, stresses):
    """Check the stresses of the stages, and that no two stages have one name."""
    names = name_stages(Study(friction, 200, 4.5), stresses)
    assert len(set(names)) == len(names)
    stress_names = [name for name in names if name[0].isdigit()]
    assert [float(name) for name in stress_names if " " not in name] == stresses
    path = [1e4 if friction else 2e8]
    path += [float(name.split()[0]) for name in stress_names]
    ratios = np.array(path[1:]) / path[:-1]
    assert (ratios > 0.099).all()
    assert (ratios < 10.1).all()
    assert list_intermediate_stresses(1e4, 5e5) == [1e5]


@pytest.mark.parametrize("spheres", [300, 2000, 20_000, 35_201])
def test_default_shape_is_sound_for_any_number(spheres):
    """Check the width at the densest random packing, 0.64: 8 diameters, or a cube."""
    aspect = sound_aspect(spheres)
    width = (spheres * np.pi / 6 / 0.64 / aspect) ** (1 / 3)
    assert width >= 8 or aspect == 1
    assert aspect == pytest.approx(10.05) if spheres > 7500 else width < 8.5


@pytest.mark.parametrize("sizes", [("lognormal", 0.3), ("two", 2, 0.5)])
def test_mixtures_come_to_rest_and_keep_their_sizes(sizes):
    """Compute balance, stress and void ratio from the sums of the network."""
    sample = random_sample(120, stress=1e6, seed=2, aspect=1.5, tolerance=1e-4, sizes=sizes)
    radii = draw_radii(120, sizes, seed=2)
    np.testing.assert_array_equal(sample.radii, radii)
    network = sample.network()
    mean = network.force_normal.mean()
    net = np.linalg.norm(net_forces(network)[:, :3], axis=1)
    # Twice the residual at which the descent stopped.
    assert net.mean() < 2e-4 * mean
    np.testing.assert_allclose(np.diag(stress_tensor(network)), 1e6, rtol=2e-3)
    assert void_ratio(network) == pytest.approx(network.study["void_ratio"], rel=1e-12)


@pytest.mark.parametrize("sizes", [None, ("lognormal", 0.4)])
def test_loop_and_arrays_agree(sizes, monkeypatch):
    """Compare the compiled loop with numpy, sphere by sphere, and the list with all pairs."""
    sample = make_points(200, 1.5, 4, sizes=sizes)
    results = []
    for compute_forces in (forces_by_loop, forces_by_arrays):
        monkeypatch.setattr(contacts, "forces_by_loop", compute_forces)
        moving = MovingContacts(sample, history=False)
        sums = moving.elastic_energy, moving.mean_force, moving.mean_stiffness, *moving.virial
        results.append((moving.load.copy(), moving.stiffness.copy(), *sums, moving.touching))
        # Two spheres in one place have no direction of contact, and no force.
        moving.position[11] = moving.position[10]
        moving.touch()
        assert np.isfinite(moving.load).all()
    for compiled, expected in zip(*results, strict=True):
        largest = np.max(np.abs(expected), initial=0)
        assert compiled == pytest.approx(expected, rel=1e-12, abs=1e-12 * largest)
    assert results[0][-1] == len(sample.contacts().particle_i)


def test_log_normal_sizes_have_their_moments():
    """Check the spread and skew of ln R: quantiles at mid-steps miss 1 % of the variance."""
    logarithm = np.log(draw_radii(1000, ("lognormal", 0.25), seed=3))
    assert logarithm.std() == pytest.approx(0.25, rel=0.01)
    skew = ((logarithm - logarithm.mean()) ** 3).mean() / logarithm.std() ** 3
    assert abs(skew) < 1e-9
