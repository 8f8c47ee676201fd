"""Tests of VTK files of spheres and contacts that YADE has written, against its own network."""

import json

import numpy as np
import pytest
from places import DATA
from refusals import refusal

import modal
from modal.exchange.registry import import_packing
from modal.packing.state import stress_tensor
from modal.packing.weight import gravity_of, unbalanced_forces

pytest.importorskip("vtkmodules")
YADE = DATA / "yade"
LAW = "hertz/material 1e9 0 0.2 tangential mindlin NULL 0 0.3"
"""The law of `yade_sheared`, in the words of LAMMPS."""


@pytest.fixture(scope="module")
def sheared():
    """Return the network of the sheared cell, as YADE holds it."""
    return modal.read(YADE / "yade_sheared.network.h5")


def cell_of(network):
    """Return the options that describe the cell of a network, with periods along all axes."""
    vectors = network.cell_vectors
    sides = np.diag(vectors)
    cell = np.column_stack([np.zeros(3), sides]).ravel()
    tilt = (vectors[1, 0], vectors[2, 0], vectors[2, 1])
    return {"cell": tuple(cell), "periodic": "xyz", "tilt": tilt}


def pairs_of(network):
    """Return the pairs of spheres in contact, sorted."""
    ends = np.column_stack([network.particle_i, network.partner])
    return np.sort(ends, axis=1)[np.lexsort(np.sort(ends, axis=1).T[::-1])]


def test_stress_of_a_sheared_cell_is_that_of_yade(sheared):
    """Compare with YADE's getStress, which is negative in compression.

    Both sum force times branch over all contacts.
    """
    expected = -np.array(json.loads((YADE / "yade_sheared.json").read_text())["stress"])
    assert abs(expected[0, 2]) > 1e5
    np.testing.assert_allclose(stress_tensor(sheared), expected, rtol=1e-9)


def test_positions_and_the_law_give_the_contacts_that_yade_has(sheared):
    """Compare overlaps of 4e-5 m, which six digits of VTKExporter give to 1e-9 m."""
    options = cell_of(sheared) | {"pair": LAW}
    result = import_packing(YADE / "yade_sheared.spheres.vtk", **options)
    # Contacts below the last digit may be lost.
    assert abs(result.network.n_contacts - sheared.n_contacts) <= 2
    total = sheared.stiffness_normal.sum()
    assert result.network.stiffness_normal.sum() == pytest.approx(total, rel=1e-3)
    assert result.network.cell_vectors is not None


def test_contacts_of_a_file_have_its_stiffnesses(sheared):
    """Compare kn and ks of each contact with YADE's, in six digits; no law is needed."""
    options = cell_of(sheared) | {"contacts": YADE / "yade_sheared.contacts.vtk"}
    network = import_packing(YADE / "yade_sheared.spheres.vtk", **options).network
    assert np.array_equal(pairs_of(network), pairs_of(sheared))
    for name in ("stiffness_normal", "stiffness_tangential", "force_normal"):
        own = np.sort(getattr(network, name))
        np.testing.assert_allclose(own, np.sort(getattr(sheared, name)), rtol=2e-5)
    expected = modal.elastic_moduli(sheared)
    moduli = modal.elastic_moduli(network)
    assert moduli.bulk_modulus == pytest.approx(expected.bulk_modulus, rel=1e-4)
    assert moduli.shear_modulus == pytest.approx(expected.shear_modulus, rel=1e-4)


def test_forces_of_other_lines_are_refused(sheared):
    """Refuse lines without contacts through a period, whose forces VTKRecorder lists."""
    options = cell_of(sheared) | {"pair": LAW, "contacts": YADE / "yade_sheared-intrs.vtp"}
    with refusal("shuffled_forces"):
        import_packing(YADE / "yade_sheared-spheres.vtu", **options)


@pytest.mark.parametrize(
    ("spheres", "contacts", "lines_to_walls"),
    [
        ("yade_pyramid.spheres.vtk", "yade_pyramid.contacts.vtk", True),
        ("yade_pyramid-spheres.vtu", "yade_pyramid-intrs.vtp", False),
    ],
)
def test_a_pyramid_on_a_wall(spheres, contacts, lines_to_walls):
    """Leave out lines to the wall, which VTKExporter draws; --wall makes these contacts."""
    expected = modal.read(YADE / "yade_pyramid.network.h5")
    law = "hertz/material 1e7 0 0.2 tangential mindlin NULL 0 0.6"
    result = import_packing(
        YADE / spheres, contacts=YADE / contacts, pair=law, wall="zplane 0 NULL", density=2500
    )
    network = result.network
    assert any("where no sphere is" in text for text in result.remarks) == lines_to_walls
    between = ~network.with_wall
    own = np.sort(network.stiffness_normal[between])
    # YADE lists contacts between two fixed spheres, without a stiffness.
    moves = ~expected.with_wall & (expected.stiffness_normal > 0)
    known = np.sort(expected.stiffness_normal[moves])
    # By the forces, where single precision leaves few digits of the overlaps.
    np.testing.assert_allclose(own, known, rtol=1e-3)
    assert network.with_wall.sum() == 9


def test_gravity_of_a_scene_of_yade():
    """Find the five spheres that move in balance with their weight."""
    network = modal.read(YADE / "yade_pyramid.network.h5")
    assert gravity_of(network) == pytest.approx([0, 0, -9.81])
    assert unbalanced_forces(network).max() < 1e-3


def test_contacts_of_other_spheres_are_refused(sheared):
    with refusal("no_sphere"):
        import_packing(
            YADE / "yade_pyramid.spheres.vtk", contacts=YADE / "yade_sheared.contacts.vtk"
        )
    with refusal("no_contacts"):
        import_packing(
            YADE / "yade_sheared.spheres.vtk", contacts=YADE / "yade_sheared.spheres.vtk"
        )
