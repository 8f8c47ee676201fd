"""Measurement of the time and the peak memory of one task in its own process.

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
MAX_TASK_SECONDS = 900
"""Time after which a task is given up."""
MAX_REPEATED_SECONDS = 5.0
"""Time of a run from which it is not repeated: it averages over disturbances by itself."""
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
    """Result of a task, with its cost.

    Attributes
    ----------
    value : object
        What the task has returned.
    seconds, peak_mb : float or None
        Its time, s, and peak resident memory, MB; None if it failed.
    failure : str
        Why it failed, or an empty text.
    """

    value: Any = None
    seconds: float | None = None
    peak_mb: float | None = None
    failure: str = ""

    @property
    def cost(self) -> dict[str, float | str | None]:
        """Time, memory and, if it failed, the failure, as columns of a table."""
        cost: dict[str, float | str | None] = {"seconds": self.seconds, "peak_mb": self.peak_mb}
        if self.failure:
            cost["failure"] = self.failure
        return cost


@dataclass(frozen=True)
class Job:
    """A running benchmark: whether it uses small sizes (`quick`), and the folder of its files."""

    quick: bool
    folder: Path

    @property
    def times(self) -> int:
        """Number of runs of which the median counts."""
        return 1 if self.quick else 3

    def write(self, packing: Network | Sample, name: str = "packing") -> str:
        """Write a packing for tasks and commands, and return its path."""
        if isinstance(packing, Sample):
            path = self.folder / f"{name}.sample.h5"
            write_sample(path, packing)
        else:
            path = self.folder / f"{name}.network.h5"
            write_network(path, packing)
        return str(path)

    def measured(
        self,
        task: Callable[..., Any],
        *,
        threads: int = 1,
        must: bool = True,
        **arguments: str | float | None,
    ) -> Measured:
        """Return the median of three runs of a task, or one run if `quick`.

        The arguments of the task and its value must be JSON. Raises InputError with the last line
        of a run that fails, unless a failure is a result, too (`must` is false).
        """
        measured = median_of(self.times, lambda: _run_task(task, threads, arguments))
        if measured.failure and must:
            raise InputError("task_failed", f"{task.__module__}:{task.__name__}", measured.failure)
        return measured

    def command(self, *words: str, threads: int | None = CORES) -> Measured:
        """Run a command of this project in the folder; a failure is part of the result."""
        log = self.folder / "command.log"
        environment = {"PYTHONPATH": str(ROOT)}
        try:
            return run_command(
                [sys.executable, "-m", *words], self.folder, log, environment, threads
            )
        except InputError as error:
            return Measured(failure=str(error))


def median_of(times: int, run: Callable[[], Measured]) -> Measured:
    """Return the medians of time and memory of `times` runs; of one if it is long or fails."""
    runs = [run()]
    while len(runs) < times and not runs[-1].failure and runs[0].seconds < MAX_REPEATED_SECONDS:
        runs.append(run())
    if runs[-1].failure:
        return runs[-1]
    seconds = statistics.median(run.seconds for run in runs)
    peak_mb = statistics.median(run.peak_mb for run in runs)
    return Measured(runs[-1].value, seconds, peak_mb)


def _limit_threads(threads: int | None) -> dict[str, str]:
    """Return this environment with a number of threads for every library; None leaves it open."""
    environment = {name: text for name, text in os.environ.items() if name not in THREADS}
    if threads is not None:
        environment |= dict.fromkeys(THREADS, str(threads))
    return environment


def _run_task(task: Callable[..., Any], threads: int, arguments: Mapping[str, Any]) -> Measured:
    """Run a task once in its own process."""
    name = f"{task.__module__}:{task.__name__}"
    try:
        process = subprocess.run(
            [sys.executable, "-m", "benchmarks.harness.measure", name, json.dumps(arguments)],
            cwd=ROOT,
            env=_limit_threads(threads),
            timeout=MAX_TASK_SECONDS,
            capture_output=True,
            text=True,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Measured(failure=f"given up after {MAX_TASK_SECONDS} s")
    if process.returncode != 0:
        error_lines = process.stderr.strip().splitlines()
        if error_lines:
            return Measured(failure=error_lines[-1])
        return Measured(failure=f"exit status {process.returncode}")
    return Measured(**json.loads(process.stdout.splitlines()[-1]))


def run_command(
    command: list[str],
    folder: Path,
    log: Path,
    environment: Mapping[str, str] | None = None,
    threads: int | None = 1,
) -> Measured:
    """Return the time and the peak memory of a command, whose output goes to `log`.

    If `threads` is None, it uses as many as it chooses. Raises InputError with the last error of
    the command if it fails.
    """
    # A program inherits the peak of the process that starts it: here that of a bare interpreter.
    launcher = [sys.executable, "-S", "-c", LAUNCHER, str(log), *command]
    process = subprocess.run(
        launcher,
        cwd=folder,
        env=_limit_threads(threads) | dict(environment or {}),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    status, elapsed, processor_time, peak = map(float, process.stdout.split())
    if status != 0:
        error_lines = [line for line in log.read_text().splitlines() if "rror" in line]
        reason = error_lines[-1] if error_lines else f"exit status {status:.0f}"
        raise InputError("command_failed", f"{Path(command[0]).name} failed", reason)
    seconds = processor_time if threads == 1 else elapsed
    bytes_per_unit = 1 if sys.platform == "darwin" else 1024
    return Measured(None, seconds, peak * bytes_per_unit / 1e6)


def main(argv: list[str]) -> int:
    """Prepare a task, run it, and print one line of JSON."""
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
