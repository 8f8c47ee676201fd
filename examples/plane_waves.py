"""
Scattering of plane waves and of a wall's pulse
===============================================

How fast disorder takes the energy of P- and S-waves, for several numbers of contacts z: the width
of the lines of plane waves in cells without walls, and the decay of a wall's pulse in other cells,
both over the frequency f* at which soft modes set in.

`python examples/plane_waves.py FOLDER` writes the figure and tables into a folder. It reads
`results/plane_waves/friction*.json`, the results of `studies/plane_waves.yaml`.
"""

import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

HOME = Path(sys.argv[0]).resolve().parents[1] / "results/plane_waves"
SLOPE = 0.058  # f* = SLOPE (z - 4) f_max: the peak of D(f) / f^2 of the study's packings
LIMIT = 1 / np.pi  # width over frequency at the Ioffe-Regel limit
DASHPOTS = 2.62e6  # Hz, Q f of dashpots of 1 %, friction 0, 100 kPa
SPANS = (0.5, 1.5), (1.5, 5)  # of f / f*, over which pulse and plane waves are compared
WAVES = {"P": "scattering_of_p", "S": "scattering_of_s"}

cells, pulses = [], []
for path in sorted(HOME.glob("friction*.json")):
    found = json.loads(path.read_text())
    value = {name: each["value"] for name, each in found["values"].items()}
    z = value["coordination_of_bearing"]
    cell = {"name": found["name"], "friction": found["mu_comp"], "z": z}
    cell |= {"f_star": SLOPE * (z - 4) * value["highest_frequency"]}
    curves = found["curves"]
    if "attenuation" in curves:
        # What falls as exp(-alpha x) has a line alpha v / pi wide, v the group velocity; results of
        # before do not have it, and V_P of the moduli stands for it.
        f, width, error = np.array(curves.get("scattering_of_pulse", curves["attenuation"]))
        scale = 1 if "scattering_of_pulse" in curves else value["v_p_moduli"] / np.pi
        told = width > 2 * error
        cell["P"] = f[told], (scale * width / f)[told], (scale * error / f)[told]
        pulses.append(cell)
    else:
        for wave, name in WAVES.items():
            f, width, error = np.array(curves[name])
            cell[wave] = f, width / f, error / f
        cells.append(cell)
frictions = sorted({cell["friction"] for cell in cells})


def of(friction, among):
    """Those of one friction."""
    return [cell for cell in among if cell["friction"] == friction]


def points(some, wave):
    """f / f*, width over frequency and its error of a wave in some cells, by frequency."""
    rows = [(f / c["f_star"], w, e) for c in some for f, w, e in np.transpose(c[wave])]
    return np.array(sorted(rows)).reshape(-1, 3).T


# %%
# **Where waves end**: between the two waves about the limit, straight in logarithms.
# **Two ways**: the pulse's width over that of plane waves at its frequency.


def limits(friction, wave):
    """Over f*, where a wave is as wide as the limit, and the error; NaN where not seen.

    The error: of the widths beside it, and how far the cells are apart.
    """
    found = []
    for cell in of(friction, cells):
        f, share, error = cell[wave]
        if not share[0] < LIMIT < share[-1]:
            return np.nan, np.nan
        k = int(np.argmax(share > LIMIT))
        beside = slice(k - 1, k + 1)
        log_f, log_share = np.log(f[beside]), np.log(share[beside])
        at = np.exp(np.interp(np.log(LIMIT), log_share, log_f)) / cell["f_star"]
        power = np.diff(log_share)[0] / np.diff(log_f)[0]
        found.append((at, at * (error / share)[beside].max() / power))
    at, error = np.transpose(found)
    return np.mean(at), np.hypot(np.ptp(at) / 2, np.mean(error) / len(at) ** 0.5)


def two_ways(friction):
    """Frequency over f*, pulse over plane waves, error: where plane waves lie on both sides."""
    x, share, error = points(of(friction, cells), "P")
    rows = []
    for at, found, off in np.transpose(points(of(friction, pulses), "P")):
        if x[0] <= at <= x[-1]:
            plane = np.exp(np.interp(np.log(at), np.log(x), np.log(share)))
            own = np.interp(at, x, error / share)
            rows.append((at, found / plane, found / plane * np.hypot(off / found, own)))
    return np.array(rows).reshape(-1, 3)


def apart(wave, over_f_star):
    """Mean difference in ln(width / f) of cells of different z at the same frequency, root square.

    Over f* or in Hz; where the other cell has waves on both sides.
    """
    found = []
    for one in cells:
        for other in cells:
            if one["friction"] == other["friction"]:
                continue
            scales = [cell["f_star"] if over_f_star else 1.0 for cell in (one, other)]
            x, y = (np.log(c[wave][0] / s) for c, s in zip((one, other), scales, strict=True))
            inside = (x > y[0]) & (x < y[-1])
            expected = np.interp(x, y, np.log(other[wave][1]))
            found.append((np.log(one[wave][1]) - expected)[inside])
    return np.sqrt(np.mean(np.concatenate(found) ** 2))


rows, ratios = [], []
for friction in frictions:
    some = of(friction, cells)
    row = {"friction": friction, "z": np.mean([c["z"] for c in some])}
    row |= {"f_star_khz": np.mean([c["f_star"] for c in some]) / 1e3}
    for wave in WAVES:
        limit, error = limits(friction, wave)
        row |= {f"limit_{wave}_over_f_star": limit, f"limit_{wave}_error": error}
    rows.append(row)
    for at, ratio, error in two_ways(friction):
        ratios.append({"friction": friction, "z": row["z"], "f_over_f_star": at})
        ratios[-1] |= {"pulse_over_plane": ratio, "error": error}
