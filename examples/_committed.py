"""Shared parts of the examples that read committed results: results, means, style, files."""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from analysis.mean import mean_of_values
from analysis.table import Table
from analysis.value import Value

RESULTS = Path(__file__).resolve().parents[1] / "results"
PEAK_SLOPE = 0.058  # f* = PEAK_SLOPE (z - 4) f_max: the peak of D(f) / f² of the study's packings
plt.rcParams.update({"font.size": 8, "axes.linewidth": 0.6, "pdf.fonttype": 42})
plt.rcParams.update({"xtick.direction": "in", "ytick.direction": "in"})


def results(pattern, folder=RESULTS):
    """Yield the file's stem, the numbers by name, and all contents of each measured packing."""
    for path in sorted(folder.glob(pattern)):
        contents = json.loads(path.read_text())
        values = contents.get("values", contents)
        yield path.stem, {name: value["value"] for name, value in values.items()}, contents


def mean_with_error(numbers, errors=None):
    """Return the mean of the known numbers and its standard error, by the rule of `analysis.mean`.

    The error is that from their scatter, or that from their own known errors if it is larger. Both
    results are NaN without numbers; the error of a single number without its own is NaN.
    """
    numbers = np.asarray(numbers, float)
    if errors is None:
        errors = np.full(numbers.shape, np.nan)
    known = np.isfinite(numbers)
    if not known.any():
        return np.nan, np.nan
    mean = mean_of_values([Value(number, "1") for number in numbers[known]])
    values = []
    for number, error in zip(numbers, np.asarray(errors, float), strict=True):
        if np.isfinite(number) and np.isfinite(error):
            values.append(Value(number, "1", {"fit": error}))
    own_error = np.nan
    if values:
        own_error = mean_of_values(values).parts["fit"]
    return float(mean.value), float(np.fmax(mean.parts["samples"], own_error))


def write(folder, figures, tables, **csv_options):
    """Write figures as PNG and PDF and tables as CSV, each under its name, into a folder."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        figure.savefig(folder / f"{name}.png", dpi=200)
        figure.savefig(folder / f"{name}.pdf", metadata={"CreationDate": None})
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv", index=False, **csv_options)


def write_page(path, table, columns, unknown=""):
    """Write a table as Markdown; `columns` has the format of a row's cell by the header."""
    lines = []
    for row in table.to_dict("records"):
        cells = [cell_format.format(**row) for cell_format in columns.values()]
        lines.append([unknown if "nan" in cell else cell for cell in cells])
    Path(path).write_text(Table("", list(columns), lines).markdown())
