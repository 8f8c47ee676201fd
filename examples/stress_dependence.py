"""
Velocity against stress
=======================

Hertz's contacts become stiffer under load. In the crystal velocities grow as the power 1/6 of the
stress. In random packings they grow faster, since the stress also makes new contacts, and the more
so the fewer contacts there were.

`python examples/stress_dependence.py FOLDER` writes the figure and the tables into a folder. It
reads `results/isostaticity/samples`: packings of 35,201 spheres, three samples of each state.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from _committed import RESULTS, mean_with_error, results, write, write_page

import modal

STATES = pd.read_csv(RESULTS / "study/table1.csv").set_index("name")[["mu_comp", "stress_pa"]]
FRICTIONS = (0.0, 0.1, 0.4)
REFERENCE_STRESS = 1e5  # Pa

# %%
# **The samples.** Velocities of the longest waves along z, and Poisson's ratio of both.

samples = []
for stem, numbers, _ in results("isostaticity/samples/*.json"):
    case, seed = stem.split("_seed")
    friction, stress = STATES.loc[case]
    row = {"friction": friction, "stress_pa": stress, "seed": int(seed)}
    row |= {"v_p": numbers["v_p"], "v_s": numbers["v_s"]}
    row["poisson"] = (0.5 - (row["v_s"] / row["v_p"]) ** 2) / (1 - (row["v_s"] / row["v_p"]) ** 2)
    samples.append(row)
samples = pd.DataFrame(samples)
samples = samples[samples["friction"].isin(FRICTIONS)]

# %%
# **Means over samples** at each stress, with their standard errors, and the power of the stress by
# which they grow, by least squares; its error is what the errors of the means make of it. The
# power also changes along the path: beside it stand those of the first and of the last decade.

velocities = []
for (friction, stress), state in samples.groupby(["friction", "stress_pa"]):
    row = {"friction": friction, "stress_pa": stress, "samples": len(state)}
    for name in ("v_p", "v_s", "poisson"):
        row[name], row[f"{name}_error"] = mean_with_error(state[name])
    velocities.append(row)
velocities = pd.DataFrame(velocities)

powers = []
for friction, path in velocities.groupby("friction"):
    decades = np.log(path["stress_pa"].to_numpy() / REFERENCE_STRESS)
    for name in ("v_p", "v_s"):
        logarithm = np.log(path[name].to_numpy())
        error = (path[f"{name}_error"] / path[name]).to_numpy()
        # Least squares are a weighted sum of the logarithms.
        weight = (decades - decades.mean()) / np.sum((decades - decades.mean()) ** 2)
        power = weight @ logarithm
        slopes = np.diff(logarithm) / np.diff(decades)
        row = {"friction": friction, "velocity": name}
        row["power"] = power
        row["power_error"] = np.sqrt(weight**2 @ error**2)
        row["at_100_kpa"] = np.exp(np.mean(logarithm) - power * decades.mean())
        row["first_decade"] = slopes[0]
        row["last_decade"] = slopes[-1]
        powers.append(row)
powers = pd.DataFrame(powers)
for table in (velocities, powers):
    print(table.to_string(index=False, float_format="%.4g"))

# %%
# **The figure**: velocities with their fits, and Poisson's ratio. Dashed: the crystal.

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.8), layout="constrained")
stresses = np.geomspace(1e4, 1e7, 50)
crystal = np.array([modal.FccLattice(stress=each).velocity for each in stresses])
left.loglog(stresses / 1e3, crystal, "k--", lw=0.8, label="$V_P$ of the crystal")
for friction, mark in zip(FRICTIONS, "os^", strict=True):
    states = velocities[velocities["friction"] == friction]
    fits = powers[powers["friction"] == friction].set_index("velocity")
    for name, face in (("v_p", "k"), ("v_s", "w")):
        label = f"$V_{name[-1].upper()}$, friction {friction:g}"
        look = {"color": "k", "mfc": face, "ms": 4, "mew": 0.6}
        left.errorbar(
            states["stress_pa"] / 1e3, states[name], states[f"{name}_error"], fmt=mark,
            label=label, elinewidth=0.6, **look,
        )  # fmt: skip
        fit = fits.loc[name]
        line = fit["at_100_kpa"] * (stresses / REFERENCE_STRESS) ** fit["power"]
        left.loglog(stresses / 1e3, line, color="0.6", lw=0.6, zorder=0)
    right.errorbar(
        states["stress_pa"] / 1e3, states["poisson"], states["poisson_error"], fmt=mark,
        color="k", ms=4, label=f"friction {friction:g}", elinewidth=0.6,
    )  # fmt: skip
left.set(xlabel="stress, kPa", ylabel="velocity, m/s")
left.set_ylim(bottom=70)  # room for the legend
left.legend(frameon=False, fontsize=6, ncols=2, loc="lower center")
right.set(xlabel="stress, kPa", ylabel="Poisson's ratio", xscale="log", ylim=(0, 0.35))
right.legend(frameon=False)
plt.show()

if __name__ == "__main__" and len(sys.argv) == 2:
    tables = {"velocities": velocities, "powers": powers}
    write(sys.argv[1], {"stress_dependence": figure}, tables, float_format="%.4g", na_rep="nan")
    columns = {
        "friction": "{friction:g}",
        "velocity": "{velocity}",
        "power of the stress": "{power:.4f} ± {power_error:.4f}",
        "10 to 100 kPa": "{first_decade:.3f}",
        "1 to 10 MPa": "{last_decade:.3f}",
    }
    write_page(f"{sys.argv[1]}/powers.md", powers, columns)
    columns = {
        "friction": "{friction:g}",
        "stress, kPa": "{stress_kpa:g}",
        "V_P, m/s": "{v_p:.1f} ± {v_p_error:.1f}",
        "V_S, m/s": "{v_s:.1f} ± {v_s_error:.1f}",
        "Poisson's ratio": "{poisson:.3f} ± {poisson_error:.3f}",
    }
    page = velocities.assign(stress_kpa=velocities["stress_pa"] / 1e3)
    write_page(f"{sys.argv[1]}/velocities.md", page, columns)
