"""Figures: each function draws into given Axes and returns the numbers that it shows."""

from __future__ import annotations

import csv
from collections.abc import Callable
from itertools import zip_longest
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from analysis.figures import crystal, waves
from analysis.figures.gain import gain
from analysis.products import Products
from modal.storage import InputError

STYLE = Path(__file__).with_name("paper.mplstyle")
# name: (function, rows of axes, product that it needs)
FIGURES: dict[str, tuple[Callable, int, str]] = {
    "signals": (waves.signals, 3, "signals"),
    "space_time": (waves.space_time, 1, "signals"),
    "spectrum_distance": (waves.spectrum_distance, 1, "signals"),
    "dispersion": (waves.dispersion, 1, "network"),
    "gain": (gain, 2, "network"),
    "natural_frequencies": (crystal.natural_frequencies, 2, "modes"),
    "chi_z": (crystal.chi_z, 1, "modes"),
    "mode_shapes": (crystal.mode_shapes, 6, "modes"),
}
CROSS_CASE = {"stress_dependence": (crystal.stress_dependence, 2, "network")}


def draw(name: str, cases: list[Products], output: Path, *, missing_ok: bool = False) -> list[Path]:
    """Draw a figure of each case, or one of all; returns the PNG and CSV files written."""
    if name not in FIGURES and name not in CROSS_CASE:
        known = ", ".join(sorted((*FIGURES, *CROSS_CASE)))
        raise InputError(f"{name!r} is not a figure; choose one of {known}")
    function, rows, needs = (FIGURES | CROSS_CASE)[name]
    missing = [case for case in cases if not case.has(needs)]
    if missing:
        if missing_ok:
            return []
        raise InputError(f"{missing[0].path(needs)}: no such file; make it before figure {name}")
    if name in CROSS_CASE:
        return write_figure(function, cases, rows, output / name)
    paths = []
    for case in cases:
        paths += write_figure(function, case, rows, output / f"{case.name}.{name}")
    return paths


def write_figure(function: Callable, subject: object, rows: int, stem: Path) -> list[Path]:
    """Draw `function(axes, subject)` and write stem.png and stem.csv."""
    with matplotlib.rc_context(fname=STYLE):
        width, height = matplotlib.rcParams["figure.figsize"]
        figure = Figure(figsize=(width, height if rows == 1 else 1.1 + 1.55 * rows))
        axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
        columns = function(axes if rows > 1 else axes[0], subject)
        png = stem.with_name(stem.name + ".png")
        figure.savefig(png)
    table = stem.with_name(stem.name + ".csv")
    with open(table, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for line in zip_longest(*columns.values(), fillvalue=""):
            writer.writerow(x if isinstance(x, str) else f"{x:.8g}" for x in line)
    return [png, table]
