"""Cement that hardens under load: against the model of coated grains, theory, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal

import modal
from modal.__main__ import main
from modal.packing.cementation import cemented
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.crystal import column
from modal.packing.network import read_network, write_network
from modal.packing.sample import sample_of_network
from modal.preparation.relax import relax
from modal.theory.effective_medium import assembly_of

YOUNG = 1e9
SHARE = 0.4
RATIO = 2.0


def test_springs_are_those_of_coated_grains_at_the_same_overlaps_and_forces_stay():
    """Compare with the model whose beams are without stress at touch: the springs are equal."""
    crystal = modal.fcc(1e5, (2, 2, 4))
    bonded = cemented(crystal, YOUNG, SHARE, RATIO)
    model = f"cement-bond {YOUNG} {SHARE} 1e7 {RATIO}"
    coated = sample_of_network(crystal, 0.3)
    coated = replace(coated, material=replace(GLASS, contact_model=model)).network()
    for name in ("normal", "tangential", "rolling", "twisting"):
        # The contacts of a sample are in another order.
        expected = np.sort(getattr(coated, f"stiffness_{name}"))
        stiffness = np.sort(getattr(bonded, f"stiffness_{name}"))
        np.testing.assert_allclose(stiffness, expected, rtol=1e-9)
    np.testing.assert_array_equal(bonded.force_normal, crystal.force_normal)
    assert coated.force_normal.min() > 1.1 * crystal.force_normal.min()
    assert not bonded.sliding.any()


def test_beams_between_spheres_and_at_a_wall_have_their_closed_forms():
    """Compare with E_c pi r^2 / (2 R) along the beam, and r^2 / 4 times it against rolling."""
    plain = column(40)
    bonded = cemented(plain, YOUNG, SHARE)
    beam = YOUNG * np.pi * (SHARE * RADIUS) ** 2 / (2 * RADIUS)
    pair = ~plain.with_wall
    added = bonded.stiffness_normal - plain.stiffness_normal
    np.testing.assert_allclose(added[pair], beam, rtol=1e-12)
    # The beam at a flat wall is half as long.
    np.testing.assert_allclose(added[~pair], 2 * beam, rtol=1e-12)
    rolling = beam * (SHARE * RADIUS) ** 2 / 4
    np.testing.assert_allclose(bonded.stiffness_rolling[pair], rolling, rtol=1e-12)
    np.testing.assert_allclose(bonded.stiffness_twisting[pair], 2 * rolling / 2.5, rtol=1e-12)


def test_cement_is_refused_where_it_has_no_meaning():
    bonded = cemented(column(4), YOUNG, SHARE)
    with refusal("cemented"):
        cemented(bonded, YOUNG, SHARE)
    with refusal("cement_bond"):
        cemented(column(4), YOUNG, 2.0)
    tensor = np.tile(np.eye(3), (4, 1, 1)) * column(4).inertia[:, None, None]
    with refusal("clumps"):
        cemented(replace(column(4), inertia_tensor=tensor), YOUNG, SHARE)
    with refusal("other_law"):
        modal.propagate(bonded, 1e-5, nonlinear=True, friction=0.3)
    with refusal("cemented"):
        assembly_of(bonded)
    with refusal("other_law"):
        relax(sample_of_network(bonded, 0.3))


def test_command_writes_the_bonds(tmp_path, printed, one_line):
    plain = tmp_path / "plain.network.h5"
    bonded = tmp_path / "bonded.network.h5"
    write_network(plain, column(6))
    summary = printed("cement", plain, "--cement", YOUNG, SHARE, "-o", bonded)
    network = read_network(bonded)
    expected = cemented(column(6), YOUNG, SHARE)
    assert network.matches(expected.fingerprint)
    ratio = network.stiffness_normal.mean() / column(6).stiffness_normal.mean()
    assert summary["stiffness_normal_over_before"] == pytest.approx(ratio, rel=1e-12)
    words = f"cement {plain} --cement 1e9 -o {tmp_path}/b.network.h5"
    one_line(main, words.split(), code="cement_bond")
