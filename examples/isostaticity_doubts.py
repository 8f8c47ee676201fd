"""
How sure is the distance from isostaticity?
===========================================

The lines of `isostaticity.py` through a zero z_c, tested: is there curvature, do the stresses
agree, does the unit of frequency matter, what do the values with caveats do, where is a packing
isostatic, and which z_c makes the line widths of plane waves one curve?

`python examples/isostaticity_doubts.py FOLDER` writes the tables into a folder. All numbers come
from committed results and from the samples of cases 5 to 8 and 29 to 32.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from _committed import PEAK_SLOPE, RESULTS, mean_with_error, results, write, write_page
from _isostaticity import KEYS, NAMES, line, seeds, study
from scipy import stats

import modal
from modal.packing.rattlers import force_bearing

CURVATURE_DEGREES = 1
"""Degrees of freedom that a quadratic term adds to a line."""
TRIALS = np.linspace(3.5, 4.25, 76)
"""Values of z_c that are tried for the collapse of the line widths; the lowest z is 4.27."""
CURVE_DEGREE = 3
"""Degree of the polynomial of the logarithms through all line widths."""
CELL_DRAWS = 200
"""Draws of cells for the interval of the best z_c."""
LIMIT_TOLERANCE = 1e-3
"""Relative distance from the friction limit up to which a contact counts as being at it."""
FRICTION_OF_PATH = {5: 0.0, 6: 0.0, 7: 0.0, 8: 0.0, 29: 0.4, 30: 0.4, 31: 0.4, 32: 0.4}
"""Friction during the compression of each committed sample, by the number of its case."""

# %%
# **Curvature and errors.** A line and a parabola, each by least squares weighted with the errors of
# the points. Chi-squared per degree of freedom is 1 where the errors explain the distances. F
# compares the two fits; its p holds for independent points. Those of one path are not independent,
# so p is a lower end.


def weighted_fit(z, y, error, degree):
    """Return the coefficients of a polynomial and the weighted sum of squares left."""
    coefficients = np.polyfit(z, y, degree, w=1 / error)
    left = np.sum(((y - np.polyval(coefficients, z)) / error) ** 2)
    return coefficients, left


def test_curvature(name):
    """Return a row: chi-squared of line and parabola, F and p of the parabola's curvature."""
    known = study.dropna(subset=[name, f"{name}, error"])
    z = known["z"].to_numpy()
    y = known[name].to_numpy()
    error = known[f"{name}, error"].to_numpy()
    straight, line_left = weighted_fit(z, y, error, 1)
    _, parabola_left = weighted_fit(z, y, error, 2)
    degrees = len(z) - 2 - CURVATURE_DEGREES
    f_ratio = (line_left - parabola_left) / (parabola_left / degrees)
    return {
        "quantity": name,
        "points": len(z),
        "z_c_weighted": -straight[1] / straight[0],
        "chi_squared_line": line_left / (len(z) - 2),
        "chi_squared_parabola": parabola_left / degrees,
        "f_ratio": f_ratio,
        "p_value": stats.f.sf(f_ratio, CURVATURE_DEGREES, degrees),
    }


# %%
# **The interval of z_c.** With seven loading paths a bootstrap over paths is too narrow. A
# jackknife leaves out one path at a time; its interval is Student's t with six degrees of freedom.


def jackknife_zero(name):
    """Return z_c of all packings and the half width of its 95 % interval by the jackknife."""
    paths = study["path"].unique()
    left_out = []
    for path in paths:
        rest = study[study["path"] != path]
        left_out.append(line(rest["z"].to_numpy(), rest[name].to_numpy())[1])
    count = len(paths)
    error = np.sqrt((count - 1) * np.var(left_out))
    _, zero = line(study["z"].to_numpy(), study[name].to_numpy())
    return zero, error * stats.t.ppf(0.975, count - 1)


