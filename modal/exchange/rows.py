"""Tables of numbers in text files, and the one line that says where such a file is at fault."""

from __future__ import annotations

import gzip
import io
import itertools
import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NoReturn, cast

import numpy as np

from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError

SHOWN = 60
"""Characters of a file that a message quotes."""
LOOKED_AT = 500
"""Rows whose texts are looked at for the number of digits that a program has written."""


def fault(path: str | Path, what: str, do: str, line: int = 0, column: str = "") -> NoReturn:
    """InputError in one line: file, line (from 1) and column where known, fault, remedy."""
    where = f", line {line}" * bool(line) + f", column {column}" * bool(column)
    raise InputError(f"{path}{where}: {what}; {do}")


def shown(text: str) -> str:
    """What stands in a file, for a message: cut, and without the bytes that a terminal obeys."""
    return repr(text[:SHOWN]) + "..." * (len(text) > SHOWN)


@contextmanager
def open_bytes(path: str | Path) -> Iterator[IO[bytes]]:
    """The file as bytes, unpacked where its name ends in .gz.

    InputError where there is none, and where reading fails while it is open: an archive that was
    cut off says so at its end alone.
    """
    try:
        with gzip.open(path, "rb") if str(path).endswith(".gz") else open(path, "rb") as file:
            yield cast(IO[bytes], file)
    except (OSError, EOFError, zlib.error) as error:
        if isinstance(error, OSError) and error.strerror:
            fault(path, error.strerror, "check the name")
        fault(path, str(error), "the archive is damaged, write it again")


def text_lines(path: str | Path) -> Iterator[tuple[int, str]]:
    """Number, from 1, and text of each line, without the byte order mark of a spreadsheet."""
    with open_bytes(path) as file, io.TextIOWrapper(file, "utf-8-sig", "replace") as text:
        yield from enumerate(text, 1)


@dataclass(frozen=True)
class Rows:
    """Rows of named columns in a text file: their texts, and the number of the first, from 1.

    `separator` None for blanks.
    """

    path: Path
    columns: tuple[str, ...]
    texts: Sequence[str]
    line: int
    separator: str | None = None

    def has(self, *names: str) -> bool:
        """Whether all these columns are there."""
        return set(names) <= set(self.columns)

    def require(self, names: Iterable[str], do: str, had: Iterable[str] = ()) -> None:
        """InputError for the first of these columns that is not among those that it `had`.

        By default its own; the line is that of the header.
        """
        columns, by = tuple(had) or self.columns, self.separator or " "
        for name in names:
            if name not in columns:
                what = f"no column {name} among {shown(by.join(columns))}"
                fault(self.path, what, do, self.line - 1, name)

    def refuse(
        self, wrong: Bools, what: str | Callable[[int], str], do: str, column: str = ""
    ) -> None:
        """InputError, with its line, for the first row that is `wrong` (n,)."""
        if wrong.any():
            row = int(np.argmax(wrong))
            text = what if isinstance(what, str) else what(row)
            fault(self.path, text, do, self.line + row, column)

    def rising(self, keys: Ints, what: Callable[[int], str], do: str, column: str = "") -> Ints:
        """The order (n,) in which the keys rise; InputError where one stands twice.

        `what` says which it is, of the row where it stands first.
        """
        order = np.argsort(keys, kind="stable")
        again = np.flatnonzero(np.diff(keys[order]) == 0)
        if len(again):
            first, second = order[again[0]], order[again[0] + 1]
            fault(self.path, what(first), do, self.line + second, column)
        return order

    def read(self, *names: str) -> Floats:
        """Shape (n, k): the columns of these names as numbers; InputError says which is not."""
        at = [self.columns.index(name) for name in names]
        if not self.texts:
            return np.empty((0, len(at)))
        how: dict[str, Any] = {"comments": None, "delimiter": self.separator, "ndmin": 2}
        try:
            table = np.loadtxt(self.texts, usecols=at, **how)
        except (ValueError, IndexError):
            self._blame(names, at)
        if len(table) < len(self.texts):  # empty lines, which shift all rows
            self._blame(names, at)
        bad = np.argwhere(~np.isfinite(table))
        if len(bad):
            row, column = (int(k) for k in bad[0])
            what = f"{table[row, column]} is no finite number"
            fault(self.path, what, "mend the export", self.line + row, names[column])
        return table

    def parts(self, groups: Mapping[str, Sequence[str]]) -> dict[str, Floats]:
        """Shape (n, k) each: those groups of k columns that are there, read at once."""
        whole = {what: names for what, names in groups.items() if self.has(*names)}
        table = self.read(*itertools.chain(*whole.values()))
        at = np.cumsum([len(names) for names in whole.values()])
        return dict(zip(whole, np.split(table, at[:-1], axis=1), strict=True))

    def whole(self, numbers: Floats, column: str) -> Ints:
        """These numbers (n,) of a column as integers; InputError says which is none."""
        wrong = (numbers != np.round(numbers)) | (abs(numbers) > 2**53)
        do = "write ids and types as they are"
        self.refuse(wrong, lambda k: f"{numbers[k]:.17g} is no whole number", do, column)
        return numbers.astype(np.int64)

    def digits(self, *names: str) -> int:
        """Most significant digits that a number of these columns has in the first rows."""
        at = [self.columns.index(name) for name in names]
        rows = (text.split(self.separator) for text in self.texts[:LOOKED_AT])
        return significant_digits([row[k] for row in rows for k in at if k < len(row)])

    def _blame(self, names: Sequence[str], at: Sequence[int]) -> NoReturn:
        for here, text in enumerate(self.texts, self.line):
            words = text.split(self.separator)
            if not "".join(words).strip():
                fault(self.path, "an empty line between the rows", "take it out", here)
            for name, column in zip(names, at, strict=True):
                if column >= len(words):
                    what = f"has {len(words)} columns, the header names {len(self.columns)}"
                    fault(self.path, what, "let the program write whole rows", here, name)
                try:
                    float(words[column])
                except ValueError:
                    what = f"{shown(words[column].strip())} is no number"
                    fault(self.path, what, "write numbers there", here, name)
        fault(self.path, "its rows cannot be read as numbers", "write it again", self.line)


def significant_digits(texts: Sequence[str]) -> int:
    """Most significant digits among numbers as they are written; a float32 counts as 7.

    >>> significant_digits(["0.01200", "1.25e-3", "7"]), significant_digits(["0.10000000149011612"])
    (4, 7)
    """
    most, numbers = 1, []
    for text in texts:
        mantissa = text.strip().lower().partition("e")[0].lstrip("+-").replace(".", "")
        most = max(most, len(mantissa.lstrip("0")))
        try:
            numbers.append(float(text))
        except ValueError:
            continue
    values = np.array([value for value in numbers if abs(value) < 1e38])
    if most > 8 and len(values) and (values.astype(np.float32) == values).all():
        return 7
    return most


def last_step(values: Floats, digits: int) -> float:
    """Unit of the last of `digits` significant digits of the largest of these numbers.

    >>> last_step(np.array([0.0144, 0.002]), 6)
    1e-07
    """
    largest = float(abs(values).max(initial=0.0))
    if largest == 0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(largest)) - digits + 1)
    return max(float(unit), float(np.spacing(largest)))
