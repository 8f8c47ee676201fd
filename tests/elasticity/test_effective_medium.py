"""Tests of effective-medium theory, of saturated packings, and of both beside measured moduli."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal

import modal
from analysis.measurement import measure
from modal.__main__ import main
from modal.elasticity.plane_waves import isotropic_mean
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.network import write_network
from modal.theory.effective_medium import (
    Assembly,
    IsotropicModuli,
    affine_moduli,
    assembly_of,
    digby,
    walton,
)
from modal.theory.saturation import (
    FLUIDS,
    gassmann,
    grain_bulk_modulus,
    permeability,
    saturate,
    with_added_mass,
)

CLOSED_FORM = 1e-13
"""Relative round-off of some hundred operations, without a difference of nearly equal numbers."""
RANDOM = Assembly(stress=1e5, coordination=5.5, solid_fraction=0.62, radius=RADIUS, material=GLASS)


@pytest.fixture(scope="module")
def crystal():
    return modal.fcc(cells=(2, 2, 4), periodic_z=True)


def test_walton_is_the_closed_form_of_his_paper():
    """Compare with Walton's constants A and B of the two limits (1987, sections 4 and 5)."""
    shear = GLASS.young / (2 * (1 + GLASS.poisson))
    lame = 2 * shear * GLASS.poisson / (1 - 2 * GLASS.poisson)
    a = (1 / shear - 1 / (shear + lame)) / (4 * np.pi)
    b = (1 / shear + 1 / (shear + lame)) / (4 * np.pi)
    contacts = RANDOM.solid_fraction * RANDOM.coordination
    unit = (3 * contacts**2 * RANDOM.stress / (np.pi**4 * b**2)) ** (1 / 3) / 10
    smooth = walton(RANDOM, rough=False)
    assert smooth.shear == pytest.approx(unit, rel=1e-12)
    assert smooth.bulk == pytest.approx(5 / 3 * unit, rel=1e-12)
    assert smooth.poisson == pytest.approx(0.25, rel=1e-12)
    rough = walton(RANDOM)
    assert rough.shear == pytest.approx(unit * (5 * b + a) / (2 * b + a), rel=1e-12)
    assert rough.bulk == pytest.approx(smooth.bulk, rel=1e-12)
    assert rough.poisson == pytest.approx(GLASS.poisson / (2 * (5 - 3 * GLASS.poisson)), rel=1e-12)
    assert rough.poisson == pytest.approx(0.0227, abs=5e-5)


def test_makse_has_the_same_bulk_modulus_over_pressure():
    """Compare with K = kn / (12 pi) (phi z)^(2/3) (6 pi p / kn)^(1/3), kn = 4 mu / (1 - nu)."""
    shear = GLASS.young / (2 * (1 + GLASS.poisson))
    normal = 4 * shear / (1 - GLASS.poisson)
    tangential = 8 * shear / (2 - GLASS.poisson)
    contacts = RANDOM.solid_fraction * RANDOM.coordination
    common = contacts ** (2 / 3) * (6 * np.pi * RANDOM.stress / normal) ** (1 / 3)
    rough = walton(RANDOM)
    assert rough.bulk == pytest.approx(normal / (12 * np.pi) * common, rel=CLOSED_FORM)
    expected = (normal + 1.5 * tangential) / (20 * np.pi) * common
    assert rough.shear == pytest.approx(expected, rel=CLOSED_FORM)


def test_digby_lies_between_smooth_and_bonded_spheres():
    """Compare with Walton's smooth spheres without bonds.

    Without pressure the radius of the contact is that of the bond.
    """
    smooth = walton(RANDOM, rough=False)
    assert digby(RANDOM, bond_radius=0.0) == pytest.approx(smooth, rel=CLOSED_FORM)
    bond = 0.02 * RADIUS
    free = digby(RANDOM._replace(stress=0.0), bond_radius=bond)
    young, shear = GLASS.moduli
    expected = affine_moduli(2 * young * bond, 8 * shear * bond, 5.5, 0.62, RADIUS)
    assert free == pytest.approx(expected, rel=CLOSED_FORM)
    # The circle of contact of the paper: d^3 + 3/2 (b/R)^2 d = 3 pi (1 - nu) p / (2 z phi mu).
    modulus = GLASS.young / (2 * (1 + GLASS.poisson))
    load = 1.5 * np.pi * (1 - GLASS.poisson) * RANDOM.stress / (5.5 * 0.62 * modulus)
    roots = np.roots([1.0, 0.0, 1.5 * (bond / RADIUS) ** 2, -load])
    (d,) = roots[abs(roots.imag) < 1e-9].real
    radius = RADIUS * np.hypot(d, bond / RADIUS)
    pressed = digby(RANDOM, bond_radius=bond)
    # The real root of a cubic, which stands alone, is known to some ten eps.
    assert pressed.bulk / free.bulk == pytest.approx(radius / bond, rel=CLOSED_FORM)


