"""
Distance from isostaticity
==========================

Three frequencies of all random packings of the study, each over the highest frequency of its
packing, against z - 4: z is the mean number of contacts of a force-bearing sphere, and with
friction a packing of spheres is isostatic at z = 4.

`python examples/isostaticity.py FOLDER` writes the figures (PNG, PDF), their points and the fits
(CSV) into a folder. All numbers are those of `results/study/table1.csv`; the peak of the density of
states of the eight committed samples, with its error, is that of `results/isostaticity/case*.json`,
which `python -m analysis measure` made.
"""

import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

RESULTS = Path(sys.argv[0]).resolve().parents[1] / "results"
WIDTH = 14.08  # of the study's cells, D
DRAWS = 4000  # of frictions, for the intervals
LOW_PASS, PEAK, IOFFE_REGEL = "low-pass frequency (2 %)", "peak of D(f) / f²", "Ioffe-Regel limit"

rows = pd.read_csv(RESULTS / "study/table1.csv").query("packing == 'random'")


def column(name):
    """Numbers of all random cases; NaN where there is none."""
    return rows[name].to_numpy(float)


z = column("coordination_number_bearing")
friction, stress, void = column("mu_comp"), column("stress_pa"), column("void_ratio")
top = column("f_max_khz")
wavelength, wavelength_error = (column(f"lambda_2_linear_over_d{end}") for end in ("", "_error"))
columns = {LOW_PASS: "f_low_pass_2_linear", PEAK: "excess_peak", IOFFE_REGEL: "ioffe_regel"}
value = {name: column(f"{key}_khz") / top for name, key in columns.items()}
error = {name: column(f"{key}_khz_error") / top for name, key in columns.items()}
for k, name in enumerate(rows["name"]):
    own = RESULTS / f"isostaticity/{name}.json"
    if own.exists():
        measured = json.loads(own.read_text())
        value[PEAK][k] = measured["excess_peak"]["value"] / 1e3 / top[k]
        error[PEAK][k] = measured["excess_peak"]["error"] / 1e3 / top[k]

# %%
# **The fits.** Each quantity is a line a (z - z_c), by least squares. All stresses of one friction
# are states of one loading path, so that cases are not independent: the intervals (95 %) come from
# drawing the seven frictions with replacement, not the 28 cases.


def line(x, y):
    """Slope and zero of the least-squares line through what is known."""
    known = np.isfinite(y)
    slope, at_zero = np.polyfit(x[known], y[known], 1)
    return slope, -at_zero / slope


def power(x, y):
    """Exponent of the power law of z - 4."""
    return line(np.log(x - 4), np.log(y))[0]


def shared_zero(x, ys):
    """The one z_c of several lines, each weighted by its own scatter about its best one."""
    trials, cost = np.linspace(3, 4.4, 281), 0
    for y in ys:
        known = np.isfinite(y)
        less = x[known] - trials[:, None]
        slope = (less * y[known]).sum(axis=1) / (less**2).sum(axis=1)
        left = ((y[known] - slope[:, None] * less) ** 2).sum(axis=1)
        cost = cost + left / left.min()
    return trials[cost.argmin()]


def interval(statistic, paths=friction):
    """2.5 and 97.5 % of a statistic of some cases, over draws of whole loading paths."""
    random = np.random.default_rng(1)
    members = [np.flatnonzero(paths == each) for each in np.unique(paths)]
    draws = [random.integers(len(members), size=len(members)) for _ in range(DRAWS)]
    found = [statistic(np.concatenate([members[k] for k in d])) for d in draws if np.ptp(d) > 0]
    return np.percentile(found, (2.5, 97.5), axis=0)


