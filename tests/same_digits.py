"""Do two checkouts give the same digits? The same commands in both, all that they write compared.

    ./run_cases.sh                                     # once: the crystal's products
    python tests/same_digits.py BEFORE AFTER [--products DIR]

BEFORE and AFTER are folders with a checkout each. In both this interpreter runs the command line on
a random sample and on the crystal: the contact network's summary, lowest and highest modes, a
count, the density of states, waves, the response, the comparison of the crystal and its report.
Every number of the JSON output and of the HDF5 and CSV files is compared: array by array, a table's
cell by cell, a figure's curve by curve. Of each file the largest difference is printed, and every
name that differs by more than `ROUND_OFF` or is on one side only; chi_z of modes may differ by what
their residuals allow (`chi_z_bound`). Exit status 1 where anything is named. What has been found:
docs/stability.md.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

import modal
from modal.packing.chain import wall_to_wall_chain
from modal.tools.arrays import Floats

ROUND_OFF = 1e-9
"""Relative to the largest number of an array: a move may change the order of a sum, and Lanczos'
vectors with it, but no physics."""
DEGENERATE = ("mode_shape", "resonance_shape", "residual")
"""Arrays that are not one by one the same: the vectors of equal frequencies are a matter of
round-off, and so is what a residual consists of."""
OF_ONE = ("truncation", "chi_z", "chi_z_chain")
"""Shares, and errors relative to the whole: compared with 1, not with the largest of them."""
UNLIKE = ("seconds", "peak_memory", "run_time", "solver")
"""Names of what a run has taken, in seconds, bytes or products."""
NUMBER = r"[+-]?\d+\.?\d*(?:e[+-]?\d+)?"
"""As it stands within a text."""
CURVE = 6
"""Values from which an array is known by them: the same ones under another name are no change."""
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


def numbers(path: Path) -> dict[str, np.ndarray]:
    """Every array, cell, curve or entry of a file by its name."""
    found: dict[str, np.ndarray] = {}
    if path.suffix == ".h5":

        def keep(name: str, node: object) -> None:
            if isinstance(node, h5py.Dataset):
                found[name] = node[()]

        with h5py.File(path) as file:
            file.visititems(keep)
    elif path.suffix == ".json":
        for key, value in json.loads(path.read_text()).items():
            # The order of an object's members means nothing.
            values = [value[k] for k in sorted(value)] if isinstance(value, dict) else value
            found[key] = np.array(values, object).ravel()
    else:
        lines = path.read_text().splitlines()
        heads = [json.loads(line[2:]) for line in lines if line.startswith("# ")]
        head, *rows = csv.reader(line for line in lines if not line.startswith("# "))
        found = curves(heads, rows) if heads else cells(head, rows)
    return found


def cells(head: list[str], rows: list[list[str]]) -> dict[str, np.ndarray]:
    """Cells of a table by row and column; rows that begin alike are counted."""
    found: dict[str, np.ndarray] = {}
    for row in rows:
        # The second cell names a row together with the first only where it says a word.
        label = ", ".join(row[:1] + [cell for cell in row[1:2] if re.search("[a-z]{2}", cell)])
        for column, cell in zip(head[1:], row[1:], strict=True):
            _add(found, f"{label} | {column}", np.array([cell], object))
    return found


def curves(heads: list[dict], rows: list[list[str]]) -> dict[str, np.ndarray]:
    """Points of a figure's curves, which its first lines name, by panel and label."""
    found: dict[str, np.ndarray] = {}
    panel, curve = -1, -1
    for entry in heads[1:]:
        if "panel" in entry:
            panel, curve, axis = panel + 1, -1, entry["panel"]["ylabel"]
            continue
        curve += 1
        own = [row[2:] for row in rows if row[:2] == [str(panel), str(curve)]]
        _add(found, f"{axis} | {entry['series']['label']}", np.array(own, object).ravel())
    return found


def _add(found: dict[str, np.ndarray], name: str, values: np.ndarray) -> None:
    """Keep values by a name that is theirs alone."""
    alike = sum(1 for other in found if other.split(" #")[0] == name)
    found[f"{name} #{alike + 1}" if alike else name] = values


def difference(before: np.ndarray, after: np.ndarray, size: float | None = None) -> float:
    """Largest difference over the largest number, or over `size`; infinite where texts differ."""
    if before.shape != after.shape:
        return np.inf
    try:
        a, b = before.astype(float), after.astype(float)
    except (TypeError, ValueError):
        pairs = zip(before.ravel(), after.ravel(), strict=True)
        return max((_text_difference(str(x), str(y)) for x, y in pairs), default=0.0)
    if (np.isnan(a) != np.isnan(b)).any():
        return np.inf
    size = size or np.nanmax(abs(a), initial=0.0) or 1.0
    return float(np.nanmax(abs(a - b), initial=0.0) / size)


