"""The rules of any study: what a dry run plans, and one tiny study run from end to end."""

import importlib
import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import pytest
from places import ROOT
from study_folder import driven, planned, study_folder

pytest.importorskip("snakemake")
TINY = """
groups:
  - kind: random
    factors: {friction: [0], stress: [1e6, 2e6]}
    spheres: 110
    width: 4
    wave_friction: friction + 0.1
measure: [void_ratio, coordination]
tables:
  - {name: all, title: All, columns: {case: name, e: void_ratio | .4f, Z: coordination | .2f}}
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    """The project with studies of its own, without products; nothing is set up there."""
    folder = study_folder(tmp_path_factory.mktemp("study") / "project")
    (folder / "setup.sh").write_text("#!/bin/sh\n")
    return folder


PLANS = {
    # Of 0 and 0.4 the finished samples are there; cases 3 and 4 have the pulse of 100 kHz too.
    "each friction walks once": (
        {"stage": "page"},
        {"states": 5, "committed_sample": 8, "sample": 20, "measure": 32, "yade_wave": 32}
        | {"further_wave": 2, "measure_state": 7, "band_modes": 2, "page": 1, "crystal": 4}
        | {"all_modes": 4, "translations": 4},
    ),
    "all of a small packing is made where it is measured": (
        {"stage": "page", "spheres": 1000},
        {"states": 7, "measure": 32, "measure_state": 7, "page": 1, "total": 48},
    ),
    "a stage is made by its own rule": (
        {"stage": "response", "spheres": 1000, "cases": [2, 6]},
        {"gain": 1, "spectra": 1, "crystal": 1, "states": 1, "sample": 1, "network": 1, "total": 7},
    ),
    "another seed takes no committed sample and shows a scatter alone": (
        {"cases": [6, 30], "seed": 2},
        {"states": 2, "sample": 2, "network": 2, "highest_mode": 2, "measure": 2, "total": 11},
    ),
    "six further waves": ({"cases": [6], "stage": "split"}, {"further_wave": 6}),
    "neither YADE nor stages of its own": (
        {"study": "studies/friction_width.yaml", "stage": "page"},
        {"states": 18, "sample": 18, "measure": 18, "page": 1, "total": 56},
    ),
}


@pytest.mark.parametrize("name", PLANS)
def test_a_dry_run_plans(name, study, jobs):
    settings, wanted = PLANS[name]
    assert wanted.items() <= planned(study, **settings).items()


TINY_NAMES = ["friction0_stress1e+06", "friction0_stress2e+06"]
IMPOSSIBLE = f"cases: {{{TINY_NAMES[1]}: {{wave_friction: 0}}}}\n"
"""A change of the tiny study: at rest with less friction than it was compressed with is refused."""


class TinyRun(NamedTuple):
    """A tiny study, run with a case that cannot be made, then mended and run again.

    `absent` and `page` are the list of absent cases and the page after the first run;
    `reevaluations` counts how often Snakemake's limit of jobs a second has asked to look at all
    jobs again; `first_result` is when the possible case was measured, by both runs.
    """

    folder: Path
    statuses: list[int]
    absent: list[str]
    page: str
    first_result: list[float]
    reevaluations: int


@pytest.fixture(scope="module")
def tiny(study) -> TinyRun:
    """Run the tiny study twice: from cloud to a page that lacks a case, then to the whole page."""
    reevaluations: list[object] = []
    scheduler = importlib.import_module("snakemake.scheduling.job_scheduler").JobScheduler
    assert hasattr(scheduler, "_schedule_reevalutation")
    folder = study / "tiny"
    description = study / "studies/tiny.yaml"
    possible = folder / f"results/{TINY_NAMES[0]}.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        patch.setattr(
            scheduler, "_schedule_reevalutation", lambda *given: reevaluations.append(given)
        )
        description.write_text(TINY + IMPOSSIBLE)
        statuses = [driven(study, "", **TINY_RUN)[0]]
        first_result = [possible.stat().st_mtime]
        absent = (folder / "study/absent.csv").read_text().splitlines()
        page = (folder / "study/study.html").read_text()
        description.write_text(TINY)
        statuses.append(driven(study, "", **TINY_RUN)[0])
        first_result.append(possible.stat().st_mtime)
    return TinyRun(folder, statuses, absent, page, first_result, len(reevaluations))


TINY_RUN = {"study": "studies/tiny.yaml", "products": "tiny", "stage": "page"}


def test_a_case_that_cannot_be_made_is_a_row_of_the_page_that_says_why(tiny):
    assert tiny.statuses[0] == 3
    header, line = tiny.absent
    assert line.startswith(f"{TINY_NAMES[1]},")
    assert "friction 0" in line
    assert "No result of case 2" in tiny.page


def test_the_next_run_makes_the_missing_case_and_nothing_else(tiny):
    """A page that lacks cases does not keep them from being tried again."""
    assert tiny.statuses[1] == 0
    assert tiny.first_result[0] == tiny.first_result[1]
    assert not (tiny.folder / "study/absent.csv").exists()
    assert not (tiny.folder / "results/absent.csv").exists()
    assert "No result of case" not in (tiny.folder / "study/study.html").read_text()


def test_a_page_follows_its_results(tiny):
    void_ratios = []
    for name in TINY_NAMES:
        result = json.loads((tiny.folder / f"results/{name}.json").read_text())
        void_ratios.append(result["values"]["void_ratio"]["value"])
    assert void_ratios[0] > void_ratios[1]  # denser under more stress
    table = (tiny.folder / "study/all.csv").read_text().splitlines()
    assert [line.split(",")[1] for line in table[1:]] == [f"{value:.4f}" for value in void_ratios]
    assert (tiny.folder / "study/workflow.html").exists()


def test_what_changes_is_made_again_and_nothing_else(tiny, study, jobs):
    description = study / "studies/tiny.yaml"
    assert planned(study, **TINY_RUN) == {}
    description.write_text(TINY.replace("friction + 0.1", "friction + 0.2"))
    again = planned(study, **TINY_RUN)
    description.write_text(TINY)
    assert again == {"sample": 2, "measure": 2, "page": 1, "total": 6}


def test_a_seed_that_is_added_makes_the_page_stale(tiny, study, jobs):
    """The result of another seed is one of the page's inputs."""
    seed = tiny.folder / "results/seed_2"
    seed.mkdir()
    shutil.copy(tiny.folder / f"results/{TINY_NAMES[0]}.json", seed)
    stale = planned(study, **TINY_RUN)
    shutil.rmtree(seed)
    assert stale == {"page": 1, "total": 2}


def test_snakemakes_limit_of_jobs_a_second_is_taken_away(tiny):
    """With it Snakemake looks at all jobs once more for each job that has ended."""
    assert tiny.reevaluations == 0


def test_a_scheduler_without_that_limit_is_noticed(jobs):
    """Another version of Snakemake that calls the limit otherwise must not go unnoticed."""
    with pytest.raises(AttributeError):
        importlib.import_module("job_rate").remove_job_rate_limit(SimpleNamespace())
