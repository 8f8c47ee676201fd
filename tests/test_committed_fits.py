"""The committed fits over z - 4 and powers of soft modes, again by SciPy from committed points."""

import json

import numpy as np
import pandas as pd
import pytest
from places import ROOT
from scipy.optimize import minimize_scalar
from scipy.stats import linregress

RESULTS = ROOT / "results"
ISOSTATICITY = RESULTS / "isostaticity"
LOW_PASS = "low-pass frequency (2 %)"
PEAK = "peak of D(f) / f²"
IOFFE_REGEL = "Ioffe-Regel limit"
MEASURED = {PEAK: "excess_peak", IOFFE_REGEL: "ioffe_regel", LOW_PASS: "low_pass"}
"""Name of each frequency in a file of measured quantities."""
POINTS = pd.read_csv(ISOSTATICITY / "headline.csv")
FITS = pd.read_csv(ISOSTATICITY / "fits.csv", index_col="quantity")


def points(name):
    """Return z and a frequency, divided by the highest one, of the packings that have both."""
    return POINTS[["z", f"{name} / f_max"]].dropna().to_numpy().T


def read_values(path):
    """Return the measured values in a file, by name."""
    quantities = json.loads(path.read_text())
    return {name: quantity["value"] for name, quantity in quantities.items()}


def samples_of(case):
    """Return z and the low-pass frequency over the highest one of each sample of a case."""
    samples = []
    for path in ISOSTATICITY.glob(f"samples/case{case:02}_seed*.json"):
        values = read_values(path)
        frequency = values["low_pass"] / values["highest_frequency"]
        samples.append((values["coordination_of_bearing"], frequency))
    return samples


def test_points_are_means_of_the_samples():
    """Compare z and the low-pass frequency; 1e-4: the points have five digits."""
    for case, point in zip(POINTS["case"], points(LOW_PASS).T, strict=True):
        assert point == pytest.approx(np.mean(samples_of(case), axis=0), rel=1e-4)


def assert_same_line(fit, z, y):
    """Compare slope and zero of a committed fit with the least-squares line of the points.

    1e-3: the points have five digits, and the zero is far from most of them.
    """
    line = linregress(z, y)
    assert fit["cases"] == len(z)
    assert fit["slope"] == pytest.approx(line.slope, rel=1e-3)
    assert fit["z_c"] == pytest.approx(-line.intercept / line.slope, rel=1e-3)


@pytest.mark.parametrize("name", MEASURED)
def test_committed_lines(name):
    z, frequency = points(name)
    assert_same_line(FITS.loc[name], z, frequency)
    correlation = linregress(z, frequency).rvalue
    assert FITS.loc[name]["r_squared"] == pytest.approx(correlation**2, rel=1e-3)


@pytest.mark.parametrize("name", MEASURED)
def test_committed_powers_of_z_less_4(name):
    z, frequency = points(name)
    power = linregress(np.log(z - 4), np.log(frequency)).slope
    assert FITS.loc[name]["power_of_z_less_4"] == pytest.approx(power, rel=1e-3)


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("number", ["slope", "z_c"])
def test_committed_intervals_contain_their_number(name, number):
    fit = FITS.loc[name]
    assert fit[f"{number}_low"] < fit[number] < fit[f"{number}_high"]


def packings_of(*folders):
    """Return a table with a row a packing: stress, z, e and three frequencies.

    The frequencies are divided by the highest one of the packing.
    """
    rows = []
    for folder in folders:
        for path in (ISOSTATICITY / folder).glob("*.json"):
            result = json.loads(path.read_text())
            values = {name: quantity["value"] for name, quantity in result["values"].items()}
            rows.append({"stress": result["stress"], **values})
    table = pd.DataFrame(rows).astype(float)
    for name, quantity in MEASURED.items():
        table[name] = table[quantity] / table["highest_frequency"]
    return table.rename(columns={"coordination_of_bearing": "z", "void_ratio": "e"})


@pytest.mark.parametrize("name", MEASURED)
def test_lines_of_the_seeds(name):
    seeds = packings_of("seeds").dropna(subset=name)
    assert_same_line(FITS.loc[f"{name}, seeds"], seeds["z"], seeds[name])