def fitted(name, z, y, paths):
    """The line through a quantity's points with intervals, and what it leaves."""
    known = np.isfinite(y)
    slope, zero = line(z, y)
    (low_slope, low_zero), (high_slope, high_zero) = interval(lambda k: line(z[k], y[k]), paths)
    low_power, high_power = interval(lambda k: power(z[k], y[k]), paths)
    through_four = (y[known] @ (z[known] - 4)) / ((z[known] - 4) ** 2).sum()
    fit = {
        "cases": int(known.sum()),
        "slope": slope,
        "slope_low": low_slope,
        "slope_high": high_slope,
        "z_c": zero,
        "z_c_low": low_zero,
        "z_c_high": high_zero,
        "r_squared": np.corrcoef(z[known], y[known])[0, 1] ** 2,
        "scatter": np.std((y - slope * (z - zero))[known]),
        "slope_with_z_c_4": through_four,
        "scatter_with_z_c_4": np.sqrt(np.mean((y - through_four * (z - 4))[known] ** 2)),
        "power_of_z_less_4": power(z, y),
        "power_low": low_power,
        "power_high": high_power,
    }
    print(
        f"{name}: {slope:.4f} ({low_slope:.4f} to {high_slope:.4f}) (z - z_c), z_c {zero:.2f} "
        f"({low_zero:.2f} to {high_zero:.2f}), R^2 {fit['r_squared']:.3f}; "
        f"(z - 4)^{power(z, y):.2f} ({low_power:.2f} to {high_power:.2f})"
    )
    return fit


fits = {name: fitted(name, z, y, friction) for name, y in value.items()}
straight = [value[LOW_PASS], value[PEAK]]
common = shared_zero(z, straight)
low, high = interval(lambda k: shared_zero(z[k], [y[k] for y in straight]))
fits["both, one z_c"] = {"z_c": common, "z_c_low": low, "z_c_high": high}
print(f"one z_c of the low-pass frequency and the peak: {common:.2f} ({low:.2f} to {high:.2f})")
low, high = interval(lambda k: power(z[k], wavelength[k]))
wave = {"power_of_z_less_4": power(z, wavelength), "power_low": low, "power_high": high}
fits["wavelength at the low-pass frequency"] = wave
print(f"wavelength at the low-pass frequency: (z - 4)^{power(z, wavelength):.2f}", low, high)

# %%
# **The figure.** Colours are frictions, markers are stresses. Full lines are the fits, dashed ones
# those with z_c = 4. Bars are the error of each number where it is known.

plt.rcParams.update({"font.size": 8, "axes.linewidth": 0.6, "pdf.fonttype": 42})
plt.rcParams.update({"xtick.direction": "in", "ytick.direction": "in"})
values, pressures = np.unique(friction), np.unique(stress)
colours = dict(zip(values, plt.get_cmap("viridis")(np.linspace(0, 0.9, len(values))), strict=True))
markers = dict(zip(pressures, "os^D", strict=True))
EDGE = {"ms": 3.6, "mec": "k", "mew": 0.4}


def points(ax, x, y, bars):
    """All cases, each with the colour of its friction and the marker of its stress."""
    ax.errorbar(x, y, bars, fmt="none", ecolor="k", elinewidth=0.6)
    for k in range(len(x)):
        ax.plot(x[k], y[k], markers[stress[k]], color=colours[friction[k]], **EDGE)


def legend(ax, title, entries):
    """A legend of markers: their texts, colours and kinds."""
    handles = [ax.plot([], [], kind, color=c, label=text, **EDGE)[0] for text, c, kind in entries]
    ax.legend(handles=handles, title=title, frameon=False, fontsize=6.5, title_fontsize=7)


def framed(axes, colours):
    """Titles, axes and legends of the three frequencies over z - 4."""
    for ax, name in zip(axes, value, strict=True):
        ax.set_title(name, fontsize=8)
        ax.set(xlabel="z - 4", xlim=(0, 3.1))
    axes[0].set(ylabel="frequency / highest frequency", ylim=(0, 0.36))
    legend(axes[0], "friction", [(f"{mu:g}", colour, "o") for mu, colour in colours.items()])
    legend(axes[1], "stress, kPa", [(f"{p / 1e3:,.0f}", "0.6", markers[p]) for p in pressures])
    axes[2].legend(frameon=False, fontsize=6.5, loc="upper left")


