"""Growth of seconds and bytes with the number of spheres.

Smaller packings are lower parts of the sample of case 6; larger ones are the sample repeated
sideways. `python -m benchmarks contact_loop` measures the least time that a product K u could take,
`python -m benchmarks questions` the gain of more threads for whole commands.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.harness import diagram
from benchmarks.harness.measure import Job
from benchmarks.harness.packing import bytes_of, resized, sample_or_small
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
MAX_ASSEMBLED_SPHERES = 150_000
"""Spheres up to which K is assembled; three times as many need 10 GB."""
MAX_FACTORED_SPHERES = 40_000
"""Spheres up to which K is factorised; three times as many need 7 GB and minutes."""
PRODUCTS = 400_000
"""Products that are timed together, times the number of spheres; at least 20."""
CONTACTS = "product K u, contacts"
CSR = "product K u, CSR"


def modes(network: Network, which: str, count: int) -> str:
    """Compute the highest or lowest modes, and return how they were computed."""
    system = LinearSystem.of(network, shapes=False)
    computed = modes_of(system, certify=which == "lowest", **{which: count})
    exact = "certified" if computed.attributes["certified"] else "not certified"
    last = computed.frequency[-1]
    solver = computed.attributes["solver"]
    return f"{len(computed.frequency)} modes to {last:.0f} Hz, {exact}, {solver}"


ACTIONS: dict[str, Callable[[Network], str]] = {
    "linear wave, 0.6 ms": lambda net: f"{propagate(net, 6e-4, whole=True).products} products",
    "highest mode": lambda net: modes(net, "highest", 1),
    "density, 10 kHz": lambda net: f"{density_of_states(net, resolution=1e4).products} products",
    "assembly of K": lambda net: f"{stiffness_matrix(net).nnz} nonzeros",
    "one exact count": lambda net: f"{count_below(LinearSystem.of(net), 2e4)} modes",
    "lowest 10 modes": lambda net: modes(net, "lowest", 10),
}
"""Actions on a network; each returns the text of the result for the table."""
MAX_SPHERES = {
    CSR: MAX_ASSEMBLED_SPHERES,
    "assembly of K": MAX_ASSEMBLED_SPHERES,
    "one exact count": MAX_FACTORED_SPHERES,
    "lowest 10 modes": MAX_FACTORED_SPHERES,
}
"""Spheres of the largest packing of an action."""


def compile_loop() -> None:
    """Compile the loop over contacts, whose time and memory are no part of a task."""
    ContactOperator(gallery.column(2)).apply(np.ones(12))


def nothing() -> Callable[[], None]:
    """Prepare an empty task, which measures the memory of the interpreter and the imports."""
    compile_loop()
    return lambda: None


def repetitions(spheres: int) -> int:
    """Return the number of products that are timed together: enough for the clock."""
    return max(20, PRODUCTS // spheres)


def products(path: str, curve: str) -> Callable[[], float]:
    """Prepare the task of products K u by contacts or CSR; it returns the bytes of one."""
    network = read_network(path)
    u = np.ones(6 * network.n_particles)
    out = np.zeros_like(u)
    count = repetitions(network.n_particles)
    if curve == CONTACTS:
        compile_loop()
        operator = ContactOperator(network)

        def multiply_by_contacts() -> float:
            for _ in range(count):
                operator.combine(u, out, 1.0, 0.0, 1.0)
            return bytes_of(operator)

        return multiply_by_contacts
    matrix = stiffness_matrix(network)

    def multiply_by_matrix() -> float:
        for _ in range(count):
            matrix @ u
        return bytes_of(matrix)

    return multiply_by_matrix


def act(path: str, curve: str) -> Callable[[], str]:
    """Prepare the task of one of `ACTIONS`."""
    compile_loop()
    network = read_network(path)
    return lambda: ACTIONS[curve](network)


def row_of(job: Job, path: str, curve: str, x: int, bare: float) -> dict[str, Any]:
    """Return one point: seconds and memory, MB, beyond the `bare` interpreter or of a product."""
    task = act if curve in ACTIONS else products
    run = job.measured(task, must=False, path=path, curve=curve)
    row: dict[str, Any] = {"curve": curve, "x": x, "seconds": run.seconds, "mb": None}
    if run.failure:
        return row | {"result": run.failure}
    if task is products:
        return row | {"seconds": run.seconds / repetitions(x), "mb": run.value / 1e6}
    return row | {"mb": max(run.peak_mb - bare, 1e-3), "result": run.value}


def run(job: Job) -> Page:
    """Measure every curve at every size."""
    sample = sample_or_small(500, job.quick)
    bare = job.measured(nothing).peak_mb
    rows: Rows = []
    for size in SIZES[job.quick]:
        network = resized(sample, size)
        n = network.n_particles
        path = job.write(network)
        del network  # the tasks need the memory
        curves = [curve for curve in (CONTACTS, CSR, *ACTIONS) if n <= MAX_SPHERES.get(curve, n)]
        rows += [row_of(job, path, curve, n, bare) for curve in curves]
    rows.sort(key=lambda row: (CONTACTS, CSR, *ACTIONS).index(row["curve"]))
    task = (
        "Seconds are processor time of one thread. Memory is what a task needs beyond the bare "
        "interpreter; of a product, the bytes that it has to move. x: spheres. From the whole "
        "sample on it is repeated sideways: its length stays, its cross-section grows. Exponents "
        "are fitted to the larger half of the points."
    )
    shown = [row | {"method": row["curve"]} for row in rows]
    figure = diagram.work_precision(shown, {"x": "number of spheres"}, ("seconds", "mb"))
    return Page(TITLE, task, {"scaling": rows}, notes(rows), {"scaling": figure})


def notes(rows: Rows) -> list[str]:
    """Return lines with the exponents and the largest point of each curve."""
    lines = []
    for curve in dict.fromkeys(row["curve"] for row in rows):
        points = [row for row in rows if row["curve"] == curve and row["seconds"]]
        if points:
            largest = points[-1]
            powers = [_describe_growth(points, quantity) for quantity in ("seconds", "mb")]
            lines.append(
                f"{curve}: {largest['seconds']:.3g} s and {largest['mb']:.3g} MB "
                f"at n = {largest['x']:.0f}; seconds and bytes grow as {', '.join(powers)}."
            )
    return lines


def _describe_growth(points: Rows, quantity: str) -> str:
    """Return the power of n with which a quantity grows as a text."""
    exponent = diagram.exponent(points, quantity)
    if exponent is None:
        return "-"
    return f"n^{exponent:.2f}"
