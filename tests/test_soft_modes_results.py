"""The committed powers of soft modes, by scipy's likelihood from the committed modes."""

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

FOLDER = Path(__file__).resolve().parents[1] / "results/soft_modes"


@pytest.fixture(scope="module")
def modes():
    packings = np.genfromtxt(FOLDER / "packings.csv", delimiter=",", names=True)
    table = np.loadtxt(FOLDER / "modes.csv.gz", delimiter=",", skiprows=1)
    return packings, table


def likelihood(b, x):
    """Minus the mean log density of x (n,), over the upper end, under b x^b from its lower end."""
    low = 0.1 / 0.5
    return -(np.log((b + 1) / (1 - low ** (b + 1))) + b * np.log(x).mean())


def test_powers_below_half_of_f_star(modes):
    """A step of the trials is 0.005; f* is told with four digits."""
    packings, table = modes
    with open(FOLDER / "powers.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(packings) == sum(int(row["packings"]) for row in rows)
    for row in rows:
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
