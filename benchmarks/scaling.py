"""Seconds and bytes against the number of spheres, and the limits of the machine.

Smaller packings are the lower parts of the sample of case 6, so they stay as slender; larger ones
are the sample repeated sideways. A product K u takes at least what it reads over the bytes a second
of this very run, unless a cache holds it, and what it multiplies and adds over the rate of a dense
product: the limits drawn. At the size of the sample every task runs on all cores as well; the
machine must then have nothing else to do.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.harness import diagram, machine, product
from benchmarks.harness.diagram import exponent
from benchmarks.harness.measure import measured
from benchmarks.harness.packing import resized, sample_or_small
from benchmarks.harness.report import Page, Rows
from modal.modes.counts import count_below
from modal.modes.density import density_of_states
from modal.modes.eigenmodes import highest_modes
from modal.modes.lowest import lowest_modes, modes_between
from modal.packing import crystal as gallery
from modal.packing.network import Network, read_network, write_network
from modal.system.assembly import stiffness_matrix
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator
from modal.waves.propagate import propagate

TITLE = "Scaling: seconds and bytes against the number of spheres, and all cores"
SIZES = {True: (125, 250, 500), False: (1_000, 6_000, 35_201, 105_603, 985_628)}
MODES = {True: 20, False: 100}
"""Number of lowest modes of the whole sample."""
BAND = {True: (2e4, 3e4), False: (1.95e4, 2e4)}
"""Ends, Hz, of the interval whose modes are all found."""
ASSEMBLED, FACTORED = 150_000, 40_000
"""Spheres up to which K is assembled (three times as many: 10 GB), and up to which it is factorised
(three times as many: 7 GB and minutes)."""
DURATION = {True: 6e-5, False: 6e-4}
PRODUCTS = 400_000
"""Products that are timed together, times the number of spheres; at least 20."""
CORES = os.cpu_count() or 1
LIMITS = (("seconds_limit", "memory", "-"), ("seconds_arithmetic", "arithmetic", ":"))
"""Columns of the least times of a product, what sets them, and how they are drawn."""
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


def products(path: str, compiled: bool) -> Callable[[], product.Needs]:
    """Task: products K u by the contact operator or by the CSR matrix; returns what each needs."""
    network = read_network(path)
    u = np.ones(6 * network.n_particles)
    out = np.zeros_like(u)
    if compiled:
        compile_loop()
        operator = ContactOperator(network)
        needs, multiply = product.of_operator(operator), lambda: operator.accumulate(u, out)
    else:
        matrix = stiffness_matrix(network)
        needs, multiply = product.of_matrix(matrix), lambda: matrix @ u

    def action() -> product.Needs:
        for _ in range(repetitions(network.n_particles)):
            multiply()
        return needs

    return action


def modes(network: Network, which: str, limits: Sequence[float]) -> str:
    """The highest or lowest modes, or all between two frequencies; how they were found."""
    top = partial(highest_modes, certify=False)
    find = {"highest": top, "lowest": lowest_modes, "between": modes_between}[which]
    found = find(LinearSystem.of(network, shapes=False), *limits)
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


class Sweep:
    """Measures tasks on the network of one file."""

    def __init__(self, folder: Path, quick: bool, rates: tuple[float, float]) -> None:
        self.path, self.quick, self.rates = str(folder / "scaling.network.h5"), quick, rates
        self.bare = measured("benchmarks.scaling:nothing", times=3).peak_mb

    def row(self, curve: str, x: int, given: dict[str, Any], threads: int = 1) -> dict[str, Any]:
        """One point; of a product, the bytes that it moves, and the least time for both limits."""
        task = "act" if "action" in given else "products"
        how = {"times": 1 if self.quick else 3, "threads": threads}
        run = measured(f"benchmarks.scaling:{task}", must=False, path=self.path, **how, **given)
        row: dict[str, Any] = {"curve": curve, "x": x, "threads": threads}
        row |= {"seconds": None, "mb": None}
        if run.failure:
            return row | {"result": run.failure}
        if task == "products":
            row |= product.limits(run.value, *self.rates)
            mb = run.value["bytes"] / 1e6
            return row | {"seconds": run.seconds / repetitions(x), "mb": mb}
        mb = max(run.peak_mb - self.bare, 1e-3)
        return row | {"seconds": run.seconds, "mb": mb, "result": run.value}


def run(quick: bool, folder: Path) -> Page:
    """Every size, then the whole sample on one thread and on all."""
    sample = sample_or_small(500, quick)
    rates = machine.bandwidth(32.0 if quick else 256.0)
    arithmetic = machine.arithmetic()
    sweep, rows = Sweep(folder, quick, (max(rates.values()), arithmetic)), []
    for size in SIZES[quick]:
        network = resized(sample, size)
        n = network.n_particles
        write_network(sweep.path, network)
        del network  # the tasks need the memory
        rows += [sweep.row(curve, n, given) for curve, given in curves(n, quick).items()]
    names = list(dict.fromkeys(row["curve"] for row in rows))
    rows.sort(key=lambda row: names.index(row["curve"]))
    cores = cores_rows(
        sweep, sample, {row["curve"]: row for row in rows if row["x"] == sample.n_particles}
    )
    task = (
        "Seconds of one thread are its processor time, of several the time by the clock. Memory "
        "is what a task needs beyond the bare interpreter; of a product, the bytes that it has to "
        "move. `seconds_limit` is those bytes over the bandwidth of this run, "
        + ", ".join(f"{name} {rate / 1e9:.1f} GB/s" for name, rate in rates.items())
        + f" on one core; `seconds_arithmetic` its operations over {arithmetic / 1e9:.1f} a "
        "nanosecond, those of a dense product on one core. x: spheres. From the whole sample on it "
        "is repeated sideways: its length stays, its cross-section grows. Exponents are fitted to "
        "the larger half of the points."
    )
    said = notes(rows) + notes_on_cores(cores)
    return Page(TITLE, task, {"scaling": rows, "cores": cores}, said, {"scaling": draw(rows)})


def cores_rows(sweep: Sweep, sample: Network, known: dict[str, dict[str, Any]]) -> Rows:
    """Every task and many modes on one thread, where its row is not known, and on all."""
    n, rows = sample.n_particles, []
    (low, high), most = BAND[sweep.quick], MODES[sweep.quick]
    tasks = curves(n, sweep.quick)
    for name, which, limits in (
        (f"lowest {most} modes", "lowest", [most]),
        (f"all modes from {low:g} to {high:g} Hz", "between", [low, high]),
    ):
        tasks[name] = {"action": "modes", "which": which, "limits": limits}
    write_network(sweep.path, sample)
    for name, given in tasks.items():
        rows += [known.get(name) or sweep.row(name, n, given), sweep.row(name, n, given, CORES)]
    return rows


def draw(rows: Rows) -> Figure:
    """Seconds, with the limits of the products, and megabytes."""
    figure, axes = diagram.panels(1, 2, width=4.6, height=3.9)
    names = list(dict.fromkeys(row["curve"] for row in rows))
    for ax, quantity, label in (
        (axes[0, 0], "seconds", "processor time (s)"),
        (axes[0, 1], "mb", "memory (MB)"),
    ):
        for k, curve in enumerate(names):
            own = [row for row in rows if row["curve"] == curve]
            diagram.curve(ax, own, "x", quantity, label=curve, **diagram.look(k))
            if quantity == "seconds" and own[0].get("seconds_limit"):
                style = diagram.look(k) | {"marker": None, "lw": 0.7}
                for column, what, dash in LIMITS:
                    name = f"{what} limit of {curve}"
                    diagram.curve(ax, own, "x", column, label=name, **style | {"ls": dash})
        ax.set(xlabel="number of spheres", ylabel=label)
        diagram.decades(ax)
    diagram.legend_below(figure, axes[0, 0])
    return figure


def notes(rows: Rows) -> list[str]:
    """Exponents, the largest point of each curve, and how near to both limits the products are."""
    said = []
    for curve in dict.fromkeys(row["curve"] for row in rows):
        own = [row for row in rows if row["curve"] == curve and row["seconds"]]
        if not own:
            continue
        last = own[-1]
        text = f"{curve}: {last['seconds']:.3g} s and {last['mb']:.3g} MB at n = {last['x']:.0f}"
        for quantity, growing in (("seconds", "seconds"), ("mb", "bytes")):
            slope = exponent(own, quantity)
            text += "" if slope is None else f", {growing} grow as n^{slope:.2f}"
        for column, what, _ in LIMITS:
            if last.get(column):
                text += f", {last['seconds'] / last[column]:.2g} times the limit of {what}"
        said.append(text + ".")
    return said


def notes_on_cores(rows: Rows) -> list[str]:
    """What the other cores bring."""
    pairs = zip(rows[::2], rows[1::2], strict=True)
    return [
        f"{one['curve']}, {one['x']} spheres: {one['seconds'] / both['seconds']:.2f} times faster "
        f"on {both['threads']} threads, {both['seconds']:.3g} s."
        for one, both in pairs
        if one["seconds"] and both["seconds"]
    ]
