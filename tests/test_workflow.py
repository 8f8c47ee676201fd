"""The study's rules: what a dry run plans. Nothing is run, so YADE is not needed."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("snakemake")
ROOT = Path(__file__).resolve().parents[1]
LEFT_BEHIND = (".git", ".venv", ".snakemake", "products", "__pycache__", "*.egg-info")


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    """A copy of the project, without products and without Snakemake's own notes."""
    folder = tmp_path_factory.mktemp("study") / "project"
    shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*LEFT_BEHIND))
    return folder


def snakemake(folder: Path, *arguments: str, **settings: object) -> subprocess.CompletedProcess:
    """Run Snakemake in a project; settings override study.yaml."""
    command = [sys.executable, "-m", "snakemake", "-s", "workflow/Snakefile", "--cores", "1"]
    pairs = [f"{name}={value}".replace(" ", "") for name, value in settings.items()]
    return subprocess.run(
        [*command, *arguments, "--config", *pairs], cwd=folder, capture_output=True, text=True
    )


def planned(folder: Path, *arguments: str, **settings: object) -> dict[str, int]:
    """Number of jobs of each rule in a dry run."""
    done = snakemake(folder, "--dry-run", "--quiet", "rules", *arguments, **settings)
    assert done.returncode == 0, done.stderr + done.stdout
    rows = re.findall(r"^(\w+) +(\d+)$", done.stdout + done.stderr, re.M)
    return {rule: int(count) for rule, count in rows}


def test_a_crystal_needs_no_walk(study):
    jobs = planned(study, cases=[2])
    assert jobs["crystal"] == jobs["wave"] == jobs["crystal_gain"] == 1 and jobs["modes"] == 3
    assert not {"chain", "relax", "export"} & jobs.keys()


def test_a_committed_sample_spares_the_walk_unless_told_otherwise(study):
    assert not {"walk", "relax"} & planned(study, cases=[30]).keys()
    jobs = planned(study, cases=[30], from_scratch=True)
    assert jobs["walk"] == jobs["relax"] == jobs["export"] == 1 and "start" not in jobs


def test_the_whole_study_walks_once_for_each_friction(study):
    """32 cases; of seven frictions two have their samples committed."""
    jobs = planned(study, cases=list(range(1, 33)))
    assert (jobs["crystal"], jobs["export"], jobs["wave"]) == (4, 28, 32)
    assert (jobs["walk"], jobs["start"], jobs["relax"]) == (5, 8, 20)
    assert planned(study, cases=list(range(1, 33)), from_scratch=True)["walk"] == 7


def products_of(folder: Path, case: str, kinds: list[str]) -> None:
    """Files with the names of products, in the order of their making."""
    (folder / "products").mkdir(exist_ok=True)
    for kind in kinds:
        (folder / f"products/{case}.{kind}.h5").touch()


def test_only_what_is_missing_is_planned(study):
    products_of(study, "case03", ["network", "highest.modes", "modes"])
    jobs = planned(study, cases=[3])
    assert "crystal" not in jobs and jobs["modes"] == 1 and jobs["wave"] == 1


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"colour": "red"}, "colour"),
        ({"cases": "[33]"}, "33"),
        ({"cases": "[]"}, "cases"),
        ({"preparation": "lammps"}, "lammps"),
        ({"spheres": "many"}, "many"),
        ({"spheres": 1000}, "preparation: modal"),
    ],
)
def test_unknown_words_are_refused(study, settings, said):
    done = snakemake(study, "--dry-run", **settings)
    assert done.returncode != 0
    assert said in done.stdout + done.stderr
