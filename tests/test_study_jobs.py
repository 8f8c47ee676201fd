"""Jobs of any study: commands, paths and needs, what is refused, the status of YADE."""

import importlib
import os
import re
import shlex
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest
from in_yade import forked
from places import ROOT
from study_folder import PAPER

from modal.tools.errors import InputError

pytest.importorskip("snakemake")


def test_jobs_ask_for_what_their_size_takes_and_a_retry_for_more(jobs):
    """Crystals of 3,200 spheres ask for less, and measured ones change nothing of others."""
    found = jobs.Jobs({"study": PAPER, "products": "products"})
    need = found.needs("yade_wave")
    large, small = SimpleNamespace(case="case30"), SimpleNamespace(case="case02")
    assert need["mem_mb"](large, 1) >= 1586 and need["mem_mb"](small, 1) < need["mem_mb"](large, 1)
    assert need["runtime"](large, 1) > 58 and need["runtime"](small, 1) < 30
    for ask in need.values():
        assert ask(large, 2) == pytest.approx(2 * ask(large, 1), abs=1)
    single = jobs.Jobs({"study": PAPER, "products": "products", "cases": [30]})
    for name, ask in single.needs("yade_wave").items():
        assert ask(SimpleNamespace(), 1) == need[name](large, 1)  # a job of no case


def test_half_the_step_has_the_times_of_the_whole_and_an_s_wave_is_longer(jobs):
    found = jobs.Jobs({"study": PAPER, "products": "products"})
    line = found.line("case30", "wave", run="half_step")
    assert (line["fraction"], line["interval"]) == (0.1, 0) and line["passage"] > 1.3
    reverse = found.line("case30", "wave", run="small_reverse")
    assert reverse["amplitude"] == pytest.approx(-2.5e-11, rel=1e-6, abs=0)
    assert found.line("case03", "wave", run="100kHz")["input_frequency"] == 1e5
    assert found.line("case03", "wave")["input_frequency"] == 2e5
    assert found.line("case30", "wave", run="shear_yade")["direction"] == "x"
    # YADE takes the cells for Python.
    assert '"x"' in found.yade_command("case30", "wave", "signals", "wave", run="shear_yade")


def test_a_reduced_study_is_as_slender_and_needs_no_yade_for_its_walks(jobs):
    found = jobs.Jobs({"study": PAPER, "products": "products", "spheres": 1000})
    row = found.rows["case30"]
    assert row["width"] == pytest.approx(14.65 * (1000 / 35201) ** (1 / 3), abs=1e-4)
    assert found.rows["case02"]["layers"] == 40 and found.committed_sample("case30") is None
    assert "modal pack --friction 0.4" in found.walk_command("mu0.4")
    full = jobs.Jobs({"study": PAPER, "products": "products", "from_scratch": True})
    assert full.rows["case02"]["layers"] == 200  # the paper's 4 x 4 x 200
    assert len(full.walks) == 7 and not any(
        map(full.committed_sample, full.cases_of_kind("random"))
    )
    assert "compress.py" in full.walk_command("mu0.4")
    assert "--spheres 35201" in full.walk_command("mu0")


@pytest.mark.parametrize("home", ["/proc/none", None])
def test_a_user_without_a_home_gets_one(home, jobs, tmp_path, monkeypatch):
    """No folder can be made in /proc, even by root; YADE ends where HOME is not set at all."""
    monkeypatch.setenv("HOME", home or "")
    if home is None:
        monkeypatch.delenv("HOME")
    monkeypatch.chdir(tmp_path)
    importlib.import_module("run").provide_home()
    assert Path(os.environ["HOME"]).is_absolute() and os.access(os.environ["HOME"], os.W_OK)


