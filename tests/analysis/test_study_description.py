"""A study's YAML: factors make cases, settings follow them, and what means nothing is refused."""

import os

import pytest
from refusals import refusal

from analysis.__main__ import main
from analysis.case_result import CaseResult
from analysis.frame import frame_of
from analysis.result_file import write_result
from analysis.study.description import Study
from analysis.study.page import page
from analysis.study.rules import Rules
from analysis.study.tables import make_tables
from analysis.value import estimate
from modal.tools.errors import InputError

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
    assert len(cases) == 12
    assert cases.index[-1] == "friction0.4_width5_seed3"
    assert cases["width"].tolist() == [4, 4, 4, 5, 5, 5] * 2
    assert cases["mu_wave"].tolist() == [0.1] * 6 + [0.5] * 6
    assert cases["input_frequency"].tolist() == [1e5] * 6 + [2e5] * 6
    frame = frame_of([_of_sweep(k, row) for k, row in cases.iterrows()], cases)
    spec = {"name": "means", "title": "", "means": ["mu_comp", "width"], "columns": {"V": "v_p"}}
    rules = Rules(frame, Study(path).stated())
    (table,) = make_tables([spec], rules)
    # 500 + 10 times the seed: mean 520, standard error 10 / sqrt 3.
    assert table.rows[0] == ["0", "4", "520 ± 6", "3"]
    assert len(table.rows) == 4
    with refusal("entry"):
        make_tables([spec | {"columns": 3}], rules)


