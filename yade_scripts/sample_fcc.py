"""Sample of an FCC case: placed in balance, checked, written as products/caseNN.network.h5.

    yade -n -x -j1 yade_scripts/sample_fcc.py            (case 2)
    yade-batch cases/fcc.table yade_scripts/sample_fcc.py

Environment: WAVE_PRODUCTS names the folder of products (default: products).
"""

import os
import sys
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O, config
from yade.utils import readParamsFromTable

from modal.hertz_mindlin import GLASS
from modal.network import read_network, write_network
from modal.storage import InputError
from yade_scripts.export import contact_network
from yade_scripts.scene import ROOT, find_contacts, place_fcc

ROUND_OFF = 100 * np.finfo(float).eps
"""Relative error of a position; divided by overlap / length it bounds the residual force."""

readParamsFromTable(
    noTableOk=True,
    case=2,
    mu_comp=0.0,
    mu_wave=0.1,
    stress=1e5,
    input_frequency=1e5,
    width=4,
    layers=200,
)
from yade.params.table import case, layers, mu_comp, mu_wave, stress, width  # noqa: E402


def main():
    """Make the sample unless a valid one is there; returns the exit status."""
    folder = Path(os.environ.get("WAVE_PRODUCTS", ROOT / "products"))
    path = folder / f"case{case:02d}.network.h5"
    try:
        if path.exists():
            read_network(path)
            print(f"{path}: already there")
            return 0
    except InputError as error:
        print(f"{error}; making it again")
    try:
        sizes = place_fcc(width, layers, stress, mu_wave)
        find_contacts(sizes)
        residual = np.array([list(O.forces.f(k, sync=True)) for k in range(sizes["n"])])
        mean = np.mean([i.phys.normalForce.norm() for i in O.interactions if i.isReal])
        ratio = abs(residual).max() / mean
        overlap = min(i.geom.penetrationDepth for i in O.interactions if i.isReal)
        tolerance = ROUND_OFF * sizes["length"] / overlap
        if ratio > tolerance:
            raise InputError(f"case {case}: residual force {ratio:.1e} of the mean; not in balance")
        walls = [O.forces.f(sizes["n"] + k, sync=True)[2] / sizes["area"] for k in (0, 1)]
        if max(abs(-walls[0] / stress - 1), abs(walls[1] / stress - 1)) > tolerance:
            raise InputError(f"case {case}: wall stresses {walls} Pa, target {stress} Pa")
        study = {
            "case": str(case),
            "stress": float(stress),
            "mu_comp": float(mu_comp),
            "mu_wave": float(mu_wave),
            "young": GLASS.young,
            "poisson": GLASS.poisson,
            "density": GLASS.density,
        }
        provenance = {
            "command": "yade_scripts/sample_fcc.py",
            "versions": f"yade {config.version}, numpy {np.__version__}",
            "residual_force_ratio": float(ratio),
        }
        write_network(path, contact_network(sizes, study, provenance))
    except (ValueError, InputError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    count = O.interactions.countReal()
    print(f"{path}: {sizes['n']} spheres, {count} contacts, residual {ratio:.1e} of the mean force")
    return 0


status = main()
sys.stdout.flush()
os._exit(status)  # YADE's own exit would turn every status into 0.
