"""What a benchmark has found, as Markdown, CSV and PNG."""

from __future__ import annotations

import csv
from collections.abc import Sequence
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
    """Title, what was done, tables by name, conclusions one by one, and figures by name."""

    title: str
    task: str
    tables: dict[str, Rows]
    notes: list[str] = field(default_factory=list)
    figures: dict[str, Figure] = field(default_factory=dict)


def columns(rows: Rows) -> list[str]:
    """Keys of all rows in the order in which they come first."""
    return list(dict.fromkeys(name for row in rows for name in row))


def shown(value: Any) -> str:
    """A value in a cell of a table: three digits, nothing for None."""
    if value is None:
        return ""
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def markdown_table(names: Sequence[str], rows: Rows) -> str:
    """Rows as a Markdown table."""
    cells = [[shown(row.get(name)) for name in names] for row in rows]
    return Table("", names, cells).markdown().rstrip("\n")


def write_csv(rows: Rows, path: Path) -> None:
    """Rows as CSV, numbers with eight digits."""

    def text(value: Any) -> str:
        if value is None:
            return ""
        return f"{value:.8g}" if isinstance(value, float) else str(value)

    names = columns(rows)
    Table("", names, [[text(row.get(name)) for name in names] for row in rows]).write_csv(path)


def read_csv(path: Path) -> Rows:
    """Rows as they were written: numbers as float, empty cells as None."""

    def value(text: str) -> float | str | None:
        try:
            return float(text)
        except ValueError:
            return text or None

    with open(path, newline="") as file:
        return [{name: value(text) for name, text in row.items()} for row in csv.DictReader(file)]


def markdown(page: Page) -> str:
    """The page; figures and numbers are files beside it."""
    parts = [f"## {page.title}", page.task]
    parts += [f"![{page.title}]({name}.png)" for name in page.figures]
    parts.append("\n".join(f"- {note}" for note in page.notes))
    for name, rows in page.tables.items():
        parts += [f"`{name}.csv`:", markdown_table(columns(rows), rows)]
    return "\n\n".join(part for part in parts if part)


def write(page: Page, name: str, folder: Path) -> str:
    """Write NAME.md, the tables and the figures; returns the page's text."""
    folder.mkdir(parents=True, exist_ok=True)
    for table, rows in page.tables.items():
        write_csv(rows, folder / f"{table}.csv")
    for stem, figure in page.figures.items():
        figure.savefig(folder / f"{stem}.png", dpi=DOTS_PER_INCH)
    text = markdown(page)
    (folder / f"{name}.md").write_text(text + "\n")
    return text
