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
    """The project's programs, which are linked, a copy of its workflow, this Python as .venv.

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
    """Another such folder beside it, with what has been made in it."""
    folder = start.with_name(name)
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(start, folder, symlinks=True)
    return folder


def driven(folder: Path, only: str, **settings: object) -> tuple[int, str]:
    """Status and words of the driver that ./run_cases.sh starts; Snakemake is loaded once."""
    found = {"study": PAPER, "products": "products", "stage": "result"} | settings
    said, start = io.StringIO(), subprocess.run

    def in_this_process(command: list[str], **given: object) -> SimpleNamespace:
        if command[1:3] != ["-m", "snakemake"]:
            return start(command, **given)
        with pytest.raises(SystemExit) as end:
            importlib.import_module("snakemake.cli").main(command[3:])
        return SimpleNamespace(returncode=end.value.code)

    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings(action="ignore"):
        patch.setattr(subprocess, "run", in_this_process)
        patch.syspath_prepend(str(ROOT / "workflow"))
        patch.chdir(folder)
        with redirect_stdout(said), redirect_stderr(said):
            driver = importlib.import_module("run")
            status = driver.main("local", only, "2", *(f"{n}={v}" for n, v in found.items()))
    return status, said.getvalue()


def planned(folder: Path, **settings: object) -> dict[str, int]:
    """Number of jobs of each rule in a dry run."""
    status, said = driven(folder, "dry-run", **settings)
    assert status == 0, said
    rules = dict(re.findall(r"^(\w+) +(\d+)$", said.rpartition("Job stats:")[2], re.M))
    return {rule: int(n) for rule, n in rules.items() if rule != "all"}


def measured(name: str, folder: Path) -> CaseResult:
    """The result of a crystal whose products are in a folder, by the command line."""
    study, output = folder / "crystals.yaml", folder / f"{name}.json"
    study.write_text(CRYSTALS)
    command = ["study", str(study), "--measure", name, "--products", str(folder)]
    assert main([*command, "-o", str(output)]) == 0
    return read_result(output)
