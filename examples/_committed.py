"""What the examples that read committed results share: the results, the look, the files."""

import json
from pathlib import Path

import matplotlib.pyplot as plt

from analysis.table import Table

RESULTS = Path(__file__).resolve().parents[1] / "results"
PEAK_SLOPE = 0.058  # f* = PEAK_SLOPE (z - 4) f_max: the peak of D(f) / f² of the study's packings
plt.rcParams.update({"font.size": 8, "axes.linewidth": 0.6, "pdf.fonttype": 42})
plt.rcParams.update({"xtick.direction": "in", "ytick.direction": "in"})


def results(pattern, folder=RESULTS):
    """Each result of a measured packing: its file's stem, its numbers by name, all that it has."""
    for path in sorted(folder.glob(pattern)):
        found = json.loads(path.read_text())
        numbers = found.get("values", found)
        yield path.stem, {name: each["value"] for name, each in numbers.items()}, found


def write(folder, figures, tables, **as_csv):
    """Figures as PNG and PDF, tables as CSV, each under its name, into a folder."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        figure.savefig(folder / f"{name}.png", dpi=200)
        figure.savefig(folder / f"{name}.pdf", metadata={"CreationDate": None})
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv", index=False, **as_csv)


def write_page(path, table, columns, unknown=""):
    """A table as Markdown, as pages include it: its columns' headers, and how a row is written."""
    lines = [[form.format(**row) for form in columns.values()] for row in table.to_dict("records")]
    lines = [[unknown if "nan" in cell else cell for cell in line] for line in lines]
    Path(path).write_text(Table("", list(columns), lines).markdown())
