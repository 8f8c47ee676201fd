"""The lowest modes of a random packing: this program's back ends against what a user would type.

Peers are scipy's `eigsh` in shift-invert mode, with its tolerances, and dense `eigh`. The error is
that of the frequencies, against those from the energy of the springs, which are right to more
digits than K itself. Loosely held spheres make K singular: what that does to a solver that does not
know of them is part of the comparison.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from benchmarks import diagram
from benchmarks.measure import Measured, attempted
from benchmarks.packing import KnownPacking, by_energy
from benchmarks.report import Finding
from modal.assembly import mass_diagonal, stiffness_matrix
from modal.eigenproblem import Eigenproblem, frequency_of
from modal.factor import SOLVERS, available, factorise
from modal.intervals import lowest_modes
from modal.network import Network, read_network

TITLE = "Lowest modes: back ends and tolerances against scipy's own solvers"
SPHERES = {True: 250, False: 700}
LOWEST = 20
TOLERANCES = {True: (1e-2, 1e-8, 0.0), False: (1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 0.0)}
SHIFT = -((2 * np.pi * 100.0) ** 2)
"""omega^2 a little below zero that keeps the factor of a singular K finite, rad^2/s^2."""
DENSE_AT_MOST = 6500
"""Degrees of freedom up to which the dense peers are run."""

Task = Callable[[], dict[str, Any]]


def _matrices(path: str) -> tuple[Network, sp.csr_matrix, sp.dia_matrix]:
    network = read_network(path)
    return network, stiffness_matrix(network), sp.diags(mass_diagonal(network))


def _hertz(square: np.ndarray) -> list[float]:
    """Frequencies, ascending; negative omega^2 gives negative ones."""
    return frequency_of(np.sort(np.real(square))).tolist()


def program(path: str, solver: str | None, count: int) -> Task:
    """Task: this program's lowest modes, from the network to certified frequencies."""
    network = read_network(path)
    # Loading a back end for the first time is not part of the task.
    for definite in (True, False):
        factorise(
            sp.identity(3, format="csr"), definite=definite, solver=solver if definite else None
        )

    def action() -> dict[str, Any]:
        modes = lowest_modes(Eigenproblem.of(network, solver=solver), count)
        return {"frequency": modes.frequency.tolist()}

    return action


def typed(path: str, count: int, shift: float, tolerance: float) -> Task:
    """Task: eigsh(K, k, M, sigma) as one would type it."""
    network, _, _ = _matrices(path)

    def action() -> dict[str, Any]:
        K, M = stiffness_matrix(network), sp.diags(mass_diagonal(network)).tocsc()
        square = eigsh(
            K.tocsc(), k=count, M=M, sigma=shift, tol=tolerance, return_eigenvectors=False
        )
        return {"frequency": _hertz(square)}

    return action


def without_shift(path: str, count: int, tolerance: float) -> Task:
    """Task: eigsh(K, k, M, which="SM"): no factor at all."""
    network, _, _ = _matrices(path)

    def action() -> dict[str, Any]:
        K, M = stiffness_matrix(network), sp.diags(mass_diagonal(network)).tocsc()
        square = eigsh(
            K, k=count, M=M, which="SM", tol=tolerance, maxiter=20000, return_eigenvectors=False
        )
        return {"frequency": _hertz(square)}

    return action


def dense(path: str, count: int | None) -> Task:
    """Task: eigh of the full matrices; all modes, or the lowest `count` only."""
    network, _, _ = _matrices(path)

    def action() -> dict[str, Any]:
        K, M = stiffness_matrix(network).toarray(), np.diag(mass_diagonal(network))
        subset = None if count is None else [0, count - 1]
        square = eigh(K, M, eigvals_only=False, subset_by_index=subset, overwrite_a=True)[0]
        return {"frequency": _hertz(square)}

    return action


def compare(found: list[float], exact: np.ndarray, floppy: int, wanted: int) -> tuple:
    """Elastic and zero modes in a list, and the largest relative error of the wanted ones.

    A frequency below half of the lowest elastic one is a zero mode. The error, of the `wanted`
    lowest elastic modes, is None where the list holds fewer.
    """
    elastic = exact[floppy:]
    listed = np.sort(np.array(found))
    modes = listed[listed > 0.5 * elastic[0]]
    zero = len(listed) - len(modes)
    if len(modes) < wanted:
        return len(modes), zero, None
    return len(modes), zero, float(abs(modes[:wanted] / elastic[:wanted] - 1).max())


def row(
    method: str, setting: str, cost: Measured, exact: np.ndarray, floppy: int
) -> dict[str, Any]:
    """One line of the table; where a method fails, why."""
    line: dict[str, Any] = {"method": method, "setting": setting}
    if cost.failure:
        return line | {"failure": cost.failure}
    elastic, zero, error = compare(cost.value["frequency"], exact, floppy, LOWEST)
    few = f"{elastic} elastic modes, {LOWEST} wanted" if error is None else None
    return line | {
        "elastic_modes": elastic,
        "zero_modes": zero,
        "error": error,
        "seconds": cost.seconds,
        "peak_mb": cost.peak_mb,
        "failure": few,
    }


