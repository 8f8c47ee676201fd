"""Density of states by random vectors: moments and vectors against the exact spectrum.

The number of moments follows from the resolution, the number of vectors from the tolerance. The
error is the largest distance of the number of modes below a frequency from the exact one, over all
modes. The same number of moments of the exact spectrum, smoothed by the same kernel, tells the
kernel's share from the vectors'. What exact counts cost: `python -m benchmarks scaling`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import diagram
from benchmarks.harness.measure import measured
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
    """Task: density of states of a packing, its floppy modes split off beforehand."""
    network = read_network(path)
    density_of_states(network, resolution=1e5, tolerance=0.1)  # compiles; finds floppy modes
    return lambda: density_of_states(network, resolution=resolution, tolerance=tolerance).products


def smoothed(exact: np.ndarray, found: DensityOfStates) -> DensityOfStates:
    """The same kernel on the moments of the exact spectrum (n,), Hz, elastic modes only.

    Two equal "vectors", so that the formulas for the scatter hold.
    """
    angle = np.arccos(np.clip(exact / found.highest, -1, 1))
    order = np.arange(found.moments.shape[2])
    total = np.cos(2 * angle[:, None] * order).sum(axis=0)
    moments = np.zeros((2, 6, len(order)))
    moments[:, 0] = total
    return DensityOfStates(
        moments, found.highest, found.zero_modes, found.resolution, found.products
    )


def errors(exact: np.ndarray, floppy: int, found: DensityOfStates) -> dict[str, float]:
    """Largest error of a count over all modes, and the shares of kernel and vectors.

    exact (n,): all frequencies, Hz, ascending. Counts are compared in the middle between
    neighbouring frequencies, each at most a quarter of a per cent of all modes apart.
    """
    elastic = exact[floppy:]
    chosen = np.unique(np.linspace(0, len(elastic) - 2, 400).astype(int))
    at = (elastic[chosen] + elastic[chosen + 1]) / 2
    true = floppy + chosen + 1
    estimate = found.count_below(at)[0][:, -1]
    kernel = smoothed(elastic, found).count_below(at)[0][:, -1]
    size = len(exact)
    return {
        "error": float(abs(estimate - true).max() / size),
        "error_of_kernel": float(abs(kernel - true).max() / size),
        "error_of_vectors": float(abs(estimate - kernel).max() / size),
    }


def run(quick: bool, folder: Path) -> Page:
    """Resolutions at one tolerance, then tolerances at the finest resolution."""
    packing, times = KnownPacking.of(SPHERES[quick], folder), 1 if quick else 3
    path, rows = str(packing.path), []
    sweeps = [("moments", r, TOLERANCE[quick]) for r in RESOLUTIONS[quick]]
    sweeps += [("vectors", RESOLUTIONS[quick][-1], t) for t in TOLERANCES[quick]]
    for what, resolution, tolerance in sweeps:
        setting = {"resolution": resolution, "tolerance": tolerance}
        cost = measured("benchmarks.density:states", times=times, path=path, **setting)
        found = density_of_states(packing.problem.network, **setting)
        rows.append(
            {
                "method": f"random vectors, more {what}",
                "resolution_hz": resolution,
                "moments": found.moments.shape[2],
                "vectors": len(found.moments),
                "products": found.products,
                **errors(packing.exact, packing.floppy, found),
                **cost.cost,
            }
        )
    task = (
        f"A {packing} and split off. `error` is the largest error of the number of modes below a "
        "frequency, over all modes; `error_of_kernel` what exact moments would have with the same "
        "kernel, `error_of_vectors` the rest."
    )
    figure = diagram.work_precision(rows, {"error": "error of a count over all modes (-)"})
    return Page(TITLE, task, {"density": rows}, notes(rows), {"density": figure})


def knee(rows: Rows) -> dict[str, Any]:
    """The coarsest resolution whose kernel errs less than the vectors may; else the finest.

    They may err by the standard error that is asked for; how far one draw of them is off is chance.
    """
    moments = [row for row in rows if row["method"].endswith("more moments")]
    enough = [row for row in moments if row["error_of_kernel"] < TOLERANCE[False]]
    return max(enough, key=lambda row: row["resolution_hz"]) if enough else moments[-1]


def notes(rows: Rows) -> list[str]:
    """What limits the error, and how it falls."""
    moments = [row for row in rows if row["method"].endswith("more moments")]
    vectors = [row for row in rows if row["method"].endswith("more vectors")]
    few, many = vectors[0], vectors[-1]
    coarse, fine = moments[0], moments[-1]
    return [
        f"{coarse['moments']:.0f} to {fine['moments']:.0f} moments, {fine['vectors']:.0f} vectors: "
        f"the kernel's error falls from {coarse['error_of_kernel']:.1e} to "
        f"{fine['error_of_kernel']:.1e}; that of the vectors is {fine['error_of_vectors']:.1e}.",
        f"{many['vectors'] / few['vectors']:.3g} times more vectors: their error falls by "
        f"{few['error_of_vectors'] / many['error_of_vectors']:.2g}; for independent vectors the "
        f"square root, {np.sqrt(many['vectors'] / few['vectors']):.2g}, is expected of the mean "
        "over many draws. This is one draw.",
    ]
