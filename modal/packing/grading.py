"""Compute and read grading curves: the share of the mass that is finer than a diameter."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from modal.tools.arrays import Floats
from modal.tools.errors import InputError

PERCENTILES = (10, 50, 90)
"""Per cents finer by mass whose diameters are told: d10, d50, d90."""
CURVE = "curve"
"""First word of a mixture that follows a grading curve."""
GRID_POINTS = 20_001
"""Number of diameters at which the density of numbers is integrated; the error of a quantile is
some 1e-8 of it for a curve over a factor of ten."""
FORM = "two columns: diameter in m, and per cent finer by mass, both rising, from 0 to 100 per cent"


def finer_diameters(
    diameter: Floats, mass: Floats, percent: Sequence[float] = PERCENTILES
) -> Floats:
    """Return the diameters (k,), m, at which `percent` (k,) of the mass is finer.

    `diameter`, m, and `mass`, kg, are those of the spheres (n,). Between two spheres of different
    sizes the curve is linear in the diameter; at its own diameter half of a sphere's mass counts as
    finer.

    >>> finer_diameters(np.array([1.0, 2.0, 3.0]), np.ones(3), [50]).tolist()
    [2.0]
    """
    order = np.argsort(diameter, kind="stable")
    finer = np.cumsum(mass[order]) - mass[order] / 2
    result: Floats = np.interp(np.array(percent) / 100 * mass.sum(), finer, diameter[order])
    return result


def read_grading(path: str | Path) -> list[str]:
    """Return the words of a mixture, "curve" and pairs of numbers, from a table of a grading curve.

    The table, *.csv, has two columns: diameters, m, and per cent finer by mass. A first line of
    names is skipped. Raises InputError for any other table.
    """
    try:
        text = Path(path).read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("unreadable", f"{path}: cannot be read ({error})") from None
    rows = [row for row in csv.reader(text.splitlines()) if row]
    if rows and not _is_number(rows[0][0]):
        del rows[0]
    words = [CURVE]
    for row in rows:
        if len(row) != 2 or not all(map(_is_number, row)):
            raise InputError(
                "grading", f"{path}: {','.join(row)}", "no line of a grading curve", f"give {FORM}"
            )
        words += [word.strip() for word in row]
    check_curve([float(word) for word in words[1:]], str(path))
    return words


def check_curve(numbers: Sequence[float], name: str) -> None:
    """Raise InputError unless the numbers are pairs of diameter, m, and per cent finer by mass."""
    points = np.reshape(numbers[: len(numbers) // 2 * 2], (-1, 2))
    diameter, percent = points.T
    are_points = len(numbers) % 2 == 0 and len(points) >= 2 and bool(np.isfinite(points).all())
    is_curve = False
    if are_points:
        sizes_rise = diameter[0] > 0 and bool((np.diff(diameter) > 0).all())
        percents_rise = bool((np.diff(percent) >= 0).all())
        is_complete = percent[0] == 0 and percent[-1] == 100
        is_curve = sizes_rise and percents_rise and is_complete
    if not is_curve:
        raise InputError("grading", f"{name}: no grading curve", remedy=f"give {FORM}")


def radii_of_curve(spheres: int, numbers: Sequence[float]) -> Floats:
    """Return the radii (n,), m, ascending, of spheres whose masses follow a grading curve.

    Between the points of the curve the mass finer than d is linear in ln d. The number of spheres
    per mass is proportional to 1 / d^3; radii are the quantiles of the distribution by number at (k
    + 1/2) / n, so that a small packing lacks the coarsest part of a wide curve.
    """
    check_curve(numbers, CURVE)
    diameter, percent = np.reshape(numbers, (-1, 2)).T
    log_diameter = np.linspace(np.log(diameter[0]), np.log(diameter[-1]), GRID_POINTS)
    finer = np.interp(log_diameter, np.log(diameter), percent / 100)
    middle = (log_diameter[1:] + log_diameter[:-1]) / 2
    number = np.diff(finer) * np.exp(-3 * (middle - middle[0]))
    by_number = np.concatenate([[0.0], np.cumsum(number)]) / number.sum()
    # Flat parts of the curve hold no spheres; their last point is that from which it goes on.
    rising = np.concatenate([[True], np.diff(by_number) > 0])
    rising[:-1] |= rising[1:]
    quantile = (np.arange(spheres) + 0.5) / spheres
    radii: Floats = np.exp(np.interp(quantile, by_number[rising], log_diameter[rising])) / 2
    return radii


def _is_number(word: str) -> bool:
    """Return whether a text is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True
