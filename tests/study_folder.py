"""A folder in which ./run_cases.sh runs this very project with a study of its own."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from places import ROOT

from analysis.__main__ import main
from analysis.rows import Row
from analysis.study.results import read_result

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
        (folder / "studies/otsubo2017/study.yaml").write_text(study)
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


def measured(name: str, folder: Path) -> Row:
    """The result of a crystal whose products are in a folder, by the command line."""
    study, output = folder / "crystals.yaml", folder / f"{name}.json"
    study.write_text(CRYSTALS)
    command = ["study", str(study), "--measure", name, "--products", str(folder)]
    assert main([*command, "-o", str(output)]) == 0
    return read_result(output)
