"""Tests of spheres of several densities and walls of other moduli: law, files, packings."""

from dataclasses import replace

import numpy as np
import pytest
from packings import random_sample

import modal
from modal.__main__ import main
from modal.packing.checks import density_of
from modal.packing.contact_law import GLASS, RADIUS, Elasticity, Material
from modal.packing.sample import read_sample, sample_of_network, write_sample
from modal.packing.state import stress_tensor
from modal.packing.tiling import repeat_sample
from modal.preparation.durations import inertial_time
from modal.preparation.protocol import Study
from modal.tools.errors import InputError

STEEL = 2.1e11, 0.3
MIXTURE = {"sizes": ("two", 2, 0.5), "densities": (2500, 7800), "walls": STEEL}


@pytest.fixture(scope="module")
def mixed():
    """Return large spheres of steel's density among small ones of glass's, between steel walls."""
    return random_sample(120, 1e6, seed=2, aspect=1.5, **MIXTURE)


def test_moduli_of_two_materials_are_the_textbooks():
    """Compare with Johnson, Contact Mechanics (1985), 4.5 and 7.3, for two, one and a rigid one.

    1/E* = (1 - nu^2)/E + ..., 1/G* = (2 - nu)/G + ...
    """
    steel = Elasticity(*STEEL)
    shear = [one.young / 2 / (1 + one.poisson) for one in (GLASS, steel)]
    both = GLASS.against(steel)
    compliances = [(1 - one.poisson**2) / one.young for one in (GLASS, steel)]
    assert both.effective_young == pytest.approx(1 / sum(compliances), rel=1e-14)
    slips = [(2 - one.poisson) / g for one, g in zip((GLASS, steel), shear, strict=True)]
    assert both.effective_shear == pytest.approx(1 / sum(slips), rel=1e-14)
    assert both == pytest.approx(steel.against(GLASS), rel=1e-14)
    assert GLASS.against(Elasticity(GLASS.young, GLASS.poisson)) == GLASS.moduli
    rigid = GLASS.against(Elasticity(1e20, 0.2))
    assert rigid == pytest.approx([2 * modulus for modulus in GLASS.moduli], rel=1e-8)


def test_contacts_with_the_walls_have_their_own_stiffness_and_carry_the_stress(mixed):
    """Compare with kn = (6 R* E*^2 N)^(1/3) and kt = 4 G*/E* kn, and the stress with its target."""
    network = mixed.network()
    wall = network.with_wall
    radius = network.radius[network.particle_i]
    second = network.radius[network.partner]
    effective = np.where(wall, radius, radius * second / (radius + second))
    for chosen, law in ((wall, GLASS.against(Elasticity(*STEEL))), (~wall, GLASS.moduli)):
        force, kn = network.force_normal[chosen], network.stiffness_normal[chosen]
        of_force = (6 * effective[chosen] * law.effective_young**2 * force) ** (1 / 3)
        assert kn == pytest.approx(of_force, rel=1e-12)
        ratio = 4 * law.effective_shear / law.effective_young
        assert network.stiffness_tangential[chosen] == pytest.approx(ratio * kn, rel=1e-12)
    assert np.diag(stress_tensor(network)) == pytest.approx(1e6, rel=2e-3)
    large = network.radius > network.radius.mean()
    assert density_of(network) == pytest.approx(np.where(large, 7800, 2500), rel=1e-12)
    assert "density" not in network.study and network.study["wall_young"] == STEEL[0]


def test_files_and_networks_keep_materials(mixed, tmp_path):
    """Convert a sample to a file and to a network and back, and tile it to four times the mass."""
    path = tmp_path / "mixed.sample.h5"
    write_sample(path, mixed)
    back = read_sample(path)
    again = sample_of_network(replace(mixed.network()), mixed.friction)
    for sample in (back, again):
        assert np.array_equal(sample.radii, mixed.radii)
        assert sample.densities == pytest.approx(mixed.densities, rel=1e-15)
        assert sample.wall_material == mixed.wall_material == Elasticity(*STEEL)
    four = repeat_sample(mixed, 2, 2).network()
    assert four.mass.sum() == pytest.approx(4 * mixed.network().mass.sum(), rel=1e-13)
    assert stress_tensor(four) == pytest.approx(stress_tensor(mixed.network()), rel=1e-9, abs=1)


