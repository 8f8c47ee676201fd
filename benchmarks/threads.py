"""Every kind of command on one thread and on those it chooses, alone and beside other programs.

Runs only when it is named: minutes on a machine that has nothing else to do but the programs that
the job itself starts, one for each core, which count for ever.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from matplotlib.figure import Figure

from benchmarks.harness import diagram
from benchmarks.harness.measure import ROOT, run_command
from benchmarks.harness.packing import SAMPLE
from benchmarks.harness.report import Page, Rows
from modal.packing.sample import read_sample, write_sample
from modal.preparation.random_packing import random_sample

TITLE = "Threads: whole commands on one and on their own choice, alone and beside other programs"
COMMANDS = {
    "wave, 0.6 ms": ("wave", "--duration", "6e-4"),
    "response to 20 kHz": ("response", "--highest", "2e4"),
    "density, 2 kHz, 0.5 %": ("density", "--resolution", "2000", "--tolerance", "0.005"),
    "moduli": ("moduli",),
    "highest mode": ("modes", "--highest", "1", "--uncertified"),
    "exact count at 20 kHz": ("count", "--at", "20000"),
    "lowest 10 modes": ("modes", "--lowest", "10"),
}
PACKED = "packed"
PACKING = ("pack", "--spheres", "2000", "--stress", "1e5", "-o", PACKED)
CORES = os.cpu_count() or 1
TIMES = 3
"""Runs of which the median counts, by turns on one thread and on those that the command chooses."""
SPIN = "while True: pass"


@contextmanager
def others(count: int) -> Iterator[None]:
    """So many programs that never rest."""
    running = [subprocess.Popen([sys.executable, "-S", "-c", SPIN]) for _ in range(count)]
    try:
        yield
    finally:
        for program in running:
            program.kill()
            program.wait()


def run(quick: bool, folder: Path) -> Page:
    """Each command by turns on one thread and on its choice, first alone, then on busy cores."""
    path = folder / "study.sample.h5"
    write_sample(path, random_sample(500) if quick else read_sample(SAMPLE))
    commands = {task: (given[0], str(path), *given[1:]) for task, given in COMMANDS.items()}
    commands["packing of 2000 spheres"] = PACKING
    rows: Rows = []

    def seconds(given: tuple[str, ...], threads: int | None) -> float:
        shutil.rmtree(folder / PACKED, ignore_errors=True)  # a packing that is there is not remade
        whole = [sys.executable, "-m", "modal", *given]
        how = {"environment": {"PYTHONPATH": str(ROOT)}, "threads": threads}
        start = time.perf_counter()
        run_command(whole, folder, folder / "command.log", **how)
        return time.perf_counter() - start

    for task, given in commands.items():
        seconds(given, None)  # compiles, and fills the cache of files
        for busy in (0, CORES):
            found: dict[int | None, list[float]] = {1: [], None: []}
            with others(busy):
                for _ in range(1 if quick else TIMES):
                    for threads, taken in found.items():
                        taken.append(seconds(given, threads))
            one, own = (statistics.median(taken) for taken in found.values())
            row = {"task": task, "others": busy, "one_thread_s": one, "own_choice_s": own}
            rows.append(row | {"times_faster": one / own})
    said = [
        f"{row['task']}, {row['others'] or 'no'} other programs: {row['times_faster']:.2f} times "
        "as fast with the threads that the command chooses as with one."
        for row in rows
    ]
    task = (
        f"Whole commands by the clock, the median of {TIMES} runs, on one thread and on as many as "
        f"the command chooses ({CORES} cores); "
        "beside `others`, as many programs that never rest. x: spheres of case 6."
    )
    return Page(TITLE, task, {"threads": rows}, said, {"threads": draw(rows)})


def draw(rows: Rows) -> Figure:
    """Seconds with the own choice over those with one thread: points below the line are faster."""
    figure, axes = diagram.panels(1, 1, width=4.6, height=3.9)
    for k, busy in enumerate(dict.fromkeys(row["others"] for row in rows)):
        own = [row for row in rows if row["others"] == busy]
        style = diagram.look(k) | {"ls": "none", "label": f"beside {busy:.0f} other programs"}
        diagram.curve(axes[0, 0], own, "one_thread_s", "own_choice_s", **style)
    ends = [min(row["own_choice_s"] for row in rows), max(row["one_thread_s"] for row in rows)]
    axes[0, 0].plot(ends, ends, color="0.5", lw=0.8)
    axes[0, 0].set(xlabel="one thread: seconds", ylabel="threads of its own choice: seconds")
    diagram.decades(axes[0, 0])
    diagram.legend_below(figure, axes[0, 0])
    return figure
