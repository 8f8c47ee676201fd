"""Modes of a full-size random packing: what each task costs, and what its result is worth.

    python -m benchmarks.modes [--quick] [--network FILE] [--rows NAME ...]

The sample is case 6 (35,201 spheres; --quick: a packing of 300 made on the spot). Every task of the
command line runs in a process of its own, whose seconds (without the imports) and peak memory it
reports itself; processor time, of all threads, is that of the whole process. A task that fails says
why in its row. --rows picks some: assembly, product, highest, lowest, lowest-scipy, count, below,
density, crystal.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigh

from benchmarks.report import table
from modal import gallery
from modal.assembly import mass_diagonal, stiffness_matrix
from modal.network import Network, write_network
from modal.operator import ContactOperator
from modal.random_packing import random_network
from modal.sample import read_packing
from modal.storage import InputError

ROOT = Path(__file__).resolve().parents[1]
SAMPLE = ROOT / "results" / "samples" / "case06.sample.h5"
LONGEST = 3600
"""Seconds after which a task is given up."""


def modal(*arguments: str | float | Path) -> dict[str, Any]:
    """What one command of modal prints as JSON, and its processor time, imports included, in s.

    InputError with the command's own line if it fails.
    """
    before = _processor_time()
    command = [sys.executable, "-m", "modal", *map(str, arguments), "--json"]
    try:
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, timeout=LONGEST, check=False
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"given up after {LONGEST} s") from None
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
        raise InputError(last)
    return json.loads(done.stdout) | {"processor_seconds": _processor_time() - before}


def _processor_time() -> float:
    """Of all commands so far that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def best_of(times: int, action: Callable[[], Any]) -> float:
    """Shortest of several runs, s: what else the machine does only makes a run longer."""
    seconds = []
    for _ in range(times):
        start = time.perf_counter()
        action()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def _row(result: dict[str, Any], note: str) -> dict[str, Any]:
    return {
        "seconds": result["seconds"],
        "processor_s": result["processor_seconds"],
        "peak_gb": result["peak_memory_bytes"] / 1e9,
        "result": note,
    }


def assembly(network: Network) -> dict[str, Any]:
    """K as a sparse matrix."""
    seconds = best_of(3, lambda: stiffness_matrix(network))
    return {
        "seconds": seconds,
        "processor_s": None,
        "peak_gb": None,
        "result": f"{network.n_contacts} contacts",
    }


def product(network: Network) -> dict[str, Any]:
    """One product K u by the operator without a matrix; the memory is the operator's own."""
    u = np.random.default_rng(1).standard_normal(6 * network.n_particles)
    out = np.empty_like(u)
    ContactOperator(network).apply(u, out)  # what compiling holds is not the operator's
    tracemalloc.start()
    operator = ContactOperator(network)
    operator.apply(u, out)
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    seconds = best_of(50, lambda: operator.apply(u, out))
    wanted = stiffness_matrix(network) @ u
    error = np.linalg.norm(out - wanted) / np.linalg.norm(wanted)
    return {
        "seconds": seconds,
        "processor_s": None,
        "peak_gb": held / 1e9,
        "result": f"relative difference from the sparse matrix {error:.1e}",
    }


def modes(path: Path, *choice: str | float) -> dict[str, Any]:
    """The command `modes` with its choice of modes."""
    found = modal("modes", path, *choice)
    frequency, residual = found["frequency_hz"], max(found["residual"], default=0.0)
    note = f"{len(frequency)} mode" + "s" * (len(frequency) != 1)
    if frequency:
        note += f" {frequency[0]:.6g} to {frequency[-1]:.6g} Hz, residual {residual:.1e}"
    certified = "certified" if found["certified"] else "not certified"
    return _row(found, f"{note}, {certified}, {found['solver']}")


def count(path: Path, frequency: float) -> dict[str, Any]:
    """One exact count."""
    found = modal("count", path, "--at", f"{frequency:g}")
    return _row(found, f"{found['count_below'][f'{frequency:g}']} modes below {frequency:g} Hz")