def test_the_home_of_a_user_stays(jobs, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    importlib.import_module("run").provide_home()
    assert os.environ["HOME"] == str(tmp_path)


def test_jobs_of_a_killed_driver_are_known_however_many(jobs, tmp_path, monkeypatch):
    """Two thousand in the queue; not the job that the driver runs in; no answer is said."""
    driver = importlib.import_module("run")
    squeue = tmp_path / "squeue"
    squeue.write_text(f'#!/bin/bash\nfor i in {{1..2000}}; do echo "$i|{ROOT}"; done\n')
    squeue.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    assert driver.jobs_in_queue()
    squeue.write_text(f"#!/bin/bash\necho '7|{ROOT}'\necho '8|/elsewhere'\n")
    monkeypatch.setenv("SLURM_JOB_ID", "7")
    assert not driver.jobs_in_queue()
    squeue.write_text("#!/bin/bash\necho 'slurm: no controller' >&2\nexit 1\n")
    with pytest.raises(InputError) as refused:
        driver.jobs_in_queue()
    assert refused.value.code == "command_failed"


ODD = "odd name; touch made_by_the_shell $(id) 'a' \"b\" *"


def test_each_word_of_a_command_reaches_its_program_as_it_is(jobs, tmp_path, monkeypatch):
    """Were a name not refused before, the shell and `in_turn` would still take it for a name."""
    found = jobs.Jobs({"study": PAPER, "products": "products"})
    found.rows[ODD] = found.rows["case30"]
    commands = importlib.import_module("commands")
    for text in (
        found.relax_command(ODD, f"{ODD}.h5"),
        found.network_command("highest_mode", ODD),
        found.measure_commands(ODD, [f"{ODD}.h5"])[-1],
    ):
        assert any(ODD in word for word in shlex.split(text))
        assert {len(word.split(ODD)) for word in shlex.split(text) if "odd" in word} == {2}
    monkeypatch.chdir(tmp_path)
    shell = commands.write_line({"direction": ODD, "case": 3}, f"{tmp_path}/{ODD}")
    subprocess.run(["bash", "-c", shell], check=True)
    head, cells = (tmp_path / ODD).read_text().splitlines()
    assert head == "direction case" and cells.endswith(" 3")
    assert [path.name for path in tmp_path.iterdir()] == [ODD]


def test_a_rule_is_given_the_settings_that_its_command_names(jobs):
    """Modes about a case's own band, the study's number of lowest modes, and no places left."""
    found = jobs.Jobs({"study": PAPER, "products": "products"})
    settings = found.study.settings
    settings["bands"] = {"case06": [0.5, 2.0], "case07": [0, 3.0]}
    words = shlex.split(found.network_command("band_modes", "case06"))
    first = words.index("--between") + 1
    assert [float(word) for word in words[first : first + 2]] == [0.5, 2.0]
    words = shlex.split(found.network_command("band_modes", "case07"))
    assert float(words[words.index("--below") + 1]) == 3.0
    words = shlex.split(found.network_command("lowest_modes", "case06"))
    assert words[words.index("--lowest") + 1] == str(settings["lowest_modes"])
    for rule in importlib.import_module("commands").OF_NETWORK:
        assert "{" not in found.network_command(rule, "case06")


def test_a_wave_takes_as_much_longer_as_its_packing_is_long(jobs):
    """Eight times the spheres of one shape are twice as long; stiffness goes as stress^(1/3)."""
    short, long = (
        jobs.Jobs({"study": PAPER, "products": "products", "spheres": count})
        for count in (1000, 8000)
    )
    assert long.duration("case06") == pytest.approx(2 * short.duration("case06"), rel=1e-3)
    # Case 7 has ten times the stress of case 6: V as stress^(1/6).
    ratio = short.duration("case06") / short.duration("case07")
    assert ratio == pytest.approx(10 ** (1 / 6), rel=1e-3)


def test_commands_make_each_product_that_a_result_is_measured_from(jobs):
    """YADE's jobs make sample and network beside a wave; spectra are kept by `measure`."""
    found = jobs.Jobs({"study": PAPER, "products": "products", "spheres": 1000})
    for case in ("case02", "case03", "case06"):
        text = "\n".join(found.product_commands(case))
        kept = {"sample", "network", "response", "density", "structure"}
        for kind in {*found.product_kinds(case)} - kept:
            assert found.product(case, kind) in text, (case, kind)


def test_yades_waves_are_given_the_callers_variables_of_waves_alone(jobs, monkeypatch):
    commands = importlib.import_module("commands")
    for name in [name for name in os.environ if name.startswith("WAVE_")]:
        monkeypatch.delenv(name)
    assert commands.environment() == ":"
    for name, value in {"WAVE_B": "2; id", "WAVE_A": "1", "OTHER": "3", "WAVE_2-": "4"}.items():
        monkeypatch.setenv(name, value)
    assert commands.environment() == "export WAVE_A=1 WAVE_B='2; id'"


STARTED = 1000.0
"""Time at which the run of the test of failures begins, s."""


def write_log(folder: Path, job: str, text: str, *, at: float, done_at: float | None) -> None:
    """Write the log of a job, `rule/case`, at a time, and its benchmark where it has ended well."""
    for place, content, time in (
        (folder / "log" / f"{job}.log", text, at),
        (folder / "cost" / f"{job}.tsv", "", done_at),
    ):
        if time is not None:
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(content)
            os.utime(place, (time, time))


def test_failures_are_the_jobs_of_this_run_without_a_benchmark(jobs, tmp_path):
    """With the last line that says what to do; the status tells whether each of them has one."""
    failures = importlib.import_module("failures")
    error = "Traceback\nerror: first\nerror: mend it\nended"
    write_log(tmp_path, "sample/old", error, at=STARTED - 1, done_at=None)
    write_log(tmp_path, "sample/well", error, at=STARTED + 1, done_at=STARTED + 1)
    write_log(tmp_path, "sample/again", error, at=STARTED, done_at=STARTED - 9)
    write_log(tmp_path, "sample/again.yade", "words", at=STARTED + 1, done_at=None)
    failures.write_failures(tmp_path, STARTED)
    log = tmp_path / "log/sample/again.log"
    wanted = ["2", f"sample again: mend it ({log})"]
    assert (tmp_path / ".failed").read_text().splitlines() == wanted
    write_log(tmp_path, "wave/silent", "", at=STARTED + 5, done_at=STARTED + 4)
    failures.write_failures(tmp_path, STARTED)
    status, first, second = (tmp_path / ".failed").read_text().splitlines()
    assert (status, first) == ("1", wanted[1])
    assert second.startswith("wave silent: no word (")


def test_a_run_without_failed_jobs_has_failed_otherwise(jobs, tmp_path):
    importlib.import_module("failures").write_failures(tmp_path, STARTED)
    assert (tmp_path / ".failed").read_text() == "1"


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
)
def test_paths_that_rules_cannot_hold_are_refused_before_any_job(settings, jobs):
    with pytest.raises(InputError) as refused:
        jobs.Jobs({"study": PAPER, "products": "products"} | settings)
    assert refused.value.code == "path"


