"""A study's YAML: factors make cases, settings follow them, and what means nothing is refused."""

import pytest

from analysis.__main__ import main
from analysis.frame import frame_of
from analysis.rows import Row
from analysis.study.description import Study
from analysis.study.tables import tables
from analysis.study.targets import Rules
from analysis.value import estimate

SWEEP = """
name: sweep
groups:
  - kind: random
    factors: {friction: [0, 0.4], width: [4, 5], seed: 1 to 3}
    width: 9                 # a factor comes before what the group says for all
    stress: 1e5
    wave_friction: friction + 0.1
    input_frequency: {by: friction, 0.4: 2e5, else: 1e5}
measure: [v_p]
"""


def test_factors_make_cases_and_settings_follow_them(tmp_path):
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP)
    cases = Study(path).cases
    assert len(cases) == 12 and cases.index[-1] == "friction0.4_width5_seed3"
    assert cases["width"].tolist() == [4, 4, 4, 5, 5, 5] * 2
    assert cases["mu_wave"].tolist() == [0.1] * 6 + [0.5] * 6
    assert cases["input_frequency"].tolist() == [1e5] * 6 + [2e5] * 6
    frame = frame_of([_of_sweep(k, row) for k, row in cases.iterrows()], cases)
    spec = {"name": "means", "title": "", "means": ["mu_comp", "width"], "columns": {"V": "v_p"}}
    rules = Rules(frame, Study(path).stated())
    (table,) = tables([spec], rules)
    # 500 + 10 times the seed: mean 520, standard error 10 / sqrt 3.
    assert table.rows[0] == ["0", "4", "520 ± 6", "3"] and len(table.rows) == 4
    with pytest.raises(ValueError, match="means: cannot be made"):
        tables([spec | {"columns": 3}], rules)


def _of_sweep(name: str, case) -> Row:
    row = Row(None, name, name, False, 1e5, case["mu_comp"], "linear", "")
    row.values["v_p"] = estimate(500 + 10 * case["seed"])
    return row


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("name: sweep", "nam: sweep", "setting nam is unknown"),
        ("kind: random", "kind: cubic", "kind cubic is none of"),
        ("stress: 1e5", "", "has no stress"),
        ("stress: 1e5", "stress: high", "stress high is no number"),
        ("stress: 1e5", "stress: 0", "above 0"),
        ("width: [4, 5]", "breadth: [4, 5]", "factor breadth is unknown"),
        ("width: [4, 5]", "width: [4, 4]", "two cases of one name"),
        ("friction + 0.1", "friction + mu", "is no sum"),
        ("by: friction", "by: colour", "by colour is no factor"),
        ("measure: [v_p]", "measure: [v_p", "not YAML"),
        ("measure: [v_p]", "measure: v_p", "measure v_p: give a list"),
        ("measure: [v_p]", "make: {random: 3}", "make: random 3: give a list of kinds of product"),
        ("measure: [v_p]", "bands: {case01: 9}", "bands: case01 9: give a list of two frequenc"),
        ("measure: [v_p]", "states: [low]", "states ['low']: give a list of stresses, Pa"),
        ("{friction: [0, 0.4], width: [4, 5], seed: 1 to 3}", "[1]", "factors have names"),
    ],
)
def test_a_study_that_means_none_is_refused_in_one_line(old, new, said, tmp_path, one_line):
    path = tmp_path / "sweep.yaml"
    assert old in SWEEP
    path.write_text(SWEEP.replace(old, new, 1))
    one_line(main, ["study", path, "--results", tmp_path], said)
