"""Large files of other programs: reading them here, and by pandas and OVITO.

A million spheres of a periodic FCC crystal, as a dump of LAMMPS and as a table (*.csv), 17 digits.
`numbers`: the columns of positions and radii are arrays. `import`: the command writes a network,
for which it also seeks six million contacts, applies the law and checks the packing. pandas and
ovito are compared where they are installed. Runs only when it is named.
"""

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.harness import diagram
from benchmarks.harness.measure import Job
from benchmarks.harness.report import Page, Rows
from modal.exchange import dump
from modal.exchange.programs.table import read_numbers

TITLE = "Large files of other programs"
CELLS = {True: 20, False: 63}
"""Cubes of four spheres along each side: 32,000 spheres, or 1,000,188."""
SIDE = 1.4135
"""Side of a cube of four spheres in diameters: neighbours overlap by 5e-4 of a diameter."""
LAW = "granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.3"
COLUMNS = ("id", "type", "x", "y", "z", "radius", "mass")
LINES_BEFORE_ROWS = 9
"""Lines of a dump before its rows."""
Task = Callable[[], float]
"""Returns the sum of radii, which must be the same for all."""


def write_files(folder: Path, cells: int) -> int:
    """Write the dump and the table of spheres of 1 mm; return the number of spheres."""
    base = np.array([[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]])
    corner = np.array(list(itertools.product(range(cells), repeat=3)))
    position = 1e-3 * SIDE * (corner[:, None] + base).reshape(-1, 3)
    side = 1e-3 * SIDE * cells
    count = len(position)
    radius = 5e-4
    mass = 2500 * 4 / 3 * np.pi * radius**3
    with (folder / "big.atoms").open("w") as atoms, (folder / "big.csv").open("w") as table:
        atoms.write(f"ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{count}\n")
        atoms.write("ITEM: BOX BOUNDS pp pp pp\n" + f"0 {side!r}\n" * 3)
        atoms.write(f"ITEM: ATOMS {' '.join(COLUMNS)}\n")
        bounds = f"0 {side!r}"
        table.write(f"# cell {bounds} {bounds} {bounds}\n# periodic x y z\nid,x,y,z,radius,mass\n")
        for number, (x, y, z) in enumerate(position.tolist(), 1):
            atoms.write(f"{number} 1 {x:.17g} {y:.17g} {z:.17g} {radius!r} {mass!r}\n")
            table.write(f"{number},{x:.17g},{y:.17g},{z:.17g},{radius!r},{mass!r}\n")
    return count


def dump_here(folder: str) -> Task:
    """Prepare reading the dump's columns by this program."""

    def read() -> float:
        frame = dump.read_frame(Path(folder) / "big.atoms", "ATOMS", None)
        return float(frame.rows.read("x", "y", "z", "radius")[:, 3].sum())

    return read


def table_here(folder: str) -> Task:
    """Prepare reading the table's columns by this program."""
    return lambda: float(read_numbers(Path(folder) / "big.csv").radius.sum())


def dump_by_pandas(folder: str) -> Task:
    """Prepare reading the dump's columns by pandas."""
    import pandas

    def read() -> float:
        path = Path(folder) / "big.atoms"
        frame = pandas.read_csv(path, sep=" ", skiprows=LINES_BEFORE_ROWS, names=COLUMNS)
        return float(frame[["x", "y", "z", "radius"]].to_numpy()[:, 3].sum())

    return read


def table_by_pandas(folder: str) -> Task:
    """Prepare reading the table's columns by pandas."""
    import pandas

    def read() -> float:
        frame = pandas.read_csv(Path(folder) / "big.csv", comment="#")
        return float(frame[["x", "y", "z", "radius"]].to_numpy()[:, 3].sum())

    return read


def dump_by_ovito(folder: str) -> Task:
    """Prepare reading the dump's columns by OVITO."""
    from ovito.io import import_file

    def read() -> float:
        data = import_file(str(Path(folder) / "big.atoms")).compute()
        np.array(data.particles.positions)
        return float(np.array(data.particles["Radius"], float).sum())

    return read


READERS = {
    "dump, this program": dump_here,
    "dump, pandas": dump_by_pandas,
    "dump, ovito": dump_by_ovito,
    "table, this program": table_here,
    "table, pandas": table_by_pandas,
}


def run(job: Job) -> Page:
    """Read both files in each way, and import them."""
    count = write_files(job.folder, CELLS[job.quick])
    rows: Rows = []
    for name, task in READERS.items():
        measured = job.measured(task, must=False, folder=str(job.folder))
        rows.append({"file and reader": name, "what": "numbers", **measured.cost})
    for name in ("big.atoms", "big.csv"):
        words = ("modal", "import", name, "--pair", LAW, "-o", "big.network.h5")
        measured = job.command(*words, threads=1)
        rows.append({"file and reader": name, "what": "import", **measured.cost})
    for row in rows:
        print(row, flush=True)
    shown = [row for row in rows if row["seconds"]]
    labels = [f"{row['file and reader']}, {row['what']}" for row in shown]
    figure, ax = diagram.bars(labels, {"measured": shown}, "seconds")
    ax.set(xlabel="seconds")
    task_text = f"{count:,} spheres, 17 digits; processor time of one thread, peak memory."
    return Page(TITLE, task_text, {"importing": rows}, [], {"importing": figure})
