"""
Packings of sticky spheres
==========================

Packings of JKR spheres of four strengths of adhesion, three seeds each: their void ratio e,
coordination number z, and velocities. The strength is the largest pull of a contact divided by the
force p d² with which the pressure p loads a sphere of diameter d.

`python examples/adhesion.py FOLDER` writes the means into a folder. It reads
`results/adhesion/packings.csv`; `python examples/adhesion.py FOLDER make` first makes the packings
that this table lacks, some minutes each.
"""

import sys
from dataclasses import replace

import numpy as np
import pandas as pd
from _committed import RESULTS, mean_with_error, write, write_page
from _table_of_seeds import complete_table

import modal
from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, RADIUS
from modal.packing.state import coordination_without_rattlers, mobilised_per_particle

TABLE = RESULTS / "adhesion" / "packings.csv"
PRESSURE = 1e4
STRENGTHS = (0.0, 0.01, 0.1, 1.0)
SEEDS = (1, 2, 3)
SPHERES = 1000
FRICTION = 0.3


def make_packing(strength, seed):
    """Return the row of a packing of spheres whose contacts pull by `strength` times p d²."""
    material = GLASS
    work = strength * PRESSURE * (2 * RADIUS) ** 2 / (1.5 * np.pi * RADIUS / 2)
    if work:
        material = replace(GLASS, contact_model=f"jkr {work:.6g}")
    network = modal.random_packing(
        SPHERES, PRESSURE, FRICTION, seed, periodic=True, material=material
    )
    z, rattlers = coordination_without_rattlers(network)
    moduli = modal.elastic_moduli(network)
    return {
        "strength": strength,
        "work_j_per_m2": work,
        "contact_model": network.study.get("contact_model", HERTZ_MINDLIN),
        "seed": seed,
        "void_ratio": network.study["void_ratio"],
        "z": z,
        "rattlers": rattlers,
        "mobilised": mobilised_per_particle(network),
        "pulling_share": float((network.force_normal < 0).mean()),
        "v_p": moduli.v_p,
        "v_s": moduli.v_s,
        "settled": int(network.study["settled"]),
    }


if __name__ == "__main__" and sys.argv[2:] == ["make"]:
    complete_table(TABLE, "strength", STRENGTHS, SEEDS, make_packing)

packings = pd.read_csv(TABLE)
rows = []
for strength, group in packings.groupby("strength"):
    row = {"strength": strength, "packings": len(group), "settled": group["settled"].sum()}
    for name in ("void_ratio", "z", "mobilised", "pulling_share", "v_p", "v_s"):
        row[name], row[f"{name}_error"] = mean_with_error(group[name])
    rows.append(row)
means = pd.DataFrame(rows)
print(means.to_string(index=False, float_format="%.4g"))

if __name__ == "__main__" and len(sys.argv) > 1:
    write(sys.argv[1], {}, {"means": means}, float_format="%.5g")
    columns = {
        "largest pull over p d²": "{strength:g}",
        "packings (settled)": "{packings:.0f} ({settled:.0f})",
        "e": "{void_ratio:.3f} ± {void_ratio_error:.3f}",
        "z": "{z:.2f} ± {z_error:.2f}",
        "share of contacts that pull": "{pulling_share:.3f} ± {pulling_share_error:.3f}",
        "V_P, m/s": "{v_p:.0f} ± {v_p_error:.0f}",
        "V_S, m/s": "{v_s:.0f} ± {v_s_error:.0f}",
    }
    write_page(f"{sys.argv[1]}/means.md", means, columns)
