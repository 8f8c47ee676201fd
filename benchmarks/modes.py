"""Modes: this program against what a user would type, in a random packing and in a crystal.

The lowest modes of a random packing, by this program's back ends, by scipy's `eigsh` with its
tolerances, and by dense `eigh`. The error is that of the frequencies, against those from the energy
of the springs, which are right to more digits than K itself. Loosely held spheres make K singular:
what that does to a solver that does not know of them is part of the comparison.
All modes of a crystal, by its lateral symmetry and dense. What each task costs at full size:
`python -m benchmarks scaling`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from benchmarks.harness import diagram
from benchmarks.harness.measure import attempted, measured
from benchmarks.harness.packing import KnownPacking, by_energy
from benchmarks.harness.report import Page, Rows
from modal.modes.counts import count_below
from modal.modes.highest import all_modes
from modal.modes.lowest import lowest_modes
from modal.modes.problem import Eigenproblem, frequency_of
from modal.packing import examples as gallery
from modal.packing.network_file import read_network, write_network
from modal.solvers.factor import SOLVERS, available, factorise
from modal.stiffness.matrices import mass_diagonal, stiffness_matrix

TITLE = "Modes: this program against scipy's own solvers"
SPHERES = {True: 250, False: 700}
LAYERS = {True: (12, 40), False: (40, 200)}
"""Layers of the 4 x 4 crystal that is compared with dense matrices, and of the long one."""
LOWEST = 20
TOLERANCES = {True: (1e-2, 1e-8, 0.0), False: (1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 0.0)}
SHIFT = -((2 * np.pi * 100.0) ** 2)
"""omega^2 a little below zero that keeps the factor of a singular K finite, rad^2/s^2."""
Task = Callable[[], list[float]]
OWN, EIGSH = "this program", f"eigsh, sigma < 0, k = {LOWEST} + floppy"
FAST_ENOUGH = 1.25
"""Time over that of the fastest back end within which the program's choice is a good one."""


def program(path: str, solver: str | None, count: int) -> Task:
    """Task: this program's lowest modes, from the network to certified frequencies."""
    network = read_network(path)
    # Loading a back end for the first time is not part of the task.
    for definite in (True, False):
        factorise(
            sp.identity(3, format="csr"), definite=definite, solver=solver if definite else None
        )

    def action() -> list[float]:
        fresh = replace(network)  # nothing is kept from an earlier run
        return lowest_modes(Eigenproblem.of(fresh, solver=solver), count).frequency.tolist()

    return action


def typed(path: str, count: int, sigma: float | None, tolerance: float) -> Task:
    """Task: eigsh(K, k, M, sigma) as one would type it; without sigma, which="SM": no factor."""
    network = read_network(path)
    how: dict[str, Any] = {"sigma": sigma} if sigma is not None else {"which": "SM"}

    def action() -> list[float]:
        K, M = stiffness_matrix(network).tocsc(), sp.diags(mass_diagonal(network)).tocsc()
        square = eigsh(K, count, M, tol=tolerance, maxiter=20000, return_eigenvectors=False, **how)
        return frequency_of(np.sort(square)).tolist()

    return action


def dense(path: str, count: int | None) -> Task:
    """Task: eigh of the full matrices; all modes, or the lowest `count` only."""
    network = read_network(path)

    def action() -> list[float]:
        K, M = stiffness_matrix(network).toarray(), np.diag(mass_diagonal(network))
        subset = None if count is None else [0, count - 1]
        return frequency_of(eigh(K, M, subset_by_index=subset, overwrite_a=True)[0]).tolist()

    return action


def by_symmetry(path: str) -> Task:
    """Task: all modes of a crystal by its lateral symmetry."""
    network = read_network(path)
    return lambda: all_modes(Eigenproblem.of(replace(network))).frequency.tolist()


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


