"""Jobs of a study: their cases, settings, commands and resources."""

import os
import re
import shlex
import subprocess
from types import SimpleNamespace

import pytest
from refusals import refusal
from study_folder import PAPER

PATHS = {"study": PAPER, "products": "products"}


@pytest.fixture
def paper_jobs(jobs):
    """Return the jobs of the paper's study."""
    return jobs.Jobs(PATHS)


def test_jobs_ask_for_what_their_size_takes(paper_jobs):
    """Compare 35,201 spheres, whose measured cost is in costs.tsv, with a crystal of 3,200."""
    needs = paper_jobs.needs("yade_wave")
    large = SimpleNamespace(case="case30")
    small = SimpleNamespace(case="case02")
    assert needs["mem_mb"](large, 1) >= 1586
    assert needs["mem_mb"](small, 1) < needs["mem_mb"](large, 1)
    assert needs["runtime"](large, 1) > 58
    assert needs["runtime"](small, 1) < 30


@pytest.mark.parametrize("resource", ["mem_mb", "runtime"])
def test_second_attempt_asks_for_twice_as_much(resource, paper_jobs):
    need = paper_jobs.needs("yade_wave")[resource]
    case = SimpleNamespace(case="case30")
    # Both numbers are rounded to integers.
    assert need(case, 2) == pytest.approx(2 * need(case, 1), abs=1)


@pytest.mark.parametrize("resource", ["mem_mb", "runtime"])
def test_job_of_no_case_has_the_size_of_the_first_case(resource, jobs, paper_jobs):
    need = jobs.Jobs(PATHS | {"cases": [30]}).needs("yade_wave")[resource]
    expected = paper_jobs.needs("yade_wave")[resource](SimpleNamespace(case="case30"), 1)
    assert need(SimpleNamespace(), 1) == expected


def test_needs_have_no_other_resource(paper_jobs):
    assert set(paper_jobs.needs("yade_wave")) == {"mem_mb", "runtime"}


def test_half_the_step_keeps_the_recorded_times_and_waits_for_the_s_wave(paper_jobs):
    line = paper_jobs.line("case30", "wave", run="half_step")
    assert line["fraction"] == 0.1
    assert line["interval"] == 0
    assert line["passage"] > 1.3


def test_small_reverse_wave_has_the_negative_amplitude(paper_jobs):
    line = paper_jobs.line("case30", "wave", run="small_reverse")
    assert line["amplitude"] == pytest.approx(-2.5e-11, rel=1e-6, abs=0)


@pytest.mark.parametrize(
    ("stage", "files"),
    [
        ("wave", ["products/case06.signals.h5"]),
        ("split", ["products/results/case06.agreement.csv"]),
        ("result", ["products/results/case06.json"]),
        ("page", ["products/study/study.html"]),
    ],
)
def test_a_stage_ends_with_its_files(stage, files, jobs):
    assert jobs.Jobs(PATHS | {"stage": stage, "cases": [6]}).targets() == files


def test_further_wave_has_its_own_frequency(paper_jobs):
    assert paper_jobs.line("case03", "wave")["input_frequency"] == 2e5
    assert paper_jobs.line("case03", "wave", run="100kHz")["input_frequency"] == 1e5


def test_direction_is_quoted_for_yade_which_evaluates_cells_as_python(paper_jobs):
    assert paper_jobs.line("case30", "wave", run="shear_yade")["direction"] == "x"
    command = paper_jobs.yade_command("case30", "wave", "signals", "wave", run="shear_yade")
    assert '"x"' in command


def test_reduced_study_keeps_the_slenderness(jobs):
    rows = jobs.Jobs(PATHS | {"spheres": 1000}).rows
    assert rows["case30"]["width"] == pytest.approx(14.65 * (1000 / 35201) ** (1 / 3), abs=1e-4)
    assert rows["case02"]["layers"] == 40


def test_reduced_study_compresses_without_yade(jobs):
    reduced_jobs = jobs.Jobs(PATHS | {"spheres": 1000})
    assert reduced_jobs.committed_sample("case30") is None
    assert "modal pack --friction 0.4" in reduced_jobs.walk_command("mu0.4")