def zero_by_stress(name):
    """Return z_c of the packings of each stress, by the stress in kPa."""
    zeros = {}
    for stress, some in study.groupby("stress_pa"):
        _, zeros[stress / 1e3] = line(some["z"].to_numpy(), some[name].to_numpy())
    return zeros


curvature = pd.DataFrame([test_curvature(name) for name in NAMES])
for row, name in enumerate(NAMES):
    zero, half_width = jackknife_zero(name)
    curvature.loc[row, ["z_c", "jackknife"]] = zero, half_width
    for stress, value in zero_by_stress(name).items():
        curvature.loc[row, f"z_c_at_{stress:g}_kpa"] = value
print(curvature.set_index("quantity").T.to_string(float_format="%.4g"))

# %%
# **From packing to packing.** The relative standard deviation of the samples of a case, pooled over
# the cases with three or more, and the largest of a case.

MIN_SAMPLES = 3
"""Least number of samples of a case whose scatter counts."""
SCATTERING = {"v_p": "V_P"} | {KEYS[name]: name for name in NAMES}


def pool_scatter(key):
    """Return a row: pooled and largest relative standard deviation of a quantity in a case."""
    measured = pd.DataFrame(
        [
            {"case": stem.split("_seed")[0], "value": numbers.get(key)}
            for stem, numbers, _ in results("isostaticity/samples/*.json")
        ]
    )
    groups = measured.dropna().astype({"value": float}).groupby("case")["value"]
    counts = groups.count()
    relative = (groups.std() / groups.mean())[counts >= MIN_SAMPLES]
    degrees = counts[counts >= MIN_SAMPLES] - 1
    return {
        "quantity": SCATTERING[key],
        "cases": len(relative),
        "pooled": np.sqrt(np.sum(degrees * relative**2) / np.sum(degrees)),
        "largest": relative.max(),
    }


scatter_of_samples = pd.DataFrame([pool_scatter(key) for key in SCATTERING])
print(scatter_of_samples.to_string(index=False, float_format="%.3g"))

# %%
# **The highest frequency under one stress.** The paper's differ by less than 3 % between the
# crystal and two random packings. Here random packings count with the mean of their samples. The
# spread is the largest of the three over the smallest, less 1; its error comes from the scatter of
# samples.
RANDOM = {"friction 0": 5, "friction 0.4": 29}
"""First of the four cases, from 10 kPa to 10 MPa, of each kind of random packing."""
CRYSTAL = 1
"""First of the four cases of the crystal."""


def spread_of_highest(place):
    """Return a row: highest frequencies of the three packings at one of the four stresses."""
    table = pd.read_csv(RESULTS / "study/table1.csv").set_index("case")
    crystal = table.loc[CRYSTAL + place]
    row = {"stress_kpa": crystal["stress_pa"] / 1e3, "crystal_khz": crystal["f_max_khz"]}
    frequencies = [(row["crystal_khz"], 0.0)]
    for label, first in RANDOM.items():
        pattern = f"isostaticity/samples/case{first + place:02}_seed*.json"
        numbers = [values["highest_frequency"] / 1e3 for _, values, _ in results(pattern)]
        name = label.replace(" ", "_")
        row[f"{name}_khz"], row[f"{name}_error"] = mean_with_error(numbers)
        row[f"{name}_samples"] = len(numbers)
        frequencies.append((row[f"{name}_khz"], row[f"{name}_error"]))
    lowest, lowest_error = min(frequencies)
    largest, largest_error = max(frequencies)
    row["spread"] = largest / lowest - 1
    row["spread_error"] = np.hypot(largest_error / largest, lowest_error / lowest)
    return row


highest = pd.DataFrame([spread_of_highest(place) for place in range(4)])
print(highest.to_string(index=False, float_format="%.4g"))

# %%
# **The unit.** The highest frequency is no neutral unit: it belongs to a few spheres with stiff
# contacts. The other unit is the square root of the mean normal stiffness over the mass of a
# sphere. It needs the contacts, which only the committed samples have.