headline, axes = plt.subplots(1, 3, figsize=(7, 2.7), sharey=True, layout="constrained")
along = np.linspace(0, 3.1, 50)
for ax, name in zip(axes, value, strict=True):
    fit = fits[name]
    ax.plot(along, fit["slope"] * (along + 4 - fit["z_c"]), "k-", lw=0.8, label="fit")
    ax.plot(along, fit["slope_with_z_c_4"] * along, "k--", lw=0.8, label="fit with $z_c = 4$")
    points(ax, z - 4, value[name], error[name])
framed(axes, colours)
plt.show()

# %%
# **Other packings.** The same fits of 76 packings of 6,000 spheres, 9 D wide, of up to three seeds
# each, made and measured by `studies/isostaticity.yaml`; here whole loading paths are drawn, one of
# each friction and seed. The dashed lines are the fits of the study's packings.

NAMES = {LOW_PASS: "low_pass", PEAK: "excess_peak", IOFFE_REGEL: "ioffe_regel"}


def measured(folder):
    """A line a packing: what was measured, the three frequencies over the highest, its path."""
    found = []
    for result in sorted((RESULTS / "isostaticity" / folder).glob("*.json")):
        row = json.loads(result.read_text())
        of = row["name"].replace(f"_stress{row['stress']:g}", "")
        found.append({"friction": row["mu_comp"], "stress": row["stress"], "path": of})
        found[-1] |= {name: each["value"] for name, each in row["values"].items()}
    table = pd.DataFrame(found).fillna(np.nan)
    for name, key in NAMES.items():
        table[name] = table[key].astype(float) / table["highest_frequency"]
    return table


others = measured("seeds")
other_z, path = others["coordination_of_bearing"].to_numpy(), others["path"].to_numpy(str)
for name in NAMES:
    fits[f"{name}, seeds"] = fitted(f"{name}, seeds", other_z, others[name].to_numpy(), path)
over_50 = others["low_pass_unbiased"].astype(float) / others["highest_frequency"]
name = "low-pass frequency over 50 D, seeds"
fits[name] = fitted(name, other_z, over_50.to_numpy(), path)
among, axes = plt.subplots(1, 3, figsize=(7, 2.7), sharey=True, layout="constrained")
every = np.unique(others["friction"])
shades = dict(zip(every, plt.get_cmap("viridis")(np.linspace(0, 0.9, len(every))), strict=True))
for ax, name in zip(axes, NAMES, strict=True):
    fit, before = fits[f"{name}, seeds"], fits[name]
    ax.plot(along, fit["slope"] * (along + 4 - fit["z_c"]), "k-", lw=0.8, label="fit")
    ax.plot(
        along, before["slope"] * (along + 4 - before["z_c"]), "k--", lw=0.8, label="the study's fit"
    )
    for (mu, p), of in others.dropna(subset=name).groupby(["friction", "stress"]):
        if len(of) > 1:
            at = of["coordination_of_bearing"].mean() - 4, of[name].mean(), of[name].sem()
            ax.errorbar(*at, fmt=markers[p], color=shades[mu], ecolor="k", **EDGE)
framed(axes, shades)
plt.show()

# %%
# **Contacts or density?** In all packings above z falls where e grows. In those of
# `studies/dilated.yaml` it does not: dense ones, whose contacts follow from the friction with which
# spheres that were dense jam again, and loose ones. The table tells by which share of its mean a
# frequency changes with z at one e, and with e at one z, over the range that each then has among
# all packings of 6,000 spheres at 100 kPa. Packings of one kind and friction are drawn together.

dilated = measured("dilated")
kinds = {"friction": "as above", "dilate0.005": "dilated", "agitated": "loose"}
at_100 = pd.concat([others.query("stress == 1e5"), dilated], ignore_index=True)
at_100["kind"] = at_100["path"].str.extract(rf"^({'|'.join(kinds)})")[0].map(kinds)
drawn = (at_100["kind"] + at_100["friction"].map(" {:g}".format)).to_numpy(str)
BESIDE, ENDS = ("dilated", "loose"), ("change", "change_low", "change_high")
at_100_z, at_100_e = (at_100[x].to_numpy() for x in ("coordination_of_bearing", "void_ratio"))


