"""Any YADE scene as a network: two sizes, facets or a Wall, the linear law."""

import subprocess

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from places import ROOT

from modal.packing.network import read_network
from modal.system.assembly import stiffness_matrix

SCENE = ROOT / "tests" / "yade" / "two_sizes.py"


def in_yade(folder, script, *arguments):
    """Run a script inside YADE; its status and what it said."""
    command = ["yade", "-n", "-x", "-j1", str(script), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=300)
    return done.returncode, done.stdout + done.stderr


def test_stiffness_equals_finite_differences_of_yades_forces(tmp_path, yade):
    """Eleven spheres of two radii between facets; kn and ks as FrictPhys holds them.

    The steps of `yade_scripts/tangent.py` leave 2e-8 of K.
    """
    network, measured = tmp_path / "a.network.h5", tmp_path / "k.h5"
    status, said = in_yade(tmp_path, SCENE, ROOT, network, measured)
    assert status == 0, said
    found = read_network(network)
    assert sorted(set(found.radius)) == [1e-3, 1.3e-3]
    assert found.with_wall.sum() == 11 and not found.cell_periodic.any()
    size = 6 * found.n_particles
    with h5py.File(measured) as file:
        entries = file["value"][:], (file["row"][:], file["column"][:])
    # Rotations as arcs of 1 mm.
    units = sp.diags(np.tile([1, 1, 1] + [1e3] * 3, found.n_particles))
    measured = units @ sp.csr_matrix(entries, shape=(size, size)) @ units
    apart = {}
    for kind in ("none", "full"):
        K = units @ stiffness_matrix(found, pre_stress=kind) @ units
        apart[kind] = abs(measured - K).max() / abs(K).max()
    assert apart["full"] < 1e-6
    assert apart["none"] > 1e-3


@pytest.mark.parametrize(
    ("kind", "status", "said"),
    [
        ("wall", 0, "11 spheres, 31 contacts, 11 of them with walls"),
        ("clump", 2, "body 2 is, or is part of, a clump"),
    ],
)
def test_walls_come_in_and_clumps_do_not(tmp_path, yade, kind, status, said):
    network = tmp_path / "a.network.h5"
    found, text = in_yade(tmp_path, SCENE, ROOT, network, tmp_path / "k.h5", kind)
    assert found == status and said in text, text
    assert network.exists() == (status == 0)


def test_saved_scene_gives_the_same_network(tmp_path, yade):
    """A scene that is loaded again has the same spheres, contacts and forces."""
    first, saved, second = (tmp_path / k for k in ("a.network.h5", "s.yade.bz2", "b.network.h5"))
    status, said = in_yade(tmp_path, SCENE, ROOT, first, saved, "save")
    assert status == 0, said
    status, said = in_yade(tmp_path, ROOT / "yade_scripts" / "export_scene.py", saved, second)
    assert status == 0, said
    a, b = read_network(first), read_network(second)
    order = [np.lexsort((each.particle_j, each.particle_i)) for each in (a, b)]
    for name in ("stiffness_normal", "stiffness_tangential", "force_normal", "overlap"):
        one, two = (getattr(each, name)[rows] for each, rows in zip((a, b), order, strict=True))
        np.testing.assert_allclose(two, one, rtol=1e-9)
