"""Run time and memory of the modes against the number of spheres and against the number of modes.

    python -m benchmarks.modes_scaling [--quick] [--network FILE] [-o DIR]

Smaller packings are the lower parts of the sample, cut off by a wall, so they stay as slender;
larger ones are the sample repeated sideways. Writes modes_scaling.csv and modes_scaling.png with
the exponents fitted to the points, and prints the table. Factorisations stop at 120,000 spheres.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from benchmarks.modes import SAMPLE, best_of, modal
from benchmarks.report import table
from modal import gallery
from modal.network import RECEIVER_WALL, Network, write_network
from modal.operator import ContactOperator
from modal.random_packing import random_network
from modal.sample import read_packing
from modal.storage import InputError

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

SIZES = (1_000, 3_000, 10_000, 35_000, 105_000, 1_000_000)
MODES = (10, 30, 100, 300)
FACTOR_LIMIT = 120_000
"""Spheres up to which something is factorised."""


def resized(sample: Network, spheres: int) -> Network:
    """The lower part of the sample, or copies of it side by side, with about `spheres` spheres.

    What the lower part touches above the cut is held fast, as a wall does.
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
    i, j = sample.particle_i.copy(), sample.particle_j.copy()
    normal, levers = sample.normal.copy(), [sample.lever_i.copy(), sample.lever_j.copy()]
    turn = ~kept[i] & (j >= 0) & kept[j]
    i[turn], j[turn] = j[turn], i[turn]
    normal[turn] *= -1
    levers[0][turn], levers[1][turn] = sample.lever_j[turn], sample.lever_i[turn]
    cut = kept[i] & (j >= 0) & ~kept[j]
    levers[1][cut] = 0
    shift = np.where(turn[:, None], -sample.cell_shift, sample.cell_shift)
    shift[cut] = 0
    inside = j >= 0
    j[inside & ~cut] = place[j[inside & ~cut]]
    j[cut] = RECEIVER_WALL
    some = kept[i]
    height = float(sample.position[kept, 2].max() + sample.radius[kept].max())
    return replace(
        sample,
        **{k: getattr(sample, k)[kept] for k in ("position", "radius", "mass", "inertia")},
        particle_i=place[i[some]],
        particle_j=j[some],
        normal=normal[some],
        lever_i=levers[0][some],
        lever_j=levers[1][some],
        cell_shift=shift[some],
        stiffness_normal=sample.stiffness_normal[some],
        stiffness_tangential=sample.stiffness_tangential[some],
        force_normal=sample.force_normal[some],
        force_tangential=np.where(turn[:, None], -1, 1)[some] * sample.force_tangential[some],
        overlap=sample.overlap[some],
        sliding=sample.sliding[some],
        wall_position=np.array([sample.wall_position[0], height]),
    )


def measure(name: str, x: int, *command: Any) -> dict[str, Any]:
    """One point of a curve by the command line; empty where the command fails."""
    row = {"curve": name, "x": x, "seconds": None, "peak_gb": None}
    try:
        found = modal(*command)
    except InputError as error:
        print(f"{name}, {x}: {error}", file=sys.stderr)
        return row
    return row | {"seconds": found["seconds"], "peak_gb": found["peak_memory_bytes"] / 1e9}


def run(quick: bool = False, network_file: str | None = None) -> list[dict[str, Any]]:
    """Rows curve, x (spheres, or modes for the last curve), seconds, peak_gb."""
    if quick and network_file is None:
        sample = random_network(300, 1e5, seed=1, aspect=5.0)
    else:
        sample = read_packing(network_file or SAMPLE)
    sizes, numbers = ((100, 300, 600), (5, 10, 20)) if quick else (SIZES, MODES)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "packing.network.h5"
        for size in sizes:
            network = resized(sample, size)
            n = network.n_particles
            write_network(path, network)
            operator, u = ContactOperator(network), np.ones(6 * n)
            out = np.empty_like(u)
            operator.apply(u, out)
            seconds = best_of(10, lambda A=operator, u=u, out=out: A.apply(u, out))
            rows.append({"curve": "product K u", "x": n, "seconds": seconds, "peak_gb": None})
            rows.append(measure("density, 10 kHz", n, "density", path, "--resolution", 1e4))
            if n <= FACTOR_LIMIT:
                rows.append(measure("highest mode", n, "modes", path, "--highest", 1))
                rows.append(measure("one exact count", n, "count", path, "--at", 2e4))
                rows.append(measure("lowest 10 modes", n, "modes", path, "--lowest", 10))
        write_network(path, sample)
        for number in numbers:
            name = f"lowest modes of {sample.n_particles} spheres"
            rows.append(measure(name, number, "modes", path, "--lowest", number))
    return rows


def exponent(rows: list[dict[str, Any]], quantity: str) -> float | None:
    """Slope of log quantity over log x through the larger half of the points, None if too few."""
    points = [(row["x"], row[quantity]) for row in rows if row[quantity]]
    points = points[-max(2, (len(points) + 1) // 2) :]
    if len(points) < 2:
        return None
    x, y = np.log(np.array(points, float)).T
    return float(np.polyfit(x, y, 1)[0])


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Seconds over spheres, memory over spheres, seconds over modes; exponents in the legends."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 4), layout="constrained")
    for name in dict.fromkeys(row["curve"] for row in rows):
        curve = [row for row in rows if row["curve"] == name]
        over_modes = "spheres" in name
        for quantity, ax in (("seconds", axes[2 if over_modes else 0]), ("peak_gb", axes[1])):
            points = [(row["x"], row[quantity]) for row in curve if row[quantity]]
            if not points or (over_modes and quantity == "peak_gb"):
                continue
            slope = exponent(curve, quantity)
            label = name if slope is None else f"{name}: {slope:.2f}"
            ax.loglog(*zip(*points, strict=True), "o-", label=label)
    labels = (("spheres", "run time, s"), ("spheres", "peak memory, GB"), ("modes", "run time, s"))
    for ax, (x, y) in zip(axes, labels, strict=True):
        ax.set(xlabel=f"number of {x}", ylabel=y)
        if ax.lines:
            ax.legend(title="exponent", fontsize=7)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main(argv: list[str] | None = None) -> int:
    """Measure, write table and figure; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="packings of up to 600 spheres")
    parser.add_argument("--network", metavar="FILE", help="this sample or network instead")
    parser.add_argument("-o", "--output", default="results/benchmarks", metavar="DIR")
    options = parser.parse_args(argv)
    rows = run(options.quick, options.network)
    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "modes_scaling.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    draw(rows, folder / "modes_scaling.png")
    print(table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
