"""What each digit of a sample's state costs in YADE: strain rate, stop criterion, friction.

A small packing is compressed to 100 kPa by the study's servo, and its void ratio, coordination
number, stresses and residual forces are written down as it settles. Every stop criterion is read
from the same run; how far the state still moves after it is its error. How far the state depends on
the strain rate, and on the random start, is measured by runs of their own.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks import diagram, yade_job
from benchmarks.report import Finding
from modal.minimiser import minimise
from modal.random_packing import cloud
from modal.sample import Sample, write_sample
from modal.storage import InputError

TITLE = "Sample preparation in YADE: error of the state against steps"
SPHERES = {True: 120, False: 500}
STEPS = {True: 3000, False: 8000}
"""Steps once the packing is jammed: the last state is what the earlier ones are compared with."""
INERTIAL_NUMBERS = {True: (0.1,), False: (0.1, 0.03, 0.01, 0.003)}
FRICTIONS = {True: (0.4, 0.1), False: (0.4, 0.2, 0.05)}
SEEDS = {True: (1,), False: (1, 2, 3)}
RATE = {True: 0.1, False: 0.01}
"""Inertial number of the sweeps over something else."""
STRESS = 1e5
ASPECT = 2.5
UNBALANCED = (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
"""Stop criteria: mean residual force over mean contact force; stresses to three times that."""
ERRORS = {
    "error_e": "error of e (-)",
    "error_Z": "error of Z (-)",
    "stress_error": "stress error (-)",
}


def loose_spheres(spheres: int, friction: float, seed: int) -> Sample:
    """Random spheres that do not touch: points pushed apart, then stretched until none overlap."""
    sample, _ = minimise(cloud(spheres, ASPECT, seed), None, tolerance=0.1, max_steps=500)
    contact = sample.contacts()
    diameter = np.where(contact.particle_j < 0, sample.radius, 2 * sample.radius)
    stretch = 1.001 / (1 - (contact.overlap / diameter).max(initial=0.0))
    return replace(
        sample,
        position=stretch * sample.position,
        side=stretch * sample.side,
        walls=stretch * sample.walls,
        friction=friction,
    )


def compress(
    folder: Path, spheres: int, friction: float, inertial_number: float, steps: int, seed: int
) -> tuple[dict[str, np.ndarray], float]:
    """How one run's state changed, by column, and its peak memory, MB."""
    write_sample(folder / "cloud.sample.h5", loose_spheres(spheres, friction, seed))
    run = yade_job.measured(
        "compress",
        folder,
        sample=str(folder / "cloud.sample.h5"),
        output=str(folder / "compressed.sample.h5"),
        stress=STRESS,
        inertial_number=inertial_number,
        steps=steps,
    )
    if run.failure:
        raise InputError(run.failure)
    return {name: np.array(column) for name, column in run.value.items()}, run.peak_mb


def first_met(trace: dict[str, np.ndarray], unbalanced: float) -> int | None:
    """Index at which both criteria are first met, None if they never are."""
    met = (trace["unbalanced"] < unbalanced) & (trace["stress_error"] < 3 * unbalanced)
    return int(np.argmax(met)) if met.any() else None


def stop_rows(
    trace: dict[str, np.ndarray], peak_mb: float, what: dict[str, Any]
) -> list[dict[str, Any]]:
    """A row for each stop criterion that the run has met, and one for its end."""
    rows = []
    for unbalanced in (*UNBALANCED, None):
        k = len(trace["step"]) - 1 if unbalanced is None else first_met(trace, unbalanced)
        if k is None or (unbalanced and k == len(trace["step"]) - 1):
            continue
        last = {name: column[-1] for name, column in trace.items()}
        rows.append(
            {
                **what,
                "stop_unbalanced": unbalanced if unbalanced else "end of the run",
                "steps": int(trace["step"][k]),
                "e": float(trace["e"][k]),
                "Z": float(trace["Z"][k]),
                "stress_error": float(trace["stress_error"][k]),
                "unbalanced": float(trace["unbalanced"][k]),
                "error_e": abs(float(trace["e"][k] / last["e"] - 1)) if unbalanced else None,
                "error_Z": abs(float(trace["Z"][k] / last["Z"] - 1)) if unbalanced else None,
                "seconds": float(trace["seconds"][k]),
                "peak_mb": peak_mb,
            }
        )
    return rows


