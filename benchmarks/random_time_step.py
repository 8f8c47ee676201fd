"""Time step of a wave in a random packing: leapfrog, as the DEM has it, against the exact wave.

The error of the DEM's time step is that of a linear leapfrog with the same step; it needs no DEM to
be measured, and no contact law is in the way. Single spheres of the chain carry waves up to the
highest frequencies, means over layers only the coherent ones, from which velocities are read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks import diagram
from benchmarks.modes import SAMPLE
from benchmarks.modes_scaling import resized
from benchmarks.report import Finding
from benchmarks.wave import cost, relative, step_and_records
from modal.eigenproblem import Eigenproblem
from modal.leapfrog import leapfrog
from modal.modes import highest_modes
from modal.network import write_network
from modal.random_packing import random_network
from modal.sample import read_packing
from modal.wave import propagate

TITLE = "Time step of a wave in a random packing"
SIZE = {True: (300, 5e-5), False: (9000, 2e-4)}
"""Spheres (the lower part of case 6; with --quick a packing made on the spot), duration, s."""
FRACTIONS = {True: (0.9, 0.5, 0.35, 0.2), False: (0.9, 0.7, 0.5, 0.35, 0.2, 0.1, 0.05)}
NON_LINEAR = 0.02
"""The time step needs to be below what the contact law does at the study's amplitude, not far.
Over their records YADE differs from linear by 3.4 % (case 6) and 7.5 % (case 30) in the layers'
means, contacts that slide included; in a small sample where none does by 0.4 %, single spheres by
0.9 % (`python -m benchmarks agreement`)."""
ERRORS = {
    "error": "error of single spheres (-)",
    "error_of_layers": "error of the layers' means (-)",
}


def run(quick: bool, folder: Path) -> Finding:
    """Each time step."""
    (spheres, duration), often = SIZE[quick], 1 if quick else 3
    sample = random_network(spheres, 1e5, seed=1, aspect=10.05) if quick else read_packing(SAMPLE)
    network = resized(sample, spheres)
    path = folder / "packing.network.h5"
    write_network(path, network)
    highest = highest_modes(Eigenproblem.of(network), 1, certify=False).frequency[-1]
    rows: list[dict[str, Any]] = []
    for fraction in FRACTIONS[quick]:
        step, every = step_and_records(highest, fraction)
        spent = cost("stepped", path, duration, often, time_step=step, every=every)
        found = leapfrog(network, duration, step, every=every)
        exact = propagate(network, duration, interval=step * every, tolerance=1e-10).signals
        rows.append(
            {
                "method": "leapfrog",
                "time_step_over_limit": fraction,
                "steps": round(duration / step) + 1,
                "error": relative(found.chain_displacement, exact.chain_displacement),
                "error_of_layers": relative(found.layer_displacement, exact.layer_displacement),
                "seconds": spent.seconds,
                "peak_mb": spent.peak_mb,
            }
        )
    task = (
        f"{spheres} spheres of a packing without friction at 100 kPa, pulse of 100 kHz, "
        f"{1e3 * duration:g} ms; springs only. Relative L2 errors over all times."
    )
    figure = diagram.work_precision(rows, ERRORS)
    return Finding(TITLE, task, rows, notes(rows), {"random_time_step": figure})


def largest_step(rows: list[dict[str, Any]], error: str) -> dict[str, Any] | None:
    """The largest step whose error is below the non-linear one, None if there is none."""
    enough = [row for row in rows if row[error] < NON_LINEAR]
    return max(enough, key=lambda row: row["time_step_over_limit"]) if enough else None


def notes(rows: list[dict[str, Any]]) -> list[str]:
    """The knee for single spheres, which is the default, and for layers."""
    said = []
    for error, what in (("error", "single spheres"), ("error_of_layers", "layers' means")):
        best = largest_step(rows, error)
        if best:
            said.append(
                f"Knee for {what}: {best['time_step_over_limit']:g} of the limit, the largest step "
                f"tried with an error ({best[error]:.1e}) below the {NON_LINEAR:g} that the "
                "contact law's non-linearity makes at 2A = 5 nm; smaller steps buy nothing there."
            )
    return [*said, "`cases/random.table` has 0.2 for every case."]
