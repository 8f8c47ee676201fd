"""Limits of means over seeds as a setting goes to zero, on lines that are known."""

import json

import numpy as np
import pandas as pd
import pytest
from packings import random_sample

from analysis.__main__ import main
from analysis.estimators.fits import straight_line
from analysis.study.tables import tabulate_limits
from modal.packing.sample import write_sample

SIZE = np.array([1.0, 2.0, 4.0])


@pytest.fixture(scope="module")
def exact_line():
    """Return the line through points on 1 + 2 x, each with an error of 0.1."""
    return straight_line(SIZE, 1 + 2 * SIZE, np.full(3, 0.1))


def test_limit_of_a_line_is_exact(exact_line):
    assert exact_line.offset == pytest.approx(1.0)
    assert exact_line.chi == pytest.approx(0.0, abs=1e-12)


def test_error_of_a_limit_is_that_of_least_squares(exact_line):
    """Compare with the textbook's sigma^2 (1/n + mean^2 / sum (x - mean)^2)."""
    spread = ((SIZE - SIZE.mean()) ** 2).sum()
    expected = 0.1 * np.sqrt(1 / 3 + SIZE.mean() ** 2 / spread)
    assert exact_line.at(0.0)[1] == pytest.approx(expected)


def test_one_point_has_no_limit():
    assert np.isnan(straight_line(SIZE[:1], SIZE[:1], np.full(1, 0.1)).offset)


@pytest.fixture(scope="module")
def distances():
    """Return the distances from the limit, in errors, of 4,000 draws of means without any effect.

    Each mean is that of eight seeds.
    """
    random = np.random.default_rng(5)
    size = np.array([1.0, 0.5, 0.25, 0.125])
    distances = []
    for _ in range(4000):
        seeds = random.standard_normal((4, 8))
        mean = seeds.mean(axis=1)
        error = seeds.std(axis=1, ddof=1) / np.sqrt(8)
        line = straight_line(size, mean, error)
        distances.append(line.distance(size[0], mean[0], error[0]))
    return np.array(distances)


@pytest.mark.parametrize(
    ("errors", "low", "high"), [(1, 0.15, 0.35 + 0.024), (2, 0, 0.086 + 0.013)]
)
def test_distance_from_the_limit_is_that_of_independent_draws(errors, low, high, distances):
    """Find as many beyond one and two errors as of a normal distribution.

    Errors from eight seeds make it somewhat more, Student's t of 7 degrees of freedom, 35 and 8.6 %
    for 32 and 4.6: the bounds. An enlargement where chi^2 exceeds 1 makes it less. Of 4,000 draws
    the share is known to 0.8 %, added three times. By the error of the limit alone, in which the
    point itself has a part, it was 63 and 33 %.
    """
    assert low < np.mean(np.abs(distances) > errors) < high


def line_through_scatter(error):
    """Return the line through points that scatter by 1.4, with an error that is stated."""
    return straight_line(np.array([1.0, 2.0, 3.0]), np.array([1.0, 4.0, 1.0]), np.full(3, error))


def test_scatter_about_the_line_beyond_the_errors_enlarges_them():
    """Find the error of the scatter, whatever error is stated: equal weights drop out."""
    assert line_through_scatter(0.1).chi > 1
    expected = line_through_scatter(0.2).at(0.0)[1]
    assert line_through_scatter(0.1).at(0.0)[1] == pytest.approx(expected)


def test_scatter_about_the_line_within_the_errors_does_not_lessen_them():
    assert line_through_scatter(10.0).chi < 1
    small = line_through_scatter(0.1)
    expected = 100 * small.at(0.0)[1] / np.sqrt(small.chi)
    assert line_through_scatter(10.0).at(0.0)[1] == pytest.approx(expected)


def test_table_has_the_limit_of_draws_about_a_line():
    """Draw e = 0.6 + 0.1 x, with noise, of forty seeds each."""
    random = np.random.default_rng(5)
    step = np.repeat([0.7, 0.35, 0.175], 40)
    void_ratio = 0.6 + 0.1 * step + 0.05 * random.normal(size=len(step))
    cases = pd.DataFrame({"mu_comp": 0.4, "step": step, "void_ratio": void_ratio})
    sweep = {"x": "step", "own": 0.7, "by": ["mu_comp"]}
    _, rows = tabulate_limits({"limit": sweep, "columns": {"e": "void_ratio"}}, cases)
    ((friction, name, value_text, limit_text, *_),) = rows
    assert (friction, name) == ("0.4", "e")
    value, error = map(float, value_text.split(" ± "))
    limit, limit_error = map(float, limit_text.split(" ± "))
    # Forty draws: their standard error is known to 11 %, three times that with the rounding.
    assert error == pytest.approx(0.05 / np.sqrt(40), rel=0.4)
    assert abs(value - 0.67) < 4 * error
    assert abs(limit - 0.6) < 4 * limit_error


@pytest.fixture(scope="module")
def sample():
    """Return a sample under a large stress, in balance to 1e-4."""
    return random_sample(150, 1e7, aspect=1.5, tolerance=1e-4)


@pytest.fixture(scope="module")
def numbers_of_sample(sample, tmp_path_factory):
    """Return the numbers of the sample as `measure` writes them."""
    folder = tmp_path_factory.mktemp("sample")
    write_sample(folder / "a.sample.h5", sample)
    output = folder / "a.json"
    names = ["coordination", "force_squared", "residual"]
    command = ["measure", str(folder / "a.sample.h5"), "--quantities", *names, "-o", str(output)]
    assert main(command) == 0
    return json.loads(output.read_text())


def test_coordination_counts_a_pair_twice_and_a_wall_once(sample, numbers_of_sample):
    partner = sample.contacts().particle_j
    expected = (2 * (partner >= 0).sum() + (partner < 0).sum()) / 150
    assert numbers_of_sample["coordination"]["value"] == pytest.approx(expected)


def test_spread_of_forces_is_that_of_hertz_by_overlaps_of_pairs(sample, numbers_of_sample):
    """Find forces that go with the overlap to 3/2; those of walls are left out."""
    contacts = sample.contacts()
    force = contacts.overlap[contacts.particle_j >= 0] ** 1.5
    expected = (force**2).mean() / force.mean() ** 2
    assert numbers_of_sample["force_squared"]["value"] == pytest.approx(expected, rel=1e-9)


def test_residual_is_below_that_of_the_preparation(numbers_of_sample):
    assert numbers_of_sample["residual"]["value"] < 1e-4