def _of_sweep(name: str, case) -> CaseResult:
    row = CaseResult(None, name, name, False, 1e5, case["mu_comp"], "linear", "")
    row.values["v_p"] = estimate(500 + 10 * case["seed"])
    return row


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("name: sweep", "nam: sweep", "unknown_setting"),
        ("name: sweep", "name: ../sweep", "setting"),
        ("name: sweep", "name: sweep\nname: other", "yaml"),
        ("name: sweep", "name: {a: 1}", "setting"),
        ("name: sweep", "name: !!python/object/apply:os.system [id]", "yaml"),
        ("name: sweep", "name: !!binary aGFsbG8=", "yaml"),
        ("name: sweep", "samples: $(id)", "setting"),
        ("name: sweep", "samples: a b", "setting"),
        ("name: sweep", "spheres: true", "setting"),
        ("name: sweep", "spheres: 0", "setting"),
        ("name: sweep", "spheres: 10.5", "setting"),
        ("name: sweep", "seed: -1", "setting"),
        ("name: sweep", "prepare: $(id)", "setting"),
        ("name: sweep", "forget: 1", "setting"),
        ("name: sweep", "lowest_modes: .inf", "setting"),
        ("name: sweep", "amplitude: .nan", "setting"),
        ("name: sweep", "headlines: [case99]", "unknown_case"),
        ("name: sweep", "cases: {case99: {stress: 1e5}}", "unknown_case"),
        ("name: sweep", "cases: [1]", "setting"),
        ("name: sweep", "names: 'c{foo}'", "setting"),
        ("name: sweep", "names: 'c{0.__class__}'", "setting"),
        ("name: sweep", "names: 'c{:999999999d}'", "setting"),
        ("name: sweep", "names: 'c{:2d}'", "setting"),
        ("name: sweep", "names: 'c$(id){:d}'", "setting"),
        ("name: sweep", "names: '../c{:d}'", "setting"),
        ("name: sweep", "names: '-c{:d}'", "setting"),
        ("name: sweep", "names: 'a b{:d}'", "setting"),
        ("name: sweep", "names: one", "same_name"),
        ("kind: random", "kind: cubic", "kind"),
        ("kind: random", "kind: [random]", "kind"),
        ("stress: 1e5", "", "no_setting"),
        ("stress: 1e5", "stress: high", "unknown_name"),
        ("stress: 1e5", "stress: 0", "setting"),
        ("stress: 1e5", "stress: -1e5", "setting"),
        ("stress: 1e5", "stress: true", "setting"),
        ("stress: 1e5", "stress: .nan", "setting"),
        ("stress: 1e5", "stress: .inf", "setting"),
        ("stress: 1e5", "stress: null", "setting"),
        ("stress: 1e5", "stress:", "setting"),
        ("stress: 1e5", "stress: [1e5]", "setting"),
        ("stress: 1e5", "stress: {1: 2}", "no_factor"),
        ("stress: 1e5", "stress: {by: [1]}", "no_factor"),
        ("stress: 1e5", "stress: 1.2.3e5", "expression"),
        ("stress: 1e5", "stress: 2000-01-01", "expression"),
        ("stress: 1e5", "stress: 1e5\n    stress: 2e5", "yaml"),
        ("stress: 1e5", "stress: 1e5\n    direction: up", "setting"),
        ("stress: 1e5", "stress: 1e5\n    contact_model: $(id)linear", "setting"),
        ("stress: 1e5", "stress: 1e5\n    contact_model: linear -o /tmp/x", "setting"),
        ("stress: 1e5", "stress: 1e5\n    contact_model: 'linear 1e-6'", "setting"),
        ("stress: 1e5", "stress: 1e5\n    sizes: two 2 `id`", "setting"),
        ("stress: 1e5", "stress: 1e5\n    densities: 2500; id", "setting"),
        ("stress: 1e5", "stress: 1e5\n    periodic: 1", "setting"),
        ("stress: 1e5", "stress: 1e5\n    residual: 2", "setting"),
        ("stress: 1e5", "stress: 1e5\n    residual: 0", "setting"),
        ("stress: 1e5", "stress: 1e5\n    residual: 1", "setting"),
        ("stress: 1e5", "stress: 1e5\n    damping: -0.5", "setting"),
        ("stress: 1e5", "stress: 1e5\n    1e5: 3", "unknown_setting"),
        ("stress: 1e5", "stress: 1e5\n    ? [a]\n    : 3", "yaml"),
        ("width: [4, 5]", "breadth: [4, 5]", "unknown_setting"),
        ("width: [4, 5]", "width: [4, 4]", "same_name"),
        ("width: [4, 5]", "width: [4, null]", "setting"),
        ("width: [4, 5]", "width: [4, {a: 1}]", "setting"),
        ("width: [4, 5]", "width: [a, b]", "setting"),
        ("width: [4, 5]", "width: []", "no_cases"),
        ("width: [4, 5]", "width: 8 to 1", "no_cases"),
        ("width: [4, 5]", "width: 1 to 999999999", "too_many_cases"),
        ("width: [4, 5], seed: 1 to 3", "width: 1 to 900, seed: 1 to 900", "too_many_cases"),
        ("width: [4, 5]", "contact_model: [$(id)]", "setting"),
        ("friction + 0.1", "friction + mu", "unknown_name"),
        ("friction + 0.1", "9**9**9**9 + friction", "expression_value"),
        ("friction + 0.1", "friction == 0", "setting"),
        ("friction + 0.1", "friction + os.system('id')", "expression"),
        ("friction + 0.1", "friction - 1", "setting"),
        ("friction + 0.1", "1 / friction", "expression_value"),
        ("by: friction", "by: colour", "no_factor"),
        ("0.4: 2e5", "0.04: 2e5", "absent_choice"),
        ("0.4: 2e5", "a: 2e5", "absent_choice"),
        ("measure: [v_p]", "measure: [v_p", "yaml"),
        ("measure: [v_p]", "measure: v_p", "setting"),
        ("measure: [v_p]", "measure: [v_pp]", "unknown_word"),
        ("measure: [v_p]", "make: {random: 3}", "setting"),
        ("measure: [v_p]", "make: {random: [../x]}", "setting"),
        ("measure: [v_p]", "make: {cubic: []}", "setting"),
        ("measure: [v_p]", "bands: {case01: 9}", "setting"),
        ("measure: [v_p]", "bands: {case01: [1, 2]}", "unknown_case"),
        ("measure: [v_p]", "band: [2, 1]", "band"),
        ("measure: [v_p]", "states: [low]", "setting"),
        ("measure: [v_p]", "states: [-1]", "setting"),
        ("measure: [v_p]", "title: &a b\nmeasure: *a", "setting"),
        ("measure: [v_p]", "measure: &a [*a]", "yaml"),
        ("measure: [v_p]", "measure: " + "[" * 5000, "yaml"),
        ("{friction: [0, 0.4], width: [4, 5], seed: 1 to 3}", "[1]", "no_names"),
    ],
)
def test_a_study_that_means_none_is_refused_in_one_line(old, new, code, tmp_path, one_line):
    path = tmp_path / "sweep.yaml"
    assert old in SWEEP
    path.write_text(SWEEP.replace(old, new, 1))
    with pytest.raises(InputError) as refused:
        Study(path)
    assert refused.value.code == code, refused.value
    one_line(main, ["study", path, "--results", tmp_path])