def joint(x, beside, y, paths):
    """Change of y with x in the fit to x and another variable, over the mean of y.

    Over the range that x has where the other stays; with the R² of x alone.
    """
    reach = np.ptp(x - np.polyval(np.polyfit(beside, x, 1), beside))
    known = np.isfinite(y)

    def change(k):
        k = k[known[k]]
        terms = np.column_stack([np.ones(len(k)), beside[k], x[k]])
        return np.linalg.lstsq(terms, y[k])[0][2] * reach / np.nanmean(y)

    now, (low, high) = change(np.arange(len(y))), interval(change, paths)
    alone = np.corrcoef(x[known], y[known])[0, 1] ** 2
    row = {"range": reach, "change": now, "change_low": low, "change_high": high}
    return row | {"r_squared_alone": alone}


separate = []
for name in NAMES:
    y = at_100[name].to_numpy(float)
    row = {"quantity": name, "packings": np.isfinite(y).sum()}
    for key, x, beside in (("z", at_100_z, at_100_e), ("e", at_100_e, at_100_z)):
        found = joint(x, beside, y, drawn)
        row |= {end.replace("change", key): found[end] for end in ENDS}
        row |= {f"r_squared_{key}": found["r_squared_alone"]}
    fit = fits[f"{name}, seeds"]
    off = (at_100[name] / (fit["slope"] * (at_100_z - fit["z_c"])) - 1).groupby(at_100["kind"])
    for kind in BESIDE:
        row |= {f"{kind}_off": off.mean()[kind], f"{kind}_error": off.sem()[kind]}
    separate.append(row)
    print(name, row)

one_e, axes = plt.subplots(1, 4, figsize=(7, 2.4), layout="constrained")
looks = {"as above": ("o", "0.6"), "dilated": ("D", "k"), "loose": ("s", "w")}
for ax, name in zip(axes, ["void_ratio", *NAMES], strict=True):
    if name in NAMES:
        fit = fits[f"{name}, seeds"]
        ax.plot(along, fit["slope"] * (along + 4 - fit["z_c"]), "k-", lw=0.8)
        ax.set(title=name, ylim=(0, 0.2))
    else:
        ax.set(title="void ratio")
    for (kind, _), of in at_100.dropna(subset=name).groupby(["kind", "friction"]):
        at = of["coordination_of_bearing"].mean() - 4, of[name].mean(), of[name].sem()
        ax.errorbar(*at, fmt=looks[kind][0], color=looks[kind][1], ecolor="k", **EDGE)
    ax.title.set_fontsize(8)
    ax.set(xlabel="z - 4", xlim=(0, 2.4))
axes[1].set_ylabel("frequency / highest frequency")
legend(axes[2], "", [(kind, colour, mark) for kind, (mark, colour) in looks.items()])
plt.show()

# %%
# **What is left.** If stress, friction or void ratio mattered beside z, the distances from the line
# would follow them. Each number is the change of the frequency over the whole range that a variable
# has among packings of one z, over the mean frequency.

tests = []
for name, y in value.items():
    for beside, x in (("log stress", np.log10(stress)), ("friction", friction), ("e", void)):
        found = joint(x, z, y, friction)
        row = {"quantity": name, "beside_z": beside, "range_at_one_z": found.pop("range")}
        tests.append(row | found)
        print(name, beside, found)

residuals, axes = plt.subplots(1, 4, figsize=(7, 2.4), layout="constrained")
expected = fits[LOW_PASS]["slope"] * (z - fits[LOW_PASS]["z_c"])
for ax, x, label in (
    (axes[0], stress / 1e3, "stress, kPa"),
    (axes[1], friction, "friction"),
    (axes[2], void, "void ratio"),
):
    ax.axhline(0, color="k", lw=0.6)
    points(ax, x, value[LOW_PASS] / expected - 1, error[LOW_PASS] / expected)
    ax.set(xlabel=label, ylim=(-0.2, 0.2))
