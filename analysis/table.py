"""A table: cells of text under a header, as Markdown, CSV and aligned for a terminal."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modal.formats.whole_file import write_text


@dataclass
class Table:
    """A title, a header and rows of text, each row as long as the header; name of its file."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    name: str = ""

    def markdown(self) -> str:
        """As Markdown, without the title."""
        head, *rows = (f"| {' | '.join(line)} |\n" for line in (self.header, *self.rows))
        return head + "|" + "---|" * len(self.header) + "\n" + "".join(rows)

    def text(self) -> str:
        """Aligned for a terminal, without the title; lines are told apart by their first cell."""
        from pandas import DataFrame  # which other tables do without

        return DataFrame(self.rows, columns=self.header).set_index(self.header[0]).to_string()

    def write_csv(self, path: Path) -> None:
        """Write the header and the rows as CSV."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.header, *self.rows])
        write_text(path, text.getvalue())


def cell(value: Any, form: str = "g") -> str:
    """A value as text, by Python's format and what stands behind it; empty where it is not known.

    >>> cell(0.25, ".1f %"), cell(True), cell(np.nan)
    ('0.2 %', 'yes', '')
    """
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, str) or value is None:
        return value or ""
    form, *unit = form.split()
    return " ".join([f"{value:{form}}", *unit]) if np.isfinite(value) else ""


NONE = 1e-6
"""In parts of a value: an uncertainty that no reader is shown."""


def number(value: float, error: float = np.nan, digits: int = 4) -> str:
    """A value, to the first digit of its uncertainty where there is one, else to `digits`.

    Counts are whole; empty where there is no value. An uncertainty below `NONE` of the value, as of
    a natural frequency, is none for a reader.

    >>> number(21.897, 0.93)
    '21.9 ± 0.9'
    """
    if not np.isfinite(value):
        return ""
    if not (np.isfinite(error) and error > NONE * abs(value)):
        return f"{value:.0f}" if value == round(value) else f"{value:.{digits}g}"
    error = float(f"{error:.0e}")  # one digit, which may carry: 0.96 is 1
    places = -int(np.floor(np.log10(error)))
    return f"{round(value, places):.{max(places, 0)}f} ± {error:.{max(places, 0)}f}"
