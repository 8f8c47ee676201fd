"""Run time against error of one wave by the linear solver, by leapfrog, by YADE and by LAMMPS.

The error is the relative L2 difference of all chain displacements from the converged wave, of the
springs or, for YADE and LAMMPS, of their law's tangent.
"""

import math
import shutil
from collections.abc import Callable, Sequence
from typing import Any

from benchmarks import dem
from benchmarks.harness import diagram
from benchmarks.harness.lammps import Lammps
from benchmarks.harness.measure import Job
from benchmarks.harness.packing import step_and_records
from benchmarks.harness.report import Page, Rows
from benchmarks.harness.yade import Yade
from modal.packing.network import Network, read_network
from modal.waves.motions import RECORDING_INTERVAL
from modal.waves.propagate import propagate

TITLE = "The same wave by linear propagation, leapfrog, YADE and LAMMPS"
TOLERANCES = {True: (1e-1, 1e-5, 1e-9), False: (1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-12)}
STEPS = {True: (0.5, 0.1), False: (0.9, 0.5, 0.2, 0.1, 0.05, 0.02)}
"""Time steps of the leapfrog over the limit 2 / omega_max."""
MAX_FREE_RATIO = 1.1
"""Work divided by the least one up to which a tighter tolerance counts as free."""
CHEBYSHEV = "linear, Chebyshev"
LEAPFROG = "linear, leapfrog"


def linear(path: str, duration: float, **setting: float) -> Callable[[], int]:
    """Prepare the task of the linear wave, by leapfrog with a `time_step`; it returns products."""
    network = read_network(path)
    propagate(network, max(1e-5, setting["interval"]), **setting)  # compiles the loop
    return lambda: propagate(network, duration, **setting).products


def linear_rows(
    job: Job,
    network: Network,
    duration: float,
    tolerances: Sequence[float] = (),
    fractions: Sequence[float] = (),
) -> Rows:
    """Return rows of the springs' wave at each tolerance, and by leapfrog at each step."""
    path = job.write(network)
    rows = []
    runs = []
    for tolerance in tolerances:
        method = {"method": CHEBYSHEV, "setting": f"tolerance {tolerance:g}"}
        runs.append((method, RECORDING_INTERVAL, {"tolerance": tolerance}))
    for fraction in fractions:
        step, steps_per_record = step_and_records(network, fraction, RECORDING_INTERVAL)
        method = {
            "method": LEAPFROG,
            "setting": f"{fraction:g} of the limit",
            "time_step_over_limit": fraction,
        }
        runs.append((method, steps_per_record * step, {"time_step": step}))
    for method, interval, setting in runs:
        times = {"duration": duration, "interval": interval}
        measured = job.measured(linear, path=path, **times, **setting)
        signals = propagate(network, **times, **setting).signals
        exact = propagate(network, **times, tolerance=dem.REFERENCE).signals
        errors = {
            "products": measured.value,
            "error": dem.relative(signals.chain_displacement, exact.chain_displacement),
            "error_of_layers": dem.relative(signals.layer_displacement, exact.layer_displacement),
        }
        rows.append(method | errors | measured.cost)
    return rows


def run(job: Job) -> Page:
    """Run all programs that are installed on one crystal."""
    layers = dem.LAYERS[job.quick]
    crystal = dem.Crystal(layers)
    network = crystal.network
    duration = crystal.duration
    rows = linear_rows(job, network, duration, TOLERANCES[job.quick], STEPS[job.quick])
    programs: Rows = []
    remarks = notes(rows)
    for program in (Yade, Lammps):
        if shutil.which(program.command):
            programs += crystal.rows(program(job, network), job.quick)
        else:
            remarks.append(f"{program.name}, which is optional, is not installed here.")
    rows += programs
    task = (
        f"FCC crystal of {dem.WIDTH} x {dem.WIDTH} x {layers} spheres at 100 kPa, pulse "
        f"of 100 kHz, {1e3 * duration:.3g} ms. The linear wave is computed in one of the columns "
        "of which the crystal consists, where that is exact to the tolerance. Seconds of YADE are "
        "those of its steps, those of LAMMPS include its short start. `apart_from_tangent`: "
        "difference from the leapfrog of the "
        "tangent with the same step, which leaves the contact law's non-linearity. "
        "`dispersion_linear`: error of the springs' leapfrog with the same step. "
        "`velocity_tangent`: error of V_P with pre-stress. The recording interval varies at "
        f"{dem.FRACTION:g} of the limit, 2A = {2e9 * dem.SMALL:g} nm."
    )
    shown = [row for row in rows if row["method"] != dem.RECORDING]
    figures = {
        "wave": diagram.work_precision(shown, {"error": "relative error of the signals (-)"})
    }
    if programs:
        figures["fcc_time_step"] = diagram.work_precision(programs, dem.ERRORS, ["seconds"])
    return Page(TITLE, task, {"wave": rows}, remarks + dem.notes(rows), figures)


def knee(rows: Rows) -> dict[str, Any]:
    """Return the row of the tightest tolerance that costs hardly more than the loosest."""
    tight = [row for row in rows if row["method"] == CHEBYSHEV]
    least = min(row["products"] for row in tight)
    free = [row for row in tight if row["products"] <= MAX_FREE_RATIO * least]
    return min(free, key=lambda row: row["error"])


def notes(rows: Rows) -> list[str]:
    """Return a line with the order of the leapfrog, and its time against the expansion."""
    best = knee(rows)
    steps = [row for row in rows if row["method"] == LEAPFROG]
    first = steps[0]
    last = steps[-1]
    error_ratio = first["error"] / last["error"]
    step_ratio = first["time_step_over_limit"] / last["time_step_over_limit"]
    order = math.log(error_ratio) / math.log(step_ratio)
    return [
        f"Leapfrog, by the same expansion: order {order:.2f}, {last['error']:.1e} "
        f"in {last['seconds']:.3g} s, {last['seconds'] / best['seconds']:.2g} times "
        f"Chebyshev with {best['setting']}."
    ]
