"""
Modes that are no waves
=======================

Natural frequencies of 900 periodic packings below their first wave: how many there are, how many
spheres move in each, and how much they turn. Three frictions give three numbers of contacts z.

`python examples/soft_modes.py FOLDER` writes the figure and the powers into a folder. It reads
`results/soft_modes`; with the results of `studies/soft_modes.yaml` as second argument it first
makes these two tables of them.
"""

import gzip
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from _committed import PEAK_SLOPE, RESULTS, results, write, write_page

HOME = RESULTS / "soft_modes"
DRAWS = 400  # of packings, for the errors
RANGES = (0.1, 0.5), (0.2, 0.5), (0.5, 0.8)  # of f / f*, in which a power is told


def gather(folder):
    """Write tables of packings and of their modes from the results of the study."""
    packings = []
    modes = ["packing,frequency_hz,spheres,rotation,contacts"]
    for k, (_, value, found) in enumerate(results("*.json", folder)):
        seed = int(found["name"].partition("seed")[2])
        row = {"friction": found["mu_comp"], "seed": seed, "spheres": 1000 if seed < 1001 else 2000}
        row |= {"z": value["coordination_of_bearing"], "void_ratio": value["void_ratio"]}
        row |= {"rattlers": value["rattlers"], "f_max_hz": value["highest_frequency"]}
        row |= {"first_wave_hz": value["first_wave"], "settled": int(not found["unsettled"])}
        packings.append({name: f"{x:.7g}" for name, x in row.items()})
        at, spheres, _ = found["curves"]["soft_participation"]
        of_mode = (found["curves"][f"soft_{name}"][1] for name in ("rotation", "contacts"))
        for f, p, r, c in zip(at, spheres, *of_mode, strict=True):
            modes.append(f"{k},{f:.5g},{p:.3g},{r:.2g},{c:.0f}")
    HOME.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(packings).to_csv(HOME / "packings.csv", index=False)
    packed = gzip.compress("\n".join([*modes, ""]).encode(), mtime=0)
    (HOME / "modes.csv.gz").write_bytes(packed)


if __name__ == "__main__" and len(sys.argv) == 3:
    gather(Path(sys.argv[2]))

packings = pd.read_csv(HOME / "packings.csv")
modes = pd.read_csv(HOME / "modes.csv.gz")
packings["large"] = packings["spheres"] > 1000
groups = packings.groupby(["friction", "large"])
packings["f_star"] = PEAK_SLOPE * (groups["z"].transform("mean") - 4)
packings["f_star"] *= groups["f_max_hz"].transform("mean")
# The first wave of any packing of a group is an end of what is seen of all of them.
packings["end"] = packings["first_wave_hz"] / packings["f_star"]
modes["x"] = modes["frequency_hz"] / packings["f_star"].to_numpy()[modes["packing"]]

# %%
# **The power of the density of states.** D ~ f^b between two frequencies, by maximum likelihood:
# the mean of log f decides. Errors are those of drawing whole packings with replacement.


def power(x, low, high):
    """Return the exponent b of a density x^b of numbers x between two ends."""
    inside = np.log(x[(x > low) & (x < high)] / low)
    if len(inside) < 8:
        return np.nan
    trial = np.linspace(-3, 25, 5601) + 1e-9
    span = np.log(high / low)
    mean = span / -np.expm1(-trial * span) - 1 / trial
    return trial[np.argmin(abs(mean - inside.mean()))] - 1


def with_error(chosen, low, high, modes=modes):
    """Return the power of the modes of some packings, its standard error, and their number."""
    members = [modes["x"].to_numpy()[modes["packing"] == k] for k in chosen]
    random = np.random.default_rng(1)
    every = np.concatenate(members)
    draws = random.integers(len(members), size=(DRAWS, len(members)))
    found = [power(np.concatenate([members[k] for k in draw]), low, high) for draw in draws]
    return power(every, low, high), np.std(found), int(((every > low) & (every < high)).sum())


rows = []
for (friction, _), members_of_group in packings.groupby(["friction", "large"]):
    end = members_of_group["end"].min()
    row = {
        "friction": friction,
        "spheres": members_of_group["spheres"].iloc[0],
        "packings": len(members_of_group),
    }
    row |= {
        "z": members_of_group["z"].mean(),
        "f_star_khz": members_of_group["f_star"].iloc[0] / 1e3,
    }
    row |= {"first_wave_over_f_star": end}
    for low, high in RANGES:
        b, error, count = with_error(members_of_group.index, low, min(high, end))
        settled, _, _ = with_error(
            members_of_group.index[members_of_group["settled"] == 1], low, min(high, end)
        )
        name = f"{low:g}_to_{high:g}"
        row |= {f"power_{name}": b, f"error_{name}": error, f"modes_{name}": count}
        row |= {f"power_settled_{name}": settled}
    lowest = modes[modes["packing"].isin(members_of_group.index)].query("0.1 < x < 0.5")
    row |= {"per_1000_spheres": 1000 * len(lowest) / members_of_group["spheres"].sum()}
    row |= {"spheres_that_move": lowest["spheres"].median(), "rotation": lowest["rotation"].mean()}
    row |= {"at_most_three_contacts": (lowest["contacts"] <= 3).mean()}
    rows.append(row)
