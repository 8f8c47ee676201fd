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

# **The packings.** Those of the study, one of each friction and stress; `seeds`: 76 packings of
# 6,000 spheres, 9 D wide, made and measured by `studies/isostaticity.yaml`; `dilated`: packings in
# which z does not follow the void ratio, of `studies/dilated.yaml`. A path is one loading path.

rows = pd.read_csv(RESULTS / "study/table1.csv").query("packing == 'random'").set_index("name")
named = {"case": "case", "packings": "packings", "mu_comp": "friction", "stress_pa": "stress_pa"}
named |= {"coordination_number_bearing": "z", "void_ratio": "void_ratio", "f_max_khz": "f_max_khz"}
named |= {"lambda_2_linear_over_d": "wavelength_over_d"}
named |= {"lambda_2_linear_over_d_error": "wavelength_error"}
study = rows[list(named)].rename(columns=named)
for name, key in zip(NAMES, ("f_low_pass_2_linear", "excess_peak", "ioffe_regel"), strict=True):
    study[name] = rows[f"{key}_khz"] / study["f_max_khz"]
    study[f"{name}, error"] = rows[f"{key}_khz_error"] / study["f_max_khz"]

# Samples of these cases were measured one by one (`isostaticity/samples`, seed 1 a committed one).
# A number of the study that is of another sample alone counts beside them, but its Ioffe-Regel
# limits, whose estimator was another one; a mean of several samples stays what it is. Errors are
# those of means: the scatter of samples, or the error of each where that says more.


def sample(stem, numbers, values):
    """Return a row of a sample, with the columns of the study."""
    case, seed = stem.split("_seed")
    row = {"name": case, "seed": int(seed), "f_max_khz": numbers["highest_frequency"] / 1e3}
    row |= {"z": numbers["coordination_of_bearing"], "void_ratio": numbers["void_ratio"]}
    for name in NAMES:
        for end, kind in (("", "value"), (", error", "error")):
            row[name + end] = (values[KEYS[name]][kind] or np.nan) / 1e3 / row["f_max_khz"]
    return row


samples = pd.DataFrame([sample(*each) for each in results("isostaticity/samples/*.json")])
without_samples = (
    study.drop(samples.loc[samples["seed"] == 1, "name"]).rename_axis("name").reset_index()
)
single = study.index[study["packings"] == 1]
for name in (*NAMES, "z", "void_ratio", "f_max_khz"):
    chosen_cases = study.index if name in (PEAK, IOFFE_REGEL) else single
    groups = pd.concat([without_samples] * (name != IOFFE_REGEL) + [samples]).groupby("name")
    study.loc[chosen_cases, name] = groups[name].mean().reindex(chosen_cases)
    if name in NAMES:
        errors = {
            case: mean_with_error(group[name], group[f"{name}, error"])[1] for case, group in groups
        }
        study.loc[chosen_cases, f"{name}, error"] = pd.Series(errors).reindex(chosen_cases)
study.loc[single, "packings"] += samples.groupby("name")["z"].count().reindex(single).fillna(0)
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
