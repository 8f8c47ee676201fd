"""One run of a study by Snakemake, as ./run_cases.sh asks for it: locks, YADE, tables.

run.py PROFILE ONLY JOBS NAME=VALUE ...     settings of the Snakefile; ONLY: dry-run, summary, none
"""

import fcntl
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import yaml
from commands import PYTHON, quoted
from jobs import Jobs

from analysis.table import Table
from modal.tools.errors import InputError
from modal.tools.workload import memory_at_hand

OF_YADE = "crystal", "network", "yade_wave", "further_wave", "states"
"""Rules that may need YADE."""
MANY = 300
"""Cases whose jobs take more than some seconds to plan, which is said."""


def main(profile: str, only: str, asked: str, *given: str) -> int:
    """Run; the exit status."""
    # As Snakemake reads them: what is no number, and no list, is a text.
    texts = dict(text.split("=", 1) for text in given)
    config = {name: yaml.load(value, yaml.BaseLoader) for name, value in texts.items()}
    jobs = Jobs(config)
    if not jobs.targets():
        raise InputError(
            "stage",
            f"--stage {jobs.stage}",
            f"makes no file of {', '.join(jobs.cases)}",
            "choose another stage",
        )
    if len(jobs.rows) > MANY:
        print(f"run_cases.sh: {len(jobs.rows)} cases; planning their jobs", flush=True)
    folder, study = Path(jobs.folder), str(config["study"])
    local = profile == "local"
    take_a_home()
    count = asked or (str(len(os.sched_getaffinity(0))) if local else "20")
    snakemake = [sys.executable, "-m", "snakemake", "-s", "workflow/Snakefile"]
    snakemake += ["--workflow-profile", f"workflow/profiles/{profile}"]
    # No more jobs side by side than the memory that is free now, or granted, has room for.
    memory = f"mem_mb={int(memory_at_hand() / 2**20)}"
    snakemake += ["--cores", count, "--resources", memory] if local else ["--jobs", count]
    if profile == "slurm":
        if not shutil.which("sbatch"):
            raise InputError(
                "input", "--slurm", "no sbatch in PATH", "run it where jobs are submitted"
            )
        if subprocess.run(["sacct", "--noheader"], capture_output=True).returncode:
            snakemake += ["--slurm-status-command", "squeue"]  # where accounting is off
    if not only:
        folder.mkdir(parents=True, exist_ok=True)
        lock = wait(folder / ".driver", "another run is at work: waiting for it")
        # A kill leaves jobs behind: what they make counts, and nothing is made twice.
        wait(folder / ".jobs", "jobs of a run that was killed are at work: waiting").close()
        while profile == "slurm" and at_work():
            time.sleep(10)
    settings = ["--config", *given]
    if only:
        return subprocess.run([*snakemake, f"--{only}", *settings]).returncode and 2
    if local and subprocess.run(["./setup.sh", "--is-yade-there"], capture_output=True).returncode:
        plan = output([*snakemake, "--dry-run", *settings])
        yade = any(line.split()[:1] in ([rule] for rule in OF_YADE) for line in plan.splitlines())
        if yade and (done := subprocess.run(["./setup.sh", "--extra", "workflow"]).returncode):
            return done
    failed = folder / ".failed"
    failed.unlink(missing_ok=True)
    absent = Path(jobs.results, "absent.csv")
    if absent.exists():  # the page that is there lacks cases, which are tried again
        absent.unlink()
        Path(folder, "study/study.html").unlink(missing_ok=True)
    # Where this driver is killed, Snakemake goes on and holds the lock.
    done = subprocess.run([*snakemake, *settings], pass_fds=[lock.fileno()]).returncode
    if jobs.stage == "result" and not jobs.seed:
        there = [case for case in jobs.cases if Path(jobs.results, f"{case}.json").exists()]
        table = "analysis", "study", study, "--results", jobs.results, "--case"
        tables = [quoted(*table, case) for case in there]
        subprocess.run([PYTHON, "-m", "workflow.in_turn", *tables])
    elif jobs.stage == "page" and not done:
        print(f"{folder}/study/study.html")
        report = str(folder / "study/workflow.html")
        done = subprocess.run([*snakemake, "--report", report, *settings]).returncode
    lock.close()
    status_, *reasons = failed.read_text().splitlines() if failed.exists() else ["1"]
    for reason in reasons:
        print(f"run_cases.sh: {reason}", file=sys.stderr)
    if done and reasons and jobs.stage == "page":
        return page_without(jobs, study, reasons) or int(status_)
    return int(status_) if done else 0


def take_a_home() -> None:
    """Set HOME for what runs here: YADE ends without, Snakemake and numba keep their caches there.

    Where the user has no home that can be written to, as in a container, it is a folder of this
    project.
    """
    home = os.path.abspath(os.path.expanduser("~"))
    if not os.access(home, os.W_OK):
        home = os.path.abspath(".snakemake/home")
        os.makedirs(home, exist_ok=True)
    os.environ["HOME"] = home


def page_without(jobs: Jobs, study: str, reasons: list[str]) -> int:
    """The page of the results that are there, which says why the others are not; its status, 3."""
    lines = []
    for reason in reasons:
        job, _, why = reason.partition(": ")
        names = (*jobs.rows, *jobs.walks)
        made = [name for name in names if re.search(rf" {re.escape(name)}\b", job)]
        name = max(made, key=len, default=job)
        lines += [[case, why] for case in jobs.walks.get(name, [name])]
    Table("", ["case", "why"], lines).write_csv(Path(jobs.results, "absent.csv"))
    command = [PYTHON, "-m", "analysis", "study", study, "--results", jobs.results]
    return subprocess.run([*command, "-o", f"{jobs.folder}/study"]).returncode


def wait(path: Path, text: str):
    """The lock on a file, once it is free."""
    file = path.open("w")  # open as long as the lock is held
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        print(text, flush=True)
        fcntl.flock(file, fcntl.LOCK_EX)
    return file


def at_work() -> bool:
    """Whether Slurm jobs of this folder wait or run, but for one that this driver runs in."""
    text = output(["squeue", "--me", "--noheader", "--format=%i|%Z"])
    own = os.environ.get("SLURM_JOB_ID")
    rows = [line.strip().split("|") for line in text.splitlines()]
    return any(job != own and folder == os.getcwd() for job, folder in rows)


def output(command: list[str]) -> str:
    """What a command prints; InputError with its last line where it fails."""
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
