"""The study on a real Slurm: a small study of two frictions, disturbed in every way it may be.

tests/slurm_here.sh starts a Slurm of this machine. What counts: the next run ends, makes nothing
twice, and its products are those of a run without Slurm.
"""

import contextlib
import importlib.util
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from killed_runs import assert_equal_products
from places import ROOT
from study_folder import copy_of, study_folder

HERE = str(ROOT / "tests/slurm_here.sh")
SPHERES = "1000"
STUDY = ["./run_cases.sh", "--case", "6", "10", "--spheres", SPHERES, "--from-scratch"]
STUDY += ["--stage", "wave"]
FOLDER = f"products/{SPHERES}_spheres"
PATIENCE = 1800
"""Seconds that a run may take on a busy machine."""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def start(tmp_path_factory, yade) -> Iterator[Path]:
    """Return a copy of the project with this very Python in place of .venv, and start Slurm."""
    if not importlib.util.find_spec("snakemake_executor_plugin_slurm"):
        pytest.skip("Slurm: its plugin of Snakemake is not installed: pip install '.[slurm]'")
    if not shutil.which("slurmctld") or os.geteuid():
        pytest.skip("no Slurm that could be started: tests/slurm_here.sh install, as root")
    folder = study_folder(tmp_path_factory.mktemp("slurm") / "start")
    subprocess.run([HERE, "start"], check=True)
    yield folder
    subprocess.run([HERE, "stop"], check=True)


@pytest.fixture(scope="module")
def local(start) -> Path:
    """Return the study, run without Slurm."""
    folder = copy_of(start, "local")
    assert exit_status(run(folder)) == 0
    return folder


@pytest.fixture(scope="module")
def by_slurm(start, local) -> Path:
    """Return the complete study, run by Slurm; each test takes something away from it."""
    folder = copy_of(start, "whole")
    assert exit_status(run(folder, "--slurm")) == 0
    assert_same_products(local, folder)
    return folder


def run(folder: Path, *options: str, **environment: str) -> subprocess.Popen:
    """Start the study in a process group of its own; its output goes to a file beside it."""
    with open(folder.with_suffix(".out"), "a") as out:
        return subprocess.Popen(
            [*STUDY, *options],
            cwd=folder,
            env=os.environ | environment,
            stdout=out,
            stderr=out,
            start_new_session=True,
        )


def exit_status(process: subprocess.Popen) -> int:
    """Wait for the end of a study and return its exit status."""
    return process.wait(timeout=PATIENCE)


def kill(process: subprocess.Popen) -> None:
    """Kill the driver and Snakemake; jobs of Slurm go on."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def assert_same_products(local: Path, folder: Path) -> None:
    """Compare products, but for notes of walks on their time and their steps."""
    assert_equal_products(local / FOLDER, folder / FOLDER)


def without(folder: Path, *names: str) -> dict[Path, float]:
    """Remove products, and return the times at which the other ones were written."""
    for name in names:
        path = folder / FOLDER / name
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
    return {path: path.stat().st_mtime for path in (folder / FOLDER).glob("*.h5")}


def assert_mended(local: Path, folder: Path, before: dict[Path, float]) -> None:
    """Check that the next run makes what was removed, the same as before, and nothing else."""
    assert exit_status(run(folder, "--slurm")) == 0
    assert_same_products(local, folder)
    assert {path: path.stat().st_mtime for path in before} == before


def running_job(rule: str, folder: Path) -> str:
    """Return the number of this study's running job of a rule, once there is one."""
    command = ["squeue", "--me", "--noheader", "--states=running", "--format=%i|%Z|%k"]
    for _ in range(PATIENCE):
        output = subprocess.run(command, capture_output=True, text=True).stdout
        for row in output.splitlines():
            number, folder_of_job, comment = row.split("|", 2)
            if folder_of_job == str(folder) and rule in comment:
                return number
        time.sleep(0.5)
    raise AssertionError(f"no job of {rule}")


