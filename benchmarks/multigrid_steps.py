"""Steps of multigrid against size, contacts, width and contrast of a packing.

Runs only when it is named. The task is always the same: the six elastic moduli by conjugate
gradients with a cycle of multigrid in each step, whose number of products with K is the number of
steps.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.harness.measure import ROOT, Job
from benchmarks.harness.report import Page, Rows
from benchmarks.scaling import compile_loop
from modal.elasticity.static_response import elastic_moduli
from modal.exchange.registry import read
from modal.packing.crystal import fcc
from modal.packing.network import Network

TITLE = "Multigrid: steps against size, contacts, width and contrast"
SIZES = {True: (600,), False: (4_000, 20_000, 50_000)}
"""Spheres of periodic cubes without friction."""
CASES = {True: (), False: ("08", "07", "06", "05", "32", "31", "30", "29")}
"""Committed samples of 35,201 spheres, from most to fewest contacts."""
WIDTHS = {True: (), False: (7, 14, 28)}
"""Widths, in diameters, of cells of 8,000 spheres without friction."""
CONTRASTS = {True: (1e2,), False: (1e1, 1e2, 1e3, 1e6)}
"""Largest stiffness of a contact divided by the smallest."""
PACK = "modal pack --friction 0 --periodic --stress 1e5"


def with_contrast(network: Network, contrast: float) -> Network:
    """Return the packing with stiffnesses spread evenly in their logarithm over a contrast."""
    random = np.random.default_rng(1)
    factor = contrast ** (random.random(network.n_contacts) - 0.5)
    return replace(
        network,
        stiffness_normal=factor * network.stiffness_normal,
        stiffness_tangential=factor * network.stiffness_tangential,
    )


def moduli(path: str, contrast: float) -> Callable[[], dict[str, Any]]:
    """Prepare the moduli of a packing; they return its size, contacts, steps and error."""
    compile_loop()
    network = read(path)
    if contrast > 1:
        network = with_contrast(network, contrast)

    def compute() -> dict[str, Any]:
        result = elastic_moduli(network, solver="multigrid")
        return {
            "spheres": network.n_particles,
            "contacts_a_sphere": network.coordination_number,
            "steps": result.products,
            "error": result.error,
        }

    return compute


def compile_cycles() -> Callable[[], None]:
    """Leave the loops of multigrid, for few spheres and for many, in the cache of numba."""
    for cells in ((2, 2, 4), (10, 10, 16)):
        elastic_moduli(fcc(cells=cells, periodic_z=True), solver="multigrid")
    return lambda: None


def run(job: Job) -> Page:
    """Make or find each packing, and compute its moduli."""
    job.measured(compile_cycles, must=False)

    def packed(folder: str, *options: object) -> str:
        job.command(*PACK.split(), *map(str, options), "-o", folder)
        (path,) = (job.folder / folder).glob("*.sample.h5")
        return str(path)

    cubes = {n: packed(f"cube{n}", "--spheres", n, "--aspect", 1) for n in SIZES[job.quick]}
    tasks = [("size", f"cube of {n}", path, 1.0) for n, path in cubes.items()]
    for case in CASES[job.quick]:
        path = str(ROOT / f"results/samples/case{case}.sample.h5")
        tasks.append(("contacts", f"case {int(case)}", path, 1.0))
    for width in WIDTHS[job.quick]:
        path = packed(f"width{width}", "--spheres", 8000, "--width", width)
        tasks.append(("width", f"{width} D wide", path, 1.0))
    smallest = cubes[min(cubes)]
    for contrast in CONTRASTS[job.quick]:
        tasks.append(("contrast", f"contrast {contrast:.0e}", smallest, contrast))
    rows: Rows = []
    for series, name, path, contrast in tasks:
        done = job.measured(moduli, must=False, path=path, contrast=contrast)
        row = {"series": series, "packing": name, **(done.value or {}), **done.cost}
        rows.append(row)
        print(*(f"{column} {value}" for column, value in row.items()), sep=", ", flush=True)
    task = (
        "Seconds are processor time of one thread, memory the peak of the process, errors are "
        "relative errors of the moduli."
    )
    return Page(TITLE, task, {"multigrid_steps": rows}, [], {})