for table in (rows, ratios):
    for row in table:
        print({k: float(f"{v:.3g}") for k, v in row.items()})
for low, high in SPANS:
    own = [r["pulse_over_plane"] for r in ratios if low < r["f_over_f_star"] < high]
    error = np.std(own, ddof=1) / len(own) ** 0.5
    print(
        f"pulse over plane waves, {low} to {high} f*: {np.mean(own):.2f} ± {error:.2f}, {len(own)}"
    )
scatter = [
    {"wave": wave, "over_f_star": float(apart(wave, True)), "over_hz": float(apart(wave, False))}
    for wave in WAVES
]
print("ln(width / f) apart between cells of different z:", scatter)

# %%
# **The figure.** If the distance from isostaticity alone decided, all points would be one curve.

plt.rcParams.update({"font.size": 8, "axes.linewidth": 0.6, "pdf.fonttype": 42})
plt.rcParams.update({"xtick.direction": "in", "ytick.direction": "in"})
figure, axes = plt.subplots(1, 2, figsize=(6.4, 2.9), sharey=True, layout="constrained")
bars = {"mec": "k", "mew": 0.4, "ecolor": "k", "elinewidth": 0.5, "ms": 4}
for ax, wave in zip(axes, WAVES, strict=True):
    for friction, mark in zip(frictions, "osD^v", strict=True):
        shade = plt.get_cmap("viridis")(frictions.index(friction) / (len(frictions) - 1))
        label = f"{np.mean([c['z'] for c in of(friction, cells)]):.2f}"
        x, share, error = points(of(friction, cells), wave)
        ax.errorbar(x, share, error, fmt=mark, color=shade, label=label, **bars)
        if wave == "P":
            x, share, error = points(of(friction, pulses), wave)
            ax.errorbar(x, share, error, fmt=mark, **(bars | {"mfc": "w", "mec": shade, "mew": 1}))
    ax.axhline(LIMIT, color="k", lw=0.7, ls=":")
    ax.text(14, 0.25, "Ioffe-Regel limit", ha="right", va="top")
    along = np.array([0.3, 1.0])
    ax.plot(along, LIMIT * along**3, "k--", lw=0.7)
    ax.text(0.42, 0.0105, "width as $f^4$")
    top = max(c["f_star"] for c in cells)
    along = np.array([0.8, 12.0])
    ax.plot(along, along * top / DASHPOTS, "k-.", lw=0.7)
    ax.text(14, 0.019, "dashpots of 1 %, z = 6", ha="right")
    ax.set(xscale="log", yscale="log", xlabel="f / f*", xlim=(0.2, 15), ylim=(8e-3, 3))
    ax.set_title(f"{wave}-waves", fontsize=8)
    ax.set_xticks([0.2, 0.5, 1, 2, 5, 10], ["0.2", "0.5", "1", "2", "5", "10"])
    ax.minorticks_off()
axes[0].set(ylabel="width of the line / frequency")
ways = [
    axes[0].plot([], [], "o", color="0.4", mfc=fill, ms=4, label=label)[0]
    for label, fill in (("plane waves", "0.4"), ("pulse of a wall", "w"))
]
axes[0].legend(handles=ways, frameon=False, fontsize=6.5, loc="upper left")
axes[1].legend(title="z", frameon=False, fontsize=6.5, title_fontsize=7, loc="upper left")
plt.show()


def shown(row):
    """A row of the table of the page, as text."""
    found = [f"{row['z']:.2f}", f"{row['friction']:g}", f"{row['f_star_khz']:.1f}"]
    for wave in WAVES:
        limit, error = (row[f"limit_{wave}_{end}"] for end in ("over_f_star", "error"))
        found.append("not seen" if np.isnan(limit) else f"{limit:.2f} ± {error:.2f}")
    for low, high in SPANS:
        of_it = [r for r in ratios if r["friction"] == row["friction"]]
        own = [r for r in of_it if low < r["f_over_f_star"] < high]
        if own:
            ratio, error = np.transpose([(r["pulse_over_plane"], r["error"]) for r in own])
            off = max(np.mean(error), np.std(ratio)) / max(len(own) - 1, 1) ** 0.5
            found.append(f"{np.mean(ratio):.2f} ± {off:.2f} ({len(own)})")
        else:
            found.append("")
    return found


if __name__ == "__main__" and len(sys.argv) == 2:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "plane_waves.png", dpi=200)
    figure.savefig(folder / "plane_waves.pdf", metadata={"CreationDate": None})
    as_csv = {"index": False, "float_format": "%.4g", "na_rep": "nan"}
    for name, table in (("limits", rows), ("two_ways", ratios), ("collapse", scatter)):
        pd.DataFrame(table).to_csv(folder / f"{name}.csv", **as_csv)
    header = ["z", "friction", "f*, kHz", "limit of P-waves / f*", "limit of S-waves / f*"]
    header += [f"pulse / plane waves, {low:g} to {high:g} f*" for low, high in SPANS]
    lines = [header, ["---"] * len(header), *(shown(row) for row in reversed(rows))]
    text = "".join(f"| {' | '.join(cells)} |\n" for cells in lines)
    (folder / "limits.md").write_text(text)
