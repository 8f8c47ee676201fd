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

pytest.importorskip("snakemake")
ROOT = Path(__file__).resolve().parents[1]


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
    ("arguments", "said"),
    [
        (["--case", "33"], "there are cases 1 to 32"),
        (["--case", "0"], "there are cases 1 to 32"),
        (["--case"], "--case needs a number"),
        (["--case", "two"], "--case needs a number"),
        (["--stage", "lunch"], "--stage is one of"),
        (["-j", "0"], "-j needs a number"),
        (["--spheres", "few"], "--spheres needs a number"),
        (["--colour"], "unknown option --colour"),
    ],
)
def test_front_door_refuses_in_one_line(arguments, said):
    done = front_door(*arguments)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.count("\n") == 1 and said in done.stderr


def test_help_names_every_stage_of_the_rules():
    """The words of --stage are those of the schema."""
    schema = (ROOT / "workflow/study.schema.yaml").read_text()
    words = re.search(r"stage: {enum: \[(.*)\]}", schema)[1].split(", ")
    text = front_door("--help").stdout
    listed = re.search(r"as far as one of: (.*)", text)[1].split()
    assert words == [*listed, "report", "study"]
