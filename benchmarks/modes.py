"""Lowest modes of a random packing: this program against solvers that a user would call.

The lowest modes of a random packing, by this program's back ends, by scipy's `eigsh` with its
tolerances, and by dense `eigh`. The error is that of the frequencies, against those from the energy
of the springs, which are right to more digits than K itself. Loosely held spheres make K singular:
what that does to a solver that does not know of them is part of the comparison. What each task
costs at full size: `python -m benchmarks scaling`.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from benchmarks.harness import diagram
from benchmarks.harness.measure import Job
from benchmarks.harness.packing import KnownPacking, by_energy
from benchmarks.harness.report import Page, Rows
from modal.modes.eigenmodes import modes_of
from modal.packing.network import read_network
from modal.solvers.factor import available, direct_solvers, factorise
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.linear_system import LinearSystem, frequency_of

TITLE = "Modes: this program against scipy's own solvers"
SPHERES = {True: 250, False: 700}
LOWEST = 20
TOLERANCES = {True: (1e-2, 1e-8, 0.0), False: (1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 0.0)}
SHIFT = -((2 * np.pi * 100.0) ** 2)
"""omega^2 a little below zero that keeps the factor of a singular K finite, rad^2/s^2."""
Task = Callable[[], list[float]]
OWN = "this program"
EIGSH = f"eigsh, sigma < 0, k = {LOWEST} + floppy"
FAST_ENOUGH = 1.25
"""Time over that of the fastest back end within which the program's choice is a good one."""


def program(path: str, solver: str | None, count: int) -> Task:
    """Prepare the task of this program's lowest modes, from the network to certified ones."""
    network = read_network(path)
    # Loading a back end for the first time is not part of the task.
    for definite in (True, False):
        factorise(
            sp.identity(3, format="csr"), definite=definite, solver=solver if definite else None
        )

    def action() -> list[float]:
        copy = replace(network)  # without caches of an earlier run
        return modes_of(LinearSystem.of(copy, solver=solver), lowest=count).frequency.tolist()

    return action


def typed(path: str, count: int, **how: float) -> Task:
    """Prepare the task of scipy's own solver: eigsh with settings, eigh without any."""
    network = read_network(path)

    def action() -> list[float]:
        K = stiffness_matrix(network).tocsc()
        M = sp.diags(mass_diagonal(network)).tocsc()
        if how:
            squares = eigsh(K, count, M, maxiter=20000, return_eigenvectors=False, **how)
        else:
            ends = [0, count - 1]
            squares = eigh(K.toarray(), M.toarray(), subset_by_index=ends, eigvals_only=True)
        return frequency_of(np.sort(squares)).tolist()

    return action


def compare(frequencies: list[float], exact: np.ndarray, floppy: int, needed: int) -> tuple:
    """Return the numbers of elastic and zero modes in a list, and the largest relative error.

    A frequency below half of the lowest elastic one is a zero mode. The error, that of the
    `needed` lowest elastic modes, is None if the list has fewer.
    """
    listed = np.sort(frequencies)
    elastic = exact[floppy:]
    modes = listed[listed > 0.5 * elastic[0]]
    enough = len(modes) >= needed
    error = float(abs(modes[:needed] / elastic[:needed] - 1).max()) if enough else None
    return len(modes), len(listed) - len(modes), error


def packing_rows(job: Job, packing: KnownPacking) -> Rows:
    """Return a row for each method on one random packing; a failure is part of its row."""
    floppy = packing.floppy
    exact = packing.exact.copy()
    rows: Rows = []
    exact[floppy : floppy + LOWEST] = by_energy(packing.system, floppy, LOWEST)

    def add(method: str, setting: str, task: Callable[..., Task], **arguments: Any) -> None:
        cost = job.measured(task, must=False, path=packing.path, **arguments)
        row: dict[str, Any] = {"method": method, "setting": setting}
        row |= dict.fromkeys(("elastic_modes", "zero_modes", "error")) | cost.cost
        if not cost.failure:
            elastic, zero, error = compare(cost.value, exact, floppy, LOWEST)
            row |= {"elastic_modes": elastic, "zero_modes": zero, "error": error}
            if error is None:
                row |= {"seconds": None, "failure": f"{elastic} elastic modes, {LOWEST} wanted"}
        rows.append(row)

    for solver in (None, *filter(available, direct_solvers())):
        name = f"{OWN}, {solver}" if solver else OWN
        add(name, f"{LOWEST} elastic modes", program, solver=solver, count=LOWEST)
    for name, sigma in (("eigsh, sigma = 0", 0.0), ("eigsh, sigma < 0", SHIFT)):
        add(name, f"k = {LOWEST}", typed, count=LOWEST, sigma=sigma, tol=0.0)
    for tolerance in TOLERANCES[job.quick]:
        setting = {"count": LOWEST + floppy, "sigma": SHIFT, "tol": tolerance}
        add(EIGSH, f"tol = {tolerance:g}", typed, **setting)
    add("eigh, lowest only", "", typed, count=LOWEST + floppy)
    return rows


def run(job: Job) -> Page:
    """Run every method on one random packing."""
    packing = KnownPacking.of(SPHERES[job.quick], job)
    rows = packing_rows(job, packing)
    first = packing.exact[packing.floppy]
    last = packing.exact[-1]
    # Round-off in K moves omega^2 of the lowest mode by half the unit times the highest.
    shift = np.finfo(float).eps / 2 * (last / first) ** 2
    task = (
        f"The {LOWEST} lowest elastic modes of a {packing}. From the contact network to the "
        "frequencies, assembly included. The error is the largest of the wanted frequencies, "
        "against the energy of the springs; `zero_modes` says how many floppy ones a method lists "
        f"with them (k = {LOWEST} + floppy: it is told how many there are). Only this program "
        f"counts the modes afterwards, which is in its time. Lowest mode {first:.0f} Hz, highest "
        f"{last:.0f} Hz: round-off in K can shift the lowest by half the unit times their ratio "
        f"squared, {shift:.1e}."
    )
    figure = diagram.work_precision(rows, {"error": "relative error of the frequencies (-)"})
    return Page(TITLE, task, {"eigensolvers": rows}, notes(rows), {"eigensolvers": figure})


def choice(rows: Rows) -> tuple[float, str]:
    """Return the time of the program's choice divided by that of the fastest back end, its name."""
    ends = [row for row in rows if row["method"].startswith(f"{OWN}, ") and row.get("seconds")]
    best = min(ends, key=lambda row: row["seconds"])
    return rows[0]["seconds"] / best["seconds"], best["method"].removeprefix(f"{OWN}, ")


def notes(rows: Rows) -> list[str]:
    """Return lines with the errors of this program and of its fastest peer."""
    lines = []
    for method in (OWN, EIGSH):
        of_method = [row for row in rows if row["method"].startswith(method)]
        errors = [row["error"] for row in of_method if row["error"]]
        if errors:
            spread = f"{min(errors):.1e} to {max(errors):.1e}"
            lines.append(f"{method.capitalize()}: errors of {spread}.")
    return lines