def test_study_from_scratch_takes_no_committed_sample(jobs):
    full_jobs = jobs.Jobs(PATHS | {"from_scratch": True})
    assert full_jobs.rows["case02"]["layers"] == 200  # the paper's 4 x 4 x 200
    assert len(full_jobs.walks) == 7
    samples = [full_jobs.committed_sample(case) for case in full_jobs.cases_of_kind("random")]
    assert not any(samples)
    assert "compress.py" in full_jobs.walk_command("mu0.4")
    assert "--spheres 35201" in full_jobs.walk_command("mu0")


@pytest.fixture
def split_command(paper_jobs):
    """Return a function that returns the words of a rule's command, with bands of two cases."""
    paper_jobs.study.settings["bands"] = {"case06": [0.5, 2.0], "case07": [0, 3.0]}

    def split(rule: str, case: str) -> list[str]:
        return shlex.split(paper_jobs.network_command(rule, case))

    return split


def test_modes_are_sought_in_the_band_of_the_case(split_command):
    words = split_command("band_modes", "case06")
    first = words.index("--between") + 1
    assert [float(word) for word in words[first : first + 2]] == [0.5, 2.0]


def test_band_from_zero_has_an_upper_end_alone(split_command):
    words = split_command("band_modes", "case07")
    assert float(words[words.index("--below") + 1]) == 3.0


def test_number_of_lowest_modes_is_that_of_the_study(split_command, paper_jobs):
    words = split_command("lowest_modes", "case06")
    expected = paper_jobs.study.settings["lowest_modes"]
    assert words[words.index("--lowest") + 1] == str(expected)


def test_every_place_in_a_command_is_filled(paper_jobs, import_module):
    for rule in import_module("commands").OF_NETWORK:
        assert "{" not in paper_jobs.network_command(rule, "case06"), rule


def test_wave_takes_twice_as_long_in_a_packing_of_eight_times_the_spheres(jobs):
    short = jobs.Jobs(PATHS | {"spheres": 1000}).duration("case06")
    long = jobs.Jobs(PATHS | {"spheres": 8000}).duration("case06")
    assert long == pytest.approx(2 * short, rel=1e-3)


def test_duration_of_a_wave_falls_as_the_velocity_rises_with_the_stress(jobs):
    """Compare case 7 with case 6, at a tenth of its stress.

    The velocity is proportional to stress^(1/6).
    """
    small_jobs = jobs.Jobs(PATHS | {"spheres": 1000})
    ratio = small_jobs.duration("case06") / small_jobs.duration("case07")
    assert ratio == pytest.approx(10 ** (1 / 6), rel=1e-3)


@pytest.mark.parametrize("case", ["case02", "case03", "case06"])
def test_commands_make_each_product_that_a_result_is_measured_from(case, jobs):
    """Find all products among those of the commands.

    YADE's jobs make sample and network beside a wave; `measure` keeps spectra.
    """
    small_jobs = jobs.Jobs(PATHS | {"spheres": 1000})
    commands = "\n".join(small_jobs.product_commands(case))
    made_beside = {"sample", "network", "response", "density", "structure"}
    for kind in set(small_jobs.product_kinds(case)) - made_beside:
        assert small_jobs.product(case, kind) in commands, kind


@pytest.fixture
def without_wave_variables(monkeypatch):
    """Remove the variables WAVE_* of the caller."""
    for name in [name for name in os.environ if name.startswith("WAVE_")]:
        monkeypatch.delenv(name)


def test_environment_without_variables_of_waves_is_empty(import_module, without_wave_variables):
    assert import_module("commands").environment() == ":"


def test_yades_waves_get_the_variables_of_waves_alone(
    import_module, without_wave_variables, monkeypatch
):
    for name, value in {"WAVE_B": "2; id", "WAVE_A": "1", "OTHER": "3", "WAVE_2-": "4"}.items():
        monkeypatch.setenv(name, value)
    environment = import_module("commands").environment()
    assert environment == "export WAVE_A=1 WAVE_B='2; id'"


ODD_NAME = "odd name; touch made_by_the_shell $(id) 'a' \"b\" *"
"""A name that the shell would interpret; studies with such names are refused before."""


@pytest.fixture
def commands_of_odd_name(paper_jobs):
    """Return three commands for a case with an odd name."""
    paper_jobs.rows[ODD_NAME] = paper_jobs.rows["case30"]
    return [
        paper_jobs.relax_command(ODD_NAME, f"{ODD_NAME}.h5"),
        paper_jobs.network_command("highest_mode", ODD_NAME),
        paper_jobs.measure_commands(ODD_NAME, [f"{ODD_NAME}.h5"])[-1],
    ]


