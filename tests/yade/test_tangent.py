"""The tangent with pre-stress against an incremental force routine, YADE, and invariances."""

import numpy as np
import pytest
import scipy.sparse as sp
from in_yade import measured_tangent, script
from packings import asymmetry, contact_matrices, scaled
from places import ROOT

from modal.packing import crystal as gallery
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.sample import read_sample
from modal.system.assembly import stiffness_matrix
from modal.system.operator import ContactOperator
from modal.tools.errors import InputError

SAMPLE = ROOT / "tests" / "data" / "friction150.sample.h5"
"""150 spheres at 100 kPa, compressed with friction 0.4 in YADE and at rest."""


def loaded_contacts(seed: int = 0, pairs: int = 4) -> Network:
    """Pairs of unequal spheres, each pressed and sheared, the first of each on a wall.

    Hertz stiffness kn = 3 N / (2 overlap), as the oracle's law has it; overlaps of a tenth of a
    radius make the terms of the pre-stress large.
    """
    rng = np.random.default_rng(seed)
    n = 2 * pairs
    radius = rng.uniform(0.8, 1.5, n)
    i = np.concatenate([np.arange(0, n, 2)] * 2)
    j = np.concatenate([np.arange(1, n, 2), rng.choice([SOURCE_WALL, RECEIVER_WALL], pairs)])
    wall = j < 0
    normal = rng.standard_normal((n, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    normal[wall] = np.where(j[wall] == SOURCE_WALL, -1, 1)[:, None] * [0, 0, 1]
    overlap, force = rng.uniform(0.05, 0.15, n), rng.uniform(0.5, 1.5, n)
    shear = rng.standard_normal((n, 3))
    shear -= (shear * normal).sum(axis=1)[:, None] * normal
    position = rng.standard_normal((n, 3))
    reach = radius[i[~wall]] + radius[j[~wall]] - overlap[~wall]
    position[j[~wall]] = position[i[~wall]] + reach[:, None] * normal[~wall]
    lever_j = -(radius[np.maximum(j, 0)] - overlap / 2)[:, None] * normal
    return gallery.column(1).unchecked(
        position=position,
        radius=radius,
        mass=np.ones(n),
        inertia=np.ones(n),
        particle_i=i,
        particle_j=j,
        normal=normal,
        lever_i=(radius[i] - overlap / 2)[:, None] * normal,
        lever_j=np.where(wall[:, None], 0, lever_j),
        stiffness_normal=1.5 * force / overlap,
        stiffness_tangential=force / overlap,
        force_normal=force,
        force_tangential=0.4 * shear,
        overlap=overlap,
        sliding=np.zeros(n, bool),
        cell_shift=np.zeros((n, 3), int),
        cell_size=np.full(3, 10.0),
        cell_periodic=np.zeros(3, bool),
        wall_position=np.array([-5.0, 5.0]),
    )


def forces_after(network: Network, motion: np.ndarray, *, normal_only: bool = False) -> np.ndarray:
    """Forces and torques (n, 6) after one step of the incremental law; motion (n, 6).

    The law as a DEM code writes it: new normal, overlap and Hertz force; the shear force turned
    by the rotation of the normal and by the mean twist, then changed by the shear increment.
    """
    load = np.zeros((network.n_particles, 6))
    for c, (i, j) in enumerate(zip(network.particle_i, network.particle_j, strict=True)):
        n0, d0 = network.normal[c], network.overlap[c]
        u_i, turn_i = motion[i, :3], motion[i, 3:]
        u_j, turn_j = (motion[j, :3], motion[j, 3:]) if j >= 0 else (np.zeros(3), np.zeros(3))
        if j >= 0:
            branch = network.position[j] + u_j - network.position[i] - u_i
            n, overlap = branch / np.linalg.norm(branch), 0.0
            overlap = network.radius[i] + network.radius[j] - np.linalg.norm(branch)
            r_j = network.radius[j] - overlap / 2
        else:
            n, overlap, r_j = n0, d0 + n0 @ u_i, 0.0
        r_i = network.radius[i] - overlap / 2
        s = -network.force_tangential[c] * (0 if normal_only else 1)
        s = s - np.cross(s, np.cross(n0, n))
        s = s - np.cross(s, 0.5 * n @ (turn_i + turn_j) * n)
        slip = u_j - u_i - np.cross(turn_j, r_j * n) - np.cross(turn_i, r_i * n)
        s = s - network.stiffness_tangential[c] * (slip - (slip @ n) * n)
        force = -(network.force_normal[c] * (overlap / d0) ** 1.5 * n + s)
        load[i] += [*force, *np.cross(r_i * n, force)]
        if j >= 0:
            load[j] += [*-force, *np.cross(r_j * n, force)]
    return load


def numerical_tangent(network: Network, step: float, **options: bool) -> np.ndarray:
    """Minus the central difference of the forces, column by column."""
    size = 6 * network.n_particles
    K = np.empty((size, size))
    for column in range(size):
        motion = np.zeros(size)
        motion[column] = step
        ahead = forces_after(network, motion.reshape(-1, 6), **options)
        behind = forces_after(network, -motion.reshape(-1, 6), **options)
        K[:, column] = (behind - ahead).ravel() / (2 * step)
    return K


@pytest.mark.parametrize("seed", [0, 1])
def test_full_tangent_equals_finite_differences_at_second_order(seed):
    network = loaded_contacts(seed)
    K = stiffness_matrix(network, pre_stress="full").toarray()
    errors = [
        abs(numerical_tangent(network, step) - K).max() / abs(K).max() for step in (1e-3, 5e-4)
    ]
    assert errors[1] < 1e-4
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)
    springs = stiffness_matrix(network).toarray()
    assert abs(springs - K).max() > 1e-2 * abs(K).max()


def test_normal_pre_stress_is_the_tangent_without_shear_forces():
    network = loaded_contacts(2)
    K = stiffness_matrix(network, pre_stress="normal").toarray()
    found = numerical_tangent(network, 1e-4, normal_only=True)
    # Second order in the step: 1e-8 times derivatives of order 1 / overlap^2.
    assert abs(found - K).max() < 1e-5 * abs(K).max()
    assert abs(K - K.T).max() < 1e-14 * abs(K).max()


def test_a_turned_contact_carries_its_forces_along():
    """A rigid rotation by a small angle turns every force and torque of a pair with it."""
    network = loaded_contacts(3)
    pair = ~network.with_wall
    names = "stiffness_normal", "stiffness_tangential", "force_normal", "force_tangential"
    at_walls_none = {name: scaled(getattr(network, name), ~pair, 0.0) for name in names}
    network = network.unchecked(**at_walls_none)
    K = stiffness_matrix(network, pre_stress="full")
    angle = np.array([0.3, -0.5, 0.7])
    motion = np.hstack([np.cross(angle, network.position), np.tile(angle, (len(network.mass), 1))])
    load = forces_after(network, np.zeros(motion.shape))
    turned = np.hstack([np.cross(angle, load[:, :3]), np.cross(angle, load[:, 3:])])
    assert -(K @ motion.ravel()) == pytest.approx(turned.ravel(), abs=1e-13 * abs(K).max())
    shifted = np.tile([1.0, 2.0, 3.0, 0, 0, 0], len(network.mass))
    assert abs(K @ shifted).max() < 1e-13 * abs(K).max()


def test_crystal_without_shear_forces_stays_symmetric():
    network = gallery.fcc(cells=(2, 2, 5))
    normal, full = (stiffness_matrix(network, pre_stress=kind) for kind in ("normal", "full"))
    assert abs(normal - full).max() == 0
    # Round-off of the assembly alone.
    assert asymmetry(full) < 1e-15
    assert asymmetry(stiffness_matrix(loaded_contacts(), pre_stress="full")) > 1e-3
    # Relative size of the pre-stress: N / l over kn = overlap / (1.5 l).
    change = abs(normal - stiffness_matrix(network)).max() / network.stiffness_normal.max()
    assert change < 4 * network.overlap.max() / (1.5 * 2 * network.radius[0])


def test_every_column_equals_finite_differences_of_yades_forces(tmp_path, yade):
    """Motions of each of the 150 spheres along and about each axis, 900 columns."""
    out = tmp_path / "differences.h5"
    script(ROOT / "yade_scripts" / "tangent.py", SAMPLE, out, folder=tmp_path)
    sample = read_sample(SAMPLE)
    network = sample.network()
    # Rotations times the radius are displacements: then all entries are N/m.
    measured, units = measured_tangent(out, network, sample.radius)
    apart = {}
    for kind in ("none", "normal", "full"):
        K = units @ stiffness_matrix(network, pre_stress=kind) @ units
        apart[kind] = abs(measured - K).max() / abs(K).max()
        if kind == "full":
            columns = sp.linalg.norm(measured - K, axis=0) / sp.linalg.norm(K, axis=0).clip(1e-99)
    # (h / overlap)^2 / 24 and eps R / h of the script's step h, for the average contact; a weak
    # contact with a tenth of its overlap has a hundred times the first.
    assert apart["full"] < 2e-8
    assert columns.max() < 1e-6
    # Each term of the pre-stress is seen: overlap / R and friction times that.
    assert apart["none"] > 1e-4
    assert 1e-5 < apart["normal"] < apart["none"]


def test_unknown_pre_stress_is_refused():
    network = gallery.column(2)
    for refuse in (contact_matrices, lambda n, p: ContactOperator(n, pre_stress=p)):
        with pytest.raises(InputError, match="choose one of"):
            refuse(network, "some")
