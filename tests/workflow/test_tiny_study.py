"""A tiny study run from end to end, with a case that cannot be made and is then mended."""

import importlib
import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import pytest
from places import ROOT
from study_folder import driven, planned

STUDY = """
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
CASES = ["friction0_stress1e+06", "friction0_stress2e+06"]
IMPOSSIBLE = f"cases: {{{CASES[1]}: {{wave_friction: 0}}}}\n"
"""A change of the study: to rest with less friction than in the compression is refused."""
RUN = {"study": "studies/tiny.yaml", "products": "tiny", "stage": "page"}


class TinyRun(NamedTuple):
    """Results of two runs of the tiny study; in the first a case cannot be made.

    `absent` and `page` are the lines of the list of absent cases and the page after the first run;
    `result_times` are the times of the possible case's result after each run, s since the epoch;
    `reevaluations` counts how often Snakemake's limit of jobs a second has asked to look at all
    jobs again.
    """

    folder: Path
    statuses: list[int]
    absent: list[str]
    page: str
    result_times: list[float]
    reevaluations: int


@pytest.fixture(scope="module")
def tiny(study) -> TinyRun:
    """Run the tiny study to a page that lacks a case, and again to the whole page."""
    reevaluations: list[object] = []
    scheduler = importlib.import_module("snakemake.scheduling.job_scheduler").JobScheduler
    assert hasattr(scheduler, "_schedule_reevalutation")
    folder = study / "tiny"
    description = study / "studies/tiny.yaml"
    result = folder / f"results/{CASES[0]}.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        patch.setattr(
            scheduler, "_schedule_reevalutation", lambda *args: reevaluations.append(args)
        )
        description.write_text(STUDY + IMPOSSIBLE)
        first_status, _ = driven(study, "", **RUN)
        first_time = result.stat().st_mtime
        absent = (folder / "study/absent.csv").read_text().splitlines()
        page = (folder / "study/study.html").read_text()
        description.write_text(STUDY)
        second_status, _ = driven(study, "", **RUN)
        second_time = result.stat().st_mtime
    return TinyRun(
        folder,
        [first_status, second_status],
        absent,
        page,
        [first_time, second_time],
        len(reevaluations),
    )


def test_case_that_cannot_be_made_is_a_row_of_the_page_with_the_reason(tiny):
    assert tiny.statuses[0] == 3
    _, row = tiny.absent
    assert row.startswith(f"{CASES[1]},")
    assert "friction 0" in row
    assert "No result of case 2" in tiny.page


def test_next_run_makes_the_missing_case_and_nothing_else(tiny):
    """Try the case again although the page, which lacks it, exists."""
    assert tiny.statuses[1] == 0
    assert tiny.result_times[0] == tiny.result_times[1]
    assert not (tiny.folder / "study/absent.csv").exists()
    assert not (tiny.folder / "results/absent.csv").exists()
    assert "No result of case" not in (tiny.folder / "study/study.html").read_text()


def test_page_follows_its_results(tiny):
    void_ratios = []
    for case in CASES:
        result = json.loads((tiny.folder / f"results/{case}.json").read_text())
        void_ratios.append(result["values"]["void_ratio"]["value"])
    assert void_ratios[0] > void_ratios[1]  # denser under more stress
    _, *rows = (tiny.folder / "study/all.csv").read_text().splitlines()
    assert [row.split(",")[1] for row in rows] == [f"{value:.4f}" for value in void_ratios]
    assert (tiny.folder / "study/workflow.html").exists()


def test_changed_setting_makes_what_depends_on_it_and_nothing_else(tiny, study, jobs):
    description = study / "studies/tiny.yaml"
    assert planned(study, **RUN) == {}
    description.write_text(STUDY.replace("friction + 0.1", "friction + 0.2"))
    plan = planned(study, **RUN)
    description.write_text(STUDY)
    assert plan == {"sample": 2, "measure": 2, "page": 1, "total": 6}


def test_added_seed_makes_the_page_stale(tiny, study, jobs):
    """Take the result of another seed for one of the page's inputs."""
    seed = tiny.folder / "results/seed_2"
    seed.mkdir()
    shutil.copy(tiny.folder / f"results/{CASES[0]}.json", seed)
    plan = planned(study, **RUN)
    shutil.rmtree(seed)
    assert plan == {"page": 1, "total": 2}


def test_limit_of_jobs_a_second_is_removed_from_snakemake(tiny):
    """Remove the limit, with which Snakemake looks at all jobs again for each that has ended."""
    assert tiny.reevaluations == 0


def test_scheduler_without_that_limit_is_noticed(import_module):
    """Notice a version of Snakemake that has another name for the limit."""
    with pytest.raises(AttributeError):
        import_module("job_rate").remove_job_rate_limit(SimpleNamespace())