@pytest.mark.parametrize("number", range(3), ids=["relax", "network", "measure"])
def test_odd_name_stays_one_word_of_a_command(number, commands_of_odd_name):
    words = shlex.split(commands_of_odd_name[number])
    words_with_name = [word for word in words if "odd" in word]
    assert words_with_name
    assert all(word.count(ODD_NAME) == 1 for word in words_with_name)


def test_odd_name_reaches_the_table_of_yade_as_it_is(import_module, tmp_path, monkeypatch):
    command = import_module("commands").write_line(
        {"direction": ODD_NAME, "case": 3}, f"{tmp_path}/{ODD_NAME}"
    )
    monkeypatch.chdir(tmp_path)
    subprocess.run(["bash", "-c", command], check=True)
    header, cells = (tmp_path / ODD_NAME).read_text().splitlines()
    assert header == "direction case"
    assert cells.endswith(" 3")
    assert [path.name for path in tmp_path.iterdir()] == [ODD_NAME]


@pytest.mark.parametrize(
    "settings",
    [
        {"products": "my products"},
        {"products": "$(id)"},
        {"products": "{case}"},
        {"products": "-o"},
        {"study": "a b.yaml"},
        {"study": "x';id;'.yaml"},
        {"study": ["a.yaml"]},
    ],
    ids=str,
)
def test_path_that_rules_cannot_hold_is_refused(settings, jobs):
    with refusal("path"):
        jobs.Jobs(PATHS | settings)


@pytest.mark.parametrize(
    ("word", "cases"),
    [
        ("8", ["case08"]),
        ("010", ["case10"]),
        ("case06", ["case06"]),
        ("fcc", ["case01", "case02", "case03", "case04"]),
    ],
)
def test_cases_are_chosen_by_number_name_or_kind(word, cases, jobs):
    assert jobs.Jobs(PATHS | {"cases": [word]}).cases == cases


@pytest.mark.parametrize("word", ["99", "0", "", "$(id)", "case6"])
def test_unknown_case_is_refused(word, jobs):
    with refusal("unknown_case"):
        jobs.Jobs(PATHS | {"cases": [word]})


MANY_CASES = """
groups:
  - {kind: fcc, factors: {friction: [0]}, stress: 1e5, wave_friction: 0.1}
  - kind: random
    factors: {friction: [0.1, 1], seed: 1 to 2000}
    stress: 1e5
    wave_friction: 0.1
"""


@pytest.fixture
def many_jobs(jobs, tmp_path):
    """Return the jobs of a study of four thousand random cases and a crystal."""
    study = tmp_path / "many.yaml"
    study.write_text(MANY_CASES)
    return jobs.Jobs(PATHS | {"study": str(study)})


@pytest.mark.parametrize("kind", ["fcc", "random"])
def test_pattern_of_thousands_of_names_stays_short(kind, many_jobs):
    assert len(many_jobs.pattern(many_jobs.cases_of_kind(kind))) < 2000


@pytest.mark.parametrize("name", ["friction0", "friction0.1_seed7", "friction1_seed2000"])
@pytest.mark.parametrize("kind", ["fcc", "random"])
def test_pattern_matches_whole_names_of_its_kind(kind, name, many_jobs):
    pattern = many_jobs.pattern(many_jobs.cases_of_kind(kind))
    file = re.compile(rf"(?P<case>{pattern})\.signals\.h5$")
    match = file.match(f"{name}.signals.h5")
    if name in many_jobs.cases_of_kind(kind):
        assert match["case"] == name
    else:
        assert match is None
    assert not file.match(f"{name}.reverse.signals.h5")


@pytest.mark.parametrize("name", ["c{}.linear", "c{}Pa"], ids=["product", "state"])
def test_name_that_ends_as_another_file_of_a_case_is_refused(name, jobs, tmp_path):
    study = tmp_path / "odd.yaml"
    study.write_text(
        f"names: '{name}'\ngroups: [{{kind: fcc, friction: 0, stress: 1, wave_friction: 0}}]"
    )
    with refusal("name"):
        jobs.Jobs(PATHS | {"study": str(study)})
