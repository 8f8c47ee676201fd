"""
A sweep
=======

Many packings in one loop: V_P and V_S of crystals and of small random packings over four decades of
stress. Hertz's contacts alone give the power 1/6, which the crystal must show; the excess of a
random packing is that of its new contacts.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import modal

STRESSES = (1e4, 1e5, 1e6, 1e7)  # Pa
SPHERES = 300  # small, for a short example: velocities scatter by some per cent
SEEDS = (1, 2)

# %%
# **The sweep.** A packing, its moduli, a row of the table.


def row_of(kind, stress, seed, packing):
    """Return velocities along z and contacts per sphere, with what names the packing."""
    moduli = modal.elastic_moduli(packing)
    contacts = 2 * packing.n_contacts / packing.n_particles
    return {
        "packing": kind,
        "stress, kPa": stress / 1e3,
        "seed": seed,
        "contacts": contacts,
        "V_P, m/s": moduli.v_p,
        "V_S, m/s": moduli.v_s,
    }


rows = []
for stress in STRESSES:
    crystal = modal.fcc(stress=stress, cells=(3, 3, 6), periodic_z=True)
    rows.append(row_of("FCC", stress, 0, crystal))
    for seed in SEEDS:
        packing = modal.random_packing(SPHERES, stress=stress, seed=seed, periodic=True)
        rows.append(row_of("random", stress, seed, packing))
table = pd.DataFrame(rows)
table.round(2)

# %%
# **The powers of stress**, by least squares in logarithms.

powers = {}
for kind, group in table.groupby("packing"):
    x = np.log(group["stress, kPa"])
    powers[kind] = {name: np.polyfit(x, np.log(group[name]), 1)[0] for name in table.columns[4:]}
pd.DataFrame(powers).round(4)

# %%
# **A picture.** The line is Hertz's power through the crystal's first point.

figure, axes = plt.subplots(figsize=(5, 3), layout="constrained")
for (kind, group), mark in zip(table.groupby("packing"), "so", strict=True):
    axes.loglog(group["stress, kPa"], group["V_P, m/s"], f"k{mark}", mfc="w", label=f"{kind}, V_P")
    axes.loglog(group["stress, kPa"], group["V_S, m/s"], f"k{mark}", ms=4, label=f"{kind}, V_S")
x = np.array(STRESSES) / 1e3
first = table[table["packing"] == "FCC"].iloc[0]
axes.loglog(x, first["V_P, m/s"] * (x / x[0]) ** (1 / 6), "k-", lw=0.6, label="power 1/6")
axes.set(xlabel="stress, kPa", ylabel="velocity, m/s")
axes.legend(frameon=False, fontsize=7)
plt.show()
