"""Seconds and bytes against the number of spheres, with exponents and the limit of the memory bus.

Samples are the lower parts of the packing of case 6, up to the whole, and three copies of it side
by side. What a product K u has to read, over the bytes a second that the memory delivers in this
very run, is the least time that it can take: the limit drawn. Only what a cache holds can be
faster.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks import diagram, machine, yade_job
from benchmarks.measure import attempted, measured
from benchmarks.modes import SAMPLE
from benchmarks.modes_scaling import exponent, resized
from benchmarks.report import Finding
from modal.assembly import mass_diagonal, stiffness_matrix
from modal.factor import factorise
from modal.network import Network, read_network, write_network
from modal.operator import ContactOperator
from modal.random_packing import random_network
from modal.sample import Sample, read_packing, write_sample
from modal.storage import InputError
from modal.wave import propagate

TITLE = "Scaling: seconds and bytes against the number of spheres"
SIZES = {True: (125, 250, 500), False: (1_000, 3_000, 10_000, 35_201, 105_603)}
FACTORED_AT_MOST = 40_000
"""Spheres up to which K is factorised: three times as many need 6 GB and most of a minute."""
DURATION = {True: 6e-5, False: 6e-4}
STEPS = 30
"""YADE steps that are timed."""
PRODUCTS = 400_000
"""Products that are timed together, times the number of spheres; at least 20."""
SHIFT = 1e-7
"""Shift below zero, over the largest diagonal entry, that keeps the factor definite."""


def assembly(path: str) -> Callable[[], int]:
    """Task: K as a sparse matrix; returns its nonzeros."""
    network = read_network(path)
    return lambda: int(stiffness_matrix(network).nnz)


def _scaled(network: Network) -> sp.csr_matrix:
    scale = sp.diags(1 / np.sqrt(mass_diagonal(network)))
    matrix = (scale @ stiffness_matrix(network) @ scale).tocsr()
    shift = SHIFT * matrix.diagonal().max()
    return (matrix + shift * sp.identity(matrix.shape[0], format="csr")).tocsr()


def factor(path: str) -> Callable[[], str]:
    """Task: factor of K, definite by a shift; returns the back end."""
    matrix = _scaled(read_network(path))
    factorise(sp.identity(3, format="csr"), definite=True)  # loads the back end
    return lambda: factorise(matrix, definite=True).solver


def repetitions(spheres: int) -> int:
    """Products that are timed together: enough for the clock."""
    return max(20, PRODUCTS // spheres)


def products(path: str, compiled: bool) -> Callable[[], float]:
    """Task: products K u by the contact operator or by the CSR matrix; returns bytes it must move.

    The matrix or the contacts, the vector that is read, and the result, read and written.
    """
    network = read_network(path)
    times = repetitions(network.n_particles)
    u = np.ones(6 * network.n_particles)
    out = np.zeros_like(u)
    if not compiled:
        matrix = stiffness_matrix(network)
        moved = matrix.data.nbytes + matrix.indices.nbytes + matrix.indptr.nbytes + 2 * u.nbytes

        def by_matrix() -> float:
            for _ in range(times):
                matrix @ u
            return float(moved)

        return by_matrix
    tracemalloc.start()
    operator = ContactOperator(network)
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    operator.apply(u, out)  # compiles the loop

    def by_contacts() -> float:
        for _ in range(times):
            operator.accumulate(u, out)
        return float(held + 3 * u.nbytes)

    return by_contacts


def wave(path: str, duration: float) -> Callable[[], int]:
    """Task: the linear wave; returns the number of products."""
    network = read_network(path)
    propagate(network, 1e-5)  # compiles the loop
    return lambda: propagate(network, duration, tolerance=1e-8).products


def nothing() -> Callable[[], None]:
    """Task: what the interpreter and the imports hold."""
    return lambda: None


def lower_part(network: Network) -> Sample:
    """Spheres and walls of a network for YADE, which finds the contacts itself."""
    return Sample(network.position, network.cell_size[:2], network.wall_position, friction=0.1)


def _empty(curve: str, spheres: int) -> dict[str, Any]:
    return {"curve": curve, "x": spheres, "seconds": None, "mb": None}


def yade_rows(network: Network, folder: Path) -> list[dict[str, Any]]:
    """A step under compression and a step of a wave."""
    path = folder / "scaling.sample.h5"
    write_sample(path, lower_part(network))
    rows = []
    for name, wave_step in (("YADE, sample step", False), ("YADE, wave step", True)):
        row = _empty(name, network.n_particles)
        try:
            run = yade_job.measured(
                "steps",
                folder,
                sample=str(path),
                kind="wave" if wave_step else "sample",
                stress=1e5,
                steps=STEPS,
                collider="asleep" if wave_step else "when needed",
                rotations=True,
                output=None,
            )
            rows.append(row | {"seconds": run.seconds, "mb": run.value["scene_mb"]})
        except InputError as error:
            rows.append(row | {"failure": str(error)})
    return rows


def modal_rows(
    network: Network, folder: Path, quick: bool, bare: float, bandwidth: float
) -> list[dict[str, Any]]:
    """Assembly, factor, products with their limits, and the linear wave."""
    path, n, rows = folder / "scaling.network.h5", network.n_particles, []
    write_network(path, network)
    tasks: list[tuple[str, str, dict[str, Any]]] = [
        ("assembly of K", "assembly", {}),
        ("factor of K", "factor", {}),
        ("product K u, contacts", "products", {"compiled": True}),
        ("product K u, CSR", "products", {"compiled": False}),
        (f"linear wave, {1e3 * DURATION[quick]:g} ms", "wave", {"duration": DURATION[quick]}),
    ]
    for curve, task, arguments in tasks:
        if task == "factor" and n > FACTORED_AT_MOST:
            continue
        times = 1 if quick or task == "wave" else 3
        run = attempted(f"benchmarks.scaling:{task}", times=times, path=str(path), **arguments)
        row = _empty(curve, n)
        if run.failure:
            row["failure"] = run.failure
        elif task == "products":
            row["seconds"] = run.seconds / repetitions(n)
            row["seconds_limit"] = run.value / bandwidth
            row["mb"] = run.value / 1e6
        else:
            row |= {"seconds": run.seconds, "mb": max(run.peak_mb - bare, 1e-3)}
            row["result"] = run.value
        rows.append(row)
    return rows


def run(quick: bool, folder: Path) -> Finding:
    """Every size."""
    sample = random_network(500, 1e5, seed=1, aspect=5.0) if quick else read_packing(SAMPLE)
    rates = machine.bandwidth(32.0 if quick else 256.0)
    bare = measured("benchmarks.scaling:nothing", times=3).peak_mb
    rows = []
    for size in SIZES[quick]:
        network = resized(sample, size)
        if yade_job.available():
            rows += yade_rows(network, folder)
        rows += modal_rows(network, folder, quick, bare, max(rates.values()))
    curves = list(dict.fromkeys(row["curve"] for row in rows))
    rows.sort(key=lambda row: curves.index(row["curve"]))
    task = (
        "Memory is what a task needs beyond the bare interpreter; of a product, the bytes that it "
        "has to move. `seconds_limit` is those bytes over the bandwidth of this run, "
        + ", ".join(f"{name} {rate / 1e9:.1f} GB/s" for name, rate in rates.items())
        + " on one core. Exponents are fitted to the larger half of the points. x: spheres."
    )
    return Finding(TITLE, task, rows, notes(rows), {"scaling": draw(rows)})


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Seconds, with the limits of the products, and megabytes."""
    figure, axes = diagram.panels(1, 2, width=4.6, height=3.9)
    curves = list(dict.fromkeys(row["curve"] for row in rows))
    for ax, quantity, label in (
        (axes[0, 0], "seconds", "processor time (s)"),
        (axes[0, 1], "mb", "memory (MB)"),
    ):
        for k, curve in enumerate(curves):
            own = [row for row in rows if row["curve"] == curve]
            slopes = (exponent(own, "seconds"), exponent(own, "mb"))
            name = f"{curve}: " + ", ".join("-" if s is None else f"{s:.2f}" for s in slopes)
            diagram.curve(ax, own, "x", quantity, label=name, **diagram.look(k))
            if quantity == "seconds":
                limit(ax, own, diagram.look(k))
        ax.set(xlabel="number of spheres", ylabel=label)
        diagram.decades(ax)
    diagram.legend_below(figure, axes[0, 0], len(curves) + 2, "exponents of seconds, memory")
    return figure


def limit(ax: Axes, rows: list[dict[str, Any]], look: dict[str, Any]) -> None:
    """The least time of a product at the bandwidth of the memory."""
    known = [row for row in rows if row.get("seconds_limit")]
    if known:
        label = f"memory limit of {known[0]['curve']}"
        style = look | {"marker": None, "lw": 0.7}
        diagram.curve(ax, known, "x", "seconds_limit", label=label, **style)


def notes(rows: list[dict[str, Any]]) -> list[str]:
    """Exponents, and how near to the bus the products are."""
    said = []
    for curve in dict.fromkeys(row["curve"] for row in rows):
        own = [row for row in rows if row["curve"] == curve]
        seconds, memory = exponent(own, "seconds"), exponent(own, "mb")
        last = own[-1]
        if seconds is None or last["seconds"] is None:
            continue
        text = (
            f"{curve}: seconds grow as n^{seconds:.2f}"
            + (f", bytes as n^{memory:.2f}" if memory is not None else "")
            + f"; {last['seconds']:.3g} s and {last['mb']:.3g} MB at {last['x']} spheres"
        )
        if last.get("seconds_limit"):
            text += f", {last['seconds'] / last['seconds_limit']:.2g} times the memory's limit"
        said.append(text + ".")
    return said
