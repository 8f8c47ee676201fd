"""The project's scripts inside YADE, each as yade-batch runs it for a table of one line.

yade-batch itself, which `test_faults_study.py` goes through, starts a second YADE to read the table
and looks every half second whether a job has ended.
"""

import atexit
import json
import os
import re
import subprocess
from functools import cache
from pathlib import Path

import h5py
import scipy.sparse as sp
from places import ROOT

from modal.__main__ import main
from modal.packing.network import Network, write_network


def of_batch(script: str, table: str, folder: Path) -> tuple[Path, dict[str, str]]:
    """The script, and the environment that yade-batch gives it for a table of two lines."""
    path = folder / f"{script}.table"
    path.write_text(table)
    here = {"YADE_BATCH": f"{path}:2", "WAVE_PRODUCTS": str(folder)}
    return ROOT / "yade_scripts" / f"{script}.py", here


def start(script: str, table: str, folder: Path, **environment: str) -> subprocess.Popen:
    """Start a script in a YADE of its own, on a table of two lines; it goes on beside the test."""
    path, here = of_batch(script, table, folder)
    with (folder / f"{script}.log").open("w") as log:
        return subprocess.Popen(
            ["yade", "-n", "-x", "-j1", str(path)],
            cwd=folder,
            env=os.environ | here | environment,
            stdout=log,
            stderr=log,
        )


@cache
def server() -> subprocess.Popen:
    """The YADE whose forks run all other scripts; it ends with the tests."""
    command = ["yade", "-n", "-x", "-j1", str(ROOT / "tests/yade/server.py")]
    pipes = dict.fromkeys(("stdin", "stdout"), subprocess.PIPE)
    process = subprocess.Popen(command, **pipes, stderr=subprocess.STDOUT, text=True)
    atexit.register(process.communicate)
    return process


def forked(folder: Path, words: list, environment: dict[str, str]) -> tuple[int, str]:
    """Run a script with its words to its end: exit status, and what it said."""
    log = folder / f"{Path(words[0]).stem}.log"
    job = {"words": [*map(str, words)], "folder": str(folder), "log": str(log), "seconds": 400}
    said = [json.dumps(job | {"environment": environment})]
    print(said[0], file=server().stdin, flush=True)
    while not said[-1].startswith("ended "):
        said.append(server().stdout.readline())
        assert said[-1], said
    return int(said[-1].split()[1]), log.read_text()


def run(script: str, table: str, folder: Path, **environment: str) -> str:
    """Run a script to its end; its log, which says what is wrong in lines that begin with error."""
    path, here = of_batch(script, table, folder)
    status, log = forked(folder, [path], here | environment)
    assert status == (2 if re.search("^error: ", log, re.MULTILINE) else 0), log
    return log


def script(path: Path, *arguments: object, folder: Path) -> str:
    """Run a script of its own arguments inside YADE, to its end without fault; what it said."""
    status, log = forked(folder, [path, *arguments], {})
    assert status == 0, log
    return log


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
