"""What each digit of a sample's state costs: stop criteria of YADE, and the minimiser beside it.

A small packing is compressed to 100 kPa by the study's servo, and its void ratio, coordination
number, stresses and residual forces are written down as it settles. Every stop criterion is read
from the same run; how far the state still moves after it is its error. Without friction the
minimiser, from the same dense packing, stands beside YADE.
"""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import diagram, yade
from benchmarks.harness.report import Page, Rows
from modal.packing.sample import Sample, read_sample, write_sample
from modal.preparation.frictionless import minimise
from modal.preparation.random_packing import cloud, random_sample
from modal.preparation.relax import balance_of

TITLE = "Sample preparation: error of the state against seconds, in YADE and by the minimiser"
SPHERES = {True: 120, False: 500}
ASPECT = 2.5
"""Length over width."""
STRESS, PEAK = 1e5, 1e6
"""Pa; the second is where a packing without friction comes from."""
STEPS = {True: 3000, False: 8000}
"""Steps once the packing is jammed: the last state is what the earlier ones are compared with."""
RUNS = {
    True: ((0.1, 0.4, 1), (0.1, 0.1, 1)),
    False: (
        *((number, 0.4, 1) for number in (0.1, 0.03, 0.01, 0.003)),
        *((0.01, friction, 1) for friction in (0.2, 0.05)),
        *((0.01, 0.4, seed) for seed in (2, 3)),
    ),
}
"""Inertial number of the largest strain rate, friction, and random start of each run."""
UNBALANCED = (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
"""Stop criteria: mean residual force over mean contact force; stresses to `STRESS_ERROR` times."""
STRESS_ERROR = 3.0
END = "end of the run"
BUYS = 1.5
"""A criterion three times tighter that lowers the error by less than this buys nothing."""
BY_MINIMISER = "no friction, 1 MPa to 100 kPa by the minimiser"
BY_YADE = "no friction, the same by YADE"
ERRORS = {
    "error_e": "error of e (-)",
    "error_Z": "error of Z (-)",
    "stress_error": "stress error (-)",
}
Trace = dict[str, np.ndarray]


def loose_spheres(spheres: int, friction: float, seed: int) -> Sample:
    """Random spheres that do not touch: points pushed apart, then stretched until none overlap."""
    sample, _ = minimise(cloud(spheres, ASPECT, seed), None, tolerance=0.1, max_steps=500)
    contact = sample.contacts()
    diameter = np.where(contact.particle_j < 0, sample.radius, 2 * sample.radius)
    stretch = 1.001 / (1 - (contact.overlap / diameter).max(initial=0.0))
    places = {name: stretch * getattr(sample, name) for name in ("position", "side", "walls")}
    return replace(sample, **places, friction=friction)


def compress(
    folder: Path, start: Sample, inertial_number: float, steps: int
) -> tuple[Trace, Sample, float]:
    """How one run's state changed, by column; its end; and its peak memory, MB."""
    before, end = folder / "start.sample.h5", folder / "end.sample.h5"
    write_sample(before, start)
    setting = {"stress": STRESS, "inertial_number": inertial_number, "steps": steps}
    run = yade.measured("compress", folder, sample=str(before), output=str(end), **setting)
    trace = {name: np.array(column) for name, column in run.value.items()}
    return trace, read_sample(end), run.peak_mb


def first_met(trace: Trace, unbalanced: float) -> int | None:
    """Index at which both criteria are first met, None if they never are."""
    met = (trace["unbalanced"] < unbalanced) & (trace["stress_error"] < STRESS_ERROR * unbalanced)
    return int(np.argmax(met)) if met.any() else None


def stop_rows(trace: Trace, peak_mb: float, what: dict[str, Any]) -> Rows:
    """A row for each stop criterion that the run has met, and one for its end."""
    end = len(trace["step"]) - 1
    rows = []
    for unbalanced in (*UNBALANCED, None):
        k = end if unbalanced is None else first_met(trace, unbalanced)
        if k is None or (unbalanced and k == end):
            continue
        row = {**what, "stop_unbalanced": unbalanced or END, "steps": int(trace["step"][k])}
        row |= {name: float(trace[name][k]) for name in ("e", "Z", "stress_error", "unbalanced")}
        for name in ("e", "Z"):
            moved = abs(float(trace[name][k] / trace[name][-1] - 1))
            row[f"error_{name}"] = moved if unbalanced else None
        rows.append(row | {"seconds": float(trace["seconds"][k]), "peak_mb": peak_mb})
    return rows


def frictionless_rows(quick: bool, folder: Path) -> Rows:
    """Unloading from 1 MPa without friction: by the minimiser, and by YADE's dynamics."""
    start = random_sample(2 * SPHERES[quick], PEAK, aspect=4.0, tolerance=1e-4)
    begun = time.process_time()
    low, rest = minimise(start, STRESS, tolerance=1e-5)
    spent = time.process_time() - begun
    trace, moved, _ = compress(folder, start, 0.01, STEPS[quick])
    rows = []
    for name, sample, steps, seconds in (
        (BY_MINIMISER, low, rest.steps, spent),
        (BY_YADE, moved, int(trace["step"][-1]), float(trace["seconds"][-1])),
    ):
        network = sample.network()
        row: dict[str, Any] = {"method": name, "steps": steps, "seconds": seconds}
        row |= {"e": network.study["void_ratio"], "Z": network.study["coordination_number"]}
        rows.append(row | {"residual": balance_of(sample, network)[1].residual})
    return rows


def run(quick: bool, folder: Path) -> Page:
    """Strain rates, frictions and random starts; then the packing without friction."""
    yade.need("preparation")
    rows: Rows = []
    for number, friction, seed in RUNS[quick]:
        name = f"I = {number:g}, friction {friction:g}, start {seed}"
        what = {"method": name, "inertial_number": number, "friction": friction, "seed": seed}
        start = loose_spheres(SPHERES[quick], friction, seed)
        trace, _, peak = compress(folder, start, number, STEPS[quick])
        rows += stop_rows(trace, peak, what)
    task = (
        f"{SPHERES[quick]} spheres from a cloud without contacts straight to {STRESS / 1e3:g} kPa. "
        "Errors of e and Z are relative to the end of the same run; stresses must be met to "
        f"{STRESS_ERROR:g} times the residual. I is the inertial number of the largest strain "
        f"rate. Then {2 * SPHERES[quick]} spheres without friction from {PEAK / 1e6:g} MPa; "
        "`residual` is the mean net force over the mean contact force."
    )
    figures = {"preparation": diagram.work_precision(rows, ERRORS, ["seconds"])}
    rows += frictionless_rows(quick, folder)
    return Page(TITLE, task, {"preparation": rows}, notes(rows), figures)


def stops(rows: Rows) -> dict[float, Rows]:
    """Rows of each stop criterion, from the loosest on."""
    known = [row for row in rows if row.get("error_e") is not None]
    criteria = sorted({row["stop_unbalanced"] for row in known}, reverse=True)
    return {c: [row for row in known if row["stop_unbalanced"] == c] for c in criteria}


def knee(rows: Rows) -> float:
    """The loosest criterion after which the next one hardly lowers the error of e.

    The error is the largest of all runs; only criteria that as many runs as ever have met count.
    """
    met = stops(rows)
    most = max(map(len, met.values()))
    error = {c: max(row["error_e"] for row in own) for c, own in met.items() if len(own) == most}
    for loose, tight in pairwise(error):
        if error[loose] < BUYS * error[tight]:
            return loose
    return min(error)


def notes(rows: Rows) -> list[str]:
    """What each criterion leaves of the error, and the minimiser against YADE."""
    low, moved = ([r for r in rows if r["method"] == name] for name in (BY_MINIMISER, BY_YADE))
    unloaded = [
        f"No friction: e {b['e']:.5f} by YADE in {b['seconds']:.3g} s, {a['e']:.5f} by the "
        f"minimiser in {a['seconds']:.3g} s; Z {b['Z']:.3f} and {a['Z']:.3f}; residuals "
        f"{b['residual']:.0e} and {a['residual']:.0e}."
        for a, b in zip(low, moved, strict=True)
    ]
    runs = len({row["method"] for row in rows if row.get("stop_unbalanced") == END})
    return [
        f"Residual {criterion:g}: met by {len(own)} of {runs} runs; e then moves by at most "
        f"{max(row['error_e'] for row in own):.1e}, Z by {max(row['error_Z'] for row in own):.1e}; "
        f"{np.mean([row['seconds'] for row in own]):.3g} s a run."
        for criterion, own in stops(rows).items()
    ] + unloaded
