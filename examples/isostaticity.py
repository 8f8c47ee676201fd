"""
Distance from isostaticity
==========================

Three frequencies of all random packings of the study, each over the highest frequency of its
packing, against z - 4: z is the mean number of contacts of a force-bearing sphere, and with
friction a packing of spheres is isostatic at z = 4.

`python examples/isostaticity.py FOLDER` writes the figures (PNG, PDF), their points and the fits
(CSV) into a folder. Points are means over the samples of `results/isostaticity/samples`;
wavelengths are of one sample, from `results/study/table1.csv`.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from _committed import PEAK_SLOPE, RESULTS, mean_with_error, write, write_page
from _isostaticity import (
    KEYS,
    LOW_PASS,
    NAMES,
    OVER_50,
    PEAK,
    WAVE,
    dilated,
    ends_of,
    fitted,
    headline,
    power,
    rows,
    seeds,
    shared_zero,
    study,
    with_interval,
)  # fmt: skip

DIAMETER = 2.54e-3  # m
LOOSEST = 4.4  # z, below which few packings reach the Ioffe-Regel limit

# %%
# **The fits.** Each quantity is a line a (z - z_c), by least squares, with intervals from draws of
# whole loading paths (`_isostaticity.py`, which also says which packings these are).

z = study["z"].to_numpy()
wavelength = study["wavelength_over_d"].to_numpy()
straight = study[[LOW_PASS, PEAK]].to_numpy().T
fits = {name: fitted(study, name) for name in NAMES}
fits["low-pass frequency and peak, one z_c"] = with_interval(
    "z_c", lambda k: shared_zero(z[k], straight[:, k]), study["path"].to_numpy()
)
fits[WAVE] = with_interval("power", lambda k: power(z[k], wavelength[k]), study["path"].to_numpy())
fits |= {f"{name}, seeds": fitted(seeds, name) for name in KEYS}
short = study[wavelength < rows["width_over_d"]]
fits[f"{LOW_PASS}, waves shorter than the width"] = fitted(short, LOW_PASS)
fits = pd.DataFrame.from_dict(fits, orient="index")
print(fits.to_string(float_format="%.4g"))

# %%
# **The figure.** Colours are frictions, markers are stresses. Full lines are the fits, dashed ones
# those with z_c = 4. Bars are the error of each number where it is known.

frictions, stresses = (np.unique([*study[x], *seeds[x]]) for x in ("friction", "stress_pa"))
shades = plt.get_cmap("viridis")(np.linspace(0, 0.95, len(frictions)))
COLOURS = dict(zip(frictions, shades, strict=True))
MARKERS = dict(zip(stresses, "os^D", strict=True))
EDGE = {"ms": 3.6, "mec": "k", "mew": 0.4}
LEGEND = {"frameon": False, "fontsize": 6.5, "title_fontsize": 7}
along = np.linspace(0, 3.1, 50)


def draw_points(ax, table, x, y, bars):
    """Draw all packings, each in the colour of its friction, with the marker of its stress."""
    for mu, p, *point in zip(table["friction"], table["stress_pa"], x, y, bars, strict=True):
        ax.errorbar(*point, fmt=MARKERS[p], color=COLOURS[mu], ecolor="k", elinewidth=0.6, **EDGE)


def standard_error(numbers):
    """Return the standard error of the mean of some numbers."""
    _, error = mean_with_error(numbers)
    return error


def compute_means(table, name, columns):
    """Return means of a quantity and of z over groups of packings, and the standard error."""
    groups = table.dropna(subset=name).groupby(columns)
    errors = groups[name].agg(standard_error)
    return groups[["z", name]].mean().assign(bars=errors).reset_index()


def draw_legend(ax, title, entries):
    """Draw a legend of markers from their texts, colours and kinds."""
    handles = [ax.plot([], [], kind, color=c, label=text, **EDGE)[0] for text, c, kind in entries]
    ax.legend(handles=handles, title=title, **LEGEND)


def draw_frequencies(tables, dashed, label):
    """Draw the three frequencies over z - 4, a table each, with its fit and a dashed line."""
    figure, axes = plt.subplots(1, 3, figsize=(7, 2.7), sharey=True, layout="constrained")
    for ax, (name, (table, bars, fit)) in zip(axes, tables.items(), strict=True):
        slope, zero = dashed.loc[name]
        ax.plot(along, fit["slope"] * (along + 4 - fit["z_c"]), "k-", lw=0.8, label="fit")
        ax.plot(along, slope * (along + 4 - zero), "k--", lw=0.8, label=label)
        draw_points(ax, table, table["z"] - 4, table[name], table[bars])
        ax.set_title(name, fontsize=8)
        ax.set(xlabel="z - 4 (-)", xlim=(0, 3.1), ylim=(0, 0.36))
    axes[0].set_ylabel("frequency / highest frequency (-)")
    kinds = [(f"{mu:g}", COLOURS[mu], "o") for mu in np.unique(table["friction"])]
    draw_legend(axes[0], "friction", kinds)
    draw_legend(axes[1], "stress, kPa", [(f"{p / 1e3:,.0f}", "0.6", MARKERS[p]) for p in stresses])
    axes[2].legend(loc="upper left", **LEGEND)
    plt.show()
    return figure


figures = {}
tables = {name: (study, f"{name}, error", fits.loc[name]) for name in NAMES}
through_four = fits[["slope_with_z_c_4"]].assign(z_c=4)
figures["headline"] = draw_frequencies(tables, through_four, "fit with $z_c = 4$")

# %%
# **Other packings.** Means of up to three seeds, with the fits through all packings. The dashed
# lines are the fits of the study's packings.

tables = {
    name: (
        compute_means(seeds, name, ["friction", "stress_pa"]),
        "bars",
        fits.loc[f"{name}, seeds"],
    )
    for name in NAMES
}
figures["seeds"] = draw_frequencies(tables, fits[["slope", "z_c"]], "the study's fit")

# %%
# **Contacts or density?** In all packings above z falls where e grows. In those of
# `studies/dilated.yaml` it does not: dense ones, whose contacts follow from the friction with which
# spheres that were dense jam again, and loose ones. The table tells by which share of its mean a
# frequency changes with z at one e, and with e at one z, over the range that each then has among
# all packings of 6,000 spheres at 100 kPa. Packings of one kind and friction are drawn together.

LOOKS = {"as above": ("o", "0.6"), "dilated": ("D", "k"), "loose": ("s", "w")}
kinds = {"friction": "as above", "dilate0.005": "dilated", "agitated": "loose"}
at_100 = pd.concat([seeds.query("stress_pa == 1e5"), dilated], ignore_index=True)
at_100["kind"] = at_100["path"].str.extract(rf"^({'|'.join(kinds)})")[0].map(kinds)
at_100["path"] = at_100["kind"] + at_100["friction"].map(" {:g}".format)


def joint(key, table, x, beside, name):
    """Return the change of a quantity with x, divided by its mean, and the R² of x alone.

    The quantity is fitted to x and another variable; the change is that over the range that x has
    where the other one stays.
    """
    x, beside, y = (np.asarray(each, float) for each in (x, beside, table[name]))
    reach = np.ptp(x - np.polyval(np.polyfit(beside, x, 1), beside))
    known = np.isfinite(y)

    def change(k):
        k = k[known[k]]
        terms = np.column_stack([np.ones(len(k)), beside[k], x[k]])
        return np.linalg.lstsq(terms, y[k])[0][2] * reach / np.nanmean(y)

    alone = np.corrcoef(x[known], y[known])[0, 1] ** 2
    fit = with_interval(key, change, table["path"].to_numpy())
    return reach, fit | {f"r_squared_{key}": alone}


separate = []
for name in NAMES:
    row = {"quantity": name, "packings": at_100[name].count()}
    row |= joint("z", at_100, at_100["z"], at_100["void_ratio"], name)[1]
    row |= joint("e", at_100, at_100["void_ratio"], at_100["z"], name)[1]
    fit = fits.loc[f"{name}, seeds"]
    off = at_100[name] / (fit["slope"] * (at_100["z"] - fit["z_c"])) - 1
    for kind in ("dilated", "loose"):
        mean, error = mean_with_error(off[at_100["kind"] == kind])
        row |= {f"{kind}_off": mean, f"{kind}_error": error}
    separate.append(row)
separate = pd.DataFrame(separate)

# Dilated packings are off the line. Six of them and six others, friction 0.1 and 0.2, were measured
# again with all springs as stiff as their mean: what is then left does not come from uneven forces.
again = pd.read_csv(RESULTS / "isostaticity/equal_springs.csv")


def compare_dilated(packings, name):
    """Return by which share dilated packings are off the line beyond others, and its error."""
    fit = fits.loc[f"{name}, seeds"]
    line = fit["slope"] * (packings["z"] - fit["z_c"])
    ratio = packings[f"{KEYS[name]}_khz"] / packings["f_max_khz"] / line
    shares = []
    errors = []
    for _, group in packings.assign(ratio=ratio).groupby("friction"):
        dilated_mean, dilated_error = mean_with_error(group["ratio"][group["kind"] == "dilated"])
        other_mean, other_error = mean_with_error(group["ratio"][group["kind"] == "as above"])
        shares.append(dilated_mean / other_mean - 1)
        errors.append(np.hypot(dilated_error / dilated_mean, other_error / other_mean))
    return np.mean(shares), np.hypot(*errors) / len(errors)


for springs, packings in again.groupby("springs"):
    shares, errors = np.transpose([compare_dilated(packings, name) for name in NAMES])
    separate[f"{springs}_springs_off"] = shares
    separate[f"{springs}_springs_error"] = errors
print(separate.set_index("quantity").T.to_string(float_format="%.3g"))

figure, axes = plt.subplots(1, 4, figsize=(7, 2.4), layout="constrained")
for ax, name in zip(axes, ["void_ratio", *NAMES], strict=True):
    if name in NAMES:
        fit = fits.loc[f"{name}, seeds"]
        ax.plot(along, fit["slope"] * (along + 4 - fit["z_c"]), "k-", lw=0.8)
        ax.set(ylim=(0, 0.2), yticks=np.linspace(0, 0.2, 5))
    for kind, means in compute_means(at_100, name, ["kind", "friction"]).groupby("kind"):
        marker, colour = LOOKS[kind]
        style = EDGE | {"fmt": marker, "color": colour, "ecolor": "k", "elinewidth": 0.6}
        ax.errorbar(means["z"] - 4, means[name], means["bars"], **style)
    ax.set_title(name.replace("_", " ").removesuffix(" (2 %)"), fontsize=8)
    ax.set(xlabel="z - 4 (-)", xlim=(0, 2.4))
axes[1].set_ylabel("frequency / highest frequency (-)")
draw_legend(axes[2], "", [(kind, colour, mark) for kind, (mark, colour) in LOOKS.items()])
figures["one_void_ratio"] = figure
plt.show()

# %%
# **What is left.** If stress, friction or void ratio mattered beside z, the distances from the line
# would follow them. Each number is the change of the frequency over the whole range that a variable
# has among packings of one z, over the mean frequency.

log_stress = np.log10(study["stress_pa"])
friction = study["friction"]
void = study["void_ratio"]
tests = []
for name in NAMES:
    for beside, x in (("log stress", log_stress), ("friction", friction), ("e", void)):
        reach, fit = joint("change", study, x, study["z"], name)
        fit["r_squared_alone"] = fit.pop("r_squared_change")
        tests.append({"quantity": name, "beside_z": beside, "range_at_one_z": reach} | fit)
tests = pd.DataFrame(tests)
print(tests.to_string(index=False, float_format="%.3g"))

figure, axes = plt.subplots(1, 4, figsize=(7, 2.4), layout="constrained")
expected = fits["slope"][LOW_PASS] * (study["z"] - fits["z_c"][LOW_PASS])
left = study[LOW_PASS] / expected - 1
bars = study[f"{LOW_PASS}, error"] / expected
labels = ("stress, kPa", "friction", "void ratio")
for ax, x, label in zip(axes, (study["stress_pa"] / 1e3, friction, void), labels, strict=False):
    ax.axhline(0, color="k", lw=0.6)
    draw_points(ax, study, x, left, bars)
    ax.set(xlabel=label, ylim=(-0.2, 0.2), yticks=np.linspace(-0.2, 0.2, 5))
axes[0].set(xscale="log", xlim=(5, 2e4), ylabel="low-pass frequency / line - 1")
axes[0].set_xticks([10, 100, 1000, 1e4], ["10", "", "1,000", ""])
draw_points(axes[3], study, study["z"] - 4, wavelength, study["wavelength_error"])
level = np.exp(np.mean(np.log(wavelength * (z - 4) ** 0.5)))
axes[3].plot(along[1:], level * along[1:] ** -0.5, "k--", lw=0.8, label="power -1/2")
axes[3].axhline(rows["width_over_d"].mean(), color="0.5", lw=0.8, ls=":", label="width of the cell")
axes[3].set(xscale="log", yscale="log", xlim=(0.4, 3.2))
axes[3].set(xlabel="z - 4 (-)", ylabel="wavelength / D (-)")
axes[3].set_yticks([8, 10, 15, 20, 25], ["8", "10", "15", "20", "25"])
axes[3].set_xticks([0.5, 1, 2, 3], ["0.5", "1", "2", "3"])
axes[2].set_xticks([0.55, 0.65])
for ax in axes:
    ax.minorticks_off()
axes[3].legend(**LEGEND)
figures["residuals"] = figure
plt.show()

# %%
# **Does the low-pass frequency have a z_c of its own?** It depends on the length. The widths of
# plane waves, as one curve of f / f* (`plane_waves.py`), tell where a P-wave fades to 2 % over a
# length, with no parameter to fit: the amplitude falls with pi times the width over the velocity.

plane = pd.read_csv(RESULTS / "plane_waves/lines.csv").query("wave == 'P'")
curve = np.polyfit(np.log(plane["x"]), np.log(plane["share"]), 3)
x = np.linspace(0.4, 10, 2000)  # f / f*
share = np.exp(np.polyval(curve, np.log(x)))


def faded(table, length):
    """Return the frequency, divided by the highest, at which plane waves fade to 2 %.

    The length over which they fade is in diameters.
    """
    star = PEAK_SLOPE * (table["z"] - 4)
    decay = np.outer(star * 1e3 * table["f_max_khz"] / table["v_p"], np.pi * x * share) * DIAMETER
    return star * [np.interp(np.log(50) / length, row, x) for row in decay]


lengths = []
for length, table, name in ((142, study, LOW_PASS), (65, seeds, LOW_PASS), (50, seeds, OVER_50)):
    known = table.dropna(subset=name)
    known = known.assign(faded=faded(known, length))
    row = {"length_over_d": length, "packings": len(known)}
    for key, column in (("", name), ("faded_", "faded")):
        fit = fitted(known, column)
        for end in (*ends_of("z_c"), *ends_of("power")):
            row[f"{key}{end}"] = fit[end]
    ratio = (known[name] / known["faded"])[known["z"] > LOOSEST]
    lengths.append(row | {"over_faded": ratio.mean(), "scatter": ratio.std()})
lengths = pd.DataFrame(lengths)
print(lengths.T.to_string(header=False, float_format="%.3g"))

# %%
# As files, where a folder is named.


def between(name, digits=2):
    """Return the format of a number with its interval."""
    return "{} ({} to {})".format(*(f"{{{end}:.{digits}f}}" for end in ends_of(name)))


if __name__ == "__main__" and len(sys.argv) == 2:
    folder = Path(sys.argv[1])
    fits = fits.rename_axis("quantity").reset_index()
    files = {"fits": fits.rename(columns={"power": "power_of_z_less_4"}), "residuals": tests}
    files |= {"one_void_ratio": separate, "lengths": lengths}
    write(folder, figures, files, float_format="%.5g")
    write(folder, {}, {"headline": headline}, float_format="%.5g", na_rep="nan")
    page = {"quantity": "{quantity}", "packings": "{cases:.0f}", "slope": between("slope", 3)}
    page |= {"z_c": between("z_c"), "R²": "{r_squared:.3f}"}
    page |= {"slope with z_c = 4": "{slope_with_z_c_4:.3f}", "power of z - 4": between("power")}
    write_page(folder / "fits.md", fits, page)
    page = {"quantity": "{quantity}", "packings": "{packings}", "z at one e": between("z")}
    page |= {
        "e at one z": between("e"),
        "R² of z, of e alone": "{r_squared_z:.2f}, {r_squared_e:.2f}",
    }
    page["dilated over the line - 1"] = "{dilated_off:.2f} ± {dilated_error:.2f}"
    page["loose"] = "{loose_off:.2f} ± {loose_error:.2f}"
    write_page(folder / "one_void_ratio.md", separate, page)
    page = {"quantity": "{quantity}", "beside z": "{beside_z}", "change": between("change")}
    write_page(folder / "residuals.md", tests, page | {"R² alone": "{r_squared_alone:.2f}"})
    page = {"length, D": "{length_over_d}", "packings": "{packings}", "z_c": between("z_c")}
    page["z_c by plane waves"] = between("faded_z_c")
    page["frequency over that of plane waves"] = "{over_faded:.2f} ± {scatter:.2f}"
    write_page(folder / "lengths.md", lengths, page)
