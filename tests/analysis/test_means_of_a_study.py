"""Means of a study's cases have the error that `measure` gives the same packings."""

import numpy as np
import pytest

from analysis.frame import frame_of, mean_with_error
from analysis.measurement import Measurement, mean_of
from analysis.rows import CaseResult, read_result, write_result
from analysis.study.figure_layout import plot_quantities
from analysis.study.tables import tabulate_limits, tabulate_means
from analysis.table import number
from analysis.value import estimate

VELOCITIES = {"a": (448.0, 70.0, 67.0), "b": (455.0, 71.0, 68.0), "c": (462.0, 69.0, 66.0)}
"""Of three short packings, m/s: value, error, and the part of it that all share."""


def row(name: str, velocity: tuple[float, float, float]) -> CaseResult:
    values = {"v_p": estimate(*velocity), "v_s": estimate(*(0.6 * x for x in velocity))}
    return CaseResult(None, name, name, False, 1e5, 0.3, "linear", "", values)


@pytest.fixture
def cases(tmp_path):
    """As a study reads them: each result written and read."""
    rows = []
    for name, velocity in VELOCITIES.items():
        write_result(tmp_path / f"{name}.json", row(name, velocity))
        rows.append(read_result(tmp_path / f"{name}.json"))
    return frame_of(rows)


@pytest.fixture
def wanted():
    """Mean and error as `measure` has them."""
    each = [Measurement({"v_p": estimate(*velocity)}) for velocity in VELOCITIES.values()]
    mean = mean_of(each)["v_p"]
    return float(mean.value), mean.error


def test_the_mean_is_that_of_measure(cases, wanted):
    """Not the scatter alone: 455 +- 4 of packings each of which is known to 70."""
    assert mean_with_error(cases, "v_p") == pytest.approx(wanted)
    own = np.sqrt([error**2 - common**2 for _, error, common in VELOCITIES.values()])
    assert wanted[1] == pytest.approx(np.hypot(68.0, np.linalg.norm(own) / 3))
    in_km = mean_with_error(cases, "v_p / 1000")
    assert in_km == pytest.approx([x / 1000 for x in wanted])


def test_an_error_that_both_have_leaves_no_trace_in_their_ratio(cases):
    """V_S over V_P: what is common to both cancels, what is each one's own does not."""
    ratio, error = mean_with_error(cases, "v_s / v_p")
    assert ratio == pytest.approx(0.6)
    own = [np.sqrt(e**2 - c**2) / v for v, e, c in VELOCITIES.values()]
    assert error == pytest.approx(0.6 * np.sqrt(2) * np.linalg.norm(own) / 3, rel=0.05)


def test_tables_bars_and_limits_have_that_error(cases, wanted):
    _, ((*_, shown, count),) = tabulate_means(
        {"means": ["mu_comp"], "columns": {"V": "v_p"}}, cases
    )
    assert (shown, count) == (number(*wanted), "3")
    picture = plot_quantities({"x": "stress", "y": ["v_p"], "by": "mu_comp"}, cases)
    _, bars = picture.panels[0].series
    assert [*bars.y] == pytest.approx([wanted[0]])
    assert [*bars.z] == pytest.approx([wanted[1]])
    two = cases.assign(x=[1.0, 1.0, 2.0])
    spec = {"limit": {"x": "x", "own": 1.0, "by": ["mu_comp"]}, "columns": {"V": "v_p"}}
    _, ((_, _, first, *_),) = tabulate_limits(spec, two)
    assert first == number(*mean_with_error(two[:2], "v_p"))


def test_one_case_keeps_its_own_error_and_none_has_no_mean(cases):
    assert mean_with_error(cases[:1], "v_p") == pytest.approx(VELOCITIES["a"][:2])
    assert np.isnan(mean_with_error(cases, "unknown")).all()
