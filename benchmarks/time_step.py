"""Time step of a wave in a random packing, against the exact wave.

The error of the DEM's time step is that of a linear leapfrog with the same step, with no contact
law in the way: single spheres carry waves up to the highest frequencies, means over layers only the
coherent ones, from which velocities are read. The crystal's: `python -m benchmarks wave`.
"""

from typing import Any

from benchmarks.harness import diagram
from benchmarks.harness.measure import Job
from benchmarks.harness.packing import sample_or_small
from benchmarks.harness.report import Page, Rows
from benchmarks.wave import linear_rows

TITLE = "Time step of a wave in a random packing"
SMALL = 300
"""Spheres of the packing that --quick makes; otherwise it is case 6."""
DURATION = {True: 5e-5, False: 2e-4}
"""Duration of the wave, s."""
FRACTIONS = {True: (0.9, 0.5, 0.35, 0.2), False: (0.9, 0.7, 0.5, 0.35, 0.2, 0.1, 0.05)}
NON_LINEAR = 0.02
"""The time step needs to be below what the contact law does at the study's amplitude, not far.
Over their records YADE differs from linear by 3.4 % (case 6) and 7.5 % (case 30) in the layers'
means, contacts that slide included; in small samples where none does, by less than 1 %."""
ERRORS = {
    "error": "error of single spheres (-)",
    "error_of_layers": "error of the layers' means (-)",
}


def run(job: Job) -> Page:
    """Run the linear leapfrog at every time step."""
    duration = DURATION[job.quick]
    network = sample_or_small(SMALL, job.quick, aspect=10.05)
    rows = linear_rows(job, network, duration, fractions=FRACTIONS[job.quick])
    task = (
        f"Random packing of {network.n_particles} spheres without friction, {1e3 * duration:g} ms, "
        "springs only: relative L2 errors over all times."
    )
    best = knee(rows, "error_of_layers")
    step = f"{best['time_step_over_limit']:g} of the limit" if best else "no step tried"
    remarks = [f"Packing, means over layers: error below {NON_LINEAR:g} with {step}."]
    figures = {"random_time_step": diagram.work_precision(rows, ERRORS, ["seconds"])}
    return Page(TITLE, task, {"random_time_step": rows}, remarks, figures)


def knee(rows: Rows, error: str = "error") -> dict[str, Any] | None:
    """Return the row of the largest step whose error is below the non-linear one, or None."""
    enough = [row for row in rows if row[error] < NON_LINEAR]
    return max(enough, key=lambda row: row["time_step_over_limit"], default=None)
