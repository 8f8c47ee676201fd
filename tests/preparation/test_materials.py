"""Tests of spheres of several densities and walls of other moduli: law, files, packings."""

from dataclasses import replace

import numpy as np
import pytest
from packings import random_sample
from refusals import refusal

import modal
from modal.__main__ import main
from modal.packing.checks import density_of
from modal.packing.contact_law import GLASS, RADIUS, Elasticity, Material
from modal.packing.sample import read_sample, sample_of_network, write_sample
from modal.packing.state import stress_tensor
from modal.packing.tiling import repeat_sample
from modal.preparation.durations import inertial_time
from modal.preparation.study import Study

STEEL = (2.1e11, 0.3)
MIXTURE = {"sizes": ("two", 2, 0.5), "densities": (2500, 7800), "walls": STEEL}


@pytest.fixture(scope="module")
def mixed():
    """Return large spheres of steel's density among small ones of glass's, between steel walls."""
    return random_sample(120, 1e6, seed=2, aspect=1.5, **MIXTURE)


def test_moduli_of_two_materials_are_the_textbooks():
    """Compare with Johnson, Contact Mechanics (1985), 4.5 and 7.3.

    1/E* = (1 - nu^2)/E + ..., 1/G* = (2 - nu)/G + ...
    """
    steel = Elasticity(*STEEL)
    compliance = 0.0
    slip = 0.0
    for material in (GLASS, steel):
        shear_modulus = material.young / 2 / (1 + material.poisson)
        compliance += (1 - material.poisson**2) / material.young
        slip += (2 - material.poisson) / shear_modulus
    pair = GLASS.against(steel)
    assert pair.effective_young == pytest.approx(1 / compliance, rel=1e-14)
    assert pair.effective_shear == pytest.approx(1 / slip, rel=1e-14)
    assert pair == pytest.approx(steel.against(GLASS), rel=1e-14)


def test_moduli_of_one_material_are_its_own():
    assert GLASS.against(Elasticity(GLASS.young, GLASS.poisson)) == GLASS.moduli


def test_moduli_against_a_rigid_body_are_doubled():
    rigid = GLASS.against(Elasticity(1e20, 0.2))
    assert rigid == pytest.approx([2 * modulus for modulus in GLASS.moduli], rel=1e-8)


@pytest.mark.parametrize("place", ["at walls", "between spheres"])
def test_stiffness_of_contacts_is_that_of_both_materials(mixed, place):
    """Compare with kn = (6 R* E*^2 N)^(1/3) and kt = 4 G*/E* kn."""
    network = mixed.network()
    radius = network.radius[network.particle_i]
    if place == "at walls":
        contacts = network.with_wall
        moduli = GLASS.against(Elasticity(*STEEL))
        effective_radius = radius[contacts]
    else:
        contacts = ~network.with_wall
        moduli = GLASS.moduli
        radius_j = network.radius[network.partner]
        effective_radius = (radius * radius_j / (radius + radius_j))[contacts]
    kn = network.stiffness_normal[contacts]
    force = network.force_normal[contacts]
    expected = (6 * effective_radius * moduli.effective_young**2 * force) ** (1 / 3)
    assert kn == pytest.approx(expected, rel=1e-12)
    ratio = 4 * moduli.effective_shear / moduli.effective_young
    assert network.stiffness_tangential[contacts] == pytest.approx(ratio * kn, rel=1e-12)


def test_mixture_has_its_stress_and_densities(mixed):
    """Compare the stress with its target: a descent ends at 1e-4 of the mean force."""
    network = mixed.network()
    assert np.diag(stress_tensor(network)) == pytest.approx(1e6, rel=2e-3)
    large = network.radius > network.radius.mean()
    assert density_of(network) == pytest.approx(np.where(large, 7800, 2500), rel=1e-12)
    assert "density" not in network.study
    assert network.study["wall_young"] == STEEL[0]


def assert_same_materials(sample, mixed):
    """Compare radii, densities and the material of the walls."""
    assert np.array_equal(sample.radii, mixed.radii)
    assert sample.densities == pytest.approx(mixed.densities, rel=1e-15)
    assert sample.wall_material == mixed.wall_material == Elasticity(*STEEL)


def test_a_file_contains_the_materials(mixed, tmp_path):
    path = tmp_path / "mixed.sample.h5"
    write_sample(path, mixed)
    assert_same_materials(read_sample(path), mixed)


def test_a_network_contains_the_materials(mixed):
    assert_same_materials(sample_of_network(mixed.network(), mixed.friction), mixed)


