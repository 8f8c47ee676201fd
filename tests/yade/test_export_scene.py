"""Tests of exported YADE scenes: two sizes, facets or a Wall, linear and cohesive laws, clumps."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from in_yade import error_lines, forked, measured_tangent, script
from places import ROOT

import modal
from modal.packing.network import read_network
from modal.system.assembly import stiffness_matrix

SCENE = ROOT / "tests" / "yade" / "two_sizes.py"


@pytest.mark.parametrize("kind", ["", "cohesive"])
def test_stiffness_equals_finite_differences_of_yades_forces(tmp_path, yade, kind):
    """Export eleven spheres of two radii between facets; kn and ks are those of FrictPhys.

    Cohesive-frictional contacts have the moment law: kr is 0.3 and ktw 0.7 times ks R R'. The
    steps of `yade_scripts/tangent.py` leave an error of 2e-8 of K.
    """
    network_path = tmp_path / "a.network.h5"
    tangent_path = tmp_path / "k.h5"
    options = [kind] if kind else []
    script(SCENE, ROOT, network_path, tangent_path, *options, folder=tmp_path)
    network = read_network(network_path)
    assert sorted(set(network.radius)) == [1e-3, 1.3e-3]
    assert network.with_wall.sum() == 11
    assert not network.cell_periodic.any()
    measured, units = measured_tangent(tangent_path, network, 1e-3)

    def relative_error(network, pre_stress):
        K = units @ stiffness_matrix(network, pre_stress=pre_stress) @ units
        return abs(measured - K).max() / abs(K).max()

    assert relative_error(network, "full") < 1e-7
    assert relative_error(network, "none") > 1e-3
    for name in ("stiffness_rolling", "stiffness_twisting"):
        assert (getattr(network, name) is None) == (kind == "")
        if kind:  # an error of a hundredth in one of them shows
            changed = replace(network, **{name: 1.01 * getattr(network, name)})
            assert relative_error(changed, "full") > 1e-5


def test_cohesive_contacts_pull_across_gaps(tmp_path, yade):
    """Compare with springs without a limit: the force is kn times the overlap, of either sign."""
    path = tmp_path / "a.network.h5"
    script(SCENE, ROOT, path, tmp_path / "k.h5", "pulled", folder=tmp_path)
    network = read_network(path)
    assert (network.overlap < 0).sum() == 3
    expected = network.stiffness_normal * network.overlap
    np.testing.assert_allclose(network.force_normal, expected, rtol=1e-12)


def test_contacts_with_a_wall_are_exported(tmp_path, yade):
    path = tmp_path / "a.network.h5"
    script(SCENE, ROOT, path, tmp_path / "k.h5", "wall", folder=tmp_path)
    network = read_network(path)
    assert network.n_particles == 11
    assert network.n_contacts == 31
    assert network.with_wall.sum() == 11


MEMBERS = [0, 9, 10]
"""Spheres of the clump, of two sizes, of which two touch."""


@pytest.fixture(scope="module")
def clump_scene(tmp_path_factory, yade):
    """Return the network of a scene with a clump, and that of its eleven spheres."""
    folder = tmp_path_factory.mktemp("clump")
    clump_path = folder / "a.network.h5"
    spheres_path = folder / "b.network.h5"
    script(SCENE, ROOT, clump_path, spheres_path, "clump", folder=folder)
    return read_network(clump_path), read_network(spheres_path)


def centre_and_arms(spheres):
    """Return the centre of mass (3,) of the clump and the positions (3, 3) of its members."""
    mass = spheres.mass[MEMBERS]
    position = spheres.position[MEMBERS]
    centre = mass @ position / mass.sum()
    return centre, position - centre


def test_mass_and_inertia_of_a_clump_are_those_of_its_members(clump_scene):
    clump, spheres = clump_scene
    centre, arms = centre_and_arms(spheres)
    mass = spheres.mass[MEMBERS]
    tensor = np.zeros((3, 3))
    for m, radius, arm in zip(mass, spheres.radius[MEMBERS], arms, strict=True):
        tensor += (0.4 * m * radius**2 + m * (arm @ arm)) * np.eye(3) - m * np.outer(arm, arm)
    np.testing.assert_allclose(clump.mass[0], mass.sum(), rtol=1e-12)
    np.testing.assert_allclose(clump.position[0], centre, rtol=0, atol=1e-15)
    # YADE keeps three moments and an orientation.
    tolerance = 1e-9 * np.trace(tensor)
    np.testing.assert_allclose(clump.inertia_tensor[0], tensor, rtol=0, atol=tolerance)


def test_spheres_outside_a_clump_stay(clump_scene):
    clump, spheres = clump_scene
    single = np.delete(np.arange(11), MEMBERS)
    np.testing.assert_array_equal(clump.mass[1:], spheres.mass[single])
    np.testing.assert_array_equal(clump.position[1:], spheres.position[single])


def motion_of_spheres(spheres):
    """Return the bodies (11,) of spheres, and J (66, 54) from motions of bodies to theirs.

    J takes the motion (u, theta) of a body to u + theta x arm and theta of its members.
    """
    body = np.zeros(11, int)
    body[np.delete(np.arange(11), MEMBERS)] = np.arange(1, 9)
    arm = np.zeros((11, 3))
    _, arm[MEMBERS] = centre_and_arms(spheres)
    J = np.zeros((66, 54))
    for k in range(11):
        x, y, z = arm[k]
        rows = slice(6 * k, 6 * k + 6)
        columns = slice(6 * body[k], 6 * body[k] + 6)
        J[rows, columns] = np.eye(6)
        J[6 * k : 6 * k + 3, 6 * body[k] + 3 : 6 * body[k] + 6] = [
            [0, z, -y],
            [-z, 0, x],
            [y, -x, 0],
        ]
    return body, J


def test_stiffness_of_a_clump_is_that_of_its_members(clump_scene):
    """Compare with J^T K J, without the contact inside the clump."""
    clump, spheres = clump_scene
    body, J = motion_of_spheres(spheres)
    inside = (body[spheres.particle_i] == 0) & (body[spheres.partner] == 0) & ~spheres.with_wall
    assert inside.sum() == 1
    assert clump.n_contacts == 30
    expected = J.T @ stiffness_matrix(spheres.with_contacts(~inside)).toarray() @ J
    # Rotations as arcs of 1 mm: then all entries are N/m.
    units = np.tile([1.0] * 3 + [1e3] * 3, 9)
    expected = units[:, None] * expected * units
    K = units[:, None] * stiffness_matrix(clump).toarray() * units
    assert abs(K - expected).max() < 1e-9 * abs(expected).max()


def in_order_of_bodies(network, name):
    """Return a column of contacts, sorted by their bodies."""
    return getattr(network, name)[np.lexsort((network.particle_j, network.particle_i))]


def test_saved_scene_gives_the_same_network(tmp_path, yade):
    """Compare contacts and forces of a scene before and after it was saved and loaded."""
    first = tmp_path / "a.network.h5"
    saved = tmp_path / "s.yade.bz2"
    second = tmp_path / "b.network.h5"
    script(SCENE, ROOT, first, saved, "save", folder=tmp_path)
    script(ROOT / "yade_scripts" / "export_scene.py", saved, second, folder=tmp_path)
    before = read_network(first)
    after = read_network(second)
    for name in ("stiffness_normal", "stiffness_tangential", "force_normal", "overlap"):
        expected = in_order_of_bodies(before, name)
        np.testing.assert_allclose(in_order_of_bodies(after, name), expected, rtol=1e-9)


HELD = ROOT / "tests" / "yade" / "held_spheres.py"
EXPECTED = {
    "fixed": "xyzXYZ - - -",
    "not_dynamic": "- - - xyzXYZ",
    "without_turns": "XYZ XYZ XYZ XYZ",
    "one_motion": "- - y -",
    "held_clump": "xyzXYZ - -",
    "outside_the_mask": "- xyzXYZ - -",
    "moved_and_blocked": "xyzXYZ - - -",
    "free_clump_of_a_fixed_sphere": "- - -",
    "moved_no_more": "- - - -",
    "on_a_wall": "- - - -",
}
"""Held motions of the bodies of each scene; a clump counts as one."""


def test_held_motions_of_scenes(tmp_path, yade):
    """Hold spheres wholly or in one motion, move them, or leave them out of the integration."""
    out = tmp_path / "held.json"
    script(HELD, ROOT, out, folder=tmp_path)
    held_motions = json.loads(out.read_text())
    refused = {"half_held_clump", "moved", "turned_in_a_group", "strained"}
    assert held_motions == EXPECTED | dict.fromkeys(refused, "held_bodies")


def test_a_column_between_fixed_spheres(tmp_path, yade):
    """Compare two masses and three springs kn: omega^2 = k / m and 3 k / m along z."""
    out = tmp_path / "a.network.h5"
    script(HELD, ROOT, out, "ends", folder=tmp_path)
    network = read_network(out)
    square = network.stiffness_normal[0] / network.mass[0]
    omega = 2 * np.pi * modal.eigenmodes(network, all=True).frequency
    assert abs(omega**2 / square - 1).min() < 1e-9
    assert abs(omega**2 / (3 * square) - 1).min() < 1e-9


def test_a_refusal_ends_a_users_script_with_one_line(tmp_path, yade):
    out = tmp_path / "a.network.h5"
    status, log = forked(tmp_path, [HELD, ROOT, out], {})
    assert status == 2
    assert len(error_lines(log)) == 1
    assert "Traceback" not in log
    assert not out.exists()
