"""
Mobilised contacts and isostaticity
===================================

The coordination number z of packings against their number n_m of contacts at the friction limit
per sphere, and the isostatic z = 4 + 2 n_m / 3 (Shundyak, van Hecke, van Saarloos 2007). Eight
seeds at each friction.

`python examples/mobilised.py FOLDER` writes the means into a folder. It reads
`results/mobilised/packings.csv`; `python examples/mobilised.py FOLDER make` first makes the
packings that this table lacks, some minutes each.
"""

import sys

import pandas as pd
from _committed import RESULTS, mean_with_error, write, write_page
from _table_of_seeds import complete_table

import modal
from modal.packing.sample import sample_of_network
from modal.packing.state import (
    coordination_without_rattlers,
    isostatic_coordination,
    mobilised_per_particle,
)
from modal.preparation.relax import relax
from modal.tools.errors import InputError

TABLE = RESULTS / "mobilised" / "packings.csv"
PRESSURE = 1e5
FRICTIONS = (0.03, 0.1, 0.3)
SEEDS = range(1, 9)
SPHERES = 400
RESIDUAL = 1e-6


def make_packing(friction, seed):
    """Return the row of a packing as compressed, and brought to rest with all its friction."""
    packed = modal.random_packing(SPHERES, PRESSURE, friction, seed, periodic=True)
    z, rattlers = coordination_without_rattlers(packed)
    row = {
        "friction": friction,
        "seed": seed,
        "void_ratio": packed.study["void_ratio"],
        "z": z,
        "rattlers": rattlers,
        "mobilised": mobilised_per_particle(packed),
        "settled": int(packed.study["settled"]),
    }
    try:
        rested, state = relax(
            sample_of_network(packed, friction), tolerance=RESIDUAL, mobilised=True
        )
    except InputError:
        return row | {"at_rest": 0}
    network = rested.network()
    return row | {
        "z_at_rest": coordination_without_rattlers(network)[0],
        "mobilised_at_rest": mobilised_per_particle(network),
        "at_rest": int(state.at_rest),
    }


if __name__ == "__main__" and sys.argv[2:] == ["make"]:
    complete_table(TABLE, "friction", FRICTIONS, SEEDS, make_packing)

packings = pd.read_csv(TABLE)
packings["above_isostatic"] = packings["z"] - isostatic_coordination(packings["mobilised"])
rows = []
for friction, group in packings.groupby("friction"):
    row = {"friction": friction, "packings": len(group), "at_rest": group["at_rest"].sum()}
    for name in ("z", "mobilised", "above_isostatic", "z_at_rest", "mobilised_at_rest"):
        row[name], row[f"{name}_error"] = mean_with_error(group[name])
    row["isostatic"] = isostatic_coordination(row["mobilised"])
    rows.append(row)
means = pd.DataFrame(rows)
print(means.to_string(index=False, float_format="%.4g"))

if __name__ == "__main__" and len(sys.argv) > 1:
    write(sys.argv[1], {}, {"means": means}, float_format="%.5g")
    columns = {
        "friction": "{friction:g}",
        "packings (at rest)": "{packings:.0f} ({at_rest:.0f})",
        "z": "{z:.3f} ± {z_error:.3f}",
        "n_m": "{mobilised:.3f} ± {mobilised_error:.3f}",
        "4 + 2 n_m / 3": "{isostatic:.3f}",
        "z above it": "{above_isostatic:.3f} ± {above_isostatic_error:.3f}",
        "n_m at rest": "{mobilised_at_rest:.3f} ± {mobilised_at_rest_error:.3f}",
    }
    write_page(f"{sys.argv[1]}/means.md", means, columns)