def test_cases_are_asked_for_by_number_or_name(jobs):
    found = {
        word: jobs.Jobs({"study": PAPER, "products": "products", "cases": [word]}).cases
        for word in ("8", "010", "case06", "fcc")
    }
    assert found["8"] == ["case08"] and found["010"] == ["case10"] and len(found["fcc"]) == 4
    for word in ("99", "0", "", "$(id)", "case6"):
        with pytest.raises(InputError) as refused:
            jobs.Jobs({"study": PAPER, "products": "products", "cases": [word]})
        assert refused.value.code == "unknown_case"


def test_patterns_of_names_hold_whole_names_and_stay_short(jobs, tmp_path):
    """Each file is of its case alone, and of thousands of cases no pattern names each."""
    study = tmp_path / "many.yaml"
    study.write_text(
        "groups:\n  - {kind: fcc, factors: {friction: [0]}, stress: 1e5, wave_friction: 0.1}\n"
        "  - {kind: random, factors: {friction: [0.1, 1], seed: 1 to 2000}, stress: 1e5,"
        " wave_friction: 0.1}\n"
    )
    found = jobs.Jobs({"study": str(study), "products": "products"})
    for kind in ("fcc", "random"):
        pattern = found.pattern(found.cases_of_kind(kind))
        assert len(pattern) < 2000
        file = re.compile(rf"(?P<case>{pattern})\.signals\.h5$")
        for name in ("friction0", "friction0.1_seed7", "friction1_seed2000"):
            match = file.match(f"{name}.signals.h5")
            assert bool(match) == (name in found.cases_of_kind(kind))
            assert match is None or match["case"] == name
            assert not file.match(f"{name}.reverse.signals.h5")
    for name in ("c{}.linear", "c{}Pa"):
        study.write_text(
            f"names: '{name}'\ngroups: [{{kind: fcc, friction: 0, stress: 1, wave_friction: 0}}]"
        )
        with pytest.raises(InputError) as refused:
            jobs.Jobs({"study": str(study), "products": "products"})
        assert refused.value.code == "name"


