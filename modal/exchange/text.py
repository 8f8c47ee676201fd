"""Read text files by lines and rows of numbers; name file, line and column in errors."""

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
from typing import IO, NamedTuple, NoReturn, cast

import numpy as np

from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError
from modal.tools.memory import memory_at_hand

MAX_QUOTED_CHARACTERS = 60
"""Largest number of characters of a file that a message quotes."""
SHORT_MANTISSA_BITS = 16
"""Number of bits; a number whose mantissa fits into these bits counts as exact. Of numbers that
were rounded to the 24 bits of single precision only one in 2^8 has so short a mantissa."""
MAX_LINE_CHARACTERS = 1_000_000
"""Largest number of characters of a line. Rows have some hundred characters, lines of a script some
thousand."""
MAX_MEMORY_SHARE = 0.5
"""Largest share of the free memory for the texts of rows: their numbers take as much again."""
TEXT_OVERHEAD_BYTES = 64
"""Memory that Python needs for a text in a list, beside the characters of the text."""
SAMPLED_ROWS = 500
"""Number of rows whose texts show how many digits a program has written."""
MIN_DOUBLE_PRECISION_DIGITS = 9
"""Least number of significant digits of a number that needs double precision."""
SINGLE_PRECISION_DIGITS = 7
"""Significant decimal digits of a number in single precision."""
MAX_SINGLE_PRECISION = 1e38
"""Number above which numbers overflow in single precision."""
MAX_EXACT_INTEGER = 2**53
"""Largest whole number up to which double precision holds every whole number."""


def refuse(
    path: str | Path,
    code: str,
    problem: str,
    reason: str = "",
    remedy: str = "",
    *,
    line: int = 0,
    column: str = "",
) -> NoReturn:
    """Raise InputError with the place of the fault before the problem.

    Parameters
    ----------
    path : str or Path
        The file, or the option that is at fault.
    code, problem, reason, remedy : str
        As in `InputError`.
    line : int
        Number of the line, from 1; 0 if it is not known.
    column : str
        Name of the column; empty if it is not known.
    """
    place = str(path)
    if line:
        place += f", line {line}"
    if column:
        place += f", column {column}"
    raise InputError(code, f"{place}: {problem}", reason, remedy)


class Refusal(NamedTuple):
    """A refusal that is stored until it is clear whether the fault matters.

    place: the file and the line, or the option. The other fields are those of `InputError`.
    """

    place: str
    code: str
    problem: str
    reason: str = ""
    remedy: str = ""

    def raise_error(self) -> NoReturn:
        """Raise the InputError."""
        refuse(*self)


def quote(text: str) -> str:
    """Return the beginning of a text in quotes, with control characters as escapes."""
    quoted = repr(text[:MAX_QUOTED_CHARACTERS])
    if len(text) > MAX_QUOTED_CHARACTERS:
        quoted += "..."
    return quoted


@contextmanager
def open_bytes(path: str | Path) -> Iterator[IO[bytes]]:
    """Open a file for reading bytes; unpack it if its name ends in .gz.

    Raises InputError if the file cannot be opened, or if reading fails inside the block: a
    truncated archive is noticed only at its end.
    """
    try:
        with gzip.open(path, "rb") if str(path).endswith(".gz") else open(path, "rb") as file:
            yield cast(IO[bytes], file)
    except (OSError, EOFError, zlib.error) as error:
        if isinstance(error, OSError) and error.strerror:
            refuse(path, "unreadable", error.strerror, remedy="check the name")
        remedy = "the archive is damaged, write it again"
        refuse(path, "damaged_archive", str(error), remedy=remedy)


def read_lines(path: str | Path) -> Iterator[tuple[int, str]]:
    """Yield the number, from 1, and the text of each line, without a byte order mark.

    Raises InputError for a very long line, which cannot be a line of numbers, before it fills the
    memory.
    """
    with open_bytes(path) as file, io.TextIOWrapper(file, "utf-8-sig", "replace") as text:
        next_part = partial(text.readline, MAX_LINE_CHARACTERS)
        for number, line in enumerate(iter(next_part, ""), 1):
            if len(line) == MAX_LINE_CHARACTERS and not line.endswith("\n"):
                problem = f"more than {MAX_LINE_CHARACTERS:,} characters in one line"
                remedy = "give a text file, a row in each line"
                refuse(path, "long_line", problem, remedy=remedy, line=number)
            yield number, line


def take_rows(path: str | Path, lines: Iterator[tuple[int, str]], count: int) -> list[str]:
    """Return the texts of the next `count` lines, or of all lines that are left.

    A line that begins with ITEM: ends the rows, because it is the next header of a dump. Raises
    InputError if the rows do not fit into the memory; a short archive may unpack to any length.
    """
    allowed_bytes = MAX_MEMORY_SHARE * memory_at_hand()
    used_bytes = 0
    texts: list[str] = []
    for number, text in itertools.islice(lines, min(count, sys.maxsize)):
        if text.startswith("ITEM:"):
            break
        used_bytes += len(text) + TEXT_OVERHEAD_BYTES
        if used_bytes > allowed_bytes:
            refuse(
                path,
                "too_large",
                f"its rows fill {used_bytes:.2g} bytes, more than half of the memory that is free",
                remedy="take a smaller packing, or a machine with more memory",
                line=number,
            )
        texts.append(text)
    return texts


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
            table: Floats = np.loadtxt(
                self.texts, usecols=indices, comments=None, delimiter=self.separator, ndmin=2
            )
        except (ValueError, IndexError):
            self._refuse_first_fault(names, indices)
        if len(table) < len(self.texts):  # loadtxt skips empty lines, which shifts all rows
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


