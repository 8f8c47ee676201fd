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


def test_contacts_with_a_wall_are_exported(tmp_path, yade):
    path = tmp_path / "a.network.h5"
    script(SCENE, ROOT, path, tmp_path / "k.h5", "wall", folder=tmp_path)
    network = read_network(path)
    assert network.n_particles == 11
    assert network.n_contacts == 31
    assert network.with_wall.sum() == 11


def test_a_clump_is_its_members_as_one_body(tmp_path, yade):
    """Compare mass, centre, tensor and stiffness J^T K J of three spheres of two sizes that touch.

    J takes the motion (u, theta) of a body to that of its members, u + theta x arm and theta, and
    K is that of the spheres without the contacts inside the clump.
    """
    files = tmp_path / "a.network.h5", tmp_path / "b.network.h5"
    script(SCENE, ROOT, *files, "clump", folder=tmp_path)
    clump, spheres = map(read_network, files)
    members, apart = [0, 9, 10], np.arange(1, 9)
    body = np.full(11, -1)
    body[members], body[apart] = 0, apart
    mass, place = spheres.mass[members], spheres.position[members]
    centre = mass @ place / mass.sum()
    arm = place - centre
    tensor = sum(
        (0.4 * m * r**2 + m * (a @ a)) * np.eye(3) - m * np.outer(a, a)
        for m, r, a in zip(mass, spheres.radius[members], arm, strict=True)
    )
    np.testing.assert_allclose(clump.mass[0], mass.sum(), rtol=1e-12)
    np.testing.assert_allclose(clump.position[0], centre, rtol=0, atol=1e-15)
    # YADE keeps three moments and an orientation.
    scale = 1e-9 * np.trace(tensor)
    np.testing.assert_allclose(clump.inertia_tensor[0], tensor, rtol=0, atol=scale)
    np.testing.assert_array_equal(clump.mass[1:], spheres.mass[apart])
    np.testing.assert_array_equal(clump.position[1:], spheres.position[apart])

    J = np.zeros((66, 54))
    for k in range(11):
        at = arm[members.index(k)] if k in members else np.zeros(3)
        J[6 * k : 6 * k + 6, 6 * body[k] : 6 * body[k] + 6] = np.eye(6)
        cross = [[0, at[2], -at[1]], [-at[2], 0, at[0]], [at[1], -at[0], 0]]
        J[6 * k : 6 * k + 3, 6 * body[k] + 3 : 6 * body[k] + 6] = cross
    inside = (body[spheres.particle_i] == 0) & (body[spheres.partner] == 0) & ~spheres.with_wall
    assert inside.sum() == 1 and clump.n_contacts == 30
    wanted = J.T @ stiffness_matrix(spheres.with_contacts(~inside)).toarray() @ J
    found = stiffness_matrix(clump).toarray()
    arcs = np.tile([1.0] * 3 + [1e3] * 3, 9)  # rotations as arcs of 1 mm
    off, size = (arcs[:, None] * each * arcs for each in (found - wanted, wanted))
    assert abs(off).max() < 1e-9 * abs(size).max()


def test_saved_scene_gives_the_same_network(tmp_path, yade):
    """Compare contacts and forces of a scene before and after it was saved and loaded."""
    first, saved, second = (tmp_path / k for k in ("a.network.h5", "s.yade.bz2", "b.network.h5"))
    script(SCENE, ROOT, first, saved, "save", folder=tmp_path)
    script(ROOT / "yade_scripts" / "export_scene.py", saved, second, folder=tmp_path)
    a, b = read_network(first), read_network(second)
    order = [np.lexsort((each.particle_j, each.particle_i)) for each in (a, b)]
    for name in ("stiffness_normal", "stiffness_tangential", "force_normal", "overlap"):
        one, two = (getattr(each, name)[rows] for each, rows in zip((a, b), order, strict=True))
        np.testing.assert_allclose(two, one, rtol=1e-9)


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
    held = json.loads(out.read_text())
    refused = {"half_held_clump", "moved", "turned_in_a_group", "strained"}
    assert held == EXPECTED | dict.fromkeys(refused, "held_bodies")


def test_a_column_between_fixed_spheres(tmp_path, yade):
    """Compare two masses and three springs kn: omega^2 = k / m and 3 k / m along z."""
    out = tmp_path / "a.network.h5"
    script(HELD, ROOT, out, "ends", folder=tmp_path)
    network = read_network(out)
    kn, mass = network.stiffness_normal[0], network.mass[0]
    frequency = modal.eigenmodes(network, all=True).frequency
    for square in (kn / mass, 3 * kn / mass):
        assert abs((2 * np.pi * frequency) ** 2 / square - 1).min() < 1e-9


def test_a_refusal_ends_a_users_script_with_one_line(tmp_path, yade):
    out = tmp_path / "a.network.h5"
    status, log = forked(tmp_path, [HELD, ROOT, out], {})
    assert status == 2
    assert len(error_lines(log)) == 1
    assert "Traceback" not in log
    assert not out.exists()