def density(path: Path, resolution: float) -> dict[str, Any]:
    """The density of states, against twelve exact counts over the whole spectrum."""
    top = modal("modes", path, "--highest", 1, "--uncertified")["frequency_hz"][0]
    at = [f"{f:.6g}" for f in np.linspace(top / 13, top * 12 / 13, 12)]
    found = modal("density", path, "--resolution", resolution, "--at", *at)
    exact = modal("count", path, "--at", *at)["count_below"]
    estimated, size = found["estimated_count_below"], found["degrees_of_freedom"]
    distance = max(abs(estimated[f] - exact[f]) for f in at) / size
    error = max(found["standard_error"].values()) / size
    note = f"at {resolution:g} Hz: {distance:.2%} of all modes from 12 exact counts"
    return _row(found, f"{note} (its own standard error {error:.2%})")


def crystal(folder: Path, layers: int) -> dict[str, Any]:
    """All modes of a crystal by its lateral symmetry; the method against a dense slab."""
    path = folder / "crystal.network.h5"
    write_network(path, gallery.fcc(4, layers))
    found = modal("modes", path, "--all")
    frequency = np.array(found["frequency_hz"])
    # Cuts in the middle of the widest gaps, where no cluster of equal frequencies is split.
    widest = np.argsort(np.diff(frequency))[-3:]
    at = [f"{(frequency[k] + frequency[k + 1]) / 2:.9g}" for k in widest]
    exact = modal("count", path, "--at", *at)["count_below"]
    equal = sum(int((frequency < float(f)).sum()) == exact[f] for f in at)
    slab = gallery.fcc(4, 10)
    write_network(path, slab)
    by_symmetry = np.array(modal("modes", path, "--all")["frequency_hz"])
    scale = 1 / np.sqrt(mass_diagonal(slab))
    square = eigh(scale[:, None] * stiffness_matrix(slab).toarray() * scale, eigvals_only=True)
    dense = np.sqrt(np.maximum(square, 0)) / (2 * np.pi)
    error = abs(by_symmetry - dense).max() / dense.max()
    note = f"{len(frequency)} modes, {equal} of 3 exact counts equal, slab of 10 layers {error:.1e}"
    return _row(found, note)


def tasks(network: Network, path: Path, folder: Path, quick: bool) -> dict[str, tuple]:
    """Name -> (what, at most, how), in the order of the table."""
    few, low, layers = (20, 6e4, 20) if quick else (100, 2e4, 200)
    lowest = f"lowest {few} elastic modes"
    return {
        "assembly": ("assembly of K", "1.0 s", partial(assembly, network)),
        "product": ("product K u, one core", "3 ms, 20 MB", partial(product, network)),
        "highest": ("highest mode", "1 s", partial(modes, path, "--highest", 1, "--uncertified")),
        "lowest": (lowest, "120 s, 3 GB", partial(modes, path, "--lowest", few)),
        "lowest-scipy": (
            f"{lowest}, scipy alone",
            "12 min, 6 GB",
            partial(modes, path, "--lowest", few, "--solver", "banded"),
        ),
        "count": ("one exact count", "12 s", partial(count, path, low)),
        "below": (f"all modes below {low:g} Hz", "8 min", partial(modes, path, "--below", low)),
        "density": ("density of states", "20 s, 0.5 %", partial(density, path, 2e3)),
        "crystal": (
            f"all modes of FCC 4x4x{layers}",
            "10 s, 1e-9",
            partial(crystal, folder, layers),
        ),
    }


def run(
    quick: bool = False, network_file: str | None = None, chosen: list[str] | None = None
) -> list[dict[str, Any]]:
    """Rows of the table; a task that fails has its reason as result."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "packing.network.h5"
        if network_file is None and quick:
            network = random_network(300, 1e5, seed=1, aspect=5.0)
        else:
            network = read_packing(network_file or SAMPLE)
        write_network(path, network)
        everything = tasks(network, path, folder, quick)
        for key in chosen or everything:
            what, at_most, action = everything[key]
            try:
                measured = action()
            except InputError as error:
                measured = dict.fromkeys(("seconds", "processor_s", "peak_gb"))
                measured["result"] = f"failed: {error}"
            rows.append({"what": what, "at most": at_most, **measured})
            print(f"{what}: {measured['result']}", file=sys.stderr, flush=True)
    return rows


def main(argv: list[str] | None = None) -> int:
    """Print the table; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a packing of 300 spheres")
    parser.add_argument("--network", metavar="FILE", help="this sample or network instead")
    names = [
        "assembly",
        "product",
        "highest",
        "lowest",
        "lowest-scipy",
        "count",
        "below",
        "density",
        "crystal",
    ]
    parser.add_argument("--rows", nargs="+", choices=names, help="only these")
    options = parser.parse_args(argv)
    print(table(run(options.quick, options.network, options.rows)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
