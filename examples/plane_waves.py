"""
Scattering of plane waves and of a wall's pulse
===============================================

How fast disorder takes the energy of P- and S-waves, for several numbers of contacts z: the width
of the lines of plane waves in cells without walls, and the decay of a wall's pulse in other cells,
both over the frequency f* at which soft modes set in.

`python examples/plane_waves.py FOLDER` writes the figure and tables into a folder. It reads
`results/plane_waves/friction*.json`, the results of `studies/plane_waves.yaml`.
"""

import sys
from itertools import permutations
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from _committed import PEAK_SLOPE, results, write, write_page

LIMIT = 1 / np.pi  # width over frequency at the Ioffe-Regel limit
DASHPOTS = 2.62e6  # Hz, Q f of dashpots of 1 %, friction 0, 100 kPa
SPANS = (0.5, 1.5), (1.5, 5)  # of f / f*, over which pulse and plane waves are compared
WAVES = {"P": "scattering_of_p", "S": "scattering_of_s", "pulse": "scattering_of_pulse"}

parts = []
for cell, value, found in results("plane_waves/friction*.json"):
    curves, z = found["curves"], value["coordination_of_bearing"]
    if "attenuation" in curves and WAVES["pulse"] not in curves:
        # What falls as exp(-alpha x) has a line alpha v / pi wide, v the group velocity; results of
        # before do not have it, and V_P of the moduli stands for it.
        f, *decay = np.array(curves["attenuation"])
        curves[WAVES["pulse"]] = f, *(value["v_p_moduli"] / np.pi * each for each in decay)
    for wave, name in WAVES.items():
        if name in curves:
            f, width, error = np.array(curves[name])
            part = {"cell": cell, "friction": found["mu_comp"], "z": z, "wave": wave, "f": f}
            part |= {"f_star": PEAK_SLOPE * (z - 4) * value["highest_frequency"]}
            part |= {"share": width / f, "error": error / f}
            parts.append(pd.DataFrame(part)[(wave != "pulse") | (width > 2 * error)])
lines = pd.concat(parts)
lines["x"] = lines["f"] / lines["f_star"]
plane = lines[lines["wave"] != "pulse"]


def points(friction, wave):
    """f / f*, width over frequency and its error of a wave in cells of one friction."""
    some = lines[(lines["friction"] == friction) & (lines["wave"] == wave)]
    return some.sort_values("x")[["x", "share", "error"]].to_numpy().T


# %%
# **Where waves end**: between the two waves about the limit, straight in logarithms.
# **Two ways**: the pulse's width over that of plane waves at its frequency.


def limits(some):
    """Over f*, where a wave in some cells is as wide as the limit, and the error; NaN if unseen.

    The error: of the widths beside it, and how far the cells are apart.
    """
    found = []
    for _, cell in some.groupby("cell"):
        x, share, error = cell[["x", "share", "error"]].to_numpy().T
        if not share[0] < LIMIT < share[-1]:
            return np.nan, np.nan
        k = int(np.argmax(share > LIMIT))
        beside = slice(k - 1, k + 1)
        log_x, log_share = np.log(x[beside]), np.log(share[beside])
        at = np.exp(np.interp(np.log(LIMIT), log_share, log_x))
        power = np.diff(log_share)[0] / np.diff(log_x)[0]
        found.append((at, at * (error / share)[beside].max() / power))
    at, error = np.transpose(found)
    return np.mean(at), np.hypot(np.ptp(at) / 2, np.mean(error) / len(at) ** 0.5)


def two_ways(friction):
    """Frequency over f*, pulse over plane waves, error: where plane waves lie on both sides."""
    x, share, error = points(friction, "P")
    at, found, off = points(friction, "pulse")
    ratio = found / np.exp(np.interp(np.log(at), np.log(x), np.log(share)))
    error = ratio * np.hypot(off / found, np.interp(at, x, error / share))
    table = {"f_over_f_star": at, "pulse_over_plane": ratio, "error": error}
    return pd.DataFrame(table)[(at >= x[0]) & (at <= x[-1])]


def apart(wave, over):
    """Mean difference in ln(width / f) of cells of different z at the same frequency, root square.

    Over f* ("x") or in Hz ("f"); where the other cell has waves on both sides.
    """
    found = []
    cells = [cell for _, cell in plane[plane["wave"] == wave].groupby("cell")]
    for one, other in permutations(cells, 2):
        if one["friction"].iloc[0] != other["friction"].iloc[0]:
            x, y = np.log(one[over].to_numpy()), np.log(other[over].to_numpy())
            expected = np.interp(x, y, np.log(other["share"]))
            inside = (x > y[0]) & (x < y[-1])
            found.append((np.log(one["share"].to_numpy()) - expected)[inside])
    return np.sqrt(np.mean(np.concatenate(found) ** 2))


