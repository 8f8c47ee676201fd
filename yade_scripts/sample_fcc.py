"""Sample of an FCC case: placed in balance, checked, written as products/caseNN.network.h5.

    yade -n -x -j1 yade_scripts/sample_fcc.py            (case 2)
    yade-batch own.table yade_scripts/sample_fcc.py

Environment: WAVE_PRODUCTS names the folder of products (default: products).
"""

import os
import sys
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O, config
from yade.utils import readParamsFromTable, unbalancedForce

from modal.formats.provenance import Provenance, versions
from modal.packing.contact_law import GLASS
from modal.packing.crystal import fcc
from modal.packing.network import read_network, write_network
from modal.tools.errors import InputError
from yade_scripts.export import contact_network
from yade_scripts.scene import (
    already_there,
    find_contacts,
    finish,
    place,
    products_folder,
    set_engines,
)
from yade_scripts.servo import wall_stresses

ROUND_OFF = 100 * np.finfo(float).eps
"""Relative error of a position; divided by overlap / length it bounds the residual force."""

readParamsFromTable(
    noTableOk=True,
    case=2,
    mu_comp=0.0,
    mu_wave=0.1,
    stress=1e5,
    width=4,
    layers=int(os.environ.get("WAVE_LAYERS", 200)),
    unknownOk=True,  # columns of the wave
)
from yade.params.table import case, layers, mu_comp, mu_wave, stress, width  # noqa: E402


def main():
    """Make the sample unless a valid one is there."""
    path = products_folder() / f"case{case:02d}.network.h5"
    settings = {"stress": float(stress), "mu_comp": float(mu_comp), "mu_wave": float(mu_wave)}
    made = Provenance(
        "yade_scripts/sample_fcc.py",
        settings | {"width": width, "layers": layers},
        versions=versions(yade=config.version),
    )
    if already_there(path, made, read_network):
        return
    if width < 3:
        raise InputError(
            "input", f"width {width}", "YADE needs at least 3 spheres a side (single contacts)"
        )
    crystal = fcc(stress, (width, width, layers))
    n = crystal.n_particles
    place(crystal.position, crystal.cell_size[:2].tolist(), crystal.wall_position, mu_wave)
    set_engines()
    find_contacts(expected=crystal.n_contacts)
    ratio = unbalancedForce(useMaxForce=True)
    least = min(contact.geom.penetrationDepth for contact in O.interactions if contact.isReal)
    tolerance = ROUND_OFF * crystal.length / least
    if ratio > tolerance:
        raise InputError(
            "input", f"case {case}", f"residual force {ratio:.1e} of the mean", "not in balance"
        )
    walls = wall_stresses(n)
    if max(abs(wall / stress - 1) for wall in walls) > tolerance:
        raise InputError("input", f"case {case}", f"wall stresses {walls} Pa, target {stress} Pa")
    study = {"case": str(case)} | settings
    study |= {name: getattr(GLASS, name) for name in ("young", "poisson", "density")}
    provenance = made.attributes() | {"residual_force_ratio": ratio}
    write_network(path, contact_network(n, study, provenance))
    found = f"{n} spheres, {crystal.n_contacts} contacts"
    print(f"{path}: {found}, residual {ratio:.1e} of the mean force")


finish(main)