def _numbers(text: str) -> list[str]:
    return re.findall(NUMBER, text)


def _text_difference(before: str, after: str) -> float:
    """Of the numbers within texts that are else the same, each relative to itself."""
    a, b = (np.array(_numbers(text), float) for text in (before, after))
    if re.sub(NUMBER, "", before) != re.sub(NUMBER, "", after):
        return np.inf
    tiny = np.finfo(float).tiny
    return float((abs(a - b) / np.maximum(np.maximum(abs(a), abs(b)), tiny)).max(initial=0.0))


def chi_z_bound(
    frequency: Floats, residual: Floats, shape: Floats, mass: Floats, spectrum: Floats
) -> Floats:
    """Shape (k,): how far the chi_z of n particles may be from that of the exact eigenvectors.

    frequency (k,), Hz, and residual (k,) of the modes; their mass-normalised shape (k, n, 6) and
    the mass (n,), kg, at these particles; spectrum: all frequencies, Hz.

    The sine of the angle between a unit vector and its eigenvector is at most e = |residual| / gap,
    the distance of its omega^2 to the others (C. Davis and W. M. Kahan, SIAM J. Numer. Anal. 7, 1,
    1970). Where the vector is off by e_p at particle p, whose part of it is v_p, that particle's
    direction turns by at most e_p / |v_p|, as a sine, and the square of its cosine changes by no
    more. As sum e_p^2 <= e^2, the mean of these over the n particles that move is at most e / n
    sqrt(sum 1 / |v_p|^2). Particles that hardly move count like all others in chi_z, which is
    therefore much less certain than a frequency.
    """
    bound = []
    for f, r, u in zip(frequency, residual, shape, strict=True):
        apart = abs(spectrum**2 - f**2)
        gap = np.sort(apart)[1] / f**2  # the nearest is the mode itself
        size = np.linalg.norm(u[:, :3], axis=1)
        moving = size > 1e-9 * size.max()  # as modal.modes.observables.chi_z has it
        inverse = 1 / (np.sqrt(mass[moving]) * size[moving])
        bound.append(min(1.0, r / max(gap, 1e-300) * np.linalg.norm(inverse) / moving.sum()))
    return np.array(bound)


def allowed_chi_z(files: list[Path], checkout: Path, of_chain: bool) -> float:
    """How far chi_z may differ between two files of modes, by the residuals of both.

    Over all particles, or over those of the chain.
    """
    crystal = files[0].with_name("case02.network.h5")
    of_crystal = files[0].name.startswith("case02.")
    network = modal.read(crystal if of_crystal else checkout / SAMPLE)
    spectrum = np.append(0.0, modal.eigenmodes(network, all=True).frequency)
    where = wall_to_wall_chain(network) if of_chain else slice(None)
    bounds = []
    for has in map(numbers, files):
        shape, mass = has["mode_shape"][:, where], network.mass[where]
        bounds.append(chi_z_bound(has["frequency"], has["residual"], shape, mass, spectrum))
    return float(np.sum(bounds, axis=0).max())


def renamed(old: dict[str, np.ndarray], new: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """`new` with the names of `old` for curves that have only been given another one."""
    found = dict(new)
    for name, values in old.items():
        if name not in new and values.size >= CURVE:
            others = (n for n in found if n not in old and difference(values, found[n]) < ROUND_OFF)
            if (other := next(others, None)) is not None:
                found[name] = found.pop(other)
    return found


def compare(before: Path, after: Path, checkout: Path) -> bool:
    """Print the difference of each file, and names that differ; whether all agree."""
    good = True
    kinds = ("*.h5", "*.json", "*.csv")
    files = {p.relative_to(f) for f in (before, after) for kind in kinds for p in f.rglob(kind)}
    for file in sorted(files):
        sides = [folder / file for folder in (before, after)]
        old, new = (numbers(side) if side.is_file() else {} for side in sides)
        new = renamed(old, new)
        worst = 0.0
        said = []
        for name in [*old, *(name for name in new if name not in old)]:
            if any(word in name for word in UNLIKE) or name in DEGENERATE:
                continue
            if name not in old or name not in new:
                said.append(f"{name}: {'before' if name in old else 'after'} alone")
                continue
            off = difference(old[name], new[name], 1.0 if name in OF_ONE else None)
            allowed = ROUND_OFF
            if off > ROUND_OFF and name.startswith("chi_z") and "mode_shape" in old:
                allowed = allowed_chi_z(sides, checkout, name == "chi_z_chain")
                print(f"{file}: {name} {off:.1e}, of {allowed:.1e} that the residuals allow")
            if off > allowed:
                said.append(f"{name}: {off:.1e}")
            else:
                worst = max(worst, off)
        good &= not said
        print("\n    ".join([f"{file}: {worst:.1e}", *said]))
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
        return 0 if compare(*sides, options.after.resolve()) else 1


if __name__ == "__main__":
    sys.exit(main())
