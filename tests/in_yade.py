"""The project's scripts inside YADE, each as yade-batch runs it for a table of one line.

yade-batch itself, which `test_faults_study.py` goes through, starts a second YADE to read the table
and looks every half second whether a job has ended.
"""

import os
import subprocess
from pathlib import Path

import h5py
import scipy.sparse as sp
from places import ROOT

from modal.__main__ import main
from modal.packing.network import Network, write_network


def start(script: str, table: str, folder: Path, **environment: str) -> subprocess.Popen:
    """Start a script on a table of two lines, names and values; its log is folder/script.log."""
    path = folder / f"{script}.table"
    path.write_text(table)
    command = ["yade", "-n", "-x", "-j1", str(ROOT / "yade_scripts" / f"{script}.py")]
    here = {"YADE_BATCH": f"{path}:2", "WAVE_PRODUCTS": str(folder)}
    with path.with_suffix(".log").open("w") as log:
        return subprocess.Popen(
            command,
            cwd=folder,
            env=os.environ | here | environment,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )


def run(script: str, table: str, folder: Path, **environment: str) -> str:
    """Run a script to its end; its log, which says what is wrong in lines that begin with error."""
    status = start(script, table, folder, **environment).wait(timeout=400)
    log = (folder / f"{script}.log").read_text()
    assert status == (2 if "\nerror: " in log else 0), log
    return log


def script(path: Path, *arguments: object, folder: Path) -> str:
    """Run a script of its own arguments inside YADE, to its end without fault; what it said."""
    command = ["yade", "-n", "-x", "-j1", str(path), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=300)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    return said


def measured_tangent(
    path: Path, network: Network, arc: float
) -> tuple[sp.csr_matrix, sp.dia_matrix]:
    """K as YADE's forces differ, its rotations as arcs of a radius, m; and what makes them so."""
    size = 6 * network.n_particles
    with h5py.File(path) as file:
        entries = file["value"][:], (file["row"][:], file["column"][:])
    units = sp.diags([1.0, 1, 1, 1 / arc, 1 / arc, 1 / arc] * network.n_particles)
    return units @ sp.csr_matrix(entries, shape=(size, size)) @ units, units


def write_highest(folder: Path, case: str) -> None:
    """The highest mode of a case's network, which the time step of a wave needs."""
    network, modes = (f"{folder / case}.{kind}.h5" for kind in ("network", "highest.modes"))
    assert main(["modes", network, "--highest", "1", "-o", modes]) == 0


def put(folder: Path, case: str, network: Network) -> None:
    """Write a network as that of a case, with its highest mode."""
    write_network(folder / f"{case}.network.h5", network)
    write_highest(folder, case)
