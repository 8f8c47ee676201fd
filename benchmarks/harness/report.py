"""Pages of benchmarks as Markdown, CSV and PNG."""

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from analysis.table import Table

Rows = list[dict[str, Any]]
DOTS_PER_INCH = 110
"""Keeps a figure of six panels below 150 kB."""


@dataclass
class Page:
    """A page: title, description of the task, tables by name, conclusions, and figures by name."""

    title: str
    task: str
    tables: dict[str, Rows]
    notes: list[str] = field(default_factory=list)
    figures: dict[str, Figure] = field(default_factory=dict)

    def markdown(self) -> str:
        """Return the page as Markdown; figures and numbers are files beside it."""
        blocks = [f"## {self.title}", self.task]
        blocks += [f"![{self.title}]({name}.png)" for name in self.figures]
        blocks.append("\n".join(f"- {note}" for note in self.notes))
        for name, rows in self.tables.items():
            blocks += [f"`{name}.csv`:", table(rows, digits=3).markdown().rstrip("\n")]
        return "\n\n".join(filter(None, blocks))

    def write(self, name: str, folder: Path) -> None:
        """Write NAME.md, the tables and the figures."""
        for stem, rows in self.tables.items():
            table(rows, digits=8).write_csv(folder / f"{stem}.csv")
        for stem, figure in self.figures.items():
            figure.savefig(folder / f"{stem}.png", dpi=DOTS_PER_INCH)
        (folder / f"{name}.md").write_text(self.markdown() + "\n")


def table(rows: Rows, digits: int) -> Table:
    """Return rows as text, with an empty cell for None; columns are in order of appearance."""
    names: dict[str, None] = {}
    for row in rows:
        names |= dict.fromkeys(row)

    def text(value: Any) -> str:
        if value is None:
            return ""
        if isinstance(value, float):
            return f"{value:.{digits}g}"
        return str(value)

    lines = []
    for row in rows:
        lines.append([text(row.get(name)) for name in names])
    return Table("", list(names), lines)


def read_csv(path: Path) -> Rows:
    """Read rows as they were written, with numbers as float and empty cells as None."""

    def value(text: str) -> float | str | None:
        try:
            return float(text)
        except ValueError:
            return text or None

    with open(path, newline="") as file:
        return [{name: value(text) for name, text in row.items()} for row in csv.DictReader(file)]