def packing_rows(packing: KnownPacking, quick: bool) -> Rows:
    """Every method on one random packing; where a method fails, why."""
    floppy, exact, rows = packing.floppy, packing.exact.copy(), []
    exact[floppy : floppy + LOWEST] = by_energy(packing.problem, floppy, LOWEST)

    def add(method: str, setting: str, task: str, times: int = 1, **arguments: Any) -> None:
        cost = attempted(
            f"benchmarks.modes:{task}", times=times, path=str(packing.path), **arguments
        )
        row: dict[str, Any] = {"method": method, "setting": setting}
        row |= dict.fromkeys(("elastic_modes", "zero_modes", "error", "seconds", "peak_mb"))
        row["failure"] = cost.failure or None
        if not cost.failure:
            elastic, zero, error = compare(cost.value, exact, floppy, LOWEST)
            row |= {"elastic_modes": elastic, "zero_modes": zero, "error": error}
            row |= cost.cost
            if error is None:
                row["failure"] = f"{elastic} elastic modes, {LOWEST} wanted"
        rows.append(row)

    times, all_low = 1 if quick else 3, LOWEST + floppy
    for solver in (None, *filter(available, SOLVERS)):
        name = f"{OWN}, {solver}" if solver else OWN
        add(name, f"{LOWEST} elastic modes", "program", times, solver=solver, count=LOWEST)
    for name, sigma in (("eigsh, sigma = 0", 0.0), ("eigsh, sigma < 0", SHIFT)):
        add(name, f"k = {LOWEST}", "typed", count=LOWEST, sigma=sigma, tolerance=0.0)
    for tolerance in TOLERANCES[quick]:
        setting = {"count": all_low, "sigma": SHIFT, "tolerance": tolerance}
        add(EIGSH, f"tol = {tolerance:g}", "typed", times, **setting)
    if not quick:
        setting = {"count": all_low, "sigma": None, "tolerance": 1e-6}
        add("eigsh, which = SM", "tol = 1e-06", "typed", **setting)
    add("eigh, all modes", "", "dense", count=None)
    add("eigh, lowest only", "", "dense", count=all_low)
    return rows


def crystal_rows(folder: Path, quick: bool) -> Rows:
    """All modes of 4 x 4 crystals: errors over the highest frequency, miscounts over all modes."""
    path, (short, long) = str(folder / "crystal.network.h5"), LAYERS[quick]
    write_network(path, gallery.fcc(cells=(4, 4, short)))
    whole = measured("benchmarks.modes:dense", path=path, count=None)
    blocks = measured("benchmarks.modes:by_symmetry", path=path)
    network = gallery.fcc(cells=(4, 4, long))
    write_network(path, network)
    large = measured("benchmarks.modes:by_symmetry", path=path)
    apart = abs(np.array(blocks.value) - whole.value).max() / max(whole.value)
    # Cuts in the middle of the widest gaps, where no cluster of equal frequencies is split.
    frequency, problem = np.array(large.value), Eigenproblem.of(network)
    cuts = [frequency[k : k + 2].mean() for k in np.argsort(np.diff(frequency))[-3:]]
    wrong = max(abs(count_below(problem, f) - int((frequency < f).sum())) for f in cuts)
    return [
        {"method": method, "layers": layers, "checked by": check, "error": float(error), **run.cost}
        for method, layers, check, error, run in (
            ("dense", short, "", 0.0, whole),
            ("by symmetry", short, "dense", apart, blocks),
            ("by symmetry", long, "three exact counts", wrong / len(frequency), large),
        )
    ]


def run(quick: bool, folder: Path) -> Page:
    """A random packing and a crystal."""
    packing = KnownPacking.of(SPHERES[quick], folder)
    tables = {
        "eigensolvers": packing_rows(packing, quick),
        "crystal_modes": crystal_rows(folder, quick),
    }
    bound = round_off(packing)
    task = (
        f"The {LOWEST} lowest elastic modes of a {packing}. From the contact network to the "
        "frequencies, assembly included. The error is the largest of the wanted frequencies, "
        "against the energy of the springs; `zero_modes` says how many floppy ones a method lists "
        f"with them (k = {LOWEST} + floppy: it is told how many there are). Only this program "
        f"counts the modes afterwards, which is in its time. Lowest mode "
        f"{packing.exact[packing.floppy]:.0f} Hz, highest {packing.exact[-1]:.0f} Hz: round-off in "
        f"K can shift the lowest by half the unit times their ratio squared, {bound:.1e}. Then all "
        "modes of crystals."
    )
    label = {"error": "relative error of the frequencies (-)"}
    figure = diagram.work_precision(tables["eigensolvers"], label)
    said = notes(tables["eigensolvers"]) + crystal_notes(tables["crystal_modes"])
    return Page(TITLE, task, tables, said, {"eigensolvers": figure})


