"""One thread and all: products, and whole commands of the study's sample and of larger ones.

Wall-clock time on all cores, so the machine must have nothing else to do. Larger samples are that
of case 6 repeated sideways. `python -m benchmarks.cores FILE` times the product K u alone.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import diagram, machine
from benchmarks.harness.diagram import exponent
from benchmarks.harness.measure import ROOT
from benchmarks.harness.packing import SAMPLE, STRESS
from benchmarks.harness.report import Page, Rows
from modal.packing.reading import read_packing
from modal.packing.sample import read_sample, sample_of_network, write_sample
from modal.preparation.random_packing import random_network
from modal.stiffness.operator import ContactOperator

TITLE = "One thread and all cores"
COPIES = {True: ((2, 1),), False: ((2, 2), (7, 4), (17, 17))}
"""Repetitions of the sample: up to ten million spheres, for which 16 GB must be free."""
COMMANDS = {
    "wave, 0.6 ms": ("wave", "--duration", "6e-4"),
    "exact count at 20 kHz": ("count", "--at", "20000"),
    "density, 2 kHz, 0.5 %": ("density", "--resolution", "2000", "--tolerance", "0.005"),
    "lowest 100 modes": ("modes", "--lowest", "100"),
    "all modes below 20 kHz": ("modes", "--below", "20000"),
}
TIMES = {True: 1, False: 3}
SHORT = 20.0
"""Seconds up to which a command is repeated; the best counts."""
PRODUCTS = 200


def best_product(path: str) -> dict[str, float]:
    """Least seconds of a product K u, and the bytes that it has to move."""
    operator = ContactOperator(read_packing(path), mass_scaled=True)
    u = np.random.default_rng(1).standard_normal(operator.shape[0])
    out = np.zeros_like(u)
    seconds = []
    for _ in range(PRODUCTS):
        start = time.perf_counter()
        operator.accumulate(u, out, 1e-12)
        seconds.append(time.perf_counter() - start)
    contacts, scale = operator._contacts, operator._scale
    moved = contacts.rows.nbytes + contacts.ends.nbytes + scale.nbytes + 3 * u.nbytes
    return {"seconds": min(seconds), "bytes": float(moved)}


def run_json(arguments: list[str], threads: int) -> dict[str, Any]:
    """The JSON object of a Python module, with the seconds of the whole process."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
        environment[name] = str(threads)
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", *arguments], env=environment, cwd=ROOT, capture_output=True
    )
    wall = time.perf_counter() - start
    if done.returncode:
        return {"result": done.stderr.decode().strip().splitlines()[-1]}
    return json.loads(done.stdout) | {"wall": wall}


def rows_of(task: str, spheres: int, arguments: list[str], times: int, all_cores: bool) -> Rows:
    """A command on one thread, and on all; the best of `times` runs if these are short."""
    rows: Rows = []
    for threads in dict.fromkeys((1, os.cpu_count() or 1) if not all_cores else (os.cpu_count(),)):
        found = [run_json([*arguments, "--json"], threads)]
        while len(found) < times and found[0].get("wall", SHORT) < SHORT:
            found.append(run_json([*arguments, "--json"], threads))
        row = {"task": task, "spheres": spheres, "threads": threads}
        best = min(found, key=lambda run: run.get("wall", np.inf))
        mb = best["peak_memory_bytes"] / 1e6 if "wall" in best else None
        rows.append(row | {"seconds": best.get("wall"), "mb": mb, "result": best.get("result")})
    return rows


def run(quick: bool, folder: Path) -> Page:
    """Products, commands, and the wave of ever larger samples."""
    sample = (
        sample_of_network(random_network(500, STRESS, seed=1), 0.1)
        if quick
        else read_sample(SAMPLE)
    )
    n = len(sample.position)
    path, foreign = folder / "own.sample.h5", folder / "foreign.sample.h5"
    write_sample(path, sample)
    number = np.random.default_rng(1).permutation(n)
    write_sample(foreign, replace(sample, position=sample.position[number], shear=None))
    rate = max(machine.bandwidth(32.0 if quick else 256.0).values())
    rows: Rows = []
    for name, file in (("K u", path), ("K u, numbered at random", foreign)):
        for threads in dict.fromkeys((1, os.cpu_count() or 1)):
            found = run_json(["benchmarks.cores", str(file)], threads)
            limit = {"seconds_limit": found["bytes"] / rate}
            row = {"task": name, "spheres": n, "threads": threads}
            rows.append(row | {"seconds": found["seconds"]} | limit)
    for task, (command, *given) in COMMANDS.items():
        arguments = ["modal", command, str(path), *given]
        rows += rows_of(task, n, arguments, TIMES[quick], all_cores=False)
    wave = COMMANDS["wave, 0.6 ms"]
    curve = [row for row in rows if row["task"] == "wave, 0.6 ms"][-1:]
    for x, y in COPIES[quick]:
        wide = str(folder / "wide.sample.h5")
        repeated = [str(path), "--repeat", str(x), str(y), "-o", wide]
        tiled = run_json(["modal", "tile", *repeated, "--json"], 1)
        if "result" in tiled:
            break
        curve += rows_of("wave, 0.6 ms", n * x * y, ["modal", wave[0], wide, *wave[1:]], 1, True)
    figure, axes = diagram.panels(1, 1, width=4.6, height=3.9)
    diagram.curve(axes[0, 0], curve, "spheres", "seconds", label=wave[0], **diagram.look(0))
    axes[0, 0].set(xlabel="number of spheres", ylabel="seconds, all cores")
    diagram.decades(axes[0, 0])
    slope = exponent([row | {"x": row["spheres"]} for row in curve], "seconds")
    said = [] if slope is None else [f"The wave's seconds grow as n^{slope:.2f}."]
    task = (
        "Wall-clock seconds of whole commands, best of three up to 20 s. `seconds_limit`: the "
        f"bytes of a product over the {rate / 1e9:.1f} GB/s that one core moved in this run."
    )
    return Page(TITLE, task, {"cores": rows, "cores_wave": curve}, said, {"cores": figure})


if __name__ == "__main__":
    print(json.dumps(best_product(sys.argv[1])))
