"""Whole questions by the clock: what a person types, and how long the answer takes on all cores.

Runs only when it is named, on a machine that has nothing else to do. The packing is the sample of
case 6, 35,201 spheres; a slender one is made by the question before it is asked of. The last rows
repeat the sample sideways, up to ten million spheres, which need 16 GB.
"""

from __future__ import annotations

import os
import shutil
import statistics
import sys
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from benchmarks.harness import diagram
from benchmarks.harness.measure import LONG_RUN, ROOT, Measured, run_command
from benchmarks.harness.packing import SAMPLE, STRESS
from benchmarks.harness.report import Page, Rows
from modal.packing.sample import read_sample, sample_of_network, write_sample
from modal.preparation.random_packing import random_network
from modal.tools.errors import InputError

TITLE = "Whole questions: seconds and memory from the command to the answer"
SMALL, PACKING, MADE, WIDE = (f"{name}.sample.h5" for name in ("small", "packing", "made", "wide"))
"""Files that the questions are asked of, in the folder in which they are asked."""
TIMES = 3
"""Runs of which the median counts, of answers that take less than `LONG_RUN`."""
COPIES = ((2, 2), (7, 4), (17, 17))
"""Repetitions of the sample along x and y."""


class Question(NamedTuple):
    """What is asked: its command, and the seconds in which the answer should be there, if stated.

    A command that makes a packing writes to the folder `made`.
    """

    text: str
    command: str
    goal: float | None = None


QUESTIONS = (
    Question("what is in a small packing", f"modal info {SMALL}", 0.35),
    Question("V_P, V_S, f_low-pass", f"analysis measure {PACKING} --quick", 15),
    Question("all quantities", f"analysis measure {PACKING}", 50),
    Question("V_P and V_S by the moduli", f"modal moduli {PACKING}"),
    Question("the wave from wall to wall", f"modal wave {PACKING} --duration 6e-4"),
    Question("what passes up to 20 kHz", f"modal response {PACKING} --highest 2e4"),
    Question("density of states", f"modal density {PACKING} --tolerance 0.005"),
    Question("how many modes lie below 20 kHz", f"modal count {PACKING} --at 2e4"),
    Question("the lowest 100 modes", f"modal modes {PACKING} --lowest 100"),
    Question(
        "a slender packing", "modal pack --spheres 8800 --aspect 20.4 --stress 1e5 -o made", 60
    ),
    Question("its modes below 30 kHz", f"modal modes {MADE} --below 3e4", 60),
    *(
        question
        for x, y in COPIES
        for question in (
            Question(
                f"repeated {x} x {y} times", f"modal tile {PACKING} --repeat {x} {y} -o {WIDE}"
            ),
            Question(f"the wave, {x} x {y} times", f"modal wave {WIDE} --duration 6e-4 --whole"),
        )
    ),
)


def run(quick: bool, folder: Path) -> Page:
    """Ask every question; with `quick` of small samples, to see that all are answered."""
    small = sample_of_network(random_network(500, STRESS, seed=1), 0.1)
    write_sample(folder / SMALL, small)
    write_sample(folder / PACKING, small if quick else read_sample(SAMPLE))
    rows: Rows = []
    for question in QUESTIONS[: -2 * len(COPIES) if quick else None]:
        command = question.command.replace("8800", "1000") if quick else question.command
        row = {"question": question.text, "goal_s": question.goal}
        rows.append(row | answered(command.split(), folder))
        for state in sorted((folder / "made").glob("*.sample.h5")):  # the last is the one asked for
            state.replace(folder / MADE)
    task = "Seconds by the clock on all cores, the start of the command included."
    return Page(TITLE, task, {"questions": rows}, met(rows), {"questions": draw(rows)})


def answered(command: list[str], folder: Path) -> dict[str, float | str | None]:
    """Seconds by the clock and peak memory, MB, of one command; or why there is no answer."""
    how = {"environment": {"PYTHONPATH": str(ROOT)}, "threads": os.cpu_count() or 1}
    found: list[Measured] = []
    try:
        while len(found) < TIMES and not (found and found[0].seconds > LONG_RUN):
            shutil.rmtree(folder / "made", ignore_errors=True)
            log = folder / "command.log"
            found.append(run_command([sys.executable, "-m", *command], folder, log, **how))
    except InputError as error:  # a sample that does not fit into memory is a result
        return {"seconds": None, "peak_mb": None, "failure": str(error)}
    seconds = statistics.median(one.seconds for one in found)
    return {"seconds": seconds, "peak_mb": max(one.peak_mb for one in found)}


def met(rows: Rows) -> list[str]:
    """How far each answer is from the time that was aimed at, in words."""
    return [
        f"{row['question']}: {row['seconds']:.3g} s, {row['seconds'] / row['goal_s']:.2g} times "
        f"the {row['goal_s']:g} s aimed at."
        for row in rows
        if row["goal_s"] and row["seconds"]
    ]


def draw(rows: Rows) -> Figure:
    """Seconds of each answer, and those that were aimed at."""
    figure, axes = diagram.panels(1, 1, width=6.5, height=4.5)
    ax, shown = axes[0, 0], [row for row in rows if row["seconds"]][::-1]
    places = range(len(shown))
    ax.barh(places, [row["seconds"] for row in shown], color="0.7", label="measured")
    ax.set_yticks(places, [row["question"] for row in shown])
    goals = [row["goal_s"] for row in shown]
    ax.plot(goals, places, "k|", markersize=14, label="aimed at")
    ax.set(xscale="log", xlabel="seconds")
    diagram.legend_below(figure, ax)
    return figure
