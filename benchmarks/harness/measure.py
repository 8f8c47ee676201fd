"""Time and peak memory of one task in a process of its own.

    python -m benchmarks.harness.measure MODULE:FUNCTION JSON

The function prepares the task from the JSON's arguments and returns an action without arguments;
only the action is measured. Seconds of a task that may use one thread are its processor time: on a
free core that is the elapsed time, and what else the machine does disturbs it little. Of several
threads they are the elapsed time, so that the machine must have nothing else to do.
"""

import contextlib
import importlib
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from modal.packing.network import Network, write_network
from modal.packing.sample import Sample, write_sample
from modal.tools.errors import InputError
from modal.tools.workload import peak_memory

ROOT = Path(__file__).resolve().parents[2]
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
CORES = os.cpu_count() or 1
LONGEST = 900
"""Seconds after which a task is given up."""
LONG_RUN = 5.0
"""Seconds from which a run is not repeated: it averages over the machine's whims by itself."""
LAUNCHER = """
import os, subprocess, sys, time
start = time.perf_counter()
with open(sys.argv[1], "w") as log:
    program = subprocess.Popen(
        sys.argv[2:], stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT
    )
    _, status, used = os.wait4(program.pid, 0)
elapsed, spent = time.perf_counter() - start, used.ru_utime + used.ru_stime
print(os.waitstatus_to_exitcode(status), elapsed, spent, used.ru_maxrss)
"""
"""Runs one command and prints its exit status, elapsed and processor time, and peak memory."""


@dataclass(frozen=True)
class Measured:
    """What a task has returned, its time (s) and peak resident memory (MB).

    `failure` says why there is nothing to report; the numbers are then None.
    """

    value: Any = None
    seconds: float | None = None
    peak_mb: float | None = None
    failure: str = ""

    @property
    def cost(self) -> dict[str, float | str | None]:
        """Columns of a table."""
        cost = {"seconds": self.seconds, "peak_mb": self.peak_mb}
        return cost | ({"failure": self.failure} if self.failure else {})


@dataclass(frozen=True)
class Job:
    """A benchmark under way: whether it is of small sizes, and the folder of its files."""

    quick: bool
    folder: Path

    @property
    def times(self) -> int:
        """Runs of which the median counts."""
        return 1 if self.quick else 3

    def write(self, packing: Network | Sample, name: str = "packing") -> str:
        """Keep a packing for tasks and commands; its path."""
        sample = isinstance(packing, Sample)
        path = self.folder / f"{name}.{'sample' if sample else 'network'}.h5"
        (write_sample if sample else write_network)(path, packing)
        return str(path)

    def measured(
        self, task: Callable[..., Any], *, threads: int = 1, must: bool = True, **given: Any
    ) -> Measured:
        """Median of three runs of a task, of one if `quick`; arguments and value must be JSON.

        InputError with its last line if one fails, unless that is a result too: not `must`.
        """
        found = median_of(self.times, lambda: _run(task, threads, given))
        if found.failure and must:
            raise InputError("input", f"{task.__module__}:{task.__name__}: {found.failure}")
        return found

    def command(self, *words: str, threads: int | None = CORES) -> Measured:
        """A command of this project in the folder; one that fails, or dies for memory, says why."""
        how: dict[str, Any] = {"environment": {"PYTHONPATH": str(ROOT)}, "threads": threads}
        log = self.folder / "command.log"
        try:
            return run_command([sys.executable, "-m", *words], self.folder, log, **how)
        except InputError as error:
            return Measured(failure=str(error))


def median_of(times: int, run: Callable[[], Measured]) -> Measured:
    """Medians of the seconds and megabytes of `times` runs; one alone if it is long or fails."""
    found = [run()]
    while len(found) < times and not found[-1].failure and found[0].seconds < LONG_RUN:
        found.append(run())
    if found[-1].failure:
        return found[-1]
    seconds, peak = zip(*((run.seconds, run.peak_mb) for run in found), strict=True)
    return Measured(found[-1].value, statistics.median(seconds), statistics.median(peak))


def _limited(threads: int | None) -> dict[str, str]:
    """This environment with so many threads for every library that has any, or its own choice."""
    free = {name: text for name, text in os.environ.items() if name not in THREADS}
    return free if threads is None else free | dict.fromkeys(THREADS, str(threads))


def _run(task: Callable[..., Any], threads: int, arguments: dict[str, Any]) -> Measured:
    name = f"{task.__module__}:{task.__name__}"
    command = [sys.executable, "-m", "benchmarks.harness.measure", name, json.dumps(arguments)]
    how: dict[str, Any] = {"cwd": ROOT, "env": _limited(threads), "timeout": LONGEST}
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, **how)
    except subprocess.TimeoutExpired:
        return Measured(failure=f"given up after {LONGEST} s")
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
        return Measured(failure=last)
    return Measured(**json.loads(done.stdout.splitlines()[-1]))


def run_command(
    command: list[str],
    folder: Path,
    log: Path,
    environment: Mapping[str, str] | None = None,
    threads: int | None = 1,
) -> Measured:
    """Time and peak memory of a command; its output goes to `log`.

    Without `threads` it takes as many as it chooses itself. InputError with the command's own last
    error if it fails.
    """
    # A program inherits the peak of the process that starts it: here that of a bare interpreter.
    launcher = [sys.executable, "-S", "-c", LAUNCHER, str(log), *command]
    settings = _limited(threads) | dict(environment or {})
    done = subprocess.run(
        launcher, cwd=folder, env=settings, stdout=subprocess.PIPE, text=True, check=True
    )
    status, elapsed, spent, peak = map(float, done.stdout.split())
    if status != 0:
        lines = [line for line in log.read_text().splitlines() if "rror" in line]
        last = lines[-1] if lines else f"{status:.0f}"
        raise InputError("input", f"{Path(command[0]).name} failed", f"{last}")
    unit = 1 if sys.platform == "darwin" else 1024
    return Measured(None, spent if threads == 1 else elapsed, peak * unit / 1e6)


def main(argv: list[str]) -> int:
    """Prepare, run, print one line of JSON."""
    module, name = argv[0].split(":")
    prepare: Callable[..., Callable[[], Any]] = getattr(importlib.import_module(module), name)
    action = prepare(**json.loads(argv[1]))
    with contextlib.suppress(OSError):  # let the peak count from now on, where Linux can
        Path("/proc/self/clear_refs").write_text("5")
    clock = time.process_time if os.environ[THREADS[0]] == "1" else time.perf_counter
    start = clock()
    value = action()
    seconds = clock() - start
    print(json.dumps({"value": value, "seconds": seconds, "peak_mb": peak_memory() / 1e6}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
