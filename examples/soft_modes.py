"""
Modes that are no waves
=======================

Natural frequencies of 470 periodic packings below their first wave: how many there are, how many
spheres move in each, and how much they turn. Three frictions give three numbers of contacts z.

`python examples/soft_modes.py FOLDER` writes the figure and the powers into a folder. It reads
`results/soft_modes`; with the results of `studies/soft_modes.yaml` as second argument it first
makes these two tables of them.
"""

import gzip
import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

HOME = Path(sys.argv[0]).resolve().parents[1] / "results/soft_modes"
DRAWS = 400  # of packings, for the errors
RANGES = (0.1, 0.5), (0.2, 0.5), (0.5, 0.8)  # of f / f*, in which a power is told
SLOPE = 0.058  # f* = SLOPE (z - 4) f_max: the peak of D(f) / f^2 of the study's packings
OF_PACKING = ("friction", "seed", "spheres", "z", "void_ratio", "rattlers", "f_max_hz")
OF_PACKING += ("first_wave_hz", "settled")


def gather(results):
    """Tables of packings and of their modes, from the results of the study."""
    packings, modes = [], []
    for path in sorted(results.glob("*.json")):
        found = json.loads(path.read_text())
        value = {name: each["value"] for name, each in found["values"].items()}
        seed = int(found["name"].partition("seed")[2])
        number = [found["mu_comp"], seed, 1000 if seed < 1001 else 2000]
        number += [value[n] for n in ("coordination_of_bearing", "void_ratio", "rattlers")]
        number += [value["highest_frequency"], value["first_wave"], int(not found["unsettled"])]
        at, spheres, _ = found["curves"]["soft_participation"]
        columns = [
            at,
            spheres,
            *(found["curves"][f"soft_{n}"][1] for n in ("rotation", "contacts")),
        ]
        modes += [(len(packings), *mode) for mode in zip(*columns, strict=True)]
        packings.append([f"{x:.7g}" for x in number])
    HOME.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(packings, columns=OF_PACKING).to_csv(HOME / "packings.csv", index=False)
    lines = ["packing,frequency_hz,spheres,rotation,contacts"]
    lines += [f"{k},{f:.5g},{p:.3g},{r:.2g},{c:.0f}" for k, f, p, r, c in modes]
    packed = gzip.compress("\n".join([*lines, ""]).encode(), mtime=0)
    (HOME / "modes.csv.gz").write_bytes(packed)


if __name__ == "__main__" and len(sys.argv) == 3:
    gather(Path(sys.argv[2]))

packings = np.genfromtxt(HOME / "packings.csv", delimiter=",", names=True)
of, frequency, spheres, rotation, contacts = np.loadtxt(
    HOME / "modes.csv.gz", delimiter=",", skiprows=1, unpack=True
)
of = of.astype(int)
group = packings["friction"] + 1e-3 * (packings["spheres"] > 1000)
star = np.zeros(len(packings))
for one in np.unique(group):
    in_it = group == one
    z, top = packings["z"][in_it].mean(), packings["f_max_hz"][in_it].mean()
    star[in_it] = SLOPE * (z - 4) * top
over_star = frequency / star[of]
# The first wave of any packing of a group is an end of what is seen of all of them.
end = {one: (packings["first_wave_hz"] / star)[group == one].min() for one in np.unique(group)}

# %%
# **The power of the density of states.** D ~ f^b between two frequencies, by maximum likelihood:
# the mean of log f decides. Errors are those of drawing whole packings with replacement.


def power(x, low, high):
    """b of a density x^b of some x between two ends."""
    inside = np.log(x[(x > low) & (x < high)] / low)
    if len(inside) < 8:
        return np.nan
    trial, span = np.linspace(-3, 25, 5601) + 1e-9, np.log(high / low)
    mean = span / -np.expm1(-trial * span) - 1 / trial
    return trial[np.argmin(abs(mean - inside.mean()))] - 1


def with_error(chosen, low, high):
    """The power of the modes of the chosen packings, its standard error, and their number."""
    members = [over_star[of == k] for k in np.flatnonzero(chosen)]
    random, every = np.random.default_rng(1), np.concatenate(members)
    draws = random.integers(len(members), size=(DRAWS, len(members)))
    found = [power(np.concatenate([members[k] for k in draw]), low, high) for draw in draws]
    return power(every, low, high), np.std(found), int(((every > low) & (every < high)).sum())


rows = []
for one in np.unique(group):
    chosen = group == one
    row = {"friction": packings["friction"][chosen][0], "spheres": packings["spheres"][chosen][0]}
    row |= {"packings": chosen.sum(), "z": packings["z"][chosen].mean()}
    row |= {"f_star_khz": star[chosen][0] / 1e3, "first_wave_over_f_star": end[one]}
    for low, high in RANGES:
        b, error, count = with_error(chosen, low, min(high, end[one]))
        settled, _, _ = with_error(chosen & (packings["settled"] == 1), low, min(high, end[one]))
        name = f"{low:g}_to_{high:g}"
        row |= {f"power_{name}": b, f"error_{name}": error, f"modes_{name}": count}
        row |= {f"power_settled_{name}": settled}
        print(
            f"friction {row['friction']:g}, {row['spheres']:.0f}: D ~ f^({b:.2f} +- {error:.2f})",
            end=" ",
        )
        print(f"between {low:g} and {high:g} f*, {count} modes; settled alone {settled:.2f}")
    lowest = chosen[of] & (over_star > 0.1) & (over_star < 0.5)
    row |= {"per_1000_spheres": 1000 * lowest.sum() / packings["spheres"][chosen].sum()}
    row |= {"spheres_that_move": np.median(spheres[lowest]), "rotation": rotation[lowest].mean()}
    row |= {"at_most_three_contacts": (contacts[lowest] <= 3).mean()}
    rows.append(row)

