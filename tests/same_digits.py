"""Do two checkouts give the same digits? The same commands in both, all that they write compared.

    ./run_cases.sh                                     # once: the crystal's products
    python tests/same_digits.py BEFORE AFTER [--products DIR]

BEFORE and AFTER are folders with a checkout each. In both this interpreter runs the command line on
a random sample and on the crystal: the contact network's summary, lowest and highest modes, a
count, the density of states, waves, the response, the comparison of the crystal and its report.
Every number of the JSON output and of the HDF5 and CSV files is compared, and the largest
difference of each file printed. Exit status 1 where one exceeds `ROUND_OFF`, or where a file or a
number is on one side only.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

ROUND_OFF = 1e-9
"""Relative to the largest number of an array: a move may change the order of a sum, and Lanczos'
vectors with it, but no physics."""
DEGENERATE = ("mode_shape", "resonance_shape", "residual")
"""Arrays that are not one by one the same: the vectors of equal frequencies are a matter of
round-off, and so is what a residual consists of."""
UNLIKE = ("seconds", "peak_memory", "run_time")
"""Names of what differs from run to run."""
SAMPLE = "tests/data/friction150.sample.h5"


def commands(out: Path) -> dict[str, list[str]]:
    """Arguments of each run by its name; what is written goes to `out`."""
    crystal = f"{out}/case02.network.h5"

    def modal(command: str, packing: str, *options: str) -> list[str]:
        return ["-m", "modal", command, packing, *options, "--json"]

    return {
        "info": modal("info", SAMPLE),
        "lowest": modal("modes", SAMPLE, "--lowest", "30", "-o", f"{out}/lowest.modes.h5"),
        "highest": modal("modes", SAMPLE, "--highest", "5", "-o", f"{out}/highest.modes.h5"),
        "count": modal("count", SAMPLE, "--at", "2e4", "9e4"),
        "density": modal("density", SAMPLE, "-o", f"{out}/sample.density.h5"),
        "wave": modal("wave", SAMPLE, "--duration", "1e-4", "-o", f"{out}/sample.signals.h5"),
        "tangent": modal("wave", SAMPLE, "--pre-stress", "full", "-o", f"{out}/tangent.signals.h5"),
        "response": modal("response", SAMPLE, "-o", f"{out}/sample.response.h5"),
        "lattice": ["-m", "modal", "lattice", "--json"],
        "crystal": modal("modes", crystal, "--all", "-o", f"{out}/case02.modes.h5"),
        "comparison": [
            *("-m", "analysis", "compare", "2", "--no-figures"),
            *("--products", str(out), "-o", f"{out}/compare"),
        ],
        "report": ["-m", "analysis", "report", "2", "--products", str(out), "-o", f"{out}/report"],
    }


def run_all(checkout: Path, products: Path, out: Path) -> None:
    """Run every command in a checkout; keep what it prints as JSON."""
    out.mkdir(parents=True)
    for kind in ("network", "signals"):
        shutil.copy(products / f"case02.{kind}.h5", out)
    environment = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
    for name, arguments in commands(out).items():
        print(f"{checkout.name}: {name}", file=sys.stderr, flush=True)
        done = subprocess.run(
            [sys.executable, *arguments],
            cwd=checkout,
            env=environment,
            capture_output=True,
            text=True,
        )
        if done.returncode:
            sys.exit(f"{checkout}: {name} ended with {done.returncode}: {done.stderr}")
        if arguments[-1] == "--json":
            (out / f"{name}.json").write_text(done.stdout)


def numbers(path: Path) -> Iterator[tuple[str, np.ndarray]]:
    """Name and values of every array, column or entry of a file."""
    if path.suffix == ".h5":
        found: dict[str, np.ndarray] = {}
        with h5py.File(path) as file:
            file.visititems(
                lambda name, node: (
                    found.update({name: node[()]}) if isinstance(node, h5py.Dataset) else None
                )
            )
        yield from found.items()
    elif path.suffix == ".json":
        for key, value in json.loads(path.read_text()).items():
            # The order of an object's members means nothing.
            values = [value[k] for k in sorted(value)] if isinstance(value, dict) else value
            yield key, np.array(values, object).ravel()
    else:
        rows = [line for line in path.read_text().splitlines() if not line.startswith("#")]
        cells = [cell for row in csv.reader(rows) for cell in row]
        yield path.name, np.array(cells, object)


def difference(before: np.ndarray, after: np.ndarray) -> float:
    """Largest difference over the largest number; infinite where shapes or texts differ."""
    if before.shape != after.shape:
        return np.inf
    try:
        a, b = before.astype(float), after.astype(float)
    except (TypeError, ValueError):
        return max((_cell(x, y) for x, y in zip(before, after, strict=True)), default=0.0)
    if (np.isnan(a) != np.isnan(b)).any():
        return np.inf
    size = np.nanmax(abs(a), initial=0.0)
    return float(np.nanmax(abs(a - b), initial=0.0) / (size if size > 0 else 1.0))


def _cell(before: object, after: object) -> float:
    try:
        a, b = float(str(before)), float(str(after))
    except ValueError:
        return 0.0 if before == after else np.inf
    return abs(a - b) / max(abs(a), abs(b), np.finfo(float).tiny)


def compare(before: Path, after: Path) -> bool:
    """Print the difference of each file; whether all agree."""
    good = True
    kinds = ("*.h5", "*.json", "*.csv")
    files = {p.relative_to(f) for f in (before, after) for kind in kinds for p in f.rglob(kind)}
    for file in sorted(files):
        if not ((before / file).is_file() and (after / file).is_file()):
            print(f"{file}: on one side only")
            good = False
            continue
        old, new = dict(numbers(before / file)), dict(numbers(after / file))
        worst, where = 0.0, ""
        for name in old:
            if any(word in name for word in UNLIKE) or name in DEGENERATE:
                continue
            off = difference(old[name], new[name]) if name in new else np.inf
            if off > worst:
                worst, where = off, name
        good &= worst <= ROUND_OFF
        print(f"{file}: {worst:.1e} {where}")
    return good


def main() -> int:
    """Run both checkouts and compare."""
    parser = argparse.ArgumentParser(description="Do two checkouts give the same digits?")
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--products", type=Path, default=Path("products"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sides = []
        for name in ("before", "after"):
            sides.append(Path(folder) / name)
            run_all(getattr(options, name).resolve(), options.products.resolve(), sides[-1])
        return 0 if compare(*sides) else 1


if __name__ == "__main__":
    sys.exit(main())
