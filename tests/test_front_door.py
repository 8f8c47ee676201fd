"""The front door of a study, ./run_cases.sh: what it refuses, and what it hands to the driver."""

import os
import re
import shutil
import subprocess

import pytest
from places import ROOT

pytest.importorskip("snakemake")


def front_door(*arguments: str) -> subprocess.CompletedProcess:
    command = str(ROOT / "run_cases.sh"), *arguments
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
    ("arguments", "named"),
    [
        (["--case", "33", "--dry-run"], "case 33"),  # by Python, all others by the shell alone
        (["--case"], "--case"),
        (["-j", "0"], "-j"),
        (["--profile", "none"], "--profile none"),
        (["--spheres", "0"], "--spheres"),
        (["-j", "x"], "-j"),
        (["--case", ""], "--case"),
        (["--case", "2;id"], "--case 2;id"),
        (["--case", "2]"], "--case 2]"),
        (["--stage", "x: y"], "--stage x: y"),
        (["--study", "studies"], "--study studies"),
        (["--study", "a b.yaml"], "--study a b.yaml"),
        (["--profile", "../local"], "--profile ../local"),
        (["--profile", ""], "--profile none"),
        (["--colour"], "--colour"),
    ],
)
def test_front_door_refuses_in_one_line_that_names_the_option(arguments, named):
    done = front_door(*arguments)
    assert done.returncode == 2
    # What is missing, or older than pyproject.toml, is set up first, and a line says so.
    assert re.sub("^setup.sh: .*\n", "", done.stdout) == ""
    assert done.stderr.count("\n") == 1
    assert named in done.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], ["local", "", "", "products=products", "stage=result", "cases=[2]"]),
        (
            ["--case", "6", "fcc", "-j", "3", "--dry-run"],
            ["local", "dry-run", "3", "stage=result", "cases=[6,fcc]"],
        ),
        (["--all", "--stage", "lunch"], ["stage=lunch", "cases=[fcc]"]),
        (
            ["--study", "studies/none.yaml", "--status"],
            ["summary", "study=studies/none.yaml", "stage=page", "cases=[all]"],
        ),
        (
            ["--spheres", "1000", "--seed", "2", "--from-scratch"],
            ["products=products/1000_spheres", "spheres=1000", "seed=2", "from_scratch=True"],
        ),
        (["--profile", "workflow/profiles/generic/"], ["generic"]),
    ],
)
def test_the_front_door_hands_its_options_to_the_driver(arguments, words, tmp_path):
    """A program that prints its words stands in place of Python."""
    shutil.copy(ROOT / "run_cases.sh", tmp_path)
    shutil.copytree(ROOT / "workflow/profiles", tmp_path / "workflow/profiles")
    python = tmp_path / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text("#!/bin/sh\nprintf '%s\\n' \"$@\"\n")
    (tmp_path / "setup.sh").write_text("#!/bin/sh\n")
    for program in (python, tmp_path / "setup.sh"):
        program.chmod(0o755)
    command = [str(tmp_path / "run_cases.sh"), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    script, *received = done.stdout.splitlines()
    assert script == "workflow/run.py"
    assert set(words) <= set(received)
