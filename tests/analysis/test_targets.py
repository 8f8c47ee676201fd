"""Targets of a study: which made-up results meet them, and the scatter of seeds beside them."""

import numpy as np
import pytest
from places import ROOT
from refusals import refusal

from analysis.case_columns import of_one_producer
from analysis.case_result import CaseResult
from analysis.frame import frame_of, powers
from analysis.result_file import read_result, read_results, write_result
from analysis.study.description import Study
from analysis.study.finding import Finding
from analysis.study.rules import Rules
from analysis.study.tables import make_tables
from analysis.study.targets import answer_targets, tabulate_second_verdicts
from analysis.value import estimate

PAPER = ROOT / "studies/otsubo2017/study.yaml"


@pytest.fixture(scope="module")
def paper() -> Study:
    return Study(PAPER)


def made_up(number: int, mu: float, stress: float, record="linear", **values: float) -> CaseResult:
    """Return the result of a case of the paper with made-up values, each with no error."""
    name = f"case{number:02d}"
    crystal = number < 5
    row = CaseResult(number, name, name, crystal, stress, mu, record, "")
    row.values = {key: estimate(value) for key, value in values.items()}
    row.curves["first"] = (np.array([0.5]),)
    return row


def test_a_result_is_read_as_it_was_written(tmp_path):
    row = made_up(6, 0.1, 1e5, void_ratio=0.544, f_max_khz=np.nan)
    row.flat["2"] = True
    row.samples["void_ratio"] = 0.002
    write_result(tmp_path / "case06.json", row)
    again = read_result(tmp_path / "case06.json")
    assert again.value("void_ratio") == 0.544
    assert np.isnan(again.value("f_max_khz"))
    assert again.flat == {"2": True}
    assert again.spread("void_ratio") == 0.002
    assert again.curves["first"][0].tolist() == [0.5]


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"schema": "case_result", "version": 9}'])
def test_a_file_that_is_no_result_is_refused(tmp_path, text):
    (tmp_path / "bad.json").write_text(text)
    with refusal("result"):
        read_result(tmp_path / "bad.json")


FRICTIONS = (0.0, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4)
STRESSES = (1e4, 1e5, 1e6, 1e7)


def study_of(powers: list[float], edge: float = 1.3) -> list[CaseResult]:
    """Return results of one friction for each power b, over four stresses.

    The void ratio grows with the friction by 0.02; V_P is proportional to stress^b, and the
    low-pass frequency to V_P^edge.
    """
    rows = []
    for k, power in enumerate(powers):
        for n, stress in enumerate(STRESSES):
            growth = (stress / STRESSES[0]) ** power
            values = {
                "void_ratio": 0.54 + 0.02 * k,
                "v_p_first_peaks_linear_m_per_s": 500 * growth,
                "f_low_pass_2_linear_khz": 20 * growth**edge,
            }
            rows.append(made_up(5 + 4 * k + n, FRICTIONS[k], stress, **values))
    return rows


GROWING = [0.17 + 0.01 * k for k in range(7)]
SHRINKING = [0.24 - 0.01 * k for k in range(7)]
CONSTANT = [0.2] * 7


def find(study: Study, rows: list[CaseResult], target: str) -> Finding:
    """Return the finding of one target of a study with these results."""
    rules = Rules(frame_of(rows, study.cases), study.stated())
    (spec,) = (spec for spec in study.part("targets") if spec["id"] == target)
    return rules.find(spec)


def test_exponents_that_grow_with_void_ratio_meet_the_target(paper):
    finding = find(paper, study_of(GROWING), "rnd_b")
    assert finding.met
    assert finding.value == pytest.approx(0.17)


def test_slope_of_low_pass_frequency_over_velocity(paper):
    finding = find(paper, study_of(GROWING, edge=1.3), "rnd_slope")
    assert finding.value == pytest.approx(1.3)


def test_exponents_that_shrink_with_void_ratio_fail_the_target(paper):
    assert find(paper, study_of(SHRINKING), "rnd_b").failures == ("no_growth",)


def test_exponents_of_two_frictions_are_incomplete(paper):
    assert "incomplete" in find(paper, study_of(GROWING[:2]), "rnd_b").failures


LINE = [0.18 + 0.001 * k for k in range(7)]
SCATTERED = [power + 0.01 * (-1) ** k for k, power in enumerate(LINE)]


