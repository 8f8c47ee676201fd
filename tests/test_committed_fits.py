"""The committed fits against z - 4 and powers of soft modes, by scipy from the committed points."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import linregress

RESULTS = Path(__file__).resolve().parents[1] / "results"
LOW_PASS, PEAK, IOFFE_REGEL = "low-pass frequency (2 %)", "peak of D(f) / f²", "Ioffe-Regel limit"


def rows(name):
    with open(RESULTS / name) as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def points():
    found = rows("isostaticity/headline.csv")
    z = np.array([float(row["z"]) for row in found])
    ys = {
        name: np.array([float(row[f"{name} / f_max"]) for row in found])
        for name in (LOW_PASS, PEAK, IOFFE_REGEL)
    }
    return z, ys


@pytest.fixture(scope="module")
def fits():
    return {row["quantity"]: row for row in rows("isostaticity/fits.csv")}


def test_points_are_the_table_s(points):
    """Written with five digits."""
    z, ys = points
    table = [row for row in rows("study/table1.csv") if row["packing"] == "random"]
    assert len(table) == len(z) == 28
    for k, row in enumerate(table):
        assert z[k] == pytest.approx(float(row["coordination_number_bearing"]), rel=1e-4)
        over = float(row["f_low_pass_2_linear_khz"]) / float(row["f_max_khz"])
        assert ys[LOW_PASS][k] == pytest.approx(over, rel=1e-4)


def fitted(fit, z, y):
    """The line, which the fit has told to the points' five digits."""
    line = linregress(z, y)
    assert int(fit["cases"]) == len(z)
    for name, value in (("slope", line.slope), ("z_c", -line.intercept / line.slope)):
        assert float(fit[name]) == pytest.approx(value, rel=1e-3)
    return line


@pytest.mark.parametrize("name", [LOW_PASS, PEAK, IOFFE_REGEL])
def test_lines_and_powers(name, points, fits):
    """1e-3: the points have five digits, and the zero is far from most of them."""
    z, y = points[0], points[1][name]
    known = np.isfinite(y)
    fit = fits[name]
    line = fitted(fit, z[known], y[known])
    assert float(fit["r_squared"]) == pytest.approx(line.rvalue**2, rel=1e-3)
    power = linregress(np.log(z[known] - 4), np.log(y[known])).slope
    assert float(fit["power_of_z_less_4"]) == pytest.approx(power, rel=1e-3)
    for number in ("slope", "z_c"):
        assert float(fit[f"{number}_low"]) < float(fit[number]) < float(fit[f"{number}_high"])


@pytest.mark.parametrize(
    ("name", "quantity"),
    [(PEAK, "excess_peak"), (IOFFE_REGEL, "ioffe_regel"), (LOW_PASS, "low_pass")],
)
def test_lines_of_the_other_packings(name, quantity, fits):
    paths = (RESULTS / "isostaticity/seeds").glob("*.json")
    found = [json.loads(path.read_text())["values"] for path in paths]
    known = [one for one in found if one.get(quantity, {}).get("value") is not None]
    z = [one["coordination_of_bearing"]["value"] for one in known]
    y = [one[quantity]["value"] / one["highest_frequency"]["value"] for one in known]
    fitted(fits[f"{name}, seeds"], z, y)


def test_the_shared_zero(points, fits):
    """Profile of both sums of squares, each over its own least one; trials are 0.005 apart."""
    z, ys = points

    def left(name, zero):
        known = np.isfinite(ys[name])
        x, y = z[known] - zero, ys[name][known]
        return ((y - x * (x @ y) / (x @ x)) ** 2).sum()

    least = {
        name: minimize_scalar(lambda c, n=name: left(n, c), bounds=(3, 4.4)).fun
        for name in (LOW_PASS, PEAK)
    }
    best = minimize_scalar(
        lambda c: sum(left(name, c) / least[name] for name in least), bounds=(3, 4.4)
    )
    assert float(fits["both, one z_c"]["z_c"]) == pytest.approx(best.x, abs=0.006)


@pytest.fixture(scope="module")
def modes():
    packings = np.genfromtxt(RESULTS / "soft_modes" / "packings.csv", delimiter=",", names=True)
    table = np.loadtxt(RESULTS / "soft_modes" / "modes.csv.gz", delimiter=",", skiprows=1)
    return packings, table


def likelihood(b, x):
    """Minus the mean log density of x (n,), over the upper end, under b x^b from its lower end."""
    low = 0.1 / 0.5
    return -(np.log((b + 1) / (1 - low ** (b + 1))) + b * np.log(x).mean())


def test_powers_below_half_of_f_star(modes):
    """A step of the trials is 0.005; f* is told with four digits."""
    packings, table = modes
    powers = rows("soft_modes/powers.csv")
    assert len(packings) == sum(int(row["packings"]) for row in powers)
    for row in powers:
        of = packings[table[:, 0].astype(int)]
        mine = of["friction"] == float(row["friction"])
        mine &= (of["spheres"] > 1000) == (float(row["spheres"]) > 1000)
        x = table[mine, 1] / (500 * float(row["f_star_khz"]))
        x = x[(x > 0.2) & (x < 1)]
        assert abs(len(x) - int(row["modes_0.1_to_0.5"])) <= 1
        best = minimize_scalar(likelihood, args=(x,), bounds=(-0.9, 10), method="bounded").x
        assert best == pytest.approx(float(row["power_0.1_to_0.5"]), abs=0.02)


def test_modes_lie_below_the_first_wave_of_their_packing(modes):
    """Each list is certified to be complete there, without zero modes."""
    packings, table = modes
    of = packings[table[:, 0].astype(int)]
    assert (table[:, 1] <= 1.0001 * of["first_wave_hz"]).all() and (table[:, 1] > 10).all()
    assert (table[:, 2] > 0.99).all() and (table[:, 2] <= of["spheres"]).all()
    assert ((table[:, 3] > 0) & (table[:, 3] < 1)).all()
