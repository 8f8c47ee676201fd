"""Highest modes of a periodic random packing: this program against other codes.

The packing is periodic because LAMMPS leaves walls out of its matrix. Two methods are compared with
this program: LAMMPS' command `dynamical_matrix`, finite differences of forces between spheres that
do not turn, with LAPACK; and the dense quadratic eigenvalue problem K + s C + s^2 M by the QZ
algorithm on its linear form, which `polyeig` solves in codes that have damping. This program gets
the same springs and the same degrees of freedom in each comparison.
"""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.linalg import eig, eigvalsh

from benchmarks.harness import diagram
from benchmarks.harness.lammps import Lammps, run_lammps, write_atoms
from benchmarks.harness.measure import Job, Measured
from benchmarks.harness.packing import STRESS
from benchmarks.harness.report import Page, Rows
from modal.modes.eigenmodes import eigenmodes
from modal.packing.contact_law import GLASS
from modal.packing.network import Network, read_network
from modal.preparation.random_packing import random_packing
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


def by_this_program(path: str, pre_stress: str) -> Task:
    """Prepare the task of the highest modes by this program, with their exact count."""
    network = read_network(path)
    return lambda: eigenmodes(
        replace(network), highest=HIGHEST, pre_stress=pre_stress
    ).frequency.tolist()


def quadratic(path: str) -> Task:
    """Prepare the task of solving (K + s C + s^2 M) u = 0 without C; |s| are frequencies."""
    network = read_network(path)

    def action() -> list[float]:
        K = LinearSystem.of(network).dynamical_matrix.toarray()
        identity = np.eye(len(K))
        zero = np.zeros_like(K)
        left = np.block([[zero, identity], [-K, zero]])
        right = np.block([[identity, zero], [zero, identity]])
        s = eig(left, right, right=False)
        return np.sort(frequency_of(np.abs(s) ** 2))[-2 * HIGHEST :: 2].tolist()

    return action


def from_matrix(path: str) -> Task:
    """Prepare the task of the frequencies of a matrix K / m that LAMMPS has written."""

    def action() -> list[float]:
        flat = np.fromfile(path)
        K = flat.reshape(round(len(flat) ** 0.5), -1)
        return frequency_of(eigvalsh((K + K.T) / 2)[-HIGHEST:]).tolist()

    return action


def lammps(job: Job, network: Network) -> Measured:
    """Return frequencies, Hz, by LAMMPS' matrix and LAPACK, and the cost of both."""
    write_atoms(job.folder / "scene.data", network)
    variables = {
        "data": "scene.data",
        "young": GLASS.young,
        "poisson": GLASS.poisson,
        "step": STEP,
        "out": "matrix.bin",
    }
    assembly = run_lammps(SCRIPT, job.folder, variables)
    solution = job.measured(from_matrix, path=str(job.folder / "matrix.bin"))
    peak_mb = max(assembly.peak_mb, solution.peak_mb)
    return Measured(solution.value, assembly.seconds + solution.seconds, peak_mb)


def rows_of(job: Job, spheres: int) -> Rows:
    """Return a row for each code on a packing of so many spheres, beside this program's."""
    network = random_packing(spheres, STRESS, seed=1, periodic=True)
    # Next to no tangential stiffness: a network's must be above zero.
    no_shear = replace(network, stiffness_tangential=1e-12 * network.stiffness_tangential)
    path = job.write(network, "whole")
    no_shear_path = job.write(no_shear, "bare")
    rows: Rows = []

    def add(method: str, theirs: Measured, mine: Measured) -> None:
        error = float(abs(np.array(theirs.value) / np.array(mine.value) - 1).max())
        rows.append({"spheres": spheres, "method": method, **theirs.cost, "difference": error})

    mine = job.measured(by_this_program, path=path, pre_stress="none")
    add("this program, shear and rotation", mine, mine)
    if spheres <= QUADRATIC:
        add("quadratic problem, dense QZ", job.measured(quadratic, path=path), mine)
    mine = job.measured(by_this_program, path=no_shear_path, pre_stress="normal")
    add("this program, no shear", mine, mine)
    if shutil.which(Lammps.command):
        add("LAMMPS dynamical_matrix, LAPACK", lammps(job, network), mine)
    return rows


def run(job: Job) -> Page:
    """Run every code at every size."""
    rows: Rows = []
    for spheres in SPHERES[job.quick]:
        rows += rows_of(job, spheres)
    task = (
        f"The {HIGHEST} highest modes of a periodic random packing without friction at 100 kPa, "
        "from the network to the frequencies. The difference is the largest of a frequency to this "
        "program's of the same springs; without shear these have the forces of the contacts, too."
    )
    figure = diagram.work_precision(rows, {"spheres": "spheres (-)"})
    remarks = []
    own_seconds = 1.0
    for row in rows:
        if row["method"].startswith("this program"):
            own_seconds = row["seconds"]
        else:
            remarks.append(
                f"{row['spheres']} spheres, {row['method']}: "
                f"{row['seconds'] / own_seconds:.3g} times the seconds of this program, "
                f"frequencies {row['difference']:.1e} apart."
            )
    return Page(TITLE, task, {"other_codes": rows}, remarks, {"other_codes": figure})
