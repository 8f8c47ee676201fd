"""A state of a compression chain settled with more friction; caseNN.rest.sample.h5.

    yade-batch cases/random.table yade_scripts/rest.py

The friction of all contacts is raised from mu_comp to mu_wave, so that sliding is no longer in
the way (Otsubo et al. 2017, section 2), and the spheres settle in a fixed cell with damping; the
rest is for `modal relax`. The chain's state, products/chain_mu0.4/STRESSPa.sample.h5, stays as it
is. Environment: WAVE_PRODUCTS.
"""

import sys
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

from yade import O, config
from yade.utils import readParamsFromTable

from modal.sample import read_sample, write_sample
from modal.storage import InputError, sha256
from yade_scripts import compression
from yade_scripts.scene import finish, products_folder
from yade_scripts.state import build_scene, read_scene

DAMPING = 0.5
UNBALANCED = 1e-5
"""Mean residual force over mean contact force from which `modal relax` takes few steps."""
PATIENCE = 6000
CHECK = 100

readParamsFromTable(noTableOk=True, unknownOk=True, case=30, mu_comp=0.4, mu_wave=0.5, stress=1e5)
from yade.params.table import case, mu_comp, mu_wave, stress  # noqa: E402


def main():
    """Settle and write, unless the sample of this very state is there."""
    folder = products_folder()
    state_path = folder / f"chain_mu{mu_comp:g}" / f"{stress:g}Pa.sample.h5"
    path = folder / f"case{case:02d}.rest.sample.h5"
    if not mu_wave >= mu_comp:
        raise InputError(f"case {case}: mu_wave {mu_wave} is below mu_comp {mu_comp}; raise it")
    state = read_sample(state_path)
    parent = sha256(state_path)
    if path.exists() and read_sample(path).provenance.get("parent_sha256") == parent:
        print(f"{path}: already there")
        return
    n = len(state.position)
    state.friction = mu_wave
    state.velocity = state.angular_velocity = state.strain_rate = None
    build_scene(state, margin=0.05, damping=DAMPING)
    O.dt = compression.time_step(stress)
    step = 0
    while step < PATIENCE:
        O.run(CHECK, wait=True)
        step += CHECK
        ratio = compression.unbalanced()
        line = f"case {case}: step {step}, unbalanced {ratio:.1e}"
        print(line, end="\r" if sys.stdout.isatty() else "\n", flush=True)
        if ratio < UNBALANCED:
            break
    settled = read_scene(n, mu_wave, moving=False)
    xx, yy, zz = compression.principal_stresses(n)
    settled.study = state.study | {
        "case": str(case),
        "stress": float(stress),
        "mu_comp": float(mu_comp),
        "mu_wave": float(mu_wave),
        "unbalanced": compression.unbalanced(),
        "stress_xx": xx,
        "stress_yy": yy,
        "stress_zz": zz,
        "rest_steps": step,
    }
    settled.provenance = {
        "command": "yade_scripts/rest.py",
        "versions": f"yade {config.version}",
        "parent": state_path.name,
        "parent_sha256": parent,
    }
    write_sample(path, settled)
    print(f"{path}: unbalanced {compression.unbalanced():.1e} after {step} steps")


finish(main)
