"""Sizes that packings should have: one constant each, which the documents have too."""

import re
from pathlib import Path

import numpy as np
import pytest
from changes import bare
from packings import slender

import modal
from analysis.packing_data import PackingData
from analysis.quantities import QUANTITIES
from modal.packing.plausibility import LONG_FOR_LOW_PASS, LONG_FOR_VELOCITY, MIN_WIDTH_IN_DIAMETERS
from modal.preparation.protocol import NOMINAL_FRACTION

DOCS = Path(__file__).parents[2] / "docs"


def number(page: str, pattern: str) -> float:
    """The number of a sentence on a page, whose lines may break anywhere."""
    text = " ".join((DOCS / page).read_text().split())
    (word,) = re.findall(pattern, text)
    return float(word.replace(",", ""))


@pytest.mark.parametrize(
    ("page", "pattern", "constant"),
    [
        ("choose.md", r"at least (\d+) D wide", MIN_WIDTH_IN_DIAMETERS),
        ("choose.md", r"velocities a length of (\d+) D", LONG_FOR_VELOCITY),
        ("choose.md", r"low-pass frequencies a length of (\d+) D", LONG_FOR_LOW_PASS),
        ("choose.md", r"must be at least (\d+) D long", LONG_FOR_LOW_PASS),
        ("lammps.md", r"at least (\d+) D x 8 D x 50 D", MIN_WIDTH_IN_DIAMETERS),
        ("lammps.md", r"at least 8 D x 8 D x (\d+) D", LONG_FOR_LOW_PASS),
        ("preparation.md", r"the cell is some (\d+) D wide", MIN_WIDTH_IN_DIAMETERS),
    ],
)
def test_documents_advise_what_the_code_asks_for(page, pattern, constant):
    assert number(page, pattern) == constant


@pytest.mark.parametrize(
    ("page", "pattern", "length"),
    [
        ("choose.md", r"usual width ([\d,]+)\)", LONG_FOR_VELOCITY),
        ("choose.md", r"low-pass frequencies a length of 50 D \(([\d,]+)\)", LONG_FOR_LOW_PASS),
        ("tutorial.md", r"a packing of ([\d,]+) spheres is long enough", LONG_FOR_LOW_PASS),
    ],
)
def test_as_many_spheres_as_the_documents_say_make_that_length(page, pattern, length):
    """At the usual width, with the solid fraction that `pack` reckons with; not twice as many."""
    spheres = number(page, pattern)
    reached = spheres * np.pi / 6 / NOMINAL_FRACTION / MIN_WIDTH_IN_DIAMETERS**2
    assert length < reached < 1.3 * length


def caveats(network, name):
    return QUANTITIES[name].measured(PackingData(network)).caveats


def test_a_narrow_cell_is_said_where_a_wave_is_read_and_nowhere_else():
    """Of 200 spheres 3.5 D wide: what differs between waves and the packing itself is the width."""
    packing = PackingData(slender())
    assert packing.width < MIN_WIDTH_IN_DIAMETERS
    (narrow,) = set(packing.of_waves) - set(packing.of_one_sample)
    assert narrow in caveats(slender(), "v_p")
    for name in ("void_ratio", "highest_frequency", "v_p_static"):
        assert narrow not in caveats(slender(), name)


def test_a_velocity_by_the_moduli_is_of_no_wave():
    cell = modal.random_packing(110, seed=2, friction=0.6, aspect=1, periodic=True)
    packing = PackingData(bare(cell, "cell_shift"))
    (narrow,) = set(packing.of_waves) - set(packing.of_one_sample)
    assert narrow not in QUANTITIES["v_p"].measured(packing).caveats
