"""Where means over seeds lead as a setting goes to zero, tried on lines that are known."""

import json

import numpy as np
import pandas as pd
import pytest
from packings import random_sample

from analysis.__main__ import main
from analysis.estimators.fits import straight_line
from analysis.study.tables import tabulate_limits
from modal.packing.sample import write_sample


def test_limit_of_a_line_is_exact_and_its_error_that_of_least_squares():
    size, value = np.array([1.0, 2.0, 4.0]), np.array([3.0, 5.0, 9.0])
    there = straight_line(size, value, np.full(3, 0.1))
    assert (there.offset, there.chi) == pytest.approx((1.0, 0.0), abs=1e-12)
    # sigma^2 (1/n + mean^2 / sum (x - mean)^2), the textbook's error of an intercept.
    spread = ((size - size.mean()) ** 2).sum()
    assert there.at(0.0)[1] == pytest.approx(0.1 * np.sqrt(1 / 3 + size.mean() ** 2 / spread))
    assert np.isnan(straight_line(size[:1], value[:1], np.full(1, 0.1)).offset)


def test_distance_from_the_limit_is_that_of_independent_draws():
    """Means of eight seeds without any effect: beyond one and two errors as often as a normal.

    Errors from eight seeds make it somewhat more often, Student's t of 7 degrees of freedom, 35 and
    8.6 % for 32 and 4.6: the bounds. An enlargement where chi^2 exceeds 1 makes it less often. Of
    4,000 draws the share is known to 0.8 %. Measured against the error of the limit alone, which
    the point itself has a part in, it was 63 and 33 %.
    """
    random, size = np.random.default_rng(5), np.array([1.0, 0.5, 0.25, 0.125])
    distance = []
    for _ in range(4000):
        seeds = random.standard_normal((4, 8))
        value, error = seeds.mean(axis=1), seeds.std(axis=1, ddof=1) / np.sqrt(8)
        distance.append(straight_line(size, value, error).distance(size[0], value[0], error[0]))
    share = [np.mean(np.abs(distance) > beyond) for beyond in (1, 2)]
    assert 0.15 < share[0] < 0.35 + 0.024 and share[1] < 0.086 + 0.013


def test_scatter_about_the_line_beyond_the_errors_enlarges_them():
    size, value = np.array([1.0, 2.0, 3.0]), np.array([1.0, 4.0, 1.0])
    few, same, many = (straight_line(size, value, np.full(3, e)) for e in (0.1, 0.2, 10.0))
    assert few.chi > 1 > many.chi
    # Weights that are equal drop out: the error is that of the scatter, whatever was said of it.
    assert few.at(0.0)[1] == pytest.approx(same.at(0.0)[1])
    assert many.at(0.0)[1] == pytest.approx(100 * few.at(0.0)[1] / np.sqrt(few.chi))


def test_table_tells_the_limit_of_what_was_drawn_about_a_line():
    """e is 0.6 + 0.1 x, with noise, of forty seeds each."""
    random, x = np.random.default_rng(5), np.repeat([0.7, 0.35, 0.175], 40)
    e = 0.6 + 0.1 * x + 0.05 * random.normal(size=len(x))
    cases = pd.DataFrame({"mu_comp": 0.4, "step": x, "void_ratio": e})
    sweep = {"x": "step", "own": 0.7, "by": ["mu_comp"]}
    _, lines = tabulate_limits({"limit": sweep, "columns": {"e": "void_ratio"}}, cases)
    ((mu, name, here, there, *_),) = lines
    assert (mu, name) == ("0.4", "e")
    # Forty draws: their standard error is known to 11 %, three times that with the rounding.
    (value, error), (least, spread) = (map(float, text.split(" ± ")) for text in (here, there))
    assert error == pytest.approx(0.05 / np.sqrt(40), rel=0.4)
    assert abs(value - 0.67) < 4 * error and abs(least - 0.6) < 4 * spread


def test_numbers_of_a_packing_are_those_of_its_contacts(tmp_path):
    sample, names = random_sample(150, 1e7, aspect=1.5, tolerance=1e-4), ("coordination",)
    write_sample(tmp_path / "a.sample.h5", sample)
    names += ("force_squared", "residual")
    asked = ["--quantities", *names, "-o", str(tmp_path / "a.json")]
    assert main(["measure", str(tmp_path / "a.sample.h5"), *asked]) == 0
    found, contact = json.loads((tmp_path / "a.json").read_text()), sample.contacts()
    pairs, walls = (contact.particle_j >= 0).sum(), (contact.particle_j < 0).sum()
    assert found["coordination"]["value"] == pytest.approx((2 * pairs + walls) / 150)
    # Hertz: forces go with the overlap to 3/2; those of walls are left out.
    force = contact.overlap[contact.particle_j >= 0] ** 1.5
    expected = (force**2).mean() / force.mean() ** 2
    assert found["force_squared"]["value"] == pytest.approx(expected, rel=1e-9)
    assert found["residual"]["value"] < 1e-4
