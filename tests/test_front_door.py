"""What `./run_cases.sh` refuses, in one line each."""

import os
import re
import subprocess

import pytest
from places import ROOT

pytest.importorskip("snakemake")


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
    ("arguments", "said"),
    [
        (["--case", "33", "--dry-run"], "case 33: none of the study's"),
        (["--case"], "--case needs a number"),
        (["--stage", "lunch"], "--stage 'lunch': unknown"),
        (["-j", "0"], "-j needs a number"),
        (["--spheres", "100"], "at least 750"),
        (["--study", "none.yaml"], "none.yaml: cannot be read"),
        (["--profile", "none"], "--profile none: no such folder"),
        (["--colour"], "unknown option --colour"),
    ],
)
def test_front_door_refuses_in_one_line(arguments, said):
    done = front_door(*arguments)
    # What is missing, or older than pyproject.toml, is set up first, and that is said.
    assert done.returncode == 2 and re.sub("^setup.sh: .*\n", "", done.stdout) == ""
    assert done.stderr.count("\n") == 1 and said in done.stderr
