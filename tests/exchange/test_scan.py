"""Spheres from a scan: positions with noise, no overlaps; the stress gives the stiffnesses."""

import numpy as np
import pytest
from places import PACKINGS
from refusals import refusal

import analysis
import modal
from modal.cli.main import main
from modal.packing.checks import density_of
from modal.packing.scan import Scan, alternatives, mean_contact_force
from modal.packing.state import stress_tensor

LAW = "hertz/material 6e10 0 0.2 tangential mindlin/force NULL 0 0.5"
STRESS = 1e6


@pytest.fixture(scope="module")
def truth():
    """Return 250 spheres of several sizes, periodic all round, that YADE has brought to 1 MPa."""
    return modal.read(PACKINGS / "triaxial.network.h5")


@pytest.fixture(scope="module")
def scanned(truth):
    """Return the packing as a scan shows it: errors of 1 % of the radius in each coordinate."""
    random = np.random.default_rng(1)
    noise = 0.01 * truth.radius.mean()
    return modal.from_spheres(
        truth.position + noise * random.standard_normal(truth.position.shape),
        truth.radius,
        cell=truth.cell_size,
        law=LAW,
        stress=STRESS,
        tolerance=3 * noise,
        density=float(density_of(truth)[0]),
    )


def test_simple_cubic_crystal_under_pressure_has_the_exact_stiffness():
    """Put p D^2 on each of three contacts a sphere, whatever the distance of the spheres."""
    count = 4
    diameter = 2e-3
    grid = np.stack(np.meshgrid(*[np.arange(count)] * 3, indexing="ij"), -1).reshape(-1, 3)
    network = modal.from_spheres(
        grid * diameter,
        diameter / 2,
        cell=np.full(3, count * diameter),
        law=LAW,
        stress=STRESS,
        tolerance=1e-6,
    )
    assert network.n_contacts == 3 * count**3
    *_, equal = alternatives(network)
    force = STRESS * diameter**2
    effective_young = 6e10 / (2 * (1 - 0.2**2))
    circle = (3 * force * diameter / 4 / (4 * effective_young)) ** (1 / 3)
    np.testing.assert_allclose(equal.stiffness_normal, 2 * effective_young * circle, rtol=1e-12)


def test_mean_force_is_that_of_the_packing(truth):
    """Compare Love's formula with the forces and branch vectors of a packing with known forces."""
    pairs = truth.branch
    length = np.linalg.norm(pairs, axis=1)
    weighted = (truth.force_normal * length).sum() / length.sum()
    volume = float(np.prod(truth.cell_size))
    pressure = np.trace(stress_tensor(truth)) / 3
    assert mean_contact_force(pressure, volume, length) == pytest.approx(weighted, rel=1e-2)


def test_truth_lies_within_the_error(truth, scanned):
    exact = modal.elastic_moduli(truth)
    moduli = modal.elastic_moduli(scanned)
    # A velocity is the root of modulus over density.
    assert abs(moduli.v_p / exact.v_p - 1) < moduli.error / 2
    assert 0.02 < moduli.error < 0.6


def test_error_contains_what_tolerances_move(scanned):
    moduli = modal.elastic_moduli(scanned)
    networks = list(alternatives(scanned))
    contacts = [network.n_contacts for network in networks]
    assert contacts[0] < scanned.n_contacts < contacts[1]
    assert contacts[2] == scanned.n_contacts
    for network in networks:
        exact = network.unchecked(study={})
        moduli_of_network = modal.elastic_moduli(exact)
        assert abs(moduli_of_network.bulk_modulus / moduli.bulk_modulus - 1) < moduli.error
        assert abs(moduli_of_network.shear_modulus / moduli.shear_modulus - 1) < moduli.error


def test_all_alternatives_bear_the_stress(scanned):
    """Sum forces times branches, from the stiffnesses alone: f = (k / c)^3 / R*."""
    scan = Scan.of(scanned.study)
    for network in alternatives(scanned):
        radius_i = network.radius[network.particle_i]
        radius_j = network.radius[network.particle_j]
        effective_radius = radius_i * radius_j / (radius_i + radius_j)
        force = (network.stiffness_normal / scan.law.normal) ** 3 / effective_radius
        length = np.linalg.norm(network.branch, axis=1)
        stress = (force * length).sum() / np.prod(network.cell_size) / 3
        assert stress == pytest.approx(STRESS, rel=1e-9)


def test_measured_quantities_have_the_error_and_the_caveat(scanned):
    values = analysis.measure(scanned, quantities=["bulk_modulus", "coordination", "void_ratio"])
    for name in ("bulk_modulus", "coordination"):
        assert "scanned" in values[name].codes
        assert values[name].error > 0.02 * values[name].value
    assert "scanned" not in values["void_ratio"].codes


def test_error_of_a_velocity_has_that_of_the_moduli_once(scanned):
    """Half the relative error of the moduli: a velocity is the root of modulus over density."""
    value = analysis.measure(scanned, quantities="v_p")["v_p"]
    moduli = modal.elastic_moduli(scanned)
    assert value.error == pytest.approx(value.value * moduli.error / 2, rel=1e-9)


def test_scan_with_friction_rests_under_its_stress(scanned, tmp_path):
    """Creep until 1e-5 of the forces is left, so that the fixed cell takes no stress away.

    A state's stress is exact to 0.3 %.
    """
    scan = tmp_path / "scan.network.h5"
    modal.write(scan, scanned)
    rested = tmp_path / "rested.sample.h5"
    words = ["relax", str(scan), "--stress", f"{STRESS:g}", "--friction", "0.3"]
    assert main([*words, "-o", str(rested)]) == 0
    np.testing.assert_allclose(np.diag(stress_tensor(modal.read(rested))), STRESS, rtol=4e-3)


def test_notes_survive_the_file(scanned, tmp_path):
    path = tmp_path / "scan.network.h5"
    modal.write(path, scanned)
    again = modal.read(path)
    assert Scan.of(again.study) == Scan.of(scanned.study)
    # Modes of guessed contacts would be those of no packing.
    with refusal("scanned_packing"):
        modal.eigenmodes(again, lowest=3)
