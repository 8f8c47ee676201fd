"""Read text files: line by line, and many rows at once."""

import gzip
import sys
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, cast

import numpy as np

from modal.exchange.refusals import refuse
from modal.exchange.row_texts import RowTexts
from modal.tools.arrays import Ints
from modal.tools.memory import memory_at_hand

MAX_LINE_BYTES = 1_000_000
"""Largest length of a line. Rows have some hundred characters, lines of a script some thousand."""
BLOCK_BYTES = 1 << 22
"""Number of bytes that are read together: more than a line may have."""
MAX_MEMORY_SHARE = 0.25
"""Largest share of the free memory for the texts of rows. They are joined from parts, which doubles
them, and their numbers take as much again."""
INDEX_BYTES = 8
"""Memory for the place where a row ends."""
BYTE_ORDER_MARK = b"\xef\xbb\xbf"
HEADER = b"ITEM:"
"""How a header of a dump begins."""


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


def _read_blocks(path: str | Path) -> Iterator[bytes]:
    """Yield the text of a file in blocks of whole lines, which end in line feeds.

    A byte order mark is left out. Of a line that is longer than a line may be, the beginning is a
    block.
    """
    with open_bytes(path) as file:
        text = b""
        data = file.read(BLOCK_BYTES).removeprefix(BYTE_ORDER_MARK)
        while data:
            while data.endswith(b"\r") and (following := file.read(1)):
                data += following
            text += data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            end = text.rfind(b"\n") + 1
            if not end and len(text) > MAX_LINE_BYTES:
                end = len(text)
            if end:
                yield text[:end]
                text = text[end:]
            data = file.read(BLOCK_BYTES)
        if text:
            yield text


class Lines(Iterator[tuple[int, str]]):
    """The number, from 1, and the text of each line of a file, without a byte order mark.

    Raises InputError for a very long line, which cannot be a line of numbers, before it fills the
    memory.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = path
        self._blocks = _read_blocks(path)
        self._block = b""
        self._place = 0  # in the block: where the next line begins
        self._previous_place = 0  # where the line begins that was returned last
        self._count = 0  # of the lines that were taken

    def __next__(self) -> tuple[int, str]:
        if not self._has_further():
            raise StopIteration
        self._previous_place = self._place
        end = self._block.find(b"\n", self._place) + 1 or len(self._block)
        text = self._take(np.array([end]))
        return self._count, text.decode("utf-8", "replace")

    def step_back(self) -> None:
        """Let the line that was returned last be the next one again."""
        self._place = self._previous_place
        self._count -= 1

    def take_rows(self, count: int = sys.maxsize) -> RowTexts:
        """Return the texts of the next `count` lines, or of all lines that are left.

        The header of a dump ends the rows. Raises InputError if the rows do not fit into the
        memory; a short archive may unpack to any length.
        """
        allowed_bytes = MAX_MEMORY_SHARE * memory_at_hand()
        texts: list[bytes] = []
        ends_of_texts: list[Ints] = [np.zeros(0, np.int64)]
        size = 0
        first = self._count
        while self._count - first < count and self._has_further():
            ends = self._ends_of_rows()[: count - (self._count - first)]
            if not len(ends):
                break
            ends_of_texts.append(ends - self._place + size)
            texts.append(self._take(ends))
            size += len(texts[-1])
            used_bytes = size + INDEX_BYTES * (self._count - first)
            if used_bytes > allowed_bytes:
                problem = (
                    f"its rows fill {used_bytes:.2g} bytes, more than a quarter of the free memory"
                )
                remedy = "take a smaller packing, or a machine with more memory"
                refuse(self.path, "too_large", problem, remedy=remedy, line=self._count)
        return RowTexts(b"".join(texts), np.concatenate(ends_of_texts))

    def _has_further(self) -> bool:
        """Tell whether there is a further line; read the next block if it is not in this one."""
        if self._place == len(self._block):
            self._block = next(self._blocks, b"")
            self._place = 0
        return self._place < len(self._block)

    def _ends_of_rows(self) -> Ints:
        """Return where the lines that are left in the block end, up to a header."""
        limit = len(self._block)
        if self._block.startswith(HEADER, self._place):
            limit = self._place
        elif (line_feed := self._block.find(b"\n" + HEADER, self._place)) >= 0:
            limit = line_feed + 1
        text = np.frombuffer(self._block, np.uint8)[self._place : limit]
        ends: Ints = np.flatnonzero(text == ord("\n")) + self._place + 1
        if len(text) and text[-1] != ord("\n"):
            return np.append(ends, limit)
        return ends

    def _take(self, ends: Ints) -> bytes:
        """Return the text of the next lines, which end at these places, and step behind them.

        Raises InputError for a line that is too long.
        """
        lengths = np.diff(ends, prepend=self._place)
        longest = int(lengths.argmax())
        if lengths[longest] > MAX_LINE_BYTES:
            problem = f"more than {MAX_LINE_BYTES:,} characters in one line"
            remedy = "give a text file, a row in each line"
            line = self._count + longest + 1
            refuse(self.path, "long_line", problem, remedy=remedy, line=line)
        text = self._block[self._place : int(ends[-1])]
        self._place = int(ends[-1])
        self._count += len(ends)
        return text
