"""The script run_cases.sh: its options, refusals, and what it passes on to the driver."""

import os
import re
import shutil
import subprocess

import pytest
from places import ROOT


def run_cases(*options: str) -> subprocess.CompletedProcess:
    """Run the script with options."""
    command = [str(ROOT / "run_cases.sh"), *options]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


@pytest.fixture
def on_macos(tmp_path, monkeypatch):
    """Put a program `uname` first in the path that prints the name of another system."""
    program = tmp_path / "uname"
    program.write_text("#!/bin/sh\necho Darwin\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")


def test_other_system_is_refused_in_one_line(on_macos):
    """Refuse macOS, which has neither Debian's YADE nor the locks that the rules use."""
    done = run_cases("--case", "2")
    assert done.returncode == 2
    assert done.stdout == ""
    assert "Linux" in done.stderr
    assert done.stderr.count("\n") == 1


def test_help_is_shown_on_any_system(on_macos):
    assert run_cases("--help").returncode == 0


@pytest.mark.parametrize(
    ("options", "name"),
    [
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
def test_wrong_option_is_refused_in_one_line_with_its_name(options, name):
    done = run_cases(*options)
    assert done.returncode == 2
    # What is missing, or older than pyproject.toml, is set up first, and a line says so.
    assert re.sub("^setup.sh: .*\n", "", done.stdout) == ""
    assert done.stderr.count("\n") == 1
    assert name in done.stderr


@pytest.fixture
def run_without_python(tmp_path):
    """Return a function that runs the script with a program that prints its words for Python."""
    shutil.copy(ROOT / "run_cases.sh", tmp_path)
    shutil.copytree(ROOT / "workflow/profiles", tmp_path / "workflow/profiles")
    python = tmp_path / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text("#!/bin/sh\nprintf '%s\\n' \"$@\"\n")
    python.chmod(0o755)
    setup = tmp_path / "setup.sh"
    setup.write_text("#!/bin/sh\n")
    setup.chmod(0o755)

    def run(*options: str) -> list[str]:
        command = [str(tmp_path / "run_cases.sh"), *options]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    return run


@pytest.mark.parametrize(
    ("options", "words"),
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
def test_options_are_passed_on_to_the_driver(options, words, run_without_python):
    script, *received = run_without_python(*options)
    assert script == "workflow/run.py"
    assert set(words) <= set(received)
