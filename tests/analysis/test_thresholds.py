"""Sizes that packings should have: one constant each, which the documents also state."""

import re
from pathlib import Path

import numpy as np
import pytest
from changes import bare
from packings import slender

import modal
from analysis.packing_data import PackingData
from analysis.quantities import QUANTITIES
from modal.packing.shape_remarks import LONG_FOR_LOW_PASS, LONG_FOR_VELOCITY, MIN_WIDTH_IN_DIAMETERS
from modal.preparation.study import NOMINAL_FRACTION

DOCS = Path(__file__).parents[2] / "docs"


def read_number(page: str, pattern: str) -> float:
    """Return the number of a sentence on a page, whose lines may break anywhere."""
    text = " ".join((DOCS / page).read_text().split())
    (word,) = re.findall(pattern, text)
    return float(word.replace(",", ""))


@pytest.mark.parametrize(
    ("page", "pattern", "constant"),
    [
        ("choose.md", r"at least (\d+) D wide", MIN_WIDTH_IN_DIAMETERS),
        ("choose.md", r"velocities a length of (\d+) D", LONG_FOR_VELOCITY),
        ("choose.md", r"low-pass frequencies (\d+) D", LONG_FOR_LOW_PASS),
        ("choose.md", r"must be at least (\d+) D long", LONG_FOR_LOW_PASS),
        ("lammps.md", r"at least (\d+) D x 8 D x 50 D", MIN_WIDTH_IN_DIAMETERS),
        ("lammps.md", r"at least 8 D x 8 D x (\d+) D", LONG_FOR_LOW_PASS),
        ("preparation.md", r"the cell is some (\d+) D wide", MIN_WIDTH_IN_DIAMETERS),
    ],
)
def test_documents_advise_what_the_code_asks_for(page, pattern, constant):
    assert read_number(page, pattern) == constant


@pytest.mark.parametrize(
    ("page", "pattern", "length"),
    [
        ("choose.md", r"velocities a length of 25 D \(([\d,]+) spheres\)", LONG_FOR_VELOCITY),
        ("choose.md", r"low-pass frequencies 50 D \(([\d,]+)\)", LONG_FOR_LOW_PASS),
        ("tutorial.md", r"a low-pass frequency, which takes ([\d,]+) spheres", LONG_FOR_LOW_PASS),
    ],
)
def test_as_many_spheres_as_the_documents_say_make_that_length(page, pattern, length):
    """Compute the length at the usual width, with the solid fraction that `pack` assumes."""
    spheres = read_number(page, pattern)
    reached_length = spheres * np.pi / 6 / NOMINAL_FRACTION / MIN_WIDTH_IN_DIAMETERS**2
    assert length < reached_length < 1.3 * length


def caveats_of(network, name):
    """Return the caveats of a quantity of a network."""
    return QUANTITIES[name].measured(PackingData(network)).caveats


def width_caveat(packing):
    """Return the one caveat that waves have because of the width."""
    (caveat,) = set(packing.of_waves) - set(packing.of_one_sample)
    return caveat


def test_narrow_cell_is_a_caveat_of_what_is_read_from_waves():
    """Take 200 spheres 3.5 D wide."""
    packing = PackingData(slender())
    assert packing.width < MIN_WIDTH_IN_DIAMETERS
    assert width_caveat(packing) in caveats_of(slender(), "v_p")


@pytest.mark.parametrize("name", ["void_ratio", "highest_frequency", "v_p_static"])
def test_narrow_cell_is_no_caveat_of_what_needs_no_wave(name):
    assert width_caveat(PackingData(slender())) not in caveats_of(slender(), name)


def test_narrow_cell_is_no_caveat_of_a_velocity_by_the_moduli():
    cell = modal.random_packing(110, seed=2, friction=0.6, aspect=1, periodic=True)
    packing = PackingData(bare(cell, "cell_shift"))
    assert width_caveat(packing) not in QUANTITIES["v_p"].measured(packing).caveats
