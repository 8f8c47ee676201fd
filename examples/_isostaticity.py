"""The packings of `isostaticity.py`, and straight lines through them with intervals."""

import numpy as np
import pandas as pd
from _committed import RESULTS, mean_with_error, results

DRAWS = 4000  # of loading paths, for the intervals
LOW_PASS = "low-pass frequency (2 %)"
PEAK = "peak of D(f) / f²"
IOFFE_REGEL = "Ioffe-Regel limit"
OVER_50 = "low-pass frequency over 50 D"
WAVE = "wavelength at the low-pass frequency"
KEYS = {LOW_PASS: "low_pass", PEAK: "excess_peak", IOFFE_REGEL: "ioffe_regel"}
NAMES = list(KEYS)
KEYS[OVER_50] = "low_pass_unbiased"

# **The packings.** Those of the study, of each friction and stress, each in three to five samples,
# which were measured one by one (`isostaticity/samples`); `seeds`: 76 packings of 6,000 spheres,
# 9 D wide, made and measured by `studies/isostaticity.yaml`; `dilated`: packings in which z does
# not follow the void ratio, of `studies/dilated.yaml`. A path is one loading path. Wavelengths and
# V_P are of one sample of each case.

rows = pd.read_csv(RESULTS / "study/table1.csv").query("packing == 'random'").set_index("name")
named = {"case": "case", "mu_comp": "friction", "stress_pa": "stress_pa"}
named |= {"lambda_2_linear_over_d": "wavelength_over_d"}
named |= {"lambda_2_linear_over_d_error": "wavelength_error"}
study = rows[list(named)].rename(columns=named)
STATE = ("z", "void_ratio", "f_max_khz")


def sample(stem, numbers, values):
    """Return a row of a sample: its state, and its frequencies divided by its highest one."""
    case, seed = stem.split("_seed")
    row = {"name": case, "seed": int(seed), "f_max_khz": numbers["highest_frequency"] / 1e3}
    row |= {"z": numbers["coordination_of_bearing"], "void_ratio": numbers["void_ratio"]}
    for name in NAMES:
        for end, kind in (("", "value"), (", error", "error")):
            row[name + end] = (values[KEYS[name]][kind] or np.nan) / 1e3 / row["f_max_khz"]
    return row


# Points are means over the samples. Errors are those of means: the scatter of samples, or the error
# of each where that says more.
samples = pd.DataFrame([sample(*each) for each in results("isostaticity/samples/*.json")])
groups = samples.groupby("name")
study.insert(1, "packings", groups["z"].count())
for column in STATE:
    study[column] = groups[column].mean()
for name in NAMES:
    study[name] = groups[name].mean()
    study[f"{name}, error"] = pd.Series(
        {case: mean_with_error(some[name], some[f"{name}, error"])[1] for case, some in groups}
    )
headline = study.rename(columns={name: f"{name} / f_max" for name in NAMES})
study = study.assign(path=study["friction"], v_p=rows["v_p_long_waves_linear_m_per_s"])


def read_packings(folder):
    """Return a row for each packing: its numbers, and frequencies divided by its highest."""
    packings = []
    for _, numbers, contents in results(f"isostaticity/{folder}/*.json"):
        stress = contents["stress"]
        path = contents["name"].replace(f"_stress{stress:g}", "")
        row = {"friction": contents["mu_comp"], "stress_pa": stress, "path": path}
        packings.append(row | numbers | {end: contents[end] for end in ("notes", "unsettled")})
    table = pd.DataFrame(packings).rename(columns={"coordination_of_bearing": "z"})
    for name, key in KEYS.items():
        table[name] = table[key].astype(float) / table["highest_frequency"]
    return table.assign(f_max_khz=table["highest_frequency"] / 1e3)


seeds = read_packings("seeds")
dilated = read_packings("dilated")

# **The fits.** Each quantity is a line a (z - z_c), by least squares. All stresses of one friction
# are states of one loading path, so that cases are not independent: the intervals (95 %) come from
# drawing paths with replacement: in the study the seven frictions, not the 28 cases.


def line(x, y):
    """Return slope and zero of the least-squares line through known numbers."""
    known = np.isfinite(y)
    slope, at_zero = np.polyfit(x[known], y[known], 1)
    return slope, -at_zero / slope


def power(x, y):
    """Return the exponent of a power law of z - 4."""
    return line(np.log(x - 4), np.log(y))[0]


def shared_zero(x, ys):
    """Return the common z_c of several lines, each weighted by its scatter about its best line."""
    trials = np.linspace(3, 4.4, 281)
    cost = 0
    for y in ys:
        known = np.isfinite(y)
        less = x[known] - trials[:, None]
        slope = (less * y[known]).sum(axis=1) / (less**2).sum(axis=1)
        left = ((y[known] - slope[:, None] * less) ** 2).sum(axis=1)
        cost = cost + left / left.min()
    return trials[cost.argmin()]


def with_interval(name, statistic, paths):
    """Return a statistic of all packings, with its 95 % interval over draws of loading paths."""
    random = np.random.default_rng(1)
    members = [np.flatnonzero(paths == path) for path in np.unique(paths)]
    draws = [random.integers(len(members), size=len(members)) for _ in range(DRAWS)]
    values = [
        statistic(np.concatenate([members[k] for k in draw])) for draw in draws if np.ptp(draw) > 0
    ]
    ends = np.percentile(values, (2.5, 97.5))
    return dict(zip(ends_of(name), [statistic(np.arange(len(paths))), *ends], strict=True))


def ends_of(name):
    """Return the columns of a number and of its interval."""
    return [name, f"{name}_low", f"{name}_high"]


def fitted(table, name):
    """Return the line through a quantity's points with intervals, and its scatter."""
    z = table["z"].to_numpy()
    y = table[name].to_numpy()
    paths = table["path"].to_numpy()
    known = np.isfinite(y)
    fit = {"cases": known.sum()}
    fit |= with_interval("slope", lambda k: line(z[k], y[k])[0], paths)
    fit |= with_interval("z_c", lambda k: line(z[k], y[k])[1], paths)
    through_four = (y[known] @ (z[known] - 4)) / ((z[known] - 4) ** 2).sum()
    fit |= {
        "r_squared": np.corrcoef(z[known], y[known])[0, 1] ** 2,
        "scatter": np.std((y - fit["slope"] * (z - fit["z_c"]))[known]),
        "slope_with_z_c_4": through_four,
        "scatter_with_z_c_4": np.sqrt(np.mean((y - through_four * (z - 4))[known] ** 2)),
    }
    return fit | with_interval("power", lambda k: power(z[k], y[k]), paths)