def count_significant_digits(texts: Sequence[str]) -> int:
    """Return the largest number of significant digits in texts; 7 for single precision.

    >>> count_significant_digits(["0.01200", "1.25e-3", "7"])
    4
    >>> count_significant_digits(["0.10000000149011612"])
    7
    >>> count_significant_digits(["5.0000000000000000e-01"])  # exact in any precision
    17
    """
    digits = count_written_digits(texts)
    if digits < MIN_DOUBLE_PRECISION_DIGITS:
        return digits
    numbers = []
    for text in texts:
        try:
            number = float(text)
        except ValueError:
            continue
        if abs(number) < MAX_SINGLE_PRECISION:
            numbers.append(number)
    if numbers and are_rounded_to_single_precision(np.array(numbers)):
        return SINGLE_PRECISION_DIGITS
    return digits


def count_written_digits(texts: Iterable[str]) -> int:
    """Return the largest number of digits in a text, without leading zeros; at least 1."""
    most = 1
    for text in texts:
        mantissa = text.strip().lower().partition("e")[0].lstrip("+-")
        most = max(most, len(mantissa.replace(".", "").lstrip("0")))
    return most


def are_rounded_to_single_precision(values: Floats) -> bool:
    """Tell whether numbers (n,) were rounded to single precision.

    All numbers must fit into single precision, and at least one must use the last bits of its
    mantissa: numbers such as 8 or 0.375 are exact in any precision and prove nothing.
    """
    if (values.astype(np.float32) != values).any():
        return False
    mantissa, _ = np.frexp(values)
    scaled = mantissa * 2.0**SHORT_MANTISSA_BITS
    return bool((scaled != np.round(scaled)).any())


def last_digit_unit(values: Floats, digits: int) -> float:
    """Return the unit of the last of `digits` significant digits of the largest number.

    >>> last_digit_unit(np.array([0.0144, 0.002]), 6)
    1e-07
    """
    largest = float(abs(values).max(initial=0.0))
    if largest == 0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(largest)) - digits + 1)
    return max(float(unit), float(np.spacing(largest)))


class Words:
    """The words of a line, which are taken one by one or looked up by the name before them.

    Attributes
    ----------
    remaining : list of str
        The words that have not been taken.
    place : str
        File and line, for messages.
    remedy : str
        The remedy of error messages, unless a call of `refuse` has another one.

    Examples
    --------
    >>> line = Words("zplane 0 NULL type 2".split(), "--wall", "give type N zplane LOW HIGH")
    >>> line.numbers_after("zplane", 2, null=True), line.number_after("type")
    ([0.0, nan], 2.0)
    """

    def __init__(self, words: Iterable[str], place: str, remedy: str) -> None:
        self.remaining = list(words)
        self.place = place
        self.remedy = remedy

    def __contains__(self, word: str) -> bool:
        return word in self.remaining

    def refuse(self, code: str, problem: str, reason: str = "", remedy: str = "") -> NoReturn:
        """Raise InputError about this line."""
        refuse(self.place, code, problem, reason, remedy or self.remedy)

    def take(self, name: str, known: Iterable[str] = ()) -> str:
        """Remove the next word and return it.

        `name` describes the word in error messages. Raises InputError if there is no word, or if it
        is not one of the `known` words.
        """
        if not self.remaining:
            self.refuse("missing_word", f"ends where {name} should stand")
        word = self.remaining.pop(0)
        if known and word not in known:
            remedy = f"give {', '.join(known)}"
            self.refuse("unknown_word", f"{name} {word!r} is not known", remedy=remedy)
        return word

    def take_numbers(self, name: str, count: int, *, null: bool = False) -> list[float]:
        """Remove the next `count` words and return them as numbers; `null` as in `to_numbers`."""
        words = [self.take(f"a number of {name}") for _ in range(count)]
        return self.to_numbers(name, words, null=null)

    def take_only_numbers(self, name: str, count: int, *, null: bool = False) -> list[float]:
        """Remove `count` numbers and return them; raise InputError if further words follow."""
        numbers = self.take_numbers(name, count, null=null)
        if self.remaining:
            self.refuse("further_words", f"{name} has more than {count} numbers")
        return numbers

    def words_after(self, name: str, count: int) -> list[str]:
        """Return the `count` words that follow a name; raise InputError if they are missing."""
        if name not in self.remaining:
            self.refuse("missing_word", f"no {name} in it")
        first = self.remaining.index(name) + 1
        words = self.remaining[first : first + count]
        if len(words) < count:
            self.refuse("missing_word", f"{name} lacks words behind it")
        return words

    def numbers_after(self, name: str, count: int, *, null: bool = False) -> list[float]:
        """Return the `count` numbers after a name; `null` as in `to_numbers`."""
        return self.to_numbers(name, self.words_after(name, count), null=null)

    def number_after(self, name: str) -> float:
        """Return the number after a name; raise InputError if it is missing."""
        return self.numbers_after(name, 1)[0]

    def optional_number_after(self, *names: str) -> float:
        """Return the number after the first of these names that the line has; 0 if it has none."""
        for name in names:
            if name in self.remaining:
                return self.number_after(name)
        return 0.0

    def to_numbers(self, name: str, words: Iterable[str], *, null: bool = False) -> list[float]:
        """Return these words as numbers; with `null` the word NULL stands for NaN.

        Raises InputError, with the `name`, for a word that is not a finite number.
        """
        numbers = []
        for word in words:
            if null and word.upper() == "NULL":
                numbers.append(math.nan)
                continue
            try:
                number = float(word)
            except ValueError:
                self.refuse("not_a_number", f"{name} {quote(word)} is no number")
            if not math.isfinite(number):
                self.refuse("not_finite", f"{name} {quote(word)} is no finite number")
            numbers.append(number)
        return numbers
