"""Modes: this program against what other codes offer for the same question.

A periodic random packing, because LAMMPS leaves walls out of its matrix. Two ways are set beside
this program's: LAMMPS' command `dynamical_matrix`, differences of forces between spheres that do
not turn, with LAPACK; and the dense quadratic eigenvalue problem K + s C + s^2 M by the QZ
algorithm on its linear form, which is what `polyeig` does in the codes that have damping. Each is
compared with this program's answer to its own question: the same springs, the same freedom.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.linalg import eig, eigvalsh

from benchmarks.harness import diagram
from benchmarks.harness.lammps import Lammps, write_atoms
from benchmarks.harness.measure import measured, run_command
from benchmarks.harness.packing import STRESS
from benchmarks.harness.report import Page, Rows
from modal.modes.eigenmodes import eigenmodes
from modal.packing.contact_law import GLASS
from modal.packing.network import Network, read_network, write_network
from modal.preparation.packings import random_packing
from modal.system.linear_system import LinearSystem, frequency_of

TITLE = "Modes: this program against other codes"
SPHERES = {True: (60,), False: (60, 120, 1000)}
QUADRATIC = 120
"""Spheres of the largest packing of which the quadratic problem is solved: N^3 seconds."""
SCRIPT = Path(__file__).resolve().parent / "harness" / "dynamical_matrix.in"
STEP = 1e-10
"""Of the differences, m: a thousandth of an overlap, and ten digits above the round-off of z."""
HIGHEST = 20
Task = Callable[[], list[float]]


def own(path: str, pre_stress: str) -> Task:
    """Task: the highest modes by this program, from the network to frequencies that are counted."""
    network = read_network(path)
    return lambda: eigenmodes(
        replace(network), highest=HIGHEST, pre_stress=pre_stress
    ).frequency.tolist()


def quadratic(path: str) -> Task:
    """Task: all solutions s of (K + s C + s^2 M) u = 0; their |s| as frequencies, without C."""
    network = read_network(path)

    def action() -> list[float]:
        K = LinearSystem.of(network).scaled.toarray()
        one, none = np.eye(len(K)), np.zeros_like(K)
        left = np.block([[none, one], [-K, none]])
        right = np.block([[one, none], [none, one]])
        s = eig(left, right, right=False)
        return np.sort(frequency_of(np.abs(s) ** 2))[-2 * HIGHEST :: 2].tolist()

    return action


def of_matrix(path: str) -> Task:
    """Task: frequencies of a matrix K / m that LAMMPS has written."""

    def action() -> list[float]:
        flat = np.fromfile(path)
        K = flat.reshape(round(len(flat) ** 0.5), -1)
        return frequency_of(eigvalsh((K + K.T) / 2)[-HIGHEST:]).tolist()

    return action


def without_shear(network: Network) -> Network:
    """The same contacts with next to no tangential stiffness (a network's must be above zero)."""
    return replace(network, stiffness_tangential=1e-12 * network.stiffness_tangential)


def lammps(network: Network, folder: Path) -> tuple[list[float], float, float]:
    """Frequencies, Hz, seconds and peak memory, MB, of LAMMPS' matrix and its eigenvalues."""
    write_atoms(folder / "scene.data", network)
    variables = {"data": "scene.data", "young": GLASS.young, "poisson": GLASS.poisson}
    variables |= {"step": STEP, "out": "matrix.bin"}
    given = [word for name, value in variables.items() for word in ("-var", name, str(value))]
    command = ["lmp", "-in", str(SCRIPT), "-log", "none", *given]
    made = run_command(command, folder, folder / "lammps.log")
    solved = measured("benchmarks.other_codes:of_matrix", path=str(folder / "matrix.bin"))
    return solved.value, made.seconds + solved.seconds, max(made.peak_mb, solved.peak_mb)


def rows_of(spheres: int, folder: Path) -> Rows:
    """Each code's way on a packing of so many spheres, beside this program's way there."""
    network = random_packing(spheres, STRESS, seed=1, periodic=True)
    path, bare = folder / "whole.network.h5", folder / "bare.network.h5"
    write_network(path, network)
    write_network(bare, without_shear(network))
    rows: Rows = []

    def add(method: str, found: list[float], cost: tuple[float, float], exact: list[float]) -> None:
        error = float(abs(np.array(found) / np.array(exact) - 1).max())
        row = {"spheres": spheres, "method": method, "seconds": cost[0], "peak_mb": cost[1]}
        rows.append(row | {"difference": error})

    for name, file, stress in (("shear and rotation", path, "none"), ("no shear", bare, "normal")):
        mine = measured("benchmarks.other_codes:own", path=str(file), pre_stress=stress)
        add(f"this program, {name}", mine.value, (mine.seconds, mine.peak_mb), mine.value)
        if stress == "none" and spheres <= QUADRATIC:
            theirs = measured("benchmarks.other_codes:quadratic", path=str(file))
            cost = theirs.seconds, theirs.peak_mb
            add("quadratic problem, dense QZ", theirs.value, cost, mine.value)
        if stress == "normal" and Lammps.available():
            found, *cost = lammps(network, folder)
            add("LAMMPS dynamical_matrix, LAPACK", found, (cost[0], cost[1]), mine.value)
    return rows


def run(quick: bool, folder: Path) -> Page:
    """Every size, every way."""
    rows = [row for spheres in SPHERES[quick] for row in rows_of(spheres, folder)]
    task = (
        f"The {HIGHEST} highest modes of a periodic random packing without friction at 100 kPa, "
        "from the network to the frequencies. The difference is the largest of a frequency to this "
        "program's of the same springs; without shear these have the forces of the contacts, too."
    )
    figure = diagram.work_precision(rows, {"spheres": "spheres (-)"})
    return Page(TITLE, task, {"other_codes": rows}, notes(rows), {"other_codes": figure})


def notes(rows: Rows) -> list[str]:
    """Seconds of each way over those of this program, which stands before it."""
    said, mine = [], 1.0
    for row in rows:
        if row["method"].startswith("this program"):
            mine = row["seconds"]
        else:
            ratio = row["seconds"] / mine
            said.append(
                f"{row['spheres']} spheres, {row['method']}: {ratio:.3g} times the seconds of this "
                f"program, frequencies {row['difference']:.1e} apart."
            )
    return said
