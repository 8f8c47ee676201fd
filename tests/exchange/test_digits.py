"""Which digits of a dump tell how well positions are known: those of positions and radii alone.

Three spheres between two walls, springs of 1e5 and 8e4 N/m: closed forms below.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from program_files import COLUMN_PAIR, COLUMN_WALL, column
from refusals import refusal

import modal
from modal.exchange.digits import count_significant_digits
from modal.exchange.registry import import_packing

MASS = 1.3


def imported(path: Path) -> modal.Network:
    return import_packing(path, pair=COLUMN_PAIR, wall=COLUMN_WALL).network


ROUND = {
    "binary": ("0.0000000000000000e+00 8.0000000000000000e+00",) * 2
    + ("0.0000000000000000e+00 1.6000000000000000e+01",),
    "short": ("0 8.1", "-1.25 7", "0 16"),
    "fractions": ("-3.7500000000000000e-01 8.1250000000000000e+00",) * 2
    + ("0.0000000000000000e+00 1.6000000000000000e+01",),
    "six digits": ("0 8.12345", "0 8.12346", "0 16.1234"),
    "single": ("0.10000000149011612 8.1000003814697266",) * 2 + ("0 16.100000381469727",),
}
"""Bounds that are exact, chosen, or rounded, where no contact goes through a period."""


@pytest.mark.parametrize("bounds", ROUND)
def test_bounds_are_no_sign_of_how_positions_were_written(tmp_path, bounds):
    """Compare motions along z with those of a chain of three masses between walls.

    A chain of n masses with both ends held by the same springs: 2 sqrt(k/m) sin(j pi / (2n + 2)).
    """
    network = imported(column(tmp_path, bounds=ROUND[bounds]))
    assert network.n_contacts == 4
    frequency = modal.eigenmodes(network, all=True).frequency
    angle = np.arange(1, 4) * np.pi / 8
    chain = np.sqrt(network.stiffness_normal[0] / MASS) * np.sin(angle) / np.pi
    for expected in chain:
        # Digits of eigenvalues that differ by a factor of 12 among 18.
        assert abs(frequency / expected - 1).min() < 1e-12


@pytest.mark.parametrize(("layout", "digits"), [(".5g", 5), (".9g", 9)])
def test_positions_count_by_their_own_digits(tmp_path, layout, digits):
    path = column(tmp_path, bounds=ROUND["binary"], x=4.12312345678912345, layout=layout)
    if digits == 5:
        with refusal("few_digits"):
            imported(path)
    else:
        figures = import_packing(path, pair=COLUMN_PAIR, wall=COLUMN_WALL).told
        # The median overlap, 1.5e-5 m of 1e-5 and 2e-5, over steps of 1e-8 m, divided by sqrt(6).
        assert figures["overlap_over_error_of_digits"] == pytest.approx(
            1.5e3 * np.sqrt(6), rel=1e-6
        )


def test_bounds_in_six_digits_blur_contacts_through_their_period(tmp_path):
    """Check a period of 2.12345 m, as LIGGGHTS writes it: overlaps there are known to 1e-5 m."""
    path = column(tmp_path, bounds=("0 2.12345", "0 8", "0 16"), x=0.25)
    text = path.read_text().replace("OF ATOMS\n3", "OF ATOMS\n4")
    crossing = " ".join(f"{number:.16e}" for number in (0.25 - 0.99999 + 2.12345, 4.123, 0.49999))
    path.write_text(f"{text}4 1 {crossing} 5.0000000000000000e-01 {MASS}\n")
    with refusal("few_digits"):
        imported(path)
    # Where the program wrote them in full, these are the contacts with the floor and the neighbour.
    path.write_text(path.read_text().replace("0 2.12345\n", "0 2.1234500000000001e+00\n"))
    assert imported(path).n_contacts == 6


@pytest.mark.parametrize(
    ("values", "digits"),
    [
        ([0.5, 0.25, 8.0], 17),
        ([0.1, 0.2, 0.3], 7),
        ([0.001953125, 1.0], 17),
        ([1.7], 7),
    ],
)
def test_single_precision_is_told_from_numbers_that_are_exact_in_it(values, digits):
    """Round numbers to single precision, and write them with 17 digits."""
    texts = [f"{float(np.float32(value)):.16e}" for value in values]
    assert count_significant_digits(texts) == digits
