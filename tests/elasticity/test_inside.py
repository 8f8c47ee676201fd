"""Moduli of a box inside a packing: crystals in closed form, a whole periodic packing, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from places import PACKINGS
from refusals import refusal

import modal
from modal.elasticity import box as box_module
from modal.elasticity import inside as inside_module
from modal.elasticity.box import Window, state_inside
from modal.elasticity.inside import SHEAR_FREE_OF_TURNS, moduli_inside
from modal.packing.network import Network
from modal.packing.state import stress_tensor
from modal.system.matrices import stiffness_matrix
from modal.theory.fcc import FccLattice

STRESS = 1e5
GAP_IN_DIAMETERS = 0.7
"""Distance of the faces of a box from the ends of the periods."""


@pytest.fixture(scope="module")
def crystal():
    """Return an FCC crystal of 11 diameters and more along each axis."""
    return modal.fcc(stress=STRESS, cells=(12, 12, 18), periodic_z=True)


@pytest.fixture(scope="module")
def beads():
    """Return 3,000 glass beads in three periods of 13 diameters, their springs taken for exact."""
    scan = modal.read(
        PACKINGS / "scan.csv.gz",
        pair="granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.5",
        stress=STRESS,
        tolerance=4e-5,
    )
    return replace(scan, study={})


def box_in(network: Network) -> np.ndarray:
    """Return the bounds of a box nearly as wide as the periods."""
    gap = GAP_IN_DIAMETERS * 2 * network.radius.mean()
    return np.column_stack([np.full(3, gap), network.cell_size - gap])


def without_periods(network: Network, box: np.ndarray) -> Network:
    """Return the packing without contacts through periods, as one with free surfaces."""
    across = (network.periods != 0).any(axis=1)
    return replace(network.with_contacts(~across), cell_periodic=np.zeros(3, bool), cell_shift=None)


def test_crystal_against_its_closed_form(crystal):
    """Compare stiffness, density and stress with theory; the soft ends leave 1 % of a lattice.

    The spheres of this crystal do not move beyond a strain, so that its faces change nothing.
    """
    theory = FccLattice(STRESS)
    whole = modal.elastic_moduli(crystal)
    box = box_in(crystal)
    measured = modal.elastic_moduli(crystal, inside=box)
    assert measured.region == "box"
    scale = np.linalg.norm(theory.stiffness)
    deviation = np.linalg.norm(measured.stiffness - theory.stiffness) / scale
    assert deviation < max(measured.error, 0.01)
    assert measured.density == pytest.approx(whole.density, rel=0.01)
    state = state_inside(crystal, box)
    assert state.stress == pytest.approx(stress_tensor(crystal), abs=0.01 * STRESS)
    assert state.coordination_number == pytest.approx(12, rel=1e-12)


def test_box_in_a_packing_with_free_surfaces_has_the_moduli_of_the_periodic_packing(beads):
    """Compare bulk and shear modulus, V_P and density with those of the whole periodic packing."""
    whole = modal.elastic_moduli(beads, tolerance=1e-3)
    box = box_in(beads)
    free = without_periods(beads, box)
    with refusal("not_periodic", "--inside"):
        modal.elastic_moduli(free)
    measured = modal.elastic_moduli(free, inside=box, tolerance=1e-3)
    assert 0.01 < measured.error < 0.15
    for name in ("bulk_modulus", "shear_modulus"):
        ratio = getattr(measured, name) / getattr(whole, name)
        assert abs(ratio - 1) < measured.error, name
    assert abs(measured.v_p / whole.v_p - 1) < measured.error / 2
    assert measured.density == pytest.approx(whole.density, rel=0.01)


def test_motion_is_that_of_a_dense_solution_with_rows_left_out(monkeypatch):
    """Solve K u = -K u_affine for the spheres inside a box by numpy; those outside follow."""
    monkeypatch.setattr(box_module, "MIN_SIDE_IN_DIAMETERS", 5.0)
    monkeypatch.setattr(inside_module, "MARGINS_IN_DIAMETERS", (0.5, 1.0))
    crystal = modal.fcc(stress=STRESS, cells=(8, 8, 12), periodic_z=True)
    rng = np.random.default_rng(3)
    weaker = rng.uniform(0.5, 1.0, crystal.n_contacts)
    network = replace(
        crystal,
        stiffness_normal=weaker * crystal.stiffness_normal,
        stiffness_tangential=weaker * crystal.stiffness_tangential,
    )
    middle = network.cell_size / 2
    half = 2.6 * 2 * network.radius.mean()
    box = np.column_stack([middle - half, middle + half])
    found = moduli_inside(network, box, 1e-10, None)
    cut = found.system.network
    rows = np.flatnonzero(cut.free_motions)
    inside = ~cut.held
    affine = np.zeros((6, cut.n_particles, 6))
    for case, gradient in enumerate(SHEAR_FREE_OF_TURNS.gradient):
        affine[case, :, :3] = (cut.position - middle) @ gradient.T
    free = replace(cut, fixed=None)
    K = stiffness_matrix(free).tocsr()[rows]
    reached = np.unique(K.indices)
    affine = affine.reshape(6, -1).T
    far = ~np.isin(np.arange(cut.n_particles), np.unique(reached // 6))
    assert not (far & inside).any()
    expected = np.linalg.solve(K[:, rows].toarray(), -(K @ affine))
    scale = abs(expected).max()
    np.testing.assert_allclose(found.motion[rows], expected, atol=1e-7 * scale)
    assert not found.motion.reshape(-1, 6, 6)[cut.held].any()


def test_windows_have_the_mean_weight_of_lines():
    """Compare the volume and the mean over lines with sums over many points."""
    window = Window(np.array([0.0, 1.0, 2.0]), np.array([8.0, 9.0, 12.0]), 2.0)
    rng = np.random.default_rng(1)
    axes = [np.linspace(*ends, 61)[:-1] for ends in zip(window.low, window.high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    box = (window.high - window.low).prod()
    assert window.weight(grid).mean() * box == pytest.approx(window.volume, rel=1e-3)
    start = rng.uniform(-1, 13, (20, 3))
    branch = rng.normal(size=(20, 3)) / 2
    along = (np.arange(500) + 0.5)[:, None, None] / 500
    points = start + along * branch
    means = window.weight(points.reshape(-1, 3)).reshape(500, -1).mean(axis=0)
    np.testing.assert_allclose(window.mean_weight(start, branch), means, atol=1e-4)


def test_boxes_without_spheres_around_them_are_refused(crystal):
    box = box_in(crystal)
    wide = box.copy()
    wide[0] = -1.0, 1.0
    low = box.copy()
    low[2, 1] = low[2, 0] + 9 * 2 * crystal.radius.mean()
    walled = modal.fcc(stress=STRESS, cells=(12, 12, 18))
    at_wall = box_in(walled)
    at_wall[2] = 0.0, walled.length
    cases = {
        "box": (crystal, [1.0, 2.0]),
        "small_box": (crystal, low),
        "box_in_period": (crystal, wide),
        "box_at_wall": (walled, at_wall),
        "box_at_surface": (without_periods(crystal, box), wide),
    }
    for code, (network, bounds) in cases.items():
        with refusal(code):
            modal.elastic_moduli(network, inside=bounds)
    with refusal("pre_stress"):
        modal.elastic_moduli(crystal, inside=box, pre_stress="normal")
