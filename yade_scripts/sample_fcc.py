"""Place the FCC crystal of a case in balance, check it, and write products/caseNN.network.h5.

    yade -n -x -j1 yade_scripts/sample_fcc.py            (case 2)
    yade-batch own.table yade_scripts/sample_fcc.py

The environment variable WAVE_PRODUCTS names the folder of products (default: products).
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
    find_contacts,
    finish,
    is_product_current,
    place,
    products_folder,
    set_engines,
)
from yade_scripts.servo import wall_stresses

POSITION_ERROR = 100 * np.finfo(float).eps
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
    """Make the sample unless a current one exists."""
    path = products_folder() / f"case{case:02d}.network.h5"
    settings = {"stress": float(stress), "mu_comp": float(mu_comp), "mu_wave": float(mu_wave)}
    made = Provenance(
        "yade_scripts/sample_fcc.py",
        settings | {"width": width, "layers": layers},
        versions=versions(yade=config.version),
    )
    if is_product_current(path, made, read_network):
        return
    if width < 3:
        raise InputError(
            "width",
            f"width {width}",
            "YADE has one contact for each pair of spheres",
            "take at least 3 spheres a side",
        )
    crystal = fcc(stress, (width, width, layers))
    n = crystal.n_particles
    place(crystal.position, crystal.cell_size[:2].tolist(), crystal.wall_position, mu_wave)
    set_engines()
    find_contacts(expected=crystal.n_contacts)
    residual = unbalancedForce(useMaxForce=True)
    overlaps = [contact.geom.penetrationDepth for contact in O.interactions if contact.isReal]
    tolerance = POSITION_ERROR * crystal.length / min(overlaps)
    if residual > tolerance:
        raise InputError(
            "unbalanced",
            f"case {case}: not in balance",
            f"residual force {residual:.1e} of the mean",
        )
    stresses = wall_stresses(n)
    if max(abs(wall_stress / stress - 1) for wall_stress in stresses) > tolerance:
        raise InputError(
            "wall_stress", f"case {case}", f"wall stresses {stresses} Pa, target {stress} Pa"
        )
    study = {"case": str(case)} | settings
    study |= {name: getattr(GLASS, name) for name in ("young", "poisson", "density")}
    provenance = made.attributes() | {"residual_force_ratio": residual}
    write_network(path, contact_network(n, study, provenance))
    print(
        f"{path}: {n} spheres, {crystal.n_contacts} contacts, residual {residual:.1e} of the mean "
        "force"
    )


finish(main)