rows, ratios = [], []
for friction, some in plane.groupby("friction"):
    cells = some.groupby("cell")[["z", "f_star"]].first().mean()
    row = {"friction": friction, "z": cells["z"], "f_star_khz": cells["f_star"] / 1e3}
    for wave, of_wave in some.groupby("wave"):
        limit, error = limits(of_wave)
        row |= {f"limit_{wave}_over_f_star": limit, f"limit_{wave}_error": error}
    rows.append(row)
    ratios.append(two_ways(friction).assign(friction=friction, z=row["z"]))
rows, order = pd.DataFrame(rows), ["friction", "z", "f_over_f_star", "pulse_over_plane", "error"]
ratios = pd.concat(ratios)[order]
scatter = [
    {"wave": wave, "over_f_star": apart(wave, "x"), "over_hz": apart(wave, "f")} for wave in "PS"
]
scatter = pd.DataFrame(scatter)
for table in (rows, ratios, scatter):  # the last: ln(width / f) between cells of different z
    print(table.to_string(index=False, float_format="%.3g"))
for low, high in SPANS:
    own = ratios["pulse_over_plane"][ratios["f_over_f_star"].between(low, high)]
    print(f"pulse over plane, {low} to {high} f*: {own.mean():.2f} ± {own.sem():.2f}, {len(own)}")

# %%
# **The figure.** If the distance from isostaticity alone decided, all points would be one curve.

figure, axes = plt.subplots(1, 2, figsize=(6.4, 2.9), sharey=True, layout="constrained")
bars = {"mec": "k", "mew": 0.4, "ecolor": "k", "elinewidth": 0.5, "ms": 4}
shades = plt.get_cmap("viridis")(np.linspace(0, 1, len(rows)))
for ax, wave in zip(axes, "PS", strict=True):
    for row, mark, shade in zip(rows.itertuples(), "osD^v", shades, strict=True):
        label = {"label": f"{row.z:.2f}", "color": shade}
        ax.errorbar(*points(row.friction, wave), fmt=mark, **label, **bars)
        if wave == "P":
            hollow = bars | {"mfc": "w", "mec": shade, "mew": 1}
            ax.errorbar(*points(row.friction, "pulse"), fmt=mark, **hollow)
    ax.axhline(LIMIT, color="k", lw=0.7, ls=":")
    ax.text(14, 0.25, "Ioffe-Regel limit", ha="right", va="top")
    along = np.array([0.3, 1.0])
    ax.plot(along, LIMIT * along**3, "k--", lw=0.7)
    ax.text(0.37, 0.0135, "width as $f^4$")
    along = np.array([0.8, 12.0])
    ax.plot(along, along * plane["f_star"].max() / DASHPOTS, "k-.", lw=0.7)
    ax.text(14, 0.0105, "dashpots of 1 %, z = 6", ha="right")
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


def mean_ratio(own):
    """Mean of some ratios, its error, of scatter or of each, and their number, as text."""
    ratio, error = own["pulse_over_plane"], own["error"]
    off = max(error.mean(), ratio.std(ddof=0)) / max(len(own) - 1, 1) ** 0.5
    return f"{ratio.mean():.2f} ± {off:.2f} ({len(own)})"


if __name__ == "__main__" and len(sys.argv) == 2:
    tables = {"limits": rows, "two_ways": ratios, "collapse": scatter, "lines": lines}
    write(sys.argv[1], {"plane_waves": figure}, tables, float_format="%.4g", na_rep="nan")
    page = {"z": "{z:.2f}", "friction": "{friction:g}", "f*, kHz": "{f_star_khz:.1f}"}
    for wave in "PS":
        form = f"{{limit_{wave}_over_f_star:.2f}} ± {{limit_{wave}_error:.2f}}"
        page[f"limit of {wave}-waves / f*"] = form
    for name, (low, high) in zip(("below", "above"), SPANS, strict=True):
        inside = ratios["f_over_f_star"].between(low, high, inclusive="neither")
        rows[name] = rows["friction"].map(ratios[inside].groupby("friction").apply(mean_ratio))
        page[f"pulse / plane waves, {low:g} to {high:g} f*"] = f"{{{name}}}"
    write_page(Path(sys.argv[1]) / "limits.md", rows[::-1], page, unknown="not seen")