axes[0].set(xscale="log", ylabel="low-pass frequency / line - 1")
points(axes[3], z - 4, wavelength, wavelength_error)
level = np.exp(np.mean(np.log(wavelength * (z - 4) ** 0.5)))
axes[3].plot(along[1:], level * along[1:] ** -0.5, "k--", lw=0.8, label="power -1/2")
axes[3].axhline(WIDTH, color="0.5", lw=0.8, ls=":", label="width of the cell")
axes[3].set(xscale="log", yscale="log", xlabel="z - 4", ylabel="wavelength / D", xlim=(0.4, 3.2))
axes[3].set_yticks([8, 10, 15, 20, 25], ["8", "10", "15", "20", "25"])
axes[3].set_xticks([0.5, 1, 2, 3], ["0.5", "1", "2", "3"])
axes[3].minorticks_off()
axes[3].legend(frameon=False, fontsize=6.5)
plt.show()

# %%
# As files, where a folder is named.


def markdown(header, table):
    """A table as pages include it."""
    lines = [header, ["---"] * len(header), *table]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def with_ends(fit, name, digits):
    """A number of a fit with its interval."""
    key = {"power": "power_of_z_less_4"}.get(name, name)
    value, low, high = (fit[k] for k in (key, f"{name}_low", f"{name}_high"))
    return f"{value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


if __name__ == "__main__" and len(sys.argv) == 2:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    figures = {"headline": headline, "seeds": among, "one_void_ratio": one_e}
    for name, figure in (figures | {"residuals": residuals}).items():
        figure.savefig(folder / f"{name}.png", dpi=200)
        figure.savefig(folder / f"{name}.pdf", metadata={"CreationDate": None})
    as_csv = {"index": False, "float_format": "%.5g"}
    table = pd.DataFrame([{"quantity": name} | fit for name, fit in fits.items()])
    table.to_csv(folder / "fits.csv", **as_csv)
    pd.DataFrame(tests).to_csv(folder / "residuals.csv", **as_csv)
    header = ["quantity", "cases", "slope", "z_c", "R²", "slope with z_c = 4", "power of z - 4"]
    lines = [
        [name, f"{fit['cases']}", with_ends(fit, "slope", 3), with_ends(fit, "z_c", 2)]
        + [f"{fit['r_squared']:.3f}", f"{fit['slope_with_z_c_4']:.3f}", with_ends(fit, "power", 2)]
        for name, fit in fits.items()
        if "cases" in fit
    ]
    lines.append(["the first two, one z_c", "", "", with_ends(fits["both, one z_c"], "z_c", 2)])
    lines[-1] += ["", "", ""]
    lines.append(["wavelength at the low-pass frequency", f"{len(z)}", "", "", "", ""])
    lines[-1].append(with_ends(wave, "power", 2))
    (folder / "fits.md").write_text(markdown(header, lines))
    pd.DataFrame(separate).to_csv(folder / "one_void_ratio.csv", **as_csv)
    header = ["quantity", "packings", "z at one e", "e at one z", "R² of z, of e alone"]
    header += ["dilated over the line - 1", "loose"]
    lines = [
        [row["quantity"], f"{row['packings']}", with_ends(row, "z", 2), with_ends(row, "e", 2)]
        + [f"{row['r_squared_z']:.2f}, {row['r_squared_e']:.2f}"]
        + [f"{row[f'{kind}_off']:.2f} ± {row[f'{kind}_error']:.2f}" for kind in BESIDE]
        for row in separate
    ]
    (folder / "one_void_ratio.md").write_text(markdown(header, lines))
    header = ["quantity", "log stress", "friction", "e", "R² of each alone"]
    lines = []
    for name in value:
        of = [row for row in tests if row["quantity"] == name]
        lines.append([name, *(with_ends(row, "change", 2) for row in of)])
        lines[-1].append(", ".join(f"{row['r_squared_alone']:.2f}" for row in of))
    (folder / "residuals.md").write_text(markdown(header, lines))
    points_of = {"friction": friction, "stress_pa": stress, "z": z, "void_ratio": void}
    points_of |= {"f_max_khz": top, "wavelength_over_d": wavelength}
    points_of |= {"wavelength_error": wavelength_error}
    for name in value:
        points_of |= {f"{name} / f_max": value[name], f"{name}, error": error[name]}
    table = rows[["case", "packings"]].assign(**points_of)
    table.to_csv(folder / "headline.csv", na_rep="nan", **as_csv)
