"""Text files: rows of numbers, the words of a line, and one line that says what is at fault."""

import gzip
import io
import itertools
import math
import sys
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any, NoReturn, cast

import numpy as np

from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError
from modal.tools.memory import memory_at_hand

SHOWN = 60
"""Characters of a file that a message quotes."""
SHORT_MANTISSA_BITS = 16
"""Numbers that need no more bits are exact: of those rounded to the 24 bits of single precision
one in 2^8 needs as few."""
MAX_LINE_CHARACTERS = 1_000_000
"""Rows have at most some hundred numbers, lines of a script some thousand characters."""
MAX_SHARE_OF_MEMORY = 0.5
"""Of the free memory, for the texts of rows: their numbers take about as much again."""
BYTES_BESIDE_A_TEXT = 64
"""What Python takes for a text beside its characters, and for its place in a list."""
LOOKED_AT = 500
"""Rows whose texts are looked at for the number of digits that a program has written."""


def fault(
    path: str | Path, what: str, do: str, line: int = 0, column: str = "", *, code: str = "input"
) -> NoReturn:
    """InputError in one line: file, line (from 1) and column where known, fault, remedy."""
    where = f", line {line}" if line else ""
    if column:
        where += f", column {column}"
    raise InputError(code, f"{path}{where}: {what}", remedy=do)


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
    """Yield number, from 1, and text of each line, without the byte order mark of a spreadsheet.

    InputError for a line that is too long to be one of numbers, before it fills the memory.
    """
    with open_bytes(path) as file, io.TextIOWrapper(file, "utf-8-sig", "replace") as text:
        next_part = partial(text.readline, MAX_LINE_CHARACTERS)
        for number, line in enumerate(iter(next_part, ""), 1):
            if len(line) == MAX_LINE_CHARACTERS and not line.endswith("\n"):
                what = f"more than {MAX_LINE_CHARACTERS:,} characters in one line"
                fault(path, what, "give a text file, a row in each line", number, code="long_line")
            yield number, line


def kept_lines(path: str | Path, lines: Iterator[tuple[int, str]], count: int) -> list[str]:
    """Return the texts of the next `count` lines, or of those that are left.

    A line that begins with ITEM: ends them, as the next header of a dump. InputError where the file
    has more than the memory holds, whatever it says that it has: an archive may be short.
    """
    room = MAX_SHARE_OF_MEMORY * memory_at_hand()
    taken = 0
    texts: list[str] = []
    for number, text in itertools.islice(lines, min(count, sys.maxsize)):
        if text.startswith("ITEM:"):
            break
        taken += len(text) + BYTES_BESIDE_A_TEXT
        if taken > room:
            what = f"its rows fill {taken:.2g} bytes, more than half of the memory that is free"
            do = "take a smaller packing, or a machine with more memory"
            fault(path, what, do, number, code="too_large")
        texts.append(text)
    return texts


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
                fault(self.path, what, do, self.line - 1, name, code="no_column")

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
    """Return the most significant digits among numbers as they are written; 7 for rounded float32.

    >>> significant_digits(["0.01200", "1.25e-3", "7"]), significant_digits(["0.10000000149011612"])
    (4, 7)
    >>> significant_digits(["5.0000000000000000e-01"])  # half is a float32, but none was rounded
    17
    """
    most, numbers = written_digits(texts), []
    for text in texts:
        try:
            numbers.append(float(text))
        except ValueError:
            continue
    values = np.array([value for value in numbers if abs(value) < 1e38])
    if most > 8 and len(values) and _rounded_to_float32(values):
        return 7
    return most


def written_digits(texts: Iterable[str]) -> int:
    """Return the most digits that stand in a number, leading zeros left out."""
    mantissas = (text.strip().lower().partition("e")[0].lstrip("+-") for text in texts)
    return max((len(each.replace(".", "").lstrip("0")) for each in mantissas), default=1) or 1


def _rounded_to_float32(values: Floats) -> bool:
    """Whether numbers (n,) were rounded to single precision: all fit in it, some need its end.

    Numbers such as 8 or 0.375 fit in any precision, so they tell nothing.
    """
    if (values.astype(np.float32) != values).any():
        return False
    mantissa, _ = np.frexp(values)
    scaled = mantissa * 2.0**SHORT_MANTISSA_BITS
    return bool((scaled != np.round(scaled)).any())


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


class Words:
    """The words that are `left` of a line; `where` and what to `do` stand in messages about it.

    >>> line = Words("zplane 0 NULL type 2".split(), "--wall", "give type N zplane LOW HIGH")
    >>> line.numbers("zplane", 2, null=True), line.number("type")
    ([0.0, nan], 2.0)
    """

    def __init__(self, words: Iterable[str], where: str, do: str) -> None:
        self.left, self.where, self.do = list(words), where, do

    def __contains__(self, word: str) -> bool:
        return word in self.left

    def refuse(self, what: str, do: str = "", *, code: str = "input") -> NoReturn:
        """InputError about this line."""
        fault(self.where, what, do or self.do, code=code)

    def next(self, what: str, known: Iterable[str] = ()) -> str:
        """The next word, which is `what`, one of those that are `known`; it is no longer left."""
        if not self.left:
            self.refuse(f"ends where {what} should stand")
        word = self.left.pop(0)
        if known and word not in known:
            self.refuse(f"{what} {word!r} is not known", f"give {', '.join(known)}")
        return word

    def in_turn(self, what: str, count: int, *, null: bool = False) -> list[float]:
        """The next `count` words as numbers, those of `what`; they are no longer left."""
        words = [self.next(f"a number of {what}") for _ in range(count)]
        return self.converted(what, words, null=null)

    def alone(self, what: str, count: int, *, null: bool = False) -> list[float]:
        """All words, which are `count` numbers."""
        numbers = self.in_turn(what, count, null=null)
        if self.left:
            self.refuse(f"{what} has more than {count} numbers")
        return numbers

    def behind(self, name: str, count: int) -> list[str]:
        """The `count` words behind a name, which all stay."""
        if name not in self.left:
            self.refuse(f"no {name} in it")
        at = self.left.index(name) + 1
        words = self.left[at : at + count]
        if len(words) < count:
            self.refuse(f"{name} lacks words behind it")
        return words

    def numbers(self, name: str, count: int, *, null: bool = False) -> list[float]:
        """The `count` numbers behind a name; with `null` a word NULL is no number, NaN."""
        return self.converted(name, self.behind(name, count), null=null)

    def converted(self, name: str, words: Iterable[str], *, null: bool = False) -> list[float]:
        """These words as numbers, which are those of a `name`."""
        numbers = []
        for word in words:
            try:
                number = math.nan if null and word.upper() == "NULL" else float(word)
            except ValueError:
                self.refuse(f"{name} {shown(word)} is no number")
            if not (math.isfinite(number) or word.upper() == "NULL"):
                self.refuse(f"{name} {shown(word)} is no finite number")
            numbers.append(number)
        return numbers

    def number(self, name: str) -> float:
        """The number behind a name."""
        return self.numbers(name, 1)[0]

    def first(self, *names: str) -> float:
        """The number behind the first of these names that is there, or 0."""
        return next((self.number(name) for name in names if name in self.left), 0.0)
