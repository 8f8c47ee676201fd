"""Run a study by Snakemake, as ./run_cases.sh requests: locks, YADE, tables.

run.py PROFILE ONLY JOBS NAME=VALUE ...

NAME=VALUE are settings of the Snakefile; ONLY is dry-run, summary or empty; JOBS may be empty.
"""

import fcntl
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import TextIO

import yaml
from commands import PYTHON, quoted
from jobs import Jobs

from analysis.table import Table
from modal.tools.errors import InputError
from modal.tools.workload import memory_at_hand

RULES_OF_YADE = ("crystal", "network", "yade_wave", "further_wave", "states")
"""Rules that may need YADE."""
MANY_CASES = 300
"""Number of cases from which on planning the jobs takes more than some seconds, so that a line
announces it."""
CLUSTER_JOBS = 20
"""Jobs at a time on a cluster, if the caller does not say how many."""
SECONDS_BETWEEN_LOOKS = 10
"""Time between two looks at the queue of a cluster, s."""


def main(profile: str, only: str, jobs_at_a_time: str, *settings: str) -> int:
    """Run the study and return the exit status of ./run_cases.sh.

    Raises InputError if the settings, the study or the machine do not allow the run.
    """
    jobs = Jobs(_read_settings(settings))
    if not jobs.targets():
        raise InputError(
            "stage",
            f"--stage {jobs.stage}",
            f"makes no file of {', '.join(jobs.cases)}",
            "choose another stage",
        )
    if len(jobs.rows) > MANY_CASES:
        print(f"run_cases.sh: {len(jobs.rows)} cases; planning their jobs", flush=True)
    provide_home()
    snakemake = _snakemake_command(profile, jobs_at_a_time)
    configuration = ["--config", *settings]
    if only:
        return subprocess.run([*snakemake, f"--{only}", *configuration]).returncode and 2
    folder = Path(jobs.folder)
    folder.mkdir(parents=True, exist_ok=True)
    with wait_for_lock(folder / ".driver", "another run is at work: waiting for it") as lock:
        # A kill leaves jobs behind: what they make counts, and nothing is made twice.
        wait_for_lock(
            folder / ".jobs", "jobs of a run that was killed are at work: waiting"
        ).close()
        while profile == "slurm" and jobs_in_queue():
            time.sleep(SECONDS_BETWEEN_LOOKS)
        if profile == "local":
            status = _install_yade_if_needed(snakemake, configuration)
            if status:
                return status
        failed = folder / ".failed"
        failed.unlink(missing_ok=True)
        _forget_incomplete_page(jobs)
        # If this driver is killed, Snakemake goes on and holds the lock.
        status = subprocess.run([*snakemake, *configuration], pass_fds=[lock.fileno()]).returncode
        if jobs.stage == "result" and jobs.seed is None:
            _print_tables(jobs)
        elif jobs.stage == "page" and not status:
            print(f"{folder}/study/study.html")
            report = str(folder / "study/workflow.html")
            status = subprocess.run([*snakemake, "--report", report, *configuration]).returncode
    if not status:
        return 0
    return _report_failure(jobs, failed)


def _read_settings(settings: tuple[str, ...]) -> dict[str, object]:
    """Return the settings NAME=VALUE as Snakemake reads them: all except lists are texts."""
    pairs = [text.split("=", 1) for text in settings]
    return {name: yaml.load(value, yaml.BaseLoader) for name, value in pairs}


def _snakemake_command(profile: str, jobs_at_a_time: str) -> list[str]:
    """Return the command of Snakemake with a profile; InputError if its cluster is not there."""
    command = [sys.executable, "-m", "snakemake", "-s", "workflow/Snakefile"]
    command += ["--workflow-profile", f"workflow/profiles/{profile}"]
    if profile == "local":
        cores = jobs_at_a_time or str(len(os.sched_getaffinity(0)))
        # No more jobs side by side than the memory that is free now, or granted, has room for.
        memory = f"mem_mb={int(memory_at_hand() / 2**20)}"
        return [*command, "--cores", cores, "--resources", memory]
    command += ["--jobs", jobs_at_a_time or str(CLUSTER_JOBS)]
    if profile == "slurm":
        if not shutil.which("sbatch"):
            raise InputError(
                "no_slurm", "--slurm", "no sbatch in PATH", "run it where jobs are submitted"
            )
        if subprocess.run(["sacct", "--noheader"], capture_output=True).returncode:
            command += ["--slurm-status-command", "squeue"]  # where accounting is off
    return command