@pytest.mark.parametrize(
    ("name", "value"),
    [("spheres", 1), ("layers", 1), ("spheres", 100_000_000), ("seed", 0), ("seed", 2**31 - 1)],
)
def test_the_ends_of_a_range_may_be_set(name, value, tmp_path):
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP.replace("name: sweep", f"name: sweep\n{name}: {value}"))
    assert Study(path).settings[name] == value


def test_what_a_study_does_not_say_is_as_in_the_paper(tmp_path):
    """Find crystals of 4 x 4 x 200 and packings of 35,201 spheres, as in stated.csv."""
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP)
    settings = Study(path).settings
    assert (settings["layers"], settings["spheres"]) == (200, 35201)


def test_a_study_may_have_as_many_cases_as_the_limit(tmp_path, monkeypatch):
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP)
    monkeypatch.setattr("analysis.study.description.MAX_CASES", 12)
    assert len(Study(path).cases) == 12
    monkeypatch.setattr("analysis.study.description.MAX_CASES", 11)
    with refusal("too_many_cases"):
        Study(path)


def test_a_quantity_called_as_a_setting_is_what_was_measured(tmp_path):
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP.replace("stress: 1e5", "stress: 1e5\n    particles: 1"))
    study = Study(path)
    rows = [_of_sweep(name, case) for name, case in study.cases.iterrows()]
    for row in rows:
        row.values["particles"] = estimate(110.0)
    assert (frame_of(rows, study.cases)["particles"] == 110).all()


def test_a_setting_and_a_quantity_of_one_name_are_refused(tmp_path):
    """Refuse a study that has both: a selection could mean either."""
    path = tmp_path / "sweep.yaml"
    text = SWEEP.replace("stress: 1e5", "stress: 1e5\n    residual: 1e-3")
    path.write_text(text.replace("measure: [v_p]", "measure: [residual]"))
    with refusal("same_name"):
        Study(path)


def test_references_that_grow_without_end_are_refused(tmp_path):
    """Refuse nine lines that stand for a thousand million numbers."""
    text = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
    for k in range(1, 9):
        ten_references = ", ".join([f"*a{k - 1}"] * 10)
        text += f"a{k}: &a{k} [{ten_references}]\n"
    (tmp_path / "bomb.yaml").write_text(text)
    with refusal("yaml"):
        Study(tmp_path / "bomb.yaml")


@pytest.mark.parametrize("kind", ["folder", "absent", "pipe", "large", "binary", "empty"])
def test_what_is_no_file_of_a_study_is_refused(kind, tmp_path):
    path = tmp_path / "own.yaml"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "large":
        path.write_text("# \n" * 500_000)
    elif kind == "binary":
        path.write_bytes(b"\xff\xfe\x00")
    elif kind == "empty":
        path.write_bytes(b"")
    with pytest.raises(InputError) as refused:
        Study(path)
    assert refused.value.code in ("no_file", "size", "no_names")


