"""What a run of the study prints: the plan, a line per finished product, why a job failed.

Snakemake finds it by its name (`--logger study`) where this folder's parent is in PYTHONPATH.
STUDY_FAILED, if set, names a file that gets a line for each job that failed: 2 where its log says
what to do about it, else 1, and the reason.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import re
import resource
import shutil
import sys
import time
from collections import Counter
from logging import WARNING, LogRecord
from pathlib import Path
from typing import Any

from cost import job as benchmark
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

SILENT = {"all"}
"""Rules that make nothing."""
SHOWN = 200
"""Characters of a reason."""
ROOM = 10_000
"""Bytes on a disk that is not full."""
FULL = "no space is left on the disk: free some, then run the same command; what is made is kept"
STOPPED = "Will exit after finishing currently running jobs"
WAITS = "told to end: waits for the jobs that are at work; the same command goes on later"
HEAD = re.compile(r"\w*(Error|Exception)( in (file|rule) .*)?:?$|Error validating config file")
PREFIX = re.compile(r"^\w*(Error|Exception): ")
KNOWN = (
    *("At least one job", "Exiting because", "Shutting down", "Command '"),
    *(
        "Missing metadata for file",
        "Ignore corrupted or currently written metadata",
        "MinJobAge",
        "No SLURM account",
        "Unable to guess SLURM account",
    ),
)
"""Beginnings of what the lines of the jobs have said before, and of what is no trouble."""


class LogHandler(LogHandlerBase):
    """Prints what happens to the jobs, on stdout; what went wrong, on stderr."""

    writes_to_stream = True
    writes_to_file = False
    has_filter = True
    has_formatter = True
    needs_rulegraph = False

    def __post_init__(self) -> None:
        self.jobs: dict[int, dict[str, Any]] = {}
        self.planned: Counter[str] = Counter()
        self.expected: dict[str, float] = {}
        self.of_yade: set[str] = set()
        self.said: set[str] = set()
        self.done = self.cores = 0
        self.closed = self.elsewhere = False
        self.spent = self.foreseen = 0.0
        self.started = time.monotonic()
        # Snakemake keeps a log of its own; that it cannot be written is no reason for a traceback.
        logging.raiseExceptions = False

    def emit(self, record: LogRecord) -> None:
        """One event of the run."""
        said = vars(record)
        event = said.get("event")
        if "expected" in said:
            self.expected, self.cores, self.of_yade = said["expected"], said["cores"], said["yade"]
        elif event == LogEvent.RUN_INFO and not self.planned:
            self.planned = Counter({k: n for k, n in said["stats"].items() if k != "total"})
            for rule in SILENT:
                self.planned.pop(rule, None)
        elif event == LogEvent.RESOURCES_INFO:
            self.elsewhere = self.elsewhere or "nodes" in said
        elif event == LogEvent.JOB_INFO:
            self.jobs[said["jobid"]] = said
            if self.common_settings.dryrun and said["rule_name"] not in SILENT:
                print(f"{said['rule_name']:20} {_name(said['output'])}: {_reason(said['reason'])}")
        elif event == LogEvent.JOB_FINISHED:
            self.finish(self.jobs.get(said["job_id"]))
        elif event == LogEvent.JOB_ERROR:
            self.fail(said)
        elif record.getMessage().startswith(STOPPED):
            if WAITS not in self.said:
                _note(1, WAITS)
            self.say(WAITS)
        elif event in (None, LogEvent.ERROR) and record.levelno >= WARNING:
            self.warn(record)

    def finish(self, job: dict[str, Any] | None) -> None:
        """A line for a finished product: its cost, and how long the rest may take."""
        if job is None or job["rule_name"] in SILENT:
            return
        self.done += 1
        self.planned[job["rule_name"]] -= 1
        seconds = memory = 0.0
        path = Path(job["benchmark"] or "")
        if path.is_file() and path.stat().st_size:
            seconds, memory, _ = benchmark(path)
        self.spent += seconds
        self.foreseen += self.expected.get(job["rule_name"], 0.0)
        cost = f"{seconds:7.1f} s" + (f" {memory:6.0f} MB" if memory else " " * 10)
        todo = sum(self.planned.values())
        line = f"{time.strftime('%H:%M:%S')}  {_name(job['output']):34} {cost}"
        print(f"{line}  {self.done} of {self.done + todo}{self.to_go()}", flush=True)

    def to_go(self) -> str:
        """Time to go, from what was expected and how far off that was until now."""
        left = sum(n * self.expected.get(rule, 0.0) for rule, n in self.planned.items())
        if left == 0:
            return ""
        off = self.spent / self.foreseen if self.foreseen and self.spent else 1.0
        return f", {_time(off * left / max(1, self.cores))} to go"

    def warn(self, record: LogRecord) -> None:
        """What stops or hinders the run as a whole, in one line."""
        lines = [line.strip() for line in record.getMessage().splitlines() if line.strip()]
        texts = [PREFIX.sub("", line) for line in lines if not HEAD.match(line)]
        if texts and not texts[0].startswith(KNOWN):
            self.say(FULL if os.strerror(errno.ENOSPC) in texts[0] else texts[0][:SHOWN])

    def fail(self, job: dict[str, Any]) -> None:
        """One line for a job that failed: the product, why, and where to read more."""
        product, logs = _name(job["output"]), [Path(path) for path in job["log"]]
        reason, mendable = _reason_of(logs)
        self.say(f"{product}: {reason}" + (f" ({logs[0]})" if logs else ""))
        self.said.add(reason)
        _note(2 if mendable else 1, f"{product}: {reason}")

    def say(self, text: str) -> None:
        """What went wrong, on stderr, if it was not said before."""
        if text not in self.said:
            print(f"run_cases.sh: {text}", file=sys.stderr, flush=True)
        self.said.add(text)

    def close(self) -> None:
        """At the end: the plan of a dry run, or how busy the cores were."""
        if self.closed:
            return
        self.closed = True
        if self.common_settings.dryrun:
            if not self.planned and not self.said:
                print("nothing to be made")
            total = sum(n * self.expected.get(rule, 0.0) for rule, n in self.planned.items())
            for rule, n in self.planned.items():
                hours = n * self.expected.get(rule, 0.0) / 3600
                program = ", by YADE" if rule in self.of_yade else ""
                print(f"plan: {rule:20} {n:4} jobs {hours:9.3f} core-hours{program}")
            if self.planned:
                cost = f"{self.planned.total():4} jobs {total / 3600:9.3f} core-hours"
                at_once = f"some {_time(total / max(1, self.cores))} on {self.cores} cores"
                print(f"plan: {'all':20} {cost}, {at_once}")
        elif self.done and not self.elsewhere:
            used = resource.getrusage(resource.RUSAGE_CHILDREN)
            wall, busy = time.monotonic() - self.started, used.ru_utime + used.ru_stime
            text = (
                f"{self.done} products in {_time(wall)}; their programs computed for {_time(busy)}"
            )
            print(f"{text}, {100 * busy / wall / max(1, self.cores):.0f} % of {self.cores} cores")
        sys.stdout.flush()
        super().close()


def _reason_of(logs: list[Path]) -> tuple[str, bool]:
    """Why a job failed, from its logs; and whether that says what to do."""
    text = "".join(path.read_text(errors="replace") for path in logs if path.is_file())
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    errors = [line.removeprefix("error: ") for line in lines if line.startswith("error: ")]
    if errors:
        return errors[-1][:SHOWN], True
    folders = [path.parent for path in logs if path.parent.exists()]
    if any(shutil.disk_usage(folder).free < ROOM for folder in folders):
        return FULL, True
    return (lines or ["no word"])[-1][:SHOWN], False


def _note(status: int, text: str) -> None:
    """Write what failed for run_cases.sh; where even this has no room, all can be mended."""
    with contextlib.suppress(KeyError, OSError), open(os.environ["STUDY_FAILED"], "a") as file:
        print(status, text, file=file)


def _name(outputs: Any) -> str:
    """A job's product as one name."""
    paths = [Path(str(path)) for path in outputs or []]
    if len(paths) > 1:
        return f"{paths[0].parent.name} ({len(paths)} states)"
    return paths[0].name if paths else "?"


def _reason(text: str) -> str:
    """Why a job runs, in few words."""
    if text.startswith("Missing output"):
        return "is missing"
    if text.startswith("Forced execution"):  # run_cases.sh asks for what is stale
        return "was made otherwise; --status says how"
    return text.split(";")[0].split("\n")[0][:SHOWN]


def _time(seconds: float) -> str:
    """Hours, minutes or seconds, to two digits or so."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