# %%
# **The figure.** Over f*, the line on which the peak of D(f) / f^2 lies.

plt.rcParams.update({"font.size": 8, "axes.linewidth": 0.6, "pdf.fonttype": 42})
plt.rcParams.update({"xtick.direction": "in", "ytick.direction": "in"})
figure, axes = plt.subplots(1, 3, figsize=(7, 2.6), layout="constrained")
shades = dict(zip(np.unique(packings["friction"]), ("0.1", "0.45", "0.75"), strict=True))
for row, one, mark in zip(rows, np.unique(group), "os^D", strict=True):
    chosen, small = (group == one)[of], row["spheres"] < 1500
    edges = np.geomspace(0.1, end[one], 12)
    count, _ = np.histogram(over_star[chosen], edges)
    middle, seen = np.sqrt(edges[1:] * edges[:-1]), count > 0
    per = np.diff(edges) * packings["spheres"][group == one].sum()
    style = {"color": shades[row["friction"]] if small else "w", "mec": "k", "mew": 0.4, "ms": 3.5}
    label = f"{row['z']:.2f}" + ("" if small else ", 2,000 spheres")
    bars = (np.sqrt(count) / per)[seen]
    axes[0].errorbar(
        middle[seen],
        (count / per)[seen],
        bars,
        fmt=mark,
        ecolor="k",
        elinewidth=0.5,
        label=label,
        **style,
    )
    for ax, number in ((axes[1], spheres), (axes[2], rotation)):
        ends = zip(edges[:-1], edges[1:], strict=True)
        parts = [number[chosen & (over_star > a) & (over_star < b)] for a, b in ends]
        enough = [len(part) > 7 for part in parts]
        quarters = np.array([np.percentile(p, (25, 50, 75)) for p in parts if len(p) > 7]).T
        spread = abs(quarters[[0, 2]] - quarters[1])
        ax.errorbar(
            middle[enough], quarters[1], spread, fmt=mark, ecolor="0.6", elinewidth=0.5, **style
        )
for ax in axes:
    ax.set(xscale="log", xlabel="f / f*", xlim=(0.07, 2.2))
    ax.set_xticks([0.1, 0.2, 0.5, 1, 2], ["0.1", "0.2", "0.5", "1", "2"])
    ax.minorticks_off()
along = np.array([0.12, 0.5])
for b, line in ((2, "k-"), (4, "k--")):
    axes[0].plot(along, 4e-3 * (along / 0.5) ** b, line, lw=0.7)
    axes[0].text(0.13, 4e-3 * (0.12 / 0.5) ** b, f"$f^{b}$", va="top")
axes[0].set(yscale="log", ylabel="modes a sphere, per f / f*", ylim=(5e-6, 0.3))
axes[0].legend(title="z", frameon=False, fontsize=6, title_fontsize=7, loc="lower right")
axes[1].set(yscale="log", ylabel="spheres that move")
axes[2].set(ylabel="share of rotation", ylim=(0.3, 0.9))
plt.show()

if __name__ == "__main__" and len(sys.argv) > 1:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "soft_modes.png", dpi=200)
    figure.savefig(folder / "soft_modes.pdf", metadata={"CreationDate": None})
    as_csv = {"index": False, "float_format": "%.4g", "na_rep": "nan"}
    pd.DataFrame(rows).to_csv(folder / "powers.csv", **as_csv)
    cells = []
    for r in rows:
        line = [f"{r['z']:.2f}", f"{r['friction']:g}", f"{r['packings']} of {r['spheres']:,.0f}"]
        line += [f"{r['f_star_khz']:.1f}"]
        for name in (f"{a:g}_to_{b:g}" for a, b in RANGES):
            line += [f"{r[f'power_{name}']:.2f} ± {r[f'error_{name}']:.2f}"]
        line += [f"{r['per_1000_spheres']:.2f}", f"{r['spheres_that_move']:.1f}"]
        line += [f"{r['rotation']:.2f}", f"{100 * r['at_most_three_contacts']:.0f} %"]
        cells.append(line)
    head = ["z", "friction", "packings, spheres", "f*, kHz"]
    head += [f"power, {a:g} to {b:g} f*" for a, b in RANGES]
    head += ["modes from 0.1 to 0.5 f*, of 1,000 spheres", "spheres that move", "rotation"]
    head += ["first mover has 2 or 3 contacts"]
    lines = [head, ["---"] * len(head), *cells]
    text = "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"
    (folder / "powers.md").write_text(text)