def test_affine_moduli_are_those_of_a_network_with_equal_contacts(crystal):
    """Compare with the crystal's tensor: the isotropic mean does not depend on directions.

    Spheres overlap by 1e-4 of a radius, by which branches are shorter than 2 R.
    """
    bulk, shear = isotropic_mean(modal.elastic_moduli(crystal).affine)
    pair = ~crystal.with_wall
    kn = crystal.stiffness_normal[pair].mean()
    kt = crystal.stiffness_tangential[pair].mean()
    fraction = 1 / (1 + crystal.study["void_ratio"])
    expected = affine_moduli(kn, kt, 12, fraction, RADIUS)
    assert (bulk, shear) == pytest.approx(expected, rel=1e-3)
    assert expected.bulk / expected.shear == pytest.approx(5 / (3 + 4.5 * kt / kn), rel=CLOSED_FORM)
    assert expected.bulk / expected.shear == pytest.approx(0.714, abs=5e-4)
    # A crystal's spheres follow the strain, and its pressure is that of the theory.
    assert walton(assembly_of(crystal)) == pytest.approx(expected, rel=1e-3)


def test_moduli_and_measure_tell_theory_beside_the_measured(crystal, tmp_path, printed):
    path = tmp_path / "crystal.network.h5"
    write_network(path, crystal)
    result = printed("moduli", path, "--fluid", "water")
    # Branches are shorter than 2 R by the overlap, some 3e-4 R under 100 kPa.
    for name in ("affine", "walton_rough"):
        assert result["theory"][name]["measured_over_theory"] == pytest.approx([1, 1], rel=1e-3)
    shear = result["theory"]["walton_smooth"]["shear_modulus_pa"]
    assert shear == pytest.approx(result["bulk_modulus_pa"] * 0.6, rel=1e-3)
    assert result["saturated"]["shear_modulus_pa"] == result["shear_modulus_pa"]
    assert result["saturated"]["bulk_modulus_pa"] > result["bulk_modulus_pa"]
    names = ["bulk_over_walton", "shear_over_walton", "shear_over_walton_smooth"]
    measured = measure(crystal, quantities=names)
    ratios = [measured[name].value for name in names]
    kt_over_kn = 2 * (1 - GLASS.poisson) / (2 - GLASS.poisson)
    assert ratios == pytest.approx([1, 1, 1 + 1.5 * kt_over_kn], rel=1e-3)
    unknown = measure(replace(crystal, study={}), quantities=names)
    assert unknown["bulk_over_walton"].codes == ["unknown_material"]
    with refusal("no_pressure"):
        walton(RANDOM._replace(stress=0.0))


def test_gassmann_against_the_form_of_compliances():
    """Compare with K_sat / (K_s - K_sat) = K / (K_s - K) + K_f / (phi (K_s - K_f))."""
    grain = grain_bulk_modulus(GLASS)
    water = FLUIDS["water"].bulk_modulus
    assert grain == pytest.approx(60e9 / 1.8, rel=CLOSED_FORM)
    dry = IsotropicModuli(2e8, 1e8)
    full = gassmann(dry, 0.38, grain, water)
    saturated = full.bulk / (grain - full.bulk)
    expected = dry.bulk / (grain - dry.bulk) + water / (0.38 * (grain - water))
    assert saturated == pytest.approx(expected, rel=CLOSED_FORM)
    assert full.shear == dry.shear
    # A fluid as stiff as the grains makes a solid of grains.
    assert gassmann(dry, 0.38, grain, grain).bulk == pytest.approx(grain, rel=CLOSED_FORM)
    with refusal("saturation"):
        gassmann(IsotropicModuli(2 * grain, 1e8), 0.38, grain, water)


def test_permeability_and_biot_frequency_of_equal_spheres(crystal):
    porosity = 1 - np.pi / np.sqrt(18)
    expected = porosity**3 * (2 * RADIUS) ** 2 / (180 * (1 - porosity) ** 2)
    # The overlaps of 1e-4 of the radius count four times as much in the pores.
    assert permeability(crystal) == pytest.approx(expected, rel=5e-3)
    full = saturate(crystal, IsotropicModuli(2e8, 1e8), GLASS, FLUIDS["water"])
    assert full.density == pytest.approx(2230 * (1 - porosity) + 1000 * porosity, rel=1e-3)
    biot = 1e-3 * porosity / (2 * np.pi * 1000 * expected)
    assert full.biot_frequency == pytest.approx(biot, rel=5e-3)
    p_wave, s_wave = full.velocities
    assert (p_wave / s_wave) ** 2 == pytest.approx(full.moduli.bulk / 1e8 + 4 / 3, rel=CLOSED_FORM)


def test_added_mass_of_water_lowers_motions_of_centres_by_its_factor(tmp_path, printed, one_line):
    """Find sqrt(2230 / 2730) = .904 for translations, and as much for long waves."""
    dry = modal.fcc(cells=(1, 1, 10))
    wet = with_added_mass(dry, "water")
    factor = np.sqrt(2230 / 2730)
    assert factor == pytest.approx(0.904, abs=5e-4)  # three printed digits
    lists = [
        modal.eigenmodes(network, lowest=5, translations_only=True).frequency
        for network in (dry, wet)
    ]
    # Both lists have converged to 1e-10 of omega^2, and f errs by half of that.
    assert lists[1] / lists[0] == pytest.approx(factor, rel=1e-9)
    path = tmp_path / "dry.network.h5"
    write_network(path, dry)
    words = ("modes", path, "--lowest", 5, "--translations-only", "--fluid", "water")
    assert printed(*words)["frequency_hz"] == pytest.approx(lists[1], rel=1e-9)
    with refusal("fluid_twice", "water"):
        with_added_mass(wet, "water")
    with refusal("unknown_word"):
        with_added_mass(dry, "honey")
    one_line(main, ["modes", path, "--lowest", 5, "--fluid", "honey"], code="command_line")
