"""What a benchmark has found, as Markdown, CSV and PNG."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

DOTS_PER_INCH = 110
"""Keeps a figure of six panels below 150 kB."""


@dataclass
class Finding:
    """Title, what was done, rows of the table, conclusions one by one, and figures by name."""

    title: str
    task: str
    rows: list[dict[str, Any]]
    notes: list[str] = field(default_factory=list)
    figures: dict[str, Figure] = field(default_factory=dict)


def columns(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Keys of all rows in the order in which they come first."""
    return list(dict.fromkeys(name for row in rows for name in row))


def shown(value: Any) -> str:
    """A value in a cell of a table: three digits, nothing for None."""
    if value is None:
        return ""
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Rows as a Markdown table."""
    names = columns(rows)
    lines = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    lines += ["| " + " | ".join(shown(row.get(name)) for name in names) + " |" for row in rows]
    return "\n".join(lines)


def write_csv(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Rows as CSV, numbers with eight digits."""
    with open(path, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns(rows))
        for row in rows:
            cells = [row.get(name) for name in columns(rows)]
            writer.writerow(f"{c:.8g}" if isinstance(c, float) else c for c in cells)


def markdown(finding: Finding, name: str) -> str:
    """A section of the report; figures are beside it."""
    parts = [f"## {finding.title}", finding.task]
    parts += [f"![{finding.title}]({stem}.png)" for stem in finding.figures]
    parts.append("\n".join(f"- {note}" for note in finding.notes))
    parts += [table(finding.rows), f"Numbers: `{name}.csv`."]
    return "\n\n".join(part for part in parts if part)


def write(finding: Finding, name: str, folder: Path) -> str:
    """Write NAME.csv, NAME.md and the figures; returns the section."""
    folder.mkdir(parents=True, exist_ok=True)
    write_csv(finding.rows, folder / f"{name}.csv")
    for stem, figure in finding.figures.items():
        figure.savefig(folder / f"{stem}.png", dpi=DOTS_PER_INCH)
    text = markdown(finding, name)
    (folder / f"{name}.md").write_text(text + "\n")
    return text