def states_of_jobs(folder: Path, rule: str = "") -> list[str]:
    """Return the states of all jobs that this study has had, or of those of a rule."""
    command = ["squeue", "--noheader", "--states=all", "--format=%k %T %Z"]
    output = subprocess.run(command, capture_output=True, text=True).stdout
    states = []
    for row in output.splitlines():
        if row.endswith(f" {folder}"):
            comment, state, _ = row.split()
            if rule in comment:
                states.append(state)
    return states


def test_every_job_is_one_of_slurms(by_slurm):
    """Count ten jobs; `by_slurm` has compared their products with a run without Slurm."""
    assert states_of_jobs(by_slurm) == 10 * ["COMPLETED"]


def test_failing_job(local, by_slurm):
    """Fail twice by an unstable time step: the other case is made, and the next run mends this."""
    before = without(by_slurm, "case06.signals.h5")
    assert exit_status(run(by_slurm, "--slurm", WAVE_FRACTION="1.5")) == 2
    assert not (by_slurm / FOLDER / "case06.signals.h5").exists()
    # The other case's signals were stale with that fraction, and are made again.
    before = {path: written for path, written in before.items() if "signals" not in path.name}
    assert_mended(local, by_slurm, before)


def test_cancelled_job(local, by_slurm):
    """Cancel a walk: it starts once more, or goes on in the next run."""
    case = [f"case10.{kind}.h5" for kind in ("sample", "network", "highest.modes", "signals")]
    before = without(by_slurm, "states/mu0.01", "walks/compression_mu0.01", *case)
    study = run(by_slurm, "--slurm")
    subprocess.run(["scancel", running_job("states", by_slurm)], check=True)
    exit_status(study)
    assert_mended(local, by_slurm, before)


def test_time_limit(local, by_slurm):
    """Stop a job until its time limit is over: Slurm tries again with twice the time."""
    kinds = "network", "highest.modes", "signals"  # the last two follow from the first
    before = without(by_slurm, *(f"case06.{kind}.h5" for kind in kinds))
    study = run(by_slurm, "--slurm")
    number = running_job("network", by_slurm)
    subprocess.run(["scontrol", "update", f"JobId={number}", "TimeLimit=1"], check=True)
    subprocess.run(["scancel", "--full", "--signal=STOP", number], check=True)
    exit_status(study)
    state = ["squeue", "--noheader", "--states=all", "--format=%T", "--jobs", number]
    assert subprocess.run(state, capture_output=True, text=True).stdout.strip() == "TIMEOUT"
    assert_mended(local, by_slurm, before)


def test_killed_driver(local, by_slurm):
    """Kill the driver: its jobs go on; the next run waits for them and makes the rest."""
    case = [f"case10.{kind}.h5" for kind in ("network", "signals")]
    before = without(by_slurm, *case)
    networks = states_of_jobs(by_slurm, "network")
    study = run(by_slurm, "--slurm")
    running_job("network", by_slurm)
    kill(study)
    assert_mended(local, by_slurm, before)
    # Snakemake's part of a job touches its product when all is over: count jobs, not times.
    assert states_of_jobs(by_slurm, "network") == [*networks, "COMPLETED"]


def test_controller_that_restarts(local, by_slurm):
    """Stop the controller for twenty seconds during a job: this run or the next one completes.

    Where the controller does not answer the plugin asks the accounting, which is off here, and
    forgets its jobs. Jobs take a minute: a run that is not over after ten has lost them.
    """
    before = without(by_slurm, "case06.signals.h5", "case10.signals.h5")
    study = run(by_slurm, "--slurm")
    running_job("yade_wave", by_slurm)
    subprocess.run([HERE, "restart", "20"], check=True)
    with contextlib.suppress(subprocess.TimeoutExpired):
        assert study.wait(timeout=600) == 0
    kill(study)
    assert_mended(local, by_slurm, before)
