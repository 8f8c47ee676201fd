"""The scene of the YADE wave in LAMMPS, where it is installed (Debian package lammps)."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from benchmarks.harness.measure import Measured, median_of, run_command
from modal.packing.contact_law import GLASS
from modal.packing.network import Network
from modal.waves.chain import wall_to_wall_chain
from modal.waves.source import INPUT_FREQUENCY

SCRIPT = Path(__file__).resolve().parent / "inside_lammps.in"


def available() -> bool:
    """Whether LAMMPS is installed."""
    return shutil.which("lmp") is not None


def wave(
    folder: Path,
    network: Network,
    *,
    amplitude: float,
    time_step: float,
    duration: float,
    every: int,
    times: int,
) -> tuple[np.ndarray, Measured]:
    """Chain displacements (nt, nc), m, and what a run has cost: the median of `times` runs.

    The time step, s, must divide the period of the pulse: the wall's motion changes between two.
    """
    radius, cell = float(network.radius[0]), network.cell_size
    low, high = (float(z) for z in network.wall_position)
    bounds = zip("xyz", (0.0, 0.0, low - radius), (cell[0], cell[1], high + radius), strict=True)
    lines = ["FCC crystal", "", f"{network.n_particles} atoms", "1 atom types", ""]
    lines += [f"{float(a)!r} {float(b)!r} {axis}lo {axis}hi" for axis, a, b in bounds]
    lines += ["", "Atoms # sphere", ""]
    for k, (x, y, z) in enumerate(network.position.tolist()):
        lines.append(f"{k + 1} 1 {2 * radius!r} {GLASS.density!r} {x!r} {y!r} {z!r}")
    (folder / "scene.data").write_text("\n".join(lines) + "\n")
    chain = wall_to_wall_chain(network)
    pulse = round(1 / (INPUT_FREQUENCY * time_step))
    variables = {
        "data": "scene.data",
        "young": GLASS.young,
        "poisson": GLASS.poisson,
        "friction": 0.1,
        "low": low,
        "high": high,
        "amplitude": amplitude,
        "period": 1 / INPUT_FREQUENCY,
        "step": time_step,
        "pulse": pulse,
        "rest": round(duration / time_step) - pulse,
        "every": every,
        "records": "scene.dump",
        "chain": " ".join(str(k + 1) for k in chain),
    }
    command = ["lmp", "-in", str(SCRIPT), "-log", "none"]
    for name, value in variables.items():
        command += ["-var", name, value if isinstance(value, str) else repr(value)]
    spent = median_of(times, lambda: run_command(command, folder, folder / "scene.log"))
    z = []
    for block in (folder / "scene.dump").read_text().split("ITEM: TIMESTEP\n")[1:]:
        rows = np.array([line.split() for line in block.splitlines()[8:]], float)
        z.append(rows[:, 1])
    order = np.argsort(np.argsort(chain))  # dumped in the order of the ids
    return (np.array(z) - z[0])[:, order], spent
