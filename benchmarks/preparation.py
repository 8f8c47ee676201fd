"""What each digit of a sample's state costs: stop criteria of the motion.

A small packing is compressed to 100 kPa by the study's servo, and its void ratio, coordination
number, stresses and residual forces are written down as it settles. Every stop criterion is read
from the same run; how far the state still moves after it is its error. The motion is modal's own,
whose steps are YADE's (`tests/preparation/test_dynamics.py`).
"""

import time
from collections.abc import Callable
from itertools import takewhile
from typing import Any

import numpy as np

from benchmarks.harness import diagram
from benchmarks.harness.measure import Job
from benchmarks.harness.report import Page, Rows
from modal.dem.motion import Dynamics
from modal.packing.sample import read_sample
from modal.packing.state import void_ratio
from modal.preparation import protocol
from modal.preparation.cloud import make_cloud
from modal.preparation.durations import count_steps, time_step, vibration_duration
from modal.preparation.random_packing import width_of
from modal.preparation.strain_control import Servo

TITLE = "Sample preparation: error of the state against seconds"
SPHERES = {True: 120, False: 500}
ASPECT = 1.5
"""Length over width."""
STRESS = 1e5
"""Pa."""
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
DIGIT = 5e-4
"""Half of the last digit to which the paper states void ratios."""
CHECK = 50
"""Steps between two looks."""
LONGEST = 100_000
"""Steps after which a packing that does not jam is given up."""
JAMMED, JAM_ERROR = 3.7, 0.1
"""Coordination number and relative stress error from which the packing counts as jammed."""
JAM_PATIENCE = 3000
"""Steps after the stress was first met at which damping sets in although spheres still move."""
ERRORS = {
    "error_e": "error of e (-)",
    "error_Z": "error of Z (-)",
    "stress_error": "stress error (-)",
}
COLUMNS = ("steps", "seconds", "e", "Z", "stress_error", "unbalanced")
Trace = dict[str, Any]
"""How a run's state changed, by column."""


def servo(path: str, inertial_number: float, steps: int) -> Callable[[], Trace]:
    """Task: spheres driven to the stress, hardly damped until they jam; how their state changes.

    `yade_scripts/compress.py` for a single stress, without its rest at constant volume; ends
    `steps` after jamming.
    """
    sample = read_sample(path)
    Dynamics(sample).step(1e-12)  # compiles

    def action() -> Trace:
        control, started = Servo(STRESS, inertial_number), time.process_time()
        motion = Dynamics(sample, protocol.AGITATED_DAMPING, control=control.follow)
        trace: Trace = {name: [] for name in COLUMNS}
        interval = vibration_duration(protocol.CONTROL_INTERVAL, STRESS)
        every = count_steps(interval, time_step(STRESS))
        met = jammed = 0
        while motion.steps < LONGEST and not (jammed and motion.steps - jammed >= steps):
            above = protocol.STRESS_MARGIN * control.stress.mean()
            motion.advance(CHECK, time_step(max(STRESS, above)), every)
            if not met and control.stress.mean() > STRESS:
                met = motion.steps
            network, error = motion.contacts.sample().network(), control.error()
            held = network.coordination_number
            settled = error < JAM_ERROR and held > JAMMED
            if not jammed and met and (settled or motion.steps - met >= JAM_PATIENCE):
                jammed, motion.damping = motion.steps, protocol.LOCAL_DAMPING
            spent = time.process_time() - started
            state = motion.steps, spent, void_ratio(network), held, error, motion.unbalanced()
            for column, number in zip(trace.values(), state, strict=True):
                column.append(float(number))
        return trace

    return action


def stop_rows(trace: Trace, what: dict[str, Any]) -> Rows:
    """A row for each stop criterion that the run has met before its end, and one for that."""
    end, stops = len(trace["steps"]) - 1, dict[float | str, int]()
    for residual in UNBALANCED:
        balanced = trace["unbalanced"] < residual
        met = balanced & (trace["stress_error"] < STRESS_ERROR * residual)
        if met[:end].any():
            stops[residual] = int(np.argmax(met))
    rows = []
    for stop, k in (stops | {END: end}).items():
        state = {name: float(column[k]) for name, column in trace.items()}
        state["steps"] = int(state["steps"])
        errors = {
            f"error_{name}": abs(state[name] / trace[name][-1] - 1) if k < end else None
            for name in ("e", "Z")
        }
        rows.append({**what, "stop_unbalanced": stop, **state, **errors})
    return rows


def run(job: Job) -> Page:
    """Strain rates, frictions and random starts; then the packing without friction."""
    spheres, rows = SPHERES[job.quick], list[dict[str, Any]]()
    for number, friction, seed in RUNS[job.quick]:
        name = f"I = {number:g}, friction {friction:g}, start {seed}"
        what = {"method": name, "inertial_number": number, "friction": friction, "seed": seed}
        start = make_cloud(protocol.Study(friction, spheres, width_of(spheres, ASPECT), seed))
        given = {"path": job.write(start, "start"), "steps": STEPS[job.quick]}
        trace = job.measured(servo, inertial_number=number, **given).value
        rows += stop_rows({key: np.array(column) for key, column in trace.items()}, what)
    task = (
        f"{spheres} spheres from a cloud without contacts straight to {STRESS / 1e3:g} kPa. "
        "Errors of e and Z are relative to the end of the same run; stresses must be met to "
        f"{STRESS_ERROR:g} times the residual. I is the inertial number of the largest strain "
        "rate. `unbalanced` is the mean net force over the mean contact force."
    )
    figures = {"preparation": diagram.work_precision(rows, ERRORS, ["seconds"])}
    return Page(TITLE, task, {"preparation": rows}, notes(rows), figures)


def stops(rows: Rows) -> dict[float, Rows]:
    """Rows of each stop criterion, from the loosest on."""
    known = [row for row in rows if row.get("error_e") is not None]
    criteria = sorted({row["stop_unbalanced"] for row in known}, reverse=True)
    return {c: [row for row in known if row["stop_unbalanced"] == c] for c in criteria}


def knee(rows: Rows) -> float:
    """The loosest criterion from which on every run keeps e to `DIGIT`; else the tightest.

    Only criteria that as many runs as ever have met count.
    """
    met = stops(rows)
    most = max(map(len, met.values()))
    full = sorted(criterion for criterion, own in met.items() if len(own) == most)
    good = takewhile(lambda c: all(row["error_e"] * row["e"] <= DIGIT for row in met[c]), full)
    return max(good, default=full[0])


def notes(rows: Rows) -> list[str]:
    """What each criterion leaves of the error."""
    runs = sum(row.get("stop_unbalanced") == END for row in rows)
    return [
        f"Residual {criterion:g}: met by {len(own)} of {runs} runs; e then moves by at most "
        f"{max(row['error_e'] for row in own):.1e}, Z by {max(row['error_Z'] for row in own):.1e}; "
        f"{np.mean([row['seconds'] for row in own]):.3g} s a run."
        for criterion, own in stops(rows).items()
    ]
