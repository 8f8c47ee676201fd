"""What `./run_cases.sh` says: its refusals, and a line for each product that is made or fails."""

from __future__ import annotations

import importlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

pytest.importorskip("snakemake")


def logger_plugin():
    """The module of the study's own lines."""
    sys.path.insert(0, str(ROOT / "workflow"))
    try:
        return importlib.import_module("snakemake_logger_plugin_study")
    finally:
        sys.path.remove(str(ROOT / "workflow"))


def test_reason_of_a_failure_is_what_its_log_says_or_the_full_disk(tmp_path, monkeypatch):
    """On a full disk the log has no room either: it is there and empty."""
    plugin, log = logger_plugin(), tmp_path / "case02.log"
    log.write_text("step 1\nerror: no such file; name another\nstep 2\n")
    assert plugin._reason_of([log]) == ("no such file; name another", True)
    log.write_text("Segmentation fault\n")
    assert plugin._reason_of([log]) == ("Segmentation fault", False)
    log.write_text("")
    assert plugin._reason_of([log]) == ("no word", False)
    full = shutil._ntuple_diskusage(1, 1, 0)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: full)
    assert plugin._reason_of([log]) == (plugin.FULL, True)


def test_finished_product_is_a_line_with_its_cost(tmp_path, capsys):
    """Seconds and memory are those that Snakemake noted of the job, in its own columns."""
    plugin = logger_plugin()
    handler = plugin.LogHandler.__new__(plugin.LogHandler)
    handler.__post_init__()
    handler.planned["response"] = 1
    noted = tmp_path / "case02.tsv"
    noted.write_text("s\th:m:s\tmax_rss\tcpu_time\n12.5\t0:00:12\t345.6\t9.0\n")
    product = {"rule_name": "response", "output": ["case02.response.h5"], "benchmark": str(noted)}
    handler.finish(product)
    line = capsys.readouterr().out
    assert "case02.response.h5" in line and "12.5 s    346 MB  1 of 1" in line