def test_numbers_are_decimal_and_merged_lines_are_overridden(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text(
        "groups:\n  - &a {kind: random, factors: {seed: [010]}, spheres: 1e3, stress: 1.5E+5,"
        " friction: 0.3, wave_friction: 0.4}\n  - {<<: *a, factors: {seed: [2]}, friction: .5}\n"
    )
    first, second = Study(path).rows.values()
    assert first["seed"] == 10
    assert first["spheres"] == 1000
    assert isinstance(first["spheres"], int)
    assert first["stress"] == 1.5e5
    assert second["mu_comp"] == 0.5
    assert second["mu_wave"] == 0.4


ENTRY = {
    "tables": "- {name: all, title: All, columns: {case: name}}",
    "figures": "- {name: speed, caption: V_P, plot: {x: mu_comp, y: [v_p], by: width}}",
    "targets": '- {id: e, stated: "1", rule: r, near: {quantity: v_p, value: 1, within: 9}}',
}


@pytest.mark.parametrize(
    ("part", "old", "new"),
    [
        ("tables", "name: all", "name: ../all"),
        ("tables", "name: all", "name: /tmp/all"),
        ("tables", "name: all", "name: .all"),
        ("tables", "name: all", "name: 'a b'"),
        ("tables", "name: all", "name: table1"),
        ("tables", "title: All", "titel: All"),
        ("tables", "{case: name}", "{case: 'name | 999999999d'}"),
        ("tables", "{case: name}", '{case: "v_p.__class__"}'),
        ("tables", "{case: name}", "{case: 5}"),
        ("tables", "{case: name}", "name"),
        ("tables", "title: All", "title: All, select: \"@pd.io.common.os.system('id') == 0\""),
        ("tables", "title: All", "title: All, select: 5"),
        ("tables", "columns: {case: name}", 'says: {a: "{{ cycler.__init__ }}"}'),
        ("tables", "columns: {case: name}", "means: 3"),
        ("figures", "name: speed", "name: ../../speed"),
        ("figures", "name: speed", "name: all"),  # the table's CSV
        ("figures", "caption: V_P", 'caption: "{{ cycler.__init__.__globals__ }}"'),
        ("figures", "caption: V_P", 'caption: "{% for a in b %}"'),
        ("figures", "y: [v_p]", "y: [\"__import__('os')\"]"),
        ("figures", "y: [v_p]", "y: v_p"),
        ("figures", "plot:", "columns: 0, plot:"),
        ("figures", "plot:", "columns: 1.5, plot:"),
        ("figures", "plot:", "height: 1e9, plot:"),
        ("figures", "by: width", "by: colour"),
        ("targets", "value: 1", "value: .nan"),
        ("targets", "value: 1", "value: true"),
        ("targets", "within: 9", "within: 1.2.3 %"),
        ("targets", "within: 9", "within: 9, mention: ['{row.__class__}']"),
        ("targets", "within: 9", "within: 9, mention: ['{v_p:999999999}']"),
        ("targets", "quantity: v_p", 'quantity: v_p, select: "().__class__ == 1"'),
        ("targets", "- {", "{"),
    ],
)
def test_an_entry_of_a_part_that_means_none_is_one_line(part, old, new, tmp_path, one_line):
    """Refuse it in one line, and write only into the requested folder."""
    study = tmp_path / "own"
    study.mkdir()
    (study / "sweep.yaml").write_text(SWEEP)
    assert old in ENTRY[part]
    for name, entry in ENTRY.items():
        text = entry.replace(old, new, 1) if name == part else entry
        (study / f"{name}.yaml").write_text(text + "\n")
    results(tmp_path / "results", study / "sweep.yaml")
    command = ["study", study / "sweep.yaml", "--results", tmp_path / "results"]
    one_line(main, [*command, "-o", tmp_path / "a/b/out"])
    assert {path.name for path in tmp_path.iterdir()} <= {"own", "results", "a"}
    assert not list(tmp_path.glob("a/*.*"))
    assert not list(tmp_path.glob("a/b/*.*"))


def results(folder, path):
    """Return results of a study's cases, as they are measured."""
    folder.mkdir()
    for name, row in Study(path).cases.iterrows():
        write_result(folder / f"{name}.json", _of_sweep(name, row))


@pytest.mark.parametrize(
    "line",
    [
        "v_p,@pd.io.common.os.system('id') == 0,1,,,1,a",
        "v_p,width == 4,one,,,1,a",
        "v_p,width == 4,inf,,,1,a",
        "v p,width == 4,1,,,1,a",
        "v_p,width == 4,,3,2,m/s,a",
        "v_p,width == 4,1,2,3,m/s,a",
        "v_p,width == 4,0.5,,,km/s,a",
        "f_max_khz,width == 4,2e5,,,Hz,a",
        ",,,,,,",
        "v_p,case in,1,,,1,a",
    ],
)
def test_stated_numbers_are_data(line, tmp_path, one_line):
    (tmp_path / "sweep.yaml").write_text(SWEEP)
    (tmp_path / "stated.csv").write_text(f"quantity,select,value,low,high,unit,where\n{line}\n")
    results(tmp_path / "results", tmp_path / "sweep.yaml")
    command = ["study", tmp_path / "sweep.yaml", "--results", tmp_path / "results"]
    one_line(main, [*command, "-o", tmp_path / "out"])


@pytest.mark.parametrize(
    "text",
    [
        "{{ cycler.__init__.__globals__.os.popen('id').read() }}",
        "{{ cases.__class__.__mro__ }}",
        "{{ cases.clear() }}",
        "{{ targets.write_csv('x.csv') }}",
        "{{ settings.name.upper() }}",
        "{{ '%999999999d'|format(1) }}",
        "{{ 'a' * 999999999 }}",
        "{{ 9 ** 9 ** 9 }}",
        "{{ range(999999999)|list }}",
        "{% set a = [settings.name, settings.name]|join %}",
        "{% set a = settings.name ~ settings.name %}",
        "{% include 'sweep.yaml' %}",
        "{% extends '/etc/passwd' %}",
        "{% import 'plain.html.j2' as a %}",
        "{% macro a() %}{{ a() }}{% endmacro %}{{ a() }}",
        "{% for a in cases %}" * 3 + "{% endfor %}" * 3,
        "{{ none.a.b }}",
        "{{ " + "(" * 2000 + "1" + ")" * 2000 + " }}",
        "{% if",
    ],
)
def test_a_page_of_a_study_is_no_program(text, tmp_path):
    (tmp_path / "page.html.j2").write_text(text)
    with pytest.raises(InputError) as refused:
        page(tmp_path, {"settings": {"name": "a"}, "cases": {"a": {"v": 1.0}}, "targets": {}})
    assert refused.value.code == "template"
    assert "\n" not in str(refused.value)


def test_all_that_a_page_shows_is_escaped(tmp_path):
    """Show titles, captions, heads of columns and targets that contain HTML."""
    mark = r"""<script>alert(1)</script>\"'"""
    (tmp_path / "sweep.yaml").write_text(SWEEP.replace("name: sweep", f'title: "{mark}"'))
    texts = {
        "tables": f'- {{name: all, title: "{mark}", columns: {{"{mark}": name}}}}',
        "figures": ENTRY["figures"].replace("V_P", f'"{mark}"'),
        "targets": ENTRY["targets"].replace("id: e", f'id: "{mark}"').replace("r,", f'"{mark}",'),
    }
    for name, text in texts.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    results(tmp_path / "results", tmp_path / "sweep.yaml")
    command = ["study", tmp_path / "sweep.yaml", "--results", tmp_path / "results"]
    assert main([*map(str, command), "-o", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out/study.html").read_text()
    assert "<script" not in text
    assert text.count("&lt;script&gt;") >= 5