@pytest.mark.parametrize(
    ("exponents", "grows"),
    [
        pytest.param(LINE, True, id="on a line"),
        pytest.param(SCATTERED, False, id="scatter that hides the line"),
    ],
)
def test_growth_counts_beyond_twice_the_error_of_the_slope(paper, exponents, grows):
    frame = frame_of(study_of(exponents), paper.cases).query("kind == 'random'")
    fit = powers(frame, "stress", "v_p_first_peaks_linear_m_per_s")
    slope, error = fit.trend
    assert fit.whole
    assert (slope > 2 * error) == grows
    # 0.001 for each 0.02 of void ratio. Alternating deviations of 0.01 at k - 3 = -3 ... 3 have
    # sum((-1)^k (k - 3)) = 0 over the frictions, so the slope stays.
    assert slope == pytest.approx(0.001 / 0.02, rel=1e-6)


def test_powers_over_stress_are_of_one_producer(paper):
    """Take all velocities from the linear wave where one friction alone has runs of YADE."""
    rows = study_of(CONSTANT)
    for row in rows[:4]:
        row.record = "yade"
        row.values["v_p_first_peaks_yade_m_per_s"] = estimate(500 * (row.stress / 1e4) ** 0.3)
    producer, _ = of_one_producer([row.record for row in rows], "v_p_first_peaks_{record}_m_per_s")
    assert producer == "linear"
    assert find(paper, rows, "rnd_b").value == pytest.approx(0.2)


def test_one_case_outside_fails_a_target_of_all(paper):
    inside = [made_up(n, 0.0, 1e5, length_over_d=143.0) for n in range(5, 33)]
    assert find(paper, inside, "rnd_length").met
    inside[3].values["length_over_d"] = estimate(147.0)
    finding = find(paper, inside, "rnd_length")
    assert finding.failures == ("outside",)
    assert finding.outside == ("case08",)
    assert finding.value == 147.0


def test_a_power_without_all_its_numbers_is_not_met(paper):
    """Leave out one of the four stresses of the crystal, whose V_P grows with stress^(1/6)."""
    name = "v_p_first_peaks_yade_m_per_s"
    rows = [made_up(n, 0, 10.0 ** (3 + n), "yade", **{name: 10 ** (n / 6)}) for n in range(1, 5)]
    assert find(paper, rows, "fcc_b").met
    rows[3].values[name] = estimate(np.nan)
    finding = find(paper, rows, "fcc_b")
    assert finding.value == pytest.approx(1 / 6)
    assert finding.failures == ("incomplete",)


def results_that_meet(target: str) -> tuple[str, list[CaseResult]]:
    """Return a quantity and results with which a target of several cases is met."""
    if target == "gain_peak":
        numbers = (2, 3, 4, 6, 7, 8)
        return "gain_maximum", [made_up(n, 0, 1e5, gain_maximum=3.0) for n in numbers]
    return "f_max_khz", [made_up(n, 0, 1e5, f_max_khz=200.0 + n / 100) for n in range(1, 33)]


@pytest.mark.parametrize("target", ["gain_peak", "fmax_spread"])
def test_a_target_of_several_cases_needs_all_their_numbers(paper, target):
    name, rows = results_that_meet(target)
    assert find(paper, rows, target).met
    rows[4].values[name] = estimate(np.nan)
    assert not find(paper, rows, target).met


@pytest.mark.parametrize("target", ["gain_peak", "fmax_spread"])
def test_a_target_of_several_cases_needs_all_cases(paper, target):
    _, rows = results_that_meet(target)
    assert not find(paper, rows[:4], target).met


def test_the_spread_of_the_highest_frequency_is_that_of_the_most_different_cases(paper):
    """Lower case 30 (friction 0.4, 100 kPa) to 190 kHz: case 6 of the same stress is farthest."""
    name, rows = results_that_meet("fmax_spread")
    rows[29].values[name] = estimate(190.0)
    finding = find(paper, rows, "fmax_spread")
    assert finding.value == pytest.approx(100 * (200.06 / 190 - 1))
    assert not finding.met


@pytest.fixture
def case_6():
    """Return a result of case 6 that meets its targets of void ratio and low-pass frequency."""
    row = made_up(6, 0.0, 1e5, void_ratio=0.544, f_low_pass_2_khz=21.9)
    row.flat["2"] = True
    return row


