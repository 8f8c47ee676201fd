"""Lowest modes and moduli of cubes against the number of spheres, by all methods.

Runs only when it is named: the largest cube takes hours and tens of gigabytes. The cubes are
periodic packings without friction at 100 kPa. Each method goes as far as time and memory allow; a
failure stands in the table. What users without this program would take is scipy's `eigsh` about a
shift on the assembled K, or LAMMPS' command `dynamical_matrix` (finite differences of forces
between spheres that do not turn) with LAPACK.
"""

import shutil
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse.linalg import eigsh

from benchmarks.harness import diagram
from benchmarks.harness.lammps import Lammps
from benchmarks.harness.measure import Job
from benchmarks.harness.report import Page, Rows
from benchmarks.multigrid_steps import compile_cycles
from benchmarks.other_codes import lammps
from benchmarks.scaling import compile_loop
from modal.elasticity.static_response import elastic_moduli
from modal.exchange.registry import read
from modal.modes.density import density_of_states
from modal.modes.eigenmodes import modes_of
from modal.modes.zero_modes import by_structure
from modal.packing.network import Network
from modal.system.linear_system import LinearSystem, frequency_of

TITLE = "Cubes: lowest modes and moduli against the number of spheres"
SIZES = {True: (300, 600), False: (4_000, 50_000, 200_000)}
COUNT = 20
"""Number of lowest modes."""
SHIFT = 1e-7
"""Distance below zero of scipy's shift, divided by the largest diagonal entry of A."""
MAX_SPHERES = {
    "LAMMPS": 4_000,
    "scipy": 4_000,
    "factor": 50_000,
    "pardiso": 50_000,
}
"""Spheres up to which a method is tried, by a part of its name. Beyond, a whole matrix of LAMMPS
takes 180 GB, scipy's factor hours by extrapolation, and PARDISO's, which grows as N^(4/3), more
than 30 GB."""


def lowest(network: Network, *, certify: bool, solver: str | None = None) -> str:
    """Find the lowest modes, and return the first and the last one and how they were found."""
    system = LinearSystem.of(network, solver=solver, shapes=False, hours=1.0)
    modes = modes_of(system, lowest=COUNT, certify=certify)
    first, last = modes.frequency[[0, -1]]
    text = f"{first:.6f} to {last:.6f} Hz, residual {modes.residual.max():.1e}"
    text += f", {modes.attributes['solver']}"
    expected = modes.attributes.get("expected_modes")
    if expected is not None:
        text += f"; moments expect {expected:.0f} +- {modes.attributes['expected_modes_error']:.0f}"
    return text


def lowest_by_scipy(network: Network) -> str:
    """Find the lowest modes with scipy's eigsh about a shift, after all zero modes."""
    system = LinearSystem.of(network)
    n_zero = by_structure(system).basis.shape[1]
    sigma = -SHIFT * system.diagonal.max()
    matrix = system.dynamical_matrix.tocsc()
    square = eigsh(matrix, k=COUNT + n_zero, sigma=sigma, which="LM")[0]
    return f"{len(square)} modes up to {frequency_of(np.sort(square))[-1]:.6f} Hz"


def moduli(network: Network, solver: str) -> str:
    """Compute the moduli, and return the bulk modulus and the number of products."""
    result = elastic_moduli(network, solver=solver)
    return f"bulk modulus {result.bulk_modulus:.6e} Pa, {result.products} products"


ACTIONS: dict[str, Callable[[Network], str]] = {
    "lowest 20, factor and count": lambda network: lowest(network, certify=True),
    "lowest 20, polynomial": lambda network: lowest(network, certify=False),
    "lowest 20, multigrid": lambda network: lowest(network, certify=False, solver="multigrid"),
    "lowest 20, scipy eigsh": lowest_by_scipy,
    "density, 10 kHz": lambda network: repr(density_of_states(network, resolution=1e4)),
    "moduli, pardiso": lambda network: moduli(network, "pardiso"),
    "moduli, multigrid": lambda network: moduli(network, "multigrid"),
}
LAMMPS = "all modes, LAMMPS and LAPACK"
CURVES = [*ACTIONS, LAMMPS] if shutil.which(Lammps.command) else list(ACTIONS)


def act(path: str, curve: str) -> Callable[[], str]:
    """Prepare the task of one of `ACTIONS`."""
    compile_loop()
    network = read(path)
    return lambda: ACTIONS[curve](network)


def tried(curve: str, spheres: int) -> bool:
    """Tell whether a method is tried for so many spheres."""
    return all(part not in curve or spheres <= most for part, most in MAX_SPHERES.items())


def run(job: Job) -> Page:
    """Make each cube by a command, and ask it every question."""
    job.measured(compile_cycles, must=False)
    rows: Rows = []
    for spheres in SIZES[job.quick]:
        folder = f"cube{spheres}"
        words = f"modal pack --friction 0 --periodic --spheres {spheres} --aspect 1 --stress 1e5"
        job.command(*words.split(), "-o", folder)
        (path,) = (job.folder / folder).glob("*.sample.h5")
        for curve in CURVES:
            if not tried(curve, spheres):
                continue
            if curve == LAMMPS:
                run = lammps(job, read(path))
                highest = run.value[-1] if run.value else 0.0
                run = replace(run, value=f"20 highest modes up to {highest:.6f} Hz")
            else:
                run = job.measured(act, must=False, path=str(path), curve=curve)
            row: dict[str, Any] = {"curve": curve, "x": spheres, **run.cost, "result": run.value}
            rows.append(row)
            print(*(f"{name} {value}" for name, value in row.items()), sep=", ", flush=True)
    rows.sort(key=lambda row: CURVES.index(row["curve"]))
    task = (
        "Seconds are processor time of one thread, memory the peak of the process. x: spheres of a "
        "periodic cube without friction at 100 kPa."
    )
    measured = [row | {"method": row["curve"]} for row in rows if row["seconds"]]
    axes = {"x": "number of spheres"}
    figure = diagram.work_precision(measured, axes, ("seconds", "peak_mb"))
    return Page(TITLE, task, {"cubes": rows}, [], {"cubes": figure})
