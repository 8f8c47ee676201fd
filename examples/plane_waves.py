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
from _committed import PEAK_SLOPE, mean_with_error, results, write, write_page

LIMIT = 1 / np.pi  # width over frequency at the Ioffe-Regel limit
DASHPOTS = 2.62e6  # Hz, Q f of dashpots of 1 %, friction 0, 100 kPa
SPANS = (0.5, 1.5), (1.5, 5)  # of f / f*, over which pulse and plane waves are compared
WAVES = {"P": "scattering_of_p", "S": "scattering_of_s", "pulse": "scattering_of_pulse"}

tables_of_waves = []
for cell, value, contents in results("plane_waves/friction*.json"):
    curves = contents["curves"]
    z = value["coordination_of_bearing"]
    if "attenuation" in curves and WAVES["pulse"] not in curves:
        # What falls as exp(-alpha x) has a line alpha v / pi wide, v the group velocity; results of
        # before do not have it, and V_P of the moduli stands for it.
        f, *decay = np.array(curves["attenuation"])
        curves[WAVES["pulse"]] = f, *(value["v_p_moduli"] / np.pi * each for each in decay)
    for wave, name in WAVES.items():
        if name in curves:
            f, width, error = np.array(curves[name])
            table_of_wave = {
                "cell": cell,
                "friction": contents["mu_comp"],
                "z": z,
                "wave": wave,
                "f": f,
            }
            table_of_wave |= {"f_star": PEAK_SLOPE * (z - 4) * value["highest_frequency"]}
            table_of_wave |= {"share": width / f, "error": error / f}
            tables_of_waves.append(
                pd.DataFrame(table_of_wave)[(wave != "pulse") | (width > 2 * error)]
            )
lines = pd.concat(tables_of_waves)
lines["x"] = lines["f"] / lines["f_star"]
plane = lines[lines["wave"] != "pulse"]


def select_points(friction, wave):
    """Return f / f*, width over frequency and its error of a wave in cells of one friction."""
    points = lines[(lines["friction"] == friction) & (lines["wave"] == wave)]
    return points.sort_values("x")[["x", "share", "error"]].to_numpy().T


# %%
# **Where waves end**: between the two waves about the limit, straight in logarithms.
# **Two ways**: the pulse's width over that of plane waves at its frequency.


def find_limit(lines_of_wave):
    """Return f / f* at which a wave is as wide as the limit, and its error; NaN if it is not seen.

    The error contains those of the widths beside the limit, and half the range of the cells.
    """
    crossings = []
    for _, cell in lines_of_wave.groupby("cell"):
        x, share, error = cell[["x", "share", "error"]].to_numpy().T
        if not share[0] < LIMIT < share[-1]:
            return np.nan, np.nan
        k = int(np.argmax(share > LIMIT))
        beside = slice(k - 1, k + 1)
        log_x = np.log(x[beside])
        log_share = np.log(share[beside])
        crossing = np.exp(np.interp(np.log(LIMIT), log_share, log_x))
        power = np.diff(log_share)[0] / np.diff(log_x)[0]
        crossings.append((crossing, crossing * (error / share)[beside].max() / power))
    crossing, error = np.transpose(crossings)
    half_range = np.ptp(crossing) / 2
    return np.mean(crossing), np.hypot(half_range, np.mean(error) / len(crossing) ** 0.5)


def compare_pulse(friction):
    """Return a table of the width by the pulse divided by that of plane waves, with its error.

    It has the frequencies of the pulse, divided by f*, that plane waves enclose.
    """
    x, share, error = select_points(friction, "P")
    pulse_x, pulse_share, pulse_error = select_points(friction, "pulse")
    ratio = pulse_share / np.exp(np.interp(np.log(pulse_x), np.log(x), np.log(share)))
    relative_error = np.hypot(pulse_error / pulse_share, np.interp(pulse_x, x, error / share))
    table = {"f_over_f_star": pulse_x, "pulse_over_plane": ratio, "error": ratio * relative_error}
    return pd.DataFrame(table)[(pulse_x >= x[0]) & (pulse_x <= x[-1])]


def compute_collapse_error(wave, column):
    """Return the root mean square difference in ln(width / f) of cells of different z.

    Cells are compared at equal frequency, divided by f* (column "x") or in Hz ("f"), where the
    other cell has waves on both sides.
    """
    differences = []
    cells = [cell for _, cell in plane[plane["wave"] == wave].groupby("cell")]
    for cell, other_cell in permutations(cells, 2):
        if cell["friction"].iloc[0] != other_cell["friction"].iloc[0]:
            x = np.log(cell[column].to_numpy())
            y = np.log(other_cell[column].to_numpy())
            expected = np.interp(x, y, np.log(other_cell["share"]))
            inside = (x > y[0]) & (x < y[-1])
            differences.append((np.log(cell["share"].to_numpy()) - expected)[inside])
    return np.sqrt(np.mean(np.concatenate(differences) ** 2))


