"""Tests of the tangent with pre-stress: law of moving contacts, YADE, invariances."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from in_yade import error_lines, forked, measured_tangent, script
from oracles import asymmetry
from packings import random_sample, sheared
from places import ROOT, SHEARED

from modal.dem.contacts import MovingContacts
from modal.packing import crystal as gallery
from modal.packing.sample import read_sample, write_sample
from modal.packing.state import net_forces
from modal.system import matrices
from modal.system.assembly import stiffness_matrix

COLUMNS = slice(None, None, 5)
"""Columns of K by finite differences: all kinds of motion, of different spheres. The columns of all
motions are compared with YADE's forces below."""


@pytest.fixture(scope="module")
def loaded():
    """Return spheres of two sizes with overlaps of some per cent, sheared by a fifth of them.

    Large overlaps make the terms of the pre-stress large. They are not in balance.
    """
    sample = random_sample(24, 2e8, aspect=1.0, tolerance=1e-2, sizes=("two", 1.5, 0.5))
    contacts = MovingContacts(sample, np.inf)
    motion = np.random.default_rng(1).standard_normal(contacts.load.shape)
    motion[:, 3:] /= sample.radius
    contacts.move(0.2 * np.median(sample.contacts().overlap) * motion)
    return replace(contacts.sample(), friction=np.inf)


def numerical_tangent(sample, step):
    """Return minus the central differences of the law's forces over `step`, m, of `COLUMNS`."""
    size = 6 * len(sample.position)
    columns = np.arange(size)[COLUMNS]
    K = np.empty((size, len(columns)))
    for number, column in enumerate(columns):
        displacement = step if column % 6 < 3 else step / sample.radius
        loads = []
        for sign in (1, -1):
            contacts = MovingContacts(sample)
            motion = np.zeros(size)
            motion[column] = sign * displacement
            contacts.move(motion.reshape(-1, 6))
            loads.append(contacts.load.ravel())
        K[:, number] = (loads[1] - loads[0]) / (2 * displacement)
    return K


def in_arcs(K, sample):
    """Return columns of K with rotations as arcs of a radius: all entries are N/m."""
    units = np.tile([1.0] * 3 + [1 / sample.radius] * 3, len(sample.position))
    return units[:, None] * K * units[COLUMNS]


def tangent(sample, pre_stress):
    """Return the columns of the assembled tangent for the same motions."""
    K = stiffness_matrix(sample.network(), pre_stress=pre_stress).toarray()
    return in_arcs(K[:, COLUMNS], sample)


def largest_difference(columns, expected):
    """Return the largest difference divided by the largest entry."""
    return abs(columns - expected).max() / abs(expected).max()


def test_tangent_equals_finite_differences_at_second_order(loaded):
    """Find an error that falls with the square of the step, far below the terms of pre-stress."""
    overlap = np.median(loaded.contacts().overlap)
    expected = tangent(loaded, "full")
    errors = []
    for share in (1e-2, 5e-3):
        columns = in_arcs(numerical_tangent(loaded, share * overlap), loaded)
        errors.append(largest_difference(columns, expected))
    assert errors[1] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)
    for pre_stress in ("none", "normal"):
        assert largest_difference(tangent(loaded, pre_stress), expected) > 10 * errors[0]


def test_tangent_of_normal_forces_equals_finite_differences_without_shear(loaded):
    bare = replace(loaded, shear=0 * loaded.shear)
    step = 5e-3 * np.median(bare.contacts().overlap)
    expected = tangent(bare, "normal")
    # As large as with shear forces, 1e-3.
    assert largest_difference(in_arcs(numerical_tangent(bare, step), bare), expected) < 1e-3
    K = stiffness_matrix(bare.network(), pre_stress="normal")
    assert asymmetry(K) < 1e-14


