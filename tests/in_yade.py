"""The project's scripts inside YADE, each as yade-batch runs it for a table of one line.

yade-batch itself, which `test_faults_study.py` goes through, starts a second YADE to read the table
and looks every half second whether a job has ended.
"""

import atexit
import json
import os
import subprocess
from functools import cache
from pathlib import Path

import h5py
import scipy.sparse as sp
from places import ROOT

from modal.__main__ import main
from modal.packing.network import Network, write_network


def of_batch(script: str, table: str, folder: Path) -> tuple[Path, dict[str, str]]:
    """Return the path of a script, and the environment of yade-batch for a table of two lines."""
    path = folder / f"{script}.table"
    path.write_text(table)
    environment = {"YADE_BATCH": f"{path}:2", "WAVE_PRODUCTS": str(folder)}
    return ROOT / "yade_scripts" / f"{script}.py", environment


def start(script: str, table: str, folder: Path, **environment: str) -> subprocess.Popen:
    """Start a script in a YADE of its own, on a table of two lines; it goes on beside the test."""
    path, batch_environment = of_batch(script, table, folder)
    with (folder / f"{script}.log").open("w") as log:
        return subprocess.Popen(
            ["yade", "-n", "-x", "-j1", str(path)],
            cwd=folder,
            env=os.environ | batch_environment | environment,
            stdout=log,
            stderr=log,
        )


MAX_SCRIPT_SECONDS = 400
"""Time after which a script is killed."""


@cache
def server() -> subprocess.Popen:
    """Start the YADE whose forks run all other scripts; it ends with the tests."""
    command = ["yade", "-n", "-x", "-j1", str(ROOT / "tests/yade/server.py")]
    pipes = dict.fromkeys(("stdin", "stdout"), subprocess.PIPE)
    process = subprocess.Popen(command, **pipes, stderr=subprocess.STDOUT, text=True)
    atexit.register(process.communicate)
    return process


def forked(folder: Path, words: list, environment: dict[str, str]) -> tuple[int, str]:
    """Run a script with its arguments to its end; return its exit status and its output."""
    log = folder / f"{Path(words[0]).stem}.log"
    job = {
        "words": [*map(str, words)],
        "folder": str(folder),
        "log": str(log),
        "seconds": MAX_SCRIPT_SECONDS,
        "environment": environment,
    }
    print(json.dumps(job), file=server().stdin, flush=True)
    while True:
        line = server().stdout.readline()
        assert line, f"YADE has ended: {job}"
        if line.startswith("ended "):
            return int(line.split()[1]), log.read_text()


def run(script: str, table: str, folder: Path, **environment: str) -> str:
    """Run a script on a table to its end; return its log, which may have an error in a line."""
    path, batch_environment = of_batch(script, table, folder)
    status, log = forked(folder, [path], batch_environment | environment)
    assert status == (2 if error_lines(log) else 0), log
    return log


def error_lines(log: str) -> list[str]:
    """Return the lines of a log that report a user's mistake."""
    return [line for line in log.splitlines() if line.startswith("error: ")]


def script(path: Path, *arguments: object, folder: Path) -> str:
    """Run a script with arguments inside YADE, to its end without fault; return its output."""
    status, log = forked(folder, [path, *arguments], {})
    assert status == 0, log
    return log


def measured_tangent(
    path: Path, network: Network, arc: float
) -> tuple[sp.csr_matrix, sp.dia_matrix]:
    """Return K by differences of YADE's forces, and the diagonal matrix of its units.

    Rotations are arcs of a radius, m, so that all entries are N/m.
    """
    size = 6 * network.n_particles
    with h5py.File(path) as file:
        entries = file["value"][:], (file["row"][:], file["column"][:])
    units = sp.diags([1.0, 1, 1, 1 / arc, 1 / arc, 1 / arc] * network.n_particles)
    return units @ sp.csr_matrix(entries, shape=(size, size)) @ units, units


def write_highest(folder: Path, case: str) -> None:
    """Write the highest mode of a case's network, which the time step of a wave needs."""
    network = f"{folder / case}.network.h5"
    modes = f"{folder / case}.highest.modes.h5"
    assert main(["modes", network, "--highest", "1", "-o", modes]) == 0


def put(folder: Path, case: str, network: Network) -> None:
    """Write a network as that of a case, with its highest mode."""
    write_network(folder / f"{case}.network.h5", network)
    write_highest(folder, case)