def compute_powers(wave):
    """Return a table: between which frequencies, divided by f*, a wave's width grows as what power.

    It has the neighbouring waves of each cell up to the first that is beyond the limit, and the
    error of the power from those of both widths.
    """
    tables = []
    for cell, of_cell in plane[plane["wave"] == wave].groupby("cell"):
        beyond = np.maximum.accumulate(of_cell["share"].to_numpy() > LIMIT)
        count = np.sum(~beyond) + 1
        chosen = of_cell.iloc[:count]
        if beyond[0] or len(chosen) < 2:
            continue
        distance = np.diff(np.log(chosen["f"]))
        relative_error = (chosen["error"] / chosen["share"]).to_numpy()
        table = {
            "cell": cell,
            "z": chosen["z"].iloc[0],
            "wave": wave,
            "from_f_star": chosen["x"].to_numpy()[:-1],
            "to_f_star": chosen["x"].to_numpy()[1:],
            "power": 1 + np.diff(np.log(chosen["share"])) / distance,
            "error": np.hypot(relative_error[:-1], relative_error[1:]) / distance,
        }
        tables.append(pd.DataFrame(table))
    return pd.concat(tables)


rows = []
ratios = []
for friction, lines_of_friction in plane.groupby("friction"):
    cells = lines_of_friction.groupby("cell")[["z", "f_star"]].first().mean()
    row = {"friction": friction, "z": cells["z"], "f_star_khz": cells["f_star"] / 1e3}
    for wave, of_wave in lines_of_friction.groupby("wave"):
        limit, error = find_limit(of_wave)
        row |= {f"limit_{wave}_over_f_star": limit, f"limit_{wave}_error": error}
    rows.append(row)
    ratios.append(compare_pulse(friction).assign(friction=friction, z=row["z"]))
rows = pd.DataFrame(rows)
order = ["friction", "z", "f_over_f_star", "pulse_over_plane", "error"]
ratios = pd.concat(ratios)[order]
scatter = [
    {
        "wave": wave,
        "over_f_star": compute_collapse_error(wave, "x"),
        "over_hz": compute_collapse_error(wave, "f"),
    }
    for wave in "PS"
]
scatter = pd.DataFrame(scatter)
powers = pd.concat([compute_powers(wave) for wave in "PS"])
for table in (rows, ratios, powers, scatter):  # the last: ln(width / f) of cells of different z
    print(table.to_string(index=False, float_format="%.3g"))
for low, high in SPANS:
    inside = ratios[ratios["f_over_f_star"].between(low, high)]
    mean, error = mean_with_error(inside["pulse_over_plane"], inside["error"])
    print(f"pulse over plane, {low} to {high} f*: {mean:.2f} ± {error:.2f}, {len(inside)}")

# %%
# **The figure.** If the distance from isostaticity alone decided, all points would be one curve.

figure, axes = plt.subplots(1, 2, figsize=(6.4, 2.9), sharey=True, layout="constrained")
bars = {"mec": "k", "mew": 0.4, "ecolor": "k", "elinewidth": 0.5, "ms": 4}
shades = plt.get_cmap("viridis")(np.linspace(0, 1, len(rows)))
for ax, wave in zip(axes, "PS", strict=True):
    for row, mark, shade in zip(rows.itertuples(), "osD^v", shades, strict=True):
        label = {"label": f"{row.z:.2f}", "color": shade}
        ax.errorbar(*select_points(row.friction, wave), fmt=mark, **label, **bars)
        if wave == "P":
            hollow = bars | {"mfc": "w", "mec": shade, "mew": 1}
            ax.errorbar(*select_points(row.friction, "pulse"), fmt=mark, **hollow)
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
handles = [
    axes[0].plot([], [], "o", color="0.4", mfc=fill, ms=4, label=label)[0]
    for label, fill in (("plane waves", "0.4"), ("pulse of a wall", "w"))
]
axes[0].legend(handles=handles, frameon=False, fontsize=6.5, loc="upper left")
axes[1].legend(title="z", frameon=False, fontsize=6.5, title_fontsize=7, loc="upper left")
plt.show()


def describe_mean_ratio(group):
    """Return the mean of some ratios, its error and their number as a text."""
    mean, error = mean_with_error(group["pulse_over_plane"], group["error"])
    return f"{mean:.2f} ± {error:.2f} ({len(group)})"


if __name__ == "__main__" and len(sys.argv) == 2:
    tables = {"limits": rows, "two_ways": ratios, "collapse": scatter, "lines": lines}
    tables["powers"] = powers
    write(sys.argv[1], {"plane_waves": figure}, tables, float_format="%.4g", na_rep="nan")
    page = {"z": "{z:.2f}", "friction": "{friction:g}", "f*, kHz": "{f_star_khz:.1f}"}
    for wave in "PS":
        form = f"{{limit_{wave}_over_f_star:.2f}} ± {{limit_{wave}_error:.2f}}"
        page[f"limit of {wave}-waves / f*"] = form
    for name, (low, high) in zip(("below", "above"), SPANS, strict=True):
        inside = ratios["f_over_f_star"].between(low, high, inclusive="neither")
        rows[name] = rows["friction"].map(
            ratios[inside].groupby("friction").apply(describe_mean_ratio)
        )
        page[f"pulse / plane waves, {low:g} to {high:g} f*"] = f"{{{name}}}"
    write_page(Path(sys.argv[1]) / "limits.md", rows[::-1], page, unknown="not seen")