rows = pd.DataFrame(rows)
print(rows.T.to_string(header=False, float_format="%.4g"))

# %%
# **Which modes have which power?** The sphere that moves most in a mode has few contacts in nine of
# ten modes. The powers of all packings together, by the number of its contacts.

MOVERS = {
    "two": modes["contacts"] == 2,
    "three": modes["contacts"] == 3,
    "at most three": modes["contacts"] <= 3,
    "four or more": modes["contacts"] >= 4,
}
movers = []
for name, chosen in MOVERS.items():
    low, high = RANGES[0]
    b, error, count = with_error(packings.index, low, high, modes[chosen])
    movers.append({"contacts": name, "modes": count, "power": b, "error": error})
movers = pd.DataFrame(movers)
print(movers.to_string(index=False, float_format="%.3g"))

# %%
# **The figure.** Over f*, the line on which the peak of D(f) / f^2 lies.

figure, axes = plt.subplots(1, 3, figsize=(7, 2.6), layout="constrained")
looks = dict(zip(rows["friction"].unique(), ("0.1 o", "0.45 s", "0.75 ^"), strict=True))
for (_, row), (_, members_of_group) in zip(rows.iterrows(), groups, strict=True):
    modes_of_group = modes[modes["packing"].isin(members_of_group.index)]
    small = row["spheres"] < 1500
    edges = np.geomspace(0.1, row["first_wave_over_f_star"], 12)
    modes_by_bin = [
        modes_in_bin
        for _, modes_in_bin in modes_of_group.groupby(
            pd.cut(modes_of_group["x"], edges), observed=False
        )
    ]
    middle = np.sqrt(edges[1:] * edges[:-1])
    count = np.array([len(modes_in_bin) for modes_in_bin in modes_by_bin])
    per = np.diff(edges) * members_of_group["spheres"].sum()
    shade, mark = looks[row["friction"]].split()
    style = {"color": shade if small else "w", "mec": "k", "mew": 0.4, "ms": 3.5}
    style |= {"fmt": mark, "elinewidth": 0.5}
    style["label"] = f"{row['z']:.2f}" + ("" if small else ", 2,000 spheres")
    x, y, bars = (each[count > 0] for each in (middle, count / per, np.sqrt(count) / per))
    axes[0].errorbar(x, y, bars, ecolor="k", **style)
    for ax, name in ((axes[1], "spheres"), (axes[2], "rotation")):
        enough = [
            modes_in_bin[name].quantile((0.25, 0.5, 0.75))
            for modes_in_bin in modes_by_bin
            if len(modes_in_bin) > 7
        ]
        low, median, high = np.transpose(enough)
        bars = (median - low, high - median)
        ax.errorbar(middle[count > 7], median, bars, ecolor="0.6", **style)
for ax in axes:
    ax.set(xscale="log", xlabel="f / f*", xlim=(0.07, 2.2))
    ax.set_xticks([0.1, 0.2, 0.5, 1, 2], ["0.1", "0.2", "0.5", "1", "2"])
    ax.minorticks_off()
along = np.array([0.15, 0.5])
for b, line, end in ((2, "k-", 2e-3), (4, "k--", 5e-4)):
    axes[0].plot(along, end * (along / 0.5) ** b, line, lw=0.7)
    axes[0].text(0.54, end, f"$f^{b}$", va="center")
axes[0].set(yscale="log", ylabel="modes a sphere, per f / f*", ylim=(5e-6, 0.3))
axes[2].legend(title="z", frameon=False, fontsize=6, title_fontsize=7, loc="upper right")
axes[1].set(yscale="log", ylabel="spheres that move")
axes[2].set(ylabel="share of rotation", ylim=(0.3, 1.09), yticks=(0.4, 0.6, 0.8, 1))
plt.show()

if __name__ == "__main__" and len(sys.argv) > 1:
    folder = Path(sys.argv[1])
    tables = {"powers": rows, "movers": movers}
    write(folder, {"soft_modes": figure}, tables, float_format="%.7g", na_rep="nan")
    page = {"z": "{z:.2f}", "friction": "{friction:g}", "packings": "{packings}"}
    page |= {"spheres": "{spheres:,}", "f*, kHz": "{f_star_khz:.1f}"}
    for low, high in RANGES:
        name = f"{low:g}_to_{high:g}".replace(".", "_")  # dots are none in a form
        form = f"{{power_{name}:.2f}} ± {{error_{name}:.2f}}"
        page[f"power, {low:g} to {high:g} f*"] = form
    page["modes from 0.1 to 0.5 f*, of 1,000 spheres"] = "{per_1000_spheres:.2f}"
    page["spheres that move"] = "{spheres_that_move:.1f}"
    page["rotation"] = "{rotation:.2f}"
    page["first mover has 2 or 3 contacts"] = "{at_most_three_contacts:.2f}"
    rows = rows.rename(columns=lambda name: name.replace(".", "_"))
    write_page(folder / "powers.md", rows, page)
    page = {"contacts of the sphere that moves most": "{contacts}", "modes": "{modes}"}
    page["power, 0.1 to 0.5 f*"] = "{power:.2f} ± {error:.2f}"
    write_page(folder / "movers.md", movers, page)
