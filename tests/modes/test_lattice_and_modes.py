"""Modes against theory: Bloch waves, the layer chain, the symmetry blocks, exact counts.

Degenerate eigenvectors are never compared one by one (any rotation of them is as good);
frequencies, counts and symmetric observables are.
"""

from dataclasses import replace

import numpy as np
import pytest
from changes import scaled
from refusals import refusal

from analysis.estimators.layer_lattice import LayerLattice
from modal.modes.eigenmodes import modes_of
from modal.packing import crystal as gallery
from modal.packing.contact_law import Material
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.linear_system import Limits, LinearSystem
from modal.theory.fcc import FccLattice, dispersion
from modal.tools.errors import InputError


def test_bloch_long_wave_along_z_is_eq_9():
    crystal = FccLattice(1e5)
    for fraction in (0.01, 0.3, 0.7, 1.0):
        kappa = fraction * np.pi / crystal.layer_distance
        frequency, _ = crystal.bloch([0, 0, kappa])
        theory = dispersion(kappa, crystal.C, crystal.mass, crystal.layer_distance) / (2 * np.pi)
        # At 0.01 of the zone omega^2 is 1e-4 of the largest of the 6 x 6 matrix: 1e4 eps.
        assert abs(frequency / theory - 1).min() < 1e-11
    # A closed form against another: round-off of some ten operations.
    assert crystal.low_pass_frequency == pytest.approx(theory, rel=1e-12)


def test_bloch_equals_periodic_supercell():
    """Compare all modes of a cell, periodic on all sides, with the Bloch waves in it."""
    width = 2
    layers = 4
    crystal = FccLattice(1e5)
    network = gallery.fcc(cells=(width, width, layers), periodic_z=True)
    K = stiffness_matrix(network).toarray()
    scale = 1 / np.sqrt(mass_diagonal(network))
    supercell = np.sort(np.linalg.eigvalsh(K * scale[:, None] * scale))
    d = crystal.spacing
    length = layers * crystal.layer_distance
    squares = []
    for a in range(width):
        for b in range(width):
            for c in range(layers):
                # The unit cell holds one sphere, the supercell 16: 16 wavevectors.
                q = 2 * np.pi * np.array([a / (width * d), b / (width * d), c / length])
                squares.extend(np.linalg.eigvalsh(crystal.bloch_matrix(q)))
    assert np.sort(squares) == pytest.approx(supercell, abs=1e-12 * supercell.max())


@pytest.mark.parametrize(
    ("layers", "stress", "radius"), [(6, 1e5, 1.27e-3), (11, 1e4, 1e-3), (16, 1e7, 5e-3)]
)
def test_planar_modes_equal_the_chain_of_layers(layers, stress, radius):
    network = gallery.fcc(stress, (3, 3, layers), radius=radius)
    modes = modes_of(LinearSystem.of(network), all=True)
    theory = LayerLattice.of_network(network).eigenmodes()[0] / (2 * np.pi)
    assert len(modes.resonance_frequency) == layers
    # Dense solutions: eps of the largest omega^2 times the root of up to 864 rows, and the lowest
    # omega^2 is 1e-3 of the largest.
    assert modes.resonance_frequency == pytest.approx(theory, rel=1e-9)
    wavenumber = np.pi * np.arange(1, layers + 1) / network.length
    assert np.allclose(modes.resonance_wavenumber, wavenumber)
    # Of unit norm in the mass of all nine spheres of a layer.
    energy = 9 * network.mass[0] * (modes.resonance_shape**2).sum(axis=1)
    assert energy == pytest.approx(np.ones(layers), rel=1e-9)


def test_highest_mode_of_the_crystal_is_that_of_equal_turns():
    """Compare with the branches at wavevector 0, a periodic crystal, and the referee's number."""
    lattice = FccLattice(1e5)
    branches, _ = lattice.bloch(np.zeros(3))
    # The largest eigenvalue of a symmetric matrix is known to some eps of itself.
    assert lattice.highest_frequency == pytest.approx(branches[-1], rel=1e-12)
    # Worked out by hand from omega^2 = 16 kt l^2 / I.
    assert lattice.highest_frequency == pytest.approx(211_064, abs=1)
    system = LinearSystem(gallery.fcc(cells=(2, 2, 2), periodic_z=True))
    square = np.linalg.eigvalsh(system.assemble_dynamical_matrix().toarray())[-3:]
    assert np.sqrt(square) / (2 * np.pi) == pytest.approx(lattice.highest_frequency, rel=1e-12)