def front_door(*arguments: str) -> subprocess.CompletedProcess:
    command = [str(ROOT / "run_cases.sh"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


def test_another_system_is_told_what_runs_there(tmp_path, monkeypatch):
    """macOS has neither Debian's YADE nor the locks that the rules use."""
    (tmp_path / "uname").write_text("#!/bin/sh\necho Darwin\n")
    (tmp_path / "uname").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    done = front_door("--case", "2")
    assert done.returncode == 2 and done.stdout == ""
    assert "runs on Linux" in done.stderr and done.stderr.count("\n") == 1
    assert front_door("--help").returncode == 0


@pytest.mark.parametrize(
    "arguments",
    [
        ["--case", "33"],
        ["--case", "0"],
        ["--case"],
        ["--case", "two"],
        ["--stage", "lunch"],
        ["-j", "0"],
        ["--seed", "1"],
        ["--spheres", "few"],
        ["--colour"],
    ],
    ids=" ".join,
)
def test_front_door_refuses_in_one_line_that_names_the_option(arguments):
    done = front_door(*arguments)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.count("\n") == 1 and arguments[0].strip("-") in done.stderr


PROGRAMS = {
    "python": """#!/bin/sh
echo "$@" >> asked
case $1 in -c) exec {python} "$@";; esac
""",
    # As many jobs as do not fit into a pipe, each a write of its own, for the first two questions.
    "squeue": """#!/bin/bash
echo "$@" >> asked
[ "$(grep -c noheader asked)" -le ${{BUSY:-2}} ] || exit ${{SILENT:-0}}
for i in {{1..2000}}; do echo "$i|$(pwd -P)" || exit 1; done
""",
    "sbatch": "#!/bin/sh\n",
    "sacct": "#!/bin/sh\n",
    "sleep": "#!/bin/sh\n",
    "setup.sh": "#!/bin/sh\n",
}


@pytest.fixture
def door(tmp_path, monkeypatch) -> Path:
    """The front door in a folder that has a second name; its programs note what they are asked."""
    folder = tmp_path / "home/study"
    shutil.copytree(ROOT / "cases", folder / "cases")
    (folder / "workflow").mkdir()
    shutil.copy(ROOT / "workflow/study.yaml", folder / "workflow")
    shutil.copy(ROOT / "run_cases.sh", folder)
    (folder / "modal").symlink_to(ROOT / "modal")
    for name, text in PROGRAMS.items():
        places = {"python": ".venv/bin/python", "setup.sh": "setup.sh"}
        path = folder / places.get(name, f"bin/{name}")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.format(python=sys.executable))
        path.chmod(0o755)
    (tmp_path / "link").symlink_to(folder)
    monkeypatch.chdir(tmp_path / "link")
    monkeypatch.setenv("PWD", str(tmp_path / "link"))
    monkeypatch.setenv("PATH", f"{folder}/bin:{os.environ['PATH']}")
    for name in ("SLURM_JOB_ID", "SLURM_MEM_PER_NODE", "SLURM_MEM_PER_CPU"):
        monkeypatch.delenv(name, raising=False)
    return folder


def opened(*arguments: str) -> subprocess.CompletedProcess:
    command = ["./run_cases.sh", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


def test_jobs_of_a_killed_driver_are_waited_for_however_many(door):
    """Two thousand in the queue, of a folder that the caller knows by another name."""
    done = opened("--case", "2", "--slurm")
    assert done.returncode == 0 and "waiting for them" in done.stdout, done.stderr
    asked = [line.split()[0] for line in (door / "asked").read_text().splitlines()]
    # It asks until there are none, and only then gives out jobs.
    assert asked.count("--me") == 3 and "-m" not in asked[: asked.index("--me") + 3]


def test_a_driver_does_not_wait_for_the_job_that_it_runs_in(door, monkeypatch):
    (door / "bin/squeue").write_text('#!/bin/sh\necho "7|$(pwd -P)"\n')
    monkeypatch.setenv("SLURM_JOB_ID", "7")
    assert "waiting" not in opened("--case", "2", "--slurm").stdout


def test_without_an_answer_of_slurm_no_job_is_given_out(door, monkeypatch):
    """A controller that is away: jobs of an earlier run may be at work."""
    monkeypatch.setenv("BUSY", "0")
    monkeypatch.setenv("SILENT", "1")
    done = opened("--case", "2", "--slurm")
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    assert (
        "when Slurm answers" in done.stderr and "-m snakemake" not in (door / "asked").read_text()
    )


@pytest.mark.parametrize(
    ("granted", "most"),
    [
        ({"SLURM_MEM_PER_NODE": "700"}, 700),
        ({"SLURM_MEM_PER_CPU": "100", "SLURM_CPUS_ON_NODE": "4"}, 400),
    ],
)
def test_in_an_allocation_its_memory_counts_not_the_nodes(granted, most, door, monkeypatch):
    """As `sbatch --mem 700M --wrap ./run_cases.sh` sets them; the machine has more."""
    for name, text in granted.items():
        monkeypatch.setenv(name, text)
    assert opened("--case", "2").returncode == 0
    (given,) = set(re.findall(r"mem_mb=(\d+)", (door / "asked").read_text()))
    assert int(given) == most


def test_products_go_where_the_settings_say(door):
    settings = door / "workflow/study.yaml"
    settings.write_text(settings.read_text().replace("products: products ", "products: elsewhere "))
    assert opened("--case", "2").returncode == 0
    assert opened("--case", "30", "--spheres", "1000", "--seed", "2").returncode == 0
    asked = (door / "asked").read_text()
    for folder in ("elsewhere", "elsewhere/1000_spheres/seed_2"):
        assert f"products={folder} " in asked and (door / folder).is_dir()
    assert not (door / "products").exists()


def test_a_case_is_a_line_of_its_table(door):
    """One that is added there may be asked for, and is part of the study."""
    with open(door / "cases/random.table", "a") as table:
        table.write("33 0.4 0.5 1e5 1e5 0.2 1.3\n")
    assert opened("--case", "33", "2").returncode == 0
    assert "cases=[33,2]" in (door / "asked").read_text()
    assert opened("--study").returncode == 0
    assert f"cases=[{','.join(map(str, range(1, 34)))}]" in (door / "asked").read_text()


def test_help_names_every_stage_of_the_rules():
    """The words of --stage are those of the schema."""
    schema = (ROOT / "workflow/study.schema.yaml").read_text()
    words = re.search(r"stage: {enum: \[(.*)\]}", schema)[1].split(", ")
    text = front_door("--help").stdout
    listed = re.search(r"as far as one of: (.*)", text)[1].split()
    assert words == [*listed, "report", "study"]