def round_off(packing: KnownPacking) -> float:
    """Relative shift of the lowest elastic frequency by round-off in K."""
    ratio = packing.exact[-1] / packing.exact[packing.floppy]
    return float(np.finfo(float).eps * ratio**2 / 2)


def trend(rows: Rows) -> tuple[float, float] | None:
    """Slope of log error over log tolerance, and its standard error; None below four points."""
    known = [(float(row["setting"].removeprefix("tol = ")), row["error"]) for row in rows]
    known = [(tolerance, error) for tolerance, error in known if tolerance > 0 and error]
    if len(known) < 4:
        return None
    x, y = np.log(np.array(known)).T
    fit, covariance = np.polyfit(x, y, 1, cov=True)
    return float(fit[0]), float(np.sqrt(covariance[0, 0]))


def choice(rows: Rows) -> tuple[float, str]:
    """Time of the program's own choice over that of its fastest back end, and which that is."""
    ends = [row for row in rows if row["method"].startswith(f"{OWN}, ") and row.get("seconds")]
    best = min(ends, key=lambda row: row["seconds"])
    return rows[0]["seconds"] / best["seconds"], best["method"].removeprefix(f"{OWN}, ")


def notes(rows: Rows) -> list[str]:
    """Where the errors stop, what the floppy modes do, and what each method costs."""
    known = [row for row in rows if row.get("error") is not None]
    own = [row["error"] for row in known if row["method"].startswith(OWN)]
    eigsh_rows = [row for row in known if row["method"] == EIGSH]
    errors = [row["error"] for row in eigsh_rows]
    said = [f"{OWN.capitalize()}: errors of {min(own):.1e} to {max(own):.1e} with its back ends."]
    if errors:
        text = f"{EIGSH}: errors of {min(errors):.1e} to {max(errors):.1e}"
        slope = trend(eigsh_rows)
        if slope is not None:
            shown = "" if abs(slope[0]) > 2 * slope[1] else ", which shows no trend"
            text += f"; they go as tol^({slope[0]:.2f} ± {slope[1]:.2f}){shown}"
        said.append(text + ".")
    for row in rows:
        if row.get("failure"):
            zero = f"lists {row['zero_modes']:.0f} floppy modes; " if row.get("zero_modes") else ""
            said.append(f"{row['method']}, {row['setting']}: {zero}{row['failure']}.")
    floppy = max(row["zero_modes"] for row in known)
    loose = [row for row in known if row["zero_modes"] not in (0, floppy)]
    if loose:
        said.append(
            f"Of {floppy:.0f} zero modes {len(loose)} runs of eigsh list only some, "
            + ", ".join(f"{row['zero_modes']:.0f} ({row['setting']})" for row in loose)
            + ": a single start vector need not see all modes of one frequency."
        )
    for name in dict.fromkeys(row["method"] for row in known[1:]):
        last = [row for row in known if row["method"] == name][-1]
        said.append(
            f"{name}: {last['seconds'] / rows[0]['seconds']:.2g} times the seconds of this "
            f"program's own choice, {last['peak_mb'] / rows[0]['peak_mb']:.2g} times its memory."
        )
    return said


def crystal_notes(rows: Rows) -> list[str]:
    """What symmetry saves, and that nothing is lost by it."""
    whole, blocks, large = rows
    return [
        f"All modes of 4 x 4 x {blocks['layers']} spheres by symmetry: dense matrices take "
        f"{whole['seconds'] / blocks['seconds']:.3g} times as long, frequencies are within "
        f"{blocks['error']:.0e}; {large['layers']} layers take {large['seconds']:.3g} s, exact "
        f"counts are off by {large['error']:.0e} of all modes."
    ]