def _install_yade_if_needed(snakemake: list[str], configuration: list[str]) -> int:
    """Install YADE if it is absent and a planned job needs it; return the installer's status."""
    if not subprocess.run(["./setup.sh", "--is-yade-there"], capture_output=True).returncode:
        return 0
    plan = output_of([*snakemake, "--dry-run", *configuration])
    rules = {line.split()[0] for line in plan.splitlines() if line.split()}
    if rules.isdisjoint(RULES_OF_YADE):
        return 0
    return subprocess.run(["./setup.sh", "--extra", "workflow"]).returncode


def _forget_incomplete_page(jobs: Jobs) -> None:
    """Remove a page that lacks cases, so that the run tries to make these cases again."""
    absent = Path(jobs.results, "absent.csv")
    if absent.exists():
        absent.unlink()
        for name in ("study.html", "absent.csv"):
            Path(jobs.folder, "study", name).unlink(missing_ok=True)


def _print_tables(jobs: Jobs) -> None:
    """Print the table of each case that has a result."""
    cases = [case for case in jobs.cases if Path(jobs.results, f"{case}.json").exists()]
    command = ("analysis", "study", jobs.study.path, "--results", jobs.results, "--case")
    tables = [quoted(*command, case) for case in cases]
    subprocess.run([PYTHON, "-m", "workflow.in_turn", *tables])


def _report_failure(jobs: Jobs, failed: Path) -> int:
    """Print why jobs failed, write a page without their cases, and return the exit status.

    `failed` is the file in which the Snakefile has noted a status and a reason for each job.
    """
    status = 1
    reasons: list[str] = []
    if failed.exists():
        first, *reasons = failed.read_text().splitlines()
        status = int(first)
    for reason in reasons:
        print(f"run_cases.sh: {reason}", file=sys.stderr)
    if reasons and jobs.stage == "page":
        return write_page_without(jobs, reasons) or status
    return status


def provide_home() -> None:
    """Set HOME for the programs that run here.

    YADE stops without a home folder, and Snakemake and numba store their caches there. For a user
    without a home that can be written to, as in a container, HOME is a folder of this project.
    """
    home = os.path.abspath(os.path.expanduser("~"))
    if not os.access(home, os.W_OK):
        home = os.path.abspath(".snakemake/home")
        os.makedirs(home, exist_ok=True)
    os.environ["HOME"] = home


def write_page_without(jobs: Jobs, reasons: list[str]) -> int:
    """Write the page of the results that exist, with the reasons why others do not.

    Returns the exit status of the program that writes the page: 3 for one that lacks cases.
    """
    lines = []
    for reason in reasons:
        job, _, why = reason.partition(": ")
        names = (*jobs.rows, *jobs.walks)
        names_in_job = [name for name in names if re.search(rf" {re.escape(name)}\b", job)]
        name = max(names_in_job, key=len, default=job)
        lines += [[case, why] for case in jobs.walks.get(name, [name])]
    Table("", ["case", "why"], lines).write_csv(Path(jobs.results, "absent.csv"))
    command = [PYTHON, "-m", "analysis", "study", str(jobs.study.path), "--results", jobs.results]
    return subprocess.run([*command, "-o", f"{jobs.folder}/study"]).returncode


def wait_for_lock(path: Path, text: str) -> TextIO:
    """Return the open file that holds a lock, once it is free; print `text` if that takes time.

    The lock is held until the file is closed.
    """
    file = path.open("w")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        print(text, flush=True)
        fcntl.flock(file, fcntl.LOCK_EX)
    return file


def jobs_in_queue() -> bool:
    """Tell whether Slurm jobs of this folder wait or run, except the job of this driver itself."""
    text = output_of(["squeue", "--me", "--noheader", "--format=%i|%Z"])
    own_job = os.environ.get("SLURM_JOB_ID")
    rows = [line.strip().split("|") for line in text.splitlines()]
    return any(job != own_job and folder == os.getcwd() for job, folder in rows)


def output_of(command: list[str]) -> str:
    """Return what a command prints; InputError with its last line if it fails."""
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"{command[0]} failed"]
        raise InputError("command_failed", lines[-1])
    return done.stdout


if __name__ == "__main__":
    try:
        sys.exit(main(*sys.argv[1:]))
    except (InputError, OSError) as error:
        print(f"run_cases.sh: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