def read_case(number):
    """Return a row of a committed sample: unit, isostatic number and what it follows from.

    A contact is mobilised if it bears at least the friction of the compression. With n_m such
    contacts a sphere, packings in d dimensions are isostatic at (d + 1) + 2 n_m / d (K. Shundyak
    and others, Phys. Rev. E 75, 010301, 2007). A sphere with two contacts, which is counted as
    force-bearing, has three motions that no contact resists, so that a share x of such spheres
    lowers the number by 2 x / 3.
    """
    packing = modal.read(RESULTS / f"samples/case{number:02}.sample.h5")
    bearing = force_bearing(packing)
    pair = ~packing.with_wall
    inside = bearing[packing.particle_i] & (bearing[packing.partner] | packing.with_wall)
    ends = np.concatenate([packing.particle_i[inside], packing.partner[inside & pair]])
    contacts = np.bincount(ends, minlength=packing.n_particles)
    share_of_two = np.mean(contacts[bearing] == 2)

    friction = FRICTION_OF_PATH[number]
    share_of_limit = np.zeros(packing.n_contacts)
    if friction:
        shear = np.linalg.norm(packing.force_tangential, axis=1)
        share_of_limit = shear / (friction * packing.force_normal)
    at_limit = share_of_limit >= 1 - LIMIT_TOLERANCE
    n_m = np.sum(at_limit & inside & pair) / np.sum(bearing)
    unit = np.sqrt(np.mean(packing.stiffness_normal) / np.mean(packing.mass)) / (2 * np.pi)
    return {
        "case": number,
        "friction": friction,
        "unit_khz": unit / 1e3,
        "spheres_with_two_contacts": share_of_two,
        "above_friction": np.mean(share_of_limit > 1 + LIMIT_TOLERANCE),
        "mobilised_per_sphere": n_m,
        "isostatic_z": 4 + 2 * n_m / 3 - 2 * share_of_two / 3,
    }


def zero_in_unit(cases, name, unit):
    """Return z_c of the committed samples' cases with frequencies over a unit (kHz)."""
    some = study.set_index("case").loc[cases["case"]]
    frequency = some[name].to_numpy() * some["f_max_khz"].to_numpy()
    return line(some["z"].to_numpy(), frequency / unit)[1]


cases = pd.DataFrame([read_case(number) for number in FRICTION_OF_PATH])
f_max = study.set_index("case").loc[cases["case"], "f_max_khz"].to_numpy()
cases["f_max_over_unit"] = f_max / cases["unit_khz"]
units = pd.DataFrame(
    [
        {
            "quantity": name,
            "z_c_over_f_max": zero_in_unit(cases, name, f_max),
            "z_c_over_unit": zero_in_unit(cases, name, cases["unit_khz"].to_numpy()),
        }
        for name in NAMES
    ]
)
print(cases.to_string(index=False, float_format="%.4g"))
print(units.to_string(index=False, float_format="%.4g"))

# %%
# **Values with caveats.** Each measured value of the smaller packings has the caveats of the tool.
# The lines are fitted again without the values that have one of them.

CAVEATS = ("no plateau", "wavelength above the width", "narrow", "unsettled")
"""Beginnings of the caveats, as the result files have them; the last is one of the packing."""


def has_caveat(packing, key, caveat):
    """Return whether a packing's value of a quantity has a caveat, or the packing itself."""
    if caveat == "unsettled":
        return bool(packing["unsettled"])
    return any(note.startswith(f"{key}: {caveat}") for note in packing["notes"])


def fit_without(name, caveat):
    """Return a row: z_c of the smaller packings without the values that have a caveat."""
    key = KEYS[name]
    spared = np.array([not has_caveat(packing, key, caveat) for _, packing in seeds.iterrows()])
    y = np.where(spared, seeds[name], np.nan)
    known = np.isfinite(y)
    row = {"quantity": name, "without": caveat, "packings": known.sum()}
    row["left_out"] = np.isfinite(seeds[name]).sum() - known.sum()
    row["z_c"] = np.nan
    if known.sum() > 2 and row["left_out"]:
        row["z_c"] = line(seeds["z"].to_numpy(), y)[1]
    return row


