"""Tests of derivatives of frequencies and moduli: finite differences, and homogeneity."""

from dataclasses import replace

import numpy as np
import pytest
from packings import polydisperse

import modal
from modal.elasticity.sensitivity import moduli_sensitivity
from modal.modes.sensitivity import frequency_sensitivity

COLUMNS = ("stiffness_normal", "stiffness_tangential")


@pytest.fixture(scope="module")
def packing():
    return polydisperse(periodic_z=True)


def changed(network, column, contact, share):
    """Return a network in which one stiffness of one contact is larger by a share of it."""
    stiffness = getattr(network, column).copy()
    stiffness[contact] *= 1 + share
    return replace(network, **{column: stiffness})


@pytest.mark.parametrize("kind", [0, 1])
def test_frequencies_follow_finite_differences(packing, kind):
    """Compare with central differences of 1 %.

    They leave 1e-4 of the change, and round-off of 1e-11 of f / 0.01.
    """
    modes = modal.eigenmodes(packing, highest=3)
    per_stiffness = frequency_sensitivity(packing, modes)
    stiffness = getattr(packing, COLUMNS[kind])
    contact = int(np.argmax(per_stiffness[-1, :, kind] * stiffness))
    ends = [
        modal.eigenmodes(changed(packing, COLUMNS[kind], contact, share), highest=3).frequency
        for share in (0.01, -0.01)
    ]
    difference = (ends[0] - ends[1]) / (0.02 * stiffness[contact])
    largest = abs(per_stiffness[:, contact, kind]).max()
    assert difference == pytest.approx(per_stiffness[:, contact, kind], abs=2e-3 * largest)


def test_all_stiffnesses_together_move_a_frequency_by_half_of_it(packing):
    modes = modal.eigenmodes(packing, highest=5)
    per_stiffness = frequency_sensitivity(packing, modes)
    total = sum(per_stiffness[:, :, k] @ getattr(packing, COLUMNS[k]) for k in range(2))
    # f is the root of a quotient whose error is that of the mode squared.
    assert 2 * total == pytest.approx(modes.frequency, rel=1e-7)


def test_moduli_are_the_sum_of_stiffness_times_derivative(packing):
    moduli = modal.elastic_moduli(packing)
    derivative = moduli_sensitivity(packing)
    total = sum(
        np.einsum("c,cab->ab", getattr(packing, COLUMNS[k]), derivative.stiffness[:, k])
        for k in range(2)
    )
    # The motion is known to the root of the error of the energy, 1e-3 at most.
    assert total == pytest.approx(moduli.whole, abs=1e-5 * moduli.whole.max())
    shear = sum(derivative.shear[:, k] @ getattr(packing, COLUMNS[k]) for k in range(2))
    assert shear == pytest.approx(moduli.shear_modulus, rel=1e-5)
    bulk = sum(derivative.bulk[:, k] @ getattr(packing, COLUMNS[k]) for k in range(2))
    assert bulk == pytest.approx(moduli.bulk_modulus, rel=1e-5)


def test_moduli_follow_finite_differences(packing):
    derivative = moduli_sensitivity(packing, tolerance=1e-10)
    for kind in range(2):
        stiffness = getattr(packing, COLUMNS[kind])
        contact = int(np.argmax(derivative.shear[:, kind] * stiffness))
        ends = [
            modal.elastic_moduli(
                changed(packing, COLUMNS[kind], contact, share), tolerance=1e-10
            ).stiffness
            for share in (0.01, -0.01)
        ]
        difference = (ends[0] - ends[1]) / (0.02 * stiffness[contact])
        # Central differences of a share of 0.01 err by its square times the third derivative, to
        # which the motion of the contact's neighbours contributes as well: some ten times 1e-4.
        expected = derivative.stiffness[contact, kind]
        assert difference == pytest.approx(expected, abs=2e-3 * abs(expected).max())