def run(quick: bool, folder: Path) -> Finding:
    """Every method on one packing."""
    packing = KnownPacking.of(SPHERES[quick], folder)
    exact, floppy, path = packing.exact.copy(), packing.floppy, str(packing.path)
    exact[floppy : floppy + LOWEST] = by_energy(packing.problem, floppy, LOWEST)
    often = 1 if quick else 3

    def cost(task: str, times: int = often, **arguments: Any) -> Measured:
        return attempted(f"benchmarks.eigensolvers:{task}", times=times, path=path, **arguments)

    rows = []
    for solver in (None, *SOLVERS):
        if solver is None or available(solver):
            name = f"this program, {solver}" if solver else "this program"
            found = cost("program", solver=solver, count=LOWEST)
            rows.append(row(name, f"{LOWEST} elastic modes", found, exact, floppy))
    found = cost("typed", times=1, count=LOWEST, shift=0.0, tolerance=0.0)
    rows.append(row("eigsh, sigma = 0", f"k = {LOWEST}", found, exact, floppy))
    found = cost("typed", times=1, count=LOWEST, shift=SHIFT, tolerance=0.0)
    rows.append(row("eigsh, sigma < 0", f"k = {LOWEST}", found, exact, floppy))
    name = f"eigsh, sigma < 0, k = {LOWEST} + floppy"
    for tolerance in TOLERANCES[quick]:
        found = cost("typed", count=LOWEST + floppy, shift=SHIFT, tolerance=tolerance)
        rows.append(row(name, f"tol = {tolerance:g}", found, exact, floppy))
    if not quick:
        found = cost("without_shift", times=1, count=LOWEST + floppy, tolerance=1e-6)
        rows.append(row("eigsh, which = SM", "tol = 1e-06", found, exact, floppy))
    if packing.problem.size <= DENSE_AT_MOST:
        found = cost("dense", times=1, count=None)
        rows.append(row("eigh, all modes", "", found, exact, floppy))
        found = cost("dense", times=1, count=LOWEST + floppy)
        rows.append(row("eigh, lowest only", "", found, exact, floppy))
    task = (
        f"The {LOWEST} lowest elastic modes of a {packing}. From the contact network to the "
        "frequencies, assembly included. The error is the largest of the wanted frequencies, "
        "against the energy of the springs; `zero_modes` says how many floppy ones a method lists "
        f"with them (k = {LOWEST} + floppy: it is told how many there are). Only this program "
        "counts the modes afterwards, which is in its time."
    )
    figure = diagram.work_precision(rows, {"error": "relative error of the frequencies (-)"})
    return Finding(TITLE, task, rows, notes(rows, exact, floppy), {"eigensolvers": figure})


def notes(rows: list[dict[str, Any]], exact: np.ndarray, floppy: int) -> list[str]:
    """Where the errors stop, and what the floppy modes do."""
    own = rows[0]
    limit = np.finfo(float).eps * (exact[-1] / exact[floppy]) ** 2 / 2
    known = [row for row in rows if row.get("error") is not None]
    program = [row["error"] for row in known if row["method"].startswith("this program")]
    peers = [row["error"] for row in known if not row["method"].startswith("this program")]
    said = [
        f"Lowest mode {exact[floppy]:.0f} Hz, highest {exact[-1]:.0f} Hz. Round-off"
        f" in K can shift the lowest by half the unit times (f_max / f_1)^2 = {limit:.1e}, in the "
        "energy of the springs only by the root of that factor: that is the reference.",
        f"The peers' errors, {min(peers):.1e} to {max(peers):.1e}, scatter about that bound without"
        " a trend in the tolerance: they stop at round-off, and a tighter tolerance buys nothing. "
        f"This program's, {min(program):.1e} to {max(program):.1e} with its back ends, lie below: "
        "the many roundings in K mostly cancel.",
    ]
    plain = [row for row in rows if row["method"].startswith("eigsh, sigma")][:2]
    for typed_row in plain:
        zero = f"{typed_row.get('zero_modes')} of its modes are floppy ones, "
        result = typed_row.get("failure")
        prefix = zero if typed_row.get("zero_modes") else ""
        said.append(f"{typed_row['method']}, {typed_row['setting']}: {prefix}{result}.")
    loose = [row for row in known if row["zero_modes"] not in (0, floppy)]
    if loose:
        said.append(
            f"Of {floppy} zero modes {len(loose)} runs of eigsh list only some, "
            + ", ".join(f"{row['zero_modes']} ({row['setting']})" for row in loose)
            + ": a single start vector need not see all modes of one frequency. The exact count "
            "of this program is what notices such a loss."
        )
    others = [row for row in rows[1:] if row.get("error") is not None]
    for name in dict.fromkeys(row["method"] for row in others):
        last = [row for row in others if row["method"] == name][-1]
        said.append(
            f"{name}: {last['seconds'] / own['seconds']:.2g} times the seconds of this program's "
            f"own choice, {last['peak_mb'] / own['peak_mb']:.2g} times its memory."
        )
    return said
