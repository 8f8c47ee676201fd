"""Density of states by random vectors: moments and vectors against the exact spectrum.

The number of moments follows from the resolution, the number of vectors from the tolerance. The
error is the largest distance of the number of modes below a frequency from the exact one, over all
modes. Peers: the dense spectrum, and exact counts at a few frequencies. The same number of moments
of the exact spectrum, smoothed by the same kernel, tells the kernel's share from the vectors'.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import eigh

from benchmarks import diagram
from benchmarks.measure import measured
from benchmarks.packing import KnownPacking
from benchmarks.report import Finding
from modal.density import DensityOfStates, density_of_states
from modal.eigenproblem import Eigenproblem
from modal.inertia import count_below
from modal.network import read_network

TITLE = "Density of states: moments and random vectors against exact counts"
SPHERES = {True: 250, False: 700}
RESOLUTIONS = {True: (2e4, 5e3), False: (4e4, 2e4, 1e4, 5e3, 2e3, 1e3)}
"""Full width of a mode, Hz: the number of moments is inversely proportional to it."""
TOLERANCES = {True: (1e-2, 2e-3), False: (4e-3, 2.8e-3, 2e-3, 1.4e-3, 1e-3, 7e-4)}
"""Wanted standard error of a count over all modes: sets the number of vectors."""
TOLERANCE = {True: 2e-3, False: 1e-3}
"""While the resolution varies; the default of `modal density`."""
COUNTS = 12
BINS = 60


def states(path: str, resolution: float, tolerance: float) -> Callable[[], int]:
    """Task: density of states of a packing, its floppy modes split off beforehand."""
    network = read_network(path)
    floppy = Eigenproblem.of(network).floppy.basis
    density_of_states(network, resolution=1e5, tolerance=0.1)  # compiles the loop
    return lambda: (
        density_of_states(
            network, resolution=resolution, tolerance=tolerance, zero_modes=floppy
        ).products
    )


def dense(path: str) -> Callable[[], int]:
    """Task: the whole spectrum, frequencies only."""
    network = read_network(path)

    def action() -> int:
        return len(eigh(Eigenproblem.of(network).scaled.toarray(), eigvals_only=True))

    return action


def counts(path: str, at: list[float]) -> Callable[[], list[int]]:
    """Task: exact counts by inertia."""
    network = read_network(path)
    problem = Eigenproblem.of(network)
    count_below(problem, at[0])  # loads the back end

    def action() -> list[int]:
        fresh = Eigenproblem.of(network)
        return [count_below(fresh, f) for f in at]

    return action


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


def histogram(exact: np.ndarray, floppy: int, found: DensityOfStates) -> Figure:
    """All modes in bins, and the density by random vectors with twice its standard error."""
    figure, axes = diagram.panels(1, 1, width=6.0, height=3.0)
    ax = axes[0, 0]
    elastic = exact[floppy:] / 1e3
    edges = np.linspace(0, 1.02 * elastic[-1], BINS + 1)
    number = np.histogram(elastic, edges)[0] / np.diff(edges)
    ax.stairs(number, edges, color="0.6", fill=True, label="all modes, dense")
    frequency = found.grid()
    frequency = frequency[frequency < 0.995 * found.highest]
    density, error = found.density(frequency)
    density, error = 1e3 * density[:, -1], 1e3 * error[:, -1]
    label = f"{len(found.moments)} vectors, {found.moments.shape[2]} moments"
    ax.plot(frequency / 1e3, density, "k-", lw=1.2, label=label)
    for side in (-2, 2):
        ax.plot(frequency / 1e3, density + side * error, "k:", lw=0.7)
    ax.set(xlabel="frequency (kHz)", ylabel="modes per kHz", ylim=(0, None))
    ax.legend(fontsize=8)
    return figure


def run(quick: bool, folder: Path) -> Finding:
    """Resolutions at one tolerance, tolerances at the finest resolution, and the peers."""
    packing, times = KnownPacking.of(SPHERES[quick], folder), 1 if quick else 3
    path, problem = str(packing.path), packing.problem
    exact, floppy = packing.exact, packing.floppy
    rows, shown = [], None
    sweeps = [("moments", r, TOLERANCE[quick]) for r in RESOLUTIONS[quick]]
    sweeps += [("vectors", RESOLUTIONS[quick][-1], t) for t in TOLERANCES[quick]]
    for what, resolution, tolerance in sweeps:
        setting = {"resolution": resolution, "tolerance": tolerance}
        cost = measured("benchmarks.density:states", times=times, path=path, **setting)
        found = density_of_states(problem.network, zero_modes=problem.floppy.basis, **setting)
        rows.append(
            {
                "method": f"random vectors, more {what}",
                "resolution_hz": resolution,
                "moments": found.moments.shape[2],
                "vectors": len(found.moments),
                "products": found.products,
                **errors(exact, floppy, found),
                "seconds": cost.seconds,
                "peak_mb": cost.peak_mb,
            }
        )
        if what == "moments" and resolution <= 5e3 and shown is None:
            shown = found
    rows += peers(path, exact, times)
    task = (
        f"A {packing} and split off. `error` is the largest error of the number of modes below a "
        "frequency, over all modes; `error_of_kernel` what exact moments would have with the same "
        "kernel, `error_of_vectors` the rest."
    )
    figures = {
        "density": diagram.work_precision(rows, {"error": "error of a count over all modes (-)"}),
        "density_histogram": histogram(exact, floppy, shown),
    }
    return Finding(TITLE, task, rows, notes(rows), figures)


def peers(path: str, exact: np.ndarray, times: int) -> list[dict[str, Any]]:
    """The dense spectrum, and exact counts between which nothing is known."""
    at = np.linspace(0, exact[-1], COUNTS + 2)[1:-1].tolist()
    cost = measured("benchmarks.density:counts", times=times, path=path, at=at)
    true = [int((exact < f).sum()) for f in at]
    wrong = [abs(a - b) for a, b in zip(cost.value, true, strict=True)]
    whole = measured("benchmarks.density:dense", path=path)
    return [
        {
            "method": f"{COUNTS} exact counts",
            "error": max(wrong) / len(exact),
            "seconds": cost.seconds,
            "peak_mb": cost.peak_mb,
        },
        {
            "method": "dense spectrum",
            "error": 0.0,
            "seconds": whole.seconds,
            "peak_mb": whole.peak_mb,
        },
    ]


def default_resolution(moments: list[dict[str, Any]]) -> dict[str, Any]:
    """The coarsest resolution whose kernel errs less than the vectors do; else the finest."""
    enough = [row for row in moments if row["error_of_kernel"] < row["error_of_vectors"]]
    return max(enough, key=lambda row: row["resolution_hz"]) if enough else moments[-1]


def notes(rows: list[dict[str, Any]]) -> list[str]:
    """What limits the error, and how it falls."""
    moments = [row for row in rows if row["method"].endswith("more moments")]
    vectors = [row for row in rows if row["method"].endswith("more vectors")]
    few, many, best, dense_row = vectors[0], vectors[-1], default_resolution(moments), rows[-1]
    return [
        f"More moments at {moments[0]['vectors']} vectors: the kernel's error falls from "
        f"{moments[0]['error_of_kernel']:.1e} ({moments[0]['moments']} moments) to "
        f"{moments[-1]['error_of_kernel']:.1e} ({moments[-1]['moments']}); the error stops where "
        f"that of the vectors, {moments[-1]['error_of_vectors']:.1e}, is larger.",
        f"{many['vectors'] / few['vectors']:.3g} times more vectors: their error falls by "
        f"{few['error_of_vectors'] / many['error_of_vectors']:.2g}; for independent vectors the "
        f"square root, {np.sqrt(many['vectors'] / few['vectors']):.2g}, is expected of the mean "
        "over many draws. This is one draw.",
        f"Knee: {best['resolution_hz']:g} Hz, the coarsest resolution whose kernel "
        f"({best['error_of_kernel']:.1e}) errs less than {best['vectors']} vectors do "
        f"({best['error_of_vectors']:.1e}): {best['error']:.1e} of all modes in "
        f"{best['seconds']:.3g} s. The defaults of `modal density` are 2 kHz and a standard error "
        f"of 1e-3. The dense spectrum takes {dense_row['seconds']:.3g} s here, but its time grows "
        "with the cube of the size, that of the vectors in proportion to it, and fewer vectors do "
        "for larger packings.",
    ]
