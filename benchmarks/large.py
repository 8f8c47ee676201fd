"""Whole commands on all cores by the clock, for samples of up to ten million spheres.

Runs only when it is named: the sample of case 6, then repeated sideways. The machine must have
nothing else to do; ten million spheres need 16 GB.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from benchmarks.harness import diagram
from benchmarks.harness.measure import ROOT, run_command
from benchmarks.harness.packing import SAMPLE, STRESS
from benchmarks.harness.report import Page, Rows
from modal.packing.sample import read_sample, sample_of_network, write_sample
from modal.preparation.random_packing import random_network
from modal.tools.errors import InputError

TITLE = "Whole commands on all cores, and large samples"
WAVE = "wave, 0.6 ms"
COMMANDS = {
    "exact count at 20 kHz": ("count", "--at", "20000"),
    "density, 2 kHz, 0.5 %": ("density", "--resolution", "2000", "--tolerance", "0.005"),
    "lowest 100 modes": ("modes", "--lowest", "100"),
    "all modes below 20 kHz": ("modes", "--below", "20000"),
    WAVE: ("wave", "--duration", "6e-4", "--whole"),
}
COPIES = {True: ((2, 1),), False: ((2, 2), (7, 4), (17, 17))}
"""Repetitions of the sample along x and y."""


def run(quick: bool, folder: Path) -> Page:
    """Every command on the sample, and the wave of ever larger ones."""
    small = sample_of_network(random_network(500, STRESS, seed=1), 0.1) if quick else None
    sample = small or read_sample(SAMPLE)
    n, path, wide = len(sample.position), folder / "study.sample.h5", folder / "wide.sample.h5"
    write_sample(path, sample)
    rows: Rows = []

    def add(task: str, spheres: int, command: str, *arguments: str) -> None:
        whole = [sys.executable, "-m", "modal", command, *arguments]
        row = {"task": task, "spheres": spheres, "seconds": None, "peak_mb": None}
        how = {"environment": {"PYTHONPATH": str(ROOT)}, "threads": os.cpu_count() or 1}
        try:
            rows.append(row | run_command(whole, folder, folder / "command.log", **how).cost)
        except InputError as error:  # a sample that does not fit into memory is a result
            rows.append(row | {"failure": str(error)})

    for task, (command, *given) in COMMANDS.items():
        add(task, n, command, str(path), *given)
    for x, y in COPIES[quick]:
        spheres, repeated = n * x * y, ("--repeat", str(x), str(y), "-o", str(wide))
        add(f"repeat {x} x {y} times", spheres, "tile", str(path), *repeated)
        command, *given = COMMANDS[WAVE]
        add(WAVE, spheres, command, str(wide), *given)
    curve = [row | {"x": row["spheres"]} for row in rows if row["task"] == WAVE]
    figure, axes = diagram.panels(1, 1, width=4.6, height=3.9)
    diagram.curve(axes[0, 0], curve, "x", "seconds", **diagram.look(0))
    axes[0, 0].set(xlabel="number of spheres", ylabel=f"{WAVE}: seconds")
    diagram.decades(axes[0, 0])
    slope = diagram.exponent(curve, "seconds")
    said = [] if slope is None else [f"The wave's seconds grow as n^{slope:.2f}."]
    return Page(TITLE, "Start of the command included.", {"large": rows}, said, {"large": figure})
