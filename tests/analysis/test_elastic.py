"""V_P and V_S by moduli, modes and waves: on the crystal all three are Eq. 6's and its S-wave's."""

import numpy as np
import pytest
from shear_lattice import ShearLattice

import analysis
import modal
from analysis.estimators.structure_factor import standing_waves
from modal.elasticity.plane_waves import isotropic_mean
from modal.theory.fcc import FccLattice
from modal.tools.errors import InputError

CRYSTAL = FccLattice(1e5)
SPEEDS = {"v_p": CRYSTAL.velocity, "v_s": ShearLattice.of_crystal(CRYSTAL).velocity}


def test_velocities_of_the_crystal_by_moduli_and_by_waves():
    """Moduli from the solver's residual; waves within their errors, and 1e-4 of extrapolation."""
    names = [*SPEEDS, "v_p_moduli", "v_s_moduli"]
    found = analysis.measure(modal.fcc(cells=(1, 1, 200)), quantities=names)
    for name, exact in SPEEDS.items():
        assert found[f"{name}_moduli"].value == pytest.approx(exact, rel=1e-4)
        assert abs(found[name].value - exact) < 3 * found[name].error + 1e-4 * exact
    with pytest.raises(InputError, match="choose x, y or z"):
        standing_waves(modal.fcc(cells=(1, 1, 6)), np.array([1]), "w")


def test_a_packing_without_stiffness_has_no_velocity_but_a_reason():
    crystal = modal.fcc(cells=(2, 2, 20))
    few = np.random.default_rng(1).random(crystal.n_contacts) < 0.2
    soft = crystal.with_contacts(few | (crystal.particle_j < 0))
    found = analysis.measure(soft, quantities=["v_p", "v_s", "v_p_static", "low_pass"])
    for value in found.values():
        assert not value.known and value.caveats


def test_moduli_over_coordination_number_of_the_crystal():
    """Closed form: twelve contacts, 18 forces less 6 balances a sphere; sqrt(2) spheres a D^3."""
    cell = modal.fcc(cells=(2, 2, 4), periodic_z=True)
    names = ["coordination_of_bearing", "bulk_modulus", "shear_modulus", "bulk_over_affine"]
    names += ["shear_over_affine", "shear_over_indeterminacy"]
    found = {name: one.value for name, one in analysis.measure(cell, quantities=names).items()}
    assert found["coordination_of_bearing"] == 12
    K, G = isotropic_mean(CRYSTAL.stiffness)
    assert found["bulk_modulus"] == pytest.approx(K, rel=1e-3)
    assert found["shear_modulus"] == pytest.approx(G, rel=1e-3)
    # Spheres overlap by 4e-4 of the diameter here: the lattice is that much closer, in each length.
    wanted = G * 2 * CRYSTAL.radius / CRYSTAL.kn / (12 * np.sqrt(2))
    assert found["shear_over_indeterminacy"] == pytest.approx(wanted, rel=3e-3)
    # Every sphere is a centre of symmetry: none leaves the mean strain, Voigt's bound is reached.
    assert found["bulk_over_affine"] == pytest.approx(1, abs=1e-3)
    assert found["shear_over_affine"] == pytest.approx(1, abs=1e-3)
