"""Means of a study's cases have the error that `measure` gives the same packings."""

import numpy as np
import pytest

from analysis.case_result import CaseResult
from analysis.frame import frame_of, mean_with_error
from analysis.measurement import Measurement, mean_of
from analysis.result_file import read_result, write_result
from analysis.study.figure_layout import plot_quantities
from analysis.study.tables import tabulate_limits, tabulate_means
from analysis.table import number
from analysis.value import estimate

VELOCITIES = {"a": (448.0, 70.0, 67.0), "b": (455.0, 71.0, 68.0), "c": (462.0, 69.0, 66.0)}
"""V_P of three short packings, m/s: value, error, and the part of the error that all share."""
V_S_OVER_V_P = 0.6
MAX_COMMON_ERROR = 68.0


def make_row(name: str, velocity: tuple[float, float, float]) -> CaseResult:
    """Make a result with V_P, and with V_S in a fixed ratio to it."""
    v_s = [V_S_OVER_V_P * number for number in velocity]
    values = {"v_p": estimate(*velocity), "v_s": estimate(*v_s)}
    return CaseResult(None, name, name, False, 1e5, 0.3, "linear", "", values)


@pytest.fixture
def cases(tmp_path):
    """Return the cases as a study reads them: each result is written and read."""
    rows = []
    for name, velocity in VELOCITIES.items():
        write_result(tmp_path / f"{name}.json", make_row(name, velocity))
        rows.append(read_result(tmp_path / f"{name}.json"))
    return frame_of(rows)


@pytest.fixture
def mean_of_measure():
    """Return mean and error of V_P by `measure`."""
    measurements = [Measurement({"v_p": estimate(*velocity)}) for velocity in VELOCITIES.values()]
    mean = mean_of(measurements)["v_p"]
    return float(mean.value), mean.error


def test_the_mean_is_that_of_measure(cases, mean_of_measure):
    assert mean_with_error(cases, "v_p") == pytest.approx(mean_of_measure)


def test_the_common_error_does_not_average_out(mean_of_measure):
    """Keep an error larger than the scatter of 4 m/s: each V_P, 455 m/s, is known to 70 m/s."""
    variances = [error**2 - common**2 for _, error, common in VELOCITIES.values()]
    independent = np.sqrt(sum(variances)) / len(VELOCITIES)
    assert mean_of_measure[1] == pytest.approx(np.hypot(MAX_COMMON_ERROR, independent))


def test_the_mean_of_an_expression_has_the_error_in_its_unit(cases, mean_of_measure):
    in_km = mean_with_error(cases, "v_p / 1000")
    assert in_km == pytest.approx([number / 1000 for number in mean_of_measure])


def test_a_common_error_cancels_in_a_ratio(cases):
    """Keep only the independent errors, as relative errors of both velocities.

    5 %: the change of a ratio with its denominator is not quite linear.
    """
    ratio, error = mean_with_error(cases, "v_s / v_p")
    relative = []
    for velocity, total, common in VELOCITIES.values():
        relative.append(np.sqrt(total**2 - common**2) / velocity)
    independent = np.linalg.norm(relative) / len(VELOCITIES)
    assert ratio == pytest.approx(V_S_OVER_V_P)
    assert error == pytest.approx(V_S_OVER_V_P * np.sqrt(2) * independent, rel=0.05)


def test_a_table_of_means_has_that_error(cases, mean_of_measure):
    spec = {"means": ["mu_comp"], "columns": {"V": "v_p"}}
    _, ((_, mean, count),) = tabulate_means(spec, cases)
    assert (mean, count) == (number(*mean_of_measure), "3")


def test_bars_of_a_figure_have_that_error(cases, mean_of_measure):
    picture = plot_quantities({"x": "stress", "y": ["v_p"], "by": "mu_comp"}, cases)
    _, bars = picture.panels[0].series
    mean, error = mean_of_measure
    assert [*bars.y] == pytest.approx([mean])
    assert [*bars.z] == pytest.approx([error])


def test_a_table_of_limits_has_the_error_of_the_mean(cases):
    """Average two cases at x = 1 in the column behind group and quantity."""
    spec = {"limit": {"x": "x", "own": 1.0, "by": ["mu_comp"]}, "columns": {"V": "v_p"}}
    _, (line,) = tabulate_limits(spec, cases.assign(x=[1.0, 1.0, 2.0]))
    assert line[2] == number(*mean_with_error(cases[:2], "v_p"))


def test_one_case_keeps_its_error(cases):
    assert mean_with_error(cases[:1], "v_p") == pytest.approx(VELOCITIES["a"][:2])


def test_a_quantity_of_no_case_has_no_mean(cases):
    assert np.isnan(mean_with_error(cases, "unknown")).all()
