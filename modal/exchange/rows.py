"""Rows of numbers below the names of columns."""

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from modal.exchange.digits import count_significant_digits
from modal.exchange.numbers import parse_columns
from modal.exchange.refusals import quote, refuse
from modal.tools.arrays import Bools, Floats, Ints

SAMPLED_ROWS = 500
"""Number of rows whose texts show how many digits a program has written."""
MAX_EXACT_INTEGER = 2**53
"""Largest whole number up to which double precision holds every whole number."""


@dataclass(frozen=True)
class Rows:
    """Rows of named columns in a text file.

    Attributes
    ----------
    path : Path
        The file.
    columns : tuple of str
        Names of the columns, in their order.
    texts : sequence of str
        The text of each row.
    line : int
        Number of the first row's line, from 1.
    separator : str or None
        What separates numbers; None for blanks.
    """

    path: Path
    columns: tuple[str, ...]
    texts: Sequence[str]
    line: int
    separator: str | None = None

    def has(self, *names: str) -> bool:
        """Tell whether the rows have all these columns."""
        return set(names) <= set(self.columns)

    def require(self, names: Iterable[str], remedy: str, known: Iterable[str] = ()) -> None:
        """Raise InputError, with the line of the header, for the first column that is missing.

        `known` are the column names that the message lists as existing; by default those of the
        header.
        """
        columns = tuple(known) or self.columns
        listed = (self.separator or " ").join(columns)
        for name in names:
            if name not in columns:
                problem = f"no column {name} among {quote(listed)}"
                refuse(
                    self.path,
                    "no_column",
                    problem,
                    remedy=remedy,
                    line=self.line - 1,
                    column=name,
                )

    def refuse(
        self,
        wrong: Bools,
        code: str,
        problem: str | Callable[[int], str],
        reason: str = "",
        remedy: str = "",
        column: str = "",
    ) -> None:
        """Raise InputError, with the line, for the first row where `wrong` (n,) is True.

        `problem` may be a function of the row's index, from 0.
        """
        if not wrong.any():
            return
        row = int(np.argmax(wrong))
        text = problem if isinstance(problem, str) else problem(row)
        refuse(self.path, code, text, reason, remedy, line=self.line + row, column=column)

    def sort_unique(
        self, keys: Ints, problem: Callable[[int], str], remedy: str, column: str = ""
    ) -> Ints:
        """Return the order (n,) that sorts the keys (n,).

        Raises InputError, with the line of the second row, if two rows have the same key; `problem`
        is a function of the first row's index.
        """
        order = np.argsort(keys, kind="stable")
        repeated = np.flatnonzero(np.diff(keys[order]) == 0)
        if len(repeated):
            first = order[repeated[0]]
            second = order[repeated[0] + 1]
            line = self.line + second
            refuse(
                self.path, "repeated_row", problem(first), remedy=remedy, line=line, column=column
            )
        return order

    def read(self, *names: str) -> Floats:
        """Return the numbers (n, k) of the k named columns.

        Raises InputError, with line and column, for the first entry that is not a finite number.
        """
        indices = [self.columns.index(name) for name in names]
        if not self.texts:
            return np.empty((0, len(indices)))
        try:
            table = parse_columns(self.texts, indices, self.separator)
        except (ValueError, IndexError):
            self._refuse_first_fault(names, indices)
        if len(table) < len(self.texts):  # empty lines are left out, which shifts all rows
            self._refuse_first_fault(names, indices)
        not_finite = np.argwhere(~np.isfinite(table))
        if len(not_finite):
            row, column = (int(index) for index in not_finite[0])
            problem = f"{table[row, column]} is no finite number"
            refuse(
                self.path,
                "not_finite",
                problem,
                remedy="mend the export",
                line=self.line + row,
                column=names[column],
            )
        return table

    def read_groups(self, groups: Mapping[str, Sequence[str]]) -> dict[str, Floats]:
        """Return the numbers (n, k) of each group of k columns that is complete in the file."""
        complete = {name: columns for name, columns in groups.items() if self.has(*columns)}
        table = self.read(*itertools.chain(*complete.values()))
        ends = np.cumsum([len(columns) for columns in complete.values()])
        return dict(zip(complete, np.split(table, ends[:-1], axis=1), strict=True))

    def to_integers(self, numbers: Floats, column: str) -> Ints:
        """Return these numbers (n,) of a column as integers.

        Raises InputError, with the line, for a number that is not a whole number below 2^53.
        """
        wrong = (numbers != np.round(numbers)) | (abs(numbers) > MAX_EXACT_INTEGER)
        self.refuse(
            wrong,
            "not_an_integer",
            lambda row: f"{numbers[row]:.17g} is no whole number",
            remedy="write ids and types as they are",
            column=column,
        )
        return numbers.astype(np.int64)

    def count_digits(self, *names: str) -> int:
        """Return the largest number of significant digits in these columns of the first rows."""
        indices = [self.columns.index(name) for name in names]
        texts = []
        for row in self.texts[:SAMPLED_ROWS]:
            words = row.split(self.separator)
            texts += [words[index] for index in indices if index < len(words)]
        return count_significant_digits(texts)

    def _refuse_first_fault(self, names: Sequence[str], indices: Sequence[int]) -> NoReturn:
        """Raise InputError for the first row that cannot be read as numbers."""
        for line, text in enumerate(self.texts, self.line):
            words = text.split(self.separator)
            if not "".join(words).strip():
                problem = "an empty line between the rows"
                refuse(self.path, "empty_line", problem, remedy="take it out", line=line)
            for name, index in zip(names, indices, strict=True):
                if index >= len(words):
                    problem = f"has {len(words)} columns, the header names {len(self.columns)}"
                    remedy = "let the program write whole rows"
                    refuse(self.path, "short_row", problem, remedy=remedy, line=line, column=name)
                try:
                    float(words[index])
                except ValueError:
                    problem = f"{quote(words[index].strip())} is no number"
                    remedy = "write numbers there"
                    refuse(
                        self.path, "not_a_number", problem, remedy=remedy, line=line, column=name
                    )
        problem = "its rows cannot be read as numbers"
        refuse(self.path, "not_a_number", problem, remedy="write it again", line=self.line)
