"""Seconds and bytes against the number of spheres.

Smaller packings are the lower parts of the sample of case 6, so they stay as slender; larger ones
are the sample repeated sideways. What a product K u could take at least: `python -m benchmarks
contact_loop`; what more threads bring to whole commands: `python -m benchmarks questions`.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.harness import diagram
from benchmarks.harness.diagram import exponent
from benchmarks.harness.measure import Job
from benchmarks.harness.packing import resized, sample_or_small
from benchmarks.harness.product import bytes_of
from benchmarks.harness.report import Page, Rows
from modal.modes.counts import count_below
from modal.modes.density import density_of_states
from modal.modes.eigenmodes import modes_of
from modal.packing import crystal as gallery
from modal.packing.network import Network, read_network
from modal.system.assembly import stiffness_matrix
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator
from modal.waves.propagate import propagate

TITLE = "Scaling: seconds and bytes against the number of spheres"
SIZES = {True: (125, 250, 500), False: (1_000, 6_000, 35_201, 105_603, 985_628)}
ASSEMBLED, FACTORED = 150_000, 40_000
"""Spheres up to which K is assembled (three times as many: 10 GB), and up to which it is factorised
(three times as many: 7 GB and minutes)."""
DURATION = {True: 6e-5, False: 6e-4}
PRODUCTS = 400_000
"""Products that are timed together, times the number of spheres; at least 20."""
FILE = "packing.network.h5"
COUNT_AT, RESOLUTION, FEW = 2e4, 1e4, 10
"""Hz of the exact count; Hz of the density of states; lowest modes against the size."""


def compile_loop() -> None:
    """What compiling takes and holds is no part of a task."""
    ContactOperator(gallery.column(2)).apply(np.ones(12))


def nothing() -> Callable[[], None]:
    """Task: what the interpreter and the imports hold."""
    compile_loop()
    return lambda: None


def repetitions(spheres: int) -> int:
    """Products that are timed together: enough for the clock."""
    return max(20, PRODUCTS // spheres)


def products(path: str, compiled: bool) -> Callable[[], float]:
    """Task: products K u by the contact operator or the CSR matrix; the bytes that each moves."""
    network = read_network(path)
    u = np.ones(6 * network.n_particles)
    out = np.zeros_like(u)
    if compiled:
        compile_loop()
        operator = ContactOperator(network)
        needs, multiply = bytes_of(operator), lambda: operator.combine(u, out, 1.0, 0.0, 1.0)
    else:
        matrix = stiffness_matrix(network)
        needs, multiply = bytes_of(matrix), lambda: matrix @ u

    def action() -> float:
        for _ in range(repetitions(network.n_particles)):
            multiply()
        return needs

    return action


def modes(network: Network, which: str, limits: Sequence[float]) -> str:
    """The highest or lowest modes; how they were found."""
    system = LinearSystem.of(network, shapes=False)
    found = modes_of(system, certify=which == "lowest", **{which: int(*limits)})
    exact = "certified" if found.attributes["certified"] else "not certified"
    last, solver = found.frequency[-1], found.attributes["solver"]
    return f"{len(found.frequency)} modes to {last:.0f} Hz, {exact}, {solver}"


ACTIONS: dict[str, Callable[..., str]] = {
    "assembly": lambda network: f"{stiffness_matrix(network).nnz} nonzeros",
    "wave": lambda network, duration: (
        f"{propagate(network, duration, whole=True).products} products"
    ),
    "density": lambda network, width: (
        f"{density_of_states(network, resolution=width).products} products"
    ),
    "count": lambda network, at: f"{count_below(LinearSystem.of(network), at)} modes",
    "modes": modes,
}
"""What is done with a network; returns what the table says of the result."""


def act(path: str, action: str, **given: Any) -> Callable[[], str]:
    """Task: one of `ACTIONS`."""
    compile_loop()
    network = read_network(path)
    return lambda: ACTIONS[action](network, **given)


def curves(n: int, quick: bool) -> dict[str, dict[str, Any]]:
    """Name -> what is given to `act`, or to `products`, for a packing of n spheres."""
    lasting = DURATION[quick]
    tasks: dict[str, dict[str, Any]] = {
        "product K u, contacts": {"compiled": True},
        f"linear wave, {1e3 * lasting:g} ms": {"action": "wave", "duration": lasting},
        "highest mode": {"action": "modes", "which": "highest", "limits": [1]},
        f"density, {RESOLUTION / 1e3:g} kHz": {"action": "density", "width": RESOLUTION},
    }
    if n <= ASSEMBLED:
        tasks |= {"product K u, CSR": {"compiled": False}, "assembly of K": {"action": "assembly"}}
    if n <= FACTORED:
        tasks["one exact count"] = {"action": "count", "at": COUNT_AT}
        tasks[f"lowest {FEW} modes"] = {"action": "modes", "which": "lowest", "limits": [FEW]}
    return tasks


def row_of(job: Job, curve: str, x: int, given: dict[str, Any], bare: float) -> dict[str, Any]:
    """One point; the memory beyond the `bare` interpreter, MB, or what a product moves."""
    task, path = act if "action" in given else products, str(job.folder / FILE)
    run = job.measured(task, must=False, path=path, **given)
    row: dict[str, Any] = {"curve": curve, "x": x, "seconds": run.seconds, "mb": None}
    if run.failure:
        return row | {"result": run.failure}
    if task is products:
        return row | {"seconds": run.seconds / repetitions(x), "mb": run.value / 1e6}
    return row | {"mb": max(run.peak_mb - bare, 1e-3), "result": run.value}


def run(job: Job) -> Page:
    """Every curve at every size."""
    sample, bare, rows = sample_or_small(500, job.quick), job.measured(nothing).peak_mb, []
    for size in SIZES[job.quick]:
        network = resized(sample, size)
        n = network.n_particles
        job.write(network)
        del network  # the tasks need the memory
        points = curves(n, job.quick).items()
        rows += [row_of(job, curve, n, given, bare) for curve, given in points]
    names = list(dict.fromkeys(row["curve"] for row in rows))
    rows.sort(key=lambda row: names.index(row["curve"]))
    task = (
        "Seconds are processor time of one thread. Memory is what a task needs beyond the bare "
        "interpreter; of a product, the bytes that it has to move. x: spheres. From the whole "
        "sample on it is repeated sideways: its length stays, its cross-section grows. Exponents "
        "are fitted to the larger half of the points."
    )
    return Page(TITLE, task, {"scaling": rows}, notes(rows), {"scaling": draw(rows)})


def draw(rows: Rows) -> Figure:
    """Seconds and megabytes."""
    figure, axes = diagram.panels(1, 2, width=4.6, height=3.9)
    for ax, quantity, label in (
        (axes[0, 0], "seconds", "processor time (s)"),
        (axes[0, 1], "mb", "memory (MB)"),
    ):
        for k, curve in enumerate(dict.fromkeys(row["curve"] for row in rows)):
            own = [row for row in rows if row["curve"] == curve]
            diagram.curve(ax, own, "x", quantity, label=curve, **diagram.look(k))
        ax.set(xlabel="number of spheres", ylabel=label)
        diagram.decades(ax)
    diagram.legend_below(figure, axes[0, 0])
    return figure


def notes(rows: Rows) -> list[str]:
    """Exponents, and the largest point of each curve."""
    said = []
    for curve in dict.fromkeys(row["curve"] for row in rows):
        own = [row for row in rows if row["curve"] == curve and row["seconds"]]
        if own:
            last, slopes = own[-1], [exponent(own, quantity) for quantity in ("seconds", "mb")]
            grow = ", ".join("-" if slope is None else f"n^{slope:.2f}" for slope in slopes)
            said.append(
                f"{curve}: {last['seconds']:.3g} s and {last['mb']:.3g} MB at n = {last['x']:.0f}; "
                f"seconds and bytes grow as {grow}."
            )
    return said