@pytest.mark.parametrize("target", ["rnd_e_6", "rnd_flow_6"])
def test_a_settled_state_with_a_plateau_meets_the_targets(paper, case_6, target):
    assert find(paper, [case_6], target).met


def test_a_state_that_has_not_settled_meets_nothing(paper, case_6):
    case_6.unsettled = "residual 2e-2"
    assert find(paper, [case_6], "rnd_e_6").failures == ("unsettled",)


def test_a_threshold_on_no_plateau_meets_nothing(paper, case_6):
    case_6.flat["2"] = False
    assert "no_plateau" in find(paper, [case_6], "rnd_flow_6").failures


@pytest.fixture
def loose_state():
    """Return a state at 1 kPa that is no case of the paper."""
    row = CaseResult(None, "mu0.4_1000Pa", "", False, 1e3, 0.4, "", "", state=True)
    row.values["coordination_number"] = estimate(3.8)
    return row


def test_a_state_that_is_no_case_stands_beside_the_cases_of_its_friction(paper, loose_state):
    finding = find(paper, [loose_state, made_up(29, 0.4, 1e4)], "rnd_cn_loose")
    assert finding.value == 3.8
    assert finding.met


def test_a_state_that_is_no_case_must_have_settled(paper, loose_state):
    loose_state.unsettled = "residual 1e-2"
    finding = find(paper, [loose_state, made_up(29, 0.4, 1e4)], "rnd_cn_loose")
    assert finding.failures == ("unsettled",)


def test_a_quantity_of_no_case_is_not_measured(paper):
    finding = find(paper, [made_up(29, 0.4, 1e4)], "rnd_cn_dense")
    assert finding.failures == ("not_measured",)


def answers_to_statements(paper, ratio_of_3_percent: float) -> dict[str, str]:
    """Return "yes" or "no" for each statement of the paper, answered by the linear wave.

    The low-pass frequency is the paper's at 2 %; at 1 % it is 1.1 times that, at 3 % this ratio.
    """
    rows = study_of(CONSTANT, edge=1.25)
    # Case 6, of the second stress, has the paper's 21.9 kHz.
    factor = 21.9 / 20 / 10 ** (0.2 * 1.25)
    for row in rows:
        two = factor * row.value("f_low_pass_2_linear_khz")
        edges = {"2": two, "1": 1.1 * two, "3": ratio_of_3_percent * two}
        for percent, value in edges.items():
            row.values[f"f_low_pass_{percent}_linear_khz"] = estimate(value)
            row.values[f"lambda_{percent}_linear_over_d"] = estimate(10.0)
    frame = frame_of(rows, paper.cases)
    spec = [spec for spec in paper.part("tables") if spec["name"] == "statements"]
    (table,) = make_tables(spec, Rules(frame, paper.stated()))
    # Rules of which the study has no result have no row.
    (row,) = table.rows
    assert "linear wave" in row[0]
    answers = dict(zip(table.header, row, strict=True))
    del answers["rule"]
    return {statement: text.split(":")[0] for statement, text in answers.items() if text}


def refused_statements(answers: dict[str, str]) -> set[str]:
    """Return the statements answered by "no", but for growth, which equal powers do not show."""
    return {name for name, word in answers.items() if word == "no"} - {"slope grows with e"}


def test_a_rule_that_gives_the_papers_numbers_meets_its_statements(paper):
    assert refused_statements(answers_to_statements(paper, 0.97)) == set()


def test_a_rule_whose_thresholds_differ_fails_the_statements_about_them(paper):
    """Lower the edge at 3 % by a tenth: 2 and 3 % are no longer alike, nor nearer than 1 %."""
    answers = answers_to_statements(paper, 0.87)
    about_thresholds = {name for name in answers if "alike" in name or "further" in name}
    assert about_thresholds
    assert refused_statements(answers) == about_thresholds


@pytest.fixture(scope="module")
def case_of_two_samples(tmp_path_factory):
    """Return case 6 as read from two samples, beside a third sample of another case.

    One sample has a run of YADE, the other has none, so their linear waves are compared.
    """
    linear = "v_p_first_peaks_linear_m_per_s"
    yade = "v_p_first_peaks_yade_m_per_s"
    first = made_up(6, 0.0, 1e5, "yade", void_ratio=0.544, **{linear: 540.0, yade: 600.0})
    first.values["v_p_first_peaks_m_per_s"] = estimate(600.0)
    second = made_up(6, 0.0, 1e5, void_ratio=0.546, **{linear: 543.0})
    other_case = made_up(7, 0.0, 1e6, void_ratio=0.3)
    folder = tmp_path_factory.mktemp("seeds")
    for subfolder, row in ((".", first), ("seed_2", second), ("seed_3", other_case)):
        (folder / subfolder).mkdir(exist_ok=True)
        write_result(folder / subfolder / f"{row.name}.json", row)
    (row,) = read_results(folder)
    return row