def test_network_of_another_law_is_no_sample(mixed):
    """Refuse networks with other moduli, or whose walls are not recorded."""
    network = mixed.network()
    other = {"stiffness_tangential": 0.9 * network.stiffness_tangential}
    for changed in ({"study": {}}, other):
        with pytest.raises(InputError) as error:
            sample_of_network(replace(network, **changed), 0.3)
        assert error.value.code == "other_law"


def test_frequencies_fall_as_the_root_of_the_density():
    """Make all spheres four times as heavy: an equal packing, all frequencies halved."""
    light, heavy = (modal.random_packing(100, seed=3, densities=[rho]) for rho in (2230, 8920))
    assert np.array_equal(light.position, heavy.position)
    two = [modal.eigenmodes(each, lowest=5).frequency for each in (light, heavy)]
    assert two[0] == pytest.approx(2 * two[1], rel=1e-9)


def test_time_step_goes_by_the_lightest_sphere_and_the_stiffest_contact():
    plain = Study()
    light = Study(densities="2230 557.5").time_step(1e5)
    assert light == pytest.approx(plain.time_step(1e5) / 2, rel=1e-12)
    rigid = Study(walls="1e14 0.2").time_step(1e5)
    assert rigid == pytest.approx(plain.time_step(1e5) / 2 ** (1 / 3), rel=1e-3)
    assert inertial_time(1e5, RADIUS, GLASS) == inertial_time(1e5)


@pytest.mark.parametrize(
    ("friction", "apart"), [(0.0, 1e-3), pytest.param(0.3, 1e-9, marks=pytest.mark.slow)]
)
def test_packings_of_other_spheres_are_similar(friction, apart):
    """Make spheres 64 times as hard, 4 times as dense, twice as large: an equal packing.

    The stress is 64 times as large.

    All of the protocol's stresses and times must follow for that. Factors are powers of two, so
    that rounding is the same but for that of roots. With friction nothing else is lost. Without it
    a descent ends at 1e-3 of the mean force, which moves loose spheres by a share of an overlap of
    1e-4 R.
    """
    given = {"spheres": 120, "friction": friction, "seed": 2, "aspect": 1.5, "periodic": True}
    glass = modal.random_packing(stress=1e5, **given)
    hard = Material(64 * GLASS.young, GLASS.poisson, 4 * GLASS.density)
    other = modal.random_packing(stress=64e5, material=hard, radius=2 * RADIUS, **given)
    assert other.radius == pytest.approx(2 * glass.radius) and other.n_contacts == glass.n_contacts
    assert other.position == pytest.approx(2 * glass.position, abs=1e-2 * apart * RADIUS)
    wanted, size = 4 * 64 * glass.force_normal, other.force_normal.mean()
    assert other.force_normal == pytest.approx(wanted, abs=apart * size)
    assert other.mass == pytest.approx(32 * glass.mass)


def test_pack_takes_the_materials_of_spheres_and_walls(tmp_path, capsys):
    words = "pack --spheres 100 --aspect 1 --stress 1e4 --young 6e9 --radius 1e-4 --density 1200"
    words += f" --densities 2230 7800 --walls 2.1e11 0.3 -o {tmp_path}"
    assert main(words.split()) == 0
    (path,) = tmp_path.glob("10000Pa*")
    sample = read_sample(path)
    assert sample.material == Material(6e9, GLASS.poisson, 1200.0) and sample.radius == 1e-4
    assert np.bincount(np.searchsorted([2230, 7800], sample.densities)).tolist() == [50, 50]
    assert sample.wall_material == Elasticity(*STEEL)
    assert main(["info", str(path)]) == 0
    assert "210000000000" in capsys.readouterr().out