def residual(table, variable, regressor):
    """Return what a least-squares line over the regressor leaves of a variable."""
    line = linregress(table[regressor], table[variable])
    return table[variable] - line.slope * table[regressor] - line.intercept


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize(("variable", "regressor"), [("z", "e"), ("e", "z")])
def test_changes_with_contacts_and_with_density(name, variable, regressor):
    """Fit the residual of the frequency over that of z or e.

    The slope of a joint fit over both variables is that of the residuals (Frisch and Waugh).
    """
    fits = pd.read_csv(ISOSTATICITY / "one_void_ratio.csv", index_col="quantity")
    fit = fits.loc[name]
    table = packings_of("seeds", "dilated").query("stress == 1e5")
    with_frequency = table.dropna(subset=name)
    assert fit["packings"] == len(with_frequency)
    of_variable = residual(with_frequency, variable, regressor)
    of_frequency = residual(with_frequency, name, regressor)
    slope = linregress(of_variable, of_frequency).slope
    span = np.ptp(residual(table, variable, regressor))
    change = slope * span / with_frequency[name].mean()
    assert fit[variable] == pytest.approx(change, rel=1e-3)
    assert fit[f"{variable}_low"] < fit[variable] < fit[f"{variable}_high"]


def squares_left(zero, name):
    """Return the sum of squares that the best line through `zero` leaves of a frequency."""
    z, frequency = points(name)
    distance = z - zero
    slope = distance @ frequency / (distance @ distance)
    return ((frequency - slope * distance) ** 2).sum()


def minimum(function):
    """Return where a function of the zero is least, and its value there."""
    result = minimize_scalar(function, bounds=(3, 4.4))
    return result.x, result.fun


def test_the_shared_zero():
    """Minimise the sum of both sums of squares, each divided by its own least one.

    The committed trials of the zero are 0.005 apart.
    """
    names = (LOW_PASS, PEAK)
    least = {name: minimum(lambda zero, name=name: squares_left(zero, name))[1] for name in names}
    zero, _ = minimum(lambda zero: sum(squares_left(zero, name) / least[name] for name in names))
    assert abs(FITS["z_c"]["low-pass frequency and peak, one z_c"] - zero) < 0.006


@pytest.fixture(scope="module")
def modes():
    """Return a table with a row a mode, with the columns of its packing."""
    packings = pd.read_csv(RESULTS / "soft_modes/packings.csv")
    table = pd.read_csv(RESULTS / "soft_modes/modes.csv.gz")
    return table.merge(packings, left_on="packing", right_index=True, suffixes=("_moving", ""))


def minus_log_likelihood(power, x):
    """Return minus the mean log density of x (n,) under x^power between 0.2 and 1."""
    lowest = 0.1 / 0.5
    norm = (power + 1) / (1 - lowest ** (power + 1))
    return -(np.log(norm) + power * np.log(x).mean())


def test_powers_below_half_of_f_star(modes):
    """Fit a power law to the modes between 0.1 and 0.5 f*, by maximum likelihood.

    The committed trials of the power are 0.005 apart.
    """
    powers = pd.read_csv(RESULTS / "soft_modes/powers.csv")
    assert modes["packing"].nunique() == powers["packings"].sum()
    for _, row in powers.iterrows():
        same_friction = modes["friction"] == row["friction"]
        same_size = modes["spheres"] == row["spheres"]
        # kHz to Hz, and half of f*.
        x = modes["frequency_hz"][same_friction & same_size] / (500 * row["f_star_khz"])
        x = x[(x > 0.2) & (x < 1)]
        assert len(x) == row["modes_0.1_to_0.5"]
        fit = minimize_scalar(minus_log_likelihood, args=(x,), bounds=(-0.9, 10), method="bounded")
        assert fit.x == pytest.approx(row["power_0.1_to_0.5"], abs=0.005)


def test_modes_lie_below_the_first_wave_of_their_packing(modes):
    """Find no zero modes, which lie below 10 Hz, and none above the wave, by its four digits."""
    frequency = modes["frequency_hz"]
    assert (frequency <= 1.0001 * modes["first_wave_hz"]).all()
    assert (frequency > 10).all()


def test_participation_of_the_modes_is_possible(modes):
    """Have between one and all spheres move; numbers have two digits: 0.996 is 1."""
    moving = modes["spheres_moving"]
    rotation = modes["rotation"]
    assert (moving > 0.99).all()
    assert (moving <= modes["spheres"]).all()
    assert (rotation > 0).all()
    assert (rotation <= 1).all()
