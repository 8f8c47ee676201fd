"""Hold tables of text and write them as Markdown and CSV."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modal.formats.whole_file import write_text

MIN_SHOWN_RELATIVE_ERROR = 1e-6
"""Smallest relative uncertainty that is shown; that of a natural frequency is smaller."""


@dataclass
class Table:
    """Cells of text under a header.

    Attributes
    ----------
    title : str
    header : sequence of str
    rows : sequence of sequences of str
        Rows of cells, each as long as the header.
    name : str
        Name of the table's file.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    name: str = ""

    def markdown(self) -> str:
        """Return the table as Markdown, without the title."""
        rule = "|" + "---|" * len(self.header)
        lines = [_markdown_line(self.header), rule, *map(_markdown_line, self.rows)]
        return "".join(f"{line}\n" for line in lines)

    def write_csv(self, path: Path) -> None:
        """Write the header and the rows as CSV."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.header, *self.rows])
        write_text(path, text.getvalue())


def _markdown_line(cells: Sequence[str]) -> str:
    """Return a row of a Markdown table."""
    return f"| {' | '.join(cells)} |"


def cell(value: Any, form: str = "g") -> str:
    """Return a value as text; empty if it is not known.

    `form` is Python's format of a number, followed by a unit if there is one.

    >>> cell(0.25, ".1f %"), cell(True), cell(np.nan)
    ('0.2 %', 'yes', '')
    """
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    if not np.isfinite(value):
        return ""
    digits, *unit = form.split()
    return " ".join([f"{value:{digits}}", *unit])


def number(value: float, error: float = np.nan, digits: int = 4) -> str:
    """Return a value rounded to the first digit of its uncertainty, without one to `digits`.

    Whole numbers without uncertainty have no decimals. Empty if the value is not known.

    >>> number(21.897, 0.93)
    '21.9 ± 0.9'
    """
    if not np.isfinite(value):
        return ""
    if not (np.isfinite(error) and error > MIN_SHOWN_RELATIVE_ERROR * abs(value)):
        if value == round(value):
            return f"{value:.0f}"
        return f"{value:.{digits}g}"
    error = float(f"{error:.0e}")  # one digit, which may carry: 0.96 is 1
    places = -int(np.floor(np.log10(error)))
    decimals = max(places, 0)
    return f"{round(value, places):.{decimals}f} ± {error:.{decimals}f}"