def test_a_turned_packing_carries_its_forces_along(loaded):
    """Rotate rigidly by a small angle: every force and torque turns; a shift changes none."""
    network = loaded.network()
    inside = network.with_contacts(~network.with_wall & (network.cell_shift == 0).all(axis=1))
    K = stiffness_matrix(inside, pre_stress="full")
    angle = np.array([0.3, -0.5, 0.7])
    spins = np.tile(angle, (network.n_particles, 1))
    motion = np.hstack([np.cross(angle, network.position), spins])
    load = net_forces(inside)
    turned = np.hstack([np.cross(angle, load[:, :3]), np.cross(angle, load[:, 3:])])
    assert -(K @ motion.ravel()) == pytest.approx(turned.ravel(), abs=1e-13 * abs(K).max())
    shifted = np.tile([1.0, 2.0, 3.0, 0, 0, 0], network.n_particles)
    assert abs(K @ shifted).max() < 1e-13 * abs(K).max()


def test_crystal_without_shear_forces_stays_symmetric():
    network = gallery.fcc(cells=(2, 2, 5))
    normal = stiffness_matrix(network, pre_stress="normal")
    full = stiffness_matrix(network, pre_stress="full")
    assert abs(normal - full).max() == 0
    # Round-off of the assembly alone.
    assert asymmetry(full) < 1e-15
    assert asymmetry(stiffness_matrix(sheared(), pre_stress="full")) > 1e-6
    # Relative size of the pre-stress: N / l over kn = overlap / (1.5 l).
    change = abs(normal - stiffness_matrix(network)).max() / network.stiffness_normal.max()
    assert change < 4 * network.overlap.max() / (1.5 * 2 * network.radius[0])


def test_every_column_equals_finite_differences_of_yades_forces(tmp_path, yade):
    """Move each of the 150 spheres along and about each axis, 900 columns."""
    out = tmp_path / "differences.h5"
    script(ROOT / "yade_scripts" / "tangent.py", SHEARED, out, folder=tmp_path)
    sample = read_sample(SHEARED)
    network = sheared()
    # Rotations times the radius are displacements: then all entries are N/m.
    measured, units = measured_tangent(out, network, sample.radius)
    error = {}
    for kind in ("none", "normal", "full"):
        K = units @ stiffness_matrix(network, pre_stress=kind) @ units
        error[kind] = abs(measured - K).max() / abs(K).max()
    columns = sp.linalg.norm(measured - K, axis=0) / sp.linalg.norm(K, axis=0).clip(1e-99)
    # (h / overlap)^2 / 24 and eps R / h of the script's step h, for the average contact; a weak
    # contact with a tenth of its overlap has a hundred times the first.
    assert error["full"] < 2e-8
    assert columns.max() < 1e-6
    # Each term of the pre-stress is seen: overlap / R and friction times that.
    assert error["none"] > 1e-4
    assert 1e-5 < error["normal"] < error["none"]
    # Held bodies: one in five motions, of all kinds, has no row; the others have YADE's.
    held = np.random.default_rng(2).random((network.n_particles, 6)) < 0.2
    K = matrices.stiffness_matrix(replace(network, fixed=held), pre_stress="full")
    free = np.flatnonzero(~held.ravel())
    of_free = sp.diags(units.diagonal()[free])
    difference = measured[free][:, free] - of_free @ K @ of_free
    assert abs(difference).max() < 2e-8 * abs(of_free @ K @ of_free).max()


@pytest.mark.parametrize("kind", ["another contact model", "moments of contacts"])
def test_contacts_that_scenes_do_not_have_are_refused(kind, tmp_path, yade):
    """Refuse them in one line, with no product, rather than take YADE's law for theirs."""
    plain = replace(read_sample(SHEARED), shear=None)
    samples = {
        "another contact model": replace(
            plain, material=replace(plain.material, contact_model="linear")
        ),
        "moments of contacts": replace(plain, rolling=0.1),
    }
    path = tmp_path / "x.sample.h5"
    write_sample(path, samples[kind])
    program = ROOT / "yade_scripts/tangent.py"
    status, log = forked(tmp_path, [program, path, tmp_path / "out.h5"], {})
    assert status == 2
    assert len(error_lines(log)) == 1
    assert not (tmp_path / "out.h5").exists()
