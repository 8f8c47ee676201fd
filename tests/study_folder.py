"""A folder in which ./run_cases.sh runs this very project with a study of its own."""

import importlib
import io
import re
import shutil
import subprocess
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from types import SimpleNamespace

import pytest
from places import ROOT

from analysis.__main__ import main
from analysis.case_result import CaseResult
from analysis.result_file import read_result

PAPER = "studies/otsubo2017/study.yaml"
CRYSTALS = """
names: case{:02d}
groups: [{kind: fcc, factors: {stress: [1e4, 1e5, 1e6]}, friction: 0, wave_friction: 0.1}]
"""


def study_folder(folder: Path, study: str = "") -> Path:
    """Make a folder of the project's programs, a copy of its workflow, and this Python as .venv.

    `study` stands in place of the paper's, so that products and Snakemake's notes are its own.
    """
    folder.mkdir()
    for name in ("modal", "analysis", "yade_scripts", "results"):
        (folder / name).symlink_to(ROOT / name)
    for name in ("studies", "workflow"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("run_cases.sh", "setup.sh", "pyproject.toml"):
        shutil.copy(ROOT / name, folder)
    if study:
        (folder / PAPER).write_text(study)
    python = folder / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    paths = ":".join(path for path in sys.path if path and path != str(ROOT))
    python.write_text(
        f'#!/bin/sh\nexport PYTHONPATH="{folder}:$PYTHONPATH:{paths}"\nexec {sys.executable} "$@"\n'
    )
    python.chmod(0o755)
    for name in ("workflow", "slurm"):
        shutil.copy(ROOT / "pyproject.toml", folder / f".venv/installed-{name}")
    return folder


def copy_of(start: Path, name: str) -> Path:
    """Copy such a folder, with all that has been made in it, to another name beside it."""
    folder = start.with_name(name)
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(start, folder, symlinks=True)
    return folder


def driven(folder: Path, only: str, **settings: object) -> tuple[int, str]:
    """Run the driver that ./run_cases.sh starts; return its status and output.

    Snakemake runs in this process, so that it is loaded once.
    """
    settings = {"study": PAPER, "products": "products", "stage": "result"} | settings
    words = [f"{name}={value}" for name, value in settings.items()]
    output = io.StringIO()
    start_program = subprocess.run

    def run_snakemake_here(command: list[str], **options: object) -> SimpleNamespace:
        if command[1:3] != ["-m", "snakemake"]:
            return start_program(command, **options)
        stdout = io.StringIO() if options.get("capture_output") else output
        with redirect_stdout(stdout), pytest.raises(SystemExit) as end:
            importlib.import_module("snakemake.cli").main(command[3:])
        return SimpleNamespace(returncode=end.value.code, stdout=stdout.getvalue(), stderr="")

    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings(action="ignore"):
        patch.setattr(subprocess, "run", run_snakemake_here)
        patch.syspath_prepend(str(ROOT / "workflow"))
        patch.chdir(folder)
        with redirect_stdout(output), redirect_stderr(output):
            status = importlib.import_module("run").main("local", only, "2", *words)
    return status, output.getvalue()


def planned(folder: Path, **settings: object) -> dict[str, int]:
    """Return the number of jobs of each rule in a dry run."""
    status, output = driven(folder, "dry-run", **settings)
    assert status == 0, output
    _, _, statistics = output.rpartition("Job stats:")
    counts = {rule: int(count) for rule, count in re.findall(r"^(\w+) +(\d+)$", statistics, re.M)}
    counts.pop("all", None)
    return counts


def measured(name: str, folder: Path) -> CaseResult:
    """Return the result of a crystal whose products are in a folder, by the command line."""
    study = folder / "crystals.yaml"
    output = folder / f"{name}.json"
    study.write_text(CRYSTALS)
    command = ["study", str(study), "--measure", name, "--products", str(folder)]
    assert main([*command, "-o", str(output)]) == 0
    return read_result(output)