def test_scatter_of_samples_is_their_standard_deviation(case_of_two_samples):
    """Take |a - b| / sqrt(2) of two samples; the other case is not among them."""
    assert case_of_two_samples.packings == 2
    assert case_of_two_samples.samples["void_ratio"] == pytest.approx(0.002 / 2**0.5)
    assert case_of_two_samples.spread("void_ratio") == pytest.approx(0.002 / 2**0.5)


def test_scatter_of_samples_is_that_of_one_producer(case_of_two_samples):
    scatter = case_of_two_samples.samples["v_p_first_peaks_m_per_s"]
    assert scatter == pytest.approx((543 - 540) / 2**0.5)


STUDY = """
groups:
  - {kind: random, factors: {friction: [0.1, 0.2], stress: [1e4, 1e5, 1e6]}, wave_friction: 0.3}
"""
TARGETS = """
- id: apart
  stated: below 3 %
  rule: extremes
  apart: {quantity: top, stated: top_apart}
  calibrated: a number was chosen by it
  second: {rule: beyond twice the error, apart: {quantity: top, stated: top_apart, errors: 2}}
- {id: alone, stated: "1", rule: none, near: {quantity: top, value: 1, within: 9}}
"""


def two_frictions(folder, scatter: float):
    """Return a study of six cases, and their results as a frame.

    At each stress "top" is 100 at the first friction and 4 % more at the second, with this scatter
    of samples.
    """
    (folder / "study.yaml").write_text(STUDY)
    (folder / "targets.yaml").write_text(TARGETS)
    header = "quantity,select,value,low,high,unit,where\n"
    (folder / "stated.csv").write_text(header + "top_apart,,,,3,%,here\n")
    study = Study(folder / "study.yaml")
    rows = []
    for name, case in study.cases.iterrows():
        row = CaseResult(None, name, name, False, case["stress"], case["mu_comp"], "linear", "")
        row.values["top"] = estimate(100.0 if case["mu_comp"] == 0.1 else 104.0)
        row.samples["top"] = scatter
        row.packings = 4
        rows.append(row)
    return study, frame_of(rows, study.cases)


@pytest.mark.parametrize(("scatter", "met"), [(0.01, "no"), (2.0, "yes")])
def test_a_difference_that_scatter_explains_is_met_by_the_second_rule_alone(tmp_path, scatter, met):
    """Find 4 % between the frictions, 1 % more than the 3 % that are asked for.

    The error of the ratio 104 / 100 is that of both numbers, added as squares.
    """
    study, frame = two_frictions(tmp_path, scatter)
    answers = answer_targets(study, frame)
    assert not any(answer.finding.met for answer in answers)
    assert answers[0].spec["calibrated"] in answers[0].finding.text
    (row,) = tabulate_second_verdicts(answers).rows
    target, _, first_verdict, _, value, error, second_verdict, _ = row
    assert (target, first_verdict, second_verdict) == ("apart", "no", met)
    assert float(value) == pytest.approx(4)
    # The table has two digits.
    expected = (scatter**2 + (100 * scatter / 104) ** 2) ** 0.5
    assert float(error) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(("errors", "met"), [(0, False), (2, True)])
def test_a_power_outside_by_less_than_its_error_is_inside(tmp_path, errors, met):
    """Fit powers of 0.5 to points of which one is 10 % off, with bounds just above 0.5."""
    study, frame = two_frictions(tmp_path, 0.0)
    frame["v"] = [1.0, 10**0.5 * 1.1, 10.0] * 2
    power = {"x": "stress", "y": "v", "low": 0.51, "high": 0.6, "errors": errors}
    assert Rules(frame, study.stated()).find({"id": "b", "power": power}).met is met


def test_bounds_between_which_no_number_lies_are_refused(tmp_path):
    study, frame = two_frictions(tmp_path, 0.0)
    rule = {"id": "b", "inside": {"quantity": "top", "low": 2, "high": 1}}
    with refusal("bounds"):
        Rules(frame, study.stated()).find(rule)
