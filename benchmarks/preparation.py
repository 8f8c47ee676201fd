"""Cost of each digit of a sample's state: stop criteria of its preparation.

A small packing is compressed to 100 kPa by the study's servo, and its void ratio, coordination
number, stresses and residual forces are written down as it settles. Every stop criterion is read
from the same run; how far the state still moves after it is its error. The motion is modal's own,
whose steps are YADE's (`tests/preparation/test_same_steps.py`).
"""

import time
from collections.abc import Callable
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
from modal.preparation.study import AGITATED_DAMPING, LOCAL_DAMPING, Study

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
CHECK_STEPS = 50
"""Steps between two rows of a trace."""
MAX_STEPS = 100_000
"""Steps after which a packing that does not jam is given up."""
JAMMED_COORDINATION = 3.7
"""Coordination number from which a packing counts as jammed."""
JAMMED_STRESS_ERROR = 0.1
"""Relative stress error below which a packing counts as jammed."""
JAM_PATIENCE = 3000
"""Steps after the stress was first met at which damping sets in although spheres still move."""
ERRORS = {
    "error_e": "error of e (-)",
    "error_Z": "error of Z (-)",
    "stress_error": "stress error (-)",
}
COLUMNS = ("steps", "seconds", "e", "Z", "stress_error", "unbalanced")
Trace = dict[str, Any]
"""States of a run, by column."""


def servo(path: str, inertial_number: float, steps: int) -> Callable[[], Trace]:
    """Prepare the task of compressing spheres to the stress; it returns the trace of their state.

    The spheres are hardly damped until they jam. The path is that of `yade_scripts/compress.py` for
    a single stress, without its rest at constant volume, and ends `steps` after jamming.
    """
    sample = read_sample(path)
    Dynamics(sample).step(1e-12)  # compiles

    def action() -> Trace:
        started = time.process_time()
        control = Servo(STRESS, inertial_number)
        motion = Dynamics(sample, AGITATED_DAMPING, control=control.follow)
        trace: Trace = {name: [] for name in COLUMNS}
        interval = vibration_duration(protocol.CONTROL_INTERVAL, STRESS)
        every = count_steps(interval, time_step(STRESS))
        loaded_step = 0
        jammed_step = 0
        while motion.steps < MAX_STEPS:
            if jammed_step and motion.steps - jammed_step >= steps:
                break
            stress = max(STRESS, protocol.STRESS_MARGIN * control.stress.mean())
            motion.advance(CHECK_STEPS, time_step(stress), every)
            if not loaded_step and control.stress.mean() > STRESS:
                loaded_step = motion.steps
            network = motion.contacts.sample().network()
            stress_error = control.error()
            coordination = network.coordination_number
            is_jammed = stress_error < JAMMED_STRESS_ERROR and coordination > JAMMED_COORDINATION
            is_late = motion.steps - loaded_step >= JAM_PATIENCE
            if not jammed_step and loaded_step and (is_jammed or is_late):
                jammed_step = motion.steps
                motion.damping = LOCAL_DAMPING
            trace["steps"].append(float(motion.steps))
            trace["seconds"].append(time.process_time() - started)
            trace["e"].append(float(void_ratio(network)))
            trace["Z"].append(float(coordination))
            trace["stress_error"].append(float(stress_error))
            trace["unbalanced"].append(float(motion.unbalanced()))
        return trace

    return action


def stop_rows(trace: Trace, run_columns: dict[str, Any]) -> Rows:
    """Return a row for each stop criterion that a run has met before its end, and one for the end.

    `run_columns` are the columns that describe the run.
    """
    end = len(trace["steps"]) - 1
    stops: dict[float | str, int] = {}
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
        rows.append({**run_columns, "stop_unbalanced": stop, **state, **errors})
    return rows


def run(job: Job) -> Page:
    """Compress packings at several strain rates, frictions and random starts."""
    spheres = SPHERES[job.quick]
    rows: Rows = []
    for number, friction, seed in RUNS[job.quick]:
        name = f"I = {number:g}, friction {friction:g}, start {seed}"
        columns = {"method": name, "inertial_number": number, "friction": friction, "seed": seed}
        start = make_cloud(Study(friction, spheres, width_of(spheres, ASPECT), seed))
        path = job.write(start, "start")
        steps = STEPS[job.quick]
        trace = job.measured(servo, path=path, inertial_number=number, steps=steps).value
        rows += stop_rows({key: np.array(column) for key, column in trace.items()}, columns)
    task = (
        f"{spheres} spheres from a cloud without contacts straight to {STRESS / 1e3:g} kPa. "
        "Errors of e and Z are relative to the end of the same run; stresses must be met to "
        f"{STRESS_ERROR:g} times the residual. I is the inertial number of the largest strain "
        "rate. `unbalanced` is the mean net force over the mean contact force."
    )
    figures = {"preparation": diagram.work_precision(rows, ERRORS, ["seconds"])}
    return Page(TITLE, task, {"preparation": rows}, notes(rows), figures)


def stops(rows: Rows) -> dict[float, Rows]:
    """Return the rows of each stop criterion, from the loosest on."""
    known = [row for row in rows if row.get("error_e") is not None]
    criteria = sorted({row["stop_unbalanced"] for row in known}, reverse=True)
    return {c: [row for row in known if row["stop_unbalanced"] == c] for c in criteria}


def knee(rows: Rows) -> float:
    """Return the loosest criterion from which on every run keeps e to `DIGIT`; else the tightest.

    Only criteria that the largest number of runs has met are considered.
    """
    rows_of_stops = stops(rows)
    run_count = max(map(len, rows_of_stops.values()))
    complete = sorted(stop for stop, met in rows_of_stops.items() if len(met) == run_count)
    loosest = complete[0]
    for stop in complete:
        if any(row["error_e"] * row["e"] > DIGIT for row in rows_of_stops[stop]):
            break
        loosest = stop
    return loosest


def notes(rows: Rows) -> list[str]:
    """Return a line for each criterion with the error that it leaves."""
    runs = sum(row.get("stop_unbalanced") == END for row in rows)
    lines = []
    for criterion, met in stops(rows).items():
        error_of_e = max(row["error_e"] for row in met)
        error_of_z = max(row["error_Z"] for row in met)
        seconds = np.mean([row["seconds"] for row in met])
        lines.append(
            f"Residual {criterion:g}: met by {len(met)} of {runs} runs; e then moves by at most "
            f"{error_of_e:.1e}, Z by {error_of_z:.1e}; {seconds:.3g} s a run."
        )
    return lines
