"""The driver that ./run_cases.sh starts: settings, home of the user, queue of a cluster."""

import os
from pathlib import Path

import pytest
from places import ROOT
from refusals import refusal
from study_folder import PAPER


@pytest.mark.parametrize(
    ("settings", "code"),
    [
        (["stage=result", "cases=[33]"], "unknown_case"),
        (["stage=lunch"], "unknown_word"),
        (["stage=sample", "cases=[2]"], "stage"),  # a crystal has no sample
        (["stage=result", "spheres=100"], "too_few_spheres"),
        (["study=none.yaml"], "no_file"),
        (["study=tests/none.yaml"], "no_file"),
    ],
)
def test_setting_is_refused_before_any_job(settings, code, driver):
    with refusal(code):
        driver.main("local", "dry-run", "", f"study={PAPER}", "products=products", *settings)


@pytest.mark.parametrize("home", ["/proc/none", None], ids=["not writable", "not set"])
def test_user_without_a_home_gets_one(home, driver, tmp_path, monkeypatch):
    """Give the user a home: even root can make none in /proc, and YADE ends without HOME."""
    if home is None:
        monkeypatch.delenv("HOME")
    else:
        monkeypatch.setenv("HOME", home)
    monkeypatch.chdir(tmp_path)
    driver.provide_home()
    assert Path(os.environ["HOME"]).is_absolute()
    assert os.access(os.environ["HOME"], os.W_OK)


def test_home_of_a_user_stays(driver, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    driver.provide_home()
    assert os.environ["HOME"] == str(tmp_path)


@pytest.fixture
def write_squeue(tmp_path, monkeypatch):
    """Return a function that makes a program `squeue` of lines of the shell."""
    program = tmp_path / "squeue"
    program.touch(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")

    def write(lines: str) -> None:
        program.write_text(f"#!/bin/bash\n{lines}\n")

    return write


def test_jobs_of_this_folder_are_noticed_among_two_thousand(driver, write_squeue):
    write_squeue(f'for i in {{1..2000}}; do echo "$i|{ROOT}"; done')
    assert driver.jobs_in_queue()


def test_own_job_and_jobs_of_other_folders_do_not_count(driver, write_squeue, monkeypatch):
    write_squeue(f"echo '7|{ROOT}'\necho '8|/elsewhere'")
    monkeypatch.setenv("SLURM_JOB_ID", "7")
    assert not driver.jobs_in_queue()


def test_queue_that_does_not_answer_is_refused(driver, write_squeue):
    write_squeue("echo 'slurm: no controller' >&2\nexit 1")
    with refusal("command_failed"):
        driver.jobs_in_queue()
