"""Tests of the tangent with pre-stress: law of moving contacts, YADE, invariances."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from in_yade import measured_tangent, script
from oracles import asymmetry
from packings import random_sample, sheared
from places import ROOT, SHEARED

from modal.dem.contacts import MovingContacts
from modal.packing import crystal as gallery
from modal.packing.sample import read_sample
from modal.packing.state import net_forces
from modal.system.assembly import stiffness_matrix


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
    """Return minus the central difference of the law's forces over `step`, m."""
    size = 6 * len(sample.position)
    K = np.empty((size, size))
    for column in range(size):
        loads = []
        for displacement in (step, -step):
            contacts = MovingContacts(sample)
            motion = np.zeros(size)
            motion[column] = displacement if column % 6 < 3 else displacement / sample.radius
            contacts.move(motion.reshape(-1, 6))
            loads.append(contacts.load.ravel())
        K[:, column] = (loads[0] - loads[1]) / (2 * motion[column])
    return K


def in_arcs(K, sample):
    """Return K with rotations as arcs of a radius: all entries are N/m."""
    units = np.tile([1.0] * 3 + [1 / sample.radius] * 3, len(sample.position))
    return units[:, None] * K * units


def test_tangent_equals_finite_differences_at_second_order(loaded):
    """Compare the tangent of all forces, and of normal ones alone where no contact shears."""
    overlap, network = np.median(loaded.contacts().overlap), loaded.network()
    K = in_arcs(stiffness_matrix(network, pre_stress="full").toarray(), loaded)
    errors = [
        abs(in_arcs(numerical_tangent(loaded, share * overlap), loaded) - K).max() / abs(K).max()
        for share in (1e-2, 5e-3)
    ]
    assert errors[1] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)
    for kind in ("none", "normal"):
        other = in_arcs(stiffness_matrix(network, pre_stress=kind).toarray(), loaded)
        assert abs(other - K).max() > 10 * errors[0] * abs(K).max()
    bare = replace(loaded, shear=0 * loaded.shear)
    K = in_arcs(stiffness_matrix(bare.network(), pre_stress="normal").toarray(), bare)
    assert (
        abs(in_arcs(numerical_tangent(bare, 5e-3 * overlap), bare) - K).max()
        < errors[0] * abs(K).max()
    )
    assert abs(K - K.T).max() < 1e-14 * abs(K).max()


def test_a_turned_packing_carries_its_forces_along(loaded):
    """Rotate rigidly by a small angle: every force and torque turns; a shift changes none."""
    network = loaded.network()
    inside = network.with_contacts(~network.with_wall & (network.cell_shift == 0).all(axis=1))
    K, angle = stiffness_matrix(inside, pre_stress="full"), np.array([0.3, -0.5, 0.7])
    spins = np.tile(angle, (network.n_particles, 1))
    motion = np.hstack([np.cross(angle, network.position), spins])
    load = net_forces(inside)
    turned = np.hstack([np.cross(angle, load[:, :3]), np.cross(angle, load[:, 3:])])
    assert -(K @ motion.ravel()) == pytest.approx(turned.ravel(), abs=1e-13 * abs(K).max())
    shifted = np.tile([1.0, 2.0, 3.0, 0, 0, 0], network.n_particles)
    assert abs(K @ shifted).max() < 1e-13 * abs(K).max()


def test_crystal_without_shear_forces_stays_symmetric():
    network = gallery.fcc(cells=(2, 2, 5))
    normal, full = (stiffness_matrix(network, pre_stress=kind) for kind in ("normal", "full"))
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
    sample, network = read_sample(SHEARED), sheared()
    # Rotations times the radius are displacements: then all entries are N/m.
    measured, units = measured_tangent(out, network, sample.radius)
    apart = {}
    for kind in ("none", "normal", "full"):
        K = units @ stiffness_matrix(network, pre_stress=kind) @ units
        apart[kind] = abs(measured - K).max() / abs(K).max()
    columns = sp.linalg.norm(measured - K, axis=0) / sp.linalg.norm(K, axis=0).clip(1e-99)
    # (h / overlap)^2 / 24 and eps R / h of the script's step h, for the average contact; a weak
    # contact with a tenth of its overlap has a hundred times the first.
    assert apart["full"] < 2e-8
    assert columns.max() < 1e-6
    # Each term of the pre-stress is seen: overlap / R and friction times that.
    assert apart["none"] > 1e-4
    assert 1e-5 < apart["normal"] < apart["none"]