@pytest.mark.parametrize(
    ("settings", "code"),
    [
        (["stage=result", "cases=[33]"], "unknown_case"),
        (["stage=lunch"], "unknown_word"),
        (["stage=sample", "cases=[2]"], "stage"),  # a crystal has no sample
        (["stage=result", "spheres=100"], "too_few_spheres"),
        (["study=none.yaml"], "no_file"),
        (["study=tests/none.yaml"], "no_file"),
    ],
)
def test_the_driver_refuses_settings_before_any_job(settings, code, jobs):
    driver = importlib.import_module("run")
    with pytest.raises(InputError) as refused:
        driver.main("local", "dry-run", "", f"study={PAPER}", "products=products", *settings)
    assert refused.value.code == code


@pytest.mark.parametrize(
    ("version", "prints", "there", "status", "said"),
    [
        ("2023.02a", "error: it belongs to another study", True, 1, "error: it belongs"),
        ("2023.02a", "killed", False, 1, "killed"),
        ("2023.02a", "Traceback\nstatus  : 256 (FAILED)", True, 1, "no product"),
        ("2023.02a", "killed before its summary", True, 1, "no product"),
        ("2023.02a", "status  : 0 (OK)", False, 1, "no product"),
        ("2023.02a", "written\nstatus  : 0 (OK)", True, 0, "written"),
        ("2025.2.0", "written\nstatus  : 0 (OK)", True, 0, "written"),
        ("2025.2.0", "killed", False, 1, "killed"),
        ("2023.02", "killed", False, 1, "killed"),
        ("2018.02b", "", False, 2, "YADE 2018.02b"),
        ("2025.20", "", False, 2, "YADE 2025.20"),
        ("2023.021", "", False, 2, "YADE 2023.021"),
        ("of today", "", False, 2, "YADE of no known version"),
        ("", "", False, 2, "yade-batch is not in PATH"),
    ],
)
def test_a_job_of_yade_fails_with_its_script(version, prints, there, status, said, tmp_path):
    """yade-batch itself returns 0 whatever comes of its job; a product may be there from before."""
    programs = {"yade-batch": prints, "yade": f"YADE {version}"} if version else {}
    for name, text in programs.items():
        (tmp_path / name).write_text(f"#!/bin/sh\necho '{text}'\n")
        (tmp_path / name).chmod(0o755)
    product = tmp_path / "100000Pa.sample.h5"
    if there:
        product.touch()
    table = tmp_path / "own.table"
    table.write_text("mu_comp spheres width seed\n0.4 120 4.2 1\n")
    job = [ROOT / "workflow/yade_job.sh", table, "0.4"]
    job += ["yade_scripts/compress.py", tmp_path, tmp_path / "walk.log", product]
    done = subprocess.run(
        [str(word) for word in job],
        env={"YADE": str(tmp_path / "yade"), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
    )
    log = (tmp_path / "walk.log").read_text()
    assert done.returncode == status and said in log, log


def test_the_batch_system_pbs_gives_a_job_its_minutes():
    """The line for PBS in the profile of other clusters, as its users copy it."""
    profile = (ROOT / "workflow/profiles/generic/config.yaml").read_text()
    words = re.search(r"walltime=(.+) -j oe", profile)[1]
    for minutes in (1, 30, 90, 1441):
        typed = words.replace("{resources.runtime}", str(minutes))
        walltime = subprocess.run(["bash", "-c", f"echo {typed}"], capture_output=True, text=True)
        hours, minute, second = map(int, walltime.stdout.split(":"))
        assert 3600 * hours + 60 * minute + second == 60 * minutes


@pytest.mark.parametrize(
    ("raised", "status", "first"),
    [
        (
            "InputError('no_file', 'no such sample', remedy='make it')",
            2,
            "error: no such sample; make it",
        ),
        ("ValueError('operands could not be broadcast')", 1, "Traceback (most recent call last):"),
    ],
)
def test_what_a_script_itself_gets_wrong_is_no_mistake_of_its_user(
    raised, status, first, yade, tmp_path
):
    """One line and 2 for what the user can mend; the place and 1 for a fault of the script."""
    script = tmp_path / "script.py"
    script.write_text(
        f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n"
        "from modal.formats.hdf5 import InputError\nfrom yade_scripts.scene import finish\n\n"
        f"def main():\n    raise {raised}\n\nfinish(main)\n"
    )
    ended, log = forked(tmp_path, [script], {})
    assert ended == status and first in log.splitlines(), log