spared_fits = []
for name in NAMES:
    _, zero = line(seeds["z"].to_numpy(), seeds[name].to_numpy())
    count = np.isfinite(seeds[name]).sum()
    spared_fits.append(
        {"quantity": name, "without": "", "packings": count, "left_out": 0, "z_c": zero}
    )
    spared_fits += [fit_without(name, caveat) for caveat in CAVEATS]
spared_fits = pd.DataFrame(spared_fits)
print(spared_fits.to_string(index=False, float_format="%.4g"))

# %%
# **Unequal springs.** Twelve packings were measured with their own springs and with all springs as
# stiff as their mean. Of each packing the ratio of both frequencies is taken, so that how packings
# differ drops out: dilated packings gain more by equal springs than others. In Hz this is less than
# over f_max, which changes as well.

SPRINGS = pd.read_csv(RESULTS / "isostaticity/equal_springs.csv")


def gain_of_dilated(column, unit):
    """Return the further rise of dilated packings' frequencies by equal springs, and its error.

    The rise is relative. Frequencies are in the unit of a column, or in Hz if this is None.
    """
    values = SPRINGS[column] / (1 if unit is None else SPRINGS[unit])
    table = SPRINGS.assign(value=values).set_index(["friction", "kind", "seed"])
    own = table.loc[table["springs"] == "own", "value"]
    equal = table.loc[table["springs"] == "equal", "value"]
    ratio = (equal / own).dropna()
    shares = []
    errors = []
    for _, some in ratio.groupby("friction"):
        dilated_mean, dilated_error = mean_with_error(some.xs("dilated", level="kind"))
        other_mean, other_error = mean_with_error(some.xs("as above", level="kind"))
        shares.append(dilated_mean - other_mean)
        errors.append(np.hypot(dilated_error, other_error))
    return np.mean(shares), np.hypot(*errors) / len(errors)


springs = []
for name in (NAMES[0], NAMES[2]):
    row = {"quantity": name}
    for label, unit in (("over_f_max", "f_max_khz"), ("in_hz", None)):
        row[label], row[f"{label}_error"] = gain_of_dilated(f"{KEYS[name]}_khz", unit)
    springs.append(row)
springs = pd.DataFrame(springs)
print(springs.to_string(index=False, float_format="%.3g"))

# %%
# **One curve.** The widths of the lines of plane waves, over their frequency, are a function of
# f / f* if f* grows as z - z_c. For each z_c the widths of all cells are fitted by one polynomial
# of the logarithms; the best z_c leaves least. Its interval comes from draws of whole cells.

lines = pd.read_csv(RESULTS / "plane_waves/lines.csv")


def scatter_about_curve(cells, zero):
    """Return the root mean square distance of ln(width / f) from one curve of f / (z - zero).

    `cells` are the columns z, frequency over the highest one, and width over frequency.
    """
    z, frequency, share = cells
    x = np.log(frequency / (z - zero))
    y = np.log(share)
    curve = np.polyfit(x - x.mean(), y, CURVE_DEGREE)
    return np.sqrt(np.mean((y - np.polyval(curve, x - x.mean())) ** 2))


def best_zero(cells):
    """Return the z_c of the trials with the least scatter, and this scatter."""
    scatter = [scatter_about_curve(cells, zero) for zero in TRIALS]
    best = int(np.argmin(scatter))
    return TRIALS[best], scatter[best]


