"""Notes on the failed jobs of a run, from their logs and benchmarks."""

import os
from pathlib import Path

import pytest

STARTED = 1000.0
"""Time at which the run begins, s."""


def write_at(path: Path, text: str, time: float) -> None:
    """Write a file whose time, s, is that of a job."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    os.utime(path, (time, time))


def write_log(folder: Path, job: str, text: str, time: float) -> None:
    """Write the log of a job, `rule/case`."""
    write_at(folder / "log" / f"{job}.log", text, time)


def write_benchmark(folder: Path, job: str, time: float) -> None:
    """Write the benchmark of a job that has ended well."""
    write_at(folder / "cost" / f"{job}.tsv", "", time)


@pytest.fixture
def read_failures(import_module, tmp_path):
    """Return a function that returns the lines which are written about the run."""
    failures = import_module("failures")

    def read() -> list[str]:
        failures.write_failures(tmp_path, STARTED)
        return (tmp_path / ".failed").read_text().splitlines()

    return read


ERROR = "Traceback\nerror: first\nerror: mend it\nended"


@pytest.fixture
def failed_job(tmp_path) -> Path:
    """Write the log of a job of this run without a benchmark of this run; return it."""
    write_log(tmp_path, "sample/again", ERROR, STARTED)
    write_benchmark(tmp_path, "sample/again", STARTED - 9)
    return tmp_path / "log/sample/again.log"


def test_failed_job_has_its_last_line_that_says_what_to_do(failed_job, read_failures):
    assert read_failures() == ["2", f"sample again: mend it ({failed_job})"]


def test_job_of_an_earlier_run_does_not_count(failed_job, read_failures, tmp_path):
    write_log(tmp_path, "sample/old", ERROR, STARTED - 1)
    assert len(read_failures()) == 2


def test_job_with_a_benchmark_does_not_count(failed_job, read_failures, tmp_path):
    write_log(tmp_path, "sample/well", ERROR, STARTED + 1)
    write_benchmark(tmp_path, "sample/well", STARTED + 1)
    assert len(read_failures()) == 2


def test_log_of_yade_inside_of_a_job_does_not_count(failed_job, read_failures, tmp_path):
    write_log(tmp_path, "sample/again.yade", "words", STARTED + 1)
    assert len(read_failures()) == 2


def test_failure_without_a_remedy_makes_status_1(failed_job, read_failures, tmp_path):
    write_log(tmp_path, "wave/silent", "", STARTED + 5)
    write_benchmark(tmp_path, "wave/silent", STARTED + 4)
    status, _, silent = read_failures()
    assert status == "1"
    assert silent.startswith("wave silent: no word (")


def test_run_without_failed_jobs_has_failed_otherwise(read_failures):
    assert read_failures() == ["1"]
