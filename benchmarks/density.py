"""Error of the density of states: moments and random vectors against the exact spectrum.

The number of moments follows from the resolution, the number of vectors from the tolerance. The
error is the largest distance of the number of modes below a frequency from the exact one, over all
modes. The same number of moments of the exact spectrum, smoothed by the same kernel, tells the
kernel's share from the vectors'. What exact counts cost: `python -m benchmarks scaling`.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.harness import diagram
from benchmarks.harness.measure import Job
from benchmarks.harness.packing import KnownPacking
from benchmarks.harness.report import Page, Rows
from modal.modes.density import DensityOfStates, density_of_states
from modal.packing.network import read_network

TITLE = "Density of states: moments and random vectors"
SPHERES = {True: 250, False: 700}
RESOLUTIONS = {True: (2e4, 5e3), False: (4e4, 2e4, 1e4, 5e3, 2e3, 1e3)}
"""Full width of a mode, Hz: the number of moments is inversely proportional to it."""
TOLERANCES = {True: (1e-2, 2e-3), False: (4e-3, 2e-3, 1e-3, 7e-4)}
"""Wanted standard error of a count over all modes: sets the number of vectors."""
TOLERANCE = {True: 2e-3, False: 1e-3}
"""While the resolution varies; the default of `modal density`."""


def states(path: str, resolution: float, tolerance: float) -> Callable[[], int]:
    """Prepare the task of a density of states; floppy modes are split off beforehand."""
    network = read_network(path)
    density_of_states(network, resolution=1e5, tolerance=0.1)  # compiles; finds floppy modes
    return lambda: density_of_states(network, resolution=resolution, tolerance=tolerance).products


def smoothed(exact: np.ndarray, density: DensityOfStates) -> DensityOfStates:
    """Return the density by the exact moments of the elastic spectrum (n,), Hz, and one kernel.

    It has two equal "vectors", so that the formulas for the scatter hold.
    """
    angle = np.arccos(np.clip(exact / density.highest, -1, 1))
    moments = np.zeros((2, 6, density.moments.shape[2]))
    moments[:, 0] = np.cos(2 * angle[:, None] * np.arange(moments.shape[2])).sum(axis=0)
    return replace(density, moments=moments)


def errors(exact: np.ndarray, floppy: int, density: DensityOfStates) -> dict[str, float]:
    """Return the largest error of a count divided by all modes, and shares of kernel and vectors.

    exact (n,): all frequencies, Hz, ascending. Counts are compared in the middle between
    neighbouring frequencies, each at most a quarter of a per cent of all modes apart.
    """
    elastic = exact[floppy:]
    chosen = np.unique(np.linspace(0, len(elastic) - 2, 400).astype(int))
    frequency = (elastic[chosen] + elastic[chosen + 1]) / 2
    true = floppy + chosen + 1
    estimate = density.count_below(frequency)[0][:, -1]
    kernel = smoothed(elastic, density).count_below(frequency)[0][:, -1]
    size = len(exact)
    return {
        "error": float(abs(estimate - true).max() / size),
        "error_of_kernel": float(abs(kernel - true).max() / size),
        "error_of_vectors": float(abs(estimate - kernel).max() / size),
    }


def run(job: Job) -> Page:
    """Vary the resolution at one tolerance, then the tolerance at the finest resolution."""
    packing = KnownPacking.of(SPHERES[job.quick], job)
    rows: Rows = []
    resolutions = RESOLUTIONS[job.quick]
    sweeps = [("moments", r, TOLERANCE[job.quick]) for r in resolutions]
    sweeps += [("vectors", resolutions[-1], t) for t in TOLERANCES[job.quick]]
    for varied, resolution, tolerance in sweeps:
        setting = {"resolution": resolution, "tolerance": tolerance}
        cost = job.measured(states, path=packing.path, **setting)
        density = density_of_states(packing.system.network, **setting)
        row = {
            "method": f"random vectors, more {varied}",
            "resolution_hz": resolution,
            "moments": density.moments.shape[2],
            "vectors": len(density.moments),
            "products": density.products,
        }
        row |= errors(packing.exact, packing.floppy, density)
        rows.append(row | cost.cost)
    task = (
        f"A {packing} and split off. `error` is the largest error of the number of modes below a "
        "frequency, over all modes; `error_of_kernel` what exact moments would have with the same "
        "kernel, `error_of_vectors` the rest."
    )
    figure = diagram.work_precision(rows, {"error": "error of a count over all modes (-)"})
    return Page(TITLE, task, {"density": rows}, notes(rows), {"density": figure})


def knee(rows: Rows) -> dict[str, Any]:
    """Return the row of the coarsest resolution whose kernel errs less than the vectors may.

    The vectors may err by the requested standard error; the error of one draw is chance. Without
    such a resolution the finest one is returned.
    """
    moments = [row for row in rows if row["method"].endswith("more moments")]
    enough = [row for row in moments if row["error_of_kernel"] < TOLERANCE[False]]
    return max(enough, key=lambda row: row["resolution_hz"], default=moments[-1])


def notes(rows: Rows) -> list[str]:
    """Return lines on how the error falls with moments and with vectors, for one draw."""
    lines = []
    for varied, source in (("moments", "kernel"), ("vectors", "vectors")):
        sweep = [row for row in rows if row["method"].endswith(f"more {varied}")]
        first = sweep[0]
        last = sweep[-1]
        error = f"error_of_{source}"
        lines.append(
            f"{first[varied]:.0f} to {last[varied]:.0f} {varied}: "
            f"their error goes from {first[error]:.1e} to {last[error]:.1e}."
        )
    return lines
