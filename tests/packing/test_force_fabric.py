"""Tests of the anisotropy of contacts and forces, and of constants of cross-anisotropy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import modal
from modal.elasticity.cross_anisotropy import about_z, constants_of, cross_anisotropy
from modal.packing.force_fabric import fabric_of_forces, force_fabric, size_of
from modal.packing.state import stress_tensor

AXIAL = np.diag([-0.5, -0.5, 1.0])


def directions(number):
    """Return evenly spread unit vectors (m, 3) on the spiral of the golden angle."""
    k = np.arange(number) + 0.5
    z = 1 - 2 * k / number
    angle = np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), z])


def deviatoric_ratio(stress):
    """Return the deviator of a stress tensor divided by its mean."""
    mean = np.trace(stress) / 3
    return (stress - mean * np.eye(3)) / mean


def test_tensors_and_identity_of_contacts_with_known_anisotropy():
    """Thin out even directions by E(n), and put on forces of known tensors.

    The rest is of second order, a few times 0.1^2.
    """
    a_c = 0.1
    a_n = 0.12
    a_t = 0.06
    normal = directions(200_000)
    along = np.einsum("ci,ij,cj->c", normal, AXIAL, normal)
    # Choose contacts with this density; multiples of sqrt(2) fill the interval evenly.
    density = (1 + a_c * along) / (1 + a_c)
    chosen = (np.arange(len(normal)) * 2**0.5) % 1 < density
    normal = normal[chosen]
    along = along[chosen]
    force = 2.0 * (1 + a_n * along)
    shear = 2.0 * a_t * (normal @ AXIAL - normal * along[:, None])
    fabric = fabric_of_forces(normal, force, shear)
    assert fabric.contacts == pytest.approx(a_c * AXIAL, abs=2e-3)
    assert fabric.normal_forces == pytest.approx(a_n * AXIAL, abs=2e-3)
    assert fabric.shear_forces == pytest.approx(a_t * AXIAL, abs=2e-3)
    assert fabric.mean_force == pytest.approx(2.0, rel=1e-3)
    ratio = deviatoric_ratio(np.einsum("ci,cj->ij", force[:, None] * normal + shear, normal))
    assert fabric.stress_ratio == pytest.approx(ratio, abs=0.01)


def test_size_of_an_axial_tensor():
    assert size_of(AXIAL) == pytest.approx(1.5, rel=1e-12)
    assert size_of(-AXIAL) == -size_of(AXIAL)


def test_identity_gives_the_stress_of_a_packing():
    """Compare without friction and under equal stresses, where both sides are small.

    Walls order few contacts.
    """
    packing = modal.random_packing(300, seed=1, aspect=1.0, periodic=True)
    fabric = force_fabric(packing)
    ratio = deviatoric_ratio(stress_tensor(packing))
    assert abs(fabric.stress_ratio - ratio).max() < 0.03
    assert abs(fabric.shear_forces).max() == 0


def cross_anisotropic(young_v, young_h, poisson_vh, poisson_hh, shear_vh):
    """Return the stiffness (6, 6) by the compliance in engineering constants."""
    s = np.diag([1 / young_h, 1 / young_h, 1 / young_v, 1 / shear_vh, 1 / shear_vh, 0.0])
    s[5, 5] = 2 * (1 + poisson_hh) / young_h
    s[0, 1] = s[1, 0] = -poisson_hh / young_h
    s[:2, 2] = s[2, :2] = -poisson_vh / young_v
    return np.linalg.inv(s)


def test_constants_are_those_of_which_a_stiffness_is_made():
    expected = (3e8, 2e8, 0.22, 0.15, 1.1e8)
    constants = constants_of(cross_anisotropic(*expected))
    assert [constant.value for constant in constants] == pytest.approx(expected, rel=1e-10)
    assert [constant.error for constant in constants] == pytest.approx([0] * 5, abs=1e-6)


def test_errors_cover_what_chance_does_to_a_stiffness():
    """Disturb a stiffness by 2 % and compare both: errors hold most deviations."""
    expected = np.array([3e8, 2e8, 0.22, 0.15, 1.1e8])
    stiffness = cross_anisotropic(*expected)
    random = np.random.default_rng(3)
    inside = 0
    for _ in range(40):
        noise = random.standard_normal((6, 6)) * 0.01
        disturbed = stiffness + stiffness.max() * (noise + noise.T) / 2
        constants = constants_of(disturbed)
        errors = np.array([constant.error for constant in constants])
        values = np.array([constant.value for constant in constants])
        inside += int((abs(values - expected) < 3 * errors).sum())
    assert inside > 0.6 * 200


def test_mean_over_rotations_is_that_of_many_frames():
    """Turn the crystal's tensor by angles about z and average; the mean has the symmetry."""
    moduli = modal.elastic_moduli(modal.fcc(cells=(2, 2, 4), periodic_z=True))
    index = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
    tensor = moduli.stiffness[index[:, :, None, None], index]
    mean = np.zeros((3, 3, 3, 3))
    for angle in np.pi * np.arange(8) / 8:
        turn = Rotation.from_euler("z", angle).as_matrix()
        mean += np.einsum("ai,bj,ck,dl,ijkl->abcd", turn, turn, turn, turn, tensor) / 8
    first = np.array([0, 1, 2, 1, 2, 0])
    second = np.array([0, 1, 2, 2, 0, 1])
    expected = mean[first[:, None], second[:, None], first, second]
    assert about_z(moduli.stiffness) == pytest.approx(expected, abs=1e-9 * expected.max())
    assert cross_anisotropy(moduli).young_v.value > 0
