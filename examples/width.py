"""
The width of the cell
=====================

Which frequencies are the cell's, which the packing's? Packings without friction at 100 kPa in cells
of four widths W: where further waves set in, how far modes are pure P-waves, the low-pass, and how
fast plane waves scatter.

`python examples/width.py FOLDER` writes the figure and three tables into a folder. It reads
`results/width/width*.json`, results of `studies/width.yaml`, and `long/*.json` there: cells of this
study that are 72 D long, measured one by one, as the low-pass frequency needs 50 D. Lines of plane
waves along cells of 35,201 spheres without walls are in `plane_waves.csv`.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from _committed import RESULTS, mean_with_error, results, write

DIAMETER = 2.54e-3  # m
# kHz, below V_S / W of cells 7 D wide
LONG = (10.5, 18.2)
NEAR = (13.7, 18.2)
# chi_z of P-waves, and of modes that have hardly a direction
PURE = 0.9
MIXED = 0.45
STEP = (0.85, 1.0), (1.0, 1.15)  # of V_S / W, where modes are counted below and above it


def read_cells(pattern):
    """Yield the numbers of each result, with the width of its cell, and all of the result."""
    for name, numbers, contents in results(f"width/{pattern}"):
        nominal = float(name.removeprefix("width").partition("_seed")[0])
        # Spheres and void ratio say how wide a cell is, as its nominal shape is kept.
        width = nominal * ((1 + numbers["void_ratio"]) * 0.6) ** (1 / 3)
        yield numbers | {"nominal": nominal, "width_over_d": width}, contents


# %%
# **Cut-ons.** Waves across the cell that fit into it once have the frequencies V_S / W and V_P / W,
# and sqrt 2 V_S / W along both axes across. The table has the modes in the 15 % below and above the
# first of them, and where the last modes lie whose chi_z is above two values; NaN where some are up
# to the end of the list.

rows = []
modes = []
for cell, contents in read_cells("width*.json"):
    f, chi, _ = np.array(contents["curves"]["chi_z_of_branches"])
    v_p = cell["v_p_moduli"]
    v_s = cell["v_s_moduli"]
    cut_on = v_s / (cell["width_over_d"] * DIAMETER)
    below, above = (int(((f > a * cut_on) & (f < b * cut_on)).sum()) for a, b in STEP)
    last_mixed = f[chi > MIXED].max()
    rows.append(
        {
            "width_over_d": cell["width_over_d"],
            "z": cell["coordination"],
            "v_p": v_p,
            "v_s": v_s,
            "v_s_over_w_khz": cut_on / 1e3,
            "root_2_v_s_over_w_khz": 2**0.5 * cut_on / 1e3,
            "v_p_over_w_khz": cut_on * v_p / v_s / 1e3,
            "modes_15_percent_below": below,
            "modes_15_percent_above": above,
            "last_above_0.9_khz": f[chi > PURE].max() / 1e3,
            "last_above_0.45_khz": last_mixed / 1e3 if last_mixed < f[-1] - 1e3 else np.nan,
        }
    )
    modes.append(
        {
            "nominal": cell["nominal"],
            "width": cell["width_over_d"],
            "cut_on": cut_on,
            "f": f,
            "chi": chi,
        }
    )

# %%
# **The low-pass frequency** and the decay of the coherent wave by a wall's pulse, cells 72 D long.

long = []
for cell, contents in read_cells("long/*.json"):
    row = {
        "width_over_d": cell["width_over_d"],
        "z": cell["coordination"],
        "v_p": cell["v_p"],
        "v_s": cell["v_s"],
        "low_pass_khz": cell["low_pass"] / 1e3,
        "low_pass_error_khz": contents["low_pass"]["error"] / 1e3,
    }
    attenuation = contents["attenuation"]
    frequency, alpha, error = (
        np.array(attenuation[name], float) for name in ("at", "value", "error")
    )
    for f in (17, 25, 34):
        k = int(np.argmin(abs(frequency - 1e3 * f)))
        is_near = abs(frequency[k] / 1e3 - f) < 1
        row[f"attenuation_{f}_khz"] = alpha[k] if is_near else np.nan
        row[f"attenuation_{f}_khz_error"] = error[k] if is_near else np.nan
    long.append(row)

# %%
# **Scattering**: the width of the lines of plane waves as a power of the frequency, for waves of 12
# to 19 D, and its mean about 16 kHz, with the standard errors that its scatter makes.

lines = pd.read_csv(RESULTS / "width/plane_waves.csv").dropna()
powers = []
lines["khz"] = lines["frequency_hz"] / 1e3
long_lines = lines[lines["khz"].between(*LONG)]
for width, lines_of_width in (
    *long_lines.groupby("width"),
    ("wider", long_lines[long_lines["width"] > long_lines["width"].min()]),
):
    fit, spread = np.polyfit(
        np.log(lines_of_width["khz"]), np.log(lines_of_width["line_hz"]), 1, cov=True
    )
    row = {
        "width": str(width),
        "waves": len(lines_of_width),
        "power": fit[0],
        "error": spread[0, 0] ** 0.5,
    }
    near = lines_of_width["line_hz"][lines_of_width["khz"].between(*NEAR)] / 1e3
    mean, error = mean_with_error(near)
    powers.append(row | {"line_16_khz": mean, "line_16_khz_error": error})
rows, long, powers = (pd.DataFrame(each) for each in (rows, long, powers))
for table in (rows, long, powers):
    print(table.to_string(index=False, float_format="%.4g"))

# %%
# **The figure.** Left: all modes below a frequency over V_S / W; middle: the largest chi_z of all
# modes from a frequency on; right: width of the lines over their frequency. Ticks: V_S / W.

figure, axes = plt.subplots(1, 3, figsize=(7.2, 2.6), layout="constrained")
modes = pd.DataFrame(modes)
widths = modes.groupby("nominal")
styles = zip(widths, ((0, (1, 1)), "-.", "--", "-"), "os^D", strict=True)
for (nominal, these), style, mark in styles:
    first = these.iloc[0]
    ratio = np.sort(first["f"]) / first["cut_on"]
    shade = f"{0.7 * (1 - nominal / modes['nominal'].max()):.2f}"
    look = {"ls": style, "color": shade, "lw": 1.2}
    label = f"{first['width']:.0f} D"
    axes[0].step(ratio, np.arange(1, len(ratio) + 1), where="post", label=label, **look)
    frequency, chi = (np.concatenate(these[name].tolist()) for name in ("f", "chi"))
    order = np.argsort(frequency)
    frequency = frequency[order]
    largest_chi = np.maximum.accumulate(chi[order][::-1])[::-1]
    is_complete = frequency < min(f[-1] for f in these["f"]) - 1e3
    axes[1].step(frequency[is_complete] / 1e3, largest_chi[is_complete], where="pre", **look)
    cut_on = [these["cut_on"].mean() / 1e3] * 2
    axes[1].plot(cut_on, [0.93, 1.0], **look)
    axes[2].plot(cut_on, [0.5, 1.0], **look)
    cell_lines = lines[lines["width"] == nominal]
    share = cell_lines["line_hz"] / cell_lines["frequency_hz"]
    axes[2].plot(cell_lines["khz"], share, mark, ms=3, mew=0.3, mec="w", color=shade, label=label)
waves = ((1, 1.3, "$V_S/W$"), (2**0.5, 2.2, "$\\sqrt{2}\\,V_S/W$"), (1.51, 1.3, "$V_P/W$"))
for ratio, height, text in waves:
    axes[0].axvline(ratio, color="k", lw=0.5, ls=":")
    axes[0].text(ratio, height, text, ha="right" if ratio < 1.5 else "left")
axes[0].set(yscale="log", xlabel="f W / $V_S$", ylabel="modes below f", xlim=(0, 2.2))
axes[0].legend(title="W", frameon=False, fontsize=6.5, title_fontsize=7, loc="upper left")
for level in (PURE, MIXED):
    axes[1].axhline(level, color="k", lw=0.5, ls=":")
axes[1].set(xlabel="f, kHz", ylabel=r"largest $\chi_z$ from f on", xlim=(0, 24), ylim=(0.3, 1.02))
axes[2].axhline(1 / np.pi, color="k", lw=0.5, ls=":")
axes[2].text(1, 0.33, "Ioffe-Regel limit", fontsize=6.5)
axes[2].legend(frameon=False, fontsize=6.5, loc="lower right")
axes[2].set(xlabel="f, kHz", ylabel="width of the line / frequency", yscale="log", xlim=(0, 40))
plt.show()

if __name__ == "__main__" and len(sys.argv) == 2:
    tables = {"cut_ons": rows, "long": long, "powers": powers}
    write(sys.argv[1], {"width": figure}, tables, float_format="%.4g", na_rep="nan")