def test_a_repeated_sample_has_the_same_materials(mixed):
    """Repeat it to four times the mass; its stress stays."""
    four = repeat_sample(mixed, 2, 2).network()
    assert four.mass.sum() == pytest.approx(4 * mixed.network().mass.sum(), rel=1e-13)
    assert stress_tensor(four) == pytest.approx(stress_tensor(mixed.network()), rel=1e-9, abs=1)


def test_a_network_whose_walls_are_not_recorded_is_no_sample(mixed):
    with refusal("other_law"):
        sample_of_network(replace(mixed.network(), study={}), 0.3)


def test_a_network_of_other_moduli_is_no_sample(mixed):
    network = mixed.network()
    softer = replace(network, stiffness_tangential=0.9 * network.stiffness_tangential)
    with refusal("other_law"):
        sample_of_network(softer, 0.3)


def test_frequencies_fall_as_the_root_of_the_density():
    """Make all spheres four times as heavy: an equal packing, all frequencies halved."""
    light = modal.random_packing(100, seed=3, densities=[2230])
    heavy = modal.random_packing(100, seed=3, densities=[4 * 2230])
    assert np.array_equal(light.position, heavy.position)
    expected = modal.eigenmodes(light, lowest=5).frequency / 2
    frequency = modal.eigenmodes(heavy, lowest=5).frequency
    assert frequency == pytest.approx(expected, rel=1e-9)


def test_time_step_goes_by_the_lightest_sphere():
    light = Study(densities="2230 557.5").time_step(1e5)
    assert light == pytest.approx(Study().time_step(1e5) / 2, rel=1e-12)


def test_time_step_goes_by_the_stiffest_contact():
    """Make the wall rigid: E* doubles, and kn grows as E*^(2/3)."""
    rigid = Study(walls="1e14 0.2").time_step(1e5)
    assert rigid == pytest.approx(Study().time_step(1e5) / 2 ** (1 / 3), rel=1e-3)


def test_inertial_time_is_by_default_that_of_the_paper():
    assert inertial_time(1e5, RADIUS, GLASS) == inertial_time(1e5)


@pytest.mark.parametrize(
    ("friction", "tolerance"), [(0.0, 1e-3), pytest.param(0.3, 1e-9, marks=pytest.mark.slow)]
)
def test_packings_of_other_spheres_are_similar(friction, tolerance):
    """Make spheres 64 times as hard, 4 times as dense, twice as large: an equal packing.

    The stress is 64 times as large. All of the protocol's stresses and times must follow. Factors
    are powers of two, so that rounding is the same but for that of roots. With friction nothing
    else is lost. Without it a descent ends at 1e-3 of the mean force, which moves loose spheres by
    a share of an overlap of 1e-4 R.
    """
    settings = {
        "spheres": 120,
        "friction": friction,
        "seed": 2,
        "aspect": 1.5,
        "periodic": True,
    }
    glass = modal.random_packing(stress=1e5, **settings)
    hard = Material(64 * GLASS.young, GLASS.poisson, 4 * GLASS.density)
    hard_packing = modal.random_packing(stress=64e5, material=hard, radius=2 * RADIUS, **settings)
    assert hard_packing.radius == pytest.approx(2 * glass.radius)
    assert hard_packing.n_contacts == glass.n_contacts
    assert hard_packing.position == pytest.approx(2 * glass.position, abs=1e-2 * tolerance * RADIUS)
    expected = 4 * 64 * glass.force_normal
    mean = hard_packing.force_normal.mean()
    assert hard_packing.force_normal == pytest.approx(expected, abs=tolerance * mean)
    assert hard_packing.mass == pytest.approx(32 * glass.mass)


def test_pack_takes_the_materials_of_spheres_and_walls(tmp_path, capsys):
    words = "pack --spheres 100 --aspect 1 --stress 1e4 --young 6e9 --radius 1e-4 --density 1200"
    words += f" --densities 2230 7800 --walls 2.1e11 0.3 -o {tmp_path}"
    assert main(words.split()) == 0
    (path,) = tmp_path.glob("10000Pa*")
    sample = read_sample(path)
    assert sample.material == Material(6e9, GLASS.poisson, 1200.0)
    assert sample.radius == 1e-4
    assert np.bincount(np.searchsorted([2230, 7800], sample.densities)).tolist() == [50, 50]
    assert sample.wall_material == Elasticity(*STEEL)
    assert main(["info", str(path)]) == 0
    assert "210000000000" in capsys.readouterr().out
