"""A table: cells of text under a header, as Markdown, CSV and aligned for a terminal."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from modal.formats.hdf5 import write_text
from modal.tools.errors import InputError


@dataclass
class Table:
    """A title, a header and rows of text, each row as long as the header."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]

    def markdown(self) -> str:
        """As Markdown, without the title."""
        head, *rows = (f"| {' | '.join(line)} |\n" for line in (self.header, *self.rows))
        return head + "|" + "---|" * len(self.header) + "\n" + "".join(rows)

    def text(self) -> str:
        """Aligned for a terminal, without the title; columns of numbers to the right."""
        columns = []
        for head, *cells in zip(self.header, *self.rows, strict=True):
            width = max(map(len, (head, *cells)))
            right = any(cells) and all(map(_is_number, cells))
            columns.append([c.rjust(width) if right else c.ljust(width) for c in (head, *cells)])
        return "\n".join("  ".join(line).rstrip() for line in zip(*columns, strict=True))

    def write_csv(self, path: Path) -> Path:
        """Write the header and the rows as CSV; returns the path."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.header, *self.rows])
        write_text(path, text.getvalue())
        return path

    def write(self, stem: Path) -> list[Path]:
        """Write stem.csv and stem.md; returns their paths."""
        text = stem.with_name(stem.name + ".md")
        write_text(text, self.markdown())
        return [self.write_csv(stem.with_name(stem.name + ".csv")), text]


def read_csv(path: Path, title: str) -> Table:
    """The table that `write_csv` has written; InputError where it is none."""
    with open(path, newline="") as file:
        lines = list(csv.reader(file))
    if not lines or any(len(line) != len(lines[0]) for line in lines):
        raise InputError(f"{path}: no table, for its rows are not equally long; make it again")
    return Table(title, lines[0], lines[1:])


def _is_number(cell: str) -> bool:
    try:
        float(cell or "nan")
    except ValueError:
        return False
    return True
