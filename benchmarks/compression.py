"""A study's packing from cloud to states at rest, at full size: whole commands, and single steps.

Runs only when it is named: minutes on cores that have nothing else to do. A step is timed on the
dense sample of case 6, whose spheres rest, so that no list of neighbours is renewed; with these,
and with agitated spheres, the walk notes its own steps and seconds, stage by stage.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from benchmarks.harness import diagram
from benchmarks.harness.measure import ROOT, measured, run_command
from benchmarks.harness.packing import SAMPLE, STRESS
from benchmarks.harness.report import Page, Rows
from modal.dem.motion import Dynamics
from modal.packing.sample import read_sample, write_sample
from modal.preparation import protocol
from modal.preparation.durations import duration, steps_of, time_step
from modal.preparation.random_packing import random_sample
from modal.preparation.strain_control import INERTIAL_NUMBER, Servo
from modal.tools.errors import InputError

TITLE = "Compression: from a cloud to states at rest"
SPHERES, WIDTH = {True: 300, False: 35_201}, {True: 5.0, False: 14.65}
"""The second in diameters, of the packing with friction."""
STRESSES = {True: ("1e4", "1e5"), False: ("1e3", "1e4", "1e5", "1e6", "1e7")}
"""Pa; the study's walk."""
STEPS = {True: 50, False: 500}
"""Steps that are timed together."""
FRICTION, RESERVE = 0.4, 0.1
"""Of the walk, and by how much that of the wave is larger."""
CORES = os.cpu_count() or 1
STEP = "a step, spheres at rest"


def steps(path: str, count: int) -> Callable[[], int]:
    """Task: steps under the servo at 100 kPa; the number of contacts."""
    motion = Dynamics(read_sample(path), protocol.DAMPING)
    control = Servo(STRESS, INERTIAL_NUMBER)
    dt = time_step(STRESS)
    every = steps_of(duration(protocol.CONTROL, STRESS), dt)
    motion.control = control.follow
    motion.advance(2 * every, dt, every)  # compiles

    def action() -> int:
        motion.advance(count, dt, every)
        return motion.contacts.touching

    return action


def step_rows(path: Path, quick: bool) -> Iterator[dict[str, Any]]:
    """The step on one thread and on all."""
    for threads in sorted({1, CORES}):
        how = {"times": 3, "threads": threads, "path": str(path), "count": STEPS[quick]}
        run = measured("benchmarks.compression:steps", **how)
        row = {"task": STEP, "threads": threads, "contacts": run.value, "steps": STEPS[quick]}
        yield row | run.cost | {"ms_a_step": 1e3 * run.seconds / STEPS[quick]}


def stage_rows(state: Path) -> Iterator[dict[str, Any]]:
    """What each stage of a walk has noted in its last state."""
    study = read_sample(state).study
    first = ["cloud", *protocol.PREPARATION]
    names = [name for name in first if f"steps_{name}" in study]
    found = {name.removeprefix("steps_") for name in study if name.startswith("steps_")}
    for name in [*names, *sorted(found - set(names), key=float)]:
        count, seconds, contacts = (study[f"{k}_{name}"] for k in ("steps", "seconds", "contacts"))
        row = {"task": f"stage {name}", "threads": CORES, "contacts": contacts, "steps": count}
        yield row | {"seconds": seconds, "ms_a_step": 1e3 * seconds / count}


def run(quick: bool, folder: Path) -> Page:
    """Steps, then the walks with and without friction, then the rest of a state of each."""
    start = folder / "start.sample.h5"
    write_sample(start, random_sample(500) if quick else read_sample(SAMPLE))
    rows: Rows = list(step_rows(start, quick))
    size = ["--spheres", str(SPHERES[quick])]

    def add(task: str, *arguments: str) -> None:
        command = [sys.executable, "-m", "modal", *arguments]
        how = {"environment": {"PYTHONPATH": str(ROOT)}, "threads": CORES}
        row: dict[str, Any] = {"task": task, "threads": CORES}
        try:
            rows.append(row | run_command(command, folder, folder / "command.log", **how).cost)
        except InputError as error:  # a state that does not come to rest is a result
            rows.append(row | {"failure": str(error)})

    walk = ["pack", *size, "--friction", f"{FRICTION:g}", "--width", f"{WIDTH[quick]:g}"]
    stresses = STRESSES[quick]
    name = f"friction {FRICTION:g}, cloud to {float(stresses[-1]) / 1e6:g} MPa"
    add(name, *walk, "--stress", *stresses, "-o", "rough")
    rows += stage_rows(folder / "rough" / f"{float(stresses[-1]):g}Pa.sample.h5")
    smooth = ["pack", *size, *(("--aspect", "2") if quick else ()), "--stress", "1e5"]
    add("friction 0, cloud to 0.1 MPa", *smooth, "-o", "smooth")
    for state, friction in (
        ("rough/100000Pa.sample.h5", FRICTION + RESERVE),
        ("smooth/01_100kPa.sample.h5", RESERVE),
    ):
        rest = ["relax", state, "--friction", f"{friction:g}", "-o", "rested.sample.h5"]
        add(f"rest at 0.1 MPa with friction {friction:g}", *rest)
    task = (
        f"{SPHERES[quick]} spheres. Seconds of one thread are processor time, of several the time "
        "by the clock. Whole commands start the interpreter; their stages are what the walk notes."
    )
    return Page(TITLE, task, {"compression": rows}, notes(rows), {"compression": draw(rows)})


def draw(rows: Rows) -> Figure:
    """Seconds of the whole commands, dark, and of the stages of the walk, with their steps."""
    figure, axes = diagram.panels(1, 1, width=6.4, height=0.26 * len(rows))
    ax, shown = axes[0, 0], [row for row in rows if row["task"] != STEP]
    for place, row in enumerate(shown):
        step = row.get("ms_a_step")
        grey = "0.75" if step else "0.3"
        ax.barh(place, row["seconds"], color=grey, edgecolor="k", lw=0.6)
        said = f"{row['seconds']:.3g} s" + (f", {step:.2g} ms a step" if step else "")
        ax.text(row["seconds"], place, f" {said}", va="center", fontsize=7)
    ax.set_yticks(range(len(shown)), [_label(row["task"]) for row in shown])
    ax.invert_yaxis()
    ax.margins(x=0.25)
    ax.set(xlabel="time by the clock (s)")
    return figure


def _label(task: str) -> str:
    """Name of a row in the figure; the stages of a walk that are stresses end with their unit."""
    stage = task.removeprefix("stage ")
    if stage == task:
        return task
    return f"to {float(stage) / 1e3:g} kPa" if stage[0].isdigit() else stage


def notes(rows: Rows) -> list[str]:
    """Each step by its contacts, and each command with its memory."""
    return [
        f"{row['task']}, {row['contacts']:.0f} contacts, {row['threads']:.0f} threads: "
        f"{row['ms_a_step']:.3g} ms."
        if row["task"] == STEP
        else f"{row['task']}: {row['seconds']:.3g} s, {row['peak_mb']:.3g} MB."
        for row in rows
        if row.get("peak_mb")
    ]
