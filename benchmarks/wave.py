"""The same wave by the linear solver, by leapfrog, by YADE and by LAMMPS: run time against error.

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
LITTLE_MORE = 1.1
"""Work over the least at which a tighter tolerance counts as free."""
CHEBYSHEV, LEAPFROG = "linear, Chebyshev", "linear, leapfrog"


def linear(path: str, duration: float, **setting: float) -> Callable[[], int]:
    """Task: the linear wave, by leapfrog with a `time_step`; returns its products with K."""
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
    """The springs' wave at each tolerance, and by leapfrog at each step, against the tightest."""
    path, rows, runs = job.write(network), [], []
    for tolerance in tolerances:
        what = {"method": CHEBYSHEV, "setting": f"tolerance {tolerance:g}"}
        runs.append((what, RECORDING_INTERVAL, {"tolerance": tolerance}))
    for fraction in fractions:
        step, every = step_and_records(network, fraction, RECORDING_INTERVAL)
        what = {"method": LEAPFROG, "setting": f"{fraction:g} of the limit"}
        what |= {"time_step_over_limit": fraction}
        runs.append((what, every * step, {"time_step": step}))
    for what, interval, setting in runs:
        how = {"duration": duration, "interval": interval}
        spent = job.measured(linear, path=path, **how, **setting)
        found, exact = (
            propagate(network, **how, **each).signals
            for each in (setting, {"tolerance": dem.REFERENCE})
        )
        error = dem.relative(found.chain_displacement, exact.chain_displacement)
        of_layers = dem.relative(found.layer_displacement, exact.layer_displacement)
        what |= {"products": spent.value, "error": error, "error_of_layers": of_layers}
        rows.append(what | spent.cost)
    return rows


def run(job: Job) -> Page:
    """All programs that are installed, on one crystal."""
    layers, sweeps = dem.LAYERS[job.quick], (TOLERANCES[job.quick], STEPS[job.quick])
    crystal = dem.Crystal(layers)
    network, duration = crystal.network, crystal.duration
    rows = linear_rows(job, network, duration, *sweeps)
    programs: Rows = []
    said = notes(rows)
    for program in (Yade, Lammps):
        if shutil.which(program.command):
            programs += crystal.rows(program(job, network), job.quick)
        else:
            said.append(f"{program.name}, which is optional, is not installed here.")
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
    return Page(TITLE, task, {"wave": rows}, said + dem.notes(rows), figures)


def knee(rows: Rows) -> dict[str, Any]:
    """The tightest tolerance of the linear wave that costs hardly more than the loosest."""
    tight = [row for row in rows if row["method"] == CHEBYSHEV]
    least = min(row["products"] for row in tight)
    free = [row for row in tight if row["products"] <= LITTLE_MORE * least]
    return min(free, key=lambda row: row["error"])


def notes(rows: Rows) -> list[str]:
    """The order of the leapfrog, and its time over that of the expansion."""
    steps, best = [row for row in rows if row["method"] == LEAPFROG], knee(rows)
    (a, b), (x, y) = (
        (row[name] for row in (steps[0], steps[-1])) for name in ("error", "time_step_over_limit")
    )
    return [
        f"Leapfrog, by the same expansion: order {math.log(a / b) / math.log(x / y):.2f}, {b:.1e} "
        f"in {steps[-1]['seconds']:.3g} s, {steps[-1]['seconds'] / best['seconds']:.2g} times "
        f"Chebyshev with {best['setting']}."
    ]
