"""The table of a case: it fits a terminal, and its verdicts are those of its numbers."""

import re

import numpy as np
import pytest
from places import ROOT

from analysis.study.case_table import (
    EXACT_AGREEMENT,
    RANDOM_AGREEMENT,
    _verdict_beside,
    case_text,
    verdict_of,
)
from analysis.study.description import Study

CASES = [f"case{number:02d}" for number in (1, 2, 6, 22, 29, 30)]
"""Crystals with and without a comparison, packings that agree and packings that do not."""


@pytest.fixture(scope="module")
def texts(tmp_path_factory):
    """Return the tables of committed results, by case; leave out the other cases."""
    results = tmp_path_factory.mktemp("results")
    for name in [*CASES, "mu0_1000Pa", "mu0.4_1000Pa"]:
        (results / f"{name}.json").symlink_to(ROOT / f"results/study/cases/{name}.json")
    study = Study(ROOT / "studies/otsubo2017/study.yaml")
    return {case: case_text(study, results, case)[0] for case in CASES}


def rows_of(text):
    """Return the lines of the table itself, each with the indented line below it."""
    _, table, _ = text.split("\n\n")
    return re.sub(r"\n {4}", " | ", table).splitlines()[1:]


@pytest.mark.parametrize("case", CASES)
def test_table_fits_80_columns_and_each_row_has_a_verdict(texts, case):
    assert max(map(len, texts[case].splitlines())) <= 80
    rows = rows_of(texts[case])
    assert len(rows) > 7
    verdict = r"(agrees (within|exactly)|differs by .*\| differs because|nothing to compare)"
    assert all(re.search(verdict, row) for row in rows)


@pytest.mark.parametrize("case", CASES)
def test_last_paragraph_names_pages_that_exist(texts, case):
    last = texts[case].rpartition("\n\n")[2]
    pages = re.findall(r"docs/\w+\.md", last)
    assert pages
    assert all((ROOT / page).exists() for page in pages)


def test_verdict_of_a_crystal_covers_the_largest_deviation_of_its_row(texts):
    """Compute the deviation from the digits as printed.

    Each number may be off by half of its last digit, 0.05 % at most.
    """
    compared = 0
    for row in rows_of(texts["case02"]):
        numbers = [float(text) for text in row[24:60].split()]
        shown = re.search(r"(agrees within|differs by) ([\d.]+) %", row)
        if row.startswith("off theory") or not shown:
            continue
        deviation = 100 * (max(numbers) / min(numbers) - 1)
        assert deviation <= float(shown[2]) + 0.05
        assert (float(shown[2]) > EXACT_AGREEMENT) == (shown[1] == "differs by")
        compared += 1
    assert compared > 10


def test_deviation_is_rounded_up():
    rng = np.random.default_rng(1)
    for deviation in 10 ** rng.uniform(-2, 3, 200):
        shown = float(verdict_of(deviation, 1.0).text.split()[2])
        # Two digits above 1 %, one below: at most doubled by rounding.
        assert deviation * (1 - 1e-6) <= shown <= 2 * deviation
        assert verdict_of(deviation, 1.0).differs == (deviation > 1.0)


def test_error_excuses_a_deviation_from_a_number_but_not_from_a_range():
    beyond = 100 * (1 + 1.5 * RANDOM_AGREEMENT / 100)
    assert _verdict_beside(beyond, 0.0, 100, 100).differs
    assert not _verdict_beside(beyond, 2.0, 100, 100).differs
    assert _verdict_beside(beyond, 2.0, 90, 100).differs
    assert not _verdict_beside(95, 0.0, 90, 100).differs
    assert not _verdict_beside(5.0, 0.0, 1, np.inf).differs
    assert _verdict_beside(0.5, 0.0, 1, np.inf).text == "differs by 50 %"
