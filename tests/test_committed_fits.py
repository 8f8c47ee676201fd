"""The committed fits against z - 4 and powers of soft modes, by scipy from the committed points."""

import json

import numpy as np
import pandas as pd
import pytest
from places import ROOT
from scipy.optimize import minimize_scalar
from scipy.stats import linregress

RESULTS = ROOT / "results"
LOW_PASS, PEAK, IOFFE_REGEL = "low-pass frequency (2 %)", "peak of D(f) / f²", "Ioffe-Regel limit"
POINTS = pd.read_csv(RESULTS / "isostaticity/headline.csv")
FITS = pd.read_csv(RESULTS / "isostaticity/fits.csv", index_col="quantity")


def known(name):
    """z and a frequency over the highest of the study's packings, where there is one."""
    return POINTS[["z", f"{name} / f_max"]].dropna().to_numpy().T


def test_points_are_the_table_s():
    """Of one sample in the table, its mean with others that were measured; with five digits."""
    table = pd.read_csv(RESULTS / "study/table1.csv").query("packing == 'random'")
    for found, (_, row) in zip(known(LOW_PASS).T, table.iterrows(), strict=True):
        own = row["coordination_number_bearing"], row["f_low_pass_2_linear_khz"] / row["f_max_khz"]
        each, others = [own], RESULTS.glob(f"isostaticity/samples/{row['name']}_*.json")
        for path in others if row["packings"] == 1 else ():
            of = {name: told["value"] for name, told in json.loads(path.read_text()).items()}
            each.append((of["coordination_of_bearing"], of["low_pass"] / of["highest_frequency"]))
        assert found == pytest.approx(np.mean(each, axis=0), rel=1e-4)


def fitted(fit, z, y):
    """The line, which the fit has told to the points' five digits."""
    line = linregress(z, y)
    assert fit["cases"] == len(z)
    found = (line.slope, -line.intercept / line.slope)
    assert (fit["slope"], fit["z_c"]) == pytest.approx(found, rel=1e-3)
    return line


@pytest.mark.parametrize("name", [LOW_PASS, PEAK, IOFFE_REGEL])
def test_lines_and_powers(name):
    """1e-3: the points have five digits, and the zero is far from most of them."""
    (z, y), fit = known(name), FITS.loc[name]
    line = fitted(fit, z, y)
    power = linregress(np.log(z - 4), np.log(y)).slope
    found = (line.rvalue**2, power)
    assert (fit["r_squared"], fit["power_of_z_less_4"]) == pytest.approx(found, rel=1e-3)
    for number in ("slope", "z_c"):
        assert fit[f"{number}_low"] < fit[number] < fit[f"{number}_high"]


MEASURED = {PEAK: "excess_peak", IOFFE_REGEL: "ioffe_regel", LOW_PASS: "low_pass"}


def others(*folders):
    """A line a packing: stress, z, e and the three frequencies over the highest."""
    paths = [path for each in folders for path in (RESULTS / "isostaticity" / each).glob("*.json")]
    found = [json.loads(path.read_text()) for path in paths]
    values = [{name: one["value"] for name, one in of["values"].items()} for of in found]
    table = pd.DataFrame(values).astype(float).assign(stress=[of["stress"] for of in found])
    over = {name: table[key] / table["highest_frequency"] for name, key in MEASURED.items()}
    return table.assign(z=table["coordination_of_bearing"], e=table["void_ratio"], **over)


@pytest.mark.parametrize("name", MEASURED)
def test_contacts_and_density_apart(name):
    """What is left of y on what is left of a variable has the slope of the joint fit.

    Before that the line of the other seeds alone.
    """
    told = pd.read_csv(RESULTS / "isostaticity/one_void_ratio.csv", index_col="quantity").loc[name]
    table = others("seeds", "dilated").query("stress == 1e5")
    some = table.dropna(subset=name)
    assert told["packings"] == len(some)

    def left(of, x, beside):
        fit = linregress(of[beside], of[x])
        return of[x] - fit.slope * of[beside] - fit.intercept

    seeds = others("seeds").dropna(subset=name)
    fitted(FITS.loc[f"{name}, seeds"], seeds["z"], seeds[name])
    for x, beside in (("z", "e"), ("e", "z")):
        slope = linregress(left(some, x, beside), left(some, name, beside)).slope
        change = slope * np.ptp(left(table, x, beside)) / some[name].mean()
        assert told[x] == pytest.approx(change, rel=1e-3)
        assert told[f"{x}_low"] < told[x] < told[f"{x}_high"]


def test_the_shared_zero():
    """Profile of both sums of squares, each over its own least one; trials are 0.005 apart."""

    def left(zero, name):
        z, y = known(name)
        x = z - zero
        return ((y - x * (x @ y) / (x @ x)) ** 2).sum()

    def least(f, *given):
        return minimize_scalar(f, args=given, bounds=(3, 4.4))

    each = {name: least(left, name).fun for name in (LOW_PASS, PEAK)}
    best = least(lambda zero: sum(left(zero, name) / each[name] for name in each))
    assert abs(FITS["z_c"]["low-pass frequency and peak, one z_c"] - best.x) < 0.006


@pytest.fixture(scope="module")
def modes():
    """Each mode of all packings, beside what its packing has."""
    packings = pd.read_csv(RESULTS / "soft_modes/packings.csv")
    table = pd.read_csv(RESULTS / "soft_modes/modes.csv.gz")
    return table.merge(packings, left_on="packing", right_index=True, suffixes=("_moving", ""))


def likelihood(b, x):
    """Minus the mean log density of x (n,), over the upper end, under b x^b from its lower end."""
    low = 0.1 / 0.5
    return -(np.log((b + 1) / (1 - low ** (b + 1))) + b * np.log(x).mean())


def test_powers_below_half_of_f_star(modes):
    """A step of the trials is 0.005; f* is told with seven digits."""
    powers = pd.read_csv(RESULTS / "soft_modes/powers.csv")
    assert modes["packing"].nunique() == powers["packings"].sum()
    for _, row in powers.iterrows():
        mine = (modes["friction"] == row["friction"]) & (modes["spheres"] == row["spheres"])
        x = modes["frequency_hz"][mine] / (500 * row["f_star_khz"])
        x = x[(x > 0.2) & (x < 1)]
        assert len(x) == row["modes_0.1_to_0.5"]
        best = minimize_scalar(likelihood, args=(x,), bounds=(-0.9, 10), method="bounded").x
        assert best == pytest.approx(row["power_0.1_to_0.5"], abs=0.005)


def test_modes_lie_below_the_first_wave_of_their_packing(modes):
    """Each list is certified to be complete there, without zero modes."""
    f, moving, rotation = (modes[name] for name in ("frequency_hz", "spheres_moving", "rotation"))
    assert (f <= 1.0001 * modes["first_wave_hz"]).all() and (f > 10).all()
    assert (moving > 0.99).all() and (moving <= modes["spheres"]).all()
    assert ((rotation > 0) & (rotation <= 1)).all()  # of two digits: 0.996 is 1
