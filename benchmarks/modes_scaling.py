"""Seconds and bytes of the modes against the number of spheres and against the number of modes.

Smaller packings are the lower parts of the sample of case 6, cut off by a wall, so they stay as
slender; larger ones are the sample repeated sideways. Whatever factorises stops at 120,000 spheres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks import diagram
from benchmarks.measure import attempted, measured
from benchmarks.modes import SAMPLE
from benchmarks.report import Finding
from modal import gallery
from modal.density import density_of_states
from modal.eigenproblem import Eigenproblem
from modal.inertia import count_below
from modal.intervals import lowest_modes
from modal.modes import highest_modes
from modal.network import Network, read_network, write_network
from modal.operator import ContactOperator
from modal.random_packing import random_network
from modal.sample import read_packing

TITLE = "Modes: seconds and bytes against the number of spheres and of modes"
SIZES = {True: (100, 300, 600), False: (1_000, 3_000, 10_000, 35_201, 105_603, 985_628)}
MODES = {True: (5, 10, 20), False: (10, 30, 100, 300)}
FACTOR_LIMIT = 120_000
"""Spheres up to which something is factorised."""
PRODUCTS = 20
"""Products that are timed together."""
COUNT_AT, RESOLUTION, FEW = 2e4, 1e4, 10
"""Hz of the exact count; Hz of the density of states; lowest modes against the size."""


def resized(sample: Network, spheres: int) -> Network:
    """The lower part of the sample, or copies of it side by side, with about `spheres` spheres.

    The lower part's upper end is free: what it touches above the cut is gone.
    """
    if spheres > 1.5 * sample.n_particles:
        times = max(1, round(spheres / sample.n_particles))
        across = max(d for d in range(1, int(np.sqrt(times)) + 1) if times % d == 0)
        return gallery.repeat(sample, times // across, across)
    if spheres >= sample.n_particles:
        return sample
    kept = np.zeros(sample.n_particles, bool)
    kept[np.argsort(sample.position[:, 2], kind="stable")[:spheres]] = True
    place = np.cumsum(kept) - 1
    i, j = sample.particle_i, sample.particle_j
    part = sample.with_contacts(kept[i] & ((j < 0) | kept[j]))
    j = part.particle_j
    height = float((sample.position[:, 2] + sample.radius)[kept].max())
    return replace(
        part,
        **{k: getattr(sample, k)[kept] for k in ("position", "radius", "mass", "inertia")},
        particle_i=place[part.particle_i],
        particle_j=np.where(j < 0, j, place[j]),
        wall_position=np.array([sample.wall_position[0], height]),
    )


def _loaded(path: str) -> Network:
    """The network; what compiling the loop takes is behind us."""
    ContactOperator(gallery.column(2)).apply(np.ones(12))
    return read_network(path)


def nothing() -> Callable[[], None]:
    """Task: what the interpreter and the imports hold."""
    ContactOperator(gallery.column(2)).apply(np.ones(12))
    return lambda: None


def product(path: str) -> Callable[[], str]:
    """Task: `PRODUCTS` products K u without a matrix."""
    operator = ContactOperator(_loaded(path))
    u = np.ones(operator.shape[0])
    out = np.zeros_like(u)

    def action() -> str:
        for _ in range(PRODUCTS):
            operator.accumulate(u, out)
        return ""

    return action


def highest(path: str) -> Callable[[], str]:
    """Task: the highest mode; returns its frequency."""
    network = _loaded(path)

    def action() -> str:
        modes = highest_modes(Eigenproblem.of(network, shapes=False), 1, certify=False)
        return f"{modes.frequency[0]:.0f} Hz, residual {modes.residual[0]:.1e}"

    return action


def density(path: str) -> Callable[[], str]:
    """Task: the density of states, floppy modes split off; returns its products."""
    network = _loaded(path)

    def action() -> str:
        zero_modes = Eigenproblem.of(network).floppy.basis
        states = density_of_states(network, resolution=RESOLUTION, zero_modes=zero_modes)
        return f"{states.products} products"

    return action


def counted(path: str) -> Callable[[], str]:
    """Task: one exact count; returns it."""
    network = _loaded(path)
    return lambda: f"{count_below(Eigenproblem.of(network), COUNT_AT)} modes"


def lowest(path: str, number: int) -> Callable[[], str]:
    """Task: the lowest elastic modes; returns how they were found."""
    network = _loaded(path)

    def action() -> str:
        modes = lowest_modes(Eigenproblem.of(network, shapes=False), number)
        certified = "certified" if modes.attributes["certified"] else "not certified"
        return f"{certified}, {modes.attributes['solver']}"

    return action


def run(quick: bool, folder: Path) -> Finding:
    """Every size, then every number of modes of the whole sample."""
    sample = random_network(300, 1e5, seed=1, aspect=5.0) if quick else read_packing(SAMPLE)
    path = folder / "modes_scaling.network.h5"
    bare = measured("benchmarks.modes_scaling:nothing", times=3).peak_mb

    def row(curve: str, x: int, task: str, divisor: int = 1, **arguments: Any) -> dict[str, Any]:
        run = attempted(f"benchmarks.modes_scaling:{task}", path=str(path), **arguments)
        found: dict[str, Any] = {"curve": curve, "x": x, "seconds": None, "mb": None}
        if run.failure:
            return found | {"result": run.failure}
        found |= {"seconds": run.seconds / divisor, "mb": max(run.peak_mb - bare, 1e-3)}
        return found | {"result": run.value}

    rows = []
    for size in SIZES[quick]:
        network = resized(sample, size)
        write_network(path, network)
        n = network.n_particles
        del network
        rows.append(row("product K u", n, "product", PRODUCTS))
        rows.append(row("highest mode", n, "highest"))
        rows.append(row(f"density, {RESOLUTION / 1e3:g} kHz", n, "density"))
        if n <= FACTOR_LIMIT:
            rows.append(row("one exact count", n, "counted"))
            rows.append(row(f"lowest {FEW} modes", n, "lowest", number=FEW))
    write_network(path, sample)
    over_modes = f"lowest modes of {sample.n_particles} spheres"
    rows += [row(over_modes, number, "lowest", number=number) for number in MODES[quick]]
    curves = list(dict.fromkeys(row["curve"] for row in rows))
    rows.sort(key=lambda row: curves.index(row["curve"]))
    task = (
        "Processor time of one thread; memory is the peak beyond the bare interpreter, the network "
        "itself included. x: spheres, and modes for the last curve. From 35,201 spheres on the "
        "sample is repeated sideways: its length stays, its cross-section grows, and with it the "
        "fill of a factor. Exponents are fitted to the larger half of the points."
    )
    return Finding(TITLE, task, rows, notes(rows, over_modes), {"modes_scaling": draw(rows)})


def exponent(rows: list[dict[str, Any]], quantity: str) -> float | None:
    """Slope of log quantity over log x through the larger half of the points, None if too few."""
    points = [(row["x"], row[quantity]) for row in rows if row[quantity]]
    points = points[-max(2, (len(points) + 1) // 2) :]
    if len(points) < 2:
        return None
    x, y = np.log(np.array(points, float)).T
    return float(np.polyfit(x, y, 1)[0])


def notes(rows: list[dict[str, Any]], over_modes: str) -> list[str]:
    """Exponents, and the largest point of each curve."""
    said = []
    for curve in dict.fromkeys(row["curve"] for row in rows):
        own = [row for row in rows if row["curve"] == curve and row["seconds"]]
        slopes = [exponent(own, quantity) for quantity in ("seconds", "mb")]
        if None in slopes:
            continue
        x, what = ("k", "modes") if curve == over_modes else ("n", "spheres")
        last = own[-1]
        said.append(
            f"{curve}: seconds grow as {x}^{slopes[0]:.2f}, bytes as {x}^{slopes[1]:.2f}; "
            f"{last['seconds']:.3g} s and {last['mb'] / 1e3:.3g} GB at {last['x']} {what}."
        )
    return said


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Seconds and megabytes, over spheres and over modes; exponents in the legends."""
    figure, axes = diagram.panels(2, 2, width=4.4, height=3.4)
    for k, curve in enumerate(dict.fromkeys(row["curve"] for row in rows)):
        own = [row for row in rows if row["curve"] == curve]
        across = 1 if curve.startswith("lowest modes of") else 0
        for down, quantity in enumerate(("seconds", "mb")):
            slope = exponent(own, quantity)
            name = curve if slope is None else f"{curve}: {slope:.2f}"
            diagram.curve(axes[down, across], own, "x", quantity, label=name, **diagram.look(k))
    for (down, across), ax in np.ndenumerate(axes):
        ax.set_xlabel(("number of spheres", "number of modes")[across])
        ax.set_ylabel(("processor time (s)", "peak memory (MB)")[down])
        diagram.decades(ax)
        low, high = ax.get_ylim()
        ax.set_ylim(low, high * (high / low) ** (0.5, 0.1)[across])  # room for the legend
        if ax.lines:
            ax.legend(fontsize=7, title="exponent", title_fontsize=7, loc="upper left")
    return figure