def collapse(wave):
    """Return a row: best z_c of a wave, its interval, and the scatter with it and with z_c = 4."""
    columns = ["z", "in_f_max", "share"]
    groups = lines[lines["wave"] == wave].groupby("cell")
    members = [cell[columns].to_numpy().T for _, cell in groups]
    random = np.random.default_rng(1)
    draws = random.integers(len(members), size=(CELL_DRAWS, len(members)))
    zeros = [best_zero(np.hstack([members[k] for k in draw]))[0] for draw in draws]
    low, high = np.percentile(zeros, (2.5, 97.5))
    every = np.hstack(members)
    zero, scatter = best_zero(every)
    return {
        "wave": wave,
        "cells": len(members),
        "z_c": zero,
        "z_c_low": low,
        "z_c_high": high,
        "scatter": scatter,
        "scatter_with_4": scatter_about_curve(every, 4.0),
    }


# The committed frequencies are over f* = 0.058 (z - 4) f_max; undone, they are over f_max.
f_max_of_line = lines["f_star"] / (PEAK_SLOPE * (lines["z"] - 4))
lines["in_f_max"] = lines["f"] / f_max_of_line
collapses = pd.DataFrame([collapse(wave) for wave in "PS"])
print(collapses.to_string(index=False, float_format="%.4g"))

# %%
# As files, where a folder is named.

if __name__ == "__main__" and len(sys.argv) == 2:
    folder = Path(sys.argv[1])
    tables = {
        "curvature": curvature,
        "samples": scatter_of_samples,
        "highest": highest,
        "units": units,
        "isostatic_number": cases,
        "caveats": spared_fits,
        "springs": springs,
        "collapse": collapses,
    }
    write(folder, {}, tables, float_format="%.5g", na_rep="nan")
    page = {"quantity": "{quantity}", "z_c, jackknife": "{z_c:.2f} ± {jackknife:.2f}"}
    for stress in (10, 100, 1000, 10000):
        page[f"z_c at {stress:,} kPa"] = f"{{z_c_at_{stress}_kpa:.2f}}"
    page["χ² of the line"] = "{chi_squared_line:.1f}"
    page["of a parabola"] = "{chi_squared_parabola:.1f}"
    page["p of the curvature"] = "{p_value:.0e}"
    write_page(folder / "curvature.md", curvature, page)
    page = {"quantity": "{quantity}", "z_c over f_max": "{z_c_over_f_max:.2f}"}
    page["z_c over √(⟨kn⟩/m) / 2π"] = "{z_c_over_unit:.2f}"
    write_page(folder / "units.md", units, page)
    page = {"case": "{case}", "friction": "{friction:g}"}
    page["spheres with two contacts"] = "{spheres_with_two_contacts:.3f}"
    page["contacts above the friction"] = "{above_friction:.3f}"
    page["mobilised contacts a sphere"] = "{mobilised_per_sphere:.3f}"
    page["isostatic z"] = "{isostatic_z:.2f}"
    page["f_max over √(⟨kn⟩/m) / 2π"] = "{f_max_over_unit:.2f}"
    write_page(folder / "isostatic_number.md", cases, page)
    left = spared_fits[(spared_fits["without"] == "") | (spared_fits["left_out"] > 0)]
    page = {"quantity": "{quantity}", "without values of": "{without}"}
    page |= {"left out": "{left_out}", "packings": "{packings}", "z_c": "{z_c:.2f}"}
    write_page(folder / "caveats.md", left, page, unknown="none is left")
    page = {"quantity": "{quantity}"}
    page["over f_max"] = "{over_f_max:.3f} ± {over_f_max_error:.3f}"
    page["in Hz"] = "{in_hz:.3f} ± {in_hz_error:.3f}"
    write_page(folder / "springs.md", springs, page)
    page = {"wave": "{wave}", "cells": "{cells}"}
    page["best z_c"] = "{z_c:.2f} ({z_c_low:.2f} to {z_c_high:.2f})"
    page["scatter of ln(width / f)"] = "{scatter:.3f}"
    page["with z_c = 4"] = "{scatter_with_4:.3f}"
    write_page(folder / "collapse.md", collapses, page)