def run(quick: bool, folder: Path) -> Finding:
    """Strain rates, frictions and random starts."""
    if not yade_job.available():
        raise InputError("preparation: YADE is not installed; apt-get install yade")
    rate, first = RATE[quick], FRICTIONS[quick][0]
    cases = [(number, first, 1) for number in INERTIAL_NUMBERS[quick]]
    cases += [(rate, friction, 1) for friction in FRICTIONS[quick][1:]]
    cases += [(rate, first, seed) for seed in SEEDS[quick][1:]]
    rows, traces = [], {}
    for number, friction, seed in cases:
        trace, peak = compress(folder, SPHERES[quick], friction, number, STEPS[quick], seed)
        name = f"I = {number:g}, friction {friction:g}" + f", start {seed}" * (seed > 1)
        traces[name] = trace
        what = {"method": name, "inertial_number": number, "friction": friction, "seed": seed}
        rows += stop_rows(trace, peak, what)
    task = (
        f"{SPHERES[quick]} spheres from a cloud without contacts to {STRESS / 1e3:g} kPa. "
        "Errors of e and Z are relative to the end of the same run; stresses must be met to three "
        "times the residual. I is the inertial number of the largest strain rate."
    )
    figures = {"preparation": diagram.work_precision(rows, ERRORS), "settling": settling(traces)}
    return Finding(TITLE, task, rows, notes(rows), figures)


def settling(traces: dict[str, dict[str, np.ndarray]]) -> Figure:
    """State against steps of every run."""
    figure, axes = diagram.panels(2, 2, width=3.6)
    labels = {
        "e": "void ratio e (-)",
        "Z": "contacts a sphere Z (-)",
        "stress_error": "stress error (-)",
        "unbalanced": "residual over contact force (-)",
    }
    for ax, (name, label) in zip(axes.ravel(), labels.items(), strict=True):
        for k, (method, trace) in enumerate(traces.items()):
            style = diagram.look(k) | {"marker": None}
            ax.plot(trace["step"] / 1e3, trace[name], label=method, **style)
        ax.set(xlabel="steps (thousands)", ylabel=label)
        if name in ("stress_error", "unbalanced"):
            ax.set_yscale("log")
    diagram.legend_below(figure, axes[0, 0], len(traces))
    return figure


def notes(rows: list[dict[str, Any]]) -> list[str]:
    """Cost of the digits, and what rate and random start change."""
    ends = [row for row in rows if row["stop_unbalanced"] == "end of the run"]
    said = []
    for end in ends:
        own = [row for row in rows if row["method"] == end["method"] and row is not end]
        digits = []
        for digit in (1e-2, 1e-3, 1e-4, 1e-5):
            within = [row for row in own if row["error_e"] < digit]
            if within:
                digits.append(f"{digit:g} after {within[0]['seconds']:.3g} s")
        reached = min((row["stop_unbalanced"] for row in own), default=None)
        said.append(
            f"{end['method']}: e = {end['e']:.4f}, Z = {end['Z']:.2f}; error of e below "
            + (", ".join(digits) or "1e-2 never")
            + f"; tightest residual met {reached:g}."
            if reached
            else f"{end['method']}: no stop criterion was met in {end['steps']} steps."
        )
    first = ends[0]["friction"]
    rates = [row for row in ends if row["friction"] == first and row["seed"] == 1]
    if len(rates) > 1:
        spread = ", ".join(f"{row['e']:.4f} at I = {row['inertial_number']:g}" for row in rates)
        said.append(f"Strain rate, friction {first:g}: e = {spread}.")
    starts = [row for row in ends if row["friction"] == first]
    starts = [row for row in starts if row["inertial_number"] == starts[-1]["inertial_number"]]
    if len(starts) > 1:
        values = np.array([row["e"] for row in starts])
        said.append(
            f"{len(values)} random starts at I = {starts[0]['inertial_number']:g}: e scatters by "
            f"{values.std(ddof=1):.4f}. Digits below that belong to one packing of this size, not "
            "to the protocol: the floor of a small sample."
        )
    return said