def test_observables_do_not_depend_on_how_many_are_measured_together():
    """Measure 144 modes together and in pieces of 7."""
    network = gallery.fcc(cells=(2, 2, 6))
    # No symmetry: dense, all modes in one call.
    network = replace(network, stiffness_normal=scaled(network.stiffness_normal, 3, 1.5))
    system = LinearSystem.of(network)
    together = modes_of(system, all=True)
    in_pieces = modes_of(LinearSystem.of(network, limits=Limits(together=7)), all=True)
    for name in ("frequency", "chi_z", "chi_z_chain", "rotation_share", "mode_shape"):
        assert np.allclose(getattr(in_pieces, name), getattr(together, name), rtol=1e-12), name
    square = (2 * np.pi * together.frequency) ** 2
    floor = (
        np.finfo(float).eps * system.size * system.row_sum_bound / square
    )  # LAPACK's p(n) eps |A|
    assert (np.maximum(together.residual, in_pieces.residual) < floor).all()


def test_symmetry_blocks_equal_the_dense_spectrum():
    system = LinearSystem.of(gallery.fcc(cells=(4, 3, 5)))
    by_symmetry = modes_of(system, all=True)
    assert by_symmetry.attributes["solver"] == "symmetry 4x3"
    exact = np.linalg.eigvalsh(system.dynamical_matrix.toarray())
    square = (2 * np.pi * by_symmetry.frequency) ** 2
    error = 1e-13 * system.size * exact.max()
    assert square == pytest.approx(exact, abs=error)


def test_crystal_with_one_different_contact_has_no_symmetry():
    network = gallery.fcc(cells=(3, 3, 5))
    network = replace(network, stiffness_normal=scaled(network.stiffness_normal, 7, 1.001))
    assert modes_of(LinearSystem.of(network), all=True).attributes["solver"] == "dense"


def test_without_rotations_the_top_is_the_low_pass_frequency():
    """Compare f_max of translations alone with the band edge of Eq. 10 (paper, section 5.1).

    Wave numbers of N = 60 layers are pi / N apart, so that one lies within pi / 2 N of the edge:
    its frequency is lower by (pi / 2 N)^2 / 2 = 3.4e-4 at most.
    """
    system = LinearSystem.of(gallery.fcc(cells=(4, 4, 60)), translations_only=True)
    top = modes_of(system, highest=1).frequency[0]
    assert top == pytest.approx(FccLattice(1e5).low_pass_frequency, rel=3.5e-4)


@pytest.mark.parametrize("share", [1e-4, 0.01, 0.1, 0.299])
def test_a_crystal_presses_as_its_overlap_says(share):
    """Compare the stress with Hertz's force divided by a contact's share of the area.

    The largest overlap is the deepest that a network may have.
    """
    radius = 1e-3
    soft = Material(1e5, 0.2, 2230.0)
    force = 4 / 3 * soft.effective_young * np.sqrt(radius / 2) * (share * radius) ** 1.5
    stress = 2 * np.sqrt(2) * force / ((2 - share) * radius) ** 2
    crystal = FccLattice(stress, radius, soft)
    assert crystal.overlap == pytest.approx(share * radius, rel=1e-12, abs=0)
    with pytest.raises(InputError) as refused:
        FccLattice(stress * (0.31 / share) ** 1.5 * ((2 - share) / 1.69) ** 2, radius, soft)
    assert refused.value.code == "stress"
    assert "0.3 " in refused.value.reason


@pytest.mark.parametrize("young", [1e5, 2e5, 1e6])
@pytest.mark.parametrize("make", [FccLattice, gallery.fcc], ids=["lattice", "packing"])
def test_a_crystal_too_soft_for_its_stress_is_refused(make, young):
    with refusal("stress"):
        make(1e5, material=Material(young, 0.2, 2230.0))


@pytest.mark.parametrize("young", [1e5, 2e5, 1e6])
def test_a_crystal_that_overlaps_too_far_with_its_walls_is_refused(young):
    """Refuse a stress that only walls exclude: their overlaps are 1.6 times as large."""
    with refusal("stress"):
        gallery.fcc(0.06 * young, (2, 2, 4), material=Material(young, 0.2, 2230.0))
